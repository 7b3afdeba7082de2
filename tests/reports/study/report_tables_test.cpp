#include "reports/study/report_tables.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/reports/cells.h"

namespace metastable::reports::test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// No number occurs twice: a value in the wrong row shows.
Studied studied() {
  Studied one;
  one.study.setting.emplace();
  one.study.setting->slope_deg = 9.59;
  analysis::StepsToRest& steps = one.study.steps;
  steps.from_start = {11, 10.5, 11.5};
  steps.from_quasi_stationary = {12, 11.6, 12.6};
  steps.worst_start = {9, 8.5, 9.5};
  steps.distribution = {11, 7.7, {{0.05, 1}, {0.5, 8}, {0.95, 30}}};
  steps.seconds = {5.5, 3.3, {}};
  steps.metres = {1.3, 0.9, {}};
  steps.reach_end = 0.043;
  one.study.spectrum.failure_rate = {0.083, 0.08, 0.09};
  one.study.spectrum.mixing_steps = 1.9;
  one.study.spectrum.total_variation_steps = 4;
  one.study.survivors.mean = 5.41;
  one.study.survivors.sd = 0.22;
  one.study.survivors.restart_mean = 5.44;
  one.study.survivors.restart_sd = 0.24;
  one.study.violations = {{"foot lifts", 0.15, 0.16}, {"energy gain", 0.25, 0.26}};
  one.thresholds = {7.8, 10.4};
  return one;
}

TEST(ReportTables, RampsHaveARowForEachAnswer) {
  Studied endless = studied();
  endless.study.setting->law = dynamics::Law::coulomb;
  endless.study.setting->slope_deg = 7.02;
  endless.study.steps = {};
  endless.study.steps.from_start = {infinity, infinity, infinity};
  endless.study.spectrum.total_variation_steps.reset();
  endless.study.violations.clear();
  endless.thresholds = {};
  const Table table = ramps_table({studied(), endless}, {});
  expect_rectangular(table);
  const auto value = [&](const char* quantity) { return at(table, row_of(table, quantity), "published, 9.59 deg"); };
  const auto other = [&](const char* quantity) { return at(table, row_of(table, quantity), "coulomb, 7.02 deg"); };
  expect_cell(value("expected steps before failure, from the launch"), Estimate{11, 10.5, 11.5});
  expect_cell(value("the same from the metastable regime"), Estimate{12, 11.6, 12.6});
  expect_cell(value("the same from the worst start"), Estimate{9, 8.5, 9.5});
  expect_cell(value("standard deviation of the steps"), 7.7);
  expect_cell(value("median of the steps"), 8.0);
  expect_cell(value("mean time to failure"), 5.5);
  expect_cell(value("mean distance to failure"), 1.3);
  expect_cell(value("failure rate per step, 1 − λ₁"), 0.083);
  expect_cell(value("mixing, spectral"), 1.9);
  expect_cell(value("mixing from the launch, total variation"), 4);
  expect_cell(value("reaches the end of the ramp"), 0.043);
  expect_cell(value("speed before a collision, long-run mean"), 5.41);
  expect_cell(value("its standard deviation"), 0.22);
  expect_cell(value("the same mean with a new launch after each rest"), 5.44);
  expect_cell(value("rest is unreachable for launches from"), 7.8);
  expect_cell(value("slope above which such launches exist"), 10.4);
  expect_cell(value("“foot lifts”, share of collisions, long run"), 0.15);
  expect_cell(value("“foot lifts”, share of all collisions until rest"), 0.16);
  expect_cell(value("“energy gain”, share of collisions, long run"), 0.25);
  expect_cell(value("“energy gain”, share of all collisions until rest"), 0.26);
  expect_cell(other("expected steps before failure, from the launch"), Infinite{});
  expect_cell(other("median of the steps"), Infinite{});
  expect_cell(other("mean time to failure"), Infinite{});
  expect_cell(other("mixing from the launch, total variation"), "");
  expect_cell(other("rest is unreachable for launches from"), "");
  expect_cell(other("“foot lifts”, share of collisions, long run"), "");
  expect_cell(at(table, row_of(table, "mean time to failure"), "unit"), "s");
  expect_cell(at(table, row_of(table, "mean distance to failure"), "unit"), "m");
}

Studied with_steps(dynamics::Law law, double slope, Estimate steps) {
  Studied one = studied();
  one.study.setting->law = law;
  one.study.setting->slope_deg = slope;
  one.study.steps.from_start = steps;
  return one;
}

TEST(ReportTables, TheAnswerIsOneSentenceARamp) {
  const Studied settled = with_steps(dynamics::Law::settled, 7.02, {6.41, 6.36, 6.54}),
                published = with_steps(dynamics::Law::published, 7.02, {4.2527, 4.249, 4.2563}),
                endless = with_steps(dynamics::Law::coulomb, 7.02, {infinity, infinity, infinity}),
                rare = with_steps(dynamics::Law::published, 7.02, {infinity, 2.5e40, infinity});
  EXPECT_EQ(
      answer_sentence(settled.study, &published.study),
      "On 7.02 deg the wheel rests after 6.41 steps (95 %: 6.36 to 6.54) under the law of rigid bodies (settled), "
      "after 4.253 under the paper’s law (published).");
  EXPECT_EQ(
      answer_sentence(settled.study, &endless.study),
      "On 7.02 deg the wheel rests after 6.41 steps (95 %: 6.36 to 6.54) under the law of rigid bodies (settled), "
      "never under the law coulomb.");
  EXPECT_EQ(answer_sentence(endless.study, nullptr), "On 7.02 deg the wheel never rests under the law coulomb.");
  EXPECT_EQ(answer_sentence(rare.study, nullptr),
            "On 7.02 deg the wheel rests after more than 2.5×10⁴⁰ steps under the paper’s law (published).");
  const Table table = answer_table({settled, published, endless}, {});
  ASSERT_EQ(table.rows.size(), 1u);
  expect_cell(at(table, 0, "settled"), Estimate{6.41, 6.36, 6.54});
  expect_cell(at(table, 0, "coulomb"), Infinite{});
  expect_cell(at(answer_table({rare}, {}), 0, "published"), "> 2.5×10⁴⁰");
}

TEST(ReportTables, RestsAreToldByLaw) {
  std::vector<Studied> all{with_steps(dynamics::Law::settled, 7.02, {6, 5, 7}),
                           with_steps(dynamics::Law::settled, 9.59, {6, 5, 7}),
                           with_steps(dynamics::Law::coulomb, 7.02, {infinity, infinity, infinity}),
                           with_steps(dynamics::Law::published, 7.02, {4, 3, 5})};
  all[0].study.steps.reach_end = 0.4;
  all[1].study.steps.reach_end = 0.25;
  all[2].study.steps.reach_end = 1;
  all[3].study.steps.reach_end = 7e-6;  // not all of them rest
  EXPECT_EQ(
      rests_text(all),
      "Before the ramp ends, 60 to 75 % of the trials rest under settled, none rest under coulomb, more than 99.9 % "
      "of the trials rest under published.");
  for (Studied& one : all) one.study.steps.reach_end.reset();  // a ramp without end
  EXPECT_EQ(rests_text(all), "");
}

TEST(ReportTables, SensitivitiesStandSideBySideAndOnlySureOnesAreTold) {
  analysis::Setting setting;
  setting.slope_deg = 9.59;
  setting.law = dynamics::Law::settled;
  using P = analysis::Parameter;
  const Hanging settled{
      setting,
      {{{P::friction_mean, {}, 0.4, 17.5, 0.4}, {P::slope, {}, 9.59, 0.04, 0.07}, {P::friction_sd, {}, 0.1, -18, 1}},
       ""}};
  setting.law = dynamics::Law::published;
  const Hanging published{setting, {{{P::friction_mean, {}, 0.4, -12, 0.1}, {P::leg_length, 3, 0.15, 2, 0.1}}, ""}};
  EXPECT_EQ(sensitivity_sentence(settled),
            "1 % more mean of friction μ makes 7.3 % more steps, 1 % more sd of friction μ makes 1.8 % fewer steps");
  const Table table = sensitivity_table("depends-on", {settled, published}, {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 4u);
  expect_cell(at(table, 0, "value"), 0.4);
  EXPECT_NEAR(std::get<Estimate>(at(table, 0, "steps under settled").value()).value, 7.25, 0.01);
  EXPECT_NEAR(std::get<Estimate>(at(table, 0, "steps under published").value()).value, -4.69, 0.01);
  expect_cell(at(table, 1, "steps under published"), "");
  expect_cell(at(table, 3, "one per cent more"), "leg 3");
}

TEST(ReportTables, GridsRunRowByRow) {
  std::vector<Estimate> cells(6);
  for (std::size_t i = 0; i < 6; ++i) {
    const double steps = 10 * static_cast<double>(i + 1);
    cells[i] = {steps, steps - 1, steps + 2};
  }
  const Table table = grid_table("grid", "a grid", {analysis::Parameter::slope, {7, 8}},
                                 {analysis::Parameter::friction_mean, {0.2, 0.3, 0.4}}, cells, {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  const std::string down(analysis::parameter_label(analysis::Parameter::slope)),
      across(analysis::parameter_label(analysis::Parameter::friction_mean));
  expect_cell(at(table, 0, down), 7.0);
  expect_cell(at(table, 1, down), 8.0);
  expect_cell(at(table, 0, across + " 0.2"), Estimate{10, 9, 12});
  expect_cell(at(table, 0, across + " 0.4"), Estimate{30, 29, 32});
  expect_cell(at(table, 1, across + " 0.2"), Estimate{40, 39, 42});
  expect_cell(at(table, 1, across + " 0.3"), Estimate{50, 49, 52});
}

TEST(ReportTables, EnergyLossesStandBesideThePaper) {
  const Table table = energy_table({{{0.066, 0.031, 0.001}, {0.148, 0.051, 0.002}, 1600},
                                    {{0.071, 0.082, 0.003}, {0.145, 0.073, 0.004}, 1600},
                                    {{0.091, 0.112, 0.005}, {0.141, 0.084, 0.006}, 1600}},
                                   dynamics::Law::published, {});
  EXPECT_NE(table.title.find("under published"), std::string::npos);
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 3u);
  expect_cell(at(table, 0, "sd of η and μ"), 0.05);
  expect_cell(at(table, 0, "tangential net mean"), with_error(0.066, 0.001));
  expect_cell(at(table, 0, "paper: tangential net mean"), "0.05");
  expect_cell(at(table, 0, "tangential net sd"), 0.031);
  expect_cell(at(table, 0, "paper: tangential net sd"), "0.03");
  expect_cell(at(table, 0, "normal mean"), with_error(0.148, 0.002));
  expect_cell(at(table, 0, "paper: normal mean"), "0.17");
  expect_cell(at(table, 0, "normal sd"), 0.051);
  expect_cell(at(table, 0, "paper: normal sd"), "0.06");
  expect_cell(at(table, 1, "tangential net sd"), 0.082);
  expect_cell(at(table, 1, "paper: tangential net sd"), "");
  expect_cell(at(table, 1, "paper: normal mean"), "0.17");
  expect_cell(at(table, 2, "normal sd"), 0.084);
  expect_cell(at(table, 2, "paper: tangential net mean"), "0.11");
  expect_cell(at(table, 2, "paper: tangential net sd"), "0.19");
  expect_cell(at(table, 2, "paper: normal sd"), "0.1");
}

}  // namespace
}  // namespace metastable::reports::test
