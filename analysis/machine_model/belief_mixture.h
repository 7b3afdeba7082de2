#pragma once
// The probability distribution of a machine's state given what was measured: a mixture of normals, which each measured
// value updates.

#include <Eigen/Core>
#include <vector>

namespace metastable::analysis {

/// Vectors and matrices of at most `Most` rows, which need no memory of their own; Eigen::Dynamic: of any size.
template <int Most>
using BeliefVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Most, 1>;
template <int Most>
using BeliefMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Most, Most>;

/// The size up to which beliefs need no memory of their own.
inline constexpr int small_belief = 8;

/// A measured value as a linear function of the state: its weights, its offset, and the variance of its error.
template <int Most>
struct Look {
  BeliefVector<Most> weights;
  double offset = 0;  ///< added to the weighted state
  double variance = 0;
};

inline constexpr double least_log_density = -1e5;  ///< of a value beyond reach
inline constexpr double farthest_score = 37;       ///< probabilities beyond it are no doubles

/// The density of a measured value under the mixture, and its place in the distribution.
struct SeenValue {
  double log_density = 0;
  double score = 0;  ///< normal score of its probability integral transform
  double unit = 1;   ///< change of the value per unit of score, there
};

/// A mixture of normals whose weights add up to the probability that the machine has not failed.
template <int Most>
class BeliefMixture {
 public:
  struct Part {
    double log_weight = 0;
    BeliefVector<Most> mean;
    BeliefMatrix<Most> covariance;
    double width = 1;  ///< above 1: values scatter this many times as far, and do not update this part
  };

  std::vector<Part>& parts() { return parts_; }
  /// Adds a part of this share in which the state, the first `states` numbers, has `width` times the spread.
  void add_outlier(double share, double width, Eigen::Index states);
  /// Adds a part of this share with the mixture's own mean and covariance, around which values scatter `width` times as
  /// far and which they do not update. The weights of the other parts are scaled down by the share.
  void add_wild(double share, double width);
  /// Updates the mixture by a measured value (Bayes's rule); the weights then add up to 1.
  /// @param failed  probability that the machine failed instead: it counts as a value below all
  SeenValue see(const Look<Most>& look, double value, double failed);
  /// Returns the one normal with the mixture's mean and covariance.
  Part collapsed() const;

 private:
  double log_mass() const;
  Part& give_way(double share);

  std::vector<Part> parts_;
};

}  // namespace metastable::analysis
