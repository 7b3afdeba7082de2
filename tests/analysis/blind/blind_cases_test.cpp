#include "analysis/blind/blind_cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "analysis/blind/sized_effect.h"
#include "analysis/experiment/experiment.h"
#include "tests/analysis/blind/power_design.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

const dynamics::NominalValues paper{0.54, 0.045, 0.352, 0.043, dynamics::paper_leg_lengths()};

// Gives a power that grows like the square of the distance from neutral.
double square_power(const PowerDesign& design, const std::vector<dynamics::Effect>& effects) {
  const Setting& s = design.conditions.front().setting;
  const dynamics::NominalValues stated = stated_values(s.restitution, s.friction, s.wheel.leg_length);
  double sum = 0;
  for (const dynamics::Effect& effect : effects) {
    // The strength of a patch or a leg sits in one value; where and which it is does not count.
    const std::size_t at = effect.id == "leg_contact" ? 1 : effect.id == "friction_patch" ? 2 : 0;
    const dynamics::Effect neutral = dynamics::effect_from_values(effect.id, {}, stated);
    sum += 4e4 * std::pow(effect.values.at(at) - neutral.values[at], 2);
  }
  return sum;
}

Experiment read(const BlindCase& made) { return parse_experiment(source_of(made.files.files, "case")); }

TEST(BlindCases, PlanHasTheSizeAskedFor) {
  const std::vector<BlindPlan> plan = blind_plan({}, 3);
  EXPECT_EQ(plan.size(), 300U + 23 * 3 * 6 + 22 * 3 + 50 + 50);  // soft_contact is not of `published`
  std::map<BlindKind, int> count;
  std::map<std::string, int> effect, family;
  for (const BlindPlan& p : plan) {
    ++count[p.kind];
    if (p.kind == BlindKind::effect) ++effect[p.effects.front()];
    if (p.kind == BlindKind::outside) ++family[p.outside];
    if (p.kind == BlindKind::pair) {
      EXPECT_NE(p.effects[0], p.effects[1]);
    }
  }
  EXPECT_EQ(count[BlindKind::none], 300);
  for (const auto& [id, n] : effect) EXPECT_EQ(n, 18) << id;
  EXPECT_EQ(effect.size(), 23U);
  EXPECT_GE(family.size(), 4U);
  EXPECT_EQ(blind_plan({}, 3)[17].effects, plan[17].effects);
}

// The contact is no candidate beside which another effect could be named, and slip_reversal has no size to balance.
TEST(BlindCases, PairsAreOfAllEffectsThatHaveASizeAndAreNotTheContact) {
  std::set<std::string> paired;
  const BlindSize both{0, 0, 500, 0, 0, {dynamics::Law::published, dynamics::Law::settled}};
  for (const BlindPlan& p : blind_plan(both, 8)) paired.insert(p.effects.begin(), p.effects.end());
  std::set<std::string> expected;
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) expected.insert(info.id);
  EXPECT_EQ(expected.erase("contact_distribution") + expected.erase("slip_reversal"), 2U);
  EXPECT_EQ(paired, expected);
}

TEST(BlindCases, LawsTakeTurnsWhereBothHaveTheEffect) {
  using dynamics::Law;
  std::map<BlindKind, std::map<Law, int>> count;
  const BlindSize both{2, 10, 0, 18, 0, {Law::published, Law::settled}};
  for (const BlindPlan& p : blind_plan(both, 5)) {
    ++count[p.kind][p.law];
    for (const std::string& id : p.effects) EXPECT_TRUE(can_be_had(id, p.law)) << id;
  }
  EXPECT_EQ(count[BlindKind::none][Law::settled], 5);
  // The catalogue has 24 effects. Four exist under `published` only, one under `settled` only.
  EXPECT_EQ(count[BlindKind::effect][Law::settled], 19 * 6 / 2 + 6);
  EXPECT_EQ(count[BlindKind::outside][Law::settled], 8);
  EXPECT_EQ(blind_plan({1, 0, 0, 18, 0, {Law::settled}}, 5).size(), 20U * 3 + 16);
  EXPECT_THROW(blind_plan({.laws = {Law::coulomb}}, 1), std::invalid_argument);
}

// Effects of which no law has both, or which no law has beside the outside effect, would be cases less than asked for.
TEST(BlindCases, EffectsDrawnTogetherAreHadByOneLaw) {
  using dynamics::Law;
  const BlindSize size{0, 0, 200, 0, 0, {Law::published, Law::settled}, 100, 100};
  const std::vector<BlindPlan> plan = blind_plan(size, 6);
  EXPECT_EQ(plan.size(), 400U);
  for (const BlindPlan& p : plan)
    for (const std::string& id : p.effects) EXPECT_TRUE(can_be_had(id, p.law)) << id;
  const BlindSize rigid{0, 0, 40, 0, 0, {Law::settled}, 0, 40};
  EXPECT_EQ(blind_plan(rigid, 6).size(), 80U);
}

// The folder of a case of the second laboratory states the law that its wheel obeys.
TEST(BlindCases, ARigidBodysCaseIsReadUnderItsLaw) {
  const BlindCase made =
      blind_case({BlindKind::effect, {"friction_patch"}, 2, dynamics::Law::settled}, 4, 9, square_power);
  EXPECT_EQ(made.truth.law, dynamics::Law::settled);
  const Experiment experiment = read(made);
  EXPECT_EQ(experiment.contact.law, dynamics::Law::settled);
  EXPECT_GE(experiment.trials.size(), 50U);
  EXPECT_GT(experiment.collisions(), 4 * experiment.trials.size());
}

TEST(BlindCases, APlanOfFewerThanNoCasesIsRefused) {
  EXPECT_EQ(message_of([&] { blind_plan({.pairs = -1}, 1); }), "pairs: -1 is below 0");
}

// An effect that cannot be drawn would be counted as one that nobody finds.
TEST(SizedEffect, EveryEffectOfTheCatalogueHasASize) {
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) {
    BlindDice dice(4, 1);
    const SizedEffect effect = sized_effect(info.id, paper, dice);
    EXPECT_EQ(effect.at(effect.largest).id, info.id);  // and is in the catalogue's range
    if (info.id == "slip_reversal") continue;          // there or not
    EXPECT_GT(effect.start, 0) << info.id;
    EXPECT_LE(effect.start, effect.largest) << info.id;
    EXPECT_NE(effect.at(effect.start).values, effect.at(0).values) << info.id;
    EXPECT_NE(effect.at(effect.largest).values, effect.at(effect.start).values) << info.id;
    const auto columns = droppable();
    for (const std::string& name : effect.needs)
      EXPECT_NE(std::find(columns.begin(), columns.end(), name), columns.end()) << info.id << ' ' << name;
  }
  BlindDice dice(4, 1);
  EXPECT_THROW(sized_effect("sloshing_fluid", paper, dice), std::logic_error);
}

TEST(BlindCases, SizesReachThePowerAskedFor) {
  int number = 1;
  for (const char* id : {"inertia", "slope_offset", "leg_contact", "trial_drift", "contact_memory", "bounce",
                         "speed_dependent_restitution", "friction_patch"}) {
    const int strength = 1 + number % 2;
    const BlindCase made = blind_case({BlindKind::effect, {id}, strength}, 2 * number - 2 + strength, 5, square_power);
    EXPECT_NEAR(made.truth.power / (16 * strength * strength), 1, 0.11) << id << ' ' << strength;
    EXPECT_EQ(made.truth.effects.front().id, id);
    ++number;
  }
}

TEST(BlindCases, FoldersAreReadAndTheSameSeedGivesTheSameBytes) {
  std::set<std::string> headers;
  std::set<std::size_t> conditions;
  bool exact = false, unlike = false, skewed = false;
  for (int number = 1; number <= 12; ++number) {
    const BlindCase made = blind_case({BlindKind::none, {}, 0}, number, 9, square_power);
    const std::string& rows = made.files.files.collisions_csv;
    const Experiment e = read(made);
    EXPECT_GE(e.trials.size(), 50U);
    EXPECT_LE(e.trials.size(), 150U);
    conditions.insert(e.conditions.size());
    headers.insert(rows.substr(0, rows.find('\n')));
    (made.truth.nominal_is_true ? exact : unlike) = true;
    skewed |= made.truth.skewness != 0;
    if (made.truth.nominal_is_true) {
      EXPECT_EQ(e.contact.friction.mean, made.truth.friction.mean);
    }
    if (number == 4) {
      const BlindCase again = blind_case({BlindKind::none, {}, 0}, 4, 9, square_power);
      EXPECT_EQ(again.files.files.collisions_csv, rows);
    }
  }
  EXPECT_GT(headers.size(), 1U);
  EXPECT_GT(conditions.size(), 1U);
  EXPECT_TRUE(exact && unlike && skewed);
}

TEST(BlindCases, LeftOutEffectsAreNotInTheCatalogueGiven) {
  const BlindCase made = blind_case({BlindKind::left_out, {"inertia"}, 2}, 1, 9, square_power);
  EXPECT_EQ(made.catalogue.size(), 23U);
  for (const std::string& id : made.catalogue) EXPECT_NE(id, "inertia");
  EXPECT_EQ(made.truth.left_out, std::vector<std::string>{"inertia"});
  const BlindCase outside =
      blind_case({BlindKind::outside, {}, 2, dynamics::Law::published, "planks"}, 2, 9, square_power);
  ASSERT_TRUE(outside.truth.outside);
  EXPECT_GT(outside.truth.outside->size, 0);
  EXPECT_THROW(blind_kind("some"), std::invalid_argument);
}

// The laboratory and the likelihood of the diagnosis, which share no formula, agree on the same effects.
TEST(EffectPower, GrowsLikeTheSquareOfTheSize) {
  PowerDesign design = steep_ramp(60);
  design.laboratory.sensor_noise = 0.01;
  const auto power = [&](const std::string& text) {
    return expected_power(design, {dynamics::effect_from_text(text, paper)}, 4);
  };
  EXPECT_NEAR(power("leg_contact:leg=2,friction_ratio=1"), 0, 1e-9);
  for (const auto& [one, two] : {std::pair<std::string, std::string>{"leg_contact:leg=2,friction_ratio=1.06",
                                                                     "leg_contact:leg=2,friction_ratio=1.12"},
                                 {"slope_offset:offset_deg=0.02", "slope_offset:offset_deg=0.04"},
                                 {"trial_drift:relative_change=0.06", "trial_drift:relative_change=0.12"}}) {
    const double small = power(one), large = power(two);
    EXPECT_GT(small, 4) << one;
    EXPECT_NEAR(large / small, 4, 1.6) << one;
  }
}

// An effect that the contact's means imitate leaves nothing once they are refitted.
TEST(EffectPower, RecalibrationAbsorbsAShiftOfTheContact) {
  BlindCase made = blind_case({BlindKind::effect, {"contact_distribution"}, 4}, 3, 21,
                              [](const PowerDesign& design, const std::vector<dynamics::Effect>& effects) {
                                return expected_power(design, effects, 1);
                              });
  EXPECT_GT(made.truth.power, 150);
  EXPECT_EQ(made.truth.left, 0);
  complete_truth(made);
  EXPECT_NE(made.truth.left, 0);
  EXPECT_LT(made.truth.left, 16);
}

// Beside its other effect in the model, each effect of a pair leaves what refitting cannot take up.
TEST(EffectPower, OfAPairEachEffectIsWeighedBesideTheOther) {
  BlindCase made = blind_case({BlindKind::pair, {"leg_contact", "contact_memory"}, 2}, 2, 21,
                              [](const PowerDesign& design, const std::vector<dynamics::Effect>& effects) {
                                return expected_power(design, effects, 1);
                              });
  complete_truth(made);
  complete_each(made.truth, read(made));
  ASSERT_EQ(made.truth.left_by_effect.size(), 2U);
  for (const double left : made.truth.left_by_effect) {
    EXPECT_GT(left, 16);
    EXPECT_LT(left, made.truth.left);
  }
  // The stated contact is another one here or the same: what recalibration takes up comes on top.
  ASSERT_TRUE(made.truth.gap_as_given);
  ASSERT_EQ(made.truth.gap_as_given->alone.size(), 2U);
  EXPECT_GT(made.truth.gap_as_given->all, 0.9 * made.truth.left);
  for (const double alone : made.truth.gap_as_given->alone) {
    EXPECT_GT(alone, 16);
    EXPECT_LT(alone, made.truth.gap_as_given->all);
  }
  BlindTruth none;
  complete_each(none, read(made));
  EXPECT_FALSE(none.gap_as_given);
  EXPECT_TRUE(none.left_by_effect.empty());
}

// Under settled a large effect stops every trial at once and leaves nothing to see: a search that took power for
// monotone ended there.
TEST(BlindCases, AnOutsideEffectHasThePowerAskedForBeforeItStopsTheWheel) {
  for (const double usual : {0.002, 0.02, 0.1}) {  // size of a power of 16
    const BlindCase made = blind_case({BlindKind::outside, {}, 2, dynamics::Law::published, "two_crews"}, 1, 5,
                                      [usual](const PowerDesign& design, const std::vector<dynamics::Effect>&) {
                                        const double times = design.laboratory.outside.front().size / usual;
                                        return times < 2.4 ? 16 * times * times : 0.0;
                                      });
    if (usual < 0.05) {
      EXPECT_NEAR(made.truth.power / 64, 1, 0.1) << usual;
    } else {
      EXPECT_DOUBLE_EQ(made.truth.outside->size, 0.075);  // the end of its range
    }
  }
}

TEST(EffectPower, NeedsAReplicate) { EXPECT_THROW(expected_power({}, {}, 0), std::invalid_argument); }

}  // namespace
}  // namespace metastable::analysis::test
