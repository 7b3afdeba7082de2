#include "dynamics/walkers/two_link_walker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace metastable::dynamics::test {
namespace {

constexpr double compass_slope = std::numbers::pi / 60;
const Stride compass_gait{0.271028680, -1.09238359, -0.37737395};

struct Point {
  double mass, x, y, vx, vy;
};
/// Returns hip and the two legs' masses, from the stance foot, by plain geometry.
std::array<Point, 3> points(double m, double hip, double a, double b, const LegMotion& s) {
  const double l = a + b, t = s.stance_angle, p = s.swing_angle;
  const double hx = -l * std::sin(t), hy = l * std::cos(t);
  const double hvx = -l * std::cos(t) * s.stance_rate, hvy = -l * std::sin(t) * s.stance_rate;
  return {{{hip, hx, hy, hvx, hvy},
           {m, a / l * hx, a / l * hy, a / l * hvx, a / l * hvy},
           {m, hx + b * std::sin(p), hy - b * std::cos(p), hvx + b * std::cos(p) * s.swing_rate,
            hvy + b * std::sin(p) * s.swing_rate}}};
}
double momentum(const Point& p, double x, double y) { return p.mass * ((p.x - x) * p.vy - (p.y - y) * p.vx); }

TEST(TwoLinkWalker, KeepsItsEnergyBetweenStrikes) {
  const TwoLinkWalker compass = TwoLinkWalker::compass(), simplest = TwoLinkWalker::simplest();
  const Stride garcia = simplest.stride(std::array{0.200310900544, -0.199832473005});
  for (const auto& [walker, stride, ground] : {std::tuple{compass, compass_gait, Ground{compass_slope, compass_slope}},
                                               std::tuple{compass, Stride{0.3, -1.3, -0.1}, Ground{0.08, 0.06}},
                                               std::tuple{simplest, garcia, Ground{0.009, 0.009}}}) {
    const auto end = walker.before_strike(stride, ground);
    ASSERT_TRUE(end);
    const double first = walker.energy(walker.at(stride, ground, 0), ground.slope_rad);
    for (const double share : {0.3, 0.7, 1.0})
      EXPECT_NEAR(walker.energy(walker.at(stride, ground, share * end->time), ground.slope_rad), first, 1e-10 * first);
    EXPECT_NEAR(end->stance_angle + end->swing_angle, 0, 1e-14);
    EXPECT_LT(end->stance_angle, 0);
  }
}

TEST(TwoLinkWalker, StrikesWhereTheFeetAreLevel) {
  const TwoLinkWalker walker = TwoLinkWalker::compass();
  int strikes = 0;
  for (int i = 0; i < 4000; ++i) {  // a lattice of rank one around the gait
    const auto spread = [&](double irrational) { return 0.4 * (i * irrational - std::floor(i * irrational) - 0.5); };
    const Stride stride{compass_gait.half_angle_rad * (1 + spread(0.7548776662466927)),
                        compass_gait.stance_rate * (1 + spread(0.5698402909980532)),
                        compass_gait.swing_rate * (1 + spread(0.4301597090019468))};
    const double slope = compass_slope * (1 + spread(0.3247179572447460));
    const auto end = walker.before_strike(stride, {slope, slope});
    if (!end) continue;
    ++strikes;
    ASSERT_NEAR(end->stance_angle + end->swing_angle, 0, 1e-14) << i;
  }
  EXPECT_GT(strikes, 2000);
}

TEST(TwoLinkWalker, EnergyIsThatOfItsPoints) {
  const CompassOptions o{.leg_mass = 3, .hip_mass = 7, .foot_to_mass = 0.3, .mass_to_hip = 0.6, .gravity = 9.81};
  const LegMotion s{0, 0.2, -0.35, -1.2, 0.7};
  double energy = 0;
  for (const Point& p : points(3, 7, 0.3, 0.6, s))
    energy += p.mass * (0.5 * (p.vx * p.vx + p.vy * p.vy) + 9.81 * (p.y * std::cos(0.1) - p.x * std::sin(0.1)));
  EXPECT_NEAR(TwoLinkWalker::compass(o).energy(s, 0.1), energy, 1e-12 * energy);
}

TEST(TwoLinkWalker, StrikesKeepAngularMomenta) {
  const double m = 3, hip = 7, a = 0.3, b = 0.6, l = a + b;
  const TwoLinkWalker walker = TwoLinkWalker::compass({m, hip, a, b, 9.81});
  const LegMotion before{0, -0.25, 0.25, -1.4, 0.6};
  const Stride stride = walker.strike(before);
  const LegMotion after{0, stride.half_angle_rad, -stride.half_angle_rad, stride.stance_rate, stride.swing_rate};
  const auto old_points = points(m, hip, a, b, before), new_points = points(m, hip, a, b, after);
  const double foot = 2 * l * std::sin(0.25);  // from the old stance foot
  double whole_before = 0, whole_after = 0;
  for (const Point& p : old_points) whole_before += momentum(p, foot, 0);
  for (const Point& p : new_points) whole_after += momentum(p, 0, 0);
  EXPECT_NEAR(whole_after, whole_before, 1e-13 * std::abs(whole_before));
  // The old stance leg is the new swing leg.
  EXPECT_NEAR(momentum(new_points[2], new_points[0].x, new_points[0].y),
              momentum(old_points[1], old_points[0].x, old_points[0].y), 1e-13);
}

TEST(TwoLinkWalker, SimplestStrikesAsGarciaPrints) {
  // This has theta'+ = cos(2 theta) theta', phi'+ = cos(2 theta) (1 - cos(2 theta)) theta' with phi = theta - psi.
  const LegMotion before{0, -0.2, 0.2, -0.21, 0.05};
  const Stride after = TwoLinkWalker::simplest().strike(before);
  EXPECT_NEAR(after.stance_rate, std::cos(0.4) * -0.21, 1e-15);
  EXPECT_NEAR(after.stance_rate - after.swing_rate, std::cos(0.4) * (1 - std::cos(0.4)) * -0.21, 1e-15);
}

TEST(TwoLinkWalker, LightLegsApproachTheSimplest) {
  // Point masses at the feet (a -> 0) get ever lighter: the compass's equations become Garcia's, errors fall with the
  // mass.
  const TwoLinkWalker simplest = TwoLinkWalker::simplest();
  const Stride stride = simplest.stride(std::array{0.2, -0.2});
  const Ground ground{0.009, 0.009};
  const double expected = simplest.before_strike(stride, ground)->swing_angle;
  double last = 1;
  for (const double mass : {1e-2, 1e-3, 1e-4}) {
    const auto light = TwoLinkWalker::compass({mass, 1, 1e-9, 1, 1}).before_strike(stride, ground);
    ASSERT_TRUE(light);
    const double error = std::abs(light->swing_angle - expected);
    EXPECT_LT(error, 0.2 * last);
    last = error;
  }
  EXPECT_LT(last, 3e-4);
}

TEST(TwoLinkWalker, SlowWalkersFall) {
  const TwoLinkWalker walker = TwoLinkWalker::compass();
  EXPECT_TRUE(walker.before_strike(compass_gait, {compass_slope, compass_slope}));
  EXPECT_FALSE(walker.before_strike({0.27, -0.2, 0}, {compass_slope, compass_slope}));     // backwards
  EXPECT_FALSE(walker.before_strike({0.27, -6.0, -6.0}, {compass_slope, compass_slope}));  // over its stance leg
}

/// Many walkers go side by side in vectors of as many numbers as the processor has, one in the narrowest.
TEST(TwoLinkWalker, StepsDoNotDependOnTheirNeighbours) {
  const TwoLinkWalker walker = TwoLinkWalker::compass();
  constexpr std::size_t walkers = 150;
  std::vector<double> states;
  std::vector<Ground> grounds;
  for (std::size_t i = 0; i < walkers; ++i) {
    const double along = static_cast<double>(i) / walkers;
    states.insert(states.end(), {0.24 + 0.07 * along, -1.2 + 0.35 * along, -0.4});
    grounds.push_back({0.04 + 0.02 * along, 0.05});
  }
  std::vector<double> together(states.size()), alone(3);
  std::vector<std::uint8_t> fell(walkers), one(1);
  walker.step(states, grounds, together, fell);
  EXPECT_LT(std::ranges::count(fell, 1), 100);
  for (std::size_t i = 0; i < walkers; ++i) {
    walker.step(std::span(states).subspan(3 * i, 3), std::span(grounds).subspan(i, 1), alone, one);
    ASSERT_EQ(one[0], fell[i]);
    for (std::size_t k = 0; k < 3 && !one[0]; ++k) EXPECT_EQ(alone[k], together[3 * i + k]);
  }
}

TEST(TwoLinkWalker, NamesStatesThatCannotWalk) {
  const TwoLinkWalker walker = TwoLinkWalker::simplest();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const std::array state : {std::array{nan, -0.2}, std::array{-0.1, -0.2}, std::array{1.6, -0.2}}) {
    std::array<double, 2> next{};
    std::array<std::uint8_t, 1> fell{};
    const std::array ground{Ground{0.009, 0.009}};
    EXPECT_THROW(walker.step(state, ground, next, fell), std::invalid_argument);
  }
  for (const Ground& ground : {Ground{nan, 0.009}, Ground{0.009, std::numeric_limits<double>::infinity()}})
    EXPECT_THROW(walker.before_strike({0.2, -0.2, 0}, ground), std::invalid_argument);
  EXPECT_THROW(TwoLinkWalker::compass({.leg_mass = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::dynamics::test
