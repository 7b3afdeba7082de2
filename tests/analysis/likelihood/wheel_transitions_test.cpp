#include "analysis/likelihood/wheel_transitions.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "analysis/diagnosis/model_fit.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

using test::term;

// Fitted effects find the sizes the data were drawn with.
TEST(WheelTransitions, FitsFindTheSizesOfEffects) {
  const auto design = wheel_transitions(test::wheel_design(120, 14));
  struct Case {
    const char* id;
    std::vector<double> variant, values;
  };
  const std::vector<Case> cases{{"leg_contact", {3, 0}, {1.15}},         {"rolling_resistance", {}, {0.004}},
                                {"contact_memory", {}, {0.3}},           {"trial_drift", {}, {0.2}},
                                {"trial_spread", {}, {0.02 * 0.02}},     {"friction_patch", {0.4, 0.9}, {0.85}},
                                {"hub_eccentricity", {}, {2e-4, -1e-4}}, {"sensor_noise", {}, {1e-4}},
                                {"sensor_bias", {1, 1}, {0.02}}};
  for (const Case& one : cases) {
    const EffectTerm truth = term(*design, one.id, one.variant, one.values);
    const auto data = design->simulate(nominal_values(*design), std::vector{truth}, 11);
    EffectTerm start = term(*data, one.id, one.variant, one.values);
    for (double& value : start.values) value *= 0.9;
    const Fit found = fit(*data, nominal_values(*data), {start});
    EXPECT_TRUE(found.converged) << one.id << ' ' << found.reason;
    const Eigen::MatrixXd covariance = found.information.inverse();
    for (std::size_t p = 0; p < one.values.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(nominal_values(*data).size() + p);
      EXPECT_NEAR(found.terms[0].values[p], one.values[p], 4 * std::sqrt(covariance(at, at))) << one.id << ' ' << p;
    }
    EXPECT_GT(found.penalised, fit(*data, nominal_values(*data), {}).penalised + 8) << one.id;
  }
}

TEST(WheelTransitions, NeedATransition) {
  EXPECT_THROW(wheel_transitions(test::wheel_design(3, 1, false)), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
