#pragma once
// Steps a machine from many points of its trials in one call.

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// The place of a transition: its trial, the row it starts from, and its number over all trials.
struct TransitionPlace {
  std::size_t trial = 0, row = 0, number = 0;
};

/// A turn of the coordinates in which a trial's points are given: where an offset and a noise act through one value,
/// the map bends in their sum alone. With x of the noise and y along the root's column both standard normal, points are
/// given with u = (x + ratio y) / n for x and w = (y - ratio x) / n for y, n^2 = 1 + ratio^2: w hardly moves the state.
struct ScoreTurn {
  std::size_t score = 0;    ///< of x
  Eigen::Index column = 0;  ///< of y
  double ratio = 0;         ///< what y moves the state by, in what x does
  Eigen::VectorXd mean;     ///< [size()] about which y is measured
  Eigen::MatrixXd root;     ///< [size() x size()] lower root of the covariance of points about it
  double length() const { return std::sqrt(1 + ratio * ratio); }
};

/// Gathers points, each a state with what differs in its trial and the scores before, and steps them together.
class MachineStepper {
 public:
  MachineStepper(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& supposed);

  std::size_t states() const { return machine_.states.size(); }
  std::size_t scores() const { return static_cast<std::size_t>(machine_.scores); }
  std::size_t offsets() const { return supposed_.spreads.size() + supposed_.push_spreads.size(); }
  /// Counts the offsets of values, which come before those of pushes.
  std::size_t value_offsets() const { return supposed_.spreads.size(); }
  bool remembers() const { return !supposed_.memory.empty(); }
  double memory(std::size_t score) const { return remembers() ? supposed_.memory[score] : 0; }
  /// Counts what a point holds: states, then the offsets of values and of pushes, then the scores before, where these
  /// are remembered.
  std::size_t size() const { return states() + offsets() + (remembers() ? scores() : 0); }

  /// Returns one of the same machine, runs and hypothesis without a point.
  MachineStepper another() const;
  void clear();
  /// Takes the points of a trial in turned coordinates from now on.
  void turn(std::size_t trial, ScoreTurn turn);
  /// Adds a point. @param point  [size()] @param fresh  [scores()] normal scores of this step
  void add(const TransitionPlace& place, const Eigen::Ref<const Eigen::VectorXd>& point,
           const Eigen::Ref<const Eigen::VectorXd>& fresh);
  /// Steps all points added. A state that has grown beyond all numbers counts as failed.
  void run();
  /// Steps some of the points added, given by their numbers from 0. The next states of the others stay as they are; a
  /// point that was neither stepped nor told has none.
  void run(std::span<const std::size_t> points);
  /// Stores a next state [states()], which holds the pushes already, for a point that was not stepped and did not fail.
  void tell(std::size_t point, const Eigen::Ref<const Eigen::VectorXd>& next);
  /// Says whether it counts as failed for want of a finite state alone.
  bool lost(std::size_t point) const;
  /// Returns the next states of a point, and whether it failed.
  Eigen::Map<const Eigen::VectorXd> next(std::size_t point) const;
  bool failed(std::size_t point) const { return failed_[point] != 0; }

 private:
  void add_straight(const TransitionPlace& place, const Eigen::Ref<const Eigen::VectorXd>& point,
                    const Eigen::Ref<const Eigen::VectorXd>& fresh);
  void take(std::size_t point, std::span<const double> next, std::uint8_t failed);
  std::vector<double> acting(std::size_t input) const;
  double input_at(std::size_t input, const TransitionPlace& place) const;
  double value_at(std::size_t value, const TransitionPlace& place,
                  const Eigen::Ref<const Eigen::VectorXd>& point) const;

  const Machine& machine_;
  const MachineRuns& runs_;
  const MachineHypothesis& supposed_;
  std::vector<double> lower_, upper_;          // of the values
  std::vector<char> varies_;                   // by value: differs from row to row
  std::vector<std::vector<double>> filtered_;  // by input, of all rows in their order; empty: as it was recorded
  std::vector<std::size_t> first_row_;         // by trial, among all rows
  std::vector<double> states_, scores_, next_;
  std::vector<double> pushed_;               // by point and PushSpread: what its state is pushed by
  std::vector<std::vector<double>> values_;  // by value
  std::vector<std::uint8_t> failed_;
  std::vector<TransitionPlace> places_;
  std::vector<std::optional<ScoreTurn>> turns_;  // by trial; empty: none
};

}  // namespace metastable::analysis
