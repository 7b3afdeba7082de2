#include "dynamics/return_map/landing_range.h"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cstdint>
#include <limits>
#include <vector>

namespace metastable::dynamics {
namespace {

constexpr int steps = 16;                   // of the grid between two edges
constexpr int brent_bits = 40;              // of Brent's method
constexpr double unbounded_friction = 100;  // friction that stands for "no upper end" where the law has no break

std::vector<double> refined(const std::vector<double>& edges) {
  std::vector<double> grid{edges.front()};
  for (std::size_t e = 1; e < edges.size(); ++e)
    for (int i = 1; i <= steps; ++i)
      grid.push_back(i == steps ? edges[e] : edges[e - 1] + (edges[e] - edges[e - 1]) * i / steps);
  return grid;
}

std::vector<double> restitution_grid(const ContactNoise::Support& support) {
  if (support.restitution_lower == support.restitution_upper) return {support.restitution_lower};
  return refined({support.restitution_lower, support.restitution_upper});
}

// The grid goes up to the last break: beyond it the law is constant or jammed, and the end of the support tells which.
std::vector<double> friction_grid(const ContactNoise::Support& support, const std::vector<double>& breaks) {
  std::vector<double> edges{support.friction_lower};
  if (support.friction_lower == support.friction_upper) return edges;
  for (double b : breaks)
    if (b > support.friction_lower && b < support.friction_upper) edges.push_back(b);
  if (breaks.empty() || edges.size() == 1)
    edges.push_back(std::min(support.friction_upper, support.friction_lower + unbounded_friction));
  std::vector<double> grid = refined(edges);
  if (support.friction_upper > grid.back()) grid.push_back(std::min(support.friction_upper, 2 * grid.back()));
  return grid;
}

class Extremes {
 public:
  Extremes(const WheelMap& map, double state, int phase)
      : map_(map),
        state_(state),
        phase_(phase),
        restitution_(restitution_grid(map.noise().support())),
        friction_(friction_grid(map.noise().support(), friction_breaks(map.contact_model(), map.collision(phase, 1)))) {
  }

  // Returns the smallest sign * omega+^2.
  double least(double sign) const {
    std::size_t best_eta = 0, best_mu = 0;
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < restitution_.size(); ++i)
      for (std::size_t k = 0; k < friction_.size(); ++k)
        if (const double value = sign * after(restitution_[i], friction_[k]); value < best) {
          best = value;
          best_eta = i;
          best_mu = k;
        }
    if (best == -std::numeric_limits<double>::infinity()) return best;
    double eta = restitution_[best_eta], mu = friction_[best_mu];
    for (int round = 0; round < 4; ++round) {
      best = improve(restitution_, best_eta, eta, best, [&](double t) { return sign * after(t, mu); });
      best = improve(friction_, best_mu, mu, best, [&](double t) { return sign * after(eta, t); });
    }
    return best;
  }

 private:
  double after(double eta, double mu) const { return map_.after_collision(state_, phase_, {eta, mu}); }

  template <class F>
  static double improve(const std::vector<double>& grid, std::size_t at, double& x, double best, F f) {
    // The two sides are taken apart: there may be a kink at the grid point.
    for (const auto& [a, b] : {std::pair(at > 0 ? at - 1 : at, at), std::pair(at, std::min(at + 1, grid.size() - 1))}) {
      if (a == b) continue;
      std::uintmax_t iterations = 60;
      const auto [t, value] = boost::math::tools::brent_find_minima(f, grid[a], grid[b], brent_bits, iterations);
      if (value < best) {
        best = value;
        x = t;
      }
    }
    return best;
  }

  const WheelMap& map_;
  double state_;
  int phase_;
  std::vector<double> restitution_, friction_;
};

}  // namespace

std::pair<double, double> after_collision_range(const WheelMap& map, double state, int phase) {
  if (map.noise().is_empirical()) {
    std::pair<double, double> range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
    for (const Contact& c : map.noise().pairs()) {
      const double after = map.after_collision(state, phase, c);
      range = {std::min(range.first, after), std::max(range.second, after)};
    }
    return range;
  }
  const Extremes extremes(map, state, phase);
  return {extremes.least(1), -extremes.least(-1)};
}

}  // namespace metastable::dynamics
