// Points drawn from a smoothed sample have its mean and covariance, less what is removed, and its shape.

#include "analysis/statistics/smooth_sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "analysis/statistics/random.h"

namespace metastable::analysis::test {
namespace {

constexpr int drawn = 20000;

struct Moments {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

Moments moments(const Eigen::MatrixXd& points) {
  Moments m;
  m.mean = points.colwise().mean();
  const Eigen::MatrixXd off = points.rowwise() - m.mean.transpose();
  m.covariance = off.transpose() * off / static_cast<double>(points.rows() - 1);
  return m;
}

// Correlated pairs in units that differ by a thousand; those of the second group lie 5 higher.
Eigen::MatrixXd pairs(int count) {
  Eigen::MatrixXd points(count, 2);
  for (int i = 0; i < count; ++i) {
    const std::vector<double> z = normal_multipliers(5, static_cast<std::uint64_t>(i), DrawStream::machine, 2);
    points.row(i) << z[0] + 5 * (i % 2), 1000 * (0.6 * z[0] + 0.8 * z[1]);
  }
  return points;
}

// Draws for the places of the even points: those of the first group.
Eigen::MatrixXd draws_of(const SmoothSample& sample, Eigen::Index d, int count) {
  Eigen::MatrixXd points(drawn, d);
  for (int k = 0; k < drawn; ++k) {
    const auto number = static_cast<std::uint64_t>(k);
    const std::vector<double> z = normal_multipliers(6, number, DrawStream::machine, static_cast<std::size_t>(d));
    points.row(k) = sample.draw(static_cast<std::size_t>(2 * k % count), uniform_at(7, number, 0, 1),
                                Eigen::Map<const Eigen::VectorXd>(z.data(), d));
  }
  return points;
}

TEST(SmoothSample, KeepsTheMeanOfAGroupAndTheCovarianceWithinGroups) {
  const int count = 30;
  const Eigen::MatrixXd points = pairs(count);
  std::vector<int> group;
  for (int i = 0; i < count; ++i) group.push_back(i % 2);
  const Moments m = moments(draws_of(SmoothSample(points, group, Eigen::Vector2d::Zero()), 2, count));
  Eigen::MatrixXd first(count / 2, 2), off = points;
  for (int i = 0; i < count / 2; ++i) first.row(i) = points.row(2 * i);
  for (int g = 0; g < 2; ++g) {
    Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(2);
    for (int i = g; i < count; i += 2) mean += points.row(i) / (count / 2);
    for (int i = g; i < count; i += 2) off.row(i) -= mean;
  }
  const Eigen::MatrixXd covariance = off.transpose() * off / (count - 2);
  for (int j = 0; j < 2; ++j) {
    const double sd = std::sqrt(covariance(j, j));
    EXPECT_NEAR(m.mean[j], first.col(j).mean(), 0.03 * sd);
    EXPECT_NEAR(m.covariance(j, j) / covariance(j, j), 1, 0.1);  // of deviations count times, not count - 2
  }
  EXPECT_NEAR(m.covariance(0, 1) / covariance(0, 1), 1, 0.15);
}

TEST(SmoothSample, TakesOffWhatIsRemovedDownToNothing) {
  const Eigen::MatrixXd points = pairs(400);
  const Eigen::MatrixXd covariance = moments(points).covariance;
  const SmoothSample sample(points, std::vector<int>(400, 0), Eigen::Vector2d(0.3 * covariance(0, 0), 0));
  const Moments m = moments(draws_of(sample, 2, 400));
  EXPECT_NEAR(m.covariance(0, 0) / covariance(0, 0), 0.7, 0.05);
  EXPECT_NEAR(m.covariance(1, 1) / covariance(1, 1), 1, 0.05);
  const SmoothSample none(points, std::vector<int>(400, 0), 2 * covariance.diagonal());
  EXPECT_NEAR(moments(draws_of(none, 2, 400)).covariance.norm() / covariance.norm(), 0, 1e-6);
}

TEST(SmoothSample, KeepsTwoSpeedsApart) {
  Eigen::MatrixXd points(40, 1);
  for (int i = 0; i < 40; ++i) points(i, 0) = (i % 2 ? 1 : -1) + 0.02 * std::sin(i);
  const Eigen::MatrixXd many = draws_of(SmoothSample(points, std::vector<int>(40, 0), Eigen::VectorXd::Zero(1)), 1, 40);
  EXPECT_GT((many.array().abs() > 0.5).count(), 0.9 * drawn);
}

TEST(SmoothSample, APointFarFromAllOthersStaysAndSpreadsNone) {
  Eigen::MatrixXd points = pairs(30);
  const SmoothSample without(points.topRows(29), std::vector<int>(29, 0), Eigen::Vector2d::Zero());
  points.row(29) << 500, 0;
  const SmoothSample with(points, std::vector<int>(30, 0), Eigen::Vector2d::Zero());
  ASSERT_TRUE(with.far(29));
  EXPECT_EQ(with.draw(29, 0.3, Eigen::Vector2d(1, 1)), Eigen::Vector2d(500, 0));
  const Eigen::Vector2d normals(0.4, -1);
  EXPECT_LT((with.draw(3, 0.3, normals) - without.draw(3, 0.3, normals)).norm(), 1e-9);
}

TEST(SmoothSample, OnePointIsDrawnAsItIsAndSizesAreChecked) {
  const Eigen::MatrixXd one = Eigen::RowVector2d(3, 4);
  const SmoothSample sample(one, {0}, Eigen::Vector2d(1, 1));
  EXPECT_EQ(sample.draw(0, 0.5, Eigen::Vector2d(1, 1)), Eigen::Vector2d(3, 4));
  EXPECT_THROW(SmoothSample(one, {0, 0}, Eigen::Vector2d(1, 1)), std::invalid_argument);
  EXPECT_THROW(SmoothSample(one, {0}, Eigen::VectorXd::Zero(1)), std::invalid_argument);
}

// The draws' variances hold the variance that the points were drawn with as often as they say. Bootstraps miss it in 68
// of 300, and 64 of these lie below it.
TEST(ReflectedBootstrap, HoldsTheVarianceThatThePointsHave) {
  constexpr int samples = 300, draws = 200, count = 20;
  int below = 0, above = 0;
  for (std::uint64_t s = 0; s < samples; ++s) {
    const std::vector<double> z = normal_multipliers(11, s, DrawStream::machine, count);
    const Eigen::MatrixXd points = Eigen::Map<const Eigen::MatrixXd>(z.data(), count, 1);
    int smaller = 0;
    for (std::uint64_t k = 0; k < draws; ++k) {
      std::vector<double> uniforms;
      for (std::uint64_t i = 0; i < count; ++i) uniforms.push_back(uniform_at(12, s * draws + k, i, 1));
      const Eigen::MatrixXd drawn = reflected_bootstrap(points, std::vector<int>(count, 0), uniforms);
      smaller += moments(drawn).covariance(0, 0) < 1;
    }
    below += smaller > 0.95 * draws;
    above += smaller < 0.05 * draws;
  }
  EXPECT_NEAR(below + above, 0.1 * samples, 15);
  EXPECT_NEAR(below, 0.05 * samples, 12);
}

TEST(ReflectedBootstrap, DrawsFarPointsAndFewOnesAsTheyAre) {
  Eigen::MatrixXd points = pairs(30);
  points.row(29) << 500, 0;
  const Eigen::MatrixXd far = reflected_bootstrap(points, std::vector<int>(30, 0), std::vector<double>(30, 0.999));
  EXPECT_EQ(far, points.row(29).replicate(30, 1));
  const std::vector<double> middle{0.1, 0.9, 0.9};
  Eigen::MatrixXd expected(3, 2);
  expected << points.row(0), points.row(2), points.row(2);
  EXPECT_EQ(reflected_bootstrap(points.topRows(3), {0, 0, 0}, middle), expected);
  // Each group is drawn from its own points.
  expected << points.row(0), points.row(2), points.row(1);
  EXPECT_EQ(reflected_bootstrap(points.topRows(3), {0, 1, 1}, std::vector<double>{0.9, 0.9, 0.1}), expected);
}

}  // namespace
}  // namespace metastable::analysis::test
