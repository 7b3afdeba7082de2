// Holds rolled wheels against the chain, which shares no random number with them.

#include "analysis/sensitivity/rolled_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "analysis/study/metastability.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

TEST(RolledSteps, AgreeWithTheChain) {
  const Setting setting = paper_setting(9.59, true);
  const double chain = study(setting, {.tolerance = 0.002, .brief = true}).steps.from_start.value;
  const auto rolled = rolled_steps(setting, {.landings = 200000});
  ASSERT_TRUE(rolled);
  EXPECT_LT(rolled->upper - rolled->lower, 0.03 * chain);
  EXPECT_NEAR(rolled->value, chain, 1.5 * (rolled->upper - rolled->value));
}

TEST(RolledSteps, IntervalsHoldTheAnswerAsOftenAsTheySay) {
  Setting setting = paper_setting(9.59, true);
  const double chain = study(setting, {.tolerance = 0.002, .brief = true}).steps.from_start.value;
  int held = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const auto rolled = rolled_steps(setting, {.landings = 4000, .seed = seed});
    ASSERT_TRUE(rolled);
    held += rolled->lower < chain && chain < rolled->upper;
  }
  EXPECT_GE(held, 87);  // binomial with 0.95: fewer in one seed of a thousand
}

TEST(RolledSteps, SayNothingOfWheelsThatHardlyRest) {
  Setting setting = paper_setting(9.59, true);
  setting.law = dynamics::Law::coulomb;
  EXPECT_FALSE(rolled_steps(setting, {.landings = 5000}));
  const Sensitivities none = rolled_sensitivities(setting, {.landings = 5000});
  EXPECT_TRUE(none.ranked.empty());
  EXPECT_EQ(none.reason, "fewer than 100 wheels came to rest in 5000 landings");
}

TEST(RolledSteps, SensitivitiesAgreeWithThoseAlongTheDraws) {
  const Setting setting = paper_setting(9.59, true);
  const StudyOptions options{.cells = 128, .samples = 4096};
  const Sensitivities paths = sensitivities(study(setting, options), options);
  const Sensitivities rolled = rolled_sensitivities(setting, {.landings = 200000});
  ASSERT_GE(rolled.ranked.size(), 7u);
  for (const Sensitivity& one : rolled.ranked) {
    const auto other = std::ranges::find_if(
        paths.ranked, [&](const Sensitivity& s) { return s.parameter == one.parameter && !s.leg; });
    ASSERT_NE(other, paths.ranked.end()) << sensitivity_name(one);
    EXPECT_NEAR(one.derivative, other->derivative, 1.5 * one.error + 0.02 * std::abs(other->derivative))
        << sensitivity_name(one);
  }
}

TEST(RolledSteps, AreTheSameBitsOnAnyNumberOfThreads) {
  Setting setting = paper_setting(9.59, true);
  setting.law = dynamics::Law::settled;
  const Sensitivities one = rolled_sensitivities(setting, {.landings = 1000, .threads = 1}),
                      two = rolled_sensitivities(setting, {.landings = 1000, .threads = 2});
  ASSERT_EQ(one.ranked.size(), two.ranked.size());
  for (std::size_t i = 0; i < one.ranked.size(); ++i) {
    EXPECT_EQ(one.ranked[i].derivative, two.ranked[i].derivative);
    EXPECT_EQ(one.ranked[i].error, two.ranked[i].error);
  }
}

TEST(RolledSteps, RefuseASettingOutOfRange) {
  Setting setting;
  setting.slope_deg = -1;
  EXPECT_THROW(rolled_steps(setting, {}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
