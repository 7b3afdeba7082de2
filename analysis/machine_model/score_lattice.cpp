#include "analysis/machine_model/score_lattice.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "analysis/machine_model/machine_hypothesis.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

// Cells of sd s at distances of 0.92 s add up to a normal density within 2 exp(-2 pi^2 / 0.92^2) = 2e-10 of it.
constexpr double spacing_share = 0.92;
// Sds of cells, and how far out the outermost are, in sds of the cells' centres. Of walks of the compass gait, whose
// map bends, cells of 0.5 sd leave an error of a sixteenth of its standard error in the sd of the slopes, cells of 0.7
// three times as much.
struct CellSize {
  double spread, reach;
};
constexpr CellSize fine{0.4, 5.6}, for_bent{0.5, 4.7}, on_two_axes{0.7, 4.7};
constexpr int most_nodes = 9;        // A polynomial goes through so many points of an axis.
constexpr std::size_t wide_gap = 4;  // The map is asked in the middle of gaps of so many spacings between them, too.
constexpr double told_share = 1e-4;  // A polynomial may be off by this share of the move in a unit of the score,
constexpr double told_width = 8;     //   weighed by exp(-z^2 / told_width) at the score z,
constexpr double told_rounding = 1e-12;  //   or by this share of the largest value.

// Returns where the upper tail of an outlier's score begins.
double tail_begin(const LatticeAxis& axis) { return axis.points.back() - 0.5 * axis.spacing; }

std::vector<double> wide_weights(const LatticeAxis& axis) {
  const double sd = std::sqrt(outlier_width * outlier_width - axis.spread * axis.spread);
  std::vector<double> weights;
  double sum = 0;
  for (std::size_t i = 0; i < axis.points.size(); ++i) {
    weights.push_back(axis.in_tail(i) ? dynamics::normal_cdf(-tail_begin(axis) / outlier_width)
                                      : axis.spacing / sd * dynamics::normal_density(axis.points[i] / sd));
    sum += weights.back();
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace

LatticeAxis lattice_axis(int axes, bool bent) {
  LatticeAxis axis;
  const CellSize& size = axes > 1 ? on_two_axes : bent ? for_bent : fine;
  axis.spread = size.spread;
  axis.spacing = spacing_share * axis.spread;
  const double variance = 1 - axis.spread * axis.spread;
  const int half = static_cast<int>(std::ceil(size.reach * std::sqrt(variance) / axis.spacing)) + 1;
  double sum = 0, whole = 0;
  for (int i = -half; i <= half; ++i) {
    axis.points.push_back(i * axis.spacing);
    const double weight = std::abs(i) == half ? 0 : std::exp(-0.5 * axis.points.back() * axis.points.back() / variance);
    axis.weights.push_back(weight);
    sum += weight;
    axis.shares.push_back(dynamics::normal_density(axis.points.back()));
    whole += axis.shares.back();
  }
  for (double& weight : axis.weights) weight /= sum;
  for (double& share : axis.shares) share /= whole;
  axis.wide_weights = wide_weights(axis);
  return axis;
}

CellPart LatticeAxis::tail(std::size_t point, std::span<const std::pair<double, double>> inside) const {
  const double begin = tail_begin(*this);
  std::vector<std::pair<double, double>> clipped;
  for (auto [from, to] : inside) {
    (point == 0 ? to : from) = point == 0 ? std::min(to, -begin) : std::max(from, begin);
    if (from < to) clipped.emplace_back(from, to);
  }
  CellPart part = cell_part(0, outlier_width, clipped);
  part.mass /= dynamics::normal_cdf(-begin / outlier_width);
  return part;
}

// The basis of Chebyshev's polynomials on the axis keeps the equations for the nodes well conditioned.
AxisPolynomial::AxisPolynomial(const LatticeAxis& axis) {
  const std::size_t n = axis.points.size();
  const auto last = static_cast<double>(n - 1);
  std::vector<std::size_t> nodes, gaps;
  for (int k = 0; k < most_nodes; ++k) {
    const double share = 0.5 - 0.5 * std::cos(std::numbers::pi * k / (most_nodes - 1));
    const auto node = static_cast<std::size_t>(std::lround(share * last));
    if (!nodes.empty() && nodes.back() == node) continue;
    if (!nodes.empty() && node - nodes.back() >= wide_gap) gaps.push_back((nodes.back() + node) / 2);
    nodes.push_back(node);
  }
  std::ranges::merge(nodes, gaps, std::back_inserter(asked_));
  const auto place = [&](std::size_t point) { return std::ranges::lower_bound(asked_, point) - asked_.begin(); };
  length_ = axis.points.back() - axis.points.front();
  const auto count = static_cast<Eigen::Index>(nodes.size()), points = static_cast<Eigen::Index>(n);
  const auto basis = [&](std::size_t point) {
    Eigen::RowVectorXd row(count);
    const double angle = std::acos(std::clamp(2 * (axis.points[point] - axis.points.front()) / length_ - 1, -1.0, 1.0));
    for (Eigen::Index power = 0; power < count; ++power) row[power] = std::cos(static_cast<double>(power) * angle);
    return row;
  };
  const auto weight = [&](std::size_t point) {
    return std::exp(-axis.points[point] * axis.points[point] / told_width);
  };
  Eigen::MatrixXd at_nodes(count, count), at_points(points, count),
      chosen = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(asked_.size()));
  for (Eigen::Index k = 0; k < count; ++k) {
    at_nodes.row(k) = basis(nodes[static_cast<std::size_t>(k)]);
    chosen(k, place(nodes[static_cast<std::size_t>(k)])) = 1;
  }
  for (Eigen::Index p = 0; p < points; ++p) at_points.row(p) = basis(static_cast<std::size_t>(p));
  const Eigen::MatrixXd coefficients = at_nodes.partialPivLu().solve(chosen);  // [powers x asked]
  told_ = at_points * coefficients;
  off_.resize(2 * points + static_cast<Eigen::Index>(gaps.size()), chosen.cols());
  for (Eigen::Index p = 0; p < points; ++p)
    for (Eigen::Index power = 0; power < 2; ++power)
      off_.row(2 * p + power) =
          weight(static_cast<std::size_t>(p)) * at_points(p, count - 1 - power) * coefficients.row(count - 1 - power);
  for (std::size_t g = 0; g < gaps.size(); ++g) {
    auto row = off_.row(2 * points + static_cast<Eigen::Index>(g));
    row = told_.row(static_cast<Eigen::Index>(gaps[g]));
    row[place(gaps[g])] -= 1;
    row *= weight(gaps[g]);
  }
}

bool AxisPolynomial::holds(const Eigen::MatrixXd& at_asked) const {
  const Eigen::RowVectorXd most = (off_ * at_asked).cwiseAbs().colwise().maxCoeff();
  const Eigen::RowVectorXd moves = (at_asked.bottomRows<1>() - at_asked.topRows<1>()).cwiseAbs() / length_;
  const Eigen::RowVectorXd rounding = told_rounding * at_asked.cwiseAbs().colwise().maxCoeff();
  return (most.array() <= told_share * moves.array() + rounding.array()).all();
}

CellPart cell_part(double centre, double spread, std::span<const std::pair<double, double>> inside) {
  CellPart part{0, centre, spread * spread};
  double first = 0, second = 0;  // moments of the standardised part, times its mass
  for (const auto& [from, to] : inside) {
    const double a = (from - centre) / spread, b = (to - centre) / spread;
    const double mass =
        a > 0 ? dynamics::normal_cdf(-a) - dynamics::normal_cdf(-b) : dynamics::normal_cdf(b) - dynamics::normal_cdf(a);
    const double at_a = std::isfinite(a) ? dynamics::normal_density(a) : 0;
    const double at_b = std::isfinite(b) ? dynamics::normal_density(b) : 0;
    part.mass += mass;
    first += at_a - at_b;
    second += mass + (std::isfinite(a) ? a * at_a : 0) - (std::isfinite(b) ? b * at_b : 0);
  }
  if (!(part.mass > 1e-12)) return {0, centre, spread * spread};
  const double mean = first / part.mass;
  part.mean = centre + spread * mean;
  part.variance = spread * spread * std::max(0.0, second / part.mass - mean * mean);
  return part;
}

}  // namespace metastable::analysis
