#include "tests/fuzz/experiment_input.h"

#include <cmath>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"
#include "analysis/motion_capture/angle_file.h"

namespace metastable::fuzz {
namespace {

using analysis::ExperimentSource;

ExperimentSource split(std::string_view text) {
  ExperimentSource source;
  std::string* part = &source.experiment_toml;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end);
    if (line == "=== collisions.csv\n")
      part = &source.collisions_csv.emplace();
    else if (line == "=== trials.csv\n")
      part = &source.trials_csv.emplace();
    else if (line == "=== angle.csv\n")
      part = &source.angle_csv.emplace();
    else
      *part += line;
  }
  return source;
}

void require(bool promise) {
  if (!promise) std::abort();
}

void check_experiment(const analysis::Experiment& experiment) {
  require(!experiment.conditions.empty() && !experiment.trials.empty());
  int last = -1;
  for (const analysis::MeasuredTrial& trial : experiment.trials) {
    require(trial.number > last && trial.condition < experiment.conditions.size() && !trial.collisions.empty());
    last = trial.number;
    require(!experiment.columns.outcomes || trial.outcome.has_value());
    int number = 0;
    for (const analysis::MeasuredCollision& c : trial.collisions) {
      require(c.number == ++number);
      require(std::isfinite(c.omega_minus) && c.omega_minus >= 0);
      require(!c.omega_plus || (std::isfinite(*c.omega_plus) && *c.omega_plus >= 0));
      require(!c.leg || (*c.leg >= 0 && *c.leg < experiment.legs()));
      require((!c.time || std::isfinite(*c.time)) && (!c.position || std::isfinite(*c.position)));
    }
  }
}

void check_angles(const std::vector<analysis::MeasuredAngle>& angles) {
  int last = -1;
  for (const analysis::MeasuredAngle& trial : angles) {
    require(trial.number > last);
    last = trial.number;
    const std::vector<double>&time = trial.recording.time, &angle = trial.recording.angle_rad;
    require(time.size() >= 2 && time.size() == angle.size());
    for (std::size_t k = 0; k < time.size(); ++k) {
      require(std::isfinite(time[k]) && std::isfinite(angle[k]));
      require(k == 0 || time[k] > time[k - 1]);
    }
  }
}

// Says whether it was taken; a refusal must say why.
template <typename Read>
bool taken(const Read& read) {
  try {
    read();
    return true;
  } catch (const analysis::InputError& error) {
    require(!error.lines().empty());
    return false;
  }
}

}  // namespace

bool read_experiment_input(const std::uint8_t* data, std::size_t size) {
  const ExperimentSource source = split({reinterpret_cast<const char*>(data), size});
  const bool good = taken([&] { check_experiment(analysis::parse_experiment(source)); });
  const bool angles = !source.angle_csv ||
                      taken([&] { check_angles(analysis::parse_angles(source, analysis::parse_description(source))); });
  return good && angles;
}

}  // namespace metastable::fuzz
