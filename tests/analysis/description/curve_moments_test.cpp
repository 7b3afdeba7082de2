#include "analysis/description/curve_moments.h"

#include <gtest/gtest.h>

#include <cmath>

namespace metastable::analysis {
namespace {

// Points of every number of lanes, some so far off that they stand for nothing, and curves that are far off as a whole.
TEST(CurveMoments, AreSumsOverThePoints) {
  for (std::size_t count = 1; count <= 40; ++count) {
    CurvePoints points;
    for (std::size_t i = 0; i < count; ++i) {
      const double t = static_cast<double>(i) / 40;
      points.add(0.3 + t * t, 0.5 - 0.4 * t, 1 + std::sin(7 * t));
    }
    const double sd = count % 2 == 0 ? 0.02 : 0.0005;  // at the latter the first points are 200 sds off
    const CurveNormal normal{0.4, 1 / sd, 0.4, 1 / 0.05};
    double nearest = 1e300, sum = 0, su = 0, suu = 0, sv = 0, svv = 0;
    const auto distance = [&](std::size_t i) {
      return std::pair((points.restitution[i] - 0.4) / sd, (points.friction[i] - 0.4) / 0.05);
    };
    for (std::size_t i = 0; i < count; ++i) {
      const auto [u, v] = distance(i);
      nearest = std::min(nearest, u * u + v * v);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const auto [u, v] = distance(i);
      const double share = points.weight[i] * std::exp(-0.5 * (u * u + v * v - nearest));
      sum += share, su += share * u, suu += share * u * u, sv += share * v, svv += share * v * v;
    }
    CurveMoments m = curve_moments(points, normal);
    EXPECT_TRUE(m.nearest == 0 || std::abs(m.nearest - nearest) < 1e-12 * nearest);
    const double scale = std::exp(-0.5 * (nearest - m.nearest));
    for (double* one : {&sum, &su, &suu, &sv, &svv}) *one *= scale;
    EXPECT_NEAR(m.sum, sum, 1e-10 * sum);
    EXPECT_NEAR(m.u, su, 1e-10 * suu + 1e-290);
    EXPECT_NEAR(m.uu, suu, 1e-10 * suu + 1e-290);
    EXPECT_NEAR(m.v, sv, 1e-10 * svv + 1e-290);
    EXPECT_NEAR(m.vv, svv, 1e-10 * svv + 1e-290);
  }
}

}  // namespace
}  // namespace metastable::analysis
