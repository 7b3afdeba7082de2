#include "analysis/blind/outside_power.h"

#include <gtest/gtest.h>

#include <stdexcept>

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

// Every other trial's friction is nobody's mean; that of the last of two conditions is half in the means.
TEST(OutsidePower, RecalibrationTakesWhatMeansHold) {
  const auto left = [](const dynamics::OutsideEffect& effect) {
    PowerDesign design = two_ramps();
    design.laboratory.outside = {effect};
    design.laboratory.seed = 4;
    const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, design.laboratory);
    const Experiment made = experiment_of(design.conditions, setup, run_laboratory(setup, 1), {});
    const Setting& stated = design.conditions[0].setting;
    const dynamics::NominalValues contact = stated_values(stated.restitution, stated.friction, stated.wheel.leg_length);
    return outside_power_left(made, contact, effect) / outside_power(made, contact, effect);
  };
  EXPECT_GT(left({"two_crews", 0.06}), 0.8);
  EXPECT_LT(left({"wet_day", 0.1}), 0.7);
}

}  // namespace
}  // namespace metastable::analysis::test
