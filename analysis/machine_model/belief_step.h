#pragma once
// Carries the distribution of a machine's state over one step, for many trials at once.

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "analysis/machine_model/belief_mixture.h"
#include "analysis/machine_model/machine_stepper.h"
#include "analysis/machine_model/score_lattice.h"
#include "analysis/machine_model/score_plan.h"

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

  /// @param shared  sensors that share errors between rows
  /// @param bent    parts stay bent in the scores of the lattice, which then are the last numbers of the vector
  BeliefStep(MachineStepper& stepper, const ScorePlan& plan, std::size_t shared, bool bent);
  /// Steps beliefs, all in one call of the machine's map, and hands on what comes of each, in their order.
  /// @param take  is given the number of the belief and its distribution after the step, which it may change
  void step(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
            const std::function<void(std::size_t, AfterStep<Most>&)>& take);

 private:
  struct Slopes;
  struct Cell;
  using Interval = std::pair<double, double>;
  /// One line of the lattice along the failing score, in one trial and from one state: where on it the machine goes on.
  struct Line {
    std::size_t trial = 0, first = 0;  // of its points, of the trial's lattice
    double weight = 1;                 // of its state, among those from which the chance of failure is taken
    bool about = false;                // not from the mean, but from a state about it
    Vector from = {};                  // its state, as MachineStepper's point
    bool begins_alive = true;
    std::vector<double> edges = {};  // where going on and failing meet, ascending
    bool known = false;              // the edges
    std::vector<Interval> alive() const;
    bool like(const Line& other) const {
      return begins_alive == other.begins_alive && edges.size() == other.edges.size();
    }
  };
  struct Edge;
  struct Alike;

  Eigen::Index states() const { return static_cast<Eigen::Index>(stepper_.states()); }
  Eigen::Index size() const { return static_cast<Eigen::Index>(stepper_.size()); }
  std::size_t pairs() const { return used_.size() + straight_.size(); }
  std::size_t lattice_start(std::size_t trial) const { return trial * points_ + 1 + 2 * pairs(); }
  std::size_t lattice_points() const;
  Vector lattice_scores(std::size_t point) const;
  void add_points(const TransitionPlace& place, const Part& belief, const Matrix& root);
  std::vector<Line> lines(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                          std::span<const Matrix> roots) const;
  std::vector<Line> rough_lines(std::size_t trial, const Vector& mean) const;
  std::vector<Alike> alike(std::span<const Line> rough) const;
  bool foretell(Line& line, const Alike& group, std::span<const Line> from_mean) const;
  void move_edges(std::span<Line> about, std::span<const Line> from_mean, std::size_t telling) const;
  void find_few(std::vector<Line>& lines, const std::vector<std::vector<Line>>& rough,
                std::span<const TransitionPlace> places) const;
  std::vector<char> goes_on(std::span<Line* const> lines, std::span<const TransitionPlace> places,
                            MachineStepper& stepper) const;
  void find_edges(std::span<Line* const> lines, std::span<const TransitionPlace> places) const;
  void divide(std::vector<Edge>& edges, std::span<const TransitionPlace> places, MachineStepper& stepper) const;
  double chance_on(const Line& line) const;
  double chance_of_failure(std::span<const Line> lines) const;
  Matrix first_differences(std::size_t at, const Vector* centre, Matrix* bend, std::vector<char>* known) const;
  Slopes slopes(std::size_t trial) const;
  Matrix columns(const Matrix& slope, const Matrix& root) const;
  Part part(const Slopes& slopes, const Part& belief, const Matrix& root) const;
  Cell cell(std::size_t trial, std::size_t point, std::span<const Line> lines) const;
  struct Bend;
  Bend bend_at(std::size_t trial, const Cell& cell) const;
  void take_cell(Part& part, std::size_t trial, const Cell& cell) const;
  Eigen::Index bent() const { return bent_ ? static_cast<Eigen::Index>(plan_.lattice.size()) : 0; }
  void on_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief, const Matrix& root,
                  std::span<const Line> lines) const;

  MachineStepper& stepper_;
  ScorePlan plan_;
  std::size_t shared_;
  bool bent_;
  LatticeAxis axis_;
  std::vector<std::size_t> straight_;  // scores that are not on the lattice
  std::vector<Eigen::Index> used_;     // columns of the roots that move points
  std::size_t points_ = 0;             // of a trial
};

}  // namespace metastable::analysis
