#include "analysis/experiment/experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "analysis/experiment/csv_reader.h"
#include "analysis/experiment/experiment_notes.h"
#include "analysis/experiment/experiment_toml.h"
#include "analysis/experiment/plausibility.h"
#include "analysis/experiment/stance_check.h"
#include "analysis/experiment/trial_index.h"

namespace metastable::analysis {
namespace {
namespace fs = std::filesystem;

constexpr std::int64_t most_collisions = 1'000'000'000, most_legs = 1000;

std::string file_name(const ExperimentSource& source, std::string_view name) {
  return source.folder.empty() ? std::string(name) : (fs::path(source.folder) / name).string();
}

std::optional<std::string> read_text(const fs::path& path, Defects& defects) {
  std::error_code error;
  if (!fs::exists(path, error) && !error) return std::nullopt;
  // Nothing but a file is opened: a pipe would have the reader wait for a writer.
  const bool regular = !error && fs::is_regular_file(path, error) && !error;
  const auto size = regular ? fs::file_size(path, error) : 0;
  std::string text(error ? 0 : static_cast<std::size_t>(size), '\0');
  std::ifstream in;
  if (regular) in.open(path, std::ios::binary);
  if (!regular || error || !in.read(text.data(), static_cast<std::streamsize>(text.size())))
    defects.add(path.string(), {}, regular ? "cannot be read" : "cannot be read: it is no regular file");
  return text;
}

enum Column { condition, trial, collision, leg, time_s, position_m, omega_minus, omega_plus };
constexpr CsvColumn collision_columns[] = {
    {"condition"}, {"trial", true}, {"collision", true},         {"leg"},
    {"time_s"},    {"position_m"},  {"omega_minus_rad_s", true}, {"omega_plus_rad_s"}};

// Reads collisions.csv row by row into the trials of an experiment.
class CollisionRows {
 public:
  // @param legs  0 if not known
  CollisionRows(Experiment& experiment, TrialIndex& index, CsvReader& csv, int legs)
      : experiment_(experiment), index_(index), csv_(csv), legs_(legs) {}

  void read() {
    while (csv_.next()) read_row();
    const auto presence = [this](std::size_t count) {
      return count == 0 ? Presence::none : count == rows_ ? Presence::all : Presence::some;
    };
    experiment_.columns.leg = presence(filled_[leg]);
    experiment_.columns.time = presence(filled_[time_s]);
    experiment_.columns.position = presence(filled_[position_m]);
    experiment_.columns.omega_plus = presence(filled_[omega_plus]);
  }
  const CollisionLines& lines() const { return lines_; }

 private:
  void read_row() {
    const std::optional<std::size_t> at = index_.row(csv_, condition, trial);
    MeasuredCollision c;
    std::optional<std::int64_t> number, landing;
    std::optional<double> before;
    const bool counted = csv_.read(collision, 1, most_collisions, number);
    csv_.read(leg, 0, legs_ > 0 ? legs_ - 1 : most_legs, landing);
    csv_.read(time_s, dynamics::range::time, c.time);
    csv_.read(position_m, dynamics::range::position, c.position);
    const dynamics::Range& speeds =
        experiment_.system == System::rimless_wheel ? dynamics::range::speed : dynamics::range::rotor_speed;
    csv_.read(omega_minus, speeds, before);
    csv_.read(omega_plus, {.low = -speeds.high, .high = speeds.high}, c.omega_plus);
    if (!at) return;
    if (*at == experiment_.trials.size()) {
      MeasuredTrial& fresh = experiment_.trials.emplace_back();
      fresh.number = index_.entries()[*at].number;
      fresh.condition = index_.entries()[*at].condition;
    }
    MeasuredTrial& roll = experiment_.trials[*at];
    ++rows_;
    filled_[leg] += landing.has_value();
    filled_[time_s] += c.time.has_value();
    filled_[position_m] += c.position.has_value();
    filled_[omega_plus] += c.omega_plus.has_value();
    // A number that cannot be read stands for the one that was due, so that the rows after it are not blamed.
    const int due = roll.collisions.empty() ? 1 : roll.collisions.back().number + 1;
    c.number = counted ? static_cast<int>(*number) : due;
    if (landing) c.leg = static_cast<int>(*landing);
    if (before) c.omega_minus = *before;
    if (c.number < due)
      return csv_.refuse(collision, fmt::format("{} repeats or goes back: collision {} of trial {} is due", c.number,
                                                due, roll.number));
    if (c.number > due)
      csv_.refuse(collision, fmt::format("{} skips: collision {} of trial {} is due", c.number, due, roll.number));
    else if (due > 1)
      compare(roll.collisions.back(), c);
    if (!roll.collisions.empty() && roll.collisions.back().omega_plus.value_or(0) < 0)
      csv_.refuse(collision, fmt::format("trial {} goes on after an omega_plus_rad_s of {}: a wheel that turned back",
                                         roll.number, *roll.collisions.back().omega_plus));
    roll.collisions.push_back(c);
    lines_.resize(experiment_.trials.size());
    lines_[*at].push_back(csv_.line());
  }

  void compare(const MeasuredCollision& last, const MeasuredCollision& next) {
    if (legs_ > 0 && last.leg && next.leg && *next.leg != (*last.leg + 1) % legs_)
      csv_.refuse(leg, fmt::format("leg {} does not land after leg {}", *next.leg, *last.leg));
    if (last.time && next.time && !(*next.time > *last.time))
      csv_.refuse(time_s, fmt::format("{} s is not after the collision before ({} s)", *next.time, *last.time));
    if (last.position && next.position && !(*next.position > *last.position))
      csv_.refuse(position_m,
                  fmt::format("{} m is not below the collision before ({} m)", *next.position, *last.position));
  }

  Experiment& experiment_;
  TrialIndex& index_;
  CsvReader& csv_;
  int legs_;
  std::size_t rows_ = 0;
  std::size_t filled_[std::size(collision_columns)] = {};
  CollisionLines lines_;
};

// Returns the step of the last digit that the speeds have; 0 where they have more than seven or are too few to say.
double last_digit(const Experiment& experiment) {
  constexpr std::size_t enough = 20;
  std::vector<double> speeds;
  for (const MeasuredTrial& trial : experiment.trials)
    for (const MeasuredCollision& c : trial.collisions) {
      speeds.push_back(c.omega_minus);
      if (c.omega_plus) speeds.push_back(*c.omega_plus);
    }
  if (speeds.size() < enough) return 0;
  double in_one = 1;
  for (int digits = 0; digits <= 7; ++digits, in_one *= 10)
    if (std::ranges::all_of(speeds,
                            [&](double speed) { return std::abs(speed * in_one - std::round(speed * in_one)) < 1e-6; }))
      return 1 / in_one;
  return 0;
}

// Reads trials.csv. Trials of the experiment stand in the order of collisions.entries().
void read_outcomes(Experiment& experiment, TrialIndex& index, const TrialIndex& collisions, CsvReader& csv) {
  while (csv.next()) {
    const std::optional<std::size_t> at = index.row(csv, 0, 1);
    const std::string_view name = csv.text(2);
    std::optional<dynamics::Outcome> outcome;
    if (name == "rest") outcome = dynamics::Outcome::rest;
    if (name == "end_of_ramp") outcome = dynamics::Outcome::end_of_ramp;
    if (name == "max_collisions") outcome = dynamics::Outcome::max_collisions;
    if (!outcome) csv.refuse(2, fmt::format("{} is none of rest, end_of_ramp, max_collisions", shown_text(name)));
    if (!at) continue;
    const TrialIndex::Entry& entry = index.entries()[*at];
    const TrialIndex::Entry* rolled = collisions.find(entry.number);
    if (rolled == nullptr) continue;  // reported when both files are read
    if (rolled->condition != entry.condition)
      csv.refuse(0, fmt::format("trial {} is of condition {} in collisions.csv", entry.number,
                                shown_text(experiment.conditions[rolled->condition].id)));
    experiment.trials[static_cast<std::size_t>(rolled - collisions.entries().data())].outcome = outcome;
  }
}

}  // namespace

std::size_t Experiment::collisions() const {
  std::size_t count = 0;
  for (const MeasuredTrial& roll : trials) count += roll.collisions.size();
  return count;
}

Setting nominal_setting(const Experiment& experiment, std::size_t condition_index) {
  if (experiment.system != System::rimless_wheel) throw std::invalid_argument("a coast-down has no wheel and no ramp");
  if (condition_index >= experiment.conditions.size())
    throw std::invalid_argument(
        fmt::format("condition: {} is outside [0, {}]", condition_index, experiment.conditions.size() - 1));
  const Condition& of = experiment.conditions[condition_index];
  Setting setting;
  setting.wheel = experiment.wheel;
  setting.slope_deg = of.slope_deg;
  setting.ramp_length = of.ramp_length;
  setting.law = experiment.contact.law;
  setting.restitution = experiment.contact.restitution;
  setting.friction = experiment.contact.friction;
  setting.first_landing_leg = of.first_landing_leg;
  if (of.initial_speed) {
    setting.initial_speed = *of.initial_speed;
    return setting;
  }
  double count = 0, mean = 0, squares = 0;
  for (const MeasuredTrial& roll : experiment.trials) {
    if (roll.condition != condition_index) continue;
    const double step = roll.collisions.front().omega_minus - mean;
    mean += step / ++count;
    squares += step * (roll.collisions.front().omega_minus - mean);
  }
  if (count == 0)
    throw std::invalid_argument(fmt::format("condition '{}': neither a launch speed nor a trial is given", of.id));
  setting.initial_speed = {mean, count > 1 ? std::sqrt(squares / (count - 1)) : 0};
  return setting;
}

ExperimentSource read_source(const fs::path& folder) {
  Defects defects;
  ExperimentSource source{
      .folder = folder.string(), .experiment_toml = {}, .collisions_csv = {}, .trials_csv = {}, .angle_csv = {}};
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    defects.add(source.folder.empty() ? "''" : source.folder, {}, "there is no such folder");
    defects.check();
  }
  const std::optional<std::string> toml = read_text(folder / "experiment.toml", defects);
  if (!toml) defects.add(file_name(source, "experiment.toml"), {}, "there is no such file; an experiment needs it");
  source.experiment_toml = toml.value_or("");
  source.collisions_csv = read_text(folder / "collisions.csv", defects);
  source.trials_csv = read_text(folder / "trials.csv", defects);
  source.angle_csv = read_text(folder / "angle.csv", defects);
  source.steps_csv = read_text(folder / "steps.csv", defects);
  defects.check();
  return source;
}

Experiment parse_description(const ExperimentSource& source) {
  Experiment experiment;
  Defects defects;
  parse_experiment_toml(file_name(source, "experiment.toml"), source.experiment_toml, experiment, defects);
  defects.check();
  return experiment;
}

Experiment parse_experiment(const ExperimentSource& source) {
  Experiment experiment;
  Defects defects;
  parse_experiment_toml(file_name(source, "experiment.toml"), source.experiment_toml, experiment, defects);
  const std::string collisions_file = file_name(source, "collisions.csv"),
                    trials_file = file_name(source, "trials.csv");
  const bool described = defects.empty();
  if (!source.collisions_csv) {
    defects.add(collisions_file, {},
                source.angle_csv ? "there is no such file; 'metastable collisions' makes it from angle.csv"
                                 : "there is no such file; an experiment needs it");
    defects.check();
  }
  TrialIndex collisions(experiment, TrialIndex::Rows::several, described);
  CsvReader rows(collisions_file, *source.collisions_csv, collision_columns, defects);
  CollisionRows collision_rows(experiment, collisions, rows, described ? experiment.legs() : 0);
  collision_rows.read();
  const bool readable = defects.empty();
  if (experiment.trials.empty() && defects.empty()) defects.add(collisions_file, {}, "holds no collision");
  if (source.trials_csv) {
    constexpr CsvColumn columns[] = {{"condition"}, {"trial", true}, {"outcome", true}};
    TrialIndex outcomes(experiment, TrialIndex::Rows::one, described);
    CsvReader csv(trials_file, *source.trials_csv, columns, defects);
    read_outcomes(experiment, outcomes, collisions, csv);
    experiment.columns.outcomes = true;
    // Trials whose rows could not be read would look like missing ones.
    if (rows.complete() && csv.complete() && collisions.complete() && outcomes.complete()) {
      collisions.report_missing(outcomes, collisions_file, trials_file, defects);
      outcomes.report_missing(collisions, trials_file, collisions_file, defects);
    }
  }
  experiment.sensor.last_digit = last_digit(experiment);
  if (readable && experiment.system == System::rimless_wheel) {
    check_plausible(experiment, collisions_file, collision_rows.lines(), defects);
    check_stances(experiment, collisions_file, defects);
  }
  if (readable) check_copies(experiment, collisions_file, collision_rows.lines(), defects);
  defects.check();
  std::ranges::sort(experiment.trials, {}, &MeasuredTrial::number);
  experiment.notes = notes_on(experiment);
  return experiment;
}

Experiment read_experiment(const fs::path& folder) { return parse_experiment(read_source(folder)); }

}  // namespace metastable::analysis
