#include "dynamics/step_density/published_roots.h"

#include <cmath>

namespace metastable::dynamics {

METASTABLE_WIDE void find_friction_roots(const PublishedLoss& of, FrictionRoots& roots, std::size_t count) {
  const auto [a, b, c, loss, kept, pull, time, usual_friction] = of;
  for (std::size_t i = 0; i < count; ++i) {
    const double eta = roots.restitution[i];
    const double alpha = 1 - eta * eta * kept, beta = (1 + eta) * (1 + eta);
    const double delta = pull * (1 + eta) * time * roots.duration[i];
    const double steady = beta + delta * (a - b * usual_friction);
    const double q2 = steady * c - loss * b * b, q1 = b * (2 * loss * a - alpha - steady);
    const double q0 = a * (alpha - loss * a);
    const double discriminant = q1 * q1 - 4 * q2 * q0, root = std::sqrt(discriminant > 0 ? discriminant : 0.0);

    // It takes one Newton step, no further than the quadratic's other side.
    double mu = q1 <= 0 ? (root - q1) / (2 * q2) : -2 * q0 / (q1 + root);
    const auto slope = [&](double d) {
      return -alpha * b + (beta + delta * d) * (2 * c * mu - b) - delta * b * mu * (c * mu - b) + 2 * loss * b * d;
    };
    const auto refine = [&](double side, double& rate) {
      const double d = a - b * mu;
      const double left = (alpha * d + (beta + delta * d) * mu * (c * mu - b) - loss * d * d) / slope(d);
      mu -= std::abs(left) < root / std::abs(4 * q2) ? left : 0.0;
      const double there = a - b * mu, steep = side * slope(there), least = 0.5 * root;
      rate = there * there / (steep < least ? least : steep);
    };
    double upper_rate, lower_rate;
    refine(1, upper_rate);
    const double upper = mu, start = q1 <= 0 ? 2 * q0 / (root - q1) : -(q1 + root) / (2 * q2);
    mu = start;
    refine(-1, lower_rate);
    roots.discriminant[i] = discriminant;
    roots.upper[i] = upper;
    roots.upper_rate[i] = upper_rate;
    roots.lower[i] = q2 > 0 && start > 0 && mu > 0 && mu < upper ? mu : 0.0;
    roots.lower_rate[i] = lower_rate;
  }
}

}  // namespace metastable::dynamics
