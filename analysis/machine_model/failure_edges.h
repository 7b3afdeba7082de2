#pragma once
// The edges of failure of one step: the scores at which a machine goes on and those at which it fails, and the chance
// of failure that comes of them.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "analysis/machine_model/belief_mixture.h"
#include "analysis/machine_model/machine_stepper.h"
#include "analysis/machine_model/score_lattice.h"

namespace metastable::analysis {

/// One line of the lattice along the failing score, in one trial and from one state, with the edges on it.
template <int Most>
struct FailureLine {
  using Interval = std::pair<double, double>;

  std::size_t trial = 0, first = 0;     ///< first: its first point, in the trial's lattice
  double weight = 1;                    ///< of its state, among those from which the chance of failure is taken
  bool about = false;                   ///< it starts from a state about the mean, not from the mean
  BeliefVector<Most> from = {};         ///< its state, as MachineStepper's point
  bool begins_alive = true;             ///< the machine goes on below the first edge
  std::vector<double> edges = {};       ///< where going on and failing meet, ascending
  bool known = false;                   ///< the edges are
  std::vector<Interval> alive() const;  ///< the scores at which the machine goes on, ascending
  bool like(const FailureLine& other) const {
    return begins_alive == other.begins_alive && edges.size() == other.edges.size();
  }
};

/// Seeks edges by stepping states between points of the lattice.
template <int Most>
class FailureEdges {
 public:
  using Line = FailureLine<Most>;
  using Vector = BeliefVector<Most>;
  using Matrix = BeliefMatrix<Most>;
  using Part = typename BeliefMixture<Most>::Part;

  /// @param stepper  has stepped the lattice of every trial; it outlives this
  /// @param lattice  its first score is the failing one; it outlives this
  /// @param points   of a trial  @param start  of its lattice, among them
  FailureEdges(const MachineStepper& stepper, const ScoreLattice& lattice, std::size_t points, std::size_t start)
      : stepper_(stepper), lattice_(lattice), points_(points), start_(start) {}

  /// Returns lines along the failing score, trial by trial: first those from the mean, then, of trials that may fail,
  /// those from states about it, by which the chance of failure knows that the state is not known exactly.
  /// @param roots  of the beliefs' covariances  @param used  their columns that move states
  std::vector<Line> lines(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                          std::span<const Matrix> roots, std::span<const Eigen::Index> used) const;
  /// @param lines  of one trial
  double chance_of_failure(std::span<const Line> lines) const;

 private:
  struct Edge;
  struct Alike;

  std::size_t start_of(std::size_t trial) const { return trial * points_ + start_; }
  Vector scores_at(std::size_t point) const { return lattice_.template at<Vector>(point, stepper_.scores()); }
  std::vector<Line> rough_lines(std::size_t trial, const Vector& mean) const;
  std::vector<Alike> alike(std::span<const Line> rough) const;
  bool foretell(Line& line, const Alike& group, std::span<const Line> from_mean) const;
  void move_edges(std::span<Line> about, std::span<const Line> from_mean, std::size_t telling) const;
  void find_few(std::vector<Line>& lines, const std::vector<std::vector<Line>>& rough,
                std::span<const TransitionPlace> places) const;
  std::vector<char> goes_on(std::span<Line* const> lines, std::span<const TransitionPlace> places,
                            MachineStepper& stepper) const;
  void find_edges(std::span<Line* const> lines, std::span<const TransitionPlace> places) const;
  void halve(std::vector<Edge>& edges, std::span<const TransitionPlace> places, MachineStepper& stepper) const;
  double chance_on(const Line& line) const;

  const MachineStepper& stepper_;
  const ScoreLattice& lattice_;
  std::size_t points_, start_;
};

}  // namespace metastable::analysis
