#pragma once
// Writes simulated trials as an experiment folder (experiment.toml, collisions.csv, trials.csv).

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/study/setting.h"
#include "dynamics/return_map/trials.h"
#include "markov/parallel.h"

namespace metastable::analysis {

struct SimulationOptions {
  int trials = 50;      ///< 1 .. 1000000
  int collisions = 16;  ///< most collisions of a trial, 1 .. 100000
  std::uint64_t seed = 1;
  int threads = 0;          ///< the same bits on any number
  std::uint64_t first = 0;  ///< index of the first trial: conditions of one experiment take different ones
  bool rest_rule = true;    ///< false: never rest, x' < 0 is set to 0 (dynamics::TrialOptions)
  markov::Share progress = {};
};

/// Simulates trials first .. first+trials-1 under `setting`. @throws std::invalid_argument naming option and range, and
/// as Setting::validate()
std::vector<dynamics::Trial> simulate_trials(const Setting& setting, const SimulationOptions& options);

/// Holds one condition of a simulated experiment.
struct SimulatedCondition {
  std::string id;
  Setting setting;
  std::vector<dynamics::Trial> trials;
};

/// Holds the three files of an experiment folder as text. Speeds are in rad/s, lengths in m, times in s.
struct ExperimentFiles {
  std::string experiment_toml;
  std::string collisions_csv;
  std::string trials_csv;  ///< empty: outcomes are not told, and there is no such file
};
/// Returns the texts as the reader takes them. @param name  of the folder, for messages
ExperimentSource source_of(const ExperimentFiles& files, const std::string& name);

/// Write experiment.toml up to its [[condition]] tables, and one of those. Launches and the leg that lands first may be
/// left unstated.
std::string wheel_description(const Setting& setting, Spread restitution, Spread friction, const std::string& title,
                              const std::vector<std::string>& comment);
std::string condition_description(const std::string& id, const Setting& setting, bool launch_stated = true,
                                  bool first_leg_stated = true);
std::string_view outcome_name(dynamics::Outcome outcome);
/// Quotes a text as TOML wants it.
std::string toml_text(const std::string& text);

/// Trials are numbered through all conditions. Wheel and contact are those of the first condition.
/// @param title, comment  of experiment.toml; the comment's lines come first, each behind "# "
ExperimentFiles experiment_files(const std::vector<SimulatedCondition>& conditions, const std::string& title,
                                 const std::vector<std::string>& comment);
/// Does the same for one condition, whose id is its slope.
ExperimentFiles experiment_files(const Setting& setting, const std::vector<dynamics::Trial>& trials,
                                 const std::string& title, const std::vector<std::string>& comment);

}  // namespace metastable::analysis
