#include "analysis/wheel_model/memory_of_scores.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "analysis/wheel_model/speed_filter.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t orders = 4;                 // 0 to 3
constexpr double farthest_score = 4, step = 0.4;  // of a trapezoidal sum

// Returns Hermite's polynomials of a standard normal, of variance 1.
std::array<double, orders> hermite(double x) {
  return {1, x, (x * x - 1) / std::sqrt(2.0), (x * x * x - 3 * x) / std::sqrt(6.0)};
}

}  // namespace

MemoryOfScores memory_of_scores(const dynamics::ExtendedWheel& wheel, const dynamics::ContactSpread& contact,
                                double omega, std::optional<double> blur) {
  const dynamics::TruncatedNormal restitution(contact.restitution_mean, contact.restitution_sd, 0, 1);
  const dynamics::TruncatedNormal friction(contact.friction_mean, contact.friction_sd, 0);
  const auto score_at = [&](const dynamics::StepContext& context, const dynamics::Contact& drawn) {
    double below = 0;
    if (blur) {
      const auto next = wheel.land(context, omega, drawn, false).next;
      below = next ? wheel.at_next_touch(context, omega, {}, *blur, *next).speed.below
                   : wheel.rest_share(context, omega, {}) / 2;
    } else {
      below = wheel.after_collision(context, omega, wheel.omega_plus(context, omega, drawn, false).value_or(0)).below;
    }
    return score_of_probability(below);
  };
  constexpr int steps = static_cast<int>(farthest_score / step);
  std::array<std::array<double, orders>, orders> mean{};  // of the score times two polynomials
  double square = 0;                                      // mean one of the score
  for (int leg = 0; leg < wheel.legs(); ++leg)
    for (int i = -steps; i <= steps; ++i)
      for (int j = -steps; j <= steps; ++j) {
        const double a = i * step, b = j * step;
        const double weight = dynamics::normal_density(a) * dynamics::normal_density(b) * step * step / wheel.legs();
        const double score = score_at({.leg = leg}, {restitution.at_score(a), friction.at_score(b)});
        const auto of_eta = hermite(a), of_mu = hermite(b);
        for (std::size_t m = 0; m < orders; ++m)
          for (std::size_t n = 0; m + n < orders; ++n) mean[m][n] += weight * score * of_eta[m] * of_mu[n];
        square += weight * score * score;
      }
  std::array<double, orders> share{};
  for (std::size_t m = 0; m < orders; ++m)
    for (std::size_t n = 0; m + n < orders; ++n) share[m + n] += mean[m][n] * mean[m][n] / square;
  return {share[1], share[2], share[3], 1 - share[1] - share[2] - share[3]};
}

}  // namespace metastable::analysis
