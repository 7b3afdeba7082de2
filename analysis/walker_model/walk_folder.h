#pragma once
// Experiment folders of walks (experiment.toml, steps.csv, trials.csv): read, drawn and written.

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/experiment.h"
#include "analysis/machine_model/machine_runs.h"
#include "analysis/walker_model/walker_machine.h"
#include "analysis/walkers/walker_trials.h"
#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::analysis {

/// Holds a folder of walks: the machine that they are of, and what was measured.
struct Walks {
  std::string title;
  std::shared_ptr<const Machine> machine;
  MachineRuns runs;
};

/// Says whether a folder's experiment.toml states `system = "machine"`; false where it cannot be read.
bool holds_walks(const std::filesystem::path& folder);

/// Says whether the text of an experiment.toml states it.
bool states_walks(const std::string& experiment_toml);

/// Reads a folder whose experiment.toml states `system = "machine"`; nothing where it states another.
/// Checks names, types and ranges of keys and columns, steps of a trial in order without gap, legs that take turns,
/// trials that stand together, and outcomes of those trials only.
/// @throws InputError with the first 20 defects, each with file, line and column; with one alone where the model of the
/// walker is missing or unknown, or where collisions.csv is there, too
std::optional<Walks> read_walks(const std::filesystem::path& folder);
/// Reads it from the texts of its files.
std::optional<Walks> parse_walks(const ExperimentSource& source);

/// Lists in sentences what diagnose_walks() says of the walks themselves: columns in other units, rows that are missing
/// (questions_on_leg_turns()), and why it refuses them. It fits nothing, so that walks can be looked over as they are
/// brought in.
std::vector<std::string> notes_on_walks(const Walks& walks);

/// Asks questions_on_leg_turns() behind the verdict.
/// @throws as machine_transitions() and diagnose(), with what to check of the columns where the walker fails from most
///   rows; std::invalid_argument for another slope or speed, which walks do not have, and for an effect of the
///   catalogue that this machine does not know
Diagnosis diagnose_walks(const Walks& walks, const DiagnosisOptions& options);

/// Holds the three files as text.
struct WalkFiles {
  std::string experiment_toml, steps_csv, trials_csv;
  std::size_t fallen = 0;
};

/// Says what experiment.toml tells of a walker's walks.
struct WalkStatement {
  std::string title;
  WalkerStatement walker;
  std::vector<std::pair<std::string, std::optional<double>>> columns = {};  ///< states, with the sd of each one's error
  std::vector<std::string> comment = {};                                    ///< its lines come first, behind "# "
  std::vector<std::pair<std::string, Spread>> launches = {};  ///< states, with mean and sd of their first values
};
/// Returns the experiment.toml that says so.
std::string walk_toml(const WalkStatement& statement);

/// Returns the texts as a folder of that name holds them.
ExperimentSource source_of(const WalkFiles& files, const std::string& name);

/// Lists the effects of walks that a walker may have, with its own bounds. Effects of the simplest walker's body have
/// no units: its lengths are in legs, its times in sqrt(l/g). @throws std::invalid_argument for the biped
std::vector<dynamics::EffectInfo> effects_known_to(Walker walker);

/// Reads effects of a walker that walks are drawn from, "hip_damping:damping=0.3", as draw_walks() takes them.
/// @throws std::invalid_argument as dynamics::effect_from_text(), and for an id that the machine does not have
std::vector<std::pair<std::string, double>> effects_of_walks(WalkerSetting setting,
                                                             const std::vector<std::string>& texts);

/// Draws walks of a walker with effects, as WalkOptions says, which start in the gait of the ideal one, and measures
/// them with errors of 0.0005 rad and, for the rates, 0.005 rad/s (simplest: 0.001). A row is a state just after a
/// strike; what becomes of the last row of WalkOptions::longest is not told.
/// @param effects  parameters of walker_machine()'s effects, "hip_damping.damping", and of the launch_STATE of
///   walker_effects(), and values
/// @throws std::invalid_argument for an effect or value that the machine does not have
WalkFiles draw_walks(const WalkerSetting& setting, std::vector<std::pair<std::string, double>> effects,
                     const WalkOptions& options, const std::string& title);

}  // namespace metastable::analysis
