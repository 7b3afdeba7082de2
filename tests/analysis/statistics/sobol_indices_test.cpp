#include "analysis/statistics/sobol_indices.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "analysis/paper/variance_sources.h"

namespace metastable::analysis {
namespace {

// Ishigami and Homma's function (1990) with a = 7, b = 0.1: indices in closed form.
void ishigami(std::span<const double> u, std::span<double> out) {
  double x[3];
  for (std::size_t i = 0; i < 3; ++i) x[i] = std::numbers::pi * (2 * u[i] - 1);
  out[0] = std::sin(x[0]) + 7 * std::pow(std::sin(x[1]), 2) + 0.1 * std::pow(x[2], 4) * std::sin(x[0]);
}

TEST(SobolIndices, OfIshigami) {
  const auto result = sobol_indices({1, 1, 1}, 1, ishigami, {.samples = 1 << 16, .seed = 2});
  ASSERT_EQ(result.size(), 1u);
  EXPECT_NEAR(result[0].mean, 3.5, 0.05);
  EXPECT_NEAR(result[0].sd * result[0].sd, 13.8446, 0.15);
  const double first[] = {0.3139, 0.4424, 0}, total[] = {0.5576, 0.4424, 0.2437};
  for (std::size_t g = 0; g < 3; ++g) {
    const SobolIndex& index = result[0].group[g];
    EXPECT_NEAR(index.first.value, first[g], 0.015);
    EXPECT_NEAR(index.total.value, total[g], 0.015);
    // Half-widths of 95 % are widened by half: four of six would pass by the definition of the interval alone.
    EXPECT_LT(std::abs(index.total.value - total[g]), 1.5 * (index.total.upper - index.total.value) + 1e-12);
  }
}

TEST(SobolIndices, AGroupHoldsItsInteractions) {
  const auto result = sobol_indices({2, 1}, 1, ishigami, {.samples = 1 << 15});
  // x1 and x2 together have S1 + S2 (x1 and x2 do not interact), and total 1 - S3.
  EXPECT_NEAR(result[0].group[0].first.value, 0.7563, 0.02);
  EXPECT_NEAR(result[0].group[0].total.value, 1, 0.02);
}

TEST(SobolIndices, WithoutVarianceThereAreNone) {
  const auto result = sobol_indices({1, 1}, 2,
                                    [](std::span<const double> u, std::span<double> out) {
                                      out[0] = 3;
                                      out[1] = u[1];
                                    },
                                    {.samples = 1024});
  EXPECT_TRUE(result[0].group.empty());
  EXPECT_NEAR(result[1].group[0].total.value, 0, 1e-12);
  EXPECT_NEAR(result[1].group[1].first.value, 1, 0.1);
  EXPECT_THROW(sobol_indices({1}, 1, ishigami, {.samples = 16}), std::invalid_argument);
}

TEST(VarianceSources, AreThoseOfTheWheel) {
  Setting setting;
  setting.law = dynamics::Law::coulomb;
  const VarianceSources coulomb = variance_of_trials(setting, 0.000687, {.samples = 512, .threads = 1});
  EXPECT_TRUE(coulomb.steps.group.empty());  // never rests at 7.02 deg
  EXPECT_DOUBLE_EQ(coulomb.steps.mean, 32);
  // With constant contact only the launch and the legs are left.
  Setting constant = setting;
  constant.restitution.sd = constant.friction.sd = 0;
  const VarianceSources few = variance_of_trials(constant, 0.000687, {.samples = 512});
  EXPECT_NEAR(few.steady_speed.group[2].total.value, 0, 1e-12);
  EXPECT_NEAR(few.steady_speed.group[3].total.value, 0, 1e-12);
  EXPECT_GT(few.steady_speed.group[1].total.value, 0.9);
  const VarianceSources again = variance_of_trials(setting, 0.000687, {.samples = 512, .threads = 3});
  EXPECT_EQ(again.steady_speed.group[0].first.value, coulomb.steady_speed.group[0].first.value);
  setting.correlation = 0.5;
  EXPECT_THROW(variance_of_trials(setting, 0.001, {}), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
