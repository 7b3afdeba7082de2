// Judges the diagnosis by rigid bodies that this tree did not make.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment_model/experiment_model.h"
#include "analysis/fitting/model_fit.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/experiment_model/engine_wheel.h"

namespace metastable::analysis {
namespace {

const EstimatedParameter& parameter(const std::vector<EstimatedParameter>& all, const std::string& name) {
  return *std::ranges::find(all, name, &EstimatedParameter::name);
}

// Of the catalogue those of each kind that are most alike, which keeps the fits to a quarter.
DiagnosisOptions some_effects() {
  DiagnosisOptions options;
  options.catalogue = {"leg_contact",    "leg_lengths", "axle_drag_viscous",          "slope_offset",
                       "friction_patch", "trial_drift", "speed_dependent_restitution"};
  return options;
}

Diagnosis decided(const metastable::test::EngineRun& run, const DiagnosisOptions& options) {
  return test::decided(*transition_model(metastable::test::engine_experiment(run)), options);
}

TEST(EngineDiagnosis, ARigidBodyIsNoGapOrARecalibrationOfAFewPerCent) {
  const Diagnosis d = decided({.seed = 11}, {});
  EXPECT_TRUE(d.verdict == Verdict::no_gap || d.verdict == Verdict::recalibrate) << verdict_name(d.verdict);
  EXPECT_NEAR(parameter(d.gap.contact, "restitution_mean").value, 0.4, 0.015);
  EXPECT_NEAR(parameter(d.gap.contact, "friction_mean").value, 0.4, 0.01);
}

TEST(EngineDiagnosis, AnOddLegIsNamedWithItsFriction) {
  const Diagnosis d = decided({.seed = 12, .odd_leg = 5, .friction_ratio = 0.88}, some_effects());
  ASSERT_EQ(d.causes.set, std::vector<std::string>{"leg_contact"});
  EXPECT_NEAR(parameter(d.causes.ranked.front().parameters.front(), "friction_ratio").value, 0.88, 0.03);
  EXPECT_EQ(parameter(d.causes.ranked.front().parameters.front(), "leg").value, 5);
}

TEST(EngineDiagnosis, ADragAtTheAxleIsInTheSetWithItsSize) {
  const Diagnosis d = decided({.seed = 13, .viscous_drag = 0.004}, some_effects());
  ASSERT_EQ(d.verdict, Verdict::explained);
  EXPECT_LE(d.causes.set.size(), 3u);
  const auto drag = std::ranges::find(d.causes.ranked, "axle_drag_viscous", &Cause::name);
  ASSERT_NE(drag, d.causes.ranked.end());
  EXPECT_NE(std::ranges::find(d.causes.set, drag->name()), d.causes.set.end());
  EXPECT_NEAR(parameter(drag->parameters.front(), "n_m_s").value, 0.004, 0.0006);
}

// Compares the steps before rest that the model with an effect expects with the engine's count.
void expect_steps(const metastable::test::EngineRun& run, const char* effect, double size) {
  const auto model = transition_model(metastable::test::engine_experiment(run));
  const EffectTerm term = test::term(*model, effect, {}, {size});
  const double expected = model->expected_steps(nominal_values(*model), std::vector{term}, 1);
  const auto [at_risk, rests] = model->rests();
  EXPECT_NEAR(std::log(expected * rests / at_risk), 0, 3.5 / std::sqrt(rests)) << effect << ": " << rests << " rests";
}

// A torque at the axle makes feet slide further, so that a friction which stops them without it does not stop them.
TEST(EngineDiagnosis, TorquesMakeTheWheelRestAsOftenAsTheModelSays) {
  expect_steps({.trials = 30, .seed = 5, .viscous_drag = 0.016}, "axle_drag_viscous", 0.016);
}

}  // namespace
}  // namespace metastable::analysis
