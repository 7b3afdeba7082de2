#include "analysis/wheel_model/memory_of_scores.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "analysis/wheel_model/speed_filter.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/settled/landing_grid.h"

namespace metastable::analysis {
namespace {

constexpr dynamics::ContactSpread usual{0.4, 0.05, 0.38, 0.03};
constexpr double omega = 4.9, blur = 0.02;

dynamics::ExtendedWheel settled_wheel() {
  dynamics::Wheel wheel;
  wheel.leg_length.assign(8, 0.152);
  wheel.radius_of_gyration = 0.0424;
  const double slope = 7.02 * std::numbers::pi / 180;
  return {wheel, slope, dynamics::Law::settled,
          usual, {},    landing_grid(dynamics::settled_wheel(wheel, slope), 4, 6, usual)};
}

// Draws pairs of landings whose contacts' scores correlate by rho, and returns by how much their speeds' scores do.
double drawn_correlation(const dynamics::ExtendedWheel& wheel, double rho, bool next) {
  const dynamics::TruncatedNormal restitution(usual.restitution_mean, usual.restitution_sd, 0, 1);
  const dynamics::TruncatedNormal friction(usual.friction_mean, usual.friction_sd, 0);
  std::mt19937_64 bits(5);
  std::normal_distribution<double> normal;
  const auto score = [&](double a, double b) {
    const dynamics::Contact contact{restitution.at_score(a), friction.at_score(b)};
    const dynamics::StepContext context{.leg = 2};
    if (!next) {
      const double plus = wheel.omega_plus(context, omega, contact, false).value_or(0);
      return score_of_probability(wheel.after_collision(context, omega, plus).below);
    }
    const auto touch = wheel.land(context, omega, contact, false).next;
    return score_of_probability(touch ? wheel.at_next_touch(context, omega, {}, blur, *touch).speed.below
                                      : wheel.rest_share(context, omega, {}) / 2);
  };
  const double left = std::sqrt(1 - rho * rho);
  double products = 0, squares = 0;
  for (int i = 0; i < 6000; ++i) {
    const double a = normal(bits), b = normal(bits);
    const double first = score(a, b);
    const double second = score(rho * a + left * normal(bits), rho * b + left * normal(bits));
    products += first * second;
    squares += (first * first + second * second) / 2;
  }
  return products / squares;
}

TEST(MemoryOfScores, IsThatOfDrawnContacts) {
  const dynamics::ExtendedWheel wheel = settled_wheel();
  for (const bool next : {false, true}) {
    const MemoryOfScores memory = memory_of_scores(wheel, usual, omega, next ? std::optional(blur) : std::nullopt);
    for (const double rho : {-0.5, 0.3, 0.6, 0.8})
      EXPECT_NEAR(memory(rho), drawn_correlation(wheel, rho, next), 0.04) << rho << (next ? " next" : " plus");
    EXPECT_LT(memory(0.5), 0.47);
  }
}

}  // namespace
}  // namespace metastable::analysis
