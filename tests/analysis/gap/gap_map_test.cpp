#include "analysis/gap/gap_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "analysis/drum_model/coast_down_transitions.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"
#include "tests/analysis/rotor.h"

namespace metastable::analysis {
namespace {

using test::Line;
using test::line;
using test::since_previous;

TEST(GapMap, FindsTheCellThatIsShiftedAndNothingInNone) {
  const Line shifted = line(0, 7, 1200, 0.3), plain = line(0, 8, 1200);
  const GapMap found = gap_map(shifted, fit(shifted, {3, -0.7}, {}), 500, 1);
  double best = 0;
  std::string facet, at;
  for (const GapCell& cell : found.cells)
    if (std::abs(cell.statistic) > best) {
      best = std::abs(cell.statistic);
      facet = cell.facet;
      at = cell.at;
    }
  EXPECT_LT(found.p_value, 0.001);
  EXPECT_TRUE(facet == "collision" || facet == "position") << facet << ' ' << at;
  EXPECT_GT(gap_map(plain, fit(plain, {3, -0.7}, {}), 500, 1).p_value, 0.02);
}

// Returns the cell that stands out most where `shift` (event) is added to noise of 0.5.
template <class Shift>
GapCell first_cell(unsigned seed, Shift shift) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < 1200; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + 0.5 * normal(generator) + shift(i));
  }
  const Line model(y, w);
  const GapMap map = gap_map(model, fit(model, {3, -0.7}, {}), 500, 1);
  return *std::min_element(map.cells.begin(), map.cells.end(),
                           [](const GapCell& a, const GapCell& b) { return a.p_adjusted < b.p_adjusted; });
}

TEST(GapMap, SeesATrendOverTheTrials) {
  const GapCell cell = first_cell(21, [](std::size_t i) { return 0.14 * (static_cast<double>(i / 4) / 149.5 - 1); });
  EXPECT_EQ(cell.at, "trend over the trials");
  EXPECT_LT(cell.p_adjusted, 0.01);
  EXPECT_NEAR(cell.size, 0.14, 3 * 0.5 / std::sqrt(1200 / 3.0));  // at the last trial, from the middle
}

TEST(GapMap, SeesASwingWithTheTimeSinceThePreviousCollision) {
  const GapCell cell =
      first_cell(22, [](std::size_t i) { return 0.13 * std::sin(2 * 3.14159 * 40 * since_previous(i)); });
  EXPECT_EQ(cell.facet, "time");
  EXPECT_NE(cell.at.find("Hz in the time since the previous collision"), std::string::npos) << cell.at;
  EXPECT_LT(cell.p_adjusted, 0.01);
}

TEST(GapMap, SeesTrialsThatDifferAsWholes) {
  std::mt19937_64 generator(3);
  std::normal_distribution<double> offset(0, 0.2);
  std::vector<double> offsets(300);
  for (double& o : offsets) o = offset(generator);
  const GapCell cell = first_cell(23, [&](std::size_t i) { return offsets[i / 4]; });
  EXPECT_EQ(cell.at, "trials as a whole");
  EXPECT_LT(cell.p_adjusted, 1e-4);
}

// Twenty events that scatter 2.5 times as much: a sum of squares weighed by its own scatter passes 2.5 at the most.
TEST(GapMap, SeesALargerSpreadOfFewEvents) {
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < 120; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + (i >= 40 && i < 60 ? 1.25 : 0.5) * normal(generator));
  }
  const Line model(y, w);
  const GapMap map = gap_map(model, fit(model, {3, -0.7}, {}), 500, 1);
  const auto first = std::ranges::min_element(map.cells, {}, &GapCell::p_adjusted);
  EXPECT_EQ(first->facet, "trial");
  EXPECT_EQ(first->aspect, "spread");
  EXPECT_LT(first->p_adjusted, 0.005);
}

// A third of the trials lies 1.2 errors off: what is shifted scatters no more around its own mean.
TEST(GapMap, AShiftIsNoLargerSpread) {
  std::mt19937_64 generator(6);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < 240; ++i) {
    w.push_back(normal(generator));
    y.push_back((i < 40 ? 1.2 : 0.0) + normal(generator));
  }
  const Line model(y, w);
  Fit stated;
  stated.nuisance = {0, 0};
  stated.evaluation = model.evaluate(stated.nuisance, {});
  const GapMap map = gap_map(model, stated, 0, 1);
  double spread = 0, mean = 0;
  for (const GapCell& cell : map.cells)
    if (cell.facet == "trial" && cell.at.starts_with("trial 1 "))
      (cell.aspect == "spread" ? spread : mean) = cell.statistic;
  EXPECT_GT(mean, 2.5);
  EXPECT_LT(spread, 2.5);
}

// The model has two columns in ten steps of a trial; `together` of the second one's error is that of the first, in this
// step or the one before.
class TwoColumns : public Line {
 public:
  TwoColumns(double together, int later) : Line({}, {}) {
    std::mt19937_64 generator(11);
    std::normal_distribution<double> normal;
    double before = 0;
    for (int i = 0; i < 800; ++i) {
      Event e;
      e.trial = static_cast<std::size_t>(i / 20);
      e.number = i % 20 / 2 + 1;
      e.column = static_cast<std::size_t>(i % 2);
      const double own = normal(generator), of_first = later == 1 ? before : i > 0 ? y_.back() : 0;
      if (i % 2 == 1 && later == 1) before = y_.back();
      e.speed = normal(generator);
      w_.push_back(e.speed);
      y_.push_back(i % 2 == 1 ? together * of_first + std::sqrt(1 - together * together) * own : own);
      events_.push_back(e);
    }
  }
  std::vector<ObservedColumn> columns() const override { return {{"angle", ""}, {"rate", ""}}; }
};

TEST(GapMap, SeesColumnsThatErrTogether) {
  for (const int later : {0, 1}) {
    const TwoColumns model(0.4, later);
    const GapMap map = gap_map(model, fit(model, {0, 0}, {}), 500, 1);
    const auto first = std::ranges::min_element(map.cells, {}, &GapCell::p_adjusted);
    EXPECT_EQ(first->facet, "pair of columns");
    EXPECT_EQ(first->aspect, "correlation");
    EXPECT_EQ(first->at, later == 1 ? "angle, then rate a step later" : "angle and rate of one step");
    EXPECT_NEAR(first->size, 0.4, 0.15);
    EXPECT_LT(first->p_adjusted, 0.005);
  }
}

// Errors with an excess of kurtosis of 3 spread as much everywhere.
TEST(GapMap, FarErrorsAreNoLargerSpread) {
  constexpr int sets = 150;
  int below = 0;
  for (unsigned seed = 500; seed < 500 + sets; ++seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::exponential_distribution<double> mixed(1);
    std::vector<double> y, w;
    for (std::size_t i = 0; i < 400; ++i) {
      w.push_back(normal(generator));
      y.push_back(3 + 0.5 * std::sqrt(mixed(generator)) * normal(generator));
    }
    const Line model(y, w);
    const GapMap map = gap_map(model, fit(model, {3, -0.7}, {}), 300, 1);
    below += std::ranges::any_of(map.cells,
                                 [](const GapCell& cell) { return cell.aspect == "spread" && cell.p_adjusted < 0.05; });
  }
  EXPECT_LE(below, 0.05 * sets + 3 * std::sqrt(0.05 * 0.95 * sets));
}

TEST(GapMap, LevelsAreHonest) {
  constexpr int sets = 150;
  int below = 0;
  for (unsigned seed = 100; seed < 100 + sets; ++seed)
    below += first_cell(seed, [](std::size_t) { return 0.0; }).p_adjusted < 0.05;
  EXPECT_LE(below, 0.05 * sets + 3 * std::sqrt(0.05 * 0.95 * sets));
}

TEST(GapMap, IsTheSameForTheSameSeed) {
  const Line model = line(0, 9, 400);
  const Fit plain = fit(model, {3, -0.7}, {});
  const GapMap a = gap_map(model, plain, 300, 5), b = gap_map(model, plain, 300, 5);
  ASSERT_EQ(a.cells.size(), b.cells.size());
  for (std::size_t i = 0; i < a.cells.size(); ++i) EXPECT_EQ(a.cells[i].p_adjusted, b.cells[i].p_adjusted);
}

bool has_swings(const TransitionModel& model) {
  const GapMap map = gap_map(model, fit(model, nominal_values(model), {}), 0, 1);
  return std::any_of(map.cells.begin(), map.cells.end(), [](const GapCell& cell) { return cell.swing; });
}

// Swings need times of their own: measured ones, whether or not it is known which leg landed, but not a rotor's.
TEST(GapMap, LooksForSwingsWhereTimesTellMoreThanSpeeds) {
  Experiment e = test::wheel_design(40, 8, false);
  const auto complete = wheel_transitions(e);
  EXPECT_TRUE(has_swings(*complete->simulate(nominal_values(*complete), {}, 4)));
  e.columns.leg = Presence::none;
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) c.leg.reset();
  const auto without_legs = wheel_transitions(e);
  ASSERT_EQ(without_legs->legs(), 0);
  EXPECT_TRUE(without_legs->time_tells());
  EXPECT_TRUE(has_swings(*without_legs->simulate(nominal_values(*without_legs), {}, 4)));
  e.columns.time = Presence::none;
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) c.time.reset();
  const auto without_times = wheel_transitions(e);
  EXPECT_FALSE(has_swings(*without_times->simulate(nominal_values(*without_times), {}, 4)));
  const auto rotor = coast_down_transitions(test::coasting_rotor());
  EXPECT_FALSE(has_swings(*rotor->simulate(nominal_values(*rotor), {}, 4)));
}

// Without draws an adjusted p-value is the cell's own, times the cells it is one of.
TEST(GapMap, TakesNoDrawsAtAll) {
  const Line model = line(0, 9, 400);
  const GapMap map = gap_map(model, fit(model, {3, -0.7}, {}), 0, 5);
  ASSERT_FALSE(map.cells.empty());
  for (const GapCell& cell : map.cells) EXPECT_GE(cell.p_adjusted, cell.p_value);
}

}  // namespace
}  // namespace metastable::analysis
