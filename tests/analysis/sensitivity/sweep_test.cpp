#include "analysis/sensitivity/sweep.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

TEST(Sweep, RangesHoldTheDecimalsThatWereTyped) {
  const std::vector<double> values = axis_values(5, 12, 0.25);
  ASSERT_EQ(values.size(), 29u);
  EXPECT_EQ(values[1], 5.25);
  EXPECT_EQ(values.back(), 12.0);
  EXPECT_EQ(axis_values(0.2, 0.5, 0.02)[5], 0.3);
  EXPECT_EQ(axis_values(1, 1, 1).size(), 1u);
  EXPECT_THROW(axis_values(1, 0, 1), std::invalid_argument);
  EXPECT_THROW(axis_values(0, 1, 0), std::invalid_argument);
  EXPECT_THROW(axis_values(0, 1, 1e-9), std::invalid_argument);
}

TEST(Sweep, LastAxisRunsFastest) {
  const std::vector<SweepAxis> axes{{Parameter::slope, {7, 8}}, {Parameter::friction_mean, {0.2, 0.3, 0.4}}};
  EXPECT_EQ(sweep_size(axes), 6u);
  std::vector<double> at;
  const Setting setting = sweep_setting(paper_setting(7.02, true), axes, 4, &at);
  EXPECT_EQ(at, (std::vector<double>{8, 0.3}));
  EXPECT_EQ(setting.slope_deg, 8);
  EXPECT_EQ(setting.friction.mean, 0.3);
}

TEST(Sweep, PointsComeInOrderAndEqualSingleStudies) {
  const Setting base = paper_setting(7.02, true);
  const std::vector<SweepAxis> axes{{Parameter::friction_sd, {0.05, 0.1, 0.15, 0.2, 0.25}}};
  StudyOptions options;
  options.cells = 32;
  options.samples = 512;
  std::size_t expected = 1;
  double last = 0;
  sweep(base, axes, 1, options, [&](std::size_t index, const SweepPoint& point) {
    EXPECT_EQ(index, expected++);
    EXPECT_EQ(point.at, std::vector<double>{axes[0].values[index]});
    EXPECT_EQ(point.study.steps.from_start.value,
              study(sweep_setting(base, axes, index), options).steps.from_start.value);
    last = point.study.steps.from_start.value;
  });
  EXPECT_EQ(expected, 5u);
  EXPECT_GT(last, 1.0);
}

TEST(Sweep, NamesOfParametersRoundTrip) {
  for (const auto name : {"slope", "restitution-mean", "restitution-sd", "friction-mean", "friction-sd"})
    EXPECT_EQ(parameter_name(parameter_from_name(name)), name);
  EXPECT_THROW(parameter_from_name("mass"), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
