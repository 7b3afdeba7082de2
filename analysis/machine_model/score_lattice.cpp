#include "analysis/machine_model/score_lattice.h"

#include <algorithm>
#include <cmath>

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
  return axis;
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
