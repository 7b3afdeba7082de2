#include "dynamics/return_map/published_row.h"

namespace metastable::dynamics::published {

double stretched(double eta, double rounding) {  // s
  const double log_eta = 0.5 * std::log(std::max(eta * eta + rounding * rounding, 1e-300));
  return std::sqrt(pi2 + log_eta * log_eta);
}

void set_contact(PublishedRow& r, const TruncatedNormal& restitution, const TruncatedNormal& friction) {
  r.restitution = restitution.mean();
  r.restitution_rate = 1 / restitution.sd();
  r.friction = friction.mean();
  r.friction_rate = 1 / friction.sd();
  r.friction_middle = std::max(r.friction, r.sticking);
  if (r.a1 > 0) r.friction_middle = std::min(r.friction_middle, 0.5 * r.a0 / r.a1);
  r.s_usual = stretched(std::clamp(r.restitution, 0.1, 1.0), 0);
  r.potential_zero = r.kappa * stretched(r.rounding, 0);
}

void set_grid(PublishedRow& r, const std::vector<double>& grid, const std::vector<double>& s, double lower) {
  const double normal_middle = r.a0 - r.a1 * r.friction_middle;
  r.lower = lower;
  r.upper = grid.back();
  r.points = grid.size();
  for (std::size_t q = 0; q < grid.size(); ++q) {
    const double eta = r.eta[q] = grid[q];
    r.a[q] = 1 - eta * eta;
    r.b_middle[q] = (1 + eta) * (1 + eta) + r.kappa * (1 + eta) * s[q] * normal_middle;
    r.exponent[q] = restitution_exponent(r, eta);
  }
}

void set_tail(PublishedRow& r, const std::vector<double>& tail, const std::vector<double>& restitution) {
  const double normal_middle = r.a0 - r.a1 * r.friction_middle;
  r.tail_points = tail.size();
  for (std::size_t q = 0; q < tail.size(); ++q) {
    const double y = r.y[q] = tail[q], eta = restitution[q], more = 1 + eta;
    r.y_a[q] = 1 - eta * eta;
    r.y_b_middle[q] = more * more + r.kappa * more * std::sqrt(pi2 + y * y) * normal_middle;
    r.y_exponent[q] = y + restitution_exponent(r, eta);
  }
}

void set_least(PublishedRow& r) {
  double low = 0, high = r.sticking;
  for (int i = 0; i < 40; ++i) {
    const double mu = 0.5 * (low + high), normal = r.a0 - r.a1 * mu;
    const double product = mu * (r.t1 * mu - r.t0), rise = (2 * r.t1 * mu - r.t0) * normal;
    const double slope =
        r.a1 * normal + rise + 2 * product * r.a1 + r.potential_zero * normal * (rise + product * r.a1);
    (slope < 0 ? low : high) = mu;
  }
  r.least = low;
  const double normal_least = r.a0 - r.a1 * r.least, product_least = r.least * (r.t1 * r.least - r.t0);
  r.level_least = (1 + product_least * (1 / normal_least + r.potential_zero)) / normal_least;
}

double least_level(const PublishedRow& r, double s_upper) {
  double least = 0;
  constexpr int steps = 16;
  for (int k = 0; k < steps; ++k) {
    const double mu = r.sticking * k / steps, normal = r.a0 - r.a1 * mu, ratio = mu * (r.t1 * mu - r.t0) / normal;
    const double more = 1 + r.upper;
    least = std::min(least, more * ((1 - r.upper + more * ratio) / normal + r.kappa * s_upper * ratio));
  }
  return least - 0.01;  // what steps of mu may miss
}

}  // namespace metastable::dynamics::published
