#include "dynamics/return_map/wheel_map.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

TEST(WheelMap, EqualLegsHaveOnePhaseAndEquation35) {
  const double slope = 7.02 * degree, length = 0.1519;
  const WheelMap map(even_wheel(), slope, Law::published, paper_noise);
  EXPECT_EQ(map.phases(), 1);
  const double beta = std::numbers::pi / 2 - std::numbers::pi / 8;
  EXPECT_NEAR(map.stance(0).gain, 2 * 9.81 / length * 2 * std::sin(slope) * std::cos(beta), 1e-11);
  EXPECT_NEAR(map.stance(0).barrier, 2 * 9.81 / length * (1 - std::sin(beta + slope)), 1e-11);
  EXPECT_NEAR(map.state_interval(0).first, map.stance(0).barrier + map.stance(0).gain, 1e-12);
}

// What gravity gives over one revolution is the drop of the ramp: sum of chords times sin(slope).
TEST(WheelMap, RevolutionOfUnevenLegsDropsByTheChords) {
  const double slope = 9.59 * degree;
  for (Law law : {Law::published, Law::coulomb, Law::plastic}) {
    const WheelMap map(Wheel(), slope, law, paper_noise);
    ASSERT_EQ(map.phases(), 8);
    double gained = 0, chords = 0;
    for (int p = 0; p < 8; ++p) {
      const Stance& s = map.stance(p);
      gained += s.inertia * s.gain / 2 -
                1.39 * 9.81 * (map.triangle(p).hub_height - map.triangle((p + 1) % 8).hub_height) * std::cos(slope);
      chords += map.advance(p);
    }
    // The hub advances by x_cp of the old triangle plus the rest of the new one; over a revolution that is the chords.
    EXPECT_NEAR(gained, 1.39 * 9.81 * chords * std::sin(slope), 1e-12);
  }
}

RC_GTEST_PROP(WheelMap, CoefficientsAreTheLosses, ()) {
  const Law law = *rc::gen::element(Law::published, Law::coulomb, Law::plastic);
  const WheelMap map(Wheel(), uniform(1, 20) * degree, law, paper_noise, uniform(0, 1));
  const int phase = *rc::gen::inRange(0, 8);
  const Contact contact{uniform(0, 1), uniform(0, 3)};
  const double state = uniform(0.5, 90);
  const double before = map.stance((phase + 7) % 8).inertia, landing = map.stance(phase).inertia;
  const double expected = (before * state - 2 * map.loss(phase, std::sqrt(state), contact).total()) / landing;
  RC_ASSERT(std::abs(map.after_collision(state, phase, contact) - expected) < 1e-10 * (std::abs(expected) + state));
}

RC_GTEST_PROP(WheelMap, LandingRisesWithTheState, ()) {
  const Law law = *rc::gen::element(Law::published, Law::coulomb, Law::plastic);
  const WheelMap map(Wheel(), uniform(1, 20) * degree, law, paper_noise);
  const std::array score{uniform(-6, 6), uniform(-6, 6)};
  const int phase = *rc::gen::inRange(0, 8);
  const double state = uniform(2, 60);
  const auto low = map.landing(state, phase, score), high = map.landing(state * 1.1, phase, score);
  if (low) RC_ASSERT(high && *high >= *low);
}

RC_GTEST_PROP(WheelMap, TableLandsLikeTheMap, ()) {
  const Law law = *rc::gen::element(Law::published, Law::coulomb, Law::plastic);
  const WheelMap map(Wheel(), 7.02 * degree, law, paper_noise);
  const int phase = *rc::gen::inRange(0, 8);
  std::vector<double> score, offset;
  for (int k = 0; k < 20; ++k) {
    score.push_back(uniform(-20, 20));
    score.push_back(uniform(-20, 37));
    offset.push_back(uniform(0, 1));
  }
  const auto table = map.tabulate(phase, score);
  std::vector<double> next(15);
  table.land(20, 30, std::span(offset).first(15), 5, next);
  for (std::size_t k = 0; k < next.size(); ++k) {
    const auto landed = map.landing(20 + 30 * offset[k], phase, std::span(score).subspan(2 * (k + 5), 2));
    RC_ASSERT(next[k] == landed.value_or(-std::numeric_limits<double>::infinity()));
  }
}

double duration_by_quadrature(const Stance& s, double next_state) {
  // Both halves are in terms of the distance from the apex, where the wheel is slowest.
  const double apex = next_state - s.pendulum * (1 - std::sin(s.end_angle_rad));
  boost::math::quadrature::tanh_sinh<double> rule;
  const auto half = [&](double width) {
    const auto pace = [&](double t) { return 1 / std::sqrt(apex + 2 * s.pendulum * std::pow(std::sin(t / 2), 2)); };
    double sum = 0, edge = width;
    for (int i = 0; i < 40; ++i, edge /= 3) sum += rule.integrate(pace, edge / 3, edge);
    return sum + rule.integrate(pace, 0.0, edge);
  };
  return half(s.end_angle_rad - std::numbers::pi / 2) + half(std::numbers::pi / 2 - s.start_angle_rad);
}

TEST(WheelMap, DurationAgreesWithQuadrature) {
  const WheelMap map(Wheel(), 7.02 * degree, Law::coulomb, paper_noise);
  for (int p : {0, 3}) {
    const double lowest = map.state_interval((p + 1) % 8).first;
    for (double above : {1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0, 60.0}) {
      const double expected = duration_by_quadrature(map.stance(p), lowest + above);
      EXPECT_NEAR(map.duration(lowest + above, p) / expected, 1, above < 1e-5 ? 1e-6 : 1e-11) << above;
    }
    EXPECT_EQ(map.duration(lowest - 1, p), std::numeric_limits<double>::infinity());
  }
}

TEST(WheelMap, DurationWithoutABarrier) {
  // A long leg lands after a short one on a steep ramp: the hub is past the foot already.
  Wheel wheel;
  wheel.leg_length = {0.16, 0.14, 0.16, 0.14, 0.16, 0.14, 0.16, 0.14};
  const WheelMap map(wheel, 22 * degree, Law::plastic, paper_noise);
  int without = 0;
  for (int p = 0; p < 2; ++p) {
    const Stance& s = map.stance(p);
    if (s.barrier > 0) continue;
    ++without;
    const double next = s.gain + 0.01;  // omega+^2 = 0.01
    boost::math::quadrature::tanh_sinh<double> rule;
    const double expected = rule.integrate(
        [&](double t) { return 1 / std::sqrt(0.01 + s.pendulum * (std::sin(s.start_angle_rad) - std::sin(t))); },
        s.start_angle_rad, s.end_angle_rad);
    EXPECT_NEAR(map.duration(next, p) / expected, 1, 1e-9);
    EXPECT_EQ(map.duration(s.gain - 1e-3, p), std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(without, 1);
}

TEST(WheelMap, AssumptionsAreFlagged) {
  const WheelMap map(even_wheel(), 7.02 * degree, Law::published, paper_noise);
  ASSERT_EQ(map.assumptions().size(), 3U);
  const std::array<double, 2> typical{0, 0};
  const std::array<double, 2> slippery{0, -3};  // mu = 0.1 < mu_c
  EXPECT_NEAR(lift_speed(map, 0), 7.7, 0.4);
  const double lift = lift_speed(map, 0) * lift_speed(map, 0);
  EXPECT_TRUE(map.violates(0, lift * 1.001, 0, typical));
  EXPECT_FALSE(map.violates(0, lift * 0.999, 0, typical));
  EXPECT_TRUE(map.violates(1, 25, 0, slippery));
  EXPECT_FALSE(map.violates(1, 25, 0, typical));
  EXPECT_FALSE(map.violates(2, 25, 0, typical));
  EXPECT_EQ(message_of([&] { map.violates(3, 25, 0, typical); }), "assumption: 3 is outside [0, 2]");
}

TEST(WheelMap, EnergyGainAtHighRestitutionBelowMuC) {
  const ContactNoise bouncy = ContactNoise::normal(1, 0, 0.1, 0);
  const WheelMap map(even_wheel(), 7.02 * degree, Law::published, bouncy);
  EXPECT_TRUE(map.violates(2, 25, 0, std::array<double, 2>{0, 0}));
}

TEST(WheelMap, IllegalInputIsNamed) {
  EXPECT_EQ(message_of([] { WheelMap(Wheel(), 25 * degree, Law::plastic, paper_noise); }),
            "slope: 25 deg is outside (0, 22.5) deg (half the angle between legs)");
  EXPECT_EQ(message_of([] { WheelMap(Wheel(), 0, Law::plastic, paper_noise); }),
            "slope: 0 deg is outside (0, 22.5) deg (half the angle between legs)");
  const WheelMap map(Wheel(), 7.02 * degree, Law::plastic, paper_noise);
  EXPECT_EQ(message_of([&] {
              map.tabulate(0, std::array{1.0, 2.0, 3.0});
            }),
            "score: 3 numbers are not a multiple of 2");
}

// Below the lowest survivor of a draw everything rests, above it nothing (where landings rise with the state).
TEST(WheelMapTable, LowestSurvivorIsWhereRestEnds) {
  for (const Law law : {Law::published, Law::coulomb}) {
    const WheelMap map(Wheel{}, 3.0 * std::numbers::pi / 180, law, ContactNoise::normal(0.4, 0.2, 0.4, 0.2));
    std::vector<double> score;
    for (int k = 0; k < 200; ++k) score.push_back(-9.5 + 0.1 * ((k * 37) % 191));
    auto table = map.tabulate(2, score);
    std::vector<std::uint32_t> order(100);
    for (std::uint32_t k = 0; k < 100; ++k) order[k] = 99 - k;
    const std::vector<double> offset(100, 0.0);
    std::vector<double> before(100), after(100);
    table.land(20, 0, offset, 0, before);
    for (std::size_t k = 0; k < 100; ++k) {
      const double lowest = table.lowest_survivor(k);
      double next = 0;
      if (lowest > 0) {
        table.land(std::min(lowest, 1e300) * (1 - 1e-9), 0, std::span(offset).first(1), k, {&next, 1});
        EXPECT_EQ(next, -INFINITY) << k;
      }
      if (lowest > 0 && std::isfinite(lowest)) {
        table.land(lowest * (1 + 1e-9), 0, std::span(offset).first(1), k, {&next, 1});
        EXPECT_GT(next, 0) << k;
      }
    }
    table.reorder(order);
    table.land(20, 0, offset, 0, after);
    for (std::size_t k = 0; k < 100; ++k) EXPECT_EQ(after[k], before[99 - k]);
  }
}

}  // namespace
}  // namespace metastable::dynamics::test
