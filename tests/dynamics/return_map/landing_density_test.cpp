#include "dynamics/return_map/landing_density.h"

#include <gtest/gtest.h>

#include <boost/math/quadrature/gauss.hpp>

#include "dynamics/return_map/rest_probability.h"
#include "dynamics/return_map/rough_terrain.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

/// Returns the integral of the density over all survivors, on `panels` equal panels.
double total(const WheelMap& map, double state, double upper, int panels) {
  const LandingDensity density(map, state, 0);
  const double lower = map.state_interval(0).first;
  double sum = 0;
  for (int i = 0; i < panels; ++i)
    sum += boost::math::quadrature::gauss<double, 15>::integrate(density, lower + (upper - lower) * i / panels,
                                                                 lower + (upper - lower) * (i + 1) / panels);
  return sum;
}

TEST(LandingDensity, SumsToTheSurvivors) {
  for (const double mean : {0.3, 0.4}) {
    const WheelMap map = wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.1, mean, 0.05));
    for (const double state : {20.0, 30.0, 54.0})
      EXPECT_NEAR(total(map, state, 1.6 * state + 10, 40), 1 - rest_probability(map, state, 0), 1e-9)
          << mean << ' ' << state;
  }
}

TEST(LandingDensity, SumsToTheSurvivorsWhereTheSpreadsReachTheirBounds) {
  const WheelMap map = wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.2, 0.4, 0.2));
  // There is a singularity of the size of both bounds' densities: fixed nodes converge slowly here.
  EXPECT_NEAR(total(map, 30, 45, 60), 1 - rest_probability(map, 30, 0), 3e-4);
}

TEST(LandingDensity, SumsToTheSurvivorsUnderCoulomb) {
  const WheelMap map = wheel_map(Law::coulomb, 3.0, ContactNoise::normal(0.4, 0.05, 0.4, 0.1));
  EXPECT_NEAR(total(map, 20, 40, 400), 1 - rest_probability(map, 20, 0), 1e-3);
}

TEST(LandingDensity, OfOneRestitutionIsThatOfFriction) {
  const WheelMap map = wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0, 0.3, 0.02));
  EXPECT_NEAR(total(map, 24, 40, 40), 1 - rest_probability(map, 24, 0), 1e-10);
}

TEST(LandingDensity, OfRoughTerrainSumsToTheSurvivors) {
  const RoughTerrainWheel wheel({.mean_slope_rad = 8 * degree, .sd_slope_rad = 2 * degree});
  for (const double state : {0.2, 1.0}) {
    const auto density = [&](double next) {
      double at = 0;
      wheel.landing_density(state, 0, {&next, 1}, {&at, 1});
      return at;
    };
    double sum = 0;
    for (int i = 0; i < 20; ++i)
      sum += boost::math::quadrature::gauss<double, 20>::integrate(density, i * 0.3, (i + 1) * 0.3);
    EXPECT_NEAR(sum, 1 - *wheel.rest_probability(state, 0), 1e-13);
  }
}

TEST(LandingDensity, IsRefusedWhereThereIsNone) {
  EXPECT_THROW(LandingDensity(wheel_map(Law::plastic, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0.1)), 20, 0),
               std::invalid_argument);
  EXPECT_THROW(LandingDensity(wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0)), 20, 0),
               std::invalid_argument);
  EXPECT_THROW(LandingDensity(wheel_map(Law::published, 7.02, ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 0.5)), 20, 0),
               std::invalid_argument);
  EXPECT_THROW(LandingDensity(wheel_map(Law::published, 7.02, ContactNoise::empirical({{0.4, 0.4}})), 20, 0),
               std::invalid_argument);
}

}  // namespace
}  // namespace metastable::dynamics::test
