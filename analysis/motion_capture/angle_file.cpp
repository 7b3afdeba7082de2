#include "analysis/motion_capture/angle_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/trial_index.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

enum Column { condition, trial, time_s, angle_rad };
constexpr CsvColumn angle_columns[] = {{"condition"}, {"trial", true}, {"time_s", true}, {"angle_rad", true}};
constexpr CsvColumn trial_columns[] = {{"condition"}, {"trial", true}, {"outcome", true}};

bool even(const std::vector<double>& values, double room) {
  const double step = (values.back() - values.front()) / static_cast<double>(values.size() - 1);
  for (std::size_t i = 1; i < values.size(); ++i)
    if (!(std::abs(values[i] - values[i - 1] - step) < room * std::abs(step))) return false;
  return step > 0;
}

// Says whether the angle is what only a clock shows, over enough frames, and the time is not.
bool exchanged(const AngleRecording& recording) {
  constexpr std::size_t enough = 20;
  return recording.time.size() >= enough && even(recording.angle_rad, 0.02) && !even(recording.time, 0.05);
}

// Frames that are missing or doubled would bend the derivative where nothing happened.
void check_frames(const MeasuredAngle& angle, const std::vector<std::size_t>& lines, const std::string& file,
                  Defects& defects) {
  const std::vector<double>& time = angle.recording.time;
  if (time.size() < 2) {
    defects.add(file, {lines.front(), 1}, fmt::format("trial {} has one frame only", angle.number));
    return;
  }
  std::vector<double> interval(time.size() - 1);
  for (std::size_t i = 0; i + 1 < time.size(); ++i) interval[i] = time[i + 1] - time[i];
  const double frame = median(interval);
  if (exchanged(angle.recording)) {
    defects.add(file, {lines.front(), 1},
                fmt::format("trial {}: time_s is uneven and angle_rad rises in even steps: the columns are exchanged",
                            angle.number));
    return;
  }
  for (std::size_t i = 0; i < interval.size(); ++i) {
    if (interval[i] <= 0)
      defects.add(file, {lines[i + 1], 1},
                  fmt::format("time_s: {} s is not after the frame before ({} s)", time[i + 1], time[i]));
    else if (frame > 0 && std::abs(interval[i] - frame) > frame / 4)
      defects.add(
          file, {lines[i + 1], 1},
          fmt::format("time_s: {:.6g} s after the frame before where trial {} has {:.6g} s; frames must follow evenly",
                      interval[i], angle.number, frame));
  }
}

}  // namespace

std::vector<MeasuredAngle> parse_angles(const ExperimentSource& source, const Experiment& description) {
  const auto name = [&](const char* file) {
    return source.folder.empty() ? std::string(file) : (std::filesystem::path(source.folder) / file).string();
  };
  const std::string angle_file = name("angle.csv"), trials_file = name("trials.csv");
  Defects defects;
  if (!source.angle_csv) {
    defects.add(angle_file, {}, "there is no such file");
    defects.check();
  }
  Experiment conditions = description;
  TrialIndex index(conditions, TrialIndex::Rows::several, true);
  CsvReader csv(angle_file, *source.angle_csv, angle_columns, defects);
  std::vector<MeasuredAngle> angles;
  std::vector<std::vector<std::size_t>> lines;  // of each frame
  while (csv.next()) {
    const std::optional<std::size_t> at = index.row(csv, condition, trial);
    std::optional<double> time, angle;
    const bool timed = csv.read(time_s, dynamics::range::time, time),
               turned = csv.read(angle_rad, dynamics::range::turned, angle);
    if (!at) continue;
    if (*at == angles.size()) {
      angles.push_back({index.entries()[*at].number, index.entries()[*at].condition, {}});
      lines.emplace_back();
    }
    if (!timed || !turned) continue;
    angles[*at].recording.time.push_back(*time);
    angles[*at].recording.angle_rad.push_back(*angle);
    lines[*at].push_back(csv.line());
  }
  if (defects.empty()) {
    if (angles.empty()) defects.add(angle_file, {}, "holds no frame");
    for (std::size_t t = 0; t < angles.size(); ++t) check_frames(angles[t], lines[t], angle_file, defects);
  }
  if (source.trials_csv) {
    TrialIndex outcomes(conditions, TrialIndex::Rows::one, true);
    CsvReader rows(trials_file, *source.trials_csv, trial_columns, defects);
    while (rows.next()) outcomes.row(rows, 0, 1);
    if (csv.complete() && rows.complete() && index.complete() && outcomes.complete()) {
      index.report_missing(outcomes, angle_file, trials_file, defects);
      outcomes.report_missing(index, trials_file, angle_file, defects);
    }
  }
  defects.check();
  std::ranges::sort(angles, {}, &MeasuredAngle::number);
  return angles;
}

}  // namespace metastable::analysis
