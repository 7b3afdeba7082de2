#include "analysis/blind/walker_cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/blind/sized_walker_effect.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/walker_model/walker_experiment.h"
#include "dynamics/catalogue/walker_effects.h"

namespace metastable::analysis::test {
namespace {

constexpr Spread slope{3, 0.35};

Walks laboratory_walks_with(const std::vector<dynamics::Effect>& effects, std::size_t trials,
                            std::size_t longest = 10) {
  WalkStatement statement{"walks", {}, {}};
  statement.walker.setting = {Walker::compass, slope.mean, slope.sd, dynamics::Terrain::fresh};
  WalkerReality reality;
  reality.effects = effects;
  reality.launch_spread = 0.02;
  WalkOptions options;
  options.trials = trials;
  options.longest = longest;
  options.seed = 7;
  options.threads = 1;
  const dynamics::WalkerLaboratory laboratory = walker_laboratory(statement.walker.setting, reality, options);
  return *parse_walks(source_of(laboratory_walks(laboratory, run_walks(laboratory, options), statement, {}), "walks"));
}

// Sizes that twenty trials show well.
std::vector<dynamics::Effect> visible_effects() {
  std::vector<dynamics::Effect> all;
  for (const dynamics::EffectInfo& info : dynamics::walker_effects()) {
    if (is_recalibration(info.id)) continue;
    BlindDice dice(3, 1);
    const SizedEffect sized = sized_walker_effect(info.id, dice);
    all.push_back(sized.at(std::min(8 * sized.start, sized.largest)));
  }
  return all;
}

// An effect of the catalogue stands in four places; each line says where one that is forgotten is to be added.
TEST(WalkerAgreement, EveryEffectOfTheCatalogueHasItsPlaces) {
  const Walks walks = laboratory_walks_with({}, 6);
  const auto model = machine_transitions(walks.machine, walks.runs);
  for (const dynamics::EffectInfo& info : dynamics::walker_effects()) {
    const dynamics::Effect neutral = dynamics::effect_from_values(info, {}, {});
    dynamics::WalkerLaboratorySetup setup;
    setup.effects = {neutral};
    EXPECT_NO_THROW(dynamics::WalkerLaboratory{setup}) << info.id << ": dynamics/laboratory/walker_laboratory.cpp";
    BlindDice dice(1, 1);
    EXPECT_NO_THROW(sized_walker_effect(info.id, dice)) << info.id << ": analysis/blind/sized_walker_effect.cpp";
    EXPECT_FALSE(rightful_walker_places(info.id).empty()) << info.id << ": analysis/blind/sized_walker_effect.cpp";
    if (is_recalibration(info.id)) continue;
    EXPECT_NO_THROW(fitted_term(*model, neutral)) << info.id << ": analysis/walker_model/walker_machine.cpp";
  }
  EXPECT_TRUE(rightful_walker_places("round_feet").empty());
}

// A candidate makes a fitted form of each effect, and reports that form as the same effect.
TEST(WalkerAgreement, FormsAreTheInverseOfReports) {
  const Walks walks = laboratory_walks_with({}, 6);
  const auto model = machine_transitions(walks.machine, walks.runs);
  for (const dynamics::Effect& effect : visible_effects()) {
    const EffectTerm term = fitted_term(*model, effect);
    const std::vector<NamedValue> reported = term.candidate->report(term.variant, term.values);
    const dynamics::EffectInfo& info = dynamics::walker_effect_info(effect.id);
    ASSERT_EQ(reported.size(), info.parameters.size()) << effect.id;
    for (std::size_t p = 0; p < reported.size(); ++p) {
      EXPECT_EQ(reported[p].first, info.parameters[p].name) << effect.id;
      EXPECT_NEAR(reported[p].second, effect.values[p], 1e-12) << effect.id;
    }
  }
}

// A few walks show what changes every step, and the first steps show a launch. What is rare or small needs many.
Walks walks_that_show(const dynamics::Effect& effect) {
  if (effect.id.starts_with("launch")) return laboratory_walks_with({effect}, 48, 3);
  const bool clear =
      effect.id.starts_with("hip") || effect.id.starts_with("leg") || effect.id.starts_with("sensor_noise");
  return laboratory_walks_with({effect}, effect.id == "outliers" ? 48 : clear ? 8 : 24);
}

// The laboratory's walks are likeliest under the model with the effect that is in them: more than without it and more
// than at a third or three times its size.
TEST(WalkerAgreement, EveryEffectIsFoundAtItsSize) {
  for (const dynamics::Effect& effect : visible_effects()) {
    const Walks walks = walks_that_show(effect);
    const auto model = machine_transitions(walks.machine, walks.runs);
    const EffectTerm term = fitted_term(*model, effect);
    const auto likelihood = [&](double size) {
      EffectTerm scaled = term;
      for (std::size_t v = 0; v < scaled.values.size(); ++v) {
        const double neutral = term.candidate->parameters[v].neutral;
        scaled.values[v] = std::clamp(neutral + size * (term.values[v] - neutral), term.candidate->parameters[v].lower,
                                      term.candidate->parameters[v].upper);
      }
      return model->evaluate(nominal_values(*model), {&scaled, 1}).total();
    };
    const double true_size = likelihood(1);
    EXPECT_GT(true_size, likelihood(0) + 4) << dynamics::effect_text(effect);
    EXPECT_GT(true_size, likelihood(0.33)) << dynamics::effect_text(effect);
    EXPECT_GT(true_size, likelihood(3)) << dynamics::effect_text(effect);
  }
}

TEST(WalkerCases, PlansHaveTheWalkersEffects) {
  BlindSize size{1, 4, 5, 10, 1};
  size.walkers = true;
  size.mixed = 3;
  size.many = 2;
  const std::vector<BlindPlan> plan = blind_plan(size, 3);
  const int effects = static_cast<int>(dynamics::walker_effects().size());
  std::map<BlindKind, int> count;
  for (const BlindPlan& one : plan) {
    EXPECT_TRUE(one.walker);
    ++count[one.kind];
    for (const std::string& id : one.effects) EXPECT_NO_THROW(dynamics::walker_effect_info(id));
    if (!one.outside.empty()) {
      EXPECT_NO_THROW(dynamics::walker_outside_info(one.outside));
    }
    for (const std::string& id : one.effects) EXPECT_TRUE(one.kind == BlindKind::effect || !is_recalibration(id));
  }
  EXPECT_EQ(count[BlindKind::none], 4);
  EXPECT_EQ(count[BlindKind::effect], 3 * effects);
  EXPECT_EQ(count[BlindKind::left_out], effects - 1);
  EXPECT_EQ(count[BlindKind::outside], 10);
  EXPECT_EQ(count[BlindKind::mixed], 3);
  EXPECT_EQ(count[BlindKind::many], 2);
}

TEST(WalkerCases, SizesReachThePowerAskedForAndTheSameSeedGivesTheSameBytes) {
  const BlindPlan plan{BlindKind::effect, {"hip_damping"}, 2, {}, {}, true};
  BlindCase made = walker_case(plan, 3, 21);
  EXPECT_NEAR(made.truth.power, 64, 32);
  EXPECT_EQ(made.truth.effects.front().id, "hip_damping");
  const Walks walks = *parse_walks(source_of(*made.walks, "case"));
  EXPECT_GE(walks.runs.trials.size(), 25u);
  EXPECT_EQ(made.walks->experiment_toml.find("damping"), std::string::npos);
  complete_walker_truth(made);
  EXPECT_GT(made.truth.left, 9);
  EXPECT_EQ(walker_case(plan, 3, 21).walks->steps_csv, made.walks->steps_csv);
}

TEST(WalkerCases, AnOutsideEffectHasThePowerAskedFor) {
  const BlindPlan plan{BlindKind::outside, {}, 2, {}, "swinging_load", true};
  const BlindCase made = walker_case(plan, 4, 21);
  ASSERT_TRUE(made.truth.outside);
  EXPECT_EQ(made.truth.outside->id, "swinging_load");
  EXPECT_NEAR(made.truth.power, 64, 40);  // sized on a share of the trials
  EXPECT_EQ(made.truth.left, made.truth.power);
}

// A loss at the strike takes the place of a slow motor.
TEST(WalkerCases, WhatIsLeftOfAnOutsideEffectBesideOthersIsWeighed) {
  const BlindPlan plan{BlindKind::mixed, {"impact_loss"}, 2, {}, "slow_motor", true};
  const BlindCase made = walker_case(plan, 4, 21);
  ASSERT_TRUE(made.truth.left_of_outside);
  EXPECT_GT(made.truth.power, 64 + 16);        // That of the loss is sized to 64.
  EXPECT_LT(*made.truth.left_of_outside, 20);  // It is 8; alone the motor has 49.
}

}  // namespace
}  // namespace metastable::analysis::test
