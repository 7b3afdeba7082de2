#include "dynamics/laboratory/walker_laboratory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/walkers/uneven_walker.h"
#include "tests/message_of.h"

namespace metastable::dynamics::test {
namespace {

WalkerLaboratorySetup small(std::size_t trials = 20, std::size_t longest = 12) {
  WalkerLaboratorySetup setup;
  setup.slope_sd_deg = 0.3;
  setup.trials = trials;
  setup.longest = longest;
  return setup;
}

std::vector<WalkedTrial> walked(const WalkerLaboratorySetup& setup) {
  const WalkerLaboratory laboratory(setup);
  std::vector<WalkedTrial> all;
  for (std::size_t t = 0; t < setup.trials; ++t) all.push_back(laboratory.run(t));
  return all;
}

// Returns the slope [deg] at which the model takes a row to the next one's half angle: by secants.
double slope_between(const WalkedRow& from, const WalkedRow& to) {
  const auto off = [&](double degrees) {
    const UnevenWalker model;
    const std::vector<double> state{from.truth.half_angle, from.truth.stance_rate, from.truth.swing_rate};
    const double slope = degrees * M_PI / 180;
    std::vector<double> next(3);
    std::uint8_t fell = 0;
    step_uneven({&model, 1}, state, {&slope, 1}, next, {&fell, 1});
    return next[1] - to.truth.stance_rate;
  };
  double a = 2.9, b = 3.1, at_a = off(a), at_b = off(b);
  for (int i = 0; i < 30 && std::abs(at_b) > 1e-12 && at_a != at_b; ++i) {
    const double next = b - at_b * (b - a) / (at_b - at_a);
    a = b, at_a = at_b, b = next, at_b = off(b);
  }
  return b;
}

// Every step's slope, as the model sees it, with where it was met.
struct Met {
  double slope;
  WalkedRow row;
  std::size_t trial;
};
std::vector<Met> slopes_of(const WalkerLaboratorySetup& setup) {
  std::vector<Met> all;
  const std::vector<WalkedTrial> trials = walked(setup);
  for (std::size_t t = 0; t < trials.size(); ++t)
    for (std::size_t k = 0; k + 1 < trials[t].rows.size(); ++k)
      all.push_back({slope_between(trials[t].rows[k], trials[t].rows[k + 1]), trials[t].rows[k], t});
  return all;
}

TEST(WalkerLaboratory, WithoutEffectsWalksAsTheModelOnNormalSlopes) {
  const std::vector<Met> met = slopes_of(small(60));
  double sum = 0, squares = 0;
  for (const Met& m : met) sum += m.slope, squares += (m.slope - 3) * (m.slope - 3);
  const auto n = static_cast<double>(met.size());
  EXPECT_NEAR(sum / n, 3, 4 * 0.3 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.3, 4 * 0.3 / std::sqrt(2 * n));
}

TEST(WalkerLaboratory, SlopesShowTheEffectsOfTheGround) {
  const std::vector<Met> plain = slopes_of(small());
  const auto differences = [&](const char* effect, const auto& expected) {
    WalkerLaboratorySetup setup = small();
    setup.effects = {effect_from_text(effect, {}, walker_effect_info)};
    const std::vector<Met> with = slopes_of(setup);
    // The same scores: as long as no trial falls, steps correspond one by one.
    ASSERT_EQ(with.size(), plain.size()) << effect;
    for (std::size_t i = 0; i < with.size(); ++i)
      EXPECT_NEAR(with[i].slope - plain[i].slope, expected(with[i]), 1e-6) << effect << " " << i;
  };
  differences("slope_deg_offset:offset_deg=0.2", [](const Met&) { return 0.2; });
  differences("slope_deg_by_phase:change_in_1=0.2", [](const Met& m) { return m.row.leg == 1 ? 0.2 : 0; });
  differences("slope_deg_drift:change_over_the_runs=0.4",
              [](const Met& m) { return 0.4 * (static_cast<double>(m.trial) / 19 - 0.5); });
  differences("slope_deg_clock:amplitude=0.2,frequency_hz=0.03",
              [](const Met& m) { return 0.2 * std::cos(2 * M_PI * 0.03 * m.row.time); });
  differences("slope_deg_stretch:change=0.3,from_m=1,to_m=3",
              [](const Met& m) { return m.row.position >= 1 && m.row.position < 3 ? 0.3 : 0; });
}

TEST(WalkerLaboratory, SpreadMemoryAndOutliersShowInTheStatisticsOfSlopes) {
  const auto with = [](const char* effect) {
    WalkerLaboratorySetup setup = small(150, 10);
    setup.slope_sd_deg = 0.15;
    setup.effects = {effect_from_text(effect, {}, walker_effect_info)};
    return slopes_of(setup);
  };
  double between = 0, sum = 0;
  std::size_t n = 0, trials = 0, last = 1000;
  for (const Met& m : with("slope_deg_spread:sd_between_trials=0.3")) {
    if (m.trial != last && last != 1000) between += (sum / n - 3) * (sum / n - 3), ++trials, sum = 0, n = 0;
    last = m.trial, sum += m.slope, ++n;
  }
  EXPECT_NEAR(std::sqrt(between / trials), std::hypot(0.3, 0.05), 0.08);
  double product = 0, square = 0;
  const std::vector<Met> memory = with("memory:correlation=0.6");
  for (std::size_t i = 1; i < memory.size(); ++i)
    if (memory[i].trial == memory[i - 1].trial)
      product += (memory[i].slope - 3) * (memory[i - 1].slope - 3), square += std::pow(memory[i].slope - 3, 2);
  EXPECT_NEAR(product / square, 0.6, 0.08);
  std::size_t wide = 0;
  const std::vector<Met> outliers = with("outliers:share=0.1");
  for (const Met& m : outliers) wide += std::abs(m.slope - 3) > 4 * 0.15;
  // A spread four times as wide is beyond four sds in 32 % of its draws.
  EXPECT_NEAR(static_cast<double>(wide) / static_cast<double>(outliers.size()), 0.032, 0.015);
}

TEST(WalkerLaboratory, SensorsHaveTheirErrors) {
  WalkerLaboratorySetup setup = small(40);
  setup.effects = {effect_from_text("sensor_noise_stance_rate_rad_s:sd=0.012", {}, walker_effect_info),
                   effect_from_text("sensor_bias_half_angle_rad:bias=0.004", {}, walker_effect_info)};
  double angle = 0, squares = 0, n = 0;
  for (const WalkedTrial& trial : walked(setup))
    for (const WalkedRow& row : trial.rows) {
      angle += row.seen.half_angle - row.truth.half_angle;
      squares += std::pow(row.seen.stance_rate - row.truth.stance_rate, 2);
      ++n;
    }
  EXPECT_NEAR(angle / n, 0.004, 4 * 0.0005 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.013, 4 * 0.013 / std::sqrt(2 * n));
}

TEST(WalkerLaboratory, LegsTakeTurnsAndPositionsAddUp) {
  for (const WalkedTrial& trial : walked(small(4)))
    for (std::size_t k = 1; k < trial.rows.size(); ++k) {
      EXPECT_EQ(trial.rows[k].leg, 3 - trial.rows[k - 1].leg);
      EXPECT_NEAR(trial.rows[k].position - trial.rows[k - 1].position, 2 * std::sin(trial.rows[k].truth.half_angle),
                  1e-9);
      EXPECT_GT(trial.rows[k].time, trial.rows[k - 1].time + 0.4);
    }
}

TEST(WalkerLaboratory, OutsideEffectsAreInNoCatalogueAndMoveTheWalk) {
  const std::vector<WalkedTrial> plain = walked(small(1));
  std::set<std::string> ids;
  for (const OutsideInfo& info : walker_outside_effects()) {
    EXPECT_TRUE(ids.insert(info.id).second);
    EXPECT_NE(message_of([&] { any_effect_info(info.id); }).find("is none of"), std::string::npos);
    WalkerLaboratorySetup setup = small(1);
    setup.outside = {{info.id, 0.2 * info.upper}};
    const std::vector<WalkedTrial> moved = walked(setup);
    ASSERT_GT(moved[0].rows.size(), 3u) << info.id;
    const RodStride &with = moved[0].rows[3].truth, &without = plain[0].rows[3].truth;
    EXPECT_GT(std::hypot(with.stance_rate - without.stance_rate, with.swing_rate - without.swing_rate), 1e-3)
        << info.id;
  }
  EXPECT_GE(ids.size(), 4u);
}

TEST(WalkerLaboratory, WalksOnLooseKneesOfAnySize) {
  for (const double share : {0.01, 0.1, 1.0}) {
    WalkerLaboratorySetup setup = small(30);
    setup.slope_sd_deg = 0.4;
    setup.outside = {{"loose_knee", share * walker_outside_info("loose_knee").upper}};
    std::size_t steps = 0, fell = 0;
    for (const WalkedTrial& trial : walked(setup)) steps += trial.rows.size() - 1, fell += trial.fell;
    EXPECT_GT(steps, 200u) << share;
    EXPECT_LT(fell, 15u) << share;
  }
}

TEST(WalkerLaboratory, LooseKneesAreNotKnownWithRoundFeet) {
  WalkerLaboratorySetup setup = small();
  setup.outside = {{"loose_knee", 0.001}, {"round_feet", 0.1}};
  EXPECT_EQ(message_of([&] { WalkerLaboratory{setup}; }), "effect loose_knee: it is not known with round_feet");
}

TEST(WalkerLaboratory, EveryEffectOfTheCatalogueActs) {
  for (const EffectInfo& info : walker_effects()) {
    WalkerLaboratorySetup setup = small(1);
    Effect effect = effect_from_values(info, {}, {});
    effect.values[0] += 0.1 * info.parameters[0].upper;
    setup.effects = {effect};
    EXPECT_NO_THROW(walked(setup)) << info.id;
  }
}

TEST(WalkerLaboratory, RefusesWhatItDoesNotHave) {
  const auto refused = [](auto change) {
    WalkerLaboratorySetup setup = small();
    change(setup);
    return message_of([&] { WalkerLaboratory{setup}; });
  };
  EXPECT_EQ(refused([](auto& s) { s.slope_deg = 50; }), "laboratory: slope: 50 is outside (0, 45) deg");
  EXPECT_EQ(refused([](auto& s) {
              s.effects = {{"hip_damping", {9}}};
            }),
            "effect hip_damping: damping: 9 N m s/rad is outside [0, 5]");
  EXPECT_NE(refused([](auto& s) {
              s.effects = {{"leg_contact", {1}}};
            }).find("is none of hip_damping"),
            std::string::npos);
  EXPECT_EQ(refused([](auto& s) {
              s.effects = {{"outliers", {0.1}}, {"outliers", {0.1}}};
            }),
            "effect outliers: given twice");
  EXPECT_EQ(refused([](auto& s) { s.outside = {{"round_feet", 3}}; }), "effect round_feet: size 3 is outside [0, 0.2]");
  EXPECT_NE(refused([](auto& s) { s.outside = {{"planks", 0.1}}; }).find("is none of round_feet"), std::string::npos);
}

}  // namespace
}  // namespace metastable::dynamics::test
