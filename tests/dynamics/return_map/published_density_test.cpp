#include "dynamics/return_map/published_density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>

#include "dynamics/return_map/landing_density.h"
#include "dynamics/return_map/rest_probability.h"
#include "dynamics/return_map/vector_math.h"

namespace metastable::dynamics {
namespace {

constexpr double degree = std::numbers::pi / 180;

WheelMap wheel_map(const ContactNoise& noise, double slope_deg = 7.02) {
  return WheelMap(Wheel{}, slope_deg * degree, Law::published, noise);
}

struct Case {
  ContactNoise noise;
  double slope_deg;
};
std::vector<Case> cases() {
  return {{ContactNoise::normal(0.4, 0.1, 0.4, 0.1), 7.02},  {ContactNoise::normal(0.4, 0.1, 0.3, 0.05), 9.59},
          {ContactNoise::normal(0.4, 0.1, 0.3, 0.02), 7.02}, {ContactNoise::normal(0.4, 0.05, 0.4, 0.05), 7.02},
          {ContactNoise::normal(0.5, 0.02, 0.35, 0.1), 5.0}, {ContactNoise::normal(0.2, 0.05, 0.25, 0.03), 12.0}};
}

TEST(PublishedDensity, AgreesWithTheAdaptiveIntegral) {
  for (const Case& c : cases()) {
    const WheelMap map = wheel_map(c.noise, c.slope_deg);
    const double lowest = map.state_interval(3).first;
    for (const double state : {map.state_interval(2).first, 25.0, 45.0}) {
      std::vector<double> next, fast(40);
      for (int k = 0; k < 40; ++k) next.push_back(lowest + state * (k + 0.37) / 40);
      PublishedDensity(map, 2)(state, next, fast);
      const LandingDensity exact(map, state, 2);
      const double largest =
          exact(*std::max_element(next.begin(), next.end(), [&](double a, double b) { return exact(a) < exact(b); }));
      // The integrand turns sharply where eta = 0 meets the least loss.
      for (std::size_t k = 0; k < next.size(); ++k)
        EXPECT_NEAR(fast[k], exact(next[k]), 1e-6 * largest) << c.slope_deg << ' ' << state << ' ' << next[k];
    }
  }
}

TEST(PublishedDensity, HasRelativeAccuracyTowardsRest) {
  const WheelMap map = wheel_map(ContactNoise::normal(0.4, 0.1, 0.3, 0.02));
  const double state = 30, lowest = map.state_interval(1).first;
  std::vector<double> next, fast(6);
  for (int k = 0; k < 6; ++k) next.push_back(lowest + 0.5 * k);
  PublishedDensity(map, 0)(state, next, fast);
  const LandingDensity exact(map, state, 0);
  EXPECT_LT(exact(next[0]), 1e-15);
  for (std::size_t k = 0; k < next.size(); ++k) EXPECT_NEAR(fast[k] / exact(next[k]), 1, 1e-7) << next[k];
}

TEST(PublishedDensity, RestAgreesWithTheAdaptiveIntegralDownToTinyProbabilities) {
  double least = 1;
  for (const Case& c : cases()) {
    const WheelMap map = wheel_map(c.noise, c.slope_deg);
    for (const double state : {map.state_interval(5).first, 22.0, 30.0, 54.0}) {
      const double exact = rest_probability(map, state, 5), fast = PublishedDensity(map, 5)(state, {}, {});
      EXPECT_NEAR(fast / exact, 1, exact > 1e-15 ? 1e-8 : 1e-7) << c.slope_deg << ' ' << state << ' ' << exact;
      least = std::min(least, exact);
    }
  }
  EXPECT_LT(least, 1e-20);
}

TEST(PublishedDensity, SumsToTheSurvivors) {
  const WheelMap map = wheel_map(ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  using Rule = boost::math::quadrature::gauss<double, 20>;
  const double lowest = map.state_interval(1).first;
  std::vector<double> next, weight;
  constexpr int panels = 200;
  for (int p = 0; p < panels; ++p)
    for (std::size_t k = 0; k < 10; ++k)
      for (const double side : {-1.0, 1.0}) {
        const double half = 20.0 / panels;
        next.push_back(lowest + half * (2 * p + 1 + side * Rule::abscissa()[k]));
        weight.push_back(half * Rule::weights()[k]);
      }
  std::vector<double> density(next.size());
  const double rest = PublishedDensity(map, 0)(25, next, density);
  double sum = rest;
  for (std::size_t k = 0; k < next.size(); ++k) sum += weight[k] * density[k];
  EXPECT_NEAR(sum, 1, 2e-8);
}

// Launches slower than any survivor take a larger rounding; those too slow for that, the adaptive integral.
// --slope 8.4 --friction 0.3,0.14: the curve may have a fold there.
TEST(PublishedDensity, HoldsForLaunchesSlowerThanAnySurvivor) {
  std::vector<Case> all = cases();
  all.push_back({ContactNoise::normal(0.4, 0.1, 0.3, 0.14), 8.4});
  for (const Case& c : all) {
    const WheelMap map = wheel_map(c.noise, c.slope_deg);
    const double lowest = map.state_interval(3).first, first = map.state_interval(2).first;
    const PublishedDensity density(map, 2);
    EXPECT_LT(density.slowest(), 0.2 * first) << c.slope_deg;
    for (const double share : {0.99, 0.8, 0.6, 0.45, 0.2, 0.126}) {
      const double state = share * first;
      std::vector<double> next, fast(40), exact(40);
      for (int k = 0; k < 40; ++k) next.push_back(lowest + 2 * state * (k + 0.37) / 40);
      const double rest = density(state, next, fast), resting = rest_probability(map, state, 2);
      EXPECT_NEAR(rest, resting, 1e-8) << c.slope_deg << ' ' << state;
      const LandingDensity at(map, state, 2);
      std::transform(next.begin(), next.end(), exact.begin(), at);
      for (std::size_t k = 0; k < next.size(); ++k)
        EXPECT_NEAR(fast[k], exact[k], share > 0.4 ? 2e-6 : 1e-5) << c.slope_deg << ' ' << state << ' ' << next[k];
    }
  }
}

TEST(PublishedDensity, LeavesTheSlowestLaunchesToTheAdaptiveIntegral) {
  const WheelMap map = wheel_map(ContactNoise::normal(0.4, 0.1, 0.3, 0.14), 8.4);
  const double lowest = map.state_interval(0).first, slowest = PublishedDensity(map, 0).slowest();
  std::vector<double> next, density(40);
  for (int k = 0; k < 40; ++k) next.push_back(lowest + 0.4 * k);
  for (const double share : {0.9, 0.5, 0.1}) {
    const double state = share * slowest;
    EXPECT_EQ(map.landing_density(state, 0, next, density), rest_probability(map, state, 0));
    const LandingDensity exact(map, state, 0);
    for (std::size_t k = 0; k < next.size(); ++k) {
      EXPECT_TRUE(std::isfinite(density[k])) << state << ' ' << next[k];
      EXPECT_EQ(density[k], exact(next[k])) << state << ' ' << next[k];
    }
  }
}

TEST(PublishedDensity, CoversOnlyIndependentSpreads) {
  EXPECT_TRUE(PublishedDensity::covers(wheel_map(ContactNoise::normal(0.4, 0.1, 0.4, 0.1))));
  EXPECT_FALSE(PublishedDensity::covers(wheel_map(ContactNoise::normal(0.4, 0.1, 0.4, 0))));
  EXPECT_FALSE(PublishedDensity::covers(wheel_map(ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 0.3))));
  EXPECT_FALSE(PublishedDensity::covers(wheel_map(ContactNoise::empirical({{0.4, 0.4}}))));
  EXPECT_FALSE(PublishedDensity::covers(
      WheelMap(Wheel{}, 7.02 * degree, Law::coulomb, ContactNoise::normal(0.4, 0.1, 0.4, 0.1))));
}

TEST(VectorMath, AgreesWithTheStandardLibrary) {
  for (int k = 0; k < 5000; ++k) {
    const double x = -700.0 * k / 5000, y = std::exp(-0.13 * k);
    EXPECT_NEAR(vector_exp(x) / std::exp(x), 1, 5e-16) << x;
    EXPECT_NEAR(vector_log(y), std::log(y), 5e-16 * std::max(1.0, std::abs(std::log(y)))) << y;
  }
  EXPECT_EQ(vector_exp(0), 1);
  EXPECT_EQ(vector_log(1), 0);
}

}  // namespace
}  // namespace metastable::dynamics
