#include "dynamics/return_map/rough_terrain.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

RoughTerrainWheel wheel(double sd) {
  return RoughTerrainWheel({.mean_slope_rad = 8 * degree, .sd_slope_rad = sd * degree});
}

TEST(RoughTerrain, FixedPointIsFixed) {
  const RoughTerrainWheel w = wheel(0);
  EXPECT_NEAR(w.next(w.fixed_point(), 8 * degree), w.fixed_point(), 1e-14);
  EXPECT_EQ(*w.rest_probability(w.fixed_point(), 0), 0);
  const auto [least, most] = w.landing_range(w.fixed_point(), 0);
  EXPECT_EQ(least, most);
  EXPECT_THROW(RoughTerrainWheel({.mean_slope_rad = 1 * degree}).fixed_point(), std::domain_error);
}

RC_GTEST_PROP(RoughTerrain, RestIsWhereTheSlopeIsTooFlat, ()) {
  const RoughTerrainWheel w = wheel(uniform(0.5, 3));
  const double state = uniform(0, 3);
  // This is the root of next(state, slope) by bisection; the upper tail (slopes beyond 45 deg) is out of reach here.
  double flat = -60 * degree, steep = 45 * degree;
  for (int k = 0; k < 80; ++k) (w.next(state, (flat + steep) / 2) <= 0 ? flat : steep) = (flat + steep) / 2;
  const double expected = normal_cdf((flat - 8 * degree) / w.options().sd_slope_rad);
  RC_ASSERT(std::abs(*w.rest_probability(state, 0) - expected) <= 1e-10 * expected);
}

RC_GTEST_PROP(RoughTerrain, LandingsStayInTheInterval, ()) {
  const RoughTerrainWheel w = wheel(2);
  const auto [low, high] = w.state_interval(0);
  const double state = low + uniform(0, 1) * (high - low);
  const auto landed = w.landing(state, 0, std::array{uniform(-37, 37)});
  const auto [least, most] = w.landing_range(state, 0);
  if (landed) RC_ASSERT(*landed > 0 && *landed <= most + 1e-12 && *landed <= high + 1e-12);
  RC_ASSERT(least == -std::numeric_limits<double>::infinity());
}

// It checks 1 - lambda_1 of the map to sixty digits (see tests/markov/transition_rows/rough_terrain_test.cpp), here
// from a Nystrom discretisation on Gauss nodes and power iteration; the kill rate of the quasi-stationary distribution
// is rest_probability averaged over it.
TEST(RoughTerrain, BenchmarkKillRates) {
  constexpr std::array reference{std::pair(2.0, 2.3121853052586986e-4), std::pair(1.5, 1.5280057867965971e-6),
                                 std::pair(1.0, 1.1990367683962527e-12)};
  using Rule = boost::math::quadrature::gauss<double, 60>;
  for (const auto& [sd, expected] : reference) {
    const RoughTerrainWheel w = wheel(sd);
    const double top = w.fixed_point() + 10 * sd * 0.45, scale = w.options().sd_slope_rad;
    std::vector<double> node, weight;
    for (std::size_t i = 0; i < Rule::abscissa().size(); ++i)
      for (double side : {-1.0, 1.0}) {
        node.push_back(top / 2 * (1 + side * Rule::abscissa()[i]));
        weight.push_back(top / 2 * Rule::weights()[i]);
      }
    // The density of landing at y from x takes the slope that leads there, by bisection, and the map's derivative.
    const std::size_t n = node.size();
    std::vector<double> kernel(n * n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k) {
        double a = -60 * degree, b = 51 * degree;
        for (int step = 0; step < 60; ++step) (w.next(node[i], (a + b) / 2) < node[k] ? a : b) = (a + b) / 2;
        const double rate = (w.next(node[i], a + 1e-4) - w.next(node[i], a - 1e-4)) / 2e-4;
        kernel[i * n + k] = normal_density((a - 8 * degree) / scale) / scale / rate * weight[k];
      }
    std::vector<double> mass(n, 1.0 / static_cast<double>(n));
    double killed = 0;
    for (int iteration = 0; iteration < 200; ++iteration) {
      std::vector<double> next(n, 0.0);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < n; ++k) next[k] += mass[i] * kernel[i * n + k];
      double sum = 0;
      for (double m : next) sum += m;
      killed = 0;
      for (std::size_t k = 0; k < n; ++k) {
        mass[k] = next[k] / sum;
        killed += mass[k] * *w.rest_probability(node[k], 0);
      }
    }
    EXPECT_NEAR(killed / expected, 1, 1e-6) << "sd " << sd << " deg";
  }
}

TEST(RoughTerrain, IllegalInputIsNamed) {
  EXPECT_EQ(message_of([] { RoughTerrainWheel({.mean_slope_rad = 0, .sd_slope_rad = -1 * degree}); }),
            "sd_slope [deg]: -1 is outside [0, 10]");
  EXPECT_EQ(message_of([] { RoughTerrainWheel({.mean_slope_rad = 60 * degree}); }),
            "mean_slope [deg]: 60 is outside (-45, 45)");
  EXPECT_EQ(message_of([] { RoughTerrainWheel({.half_leg_angle_rad = 50 * degree}); }),
            "half_leg_angle [deg]: 50 is outside (0, 45)");
  EXPECT_EQ(message_of([] { RoughTerrainWheel({.gravity = 0}); }), "gravity [m/s^2]: 0 is outside (0, inf)");
  EXPECT_EQ(message_of([] { RoughTerrainWheel({.leg_length = -1}); }), "leg_length [m]: -1 is outside (0, inf)");
}

}  // namespace
}  // namespace metastable::dynamics::test
