#include "analysis/gap/map_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

std::vector<MapCell> of_facet(const std::vector<MapCell>& cells, const std::string& facet) {
  std::vector<MapCell> some;
  for (const MapCell& cell : cells)
    if (cell.facet == facet) some.push_back(cell);
  return some;
}

// It has 400 transitions in trials of 4.
const test::Line straight = test::line(0, 3);

TEST(MapCells, RangesSplitAllEventsIntoEqualCounts) {
  for (const auto& [facet, parts] : {std::pair<std::string, std::size_t>{"speed", 5}, {"time", 5}, {"trial", 6}}) {
    std::set<std::size_t> seen;
    std::size_t cells = 0;
    for (const MapCell& cell : of_facet(map_cells(straight), facet)) {
      if (!cell.weights.empty()) continue;
      ++cells;
      EXPECT_NEAR(static_cast<double>(cell.events.size()), 400.0 / static_cast<double>(parts), 4) << cell.at;
      for (const std::size_t i : cell.events) EXPECT_TRUE(seen.insert(i).second) << "in two cells of " << facet;
    }
    EXPECT_EQ(cells, parts);
    EXPECT_EQ(seen.size(), 400U);
  }
}

TEST(MapCells, RangesHoldWhatTheyAreNamedAfter) {
  double last = -1e9;
  for (const MapCell& cell : of_facet(map_cells(straight), "speed")) {
    double least = 1e9, most = -1e9;
    for (const std::size_t i : cell.events) {
      least = std::min(least, straight.events()[i].speed);
      most = std::max(most, straight.events()[i].speed);
    }
    EXPECT_GE(least, last);
    last = most;
    double from = 0, to = 0;
    ASSERT_EQ(std::sscanf(cell.at.c_str(), "speed %lf to %lf rad/s", &from, &to), 2) << cell.at;
    EXPECT_NEAR(from, least, 0.02) << cell.at;
    EXPECT_GE(to, most - 0.02) << cell.at;
  }
}

TEST(MapCells, StepsGroupByNumber) {
  std::map<std::string, std::size_t> counts;
  for (const MapCell& cell : of_facet(map_cells(straight), "step")) counts[cell.at] = cell.events.size();
  EXPECT_EQ(counts, (std::map<std::string, std::size_t>{
                        {"step 1", 100}, {"step 2", 100}, {"steps 3 to 4", 200}}));
}

TEST(MapCells, ATrendRunsFromTheFirstTrialToTheLast) {
  const MapCell* trend = nullptr;
  const std::vector<MapCell> trials = of_facet(map_cells(straight), "trial");
  for (const MapCell& cell : trials)
    if (!cell.weights.empty()) trend = &cell;
  ASSERT_TRUE(trend);
  ASSERT_EQ(trend->weights.size(), 400U);
  double sum = 0;
  for (const double w : trend->weights) sum += w;
  EXPECT_EQ(trend->weights.front(), -1);
  EXPECT_EQ(trend->weights.back(), 1);
  EXPECT_NEAR(sum, 0, 1e-9);
}

TEST(MapCells, SwingsAreCosinesAndSinesOfTheTime) {
  int swings = 0;
  double fastest = 0;
  for (const MapCell& cell : map_cells(straight)) {
    if (!cell.swing) continue;
    ++swings;
    char which[16];
    double frequency = 0;
    ASSERT_EQ(std::sscanf(cell.at.c_str(), "%15s of %lf Hz", which, &frequency), 2) << cell.at;
    fastest = std::max(fastest, frequency);
    double squares = 0;
    for (const double w : cell.weights) squares += w * w;
    // It goes over evenly spread times; the slowest swing is no whole number of turns.
    EXPECT_NEAR(squares / static_cast<double>(cell.weights.size()), 0.5, 0.1) << cell.at;
  }
  EXPECT_GT(swings, 10);
  EXPECT_EQ(swings % 2, 0);
  EXPECT_LE(fastest, 60);
}

TEST(MapCells, AFacetOfOneValueHasNoCells) {
  EXPECT_TRUE(of_facet(map_cells(straight), "condition").empty());
  EXPECT_TRUE(of_facet(map_cells(straight), "leg").empty());  // no event knows its leg
}

TEST(MapCells, NoCellIsSmallerThanTheLeast) {
  for (const std::size_t count : {19U, 24U, 60U, 90U})
    for (const MapCell& cell : map_cells(test::line(0, 3, count)))
      EXPECT_GE(cell.events.size(), static_cast<std::size_t>(least_cell_events)) << cell.at << " of " << count;
  EXPECT_TRUE(map_cells(test::line(0, 3, 19)).empty());
}

TEST(MapCells, PhasesAreCutByThemselves) {
  const auto model = wheel_transitions(test::wheel_design(30, 6));
  std::size_t launches = 0, stances = 0, contacts = 0;
  for (const Event& e : model->events()) {
    launches += e.kind == EventKind::launch;
    stances += is_stance(e.kind);
    contacts += is_contact(e.kind);
  }
  std::set<std::string> facets;
  for (const MapCell& cell : map_cells(*model)) {
    facets.insert(cell.facet);
    for (const std::size_t i : cell.events) {
      const EventKind kind = model->events()[i].kind;
      EXPECT_EQ(kind == EventKind::launch, cell.at == "launch");
      EXPECT_EQ(is_stance(kind), cell.stance) << cell.at;
    }
    if (cell.facet == "phase") {
      EXPECT_EQ(cell.events.size(), cell.stance ? stances : contacts);
    }
    if (cell.at == "launch") {
      EXPECT_EQ(cell.events.size(), launches);
    }
  }
  for (const char* facet : {"leg", "position", "collision", "trial", "condition", "phase"})
    EXPECT_TRUE(facets.contains(facet)) << facet;
}

}  // namespace
}  // namespace metastable::analysis
