#include "reports/description/paper_tables.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "analysis/description/description.h"
#include "reports/description/paper_figures.h"
#include "reports/description/speed_cells.h"
#include "tests/reports/cells.h"

namespace metastable::reports::test {
namespace {

constexpr double t_1 = 12.706204736432095;  // 97.5 % quantile of Student's t, 1 degree of freedom (R: qt(0.975, 1))

// Makes a profile whose numbers are all made of one: its mean steady speed is `mean`, with an sd between trials of
// 0.01.
analysis::StudiedProfile profile(double mean) {
  analysis::StudiedProfile p;
  p.label = "a line";
  p.trial_means = {mean - 0.01 / std::sqrt(2.0), mean + 0.01 / std::sqrt(2.0)};
  p.steady = p.trial_means;
  for (int n = 1; n <= 16; ++n) p.profile.push_back({2, mean, mean / (n >= 13 ? 20 : n == 1 ? 1 : 10), 0.01});
  p.rest_share = mean / 100;
  return p;
}
Estimate steady(double mean) { return {mean, mean - t_1 * 0.01 / std::sqrt(2.0), mean + t_1 * 0.01 / std::sqrt(2.0)}; }

void expect_near(const Cell& cell, const Estimate& estimate) {
  const auto* held = std::get_if<Estimate>(&cell.value());
  ASSERT_NE(held, nullptr);
  EXPECT_NEAR(held->value, estimate.value, 1e-10);
  EXPECT_NEAR(held->lower, estimate.lower, 1e-10);
  EXPECT_NEAR(held->upper, estimate.upper, 1e-10);
}

analysis::SobolResult shares(double mean) {
  analysis::SobolResult result;
  result.mean = mean;
  result.sd = mean / 10;
  for (int g = 0; g < 4; ++g) {
    const double first = 0.1 + 0.05 * g + mean / 1000, total = first + 0.4;
    result.group.push_back({{first, first - 0.01, first + 0.01}, {total, total - 0.02, total + 0.02}});
  }
  return result;
}

// Every number says which figure, panel and run it is of: no two are the same.
analysis::VariantStudy study(const analysis::Variant& variant, double base) {
  analysis::VariantStudy s;
  s.variant = variant;
  for (int trial = 0; trial < 3; ++trial) {
    s.fig4.fast.speeds.emplace_back();
    s.fig4.slow.speeds.emplace_back();
    for (int n = 1; n <= 16; ++n) {
      s.fig4.fast.speeds.back().push_back(5.8 + 0.01 * trial + 0.001 * n);
      s.fig4.slow.speeds.back().push_back(4.9 + 0.02 * trial * trial + 0.001 * n);
    }
  }
  for (std::size_t j = 0; j < 4; ++j) {
    const double panel = base + 0.1 * static_cast<double>(j + 1);
    s.fig6[j].friction = 0.40 + 0.05 * static_cast<double>(j);
    s.fig7[j].friction_sd = s.fig8[j].sd = 0.05 * static_cast<double>(j + 1);
    s.fig9[j].friction = 0.2 + 0.1 * static_cast<double>(j);
    s.variance[j] = {0.3 + 0.1 * static_cast<double>(j), {shares(100 + 10 * panel), shares(200 + 10 * panel)}};
    s.fig8[j].losses = {{panel + 0.001, panel + 0.002, 0.003}, {panel + 0.004, panel + 0.005, 0.006}, 16};
    for (std::size_t k = 0; k < 3; ++k) {
      const double run = panel + 0.01 * static_cast<double>(k + 1), p = 0.01 * static_cast<double>(3 * j + k + 1);
      s.fig6[j].runs[k] = {3.35 + 2 * static_cast<double>(k), profile(run), profile(run + 10), {p, p + 0.2}};
      const int first = k < 2 ? 1 : 2, second = k == 0 ? 2 : 3;
      s.fig6[j].pairs[k] = {first, second, {p + 0.4, p + 0.6}};
      s.fig7[j].runs[k] = {0.05 * static_cast<double>(k + 1), profile(run + 20), {}};
      s.fig7[j].runs[k].against_experiment = {{run, run - 0.1, run + 0.2}, 3, 100, p + 0.8};
      s.fig9[j].runs[k] = {0.3 + 0.2 * static_cast<double>(k), profile(run + 30)};
    }
  }
  return s;
}

Studies studies() {
  const std::vector<analysis::Variant> variants = analysis::paper_variants();
  Studies all;
  for (std::size_t v = 0; v < variants.size(); ++v) all.push_back(study(variants[v], 1 + static_cast<double>(v)));
  return all;
}

analysis::PaperExperiments experiments() {
  analysis::PaperExperiments e;
  e.fast_959 = {{6, 6.1, 6.2, 6, 6.1, 6, 6.1, 6, 6, 6.1, 6.2, 6, 6.3, 6.2},
                {6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6.1, 6}};
  e.slow_959 = e.fast_959;
  e.slow_959[0].back() = 5.1;
  e.slow_959[1].back() = 5.2;
  return e;
}

std::vector<analysis::Claim> claims() {
  using enum analysis::ClaimVerdict;
  const analysis::Claim same{"Fig. 1",
                             "one",
                             "0.1",
                             "as printed",
                             {{reproduced, "1a"}, {reproduced, "1b"}, {reproduced, "1c"}, {reproduced, "1s"}},
                             {partly, "1d"}};
  const analysis::Claim by_reading{
      "Fig. 2", "two", "0.2", "in words", {{reproduced, "2a"}, {partly, "2b"}, {partly, "2c"}, {partly, "2s"}}, {}};
  const analysis::Claim by_law{
      "Fig. 3", "three", "0.3", "otherwise", {{partly, "3a"}, {partly, "3b"}, {partly, "3c"}, {not_reproduced, "3s"}},
      {}};
  const analysis::Claim by_both{
      "Fig. 4", "four", "0.4", "twice", {{reproduced, "4a"}, {partly, "4b"}, {not_applicable, "4c"}, {partly, "4s"}},
      {}};
  return {same, by_reading, by_law, by_both};
}

TEST(PaperTables, ClaimsHaveOneVerdictAVariant) {
  const Table table = claims_table(claims(), studies(), experiments(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 4u);
  expect_cell(at(table, 1, "where"), "Fig. 2");
  expect_cell(at(table, 1, "claim"), "two");
  expect_cell(at(table, 1, "paper"), "0.2");
  expect_cell(at(table, 1, "published, goes on"), "reproduced: 2a");
  expect_cell(at(table, 1, "published, rests"), "partly: 2b");
  expect_cell(at(table, 1, "coulomb"), "partly: 2c");
  expect_cell(at(table, 1, "stand-in (simulated)"), "");
  expect_cell(at(table, 0, "stand-in (simulated)"), "partly: 1d");
  const Table readings = readings_table(claims(), {});
  expect_cell(at(readings, 2, "where"), "Fig. 3");
  expect_cell(at(readings, 2, "claim"), "three");
  expect_cell(at(readings, 2, "reading"), "otherwise");
}

TEST(PaperTables, ChangesSayWhatALawOrAReadingChanges) {
  const Table table = changes_table(claims(), studies(), experiments(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 4u + 3u);  // the first claim has one verdict throughout
  // Numbers are those of the contact with sds of 0.1: panel 2, run 2 of Fig. 7, run 2 of Fig. 8, mean friction 0.4.
  const std::size_t speed = row_of(table, "steady speed [rad/s]");
  expect_cell(at(table, speed, "published, goes on"), "21.22 (21.13 to 21.31)");
  expect_cell(at(table, speed, "coulomb"), "23.22 (23.13 to 23.31)");
  const std::size_t rests = row_of(table, "trials that rest within 16 collisions");
  expect_cell(at(table, rests, "published, goes on"), "cannot");
  expect_cell(at(table, rests, "published, rests"), "0.222");
  expect_cell(at(table, rests, "coulomb"), "0.232");
  const std::size_t source = row_of(table, "largest source of the steady speed's variance (total index)");
  expect_cell(at(table, source, "coulomb"), "friction (0.78)");
  const std::size_t losses = row_of(table, "friction's net loss, normal loss [J]");
  expect_cell(at(table, losses, "published, rests"), "2.201, 2.204");
  const std::size_t reading = row_of(table, "Fig. 2: two"), law = row_of(table, "Fig. 3: three");
  expect_cell(at(table, reading, "published, goes on"), "reproduced");
  expect_cell(at(table, reading, "published, rests"), "partly");
  expect_cell(at(table, reading, "coulomb"), "partly");
  expect_cell(at(table, reading, "changes with"), "reading");
  expect_cell(at(table, law, "changes with"), "law");
  expect_cell(at(table, law, "settled"), "not reproduced");
  expect_cell(at(table, row_of(table, "Fig. 4: four"), "changes with"), "reading and law");
  EXPECT_NE(table.notes[0].find("the other 1 of 4"), std::string::npos);
}

TEST(PaperFigures, ClaimsAreAMapOfVerdictsFromTheTop) {
  std::vector<analysis::Claim> all = claims();
  all[0].brief = "Fig. 1: in brief";
  const HeatMap map = *claims_figure(all, studies(), {}).heat_map;
  EXPECT_EQ(map.y_names, (std::vector<std::string>{"Fig. 4", "Fig. 3", "Fig. 2", "Fig. 1: in brief"}));
  ASSERT_EQ(map.x_names.size(), 4u);
  EXPECT_EQ(map.value[3], (std::vector<double>{-1, -1, -1, -1}));
  EXPECT_EQ(map.value[1], (std::vector<double>{-0.5, -0.5, -0.5, 1}));
  EXPECT_TRUE(std::isnan(map.value[0][2]));
}

TEST(PaperTables, HypothesesAndTheirShares) {
  using enum analysis::ClaimVerdict;
  const std::vector<analysis::Hypothesis> hypotheses{
      {"H1", "launch", {{reproduced, "a"}, {partly, "b"}, {not_reproduced, "c"}, {partly, "d"}}}};
  const Table table = hypotheses_table(hypotheses, studies(), {});
  expect_rectangular(table);
  expect_cell(at(table, 0, ""), "H1");
  expect_cell(at(table, 0, "hypothesis"), "launch");
  expect_cell(at(table, 0, "published, goes on"), "yes: a");
  expect_cell(at(table, 0, "published, rests"), "for the steps only: b");
  expect_cell(at(table, 0, "coulomb"), "no: c");
  expect_cell(at(table, 0, "settled"), "for the steps only: d");

  Studies all = studies();
  all[2].variance[3].shares.steps.group.clear();
  const Table variance = variance_table(all, {});
  expect_rectangular(variance);
  ASSERT_EQ(variance.rows.size(), 3u * 2 * 4);  // one law, one set of indices: three laws, two outputs, four frictions
  expect_cell(at(variance, 1, "law"), "published");
  expect_cell(at(variance, 1, "output"), "steady speed [rad/s]");
  expect_cell(at(variance, 1, "mean of μ"), 0.4);
  const analysis::SobolResult& steady_speed = all[1].variance[1].shares.steady_speed;
  expect_cell(at(variance, 1, "mean"), steady_speed.mean);
  expect_cell(at(variance, 1, "sd"), steady_speed.sd);
  expect_cell(at(variance, 1, "launch speed, first"), steady_speed.group[0].first);
  expect_cell(at(variance, 1, "launch speed, total"), steady_speed.group[0].total);
  expect_cell(at(variance, 1, "leg lengths, first"), steady_speed.group[1].first);
  expect_cell(at(variance, 1, "restitution, total"), steady_speed.group[2].total);
  expect_cell(at(variance, 1, "friction, first"), steady_speed.group[3].first);
  expect_cell(at(variance, 1, "friction, total"), steady_speed.group[3].total);
  expect_cell(at(variance, 4, "output"), "steps");
  expect_cell(at(variance, 4, "mean"), all[1].variance[0].shares.steps.mean);
  expect_cell(at(variance, 15, "law"), "coulomb");
  expect_cell(at(variance, 15, "friction, total"), "");  // an output that does not vary
}

TEST(PaperTables, Fig4ComparesTheStarts) {
  const Studies all = studies();
  const Table table = fig4_table(all, experiments(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 5u);
  expect_cell(at(table, 0, "source"), "stand-in (simulated)");
  const analysis::ConditionComparison c =
      analysis::compare_conditions(all[0].fig4.fast.speeds, all[0].fig4.slow.speeds);
  expect_cell(at(table, 1, "source"), "published, goes on");
  const auto mean = [](const analysis::TrialSpeeds& speeds) {
    return mean_interval(analysis::speed_summary(analysis::steady_trial_means(speeds)));
  };
  EXPECT_NEAR(mean(all[0].fig4.fast.speeds).value, 5.8 + 0.01 + 0.0145, 1e-10);
  expect_cell(at(table, 1, "fast, steady"), mean(all[0].fig4.fast.speeds));
  expect_cell(at(table, 1, "slow, steady"), mean(all[0].fig4.slow.speeds));
  const analysis::EffectSize& difference = c.trial_means->welch.difference;
  EXPECT_GT(difference.value, 0);
  expect_cell(at(table, 1, "difference"), Estimate{difference.value, difference.lower, difference.upper});
  EXPECT_NE(c.trial_means->welch.p, c.all_collisions->pooled.p);
  expect_cell(at(table, 1, "P, trial means"), c.trial_means->welch.p);
  expect_cell(at(table, 1, "P, all collisions"), c.all_collisions->pooled.p);
  expect_cell(at(table, 1, "not told apart from collision"), "never");
}

TEST(PaperTables, Fig6AndEqualLegs) {
  Studies all = studies();
  all[0].fig6[3].runs[2].measured_legs.steady.clear();  // hardly a trial gets there
  all[0].fig6[3].runs[2].measured_legs.trial_means.clear();
  const Table table = fig6_table(all, {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 16u);
  expect_cell(at(table, 1, "variant"), "published, goes on");
  expect_cell(at(table, 1, "μ"), 0.45);
  expect_near(at(table, 1, "steady, launch 3.35"), steady(1.21));
  expect_near(at(table, 1, "steady, launch 5.35"), steady(1.22));
  expect_near(at(table, 1, "steady, launch 7.35"), steady(1.23));
  expect_cell(at(table, 1, "sd of a collision"), 1.23 / 20);
  expect_cell(at(table, 1, "P 1-2"), 0.44);
  expect_cell(at(table, 1, "P 1-3"), 0.45);
  expect_cell(at(table, 1, "P 2-3"), 0.46);
  expect_cell(at(table, 1, "P 1-2 by trial"), 0.64);
  expect_cell(at(table, 1, "P 1-3 by trial"), 0.65);
  expect_cell(at(table, 1, "P 2-3 by trial"), 0.66);
  expect_cell(at(table, 1, "trials that rest"), 1.23 / 100);
  expect_cell(at(table, 3, "P 1-2"), 0.5);
  expect_cell(at(table, 3, "steady, launch 7.35"), "");
  expect_cell(at(table, 3, "P 1-3"), "");
  expect_cell(at(table, 3, "P 2-3 by trial"), "");

  const Table legs = equal_legs_table(all, {});
  expect_rectangular(legs);
  ASSERT_EQ(legs.rows.size(), 48u);
  expect_cell(at(legs, 4, "variant"), "published, goes on");
  expect_cell(at(legs, 4, "μ"), 0.45);
  expect_cell(at(legs, 4, "launch"), 5.35);
  expect_near(at(legs, 4, "measured legs"), steady(1.22));
  expect_near(at(legs, 4, "equal legs"), steady(11.22));
  expect_cell(at(legs, 4, "P"), 0.05);
  expect_cell(at(legs, 4, "P by trial"), 0.25);
  expect_cell(at(legs, 11, "P"), "");
}

TEST(PaperTables, Fig7SpreadsOfBoth) {
  Studies all = studies();
  all[1].fig7[2].runs[0].against_experiment.reset();
  const Table table = fig7_table(all, experiments(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 48u);
  const std::size_t row = 12 + 5;  // second variant, second panel, third run
  expect_cell(at(table, row, "variant"), "published, rests");
  expect_cell(at(table, row, "sd of μ"), 0.1);
  expect_cell(at(table, row, "sd of η"), 0.05 * 3);
  expect_near(at(table, row, "steady speed"), steady(22.23));
  expect_cell(at(table, row, "sd of a collision"), 22.23 / 20);
  expect_cell(at(table, row, "trials that rest"), 22.23 / 100);
  expect_near(at(table, row, "stand-in (simulated) less simulated"), {2.23, 2.13, 2.43});
  expect_cell(at(table, row, "P"), 0.86);
  expect_cell(at(table, 12 + 6, "P"), "");
}

TEST(PaperTables, Fig8LossesBesideThePaper) {
  const Table table = fig8_table(studies(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 16u);
  expect_cell(at(table, 4, "variant"), "published, rests");
  expect_cell(at(table, 4, "sd of η and μ"), 0.05);
  expect_near(at(table, 4, "tangential net, mean"), with_error(2.101, 0.003));
  expect_cell(at(table, 4, "tangential net, sd"), 2.1 + 0.002);
  expect_cell(at(table, 4, "paper", 1), "0.05 (0.03)");
  expect_near(at(table, 4, "normal, mean"), with_error(2.104, 0.006));
  expect_cell(at(table, 4, "normal, sd"), 2.1 + 0.005);
  expect_cell(at(table, 4, "paper", 2), "0.17 (0.06)");
  expect_cell(at(table, 5, "paper", 1), "");
  expect_cell(at(table, 7, "paper", 1), "0.11 (0.19)");
  expect_cell(at(table, 7, "paper", 2), "0.17 (0.1)");
}

TEST(PaperTables, Fig9MeansOfBoth) {
  const Table table = fig9_table(studies(), {});
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 48u);
  const std::size_t row = 24 + 3 * 2 + 1;  // third variant, third panel, second run
  expect_cell(at(table, row, "variant"), "coulomb");
  expect_cell(at(table, row, "mean of μ"), 0.4);
  expect_cell(at(table, row, "mean of η"), 0.5);
  expect_cell(at(table, row, "sd at collisions 2-6"), 33.32 / 10);
  expect_cell(at(table, row, "sd at collisions 13-16"), 33.32 / 20);
  expect_near(at(table, row, "steady speed"), steady(33.32));
  expect_cell(at(table, row, "trials that rest"), 33.32 / 100);
}

}  // namespace
}  // namespace metastable::reports::test
