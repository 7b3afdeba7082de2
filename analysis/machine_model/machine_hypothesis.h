#pragma once
// A hypothesis about a machine, under which its trials are followed: the values of its map, and how they vary.

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"

namespace metastable::analysis {

/// The values of the map and their variations. Lists by transition number the transitions over all trials: row k to k +
/// 1 of the first trial, and so on.
struct MachineHypothesis {
  /// A value of the map that is more by so much in each transition.
  struct Change {
    std::size_t value;               // index of Machine::value_names()
    std::vector<double> transition;  // added
  };
  /// A value that changes with a state.
  struct StateLaw {
    std::size_t value, state;
    double slope, centre;  // added: slope (state - centre)
  };
  /// A value that differs from trial to trial.
  struct Spread {
    std::size_t value;
    double sd;
  };
  /// A state that is pushed after each step.
  struct Push {
    std::size_t state;
    std::vector<double> transition;  // added
  };

  /// A state that is pushed after each step by a weight times a number that differs from trial to trial.
  struct PushSpread {
    std::size_t state;
    double sd;                       // It is that of the number.
    std::vector<double> transition;  // These are the weights.
  };

  /// A state that the map lacks: it follows one of the states, of which it takes on a share 1 - kept of their distance
  /// at each step, and pushes a state by `pull` times that distance.
  struct Hidden {
    std::size_t follows, pushes;
    double kept, pull;
    std::vector<double> ahead;  // by transition: how far it is ahead of what was measured of the state it follows
  };

  std::vector<double> values;  ///< parameters and the effects' parameters
  std::vector<Change> changes = {};
  std::vector<StateLaw> laws = {};
  std::vector<Spread> spreads = {};
  std::vector<Push> pushes = {};
  std::vector<PushSpread> push_spreads = {};
  std::vector<Hidden> hidden = {};
  std::vector<double> scatter = {};         ///< by transition: scores are so many times as large; empty: 1
  std::vector<double> memory = {};          ///< by score: correlation with the one before; empty: 0
  std::vector<double> sensor_sd = {};       ///< by sensor
  std::vector<double> added_noise = {};     ///< by sensor: sd of an error beside it
  std::vector<double> bias = {};            ///< by sensor: what is seen is so much more than the state
  std::vector<double> launch_offset = {};   ///< by state: launches are at so much more than is stated; empty: 0
  std::vector<double> launch_scatter = {};  ///< by state: sd by which they scatter beside what is stated; empty: 0
  std::vector<double> lag = {};             ///< by input [steps]: what acts is what was recorded so long before
  std::vector<double> filter = {};          ///< by input: what acts keeps such a share of what acted the step before
  double outliers = 0;                      ///< share of steps whose scores are drawn wide
  double wild = 0;                          ///< share of rows that say nothing of the state

  /// Lists the sds of what differs from trial to trial: of values first, then of pushes.
  std::vector<double> offset_sds() const;
};

/// The mean and the sd of a state's launches.
struct NormalLaunch {
  double mean, sd;
};
/// Returns how a state is launched under a hypothesis. @param state  index of the state that the launch is of
NormalLaunch supposed_launch(const MachineHypothesis& hypothesis, const MachineLaunch& launch, std::size_t state);

/// Adds to a number of a hypothesis, transition by transition. Its numbers are the values of the map, then what each
/// state is pushed by, then the logarithm of the scores' scatter.
/// @param states  how many the machine has
void add(MachineHypothesis& hypothesis, std::size_t states, const Addition& added);

/// Returns what a change adds to one such number, in units of `step`; none if that is not all it does.
/// @param plain  the hypothesis that it changed, without additions
std::optional<Addition> addition_of(const MachineHypothesis& plain, const MachineHypothesis& changed,
                                    std::size_t states, double step);

/// Changes a hypothesis as an effect or a variation does, with these values of its variant and its parameters.
using MachineChange =
    std::function<void(MachineHypothesis&, const std::vector<double>& variant, const std::vector<double>& values)>;

inline constexpr double outlier_width = 4;  ///< sd of the scores of an outlier
/// Half of the wild rows have the one, half the other sd, in sds of what was expected there: glitches of a sensor may
/// be of any size.
inline constexpr std::array<double, 2> wild_widths{10, 100};

}  // namespace metastable::analysis
