#include "analysis/sensitivity/propagation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Sensitivities two(double slope, double friction) {
  return {{{Parameter::slope, {}, 7.0, slope, 0}, {Parameter::friction_mean, {}, 0.4, friction, 0}}, ""};
}

std::string refusal(const Setting& setting, const std::vector<StandardError>& errors) {
  return message_of([&] { check_standard_errors(setting, errors); });
}

// Variances add: 0.3^2 + 0.4^2 = 0.5^2.
TEST(Propagation, DeltaMethodInTheLogarithm) {
  const Propagated result = propagate(100, two(0.3, -4), {{Parameter::slope, 1.0}, {Parameter::friction_mean, 0.1}});
  EXPECT_DOUBLE_EQ(result.log_sd, 0.5);
  EXPECT_NEAR(result.interval.upper, 100 * std::exp(1.959963984540054 * 0.5), 1e-9);
  EXPECT_NEAR(result.interval.lower, 100 * std::exp(-1.959963984540054 * 0.5), 1e-12);
  ASSERT_EQ(result.shares.size(), 2u);
  EXPECT_EQ(result.shares[0].parameter, Parameter::friction_mean);
  EXPECT_NEAR(result.shares[0].share, 0.64, 1e-15);
}

// Friction is one unknown for both ramps and cancels where both respond alike; two slopes are two unknowns.
TEST(Propagation, RatioCancelsWhatIsCommon) {
  Setting here, there;
  there.slope_deg = 9.59;
  const auto ratio = [&](Parameter parameter, double error) {
    return propagate_ratio(2, {here, two(0.3, -4)}, {there, two(0.4, -4)}, {{parameter, error}});
  };
  const Propagated common = ratio(Parameter::friction_mean, 0.1);
  EXPECT_EQ(common.log_sd, 0);
  EXPECT_EQ(common.interval.lower, 2);
  EXPECT_DOUBLE_EQ(ratio(Parameter::slope, 1.0).log_sd, 0.5);
  there = here;
  EXPECT_DOUBLE_EQ(ratio(Parameter::slope, 1.0).log_sd, 0.1);  // one ramp
}

TEST(Propagation, RefusesWhatHasNoMeaning) {
  const std::string taken = "nothing was thrown";
  Setting setting;
  EXPECT_NE(refusal(setting, {{Parameter::radius_of_gyration, 0.01}}).find("radius-of-gyration"), std::string::npos);
  EXPECT_NE(refusal(setting, {{Parameter::slope, -1}}).find("slope: standard error -1 is outside"), std::string::npos);
  EXPECT_NE(refusal(setting, {{Parameter::slope, std::nan("")}}), taken);
  EXPECT_NE(refusal(setting, {{Parameter::slope, 0.1}, {Parameter::slope, 0.1}}), taken);
  setting.friction.sd = 0;
  EXPECT_NE(refusal(setting, {{Parameter::friction_sd, 0.01}}).find("friction-sd"), std::string::npos);
  EXPECT_EQ(refusal(setting, {{Parameter::friction_mean, 0.01}, {Parameter::slope, 0.1}}), taken);
  EXPECT_THROW(propagate(10, {}, {{Parameter::slope, 0.1}}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
