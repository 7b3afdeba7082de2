#pragma once
// Any machine as a transition model: what its user brings, with what was measured of it.
//
// Example:
//   #include <metastable/analysis/diagnosis/diagnosis.h>
//   #include <metastable/analysis/machine_model/machine_transitions.h>
//
//   #include <cstdio>
//   #include <random>
//
//   using namespace metastable::analysis;
//
//   int main() {
//     Machine machine;  // a pendulum, from one turning point to the next
//     machine.states = {"swing_rad"};
//     machine.parameters = {{"decay", 0.975, 0.01}, {"scatter_rad", 0.003, 0.003, 1e-5, 0.1}};  // nominal, sd
//     machine.effects = {{"dry_friction", {{"loss_rad", 0, 0, 0.05}}}};                         // neutral, bounds
//     machine.observe = {{"swing_rad", 0.0005}};                                                // sd of the sensor
//     machine.step = [](const MachineBatch& batch) {
//       for (std::size_t i = 0; i < batch.rows; ++i)
//         batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) * batch.scores[i] - batch.value(2,
//         i);
//     };
//     // The real machine, whose pivot takes 0.004 rad of every swing.
//     std::mt19937_64 generator(1);
//     std::normal_distribution<double> normal;
//     MachineRuns runs;
//     for (int trial = 0; trial < 40; ++trial) {
//       runs.trials.emplace_back();
//       double swing = 0.8 + 0.05 * normal(generator);
//       for (int turn = 0; turn < 24; ++turn) {
//         runs.trials.back().rows.push_back({.seen = {swing + 0.0005 * normal(generator)}});
//         swing = 0.975 * swing - 0.004 + 0.003 * normal(generator);
//       }
//     }
//     const Diagnosis answer = diagnose(machine_transitions(std::make_shared<const Machine>(machine), runs));
//     std::printf("%s: %s\n", verdict_name(answer.verdict).c_str(), answer.causes.ranked.front().name().c_str());
//   }
// prints
//   explained: dry_friction

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/fitting/transition_model.h"
#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// Says that rows drawn from a machine are not distributed as its likelihood says, which
/// TransitionModel::require_own_draws() refuses. Its sentence is for a user who wrote the step.
class OwnDrawsDiffer : public std::runtime_error {
 public:
  /// @param apart  Kolmogorov's distance between the distribution functions  @param allowed  the largest
  OwnDrawsDiffer(double apart, double allowed);
  double apart, allowed;
};

/// Returns the transition model of a machine and its runs. A recalibration refits the parameters whose sd is above 0,
/// the errors of sensors whose sd is not stated, and the share of wild rows. Effects are those of machine_effects().
/// The map is called with many states at once, from several threads at once. A stated parameter that a recalibration
/// leaves beyond three of its sds is known less well than stated: what is stated of it is set aside, unless an effect
/// makes the runs likelier with the parameter as stated. TransitionModel::misstated() names it, and the suspected
/// effects that would do as well with all parameters as stated, which it fits.
/// @throws std::invalid_argument as Machine::require_valid(), look_over(), score_plan(); where a measured state has
///   neither noise nor an error of measurement; here and in every later call as the step of refusing_nan()
std::unique_ptr<TransitionModel> machine_transitions(std::shared_ptr<const Machine> machine, MachineRuns runs);

/// Returns the same without fitting anything: what is stated of a parameter stands, however far a recalibration leaves
/// it behind.
std::unique_ptr<TransitionModel> machine_as_stated(std::shared_ptr<const Machine> machine, MachineRuns runs);

}  // namespace metastable::analysis
