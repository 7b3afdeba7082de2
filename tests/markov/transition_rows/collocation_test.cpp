#include "markov/transition_rows/collocation.h"

#include <gtest/gtest.h>

#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>

#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/integrated.h"
#include "tests/markov/linear_map.h"

namespace metastable::markov {
namespace {

using testing::linear_launch;
using testing::steps;

constexpr double infinity = std::numeric_limits<double>::infinity();

struct LinearWithPoints : testing::LinearWithDensity {
  double landing_points(double state, int phase, std::span<const double>,
                        std::vector<std::pair<double, double>>& points) const {
    const double middle = state / 2 + 1, from = std::max(0.0, middle - 16 * sd), to = middle + 16 * sd;
    constexpr int panels = 24;
    using Rule = boost::math::quadrature::gauss<double, 20>;
    for (int p = 0; p < panels; ++p)
      for (std::size_t k = 0; k < 20; ++k) {
        const double place = (k % 2 == 0 ? 1 : -1) * Rule::abscissa()[k / 2];
        const double next = from + (to - from) * (p + 0.5 + 0.5 * place) / panels, z = (next - middle) / sd;
        points.emplace_back(next, 0.5 * Rule::weights()[k / 2] * (to - from) / panels * std::exp(-0.5 * z * z) /
                                      (sd * std::sqrt(2 * std::numbers::pi)));
      }
    return *rest_probability(state, phase);
  }
};

/// Maps x' = x / 2 + 2 with probability 3/4, else x / 2 - 1: rest where that is below 0.
struct Coin {
  std::pair<double, double> state_interval(int) const { return {0, infinity}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int, std::span<const double> score) const {
    const double next = state / 2 + (score[0] < 0.6744897501960817 ? 2 : -1);
    return next > 0 ? std::optional(next) : std::nullopt;
  }
  double landing_points(double state, int, std::span<const double>,
                        std::vector<std::pair<double, double>>& points) const {
    points.emplace_back(state / 2 + 2, 0.75);
    if (state < 2) return 0.25;
    points.emplace_back(state / 2 - 1, 0.25);
    return 0;
  }
  std::vector<double> states_of_extremes(int, std::span<const double> next) const {
    std::vector<double> states;
    for (const double y : next)
      for (const double state : {2 * (y - 2), 2 * (y + 1)}) states.push_back(state);
    return states;
  }
};

TEST(NodeSpace, FindsThePlaceOfEveryNode) {
  const NodeSpace space = NodeSpace::between({{1, 2, 4}, {0, 3, 3.5}}, 3);
  ASSERT_EQ(space.nodes(), 96u);
  for (std::size_t i = 0; i < space.size(); ++i) {
    const auto [panel, place] = space.locate(space.phase(i), space.node(i));
    EXPECT_EQ(panel, i % space.nodes() / NodeSpace::order);
    EXPECT_NEAR(place, gauss_abscissa(i % NodeSpace::order), 1e-12);
  }
  EXPECT_EQ(space.locate(0, 0.5), std::pair(std::size_t{0}, -1.0));
  EXPECT_EQ(space.locate(0, 9), std::pair(std::size_t{5}, 1.0));
  double root = 0;  // of a function like a square root at every edge
  for (std::size_t j = 0; j < space.nodes(); ++j)
    root += space.weights(0)[j] * std::sqrt(std::abs(space.nodes(0)[j] - 2));
  EXPECT_NEAR(root, 2.0 / 3 * (1 + std::pow(2, 1.5)), 1e-14);
}

TEST(NodeSpace, RefusesEdgesThatDoNotAscend) {
  EXPECT_THROW(NodeSpace::between({{1, 1}}, 2), std::invalid_argument);
  EXPECT_THROW(NodeSpace::between({{1, 2}, {1, 2, 3}}, 2), std::invalid_argument);
  EXPECT_THROW(NodeSpace::between({{1, 2}}, 0), std::invalid_argument);
}

TEST(Collocate, AgreesWithDensitiesHoweverRareRestIs) {
  for (const double sd : {0.6, 0.3, 0.2}) {  // 5e2, 4e8, 4e17 steps
    const LinearWithPoints map{{{.sd = sd}}};
    const auto edges = collocation_edges(map, collocation_ranges(map, linear_launch(), 1), 1);
    const IntegratedChain by_points = collocate(map, NodeSpace::between(edges, 8), linear_launch());
    const IntegratedChain by_density =
        integrate(map, NodeSpace(node_ranges(map, linear_launch(), 1), 16), linear_launch());
    const double accuracy = sd < 0.25 ? 2e-8 : 1e-9;  // signs cost digits where rest is rare
    EXPECT_NEAR(steps(by_points) / steps(by_density), 1, accuracy) << sd << ' ' << steps(by_density);
    EXPECT_NEAR(quasi_stationary(ChainSolver(by_points.chain.chain)).failure_rate /
                    quasi_stationary(ChainSolver(by_density.chain.chain)).failure_rate,
                1, accuracy);
  }
}

TEST(Collocate, KeepsThePeriodOfPhases) {
  const LinearWithPoints one, three{{{.count = 3}}};
  const std::vector<double> edges{0, 5};
  const IntegratedChain a = collocate(one, NodeSpace::between({edges}, 4), linear_launch()),
                        b = collocate(three, NodeSpace::between({edges, edges, edges}, 4), linear_launch(), 2);
  EXPECT_EQ(ChainSolver(b.chain.chain).period().period, 3);
  EXPECT_NEAR(steps(b) / steps(a), 1, 1e-11);
}

// There are two outcomes, no density: from x < 2 a quarter of the landings rest. The expected steps jump at 2 and
// wherever an outcome leads there.
TEST(Collocate, TakesSingleOutcomes) {
  const Coin map;
  const std::vector<std::vector<double>> edges = collocation_edges(map, {{0, 4}}, 3);
  EXPECT_EQ(edges, (std::vector<std::vector<double>>{{0, 2, 4}}));
  const LaunchState from_three{[](double) { return 3.0; }, 0};
  const double expected = steps(collocate(map, NodeSpace::between(edges, 1), from_three));
  // Above 2 the next state is above 2 or below 1.  m_low = 1 + 3/4 m_high, m_high = 1 + 3/4 m_high + 1/4 m_low.
  const double high = 1.25 / (0.25 - 0.1875);
  EXPECT_NEAR(expected, high, 1e-11);
}

TEST(Collocate, NamesTheSampledMethodWhereThereAreNoPoints) {
  struct Plain {
    std::pair<double, double> state_interval(int) const { return {0, infinity}; }
    int phases() const { return 1; }
    int noise_dimension() const { return 1; }
    std::optional<double> landing(double state, int, std::span<const double>) const { return state; }
  };
  EXPECT_THROW(collocate(Plain{}, NodeSpace::between({{0, 1}}, 1), linear_launch()), std::invalid_argument);
}

TEST(InterpolatedChain, TakesNegativeEntriesButNoUndefinedOnes) {
  const Chain chain = Chain::interpolated({0, 1, 2}, {1, 0}, {-0.125, 0.5}, {0.25, 0.25});
  EXPECT_DOUBLE_EQ(chain.stay(0), 0.875);
  // By hand (I - Q) x = 1 is x0 / 8 + x1 / 8 = 1, -x0 / 2 + 3 x1 / 4 = 1.
  const std::vector<double> x = ChainSolver(chain).solve(std::vector<double>{1, 1});
  EXPECT_NEAR(x[0], 4, 1e-13);
  EXPECT_NEAR(x[1], 4, 1e-13);
  EXPECT_THROW(Chain::interpolated({0, 1, 2}, {1, 0}, {std::nan(""), 0.5}, {0.25, 0.25}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
