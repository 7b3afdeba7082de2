#include "analysis/blind/outside_power.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "tests/analysis/blind/power_design.h"

namespace metastable::analysis::test {
namespace {

PowerDesign two_ramps() {
  PowerDesign design = steep_ramp(40);
  design.conditions.push_back(design.conditions[0]);
  design.conditions[1].id = "flat";
  design.conditions[1].setting.slope_deg = 8.5;
  return design;
}

double power_of(const dynamics::OutsideEffect& effect) {
  PowerDesign design = two_ramps();
  design.laboratory.outside = {effect};
  return expected_power(design, {}, 2);
}

// A wheel whose contacts are changed is likelier where the change is known: had either a sign or a place wrong, it
// would be less likely than without.
TEST(OutsidePower, WhoKnowsTheEffectSeesIt) {
  int weighed = 0;
  for (const dynamics::OutsideInfo& info : dynamics::outside_effects()) {
    if (!can_be_weighed(info.id)) continue;
    ++weighed;
    EXPECT_NEAR(power_of({info.id, 0}), 0, 1e-6) << info.id;
    const double half = power_of({info.id, 0.15 * info.upper}), whole = power_of({info.id, 0.3 * info.upper});
    EXPECT_GT(whole, 5) << info.id;
    EXPECT_GT(whole, 1.8 * half) << info.id;
  }
  EXPECT_EQ(weighed, 15);
}

TEST(OutsidePower, WhatActsThroughThePastHasNoLikelihood) {
  for (const char* id : {"sloshing_fluid", "stored_energy", "second_memory"}) {
    EXPECT_FALSE(can_be_weighed(id));
    EXPECT_THROW(power_of({id, 0.1}), std::invalid_argument);
  }
}

// Returns what is left of an outside effect's power: of that in the same experiment, or, where these of the catalogue
// act, too, of what it has without them.
double left_of(const dynamics::OutsideEffect& effect, const std::vector<dynamics::Effect>& beside = {}) {
  PowerDesign design = two_ramps();
  design.laboratory.outside = {effect};
  design.laboratory.effects = beside;
  design.laboratory.seed = 4;
  const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, design.laboratory);
  const Experiment made = experiment_of(design.conditions, setup, run_laboratory(setup, 1), {});
  const Setting& stated = design.conditions[0].setting;
  const dynamics::NominalValues contact = stated_values(stated.restitution, stated.friction, stated.wheel.leg_length);
  return outside_power_left(made, contact, effect, beside) /
         (beside.empty() ? outside_power(made, contact, effect) : power_of(effect));
}

// Every other trial's friction is nobody's mean; that of the last of two conditions is half in the means.
TEST(OutsidePower, RecalibrationTakesWhatMeansHold) {
  EXPECT_GT(left_of({"two_crews", 0.06}), 0.8);
  EXPECT_LT(left_of({"wet_day", 0.1}), 0.7);
}

// A leg that wears shows beside another leg of more friction. A friction that rises and falls over the trials is half a
// drift.
TEST(OutsidePower, EffectsOfTheCatalogueTakeWhatTheyImitate) {
  EXPECT_GT(left_of({"wearing_leg", 0.2}, {{"leg_contact", {5, 1.3, 1}}}), 0.5);
  EXPECT_LT(left_of({"daily_cycle", 0.06}, {{"trial_drift", {0.3}}}), 0.6);
}

}  // namespace
}  // namespace metastable::analysis::test
