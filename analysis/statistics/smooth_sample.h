#pragma once
// Draws points that are as likely as those of a sample, from a smooth distribution with its mean and its spread.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace metastable::analysis {

/// A sample of points smoothed by a normal kernel, and drawn towards its mean so that its covariance stays that of the
/// sample (Silverman, Density Estimation, 1986, section 6.4.1). The kernel is as wide as the points are likeliest from
/// one another. Points of several groups have means of their own and deviate from them alike. Points far from all
/// others are not smoothed, nor do others deviate like them.
class SmoothSample {
 public:
  /// @param points  [n x d], finite, n and d >= 1  @param group  [n] each >= 0
  /// @param removed  [d] variances that the points drawn have less than the measured ones, >= 0; no direction is left
  ///   with less than none
  /// @throws std::invalid_argument for arrays of other sizes
  SmoothSample(const Eigen::MatrixXd& points, std::vector<int> group, const Eigen::VectorXd& removed);

  /// Says whether point i lies far from the others: draws for its place return it unchanged.
  bool far(std::size_t i) const { return far_[i]; }
  /// Draws a point [d] for the place of point i, around the mean of its group.
  /// @param uniform  in (0, 1): whose deviation it is near  @param normals  [d] standard normals
  Eigen::VectorXd draw(std::size_t i, double uniform, const Eigen::VectorXd& normals) const;

 private:
  Eigen::MatrixXd points_, mean_;  // mean_ [groups x d]
  std::vector<int> group_;
  std::vector<char> far_;
  std::vector<std::size_t> near_;
  Eigen::MatrixXd turn_, kernel_;  // [d x d] of a deviation of the sample, and of the normals
};

/// Draws the sample that a distribution may be known by instead, given these points of it. A bootstrap scatters around
/// the points as they scatter around the distribution; what the distribution may be lies on the other side of them.
/// The points are moved and stretched so that their mean and, in units of their own, their covariance differ from what
/// they are as the bootstrap's do, the other way round. Of normal points the variance in any one
/// direction then has its posterior up to the order 1 / n (Gelman et al., Bayesian Data Analysis, 3rd ed.,
/// section 3.6). Where they are too few for a covariance, it is the bootstrap. Points far from all others are drawn as
/// they are, as often as the bootstrap has them.
/// @param points, group  as SmoothSample's  @param uniforms  [n] in (0, 1): whose place it takes, within its group
/// @return [n x d]
Eigen::MatrixXd reflected_bootstrap(const Eigen::MatrixXd& points, const std::vector<int>& group,
                                    std::span<const double> uniforms);

}  // namespace metastable::analysis
