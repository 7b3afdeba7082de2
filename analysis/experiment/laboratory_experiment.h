#pragma once
// Runs experiments in the virtual laboratory, and writes their folders.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/angle_recording.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/study/setting.h"
#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/laboratory/laboratory.h"

namespace metastable::analysis {

/// Returns contact and legs [m] as the catalogue of effects takes them.
dynamics::NominalValues stated_values(const Spread& restitution, const Spread& friction,
                                      const std::vector<double>& leg_lengths);

/// Describes one condition as the modeller states it.
struct LaboratoryCondition {
  std::string id;
  Setting setting;  ///< the nominal model
  int trials = 50;  ///< 1 .. 100000
};

/// Says how reality departs from the nominal model.
struct LaboratoryOptions {
  std::vector<dynamics::Effect> effects = {};
  std::vector<dynamics::OutsideEffect> outside = {};
  double restitution_skewness = 0;
  double sensor_noise = 0;  ///< of every reported speed [rad/s]
  double smoothing = 0;     ///< [s], [0, 0.1]
  bool flight = true;
  bool shuffled = false;  ///< conditions take turns at random instead of one after the other
  int collisions = 16;    ///< most of a trial
  std::uint64_t seed = 1;
  int threads = 0;
};

/// Sets up the laboratory of these conditions. Wheel and contact are those of the first.
/// @throws std::invalid_argument where there is no condition, and naming a setting the laboratory cannot take
/// (correlation, list of pairs; under settled what Laboratory refuses) or an option out of range
dynamics::LaboratorySetup laboratory_setup(const std::vector<LaboratoryCondition>& conditions,
                                           const LaboratoryOptions& options);
/// Returns all trials in the order they were run. They have the same bits on any number of threads.
std::vector<dynamics::LaboratoryTrial> run_laboratory(const dynamics::LaboratorySetup& setup, int threads,
                                                      const markov::Share& progress = {});

/// Says what a folder tells of an experiment.
struct FolderOptions {
  std::string title = {};
  std::vector<std::string> comment = {};  ///< first lines of experiment.toml, each behind "# "
  /// Leaves these out: leg, time_s, position_m, omega_plus_rad_s, outcome, initial_speed_rad_s, noise.
  std::vector<std::string> dropped = {};
  std::optional<Spread> restitution = {}, friction = {};  ///< stated; default: those of the first condition's setting
  std::optional<CameraOptions> camera = {};               ///< angle.csv too
};
/// Lists the names that FolderOptions::dropped may hold.
const std::vector<std::string>& droppable();

/// Returns the trials as an experiment without a folder in between: what reading laboratory_files() back gives, with
/// digits that the files carry. @throws std::invalid_argument as laboratory_files()
Experiment experiment_of(const std::vector<LaboratoryCondition>& conditions, const dynamics::LaboratorySetup& setup,
                         const std::vector<dynamics::LaboratoryTrial>& trials, const FolderOptions& options);

struct LaboratoryFiles {
  ExperimentFiles files;
  std::optional<std::string> angle_csv;
};
/// @throws std::invalid_argument for an unknown name in `dropped`, and where there is no condition
LaboratoryFiles laboratory_files(const std::vector<LaboratoryCondition>& conditions,
                                 const dynamics::LaboratorySetup& setup,
                                 const std::vector<dynamics::LaboratoryTrial>& trials, const FolderOptions& options);

}  // namespace metastable::analysis
