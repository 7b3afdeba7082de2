#include "reports/description/describe_tables.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "tests/reports/cells.h"

namespace metastable::reports::test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double t_3 = 3.182446305284263;   // 97.5 % quantile of Student's t, 3 degrees of freedom (R: qt(0.975, 3))
constexpr double t_4 = 2.7764451051977987;  // and 4

analysis::SpeedSummary summary(std::size_t count, double mean, double sd) {
  return {count, mean, sd, sd / std::sqrt(static_cast<double>(count))};
}

// No number occurs twice below: a value in the wrong column shows.

analysis::ConditionDescription fast() {
  analysis::ConditionDescription c;
  c.id = "fast";
  c.slope_deg = 9.59;
  c.trials = 51;
  c.collisions = 790;
  c.profile = {summary(51, 5.83, 0.28), summary(1, 5.6, 0)};
  c.steady = summary(4, 5.51, 0.12);
  c.steady_collisions = summary(188, 5.52, 0.31);
  c.legs = {{summary(4, 5.41, 0.02), {}, summary(5, 5.43, 0.03)}};
  c.line = {100, 0.61, 0.04, 2.1, 5.38, 0.2};
  c.survival.emplace();
  c.survival->trials = 51;
  c.survival->rests = 7;
  c.survival->curve = {{1, 51, 3, 0.94, 0.03, 0.83, 0.98}, {2, 48, 4, 0.86, 0.05, 0.73, 0.93}};
  c.survival->expected.from_start = {62, 40, 95};
  c.survival->expected.message = "seven trials rest";
  return c;
}

analysis::ConditionDescription flat() {
  analysis::ConditionDescription c;
  c.id = "flat";
  c.slope_deg = 7.02;
  c.trials = 50;
  c.collisions = 641;
  c.profile = {summary(50, 7.35, 0.19)};
  c.steady = summary(1, 4.71, 0);
  c.survival.emplace();
  c.survival->trials = 50;
  c.survival->rests = 0;
  c.survival->curve = {{1, 50, 0, 1, 0, 0.92, 1}};
  c.survival->expected.from_start = {infinity, 210, infinity};
  return c;
}

analysis::ConditionComparison fast_and_flat() {
  analysis::ConditionComparison pair;
  pair.a = 0;
  pair.b = 1;
  pair.meet = 9;
  analysis::SampleComparison means;
  means.count_a = 44;
  means.count_b = 38;
  means.welch = {{0.81, 0.70, 0.92}, 14, 80, 0.021};
  means.pooled = {{0.82, 0.71, 0.93}, 15, 81, 0.032};
  means.kolmogorov_smirnov = {0.5, 0.043};
  means.anderson_darling = {9, 0.054};
  means.hedges = {1.7, 1.1, 2.3};
  means.superiority = {0.88, 0.79, 0.94};
  means.distance = {0.65, 0.35, 0.95};
  pair.trial_means = means;
  means.count_a = 176;
  means.count_b = 152;
  means.welch.p = 1e-9;
  means.hedges.value = infinity;
  pair.all_collisions = means;
  return pair;
}

analysis::DescribedFit fit_of_all() {
  analysis::DescribedFit fit;
  fit.of = "all conditions";
  fit.fit.transitions = 1400;
  fit.fit.rests = 8;
  fit.fit.impossible = 3;
  fit.fit.log_likelihood = -2222.5;
  fit.fit.value = {0.54, 0.045, 0.352, 0.043};
  fit.fit.lower_95 = {0.53, 0.041, 0.349, 0.039};
  fit.fit.upper_95 = {0.55, 0.049, 0.355, 0.047};
  return fit;
}

analysis::Description description() {
  analysis::Description d;
  d.conditions = {fast(), flat()};
  d.comparisons = {fast_and_flat()};
  d.fits = {fit_of_all(), {}};
  d.fits.back().of = "flat";
  d.fits.back().fit.status = analysis::ContactFit::Status::impossible;
  return d;
}

TEST(DescribeTables, ConditionsHoldWhatTheDescriptionHolds) {
  const Table table = conditions_table(description(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 0, "condition"), "fast");
  expect_cell(at(table, 0, "slope"), 9.59);
  expect_cell(at(table, 0, "trials"), 51);
  expect_cell(at(table, 0, "collisions"), 790);
  expect_cell(at(table, 0, "steady speed"), Estimate{5.51, 5.51 - t_3 * 0.06, 5.51 + t_3 * 0.06});
  expect_cell(at(table, 0, "sd between trials"), 0.12);
  expect_cell(at(table, 0, "sd between collisions"), 0.31);
  expect_cell(at(table, 0, "return-map slope"), with_error(0.61, 0.04));
  expect_cell(at(table, 0, "its fixed point"), 5.38);
  expect_cell(at(table, 0, "trials that rest"), 7);
  expect_cell(at(table, 0, "expected steps before failure"), Estimate{62, 40, 95});
  // One value has no interval and no sd; what is not known stays empty; no rest gives a bound.
  expect_cell(at(table, 1, "steady speed"), 4.71);
  expect_cell(at(table, 1, "sd between trials"), "");
  expect_cell(at(table, 1, "sd between collisions"), "");
  expect_cell(at(table, 1, "return-map slope"), "");
  expect_cell(at(table, 1, "its fixed point"), "");
  expect_cell(at(table, 1, "trials that rest"), 0);
  expect_cell(at(table, 1, "expected steps before failure"), "> 210");
  EXPECT_EQ(table.notes.back(), "fast: seven trials rest.");
}

TEST(DescribeTables, ProfilesStandSideBySide) {
  const Table table = profiles_table(description(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 0, "collision"), 1);
  expect_cell(at(table, 0, "fast trials"), 51);
  expect_cell(at(table, 0, "fast mean"), 5.83);
  expect_cell(at(table, 0, "fast standard error"), 0.28 / std::sqrt(51.0));
  expect_cell(at(table, 0, "flat trials"), 50);
  expect_cell(at(table, 0, "flat mean"), 7.35);
  expect_cell(at(table, 0, "flat standard error"), 0.19 / std::sqrt(50.0));
  expect_cell(at(table, 1, "collision"), 2);
  expect_cell(at(table, 1, "fast trials"), 1);
  expect_cell(at(table, 1, "fast mean"), 5.6);
  expect_cell(at(table, 1, "fast standard error"), "");
  expect_cell(at(table, 1, "flat trials"), 0);
  expect_cell(at(table, 1, "flat mean"), "");
}

TEST(DescribeTables, LegsWithoutACollisionAreLeftOut) {
  const Table table = legs_table(description(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 0, "leg"), 0);
  expect_cell(at(table, 0, "fast"), Estimate{5.41, 5.41 - t_3 * 0.01, 5.41 + t_3 * 0.01});
  expect_cell(at(table, 0, "flat"), "");
  expect_cell(at(table, 1, "leg"), 2);
  const double half = t_4 * 0.03 / std::sqrt(5.0);
  expect_cell(at(table, 1, "fast"), Estimate{5.43, 5.43 - half, 5.43 + half});
}

TEST(DescribeTables, TestsHaveEachItsColumn) {
  const Table table = tests_table(description(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 0, "conditions"), "fast, flat");
  expect_cell(at(table, 0, "values"), "trial means");
  expect_cell(at(table, 0, "n"), "44, 38");
  expect_cell(at(table, 0, "difference of means"), Estimate{0.81, 0.70, 0.92});
  expect_cell(at(table, 0, "P Welch"), 0.021);
  expect_cell(at(table, 0, "P pooled t"), 0.032);
  expect_cell(at(table, 0, "P Kolmogorov-Smirnov"), 0.043);
  expect_cell(at(table, 0, "P Anderson-Darling"), 0.054);
  expect_cell(at(table, 0, "Hedges' g"), Estimate{1.7, 1.1, 2.3});
  expect_cell(at(table, 0, "P(first > second)"), Estimate{0.88, 0.79, 0.94});
  expect_cell(at(table, 0, "distance D"), Estimate{0.65, 0.35, 0.95});
  expect_cell(at(table, 0, "not told apart from collision"), 9);
  expect_cell(at(table, 1, "values"), "all collisions");
  expect_cell(at(table, 1, "n"), "176, 152");
  expect_cell(at(table, 1, "P Welch"), 1e-9);
  expect_cell(at(table, 1, "Hedges' g"), Infinite{});
  expect_cell(at(table, 1, "not told apart from collision"), "");
}

TEST(DescribeTables, SurvivalEndsWithEachCondition) {
  const Table table = survival_table(description(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 1, "n"), 2);
  expect_cell(at(table, 1, "fast at risk"), 48);
  expect_cell(at(table, 1, "fast rested"), 4);
  expect_cell(at(table, 1, "fast P(steps > n)"), Estimate{0.86, 0.73, 0.93});
  expect_cell(at(table, 1, "flat at risk"), "");
  expect_cell(at(table, 0, "flat at risk"), 50);
  expect_cell(at(table, 0, "flat rested"), 0);
  expect_cell(at(table, 0, "flat P(steps > n)"), Estimate{1, 0.92, 1});
}

TEST(DescribeTables, FitsHoldTheFourParametersInOrder) {
  const Table table = fits_table(description(), dynamics::Law::published, {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_cell(at(table, 0, "fitted to"), "all conditions");
  expect_cell(at(table, 0, "transitions"), 1400);
  expect_cell(at(table, 0, "rests"), 8);
  expect_cell(at(table, 0, "left out"), 3);
  expect_cell(at(table, 0, "η mean"), Estimate{0.54, 0.53, 0.55});
  expect_cell(at(table, 0, "η sd"), Estimate{0.045, 0.041, 0.049});
  expect_cell(at(table, 0, "μ mean"), Estimate{0.352, 0.349, 0.355});
  expect_cell(at(table, 0, "μ sd"), Estimate{0.043, 0.039, 0.047});
  expect_cell(at(table, 0, "log-likelihood"), -2222.5);
  expect_cell(at(table, 1, "η mean"), "");
  expect_cell(at(table, 1, "log-likelihood"), "");
}

TEST(DescribeTables, LawsStandBesideTheMeasuredTrials) {
  analysis::LawComparison comparison;
  comparison.rows.push_back({"fast", "measured", 51, summary(4, 5.51, 0.12), 0.31, {0.14, 0.06, 0.27}, true, {}, {}});
  comparison.rows.push_back(
      {"fast", "coulomb, as given", 1000, summary(5, 5.61, 0.03), 0.33, {0, 0, 0.004}, false, 0.0031, {}});
  comparison.rows.push_back({"fast", "plastic, fitted", 0, {}, 0, {}, true, {}, "no fit"});
  const Table table = laws_table(comparison, {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 3u);
  expect_cell(at(table, 0, "condition"), "fast");
  expect_cell(at(table, 0, "source"), "measured");
  expect_cell(at(table, 0, "trials"), 51);
  expect_cell(at(table, 0, "steady speed"), Estimate{5.51, 5.51 - t_3 * 0.06, 5.51 + t_3 * 0.06});
  expect_cell(at(table, 0, "sd between trials"), 0.12);
  expect_cell(at(table, 0, "sd between collisions"), 0.31);
  expect_cell(at(table, 0, "share that rests"), Estimate{0.14, 0.06, 0.27});
  expect_cell(at(table, 0, "P same speed"), "");
  expect_cell(at(table, 1, "source"), "coulomb, as given");
  expect_cell(at(table, 1, "sd between collisions"), 0.33);
  expect_cell(at(table, 1, "share that rests"), "");
  expect_cell(at(table, 1, "P same speed"), 0.0031);
  expect_cell(at(table, 2, "steady speed"), "no fit");
}

}  // namespace
}  // namespace metastable::reports::test
