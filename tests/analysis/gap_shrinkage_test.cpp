#include "analysis/gap_shrinkage.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "analysis/coast_down_transitions.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/rotor.h"

namespace metastable::analysis {
namespace {

// A torque that the nominal losses lack: held out, its fit closes the gap; recalibration alone does not.
TEST(GapShrinkage, TheTrueEffectClosesTheGap) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const Term truth = test::term(*design, "rolling_resistance", {}, {0.02});
  const auto data = design->simulate(nominal_values(*design), std::vector{truth}, 5);
  const Fit recalibrated = fit(*data, nominal_values(*data), {});
  const Fit with = fit(*data, recalibrated.nuisance, {test::term(*data, "rolling_resistance", {}, {0.01})});
  const auto shrinkage = gap_shrinkage(*data, recalibrated, {&with}, 4, 1, 1);
  ASSERT_EQ(shrinkage.size(), 2U);
  for (const Shrinkage& one : shrinkage) {
    EXPECT_LT(one.with_effect, one.recalibrated) << one.measure;
    ASSERT_TRUE(one.closed) << one.measure;
    EXPECT_NEAR(*one.closed, 1, 0.1) << one.measure;
    EXPECT_LE(*one.closed_lower, *one.closed_upper);
    EXPECT_LE(one.baseline_lower, one.baseline_upper);
  }
}

TEST(GapShrinkage, WithoutRivalsTheLastModelIsTheRecalibratedOne) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const auto data = design->simulate(nominal_values(*design), {}, 6);
  const Fit recalibrated = fit(*data, nominal_values(*data), {});
  for (const Shrinkage& one : gap_shrinkage(*data, recalibrated, {}, 4, 1, 1))
    EXPECT_EQ(one.with_effect, one.recalibrated) << one.measure;
}

TEST(GapShrinkage, NeedsTwoFolds) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  for (const int folds : {-1, 0, 1}) EXPECT_THROW(gap_shrinkage(*design, {}, {}, folds, 1, 1), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
