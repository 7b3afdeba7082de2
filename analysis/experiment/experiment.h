#pragma once
// Holds measured (or simulated) trials, read from an experiment folder: experiment.toml, collisions.csv, trials.csv.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "analysis/study/setting.h"
#include "dynamics/wheel/contact_law.h"
#include "dynamics/wheel/outcome.h"
#include "dynamics/wheel/wheel.h"

namespace metastable::analysis {

/// Says what rolled. A coast-down is a rotor without legs: its collisions are revolutions, and it has no wheel or ramp.
enum class System { rimless_wheel, coast_down };

/// Holds the nominal contact, which the modeller believes.
struct NominalContact {
  dynamics::Law law = dynamics::Law::published;
  Spread restitution, friction;  ///< eta, mu; zero under `plastic`, which has neither
  /// By how much the mean of mu differs from day to day: an sd, as a share of it, in [0, 0.5].
  std::optional<double> day_to_day = {};
};

/// Nominal coast-downs lose omega^2 [rad^2/s^2] a revolution: constant + linear omega + quadratic omega^2 + noise.
struct RevolutionLoss {
  double constant = 0;   ///< [rad^2/s^2]
  double linear = 0;     ///< [rad/s]
  double quadratic = 0;  ///< [1]
  double noise_sd = 0;   ///< [rad^2/s^2], >= 0
  /// Says by how much each of the terms differs from run to run: an sd, as a share of the loss, in [0, 0.5].
  std::optional<double> run_to_run = {};
  std::string accepted_defects =
      {};  ///< of the runs it was fitted to, or of the trials, a sentence; "": there are none

  /// Returns the mean loss at a speed [rad^2/s^2]. @param omega [rad/s]
  double at(double omega) const { return constant + linear * omega + quadratic * omega * omega; }
};
/// The value of RevolutionLoss::run_to_run of a drum of which one run is known, and NominalContact::day_to_day where it
/// is not.
inline constexpr double usual_run_to_run = 0.03;

struct Condition {
  std::string id;
  double slope_deg = 0;                 ///< gamma [deg]; 0 for a coast-down
  double ramp_length = 0;               ///< [m]; 0 for a coast-down
  std::optional<Spread> initial_speed;  ///< just before collision 1 [rad/s]
  int first_landing_leg = 0;
  bool first_leg_stated = false;  ///< whether experiment.toml has first_landing_leg, or whoever made this knows it
  int day = 1;                    ///< on which it was measured, from 1
};

struct Sensor {
  std::optional<double> rate;      ///< [Hz]
  std::optional<double> noise_sd;  ///< believed noise of the reported speeds [rad/s]
  /// The step of the last digit in the speeds as they were printed [rad/s]; 0: none that tells; nothing: no speeds
  /// were measured (a design).
  std::optional<double> last_digit;
};

struct MeasuredCollision {
  int number = 0;                    ///< from 1, one after the other
  std::optional<int> leg;            ///< that lands
  std::optional<double> time;        ///< [s]
  std::optional<double> position;    ///< of the landing foot, down the ramp from the first [m]
  double omega_minus = 0;            ///< [rad/s]
  std::optional<double> omega_plus;  ///< [rad/s]; below 0 the wheel turned back, after its trial's last collision
};

struct MeasuredTrial {
  int number = 0;                             ///< in the order the trials were run
  std::size_t condition = 0;                  ///< index
  std::vector<MeasuredCollision> collisions;  ///< at least one
  std::optional<dynamics::Outcome> outcome;   ///< nothing: unknown. A trial that rests does so after its last collision
};

/// Says how much of a column that may be missing is there.
enum class Presence { none, some, all };

struct Columns {
  Presence leg = Presence::none, time = Presence::none, position = Presence::none, omega_plus = Presence::none;
  bool outcomes = false;  ///< trials.csv was there
};

struct Experiment {
  std::string title;
  System system = System::rimless_wheel;
  dynamics::Wheel wheel;                ///< of a rimless wheel
  NominalContact contact;               ///< of a rimless wheel
  std::optional<double> rotor_inertia;  ///< of a coast-down [kg m^2]
  RevolutionLoss loss;                  ///< of a coast-down
  std::vector<Condition> conditions;    ///< at least one
  Sensor sensor;
  std::vector<MeasuredTrial> trials;  ///< by rising number
  Columns columns;
  std::vector<std::string> notes;  ///< what is not known or looks odd, a sentence each; for the user to see

  std::size_t collisions() const;  ///< of all trials
  int legs() const { return system == System::rimless_wheel ? wheel.legs() : 1; }
};

/// Returns one condition's nominal model, with the stated launch or else the measured one (mean and sd at collision 1).
/// @throws std::invalid_argument for a coast-down, an index out of range, a condition with neither launch nor trials
Setting nominal_setting(const Experiment& experiment, std::size_t condition);

/// Holds the texts of a folder's files.
struct ExperimentSource {
  std::string folder;  ///< as messages name it
  std::string experiment_toml;
  std::optional<std::string> collisions_csv, trials_csv, angle_csv;  ///< nothing: no such file
  std::optional<std::string> steps_csv = {};                         ///< of walks
};

/// Reads the files there are. @throws InputError if experiment.toml is not there or a file cannot be read
ExperimentSource read_source(const std::filesystem::path& folder);

/// Reads everything but the trials: what experiment.toml says. @throws InputError with all its defects
Experiment parse_description(const ExperimentSource& source);

/// Reads the whole experiment. It checks types, ranges and names of all keys and columns; numbers finite, speeds not
/// negative; collisions of a trial in order without repeat or gap, legs landing one after the other, time and position
/// rising; a trial of one condition only, which experiment.toml knows; the same trials in collisions.csv and
/// trials.csv; speeds, times and positions that a wheel of these legs on this ramp can have, and no trial twice
/// (plausibility.h, stance_check.h). O(rows log trials).
/// @throws InputError with the first 20 defects, each with file, line and column
Experiment parse_experiment(const ExperimentSource& source);

/// Does read_source() and parse_experiment().
Experiment read_experiment(const std::filesystem::path& folder);

}  // namespace metastable::analysis
