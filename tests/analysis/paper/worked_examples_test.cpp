#include "analysis/paper/worked_examples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

TEST(WorkedExamples, TheLaboratoryStandInHasThePapersConditions) {
  const Experiment e = laboratory_stand_in({}, 1, 2, 4);
  ASSERT_EQ(e.conditions.size(), 3u);
  EXPECT_EQ(e.conditions[0].id, "fast-9.59");
  EXPECT_EQ(e.trials.size(), 12u);
  EXPECT_EQ(e.sensor.noise_sd, 0.008);
  const Experiment coulomb = laboratory_stand_in({{"slip_reversal", {}}}, 1, 2, 4);
  EXPECT_NE(coulomb.trials[0].collisions[1].omega_minus, e.trials[0].collisions[1].omega_minus);
}

// Rest is rarer without the charge, and out of reach under coulomb (rest_reachability_test.cpp).
TEST(WorkedExamples, WithoutTheChargeOnStickingRestIsRarer) {
  const std::vector<ChargeOnSticking> ramps = charge_on_sticking(1, 2);
  ASSERT_EQ(ramps.size(), 2u);
  for (const ChargeOnSticking& ramp : ramps) {
    EXPECT_GT(ramp.uncharged.lower, ramp.published.upper);
    EXPECT_TRUE(std::isinf(ramp.coulomb.value));
    // It is of mu ~ N(0.4, 0.1^2) on [0, inf), of which 3e-5 of the normal is cut off.
    EXPECT_NEAR(ramp.share_above, 0.5 * std::erfc((ramp.critical_friction - 0.4) / 0.1 / std::sqrt(2.0)), 1e-4);
  }
  EXPECT_NEAR(ramps[0].published.value, 4.2585, 0.05 * 4.2585);  // integrated_study_test.cpp
  EXPECT_NEAR(ramps[1].published.value, 6.1746, 0.05 * 6.1746);
}

TEST(WorkedExamples, OneSourceAtATimeIsBelievedHalfAsWide) {
  const Experiment e = test::wheel_design(2, 3);
  const Experiment none = believed_half_as_wide(e, VariabilitySource::none),
                   launch = believed_half_as_wide(e, VariabilitySource::launch),
                   legs = believed_half_as_wide(e, VariabilitySource::legs),
                   contact = believed_half_as_wide(e, VariabilitySource::contact);
  EXPECT_EQ(none.wheel.leg_length, e.wheel.leg_length);
  EXPECT_EQ(none.conditions[0].initial_speed->sd, e.conditions[0].initial_speed->sd);
  for (std::size_t i = 0; i < e.conditions.size(); ++i)
    EXPECT_DOUBLE_EQ(launch.conditions[i].initial_speed->sd, e.conditions[i].initial_speed->sd / 2);
  EXPECT_EQ(launch.contact.friction.sd, e.contact.friction.sd);
  EXPECT_NEAR(legs.wheel.mean_leg_length(), e.wheel.mean_leg_length(), 1e-15);
  EXPECT_NEAR(legs.wheel.leg_length[0] - legs.wheel.leg_length[5], (e.wheel.leg_length[0] - e.wheel.leg_length[5]) / 2,
              1e-15);
  EXPECT_DOUBLE_EQ(contact.contact.restitution.sd, e.contact.restitution.sd / 2);
  EXPECT_DOUBLE_EQ(contact.contact.friction.sd, e.contact.friction.sd / 2);
  EXPECT_EQ(contact.wheel.leg_length, e.wheel.leg_length);
}

TEST(WorkedExamples, ALaunchThatIsNotStatedHasNoWidth) {
  Experiment e = test::wheel_design(2, 3);
  e.conditions[1].initial_speed.reset();
  EXPECT_THROW(believed_half_as_wide(e, VariabilitySource::launch), std::invalid_argument);
}

TEST(WorkedExamples, EachLawWithAndWithoutTheSpeedAfter) {
  Experiment settled = test::wheel_design(2, 3);
  const std::vector<UnderLaw> all = under_each_law(settled);
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all[0].experiment.contact.law, dynamics::Law::published);
  EXPECT_EQ(all[2].experiment.contact.law, dynamics::Law::coulomb);
  EXPECT_TRUE(all[0].experiment.trials[0].collisions[0].omega_plus);
  EXPECT_TRUE(all[1].whole_steps);
  EXPECT_EQ(all[1].experiment.columns.omega_plus, Presence::none);
  EXPECT_FALSE(all[1].experiment.trials[0].collisions[0].omega_plus);
  EXPECT_EQ(under_each_law(test::wheel_design(2, 3, false)).size(), 2u);
  settled.contact.law = dynamics::Law::settled;
  ASSERT_EQ(under_each_law(settled).size(), 6u);
  EXPECT_EQ(under_each_law(settled)[4].experiment.contact.law, dynamics::Law::settled);
}

}  // namespace
}  // namespace metastable::analysis
