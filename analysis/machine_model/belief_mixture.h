#pragma once
// The probability distribution of a machine's state given what was measured: a mixture of normals, which each measured
// value updates.

#include <Eigen/Core>
#include <array>
#include <span>
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
    /// The state is a linear part, whose mean and covariance stand above, plus 1/2 b0 u^2 + 1/2 b1 v^2 + b2 u v, with u
    /// and v the last `bent` numbers of the vector. Columns of one row that the same noise moves are then consistent.
    int bent = 0;  ///< 0, 1 or 2
    std::array<BeliefVector<Most>, 3> bends = {};

    /// A place on the bend: the means of u and v, and their covariance.
    struct Place {
      Eigen::Vector2d around;
      Eigen::Matrix2d left;
    };
    Place place() const;
    /// Returns a normal that is not bent: linear about a place, with the variance that the bend has there.
    Part straightened(const Place& place) const;
  };

  std::vector<Part>& parts() { return parts_; }
  /// Adds a part for each width with the mixture's own mean and covariance, around which values scatter so many times
  /// as far and which they do not update. These parts have the share together, alike; the weights of the others are
  /// scaled down by it.
  void add_wild(double share, std::span<const double> widths);
  /// Adds the parts of another mixture, with this share of the whole.
  void add(BeliefMixture other, double share);
  /// Makes bent parts straight about where a row's values leave them. Call it before they are seen.
  void straighten(std::span<const Look<Most>> looks, std::span<const double> values);
  /// Updates the mixture by a measured value (Bayes's rule); the weights then add up to 1.
  /// @param failed  probability that the machine failed instead: it counts as a value below all
  SeenValue see(const Look<Most>& look, double value, double failed);
  /// Returns the one normal with the mixture's mean and covariance.
  Part collapsed() const;

 private:
  static double updated(Part& part, std::span<const Look<Most>> looks, std::span<const double> values);
  double log_mass() const;

  std::vector<Part> parts_;
};

}  // namespace metastable::analysis
