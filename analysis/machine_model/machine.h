#pragma once
// A machine that its user brings: a step map with names, what is known of its parameters, what is suspected of it, and
// what was measured of it.

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace metastable::analysis {

/// A number of the nominal model. A recalibration refits it where its sd is above 0.
struct MachineParameter {
  std::string name;
  double nominal = 0, sd = 0;  ///< value, and the sd with which it is known
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
};

/// A number of an effect: the nominal model has it at its neutral value.
struct SuspectedParameter {
  std::string name;
  double neutral = 0, lower = 0, upper = 0;
};

/// An effect that the user suspects.
struct MachineEffect {
  std::string id;
  std::vector<SuspectedParameter> parameters;  ///< at least one
};

/// A state that is measured.
struct MachineSensor {
  std::string state;
  std::optional<double> sd;  ///< of its error; nothing: fitted
  double correlation = 0;    ///< of the errors of neighbouring rows, in [-0.5, 0.5]

  /// The error of a row in sds: own times a number of this row plus kept times that of the row before, both independent
  /// standard normals.
  struct SharedError {
    double own, kept;
  };
  SharedError shared_error() const {
    const double plus = std::sqrt(1 + 2 * correlation), minus = std::sqrt(1 - 2 * correlation);
    return {0.5 * (plus + minus), 0.5 * (plus - minus)};
  }
};

/// The distribution from which the first value of a state comes. A first row that has the value is held against it,
/// unless it is assumed: then it only fills in what a first row lacks.
struct MachineLaunch {
  std::string state;
  double mean = 0, sd = 0;
  bool assumed = false;  ///< nobody stated it: walks that are drawn start at the mean
};

/// One call of a step map: `rows` states at once. A value (see Machine::value_names()) is one number for all rows, or
/// one a row.
struct MachineBatch {
  std::size_t rows = 0;
  std::span<const double> states;                   ///< [rows x states]
  std::span<const double> scores;                   ///< [rows x scores] standard normal
  std::span<const std::span<const double>> values;  ///< [values] of length 1 or `rows`
  std::span<double> next;                           ///< [rows x states] to be filled in
  std::span<std::uint8_t> failed;                   ///< [rows] 1 where the machine failed; next does not count then

  /// Returns a value in one row.
  double value(std::size_t which, std::size_t row) const {
    return values[which].size() == 1 ? values[which][0] : values[which][row];
  }
};

struct Machine {
  std::string name = "machine";
  std::vector<std::string> states;  ///< 1 to 30
  int scores = 1;                   ///< standard normal numbers that a step takes, >= 1
  std::function<void(const MachineBatch&)> step;
  std::vector<MachineParameter> parameters;
  std::vector<MachineEffect> effects;
  std::vector<std::string> may_vary;    ///< parameters that may differ by phase, run, clock, place, state or label
  std::vector<MachineSensor> observe;   ///< at least one
  std::vector<MachineLaunch> launches;  ///< at least of states that a first row may lack
  std::vector<std::string> inputs;      ///< recorded numbers that a step is given, by their columns' names
  /// A call of `step` costs much more than a row, as where an interpreter runs it.
  bool dear = false;
  /// The states are all that the machine has: no effect is a state that the map lacks.
  bool whole_state = false;
  double most_wild = 0.01;  ///< largest share of rows that may be wild (missed events, bad tracks), [0, 0.2]
  std::map<std::string, std::string> units;  ///< Stated of states, values and inputs; names may tell theirs.

  /// Returns the unit of a state or value: the one stated, else the one that its name ends in ("swing_rad_s": rad/s;
  /// "per_m": 1/m); "" where there is none.
  std::string unit_of(const std::string& name) const;

  /// Names what MachineBatch::values holds, in order: parameters, the effects' parameters, inputs.
  std::vector<std::string> value_names() const;
  /// Returns the index of a state. @throws std::invalid_argument for an unknown one, with those there are
  /// @param where  it was named, in the message: "sensor: "
  std::size_t state_index(const std::string& state, const std::string& where = "") const;
  /// Returns the launch that somebody stated of a state; nullptr where there is none, or where it is assumed.
  const MachineLaunch* stated_launch(const std::string& state) const;
  /// @throws std::invalid_argument naming the first thing that is wrong, and the range
  void require_valid() const;
};

/// Returns a machine whose step throws std::invalid_argument, naming state, row and values, where a state is NaN that
/// is not marked as failed: a map that cannot say what comes next would else be taken for a machine that falls there.
std::shared_ptr<const Machine> refusing_nan(std::shared_ptr<const Machine> machine);

/// Returns a machine whose steps are brought together while works run side_by_side().
Machine joining_steps(std::shared_ptr<const Machine> machine);

/// Calls work(i) once for every i in [0, count). What works ask a machine of joining_steps() goes to the map in joint
/// calls (markov::joined_for()); a value that differs between the works is then one number a row. Works within works
/// run one after the other.
/// @param machine  the map, as joining_steps() was given it  @param threads  that compute at the same time; 0: all
/// cores
void side_by_side(const Machine& machine, std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace metastable::analysis
