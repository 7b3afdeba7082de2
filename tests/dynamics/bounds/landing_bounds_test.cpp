// Bounds on landings hold against independent ways to the same probabilities.

#include "dynamics/bounds/landing_bounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "dynamics/return_map/rest_probability.h"
#include "tests/message_of.h"

namespace metastable::dynamics {
namespace {

const LandingBounds::ForEach in_order = [](std::size_t count, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < count; ++i) work(i);
};
constexpr BoundsResolution coarse{0.2, 0.125, 6};

Wheel wheel(bool equal) {
  Wheel w;
  if (equal) w.leg_length.assign(8, 0.1519);
  return w;
}

WheelMap map(double slope_deg, double mean, double sd, bool equal = true) {
  return {wheel(equal), slope_deg * std::numbers::pi / 180, Law::published, ContactNoise::normal(0.4, 0.1, mean, sd)};
}

std::string refusal(const WheelMap& refused) {
  return message_of<NoBounds>([&] { const LandingBounds bounds(refused, 0, 17, 90, coarse, in_order); });
}

TEST(LandingBounds, HoldTheQuadratureOfRest) {
  for (const bool equal : {true, false}) {
    const WheelMap m = map(7.02, 0.3, 0.05, equal);
    for (int phase = 0; phase < m.phases(); phase += 3) {
      const double lowest = m.state_interval(phase).first, next = m.state_interval((phase + 1) % m.phases()).first;
      const LandingBounds bounds(m, phase, lowest, 90, coarse, in_order);
      for (const double state : {lowest, 20.0, 27.5, 33.3, 54.0, 90.0}) {
        const Interval c = bounds.below(state, next);
        EXPECT_TRUE(c.contains(rest_probability(m, state, phase))) << phase << " " << state;
        EXPECT_LT((c.upper - c.lower) / c.upper, 0.02) << phase << " " << state;
      }
    }
  }
}

TEST(LandingBounds, HoldTheShareOfDraws) {
  for (const auto& [mean, sd] : {std::pair(0.3, 0.05), std::pair(0.4, 0.1), std::pair(0.15, 0.2)}) {
    const WheelMap m = map(9.59, mean, sd);
    const double lowest = m.state_interval(0).first;
    const LandingBounds bounds(m, 0, lowest, 90, coarse, in_order);
    std::mt19937_64 engine(7);
    std::normal_distribution<double> normal;
    constexpr int draws = 40000;
    for (const double state : {lowest * 1.05, 33.0, 60.0}) {
      std::vector<double> landings;
      for (int k = 0; k < draws; ++k) {
        const double score[] = {normal(engine), normal(engine)};
        landings.push_back(m.landing(state, 0, score).value_or(-1));
      }
      for (double edge = 22; edge < 60; edge += 3.7) {
        const auto count = std::count_if(landings.begin(), landings.end(), [&](double x) { return x < edge; });
        const double share = static_cast<double>(count) / draws;
        const Interval c = bounds.below(state, edge);
        const double error = 5 * std::sqrt(std::max(c.upper * (1 - c.lower), 1e-5) / draws);
        EXPECT_GT(share, c.lower - error) << mean << " " << state << " " << edge;
        EXPECT_LT(share, c.upper + error) << mean << " " << state << " " << edge;
      }
    }
  }
}

TEST(LandingBounds, FineOnesLieWithinCoarseOnes) {
  const WheelMap m = map(9.59, 0.4, 0.1);
  const double lowest = m.state_interval(0).first;
  const LandingBounds rough(m, 0, lowest, 90, coarse, in_order), fine(m, 0, lowest, 90, {0.1, 0.06, 12}, in_order);
  for (double state = lowest * 1.01; state < 89; state *= 1.13)
    for (double edge = lowest; edge < 80; edge *= 1.07) {
      const Interval a = rough.below(state, edge), b = fine.below(state, edge);
      EXPECT_LE(std::max(a.lower, b.lower), std::min(a.upper, b.upper)) << state << " " << edge;
      EXPECT_LT(b.upper - b.lower, 0.01) << state << " " << edge;
    }
}

// These are second differences of C, whose own bounds leave a little play.
TEST(LandingBounds, CurvatureHoldsSecondDifferences) {
  const WheelMap m = map(9.59, 0.3, 0.05);
  const double lowest = m.state_interval(0).first;
  const LandingBounds bounds(m, 0, lowest, 90, {0.05, 0.03, 16}, in_order);
  for (double state = 22; state < 60; state += 7.3)
    for (double edge = 24; edge < 45; edge += 2.9) {
      const double h = 1;
      const auto c = bounds.curvature({state - h, state + h}, {edge, edge});
      const auto e = bounds.curvature({state, state}, {edge - h, edge + h});
      if (!c || !e) continue;
      const auto chord = [](const Interval& a, const Interval& b, const Interval& d) {
        return a + b - Interval(2) * d;
      };
      const Interval middle = bounds.below(state, edge);
      const Interval by_state = chord(bounds.below(state - h, edge), bounds.below(state + h, edge), middle);
      const Interval by_edge = chord(bounds.below(state, edge - h), bounds.below(state, edge + h), middle);
      const double play_state = 2 * c->loose_state + 1e-12, play_edge = 2 * e->loose_edge + 1e-12;
      EXPECT_GE(by_state.upper, h * h * c->state.lower - play_state) << state << " " << edge;
      EXPECT_LE(by_state.lower, h * h * c->state.upper + play_state) << state << " " << edge;
      EXPECT_GE(by_edge.upper, h * h * e->edge.lower - play_edge) << state << " " << edge;
      EXPECT_LE(by_edge.lower, h * h * e->edge.upper + play_edge) << state << " " << edge;
    }
}

TEST(LandingBounds, BoundTheOvershoot) {
  const WheelMap m = map(9.59, 0.4, 0.1);
  const LandingBounds bounds(m, 0, m.state_interval(0).first, 90, coarse, in_order);
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal;
  double sum = 0, faster = 0;
  constexpr int draws = 40000;
  for (int k = 0; k < draws; ++k) {
    const double score[] = {normal(engine), normal(engine)};
    sum += std::max(0.0, m.landing(60, 0, score).value_or(0) - 40) / draws;
    faster += std::max(0.0, m.landing(61, 0, score).value_or(0) - 40) / draws;
  }
  EXPECT_LT(sum, bounds.overshoot(60, 40));
  EXPECT_LT(faster - sum, bounds.growth(60));
  EXPECT_LT(bounds.growth(60), 1);
}

TEST(LandingBounds, RefuseWhatTheyCannotProve) {
  const double slope = 7.02 * std::numbers::pi / 180;
  const ContactNoise noise = ContactNoise::normal(0.4, 0.1, 0.4, 0.1);
  EXPECT_NE(refusal({wheel(true), slope, Law::coulomb, noise}).find("coulomb"), std::string::npos);
  EXPECT_NE(
      refusal({wheel(true), slope, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 0.5)}).find("independent"),
      std::string::npos);
  EXPECT_NE(refusal({wheel(true), slope, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, 0)}).find("vary"),
            std::string::npos);
  EXPECT_NE(refusal({wheel(true), slope, Law::published, ContactNoise::empirical({{0.4, 0.4}})}).find("list"),
            std::string::npos);
}

TEST(LandingBounds, RefuseAMapThatFallsWithTheState) {
  // With a hundredth of the inertia the collision takes more than there is: omega+^2 = s omega^2 with s < 0.
  Wheel light = wheel(true);
  light.inertia = 3e-4;
  const WheelMap broken(light, 7.02 * std::numbers::pi / 180, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  ASSERT_LT(broken.after_collision(30, 0, {0.4, 0.1}), broken.after_collision(20, 0, {0.4, 0.1}));
  EXPECT_NE(refusal(broken).find("rise with the state"), std::string::npos);
}

TEST(LandingBounds, StatesOutsideTheTableAreAnError) {
  const WheelMap m = map(9.59, 0.4, 0.1);
  const LandingBounds bounds(m, 0, 20, 80, coarse, in_order);
  EXPECT_THROW(bounds.below(19.9, 30), std::out_of_range);
  EXPECT_THROW(bounds.below(80.1, 30), std::out_of_range);
}

}  // namespace
}  // namespace metastable::dynamics
