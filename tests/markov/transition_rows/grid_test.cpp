#include "markov/transition_rows/grid.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

namespace metastable::markov {
namespace {

std::uint32_t by_search(const Grid& grid, double state) {
  const auto edges = grid.edges();
  const auto above = std::upper_bound(edges.begin(), edges.end(), state);
  const auto cell = above - edges.begin() - 1;
  return static_cast<std::uint32_t>(std::clamp<std::ptrdiff_t>(cell, 0, static_cast<std::ptrdiff_t>(grid.cells()) - 1));
}

RC_GTEST_PROP(Grid, CellAgreesWithBinarySearchOnAnyEdges, ()) {
  const auto whole = *rc::gen::suchThat(rc::gen::container<std::set<int>>(rc::gen::inRange(-1000, 1000)),
                                        [](const std::set<int>& s) { return s.size() >= 2; });
  std::vector<double> edges;
  for (const int e : whole) edges.push_back(e < 0 ? e * 0.013 : std::expm1(e * 0.01));  // strongly graded
  const Grid grid(edges);
  for (const double edge : edges)
    for (const double state : {edge, std::nextafter(edge, -1e9), std::nextafter(edge, 1e9), edge + 0.1})
      RC_ASSERT(grid.cell(state) == by_search(grid, state));
}

// Both ways of finding a cell agree, for even grids and for strongly graded ones, edges, rest and what has overflown
// included.
RC_GTEST_PROP(Grid, TallyCountsWhereCellSays, ()) {
  const auto whole = *rc::gen::suchThat(rc::gen::container<std::set<int>>(rc::gen::inRange(0, 300)),
                                        [](const std::set<int>& s) { return s.size() >= 2; });
  const bool graded = *rc::gen::arbitrary<bool>();
  std::vector<double> edges;
  for (const int e : whole) edges.push_back(graded ? std::expm1(e * 0.1) : 2 + e * 0.1);
  const Grid grid(edges);
  std::vector<double> states{-1e300, 1e300, -INFINITY, INFINITY};
  for (const double edge : edges)
    for (const double state : {edge, std::nextafter(edge, -1e9), std::nextafter(edge, 1e9), edge + 0.3})
      states.push_back(state);
  std::vector<double> weights(states.size()), sums(grid.cells() + 1, 0.0), expected = sums;
  for (std::size_t k = 0; k < states.size(); ++k) {
    weights[k] = static_cast<double>(1 + k);  // whole numbers: sums are exact in any order
    expected[states[k] == -INFINITY ? 0 : 1 + by_search(grid, states[k])] += weights[k];
  }
  grid.tally(states, weights, sums);
  RC_ASSERT(sums == expected);
}

TEST(Grid, HalvingKeepsEveryEdge) {
  const Grid grid({0.0, 1.0, 4.0});
  const Grid halved = grid.halved();
  ASSERT_EQ(halved.cells(), 4u);
  const std::vector<double> expected{0.0, 0.5, 1.0, 2.5, 4.0};
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), halved.edges().begin()));
  EXPECT_DOUBLE_EQ(halved.width(2), 1.5);
  EXPECT_DOUBLE_EQ(halved.midpoint(3), 3.25);
}

TEST(Grid, StatesBeyondTheEdgesCountIntoTheEndCells) {
  const Grid grid = Grid::uniform(2.0, 3.0, 10);
  EXPECT_EQ(grid.cell(1.0), 0u);
  EXPECT_EQ(grid.cell(3.0), 9u);
  EXPECT_EQ(grid.cell(1e300), 9u);
}

TEST(Grid, RefusesEdgesThatDoNotAscend) {
  EXPECT_THROW(Grid({1.0}), std::invalid_argument);
  EXPECT_THROW(Grid({1.0, 1.0}), std::invalid_argument);
  EXPECT_THROW(Grid({1.0, std::nan("")}), std::invalid_argument);
  EXPECT_THROW(Grid::uniform(0, 1, 0), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
