#pragma once
// Carries the distribution of a machine's state over one step, for many trials at once.

#include <Eigen/Core>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "analysis/machine_model/belief_mixture.h"
#include "analysis/machine_model/failure_edges.h"
#include "analysis/machine_model/machine_stepper.h"
#include "analysis/machine_model/score_lattice.h"

namespace metastable::analysis {

/// The distribution of the state after a step, before the next row is measured. Its vector holds the machine's point
/// (see MachineStepper::size()), then an error of this row for every sensor that shares errors between rows, then the
/// one of the row before.
template <int Most>
struct AfterStep {
  BeliefMixture<Most> belief;
  double failed = 0;       ///< probability that the machine failed; the weights add up to the rest
  double failed_wide = 0;  ///< the same of an outlier's scores
};

/// Steps distributions. The vector before a step holds the point and the errors of its row.
template <int Most>
class BeliefStep {
 public:
  using Vector = BeliefVector<Most>;
  using Matrix = BeliefMatrix<Most>;
  using Part = typename BeliefMixture<Most>::Part;

  /// @param shared    sensors that share errors between rows
  /// @param bent      parts stay bent in the scores of the lattice, which then are the last numbers of the vector
  /// @param outliers  share of steps whose scores are drawn outlier_width times as wide
  BeliefStep(MachineStepper& stepper, const ScorePlan& plan, std::size_t shared, bool bent, double outliers);
  /// Seeks an offset that moves the state as a score does, once, by these beliefs; step() does so by its first ones.
  void seek(std::span<const TransitionPlace> places, std::span<const Part> beliefs) {
    if (!sought_) seek_merged(places, beliefs);
  }
  /// Steps beliefs, all in a few calls of the machine's map, and hands on what comes of each, in their order.
  /// @param take  is given the number of the belief and its distribution after the step, which it may change
  void step(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
            const std::function<void(std::size_t, AfterStep<Most>&)>& take);

 private:
  struct Slopes;
  struct Cell;

  Eigen::Index states() const { return static_cast<Eigen::Index>(stepper_.states()); }
  Eigen::Index size() const { return static_cast<Eigen::Index>(stepper_.size()); }
  std::size_t pairs() const { return used_.size() + straight_.size(); }
  std::size_t pair_start(std::size_t trial) const { return trial * points_ + (lattice_.scores.empty() ? 1 : 0); }
  std::size_t lattice_start(std::size_t trial) const { return pair_start(trial) + 2 * pairs(); }
  std::size_t centre_of(std::size_t trial) const;
  std::size_t spacings_beside() const;
  double beside() const;
  void add_points(const TransitionPlace& place, const Part& belief, const Matrix& root);
  void run_points(std::size_t trials);
  bool not_asked(std::size_t point) const;
  bool told(std::size_t trial);
  Matrix first_differences(const MachineStepper& stepper, std::size_t at, const Vector* centre, Matrix& bend) const;
  void add_pairs(MachineStepper& stepper, const TransitionPlace& place, const Vector& mean, const Matrix& root,
                 const Vector& scores, const Vector& mirrored) const;
  std::optional<std::size_t> point_that_goes_on(std::size_t trial) const;
  void take_slopes_aside(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                         std::span<const Matrix> roots);
  Matrix mixed_differences(std::size_t trial, std::size_t axis) const;
  Slopes slopes(std::size_t trial) const;
  Matrix columns(const Matrix& slope, const Matrix& root) const;
  Part part(const Slopes& slopes, const Part& belief, const Matrix& root) const;
  Cell cell(std::size_t trial, std::size_t point, std::span<const FailureLine<Most>> lines, bool wide) const;
  struct Bend;
  Bend bend_at(std::size_t trial, const Cell& cell) const;
  void take_cell(Part& part, std::size_t trial, const Cell& cell) const;
  void seek_merged(std::span<const TransitionPlace> places, std::span<const Part> beliefs);
  Matrix turned(const TransitionPlace& place, const Part& belief, Matrix root);
  Eigen::Index bent() const { return bent_ ? static_cast<Eigen::Index>(lattice_.scores.size()) : 0; }
  void widen(Part& part, Matrix& columns) const;
  double add_cells(BeliefMixture<Most>& belief, std::size_t trial, const Slopes& slopes, const Part& common,
                   const Matrix& straight, std::span<const FailureLine<Most>> lines, bool wide) const;
  void off_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief, const Matrix& root) const;
  void on_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief, const Matrix& root,
                  std::span<const FailureLine<Most>> lines, const FailureEdges<Most>& edges) const;

  MachineStepper& stepper_;
  ScoreLattice lattice_;                // Its first score is the failing one.
  std::optional<AxisPolynomial> axis_;  // It is there if the lattice is over one score and no trial may fail.
  bool fails_;
  std::size_t shared_;
  bool bent_;
  double outliers_;
  std::vector<std::size_t> straight_;  // scores that are not on the lattice
  std::vector<Eigen::Index> used_;     // columns of the roots that move points
  std::size_t points_ = 0;             // of a trial

  // An offset that moves the state as a score of the lattice does.
  struct Merged {
    Eigen::Index offset = 0;  // its place in the point
    std::size_t axis = 0;     // of the lattice
    double ratio = 0;         // what a unit of it does, in what a unit of the score does
  };
  std::optional<Merged> merged_;
  bool sought_ = false;
  std::vector<Vector> carried_;  // by belief: of the part's vector, what moves with a unit of the merged score

  // Slopes about a point of the lattice, for a belief whose mean fails with all scores at zero.
  struct Aside {
    std::size_t point;  // of the lattice
    Matrix first, bend;
  };
  std::map<std::size_t, Aside> aside_;  // by belief
};

}  // namespace metastable::analysis
