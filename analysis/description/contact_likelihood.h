#pragma once
// Evaluates the likelihood of (eta, mu) distributions for many parameters: the geometry is worked out once.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/description/curve_moments.h"
#include "analysis/description/landings.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {

/// Holds mean and sd of eta, then of mu: eta ~ N(mean, sd^2) on [0, 1] and mu ~ N(mean, sd^2) on [0, inf), independent.
using ContactParameters = std::array<double, 4>;

/// The (eta, mu) that lead from a state to its landing form a curve, which does not depend on how eta and mu are
/// distributed. The density of the landing is the integral of f(eta) f(mu) / |grad x'| along it; the probability of
/// rest, that of the region below the barrier. Curves are found once, on triangles of a grid over [0, 1] x [0, 3]
/// (spacing 1/160 up to mu = 0.9, a line of it on the law's kink); a likelihood is then a sum over their pieces. Good
/// to about 1e-3 of a density for sds of 0.01 and more (dynamics/return_map/landing_density.h is the exact form); too
/// low where eta is left in less than a column by a mean beyond [0, 1], which a wider sd describes as well.
class ContactLikelihood {
 public:
  /// @param maps  one a condition of the transitions; their noise does not matter
  /// O(transitions x 60000), once
  ContactLikelihood(const std::vector<dynamics::WheelMap>& maps, std::span<const MeasuredLanding> transitions,
                    int threads);

  /// Sums ln density of the landings [1/(rad^2/s^2)] and ln probability of rest or survival. -infinity where one of
  /// them vanishes. Fills `gradient`, if given, with the derivatives by the parameters (NaN where it is infinite).
  double operator()(const ContactParameters& parameters, ContactParameters* gradient = nullptr) const;

  /// Count the transitions that some eta and mu can lead to, and how many others there are.
  std::size_t possible() const { return possible_.size(); }
  std::size_t possible_rests() const { return rests_; }
  std::size_t impossible() const { return impossible_; }

 private:
  /// Holds a region's column of eta, and mu from and to.
  struct Piece {
    double friction, friction_to;
    std::size_t column;
  };
  /// One transition: the curve that leads to its landing, its points weighted by length / |grad x'|, or the region that
  /// rests.
  struct Observed {
    bool landing, rested;
    CurvePoints curve;
    std::vector<Piece> pieces;
  };
  /// Holds a probability or density, and its logarithm's derivatives.
  struct Value {
    double value = 0;
    ContactParameters slope{};
  };
  struct Surface;
  class LevelCurve;
  static std::vector<Piece> region_of_rest(const Surface& surface, const std::vector<double>& after, double barrier);
  void keep_possible(std::vector<Observed> all);
  /// The density takes normals that are not truncated.
  static Value density(const Observed& observed, const ContactParameters& parameters);
  /// Holds the weight of one eta of the grid, and its derivatives by eta's mean and sd.
  using ColumnWeight = std::array<double, 3>;
  static std::vector<ColumnWeight> column_weights(const dynamics::TruncatedNormal& restitution);
  static Value rest(const Observed& observed, const std::vector<ColumnWeight>& weights,
                    const dynamics::TruncatedNormal& friction, const ContactParameters& parameters,
                    const ContactParameters& truncation);

  std::vector<Observed> possible_;
  std::size_t rests_ = 0, impossible_ = 0;
  int threads_ = 0;
};

}  // namespace metastable::analysis
