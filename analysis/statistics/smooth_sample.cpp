#include "analysis/statistics/smooth_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "analysis/statistics/median.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double farthest = 6;           // from the median, in sds by the median deviation
constexpr double least_of_normal = 0.5;  // of the width that a normal sample asks for, the least
constexpr double width_step = 0.85, least_density = 1e-100;
constexpr double least_kept = 0.05;       // of a variance in a bootstrap: few points may have less by repetition
constexpr double resolved_spread = 1e-9;  // of the largest: directions with less have none

// Returns the root of a symmetric matrix, or of its pseudo-inverse; what is negative counts as zero.
Eigen::MatrixXd root(const Eigen::MatrixXd& matrix, bool inverse) {
  const markov::SymmetricEigen split = markov::symmetric_eigen(matrix);
  const double least = resolved_spread * std::max(0.0, split.values.maxCoeff());
  Eigen::VectorXd of = split.values;
  for (double& value : of) value = value <= least ? 0 : inverse ? 1 / std::sqrt(value) : std::sqrt(value);
  return split.vectors * of.asDiagonal() * split.vectors.transpose();
}

// Says which points lie far from the median of all in some coordinate.
std::vector<char> far_points(const Eigen::MatrixXd& points) {
  std::vector<char> far(static_cast<std::size_t>(points.rows()), 0);
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    std::vector<double> values(points.col(j).begin(), points.col(j).end());
    const double middle = median(values);
    for (double& value : values) value = std::abs(value - middle);
    const double sd = median_deviation_to_sd * median(values);
    for (std::size_t i = 0; sd > 0 && i < values.size(); ++i) far[i] = far[i] || values[i] > farthest * sd;
  }
  return far;
}

// The points that are not far off, the means of their groups, and how they deviate from these. Coordinates have units
// of their own: their spreads are compared in those of the sample.
struct Scatter {
  std::vector<std::size_t> near;
  Eigen::MatrixXd mean;        // [groups x d]
  Eigen::VectorXd unit;        // [d]
  Eigen::MatrixXd covariance;  // [d x d] in those units
  double known = 0;            // degrees of freedom of the covariance

  // Turns deviations into those of unit covariance.
  Eigen::MatrixXd white() const { return root(covariance, true) * unit.cwiseInverse().asDiagonal(); }
};

Scatter scatter_of(const Eigen::MatrixXd& points, const std::vector<int>& group, const std::vector<char>& far) {
  Scatter s;
  for (std::size_t i = 0; i < group.size(); ++i)
    if (!far[i]) s.near.push_back(i);
  const int groups = 1 + *std::ranges::max_element(group);
  s.mean = Eigen::MatrixXd::Zero(groups, points.cols());
  s.covariance = Eigen::MatrixXd::Zero(points.cols(), points.cols());
  Eigen::VectorXd count = Eigen::VectorXd::Zero(groups);
  for (const std::size_t i : s.near) {
    s.mean.row(group[i]) += points.row(static_cast<Eigen::Index>(i));
    ++count[group[i]];
  }
  for (Eigen::Index g = 0; g < groups; ++g) s.mean.row(g) /= std::max(1.0, count[g]);
  for (const std::size_t i : s.near) {
    const Eigen::RowVectorXd off = points.row(static_cast<Eigen::Index>(i)) - s.mean.row(group[i]);
    s.covariance += off.transpose() * off;
  }
  s.known = static_cast<double>(s.near.size()) - (count.array() > 0).cast<double>().sum();
  s.covariance /= std::max(1.0, s.known);
  s.unit = s.covariance.diagonal().cwiseSqrt();
  for (double& one : s.unit) one = one > 0 ? one : 1;
  s.covariance = s.unit.cwiseInverse().asDiagonal() * s.covariance * s.unit.cwiseInverse().asDiagonal();
  return s;
}

// Returns the width of the kernel, in units of the sample's spread, under which points are likeliest from all others
// (likelihood cross-validation; Silverman, section 3.4.4). @param deviations  [n x d] of unit covariance; equal ones,
//   as a bootstrap has, do not tell of one another
double likeliest_width(const Eigen::MatrixXd& deviations) {
  const auto n = static_cast<double>(deviations.rows()), d = static_cast<double>(deviations.cols());
  const double normal = std::min(1.0, std::pow(4 / ((d + 2) * n), 1 / (d + 4)));  // Silverman, section 4.3.2
  double best = 1, most = -std::numeric_limits<double>::infinity();
  for (double width = 1; width >= least_of_normal * normal; width *= width_step) {
    const double kept = std::sqrt(1 - width * width);
    double total = 0;
    for (Eigen::Index i = 0; i < deviations.rows(); ++i) {
      double density = least_density;
      for (Eigen::Index j = 0; j < deviations.rows(); ++j)
        if (deviations.row(j) != deviations.row(i))
          density += std::exp(-0.5 * (deviations.row(i) - kept * deviations.row(j)).squaredNorm() / (width * width));
      total += std::log(density) - d * std::log(width);
    }
    if (total > most) most = total, best = width;
  }
  return best;
}

}  // namespace

SmoothSample::SmoothSample(const Eigen::MatrixXd& points, std::vector<int> group, const Eigen::VectorXd& removed)
    : points_(points), group_(std::move(group)), far_(far_points(points)) {
  const Eigen::Index d = points.cols();
  if (d < 1 || points.rows() < 1 || static_cast<std::size_t>(points.rows()) != group_.size() || removed.size() != d)
    throw std::invalid_argument("SmoothSample: points, groups and variances differ in number");
  const Scatter scatter = scatter_of(points_, group_, far_);
  near_ = scatter.near;
  mean_ = scatter.mean;
  Eigen::MatrixXd left = scatter.covariance;
  left.diagonal() -= removed.cwiseQuotient(scatter.unit.cwiseAbs2());
  const Eigen::MatrixXd white = scatter.white();
  Eigen::MatrixXd deviations(static_cast<Eigen::Index>(near_.size()), d);
  for (std::size_t k = 0; k < near_.size(); ++k)
    deviations.row(static_cast<Eigen::Index>(k)) =
        (points_.row(static_cast<Eigen::Index>(near_[k])) - mean_.row(group_[near_[k]])) * white.transpose();
  const double width = likeliest_width(deviations);
  const Eigen::MatrixXd spread = scatter.unit.asDiagonal() * root(left, false);
  turn_ = std::sqrt(1 - width * width) * spread * white;
  kernel_ = width * spread;
}

Eigen::VectorXd SmoothSample::draw(std::size_t i, double uniform, const Eigen::VectorXd& normals) const {
  if (far_[i]) return points_.row(static_cast<Eigen::Index>(i));
  const auto at = std::min(near_.size() - 1, static_cast<std::size_t>(uniform * static_cast<double>(near_.size())));
  const auto like = static_cast<Eigen::Index>(near_[at]);
  const Eigen::VectorXd off = points_.row(like) - mean_.row(group_[near_[at]]);
  return mean_.row(group_[i]).transpose() + turn_ * off + kernel_ * normals;
}

Eigen::MatrixXd reflected_bootstrap(const Eigen::MatrixXd& points, const std::vector<int>& group,
                                    std::span<const double> uniforms) {
  std::vector<std::vector<std::size_t>> members(static_cast<std::size_t>(1 + *std::ranges::max_element(group)));
  for (std::size_t i = 0; i < group.size(); ++i) members[static_cast<std::size_t>(group[i])].push_back(i);
  const std::vector<char> far = far_points(points);
  Eigen::MatrixXd again(points.rows(), points.cols()), drawn = points;
  std::vector<char> again_far(far.size());
  for (std::size_t i = 0; i < group.size(); ++i) {
    const std::vector<std::size_t>& of = members[static_cast<std::size_t>(group[i])];
    const std::size_t like =
        of[std::min(of.size() - 1, static_cast<std::size_t>(uniforms[i] * static_cast<double>(of.size())))];
    const auto row = static_cast<Eigen::Index>(i);
    again.row(row) = points.row(static_cast<Eigen::Index>(like));
    again_far[i] = far[like];
    if (far[i] || far[like]) drawn.row(row) = again.row(row);
  }
  const Scatter was = scatter_of(points, group, far), is = scatter_of(again, group, again_far);
  if (!(std::min(was.known, is.known) > static_cast<double>(points.cols()))) return again;
  const Eigen::MatrixXd white = was.white(), back = was.unit.asDiagonal() * root(was.covariance, false),
                        of_unit = white * is.unit.asDiagonal();
  const markov::SymmetricEigen split = markov::symmetric_eigen(of_unit * is.covariance * of_unit.transpose());
  // The inverse of a covariance of d numbers is too large, by as much as d - 1 degrees of freedom are fewer.
  const double unbiased = 1 - static_cast<double>(points.cols() - 1) / is.known;
  Eigen::VectorXd of = split.values;
  for (double& value : of) value = std::sqrt(unbiased / std::max(value, least_kept));
  const Eigen::MatrixXd turn = back * split.vectors * of.asDiagonal() * split.vectors.transpose() * white;
  for (const std::size_t i : is.near) {
    const Eigen::RowVectorXd mean = was.mean.row(group[i]);
    const auto row = static_cast<Eigen::Index>(i);
    drawn.row(row) = 2 * mean - is.mean.row(group[i]) + (drawn.row(row) - mean) * turn.transpose();
  }
  return drawn;
}

}  // namespace metastable::analysis
