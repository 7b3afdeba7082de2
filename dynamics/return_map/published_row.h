#pragma once
// The published law's loss in one collision, for all landings from one state: what does not depend on the landing, and
// where the loss has a given level.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "dynamics/numerics/square.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/return_map/vector_math.h"

/// Of PublishedDensity, which gives the loss g and its terms.
namespace metastable::dynamics::published {

inline constexpr std::size_t most_points = 48;  ///< of the grid over eta
inline constexpr double split = 0.02;           ///< eta below which ln eta is the variable
inline constexpr double pi2 = std::numbers::pi * std::numbers::pi;

/// Holds everything of one state that does not depend on the landing.
struct PublishedRow {
  double a0, a1, t0, t1, kappa;
  double rounding;                                                // of eta in s where mu < mu_c
  double sticking;                                                // mu_c, or 0
  double normal_sticking;                                         // A there
  double friction_middle;                                         // the usual mu
  double s_usual;                                                 // s at the usual eta
  double potential_zero;                                          // kappa s at eta = 0, where mu < mu_c
  double least, level_least;                                      // mu of the least loss at eta = 0, g there
  double restitution, restitution_rate, friction, friction_rate;  // means and 1/sd
  double lower, upper;                                            // of eta
  std::size_t points;
  std::array<double, most_points> eta, a, b_middle, exponent;  // on the grid: 1 - eta^2, b + c A, z^2/2
  std::size_t tail_points;                                     // of -ln eta, 0 where eta stays above split
  std::array<double, most_points> y, y_a, y_b_middle, y_exponent;
};

struct Root {
  double at, weight;  // weight: 1/|g'|
};

// Finds mu > mu_c with g(eta, mu) = level, for b_normal = b + c A with an A near that of the answer.
[[gnu::always_inline]] inline double rough_friction(const PublishedRow& r, double a, double b_normal, double level) {
  const double second = b_normal * r.t1 - level * r.a1 * r.a1;
  const double first = 2 * level * r.a0 * r.a1 - a * r.a1 - r.t0 * b_normal;
  const double zeroth = r.a0 * (a - level * r.a0);
  return (std::sqrt(std::max(0.0, first * first - 4 * second * zeroth)) - first) / (2 * second);
}

// Finds the same to rounding, with A at `near`, a friction not far away, and one step of Newton's method.
[[gnu::always_inline]] inline Root friction_at(const PublishedRow& r, double eta, double log_eta, double level,
                                               double near) {
  const double more = 1 + eta, a = (1 - eta) * more, b = more * more;
  const double c = r.kappa * more * std::sqrt(pi2 + log_eta * log_eta);
  double mu = rough_friction(r, a, b + c * (r.a0 - r.a1 * near), level);
  const auto slope = [&](double normal, double product, double bc) __attribute__((always_inline)) {
    return r.a1 * (2 * level * normal - a - c * product) + (2 * r.t1 * mu - r.t0) * bc;  // of (g - level) A^2
  };
  double normal = r.a0 - r.a1 * mu, product = mu * (r.t1 * mu - r.t0), bc = b + c * normal;
  mu -= ((a - level * normal) * normal + product * bc) / slope(normal, product, bc);
  normal = r.a0 - r.a1 * mu;
  product = mu * (r.t1 * mu - r.t0);
  bc = b + c * normal;
  return {mu, normal * normal / slope(normal, product, bc)};
}

// Finds eta with g(eta, mu) = level up to the change of s, for mu < mu_c; ratio = mu B/A.
[[gnu::always_inline]] inline double rough_restitution(const PublishedRow& r, double ratio, double normal,
                                                       double level) {
  const double e = r.kappa * ratio * normal * r.s_usual, half = 0.5 * (2 * ratio + e), first = 1 - ratio;
  return (half + std::sqrt(std::max(0.0, half * half + first * (1 + ratio + e - level * normal)))) / first;
}

[[gnu::always_inline]] inline Root restitution_at(const PublishedRow& r, double mu, double level) {
  const double normal = r.a0 - r.a1 * mu, ratio = mu * (r.t1 * mu - r.t0) / normal;
  const double pull = r.kappa * ratio * normal;
  double eta = std::max(0.0, rough_restitution(r, ratio, normal, level)), slope = 1;
  for (int i = 0; i < 2; ++i) {  // the quadratic that s leaves when it is replaced by its tangent
    const double far2 = eta * eta + r.rounding * r.rounding, log_far = 0.5 * vector_log(far2);
    const double s = std::sqrt(pi2 + log_far * log_far), speed = pull * log_far * eta / (far2 * s);
    const double p0 = 1 + ratio + pull * s - speed * eta, p1 = ratio - 1 + speed;
    slope = std::sqrt(std::max(0.0, square(p0 + p1) - 4 * p1 * (p0 - level * normal)));
    eta = std::max(0.0, -(p0 + p1 + slope) / (2 * p1));
  }
  return {eta, normal / slope};
}

[[gnu::always_inline]] inline double friction_exponent(const PublishedRow& r, double mu) {
  return 0.5 * square((mu - r.friction) * r.friction_rate);
}
[[gnu::always_inline]] inline double restitution_exponent(const PublishedRow& r, double eta) {
  return 0.5 * square((eta - r.restitution) * r.restitution_rate);
}

// Finds where, below mu_c, the curve leaves eta = 0, on this side of the least loss (-1, +1); `least` if it does not.
[[gnu::always_inline]] inline double reaching_zero(const PublishedRow& r, double level, double side) {
  const double c = r.potential_zero, b = 1 + c * (r.a0 - r.a1 * r.least);
  const double second = b * r.t1 - level * r.a1 * r.a1;
  const double first = 2 * level * r.a0 * r.a1 - r.a1 - r.t0 * b, zeroth = r.a0 * (1 - level * r.a0);
  double mu = (side * std::sqrt(std::max(0.0, first * first - 4 * second * zeroth)) - first) / (2 * second);
  for (int i = 0; i < 3; ++i) {
    const double normal = r.a0 - r.a1 * mu, product = mu * (r.t1 * mu - r.t0), bc = 1 + c * normal;
    const double derivative = r.a1 * (2 * level * normal - 1 - c * product) + (2 * r.t1 * mu - r.t0) * bc;
    const double step = ((1 - level * normal) * normal + product * bc) / derivative;
    mu -= side * derivative > 0 ? step : 0;
  }
  return level > r.level_least ? mu : r.least;
}

/// Returns s at eta, taken at sqrt(eta^2 + rounding^2).
double stretched(double eta, double rounding);
/// Sets what a row has of the contact; geometry, kappa, rounding and mu_c are set.
void set_contact(PublishedRow& r, const TruncatedNormal& restitution, const TruncatedNormal& friction);
/// Sets a row's values on the grid over eta; its contact is set. @param s  on the grid
void set_grid(PublishedRow& r, const std::vector<double>& grid, const std::vector<double>& s, double lower);
/// Sets a row's values on the grid over -ln eta. @param restitution  eta there
void set_tail(PublishedRow& r, const std::vector<double>& tail, const std::vector<double>& restitution);
/// Finds the least loss at eta = 0, below mu_c, by halving.
void set_least(PublishedRow& r);
/// Returns a level that no loss is below: it falls with eta below mu_c, where the least one is.
/// @param s_upper  s at the largest eta
double least_level(const PublishedRow& r, double s_upper);

}  // namespace metastable::dynamics::published
