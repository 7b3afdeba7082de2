#include "dynamics/return_map/landing_quadrature.h"

#include <gtest/gtest.h>

#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <functional>

#include "dynamics/return_map/landing_density.h"
#include "dynamics/return_map/rest_probability.h"
#include "dynamics/wheel/coulomb_law.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

double expectation(const WheelMap& map, double state, const std::vector<double>& breaks,
                   const std::function<double(double)>& f) {
  std::vector<std::pair<double, double>> points;
  landing_points(map, state, 0, breaks, points);
  double sum = 0;
  for (const auto& [next, weight] : points) sum += weight * f(next);
  return sum;
}

struct Case {
  Law law;
  double slope_deg;
  ContactNoise noise;
  double rebound_lost = 0;
};
const Case cases[] = {{Law::published, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0.1)},
                      {Law::published, 7.02, ContactNoise::normal(0.4, 0.2, 0.4, 0.2)},
                      {Law::published, 9.59, ContactNoise::normal(0.4, 0.2, 0.4, 0)},
                      {Law::published, 9.59, ContactNoise::normal(0.4, 0, 0.3, 0.1)},
                      {Law::published, 7.02, ContactNoise::empirical({{0.4, 0.4}, {0.5, 0.3}, {0.1, 0.6}})},
                      {Law::coulomb, 3, ContactNoise::normal(0.4, 0.1, 0.4, 0.1)},
                      {Law::coulomb, 2, ContactNoise::normal(0.4, 0.2, 0.3, 0.2)},
                      {Law::coulomb, 3, ContactNoise::normal(0.4, 0.1, 0.3, 0)},
                      {Law::coulomb, 3, ContactNoise::normal(0.1, 0, 0.4, 0.1)},
                      {Law::coulomb, 3, ContactNoise::normal(0.4, 0.1, 0.4, 0.1), 1.0},
                      {Law::plastic, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0.1)}};

TEST(LandingPoints, SumToTheSurvivorsAndRestIsItsProbability) {
  for (const Case& c : cases) {
    const WheelMap map = wheel_map(c.law, c.slope_deg, c.noise, c.rebound_lost);
    const double lowest = map.state_interval(0).first;
    for (const double state : {lowest, 1.3 * lowest, 2 * lowest, 4 * lowest}) {
      const std::vector<double> breaks{lowest + 0.5, lowest + 2};
      std::vector<std::pair<double, double>> points;
      const double rest = landing_points(map, state, 0, breaks, points);
      double sum = rest;
      for (const auto& [next, weight] : points) {
        EXPECT_GE(next, lowest * (1 - 1e-12));
        EXPECT_GE(weight, 0);
        sum += weight;
      }
      EXPECT_NEAR(sum, 1, 1e-11) << law_name(c.law) << ' ' << c.slope_deg << ' ' << state;
      if (c.law == Law::plastic) continue;
      const double exact = rest_probability(map, state, 0);
      EXPECT_NEAR(rest, exact, 5e-9 * exact + 1e-36) << law_name(c.law) << ' ' << c.slope_deg << ' ' << state;
    }
  }
}

TEST(LandingPoints, AgreeWithTheDensity) {
  const WheelMap map = wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.1, 0.3, 0.05));
  const double state = 30, lowest = map.state_interval(0).first, kink = 25;
  const LandingDensity density(map, state, 0);
  const auto integral = [&](const std::function<double(double)>& f, double from, double to) {
    double sum = 0;
    for (int i = 0; i < 30; ++i)
      sum += boost::math::quadrature::gauss<double, 15>::integrate(
          [&](double y) { return f(y) * density(y); }, from + (to - from) * i / 30, from + (to - from) * (i + 1) / 30);
    return sum;
  };
  const auto smooth = [](double y) { return std::exp(0.1 * y); };
  EXPECT_NEAR(expectation(map, state, {}, smooth) / integral(smooth, lowest, 60), 1, 1e-9);
  // It has a kink, and a jump, where a break says so.
  const auto bent = [&](double y) { return std::max(0.0, y - kink); };
  EXPECT_NEAR(expectation(map, state, {kink}, bent) / integral(bent, kink, 60), 1, 1e-9);
  const auto step = [&](double y) { return y > kink ? 1.0 : 0.0; };
  EXPECT_NEAR(expectation(map, state, {kink}, step) / integral(step, kink, 60), 1, 1e-9);
}

// Sticking collisions lose v0^2/2 m_n (1 - eta^2): moments of x' are those of the truncated normal.
TEST(LandingPoints, OfStickingCollisionsHaveTheMomentsOfRestitution) {
  const ContactNoise noise = ContactNoise::normal(0.4, 0.05, 0.6, 0);
  const WheelMap map = wheel_map(Law::coulomb, 6, noise);
  ASSERT_GT(0.6, coulomb_sticking_friction(map.contact_model(), map.collision(0, 1)));
  const double state = 60, none = map.after_collision(state, 0, {0, 0.6}),
               all = map.after_collision(state, 0, {1, 0.6});
  const TruncatedNormal& eta = noise.restitution();
  const double mean = eta.truncated_mean(), square = mean * mean + eta.truncated_sd() * eta.truncated_sd();
  EXPECT_NEAR(
      expectation(map, state, {}, [](double y) { return y; }) / (none + (all - none) * square + map.stance(0).gain), 1,
      1e-11);
}

TEST(LandingPoints, AreRefusedForCorrelatedContacts) {
  std::vector<std::pair<double, double>> points;
  EXPECT_NE(message_of([&] {
              landing_points(wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 0.5)), 20, 0, {},
                             points);
            }).find("correlated"),
            std::string::npos);
}

TEST(StatesOfExtremes, LeadThere) {
  const WheelMap map = wheel_map(Law::coulomb, 3, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  const double next = map.state_interval(0).first + 1,
               sticks = coulomb_sticking_friction(map.contact_model(), map.collision(0, 1));
  const std::vector<double> states = states_of_extremes(map, 0, {&next, 1});
  ASSERT_EQ(states.size(), 6u);  // eta at 0 and 1; mu at 0, at its largest loss, and where the foot sticks
  EXPECT_TRUE(std::is_sorted(states.begin(), states.end()));
  const auto leads = [&](const Contact& contact) {
    return std::any_of(states.begin(), states.end(), [&](double state) {
      return std::abs(map.after_collision(state, 0, contact) + map.stance(0).gain - next) < 1e-9;
    });
  };
  for (const double eta : {0.0, 1.0})
    for (const double mu : {0.0, sticks}) EXPECT_TRUE(leads({eta, mu})) << eta << ' ' << mu;
  // From the largest of them on, no landing lies below `next`.
  EXPECT_NEAR(map.landing_range(states.back(), 0).first, next, 1e-6);
}

}  // namespace
}  // namespace metastable::dynamics::test
