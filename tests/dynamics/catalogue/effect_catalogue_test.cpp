#include "dynamics/catalogue/effect_catalogue.h"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>

#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/wheel/wheel.h"
#include "tests/message_of.h"

namespace metastable::dynamics::test {
namespace {

const NominalValues nominal{0.4, 0.1, 0.3, 0.05, paper_leg_lengths()};

std::string message(const std::string& text) {
  return message_of([&text] { effect_from_text(text, nominal); });
}

TEST(EffectCatalogue, HoldsTwentyFourEffectsWithNeutralValuesInRange) {
  std::set<std::string> ids;
  for (const EffectInfo& info : effect_catalogue()) {
    ids.insert(info.id);
    const Effect neutral = effect_from_values(info.id, {}, nominal);
    std::size_t size = 0;
    for (const EffectParameter& p : info.parameters) {
      size += p.per_leg ? 8 : 1;
      EXPECT_LT(p.lower, p.upper) << info.id;
      EXPECT_FALSE(p.meaning.empty()) << info.id;
    }
    EXPECT_EQ(neutral.values.size(), size) << info.id;
    // They go to text and back.
    EXPECT_EQ(effect_from_text(effect_text(neutral), nominal).values, neutral.values) << effect_text(neutral);
  }
  EXPECT_EQ(ids.size(), 24U);
}

TEST(EffectCatalogue, WalkersEffectsHaveIdsOfTheirOwnAndNeutralValuesInRange) {
  std::set<std::string> ids;
  for (const EffectInfo& info : effect_catalogue()) ids.insert(info.id);
  for (const EffectInfo& info : walker_effects()) {
    EXPECT_TRUE(ids.insert(info.id).second) << info.id;
    const Effect neutral = effect_from_values(info, {}, {});
    EXPECT_EQ(neutral.values.size(), info.parameters.size()) << info.id;
    EXPECT_EQ(effect_from_text(effect_text(neutral), {}, walker_effect_info).values, neutral.values) << info.id;
  }
  EXPECT_EQ(message_of([] { effect_from_text("leg_length:longer=1", {}, walker_effect_info); }),
            "effect leg_length: longer: 1 m is outside [-0.05, 0.05]");
}

TEST(EffectCatalogue, WhatIsNotNamedIsNeutralOrAsStated) {
  EXPECT_EQ(effect_from_text("leg_contact:leg=3,friction_ratio=1.4", nominal).values, (std::vector{3.0, 1.4, 1.0}));
  EXPECT_EQ(effect_from_text("contact_distribution:friction_mean=0.5", nominal).values,
            (std::vector{0.4, 0.1, 0.5, 0.05}));
  EXPECT_EQ(effect_from_text("slip_reversal", nominal).values.size(), 0U);
}

// Without a size it would be silently without effect; the refusal names what it takes.
TEST(EffectCatalogue, AnEffectIsTakenWithASizeOnly) {
  for (const std::vector<EffectInfo>* all : {&effect_catalogue(), &walker_effects()})
    for (const EffectInfo& info : *all) {
      if (info.parameters.empty()) continue;
      const std::string said = message_of([&] { effect_from_text(info.id, nominal, info); });
      EXPECT_EQ(said.find("effect " + info.id + ": does nothing without "), 0U) << said;
      for (const EffectParameter& p : info.parameters)
        EXPECT_NE(said.find(p.name + "=VALUE"), std::string::npos) << said;
    }
  EXPECT_EQ(message("leg_contact:leg=3"),
            "effect leg_contact: does nothing without friction_ratio or restitution_ratio; it takes leg in [0, 7], "
            "friction_ratio in [0.1, 5], restitution_ratio in [0, 3], written "
            "leg_contact:leg=VALUE,friction_ratio=VALUE,restitution_ratio=VALUE");
  EXPECT_EQ(message("contact_outliers:share=0.1")
                .find("effect contact_outliers: does nothing without share and "
                      "friction_ratio; "),
            0U);
  EXPECT_EQ(message_of([] {
              effect_from_text("slope_deg_clock:frequency_hz=1", {}, walker_effect_info);
            }).find("effect slope_deg_clock: does nothing without amplitude; "),
            0U);
}

TEST(EffectCatalogue, RefusesWhatItDoesNotUnderstand) {
  EXPECT_NE(message("gravity").find("effect: \"gravity\" is none of contact_distribution, initial_speed"),
            std::string::npos);
  EXPECT_EQ(message("leg_contact:leg=8"), "effect leg_contact: leg: 8 is outside [0, 7]");
  EXPECT_EQ(message("leg_contact:leg=1.5"), "effect leg_contact: leg: 1.5 is not a whole number");
  EXPECT_EQ(message("inertia:ratio=3"), "effect inertia: ratio: 3 is outside [0.5, 2]");
  EXPECT_EQ(message("inertia:ratio=nan"), "effect inertia: ratio: nan is outside [0.5, 2]");
  EXPECT_EQ(message("inertia:ratio"), "effect inertia: \"ratio\" is not of the form parameter=value");
  EXPECT_EQ(message("inertia:ratio=1x"), "effect inertia: \"1x\" is not a number");
  EXPECT_EQ(message("inertia:ratio=1,ratio=1"), "effect inertia: ratio is given twice");
  EXPECT_EQ(message("inertia:size=1"), "effect inertia: \"size\" is none of its parameters (ratio)");
  EXPECT_EQ(message("leg_lengths:leg_lengths_m=0.15;0.15"),
            "effect leg_lengths: leg_lengths_m: 2 values, 8 are needed");
  EXPECT_EQ(message("friction_patch:from_m=2,to_m=1"),
            "effect friction_patch: to_m: 1 m does not lie beyond from_m, 2 m");
}

}  // namespace
}  // namespace metastable::dynamics::test
