#include "analysis/sensitivity/setting_labels.h"

#include <gtest/gtest.h>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

using Labels = std::vector<std::string>;

TEST(SettingLabels, SayWhatDiffers) {
  const Setting paper = paper_setting(7.02, false);
  EXPECT_EQ(setting_labels({paper, paper_setting(9.59, false)}), (Labels{"7.02 deg", "9.59 deg"}));
  Setting other = paper;
  other.friction.mean = 0.6;
  EXPECT_EQ(setting_labels({paper, other}), (Labels{"mu 0.4", "mu 0.6"}));
  other.friction.sd = 0.05;
  EXPECT_EQ(setting_labels({paper, other}), (Labels{"mu 0.4 sd 0.1", "mu 0.6 sd 0.05"}));
  other = paper;
  other.restitution.sd = 0;
  other.law = dynamics::Law::settled;
  EXPECT_EQ(setting_labels({paper, other}), (Labels{"law published, sd of eta 0.1", "law settled, sd of eta 0"}));
  other = paper_setting(7.02, true);
  other.wheel.hub_mass = 2;
  EXPECT_EQ(setting_labels({paper, other}), (Labels{"the paper's legs, M 1.39 kg", "legs of 0.1519 m, M 2 kg"}));
  other = paper_setting(9.59, false);
  other.initial_speed = {6, 0};
  EXPECT_EQ(setting_labels({paper, other}), (Labels{"7.02 deg, omega_0 7.35 sd 0.19", "9.59 deg, omega_0 6 sd 0"}));
}

TEST(SettingLabels, NumberWhatDoesNotDiffer) {
  const Setting paper = paper_setting(7.02, false), other = paper_setting(9.59, false);
  EXPECT_EQ(setting_labels({paper, paper}), (Labels{"setting 1", "setting 2"}));
  EXPECT_EQ(setting_labels({paper, other, paper}), (Labels{"7.02 deg, setting 1", "9.59 deg", "7.02 deg, setting 3"}));
}

}  // namespace
}  // namespace metastable::analysis
