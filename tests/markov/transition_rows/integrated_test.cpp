#include "markov/transition_rows/integrated.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"
#include "tests/markov/linear_map.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

using testing::Linear;
using testing::linear_launch;
using testing::LinearWithDensity;
using testing::steps;

TEST(NodeSpace, IntegratesPolynomialsExactly) {
  const NodeSpace space({{1, 3}, {0, 1}}, 2);
  ASSERT_EQ(space.size(), 64u);
  double sum = 0;
  for (std::size_t j = 0; j < space.nodes(); ++j) sum += space.weights(0)[j] * std::pow(space.nodes(0)[j], 31);
  EXPECT_NEAR(sum / ((std::pow(3, 32) - 1) / 32), 1, 1e-14);
  const StateSpace cells = space.cells();
  for (std::size_t i = 0; i < space.size(); ++i) {
    const Grid& grid = cells.grid(space.phase(i));
    EXPECT_EQ(grid.cell(space.node(i)), i % space.nodes());
  }
}

TEST(NodeSpace, RefusesWhatIsNoInterval) {
  EXPECT_THROW(NodeSpace({{1, 1}}, 2), std::invalid_argument);
  EXPECT_THROW(NodeSpace({{0, std::numeric_limits<double>::infinity()}}, 2), std::invalid_argument);
  EXPECT_THROW(NodeSpace({{0, 1}}, 0), std::invalid_argument);
}

TEST(Integrate, IsStableUnderDoublingHoweverRareRestIs) {
  for (const double sd : {0.6, 0.3, 0.15}) {  // 5e2, 4e8, 1e31 steps
    const LinearWithDensity map{{.sd = sd}};
    const NodeSpace space(node_ranges(map, linear_launch(), 1), 8);
    const double coarse = steps(integrate(map, space, linear_launch()));
    const double fine = steps(integrate(map, space.with_panels(16), linear_launch()));
    EXPECT_NEAR(coarse / fine, 1, 1e-12) << sd << ' ' << fine;
  }
}

TEST(Integrate, RowsAndLaunchSumToOne) {
  const LinearWithDensity map;
  const NodeSpace space(node_ranges(map, linear_launch(), 1), 8);
  const IntegratedChain integrated = integrate(map, space, linear_launch(), 2);
  const Launch& start = integrated.chain.launch;
  EXPECT_NEAR(std::accumulate(start.after.begin(), start.after.end(), start.rest), 1, 1e-14);
  const Launch row = integrated_launch(map, space, {[](double) { return 0.0; }});
  EXPECT_NEAR(std::accumulate(row.after.begin(), row.after.end(), row.rest), 1, 1e-14);
  EXPECT_DOUBLE_EQ(row.rest, *map.rest_probability(0, 0));
  EXPECT_LT(integrated.row_error, 1e-3);  // of the topmost rows, which land beyond the range
}

TEST(Integrate, KeepsThePeriodOfPhases) {
  const LinearWithDensity one, three{{.count = 3}};
  const NodeSpace single({{0, 4}}, 6), triple({{0, 4}, {0, 4}, {0, 4}}, 6);
  const IntegratedChain a = integrate(one, single, linear_launch()), b = integrate(three, triple, linear_launch());
  const ChainSolver solver(b.chain.chain);
  EXPECT_EQ(solver.period().period, 3);
  EXPECT_NEAR(steps(b) / steps(a), 1, 1e-12);
  EXPECT_NEAR(quasi_stationary(solver).failure_rate / quasi_stationary(ChainSolver(a.chain.chain)).failure_rate, 1,
              1e-12);
}

TEST(Integrate, AgreesWithTheSampledChain) {
  const LinearWithDensity map{{.sd = 0.6}};
  const NodeSpace space(node_ranges(map, linear_launch(), 1), 8);
  const StateSpace cells = covering_space(map, linear_launch(), 200, 1);
  const SampledChain sampled = discretize(map, cells, linear_launch(), {.draws = {.count = 8192}});
  const std::vector<double> mean = mean_first_passage(ChainSolver(sampled.chain));
  const double by_cells = 1 + std::inner_product(mean.begin(), mean.end(), sampled.launch.after.begin(), 0.0);
  EXPECT_NEAR(steps(integrate(map, space, linear_launch())) / by_cells, 1, 5e-3);
}

TEST(Integrate, RefusesAMapWithoutADensity) {
  const Linear map;
  EXPECT_NE(message_of([&] {
              integrate(map, NodeSpace({{0, 4}}, 2), linear_launch());
            }).find("use the sampled method"),
            std::string::npos);
}

}  // namespace
}  // namespace metastable::markov
