// Holds the adjoint against differences of full solves, against itself by two methods, and against scaling laws.

#include "analysis/sensitivity/sensitivity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

const Sensitivity& find(const Sensitivities& all, const std::string& name) {
  for (const Sensitivity& one : all.ranked)
    if (sensitivity_name(one) == name) return one;
  throw std::out_of_range(name);
}

Sensitivities by_adjoint(const Setting& setting, const StudyOptions& options) {
  return sensitivities(study(setting, options), options);
}

// Takes d ln M / d parameter by re-solving on either side, with rows integrated.
double by_solves(const Setting& setting, Parameter parameter, double step) {
  double log_steps[2];
  for (int side : {0, 1}) {
    Setting moved = setting;
    set_parameter(moved, parameter, parameter_value(setting, parameter) + (side == 0 ? -step : step));
    log_steps[side] = std::log(study(moved, {.method = Method::integrated, .tolerance = 1e-4}).steps.from_start.value);
  }
  return (log_steps[1] - log_steps[0]) / (2 * step);
}

Setting rare() {
  Setting setting = paper_setting(7.02, true);
  setting.friction = {0.3, 0.03};
  return setting;
}

const StudyOptions quick{.cells = 128, .samples = 4096};
const StudyOptions few_nodes{.method = Method::integrated, .cells = 32};

TEST(Sensitivity, SampledAgreesWithDifferencesOfFullSolves) {
  const Setting setting = paper_setting(9.59, true);
  const Sensitivities all = by_adjoint(setting, quick);
  for (const auto& [parameter, step] : {std::pair(Parameter::slope, 0.01), std::pair(Parameter::friction_mean, 1e-3),
                                        std::pair(Parameter::friction_sd, 1e-3)}) {
    const Sensitivity& one = find(all, std::string(parameter_name(parameter)));
    EXPECT_NEAR(one.derivative, by_solves(setting, parameter, step), 1.5 * one.error) << parameter_name(parameter);
    EXPECT_LT(one.error, 0.05 * std::abs(one.derivative));
  }
}

// It takes 1.46e7 steps. The values are central differences of full solves with 128 integrated nodes. To reproduce:
// `metastable steps --legs 0.1519 --initial-speed 7.35,0.19 --method integrated --cells 128 --friction 0.3,0.03` with
// --slope 7.019 and 7.021, then with --friction 0.2999,0.03 and 0.3001,0.03, then 0.3,0.02999 and 0.3,0.03001.
TEST(Sensitivity, RareFailureKeepsItsDigits) {
  const Sensitivities all = by_adjoint(rare(), {.cells = 256, .samples = 16384});
  EXPECT_NEAR(find(all, "slope").derivative, 5.3666, 0.02);
  EXPECT_NEAR(find(all, "friction-mean").derivative, -219.96, 1);
  EXPECT_NEAR(find(all, "friction-sd").derivative, -941.4, 5);
  EXPECT_EQ(all.ranked.front().parameter, Parameter::inertia);
  // Times scale with sqrt(length): longer legs (the inertia follows) and contacts as much longer change nothing once
  // the launch is forgotten, so the stiffness undoes what the legs do.
  const Sensitivity& legs = find(all, "leg-length");
  EXPECT_NEAR(find(all, "ramp-stiffness").elasticity(), legs.elasticity(), 1.5 * legs.error * legs.value);
  for (const Sensitivity& one : all.ranked) EXPECT_LT(one.error, 0.02 * std::abs(one.derivative) + 0.2 / one.value);
}

TEST(Sensitivity, IntegratedRowsAgreeWithFullSolvesToManyDigits) {
  const Setting setting = paper_setting(7.02, true);
  const Sensitivities all = by_adjoint(setting, few_nodes);
  const double slope = by_solves(setting, Parameter::slope, 0.01);
  EXPECT_NEAR(find(all, "slope").derivative / slope, 1, 3e-4);
  EXPECT_NEAR(find(all, "friction-mean").derivative / by_solves(setting, Parameter::friction_mean, 1e-3), 1, 3e-4);
  // K_r and m_c enter as m_c / K_r.
  EXPECT_NEAR(find(all, "ramp-stiffness").elasticity() / -find(all, "contact-mass").elasticity(), 1, 1e-6);
}

TEST(Sensitivity, CoulombAgreesWithDifferencesOfFullSolves) {
  const Setting setting = gentle_coulomb();
  const Sensitivities all = by_adjoint(setting, quick);
  const auto resolved = [&](Parameter parameter, double step) {
    double log_steps[2];
    for (int side : {0, 1}) {
      Setting moved = setting;
      set_parameter(moved, parameter, parameter_value(setting, parameter) + (side == 0 ? -step : step));
      log_steps[side] = std::log(study(moved, {.cells = 256, .samples = 4096}).steps.from_start.value);
    }
    return (log_steps[1] - log_steps[0]) / (2 * step);
  };
  for (const auto& [parameter, step] : {std::pair(Parameter::slope, 0.02), std::pair(Parameter::restitution_mean, 0.01),
                                        std::pair(Parameter::radius_of_gyration, 1e-3)}) {
    const double full = resolved(parameter, step);
    EXPECT_NEAR(find(all, std::string(parameter_name(parameter))).derivative / full, 1, 0.02)
        << parameter_name(parameter);
  }
  for (const Sensitivity& one : all.ranked) EXPECT_NE(one.parameter, Parameter::ramp_stiffness);
}

// A mean of 0 cannot be lowered: it is moved up alone.
TEST(Sensitivity, AMeanAtTheEndOfItsRange) {
  Setting setting = paper_setting(7.02, true);
  setting.restitution = {0, 0.1};
  setting.friction = {0.4, 0.1};
  const StudyOptions options{.method = Method::integrated, .tolerance = 1e-6, .brief = true};
  const auto steps = [&](double mean) {
    Setting moved = setting;
    moved.restitution.mean = mean;
    return study(moved, options).steps.from_start.value;
  };
  const Sensitivity one = find(by_adjoint(setting, options), "restitution-mean");
  EXPECT_NEAR(one.derivative, std::log(steps(0.002) / steps(0)) / 0.002, 0.02 * std::abs(one.derivative));
}

// All legs longer by one factor give the sum over the legs one by one.
TEST(Sensitivity, LegsOneByOneAddUpToTheirCommonScale) {
  const Setting setting = paper_setting(9.59, false);
  const Sensitivities all = by_adjoint(setting, {.cells = 64, .samples = 2048, .replicates = 2});
  double sum = 0;
  for (const Sensitivity& one : all.ranked)
    if (one.leg) sum += one.elasticity();
  EXPECT_NEAR(sum, find(all, "leg-length").elasticity(), 1e-4 * std::abs(sum) + 1e-5);
}

TEST(Sensitivity, ConstantLaunchAndCorrelation) {
  Setting setting = paper_setting(9.59, true);
  setting.initial_speed.sd = 0;
  const Sensitivities all = by_adjoint(setting, quick);
  EXPECT_NEAR(find(all, "slope").derivative, by_solves(setting, Parameter::slope, 0.01),
              1.5 * find(all, "slope").error);
  setting.correlation = 0.5;
  EXPECT_THROW(by_adjoint(setting, quick), std::invalid_argument);
}

TEST(Sensitivity, ThreadsDoNotMatter) {
  StudyOptions one{.cells = 32, .samples = 256, .threads = 1, .replicates = 3}, two = one;
  two.threads = 2;
  const Sensitivities a = by_adjoint(paper_setting(7.02, true), one), b = by_adjoint(paper_setting(7.02, true), two);
  ASSERT_EQ(a.ranked.size(), b.ranked.size());
  for (std::size_t i = 0; i < a.ranked.size(); ++i) {
    EXPECT_EQ(a.ranked[i].derivative, b.ranked[i].derivative);
    EXPECT_EQ(a.ranked[i].error, b.ranked[i].error);
  }
}

TEST(Sensitivity, SaysWhyThereAreNone) {
  Setting endless = paper_setting(9.59, true);
  endless.law = dynamics::Law::coulomb;
  EXPECT_EQ(by_adjoint(endless, {.cells = 32, .samples = 256}).reason,
            "the expected steps are infinite or not resolved");
  Setting exact = paper_setting(7.02, true);
  exact.restitution.sd = exact.friction.sd = 0;
  Metastability any;
  any.setting = exact;
  EXPECT_NE(sensitivities(any, {}).reason.find("without noise"), std::string::npos);
  EXPECT_THROW(sensitivities(study(gentle_coulomb().problem(), {.cells = 32, .samples = 256}), {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
