#include "analysis/motion_capture/collision_comparison.h"

#include <gtest/gtest.h>

#include <cmath>

namespace metastable::analysis {
namespace {

FoundCollision found_collision(int number, double time, double peak, double fitted) {
  FoundCollision c;
  c.number = number;
  c.peak_time = time;
  c.peak = peak;
  c.fit.emplace();
  c.fit->time = time;
  c.fit->omega_minus = fitted;
  c.fit->omega_plus = fitted - 1;
  return c;
}

class CollisionComparisonTest : public testing::Test {
 protected:
  void SetUp() override {
    MeasuredTrial trial;
    trial.number = 7;
    for (int k = 1; k <= 3; ++k) {
      MeasuredCollision c;
      c.number = k;
      c.time = 0.2 * k;
      c.omega_minus = 5;
      c.omega_plus = 4;
      trial.collisions.push_back(c);
    }
    known_.trials = {trial};
    angles_.resize(2);
    angles_[0].number = 7;
    angles_[1].number = 8;  // not known
    found_.resize(2);
    found_[0].collisions = {found_collision(1, 0.2, 4.9, 5.01), found_collision(2, 0.4, 4.7, 5.03),
                            found_collision(3, 0.75, 4.9, 5.0)};  // the third 0.15 s late
    found_[1].collisions = {found_collision(1, 0.2, 9, 9)};
  }

  Experiment known_;
  std::vector<MeasuredAngle> angles_;
  std::vector<FoundTrial> found_;
};

TEST_F(CollisionComparisonTest, BiasAndSpreadOfWhatIsFound) {
  const CollisionComparison c = compare_collisions(known_, angles_, found_, false, 16);
  EXPECT_EQ(c.due, 3u);
  EXPECT_EQ(c.found, 2u);
  EXPECT_EQ(c.others, 1u);
  EXPECT_EQ(c.written.count, 2u);
  EXPECT_NEAR(c.written.bias, 0.02, 1e-12);
  EXPECT_NEAR(c.written.sd, std::sqrt(0.0002), 1e-12);
  EXPECT_NEAR(c.written.bias_half_width, 1.96 * std::sqrt(0.0001), 1e-6);
  EXPECT_NEAR(c.peak.bias, -0.2, 1e-12);
  EXPECT_NEAR(c.fit_after.bias, 0.02, 1e-12);
}

TEST_F(CollisionComparisonTest, TakesThePeakWhereThePeakIsWritten) {
  EXPECT_NEAR(compare_collisions(known_, angles_, found_, true, 16).written.bias, -0.2, 1e-12);
}

TEST_F(CollisionComparisonTest, OfAsManyCollisionsAsWereAskedFor) {
  const CollisionComparison c = compare_collisions(known_, angles_, found_, false, 1);
  EXPECT_EQ(c.due, 1u);
  EXPECT_EQ(c.found, 1u);
  EXPECT_EQ(c.others, 2u);
  EXPECT_EQ(c.written.sd, 0);
}

TEST_F(CollisionComparisonTest, CollisionsWithoutFitHaveTheirPeak) {
  found_[0].collisions.resize(2);
  for (FoundCollision& c : found_[0].collisions) c.fit.reset();
  const CollisionComparison c = compare_collisions(known_, angles_, found_, false, 16);
  EXPECT_NEAR(c.written.bias, -0.2, 1e-12);
  EXPECT_EQ(c.fit_before.count, 0u);
}

}  // namespace
}  // namespace metastable::analysis
