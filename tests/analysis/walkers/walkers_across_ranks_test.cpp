// Holds the walkers and the wheel on meshes across ranks, against the same meshes on one process.

#include <numbers>

#include "analysis/walkers/walker_study.h"
#include "dynamics/return_map/wheel_map.h"
#include "tests/analysis/walkers/wheel_batch.h"
#include "tests/markov/ranks/ranks_of_tests.h"

namespace metastable::analysis {
namespace {

constexpr double per_rad = 57.29577951308232;

void expect_same_walker(const WalkerSetting& setting, const markov::MeshOptions& options) {
  const dynamics::WalkerMap map = setting.map();
  const auto gait = dynamics::find_gait(map.walker(), setting.slope_deg * degree);
  markov::testing::expect_same_as_one_process(batch_map(map), gait_state(setting, gait), options);
}

TEST(AcrossRanks, SimplestWalker) {
  expect_same_walker({Walker::simplest, 0.009 * per_rad, 0.001 * per_rad, dynamics::Terrain::fresh}, {.spacing = 0.6});
}

TEST(AcrossRanks, CompassGait) {
  expect_same_walker({Walker::compass, 3, 0.012 * per_rad, dynamics::Terrain::fresh}, {.spacing = 0.9, .margin = 9});
}

TEST(AcrossRanks, CompassGaitThatFallsRarely) {
  expect_same_walker({Walker::compass, 3, 0.0035 * per_rad, dynamics::Terrain::fresh}, {.spacing = 1.2, .margin = 8});
}

TEST(AcrossRanks, WheelOfEightLegs) {
  const dynamics::WheelMap wheel = wheel_of_tests();
  const std::vector<double> start{25};
  markov::testing::expect_same_as_one_process(wheel_batch(wheel), start, {.spacing = 0.5, .margin = 8});
}

}  // namespace
}  // namespace metastable::analysis
