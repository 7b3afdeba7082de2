#include "markov/mesh/score_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "markov/mesh/mesh_passage.h"
#include "tests/markov/mesh/maps.h"

namespace metastable::markov {
namespace {

using namespace testing;  // maps.h

double below(double z) { return 0.5 * std::erfc(-z / std::sqrt(2)); }

/// Makes a map of one number that lands where `to` says and fails where that is not finite; counts what it was asked.
BatchMap landing(double (*to)(double), int& steps) {
  BatchMap map;
  map.step = [to, &steps](int, auto, auto scores, auto next, auto failed) {
    steps += static_cast<int>(scores.size());
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = to(scores[i]);
      failed[i] = !std::isfinite(next[i]);
    }
  };
  return map;
}

struct Shared {
  std::map<double, double> at;  ///< mass by node
  ScoreCurve::Shares shares;
  int steps = 0;
  double mean(int power) const {
    double sum = 0;
    for (const auto& [x, mass] : at) sum += mass * std::pow(x, power);
    return sum;
  }
};

Shared share(double (*to)(double), double spacing, double reach = 8.5,
             double beyond = -std::numeric_limits<double>::infinity()) {
  const NodeLattice lattice({{{0}, {1}, {1}, {1}}}, spacing, {0.3});
  Shared shared;
  const BatchMap map = landing(to, shared.steps);
  std::vector<std::pair<std::uint64_t, double>> parts;
  shared.shares =
      follow_curves(map, lattice, 0, {{0}, {}, {reach}, {beyond}}, 0.8, spacing).front().share(lattice, 0, 1, parts);
  for (const auto& [key, mass] : parts) shared.at[lattice.state(key)[0]] += mass;
  return shared;
}

TEST(ScoreCurve, SharesWhatSmoothNoiseDoes) {
  const Shared line = share([](double z) { return 2 * z + 0.1; }, 0.25);
  EXPECT_NEAR(line.mean(0), 1, 1e-12);
  EXPECT_NEAR(line.mean(1), 0.1, 1e-12);
  EXPECT_NEAR(line.mean(2), 4 + 0.01 + 0.25 * 0.25 / 6, 1e-4);  // sharing among nodes adds a sixth of the square
  EXPECT_LE(line.steps, 23);                                    // a straight line needs no more places
  const Shared bent = share([](double z) { return std::exp(0.3 * z); }, 0.25);
  EXPECT_NEAR(bent.mean(1), std::exp(0.045), 2e-5);
  for (const double deep : {-6.0, -4.0}) {  // the tail keeps its digits, but for the cell that the bound divides
    double mass = 0;
    for (const auto& [x, m] : line.at) mass += x < 2 * deep ? m : 0;
    EXPECT_NEAR(mass / below(deep), 1, 0.4) << deep;
  }
}

TEST(ScoreCurve, FindsWhereFailuresBeginAndEnd) {
  const Shared shared = share([](double z) { return z < -2.123 || (z > 0.5 && z < 1.7) ? NAN : z; }, 0.25);
  const double fails = below(-2.123) + below(1.7) - below(0.5);
  EXPECT_NEAR(shared.shares.fails, fails, 5e-4);
  EXPECT_NEAR(shared.mean(0), 1 - fails, 5e-4);
  EXPECT_NEAR(share([](double z) { return z < -5.3 ? NAN : z; }, 0.25).shares.fails / below(-5.3), 1, 1e-2);
}

// The curve looks less closely for failures that are exp(-10) times as likely as the cheapest one. It looks as closely
// as before for those that are as likely.
TEST(ScoreCurve, LooksLessCloselyAtWhatIsRare) {
  const auto fails = [](double z) { return z < -2.123 ? NAN : z; };
  const Shared closely = share(fails, 0.25), near = share(fails, 0.25, 8.5, -20), rare = share(fails, 0.25, 8.5, 8);
  EXPECT_EQ(near.steps, closely.steps);
  EXPECT_LE(rare.steps, closely.steps - 5);
  EXPECT_NEAR(rare.shares.fails / below(-2.123), 1, 0.3);
}

TEST(ScoreCurve, IsTornWhereTheMapJumpsAndNotBentAcross) {
  const Shared jump = share([](double z) { return z < 0.37 ? -3.0 : 4.0; }, 0.5);
  double middle = 0, low = 0;
  for (const auto& [x, mass] : jump.at) (x < -2 ? low : middle) += x < 3 ? mass : 0;
  EXPECT_NEAR(low, below(0.37), 1e-3);
  EXPECT_LT(middle, 1e-12);
  EXPECT_LT(jump.steps, 120);
}

TEST(ScoreCurve, TakesMorePlacesWhereItBends) {
  // Near an edge at which the landing goes to infinity like a logarithm, as a walker's time across the top does.
  const Shared edge = share([](double z) { return z > -1 ? std::log(z + 1) : NAN; }, 0.25);
  EXPECT_NEAR(edge.shares.fails, below(-1), 5e-4);
  EXPECT_NEAR(edge.mean(1), -0.029627, 1e-3);  // integral of log(z + 1) with the normal density, by the midpoint rule
}

TEST(ScoreCurve, WhatIsNotLookedAtLeavesOrFailsAsTheLastPlaceDid) {
  const Shared shared = share([](double z) { return z < -1 ? NAN : z; }, 0.25, 2);
  EXPECT_NEAR(shared.shares.fails, below(-1), 5e-4);
  EXPECT_NEAR(shared.shares.leaves, below(-2), 1e-12);
}

TEST(ScoreCurve, LetsShiftsOfTheMeshAgree) {
  // Turned by 45 degrees; the one score moves both numbers.
  BatchMap map;
  map.dimension = 2;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const double x = states[2 * i], y = states[2 * i + 1];
      next[2 * i] = 0.5 * x - 0.3 * y + 0.5 * scores[i];
      next[2 * i + 1] = 0.3 * x + 0.5 * y + 0.2 * std::sin(scores[i]);
      failed[i] = next[2 * i] < -1.5;
    }
  };
  const std::vector<double> start{0, 0};
  double low = INFINITY, high = 0;
  for (const std::uint32_t shift : {0, 1, 2, 3}) {
    const Mesh mesh(map, noise_frames(map, start), start, {.spacing = 0.3, .shift = shift, .score_spacing = 0.8});
    const double steps = mesh_passage(mesh, start).steps;
    low = std::min(low, steps);
    high = std::max(high, steps);
  }
  EXPECT_LT(high / low, 1.003);
}

}  // namespace
}  // namespace metastable::markov
