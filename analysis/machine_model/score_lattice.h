#pragma once
// A lattice of normal scores: where a map bends in its scores, the next state is a mixture over the lattice's cells,
// each of which is normal; where the map fails for some scores, cells are cut at the edge. The plan of a machine says
// which of its scores are on the lattice.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// The part of a cell, N(centre, spread^2), inside some intervals.
struct CellPart {
  double mass = 1, mean = 0, variance = 0;
};
/// @param inside  intervals, ascending
CellPart cell_part(double centre, double spread, std::span<const std::pair<double, double>> inside);

/// One axis of a lattice: the standard normal as a mixture of normals of sd `spread` at equal distances, exact to 1e-4
/// of its density out to five sds. The first and last points have no such cell: they serve for
/// slopes, and as the tails of an outlier's score.
struct LatticeAxis {
  double spread = 0, spacing = 0;
  std::vector<double> points;   ///< ascending
  std::vector<double> weights;  ///< of the cells, 0 for the first and the last; they add up to 1
  std::vector<double> shares;   ///< of the points, by which a mean over the standard normal is taken; they add up to 1
  /// The weights that the cells have for an outlier's score, which is drawn from N(0, outlier_width^2); they add up to
  /// 1. The first and the last are those of the tails, which hold all scores beyond the other cells.
  std::vector<double> wide_weights;

  bool in_tail(std::size_t point) const { return point == 0 || point + 1 == points.size(); }
  /// Returns the part of an outlier's score that lies in the tail of the first or the last point and inside some
  /// intervals, ascending; its mass is that share of the tail's.
  CellPart tail(std::size_t point, std::span<const std::pair<double, double>> inside) const;
};

/// @param axes  of the lattice, 1 or 2: cells of two are wider
/// @param bent  whether cells know how the map bends within them: they may be wider then
LatticeAxis lattice_axis(int axes, bool bent);

/// Tells what a map does at all points of an axis from what it does at some of them: a polynomial through nodes, which
/// are denser towards the ends, held against what the map does in the middle of the widest gaps between them.
class AxisPolynomial {
 public:
  /// @param axis  of a lattice, of two points or more
  explicit AxisPolynomial(const LatticeAxis& axis);
  const std::vector<std::size_t>& asked() const { return asked_; }  ///< indices of points, ascending
  /// Returns [points x functions] what the polynomials say. @param at_asked  [points asked x functions]
  Eigen::MatrixXd told(const Eigen::MatrixXd& at_asked) const { return told_ * at_asked; }
  /// Says whether the polynomials may stand for the functions. At no point may one of the two highest powers matter,
  /// and in no wide gap may a polynomial be off, by more than a ten-thousandth of how far its function moves in a unit
  /// of the score, on average from end to end; what is compared is weighed by exp(-z^2 / 8) at the score z. A
  /// polynomial does not stand for a function that has the same value at both ends and others between.
  bool holds(const Eigen::MatrixXd& at_asked) const;

 private:
  std::vector<std::size_t> asked_;
  Eigen::MatrixXd told_;  // [points x asked]
  Eigen::MatrixXd off_;   // [what must be small x asked]: highest powers at each point, and gaps, weighed
  double length_ = 0;     // of the axis
};

/// A lattice over some of a machine's scores.
struct ScoreLattice {
  std::vector<std::size_t> scores;  ///< that it is over, at most two; the first one runs fastest
  LatticeAxis axis;                 ///< of each

  /// Counts its points; none without scores.
  std::size_t points() const {
    std::size_t count = scores.empty() ? 0 : 1;
    for (std::size_t b = 0; b < scores.size(); ++b) count *= axis.points.size();
    return count;
  }
  /// Returns all `count` scores at a point: those that it is not over are zero.
  template <class Vector>
  Vector at(std::size_t point, std::size_t count) const {
    Vector fresh = Vector::Zero(static_cast<typename Vector::Index>(count));
    for (const std::size_t score : scores) {
      fresh[static_cast<typename Vector::Index>(score)] = axis.points[point % axis.points.size()];
      point /= axis.points.size();
    }
    return fresh;
  }
};

/// Scores that are taken by a lattice, at most two, and the one along which the edge of failure is sought, one of them.
/// All others are taken as straight: what they add to the next state is normal.
struct ScorePlan {
  std::vector<std::size_t> lattice;
  std::optional<std::size_t> failing;
  std::vector<std::string> notes;  ///< what failures it leaves out, a sentence each
};

/// Says that the map fails at zero scores from most rows that went on.
class FailsFromMostRows : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Finds out where the map bends by more than one part in a thousand of its slope, at every measured row, and whether
/// it fails within four and a half sds of its scores or did fail.
/// @param nominal  without spreads and memory: a measured row is all of a point
/// @throws std::invalid_argument for a hypothesis with these, where the map returns no finite state from a measured
///   row  @throws FailsFromMostRows where it fails from most of them; std::runtime_error where it fails at two scores
///   together alone
ScorePlan score_plan(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& nominal);

}  // namespace metastable::analysis
