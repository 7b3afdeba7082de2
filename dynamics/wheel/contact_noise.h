#pragma once
// Says what restitution and friction are at each collision.

#include <span>
#include <string>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {

/// Holds one collision's contact parameters.
struct Contact {
  double restitution = 0;  ///< eta, energetic, in [0, 1]
  double friction = 0;     ///< mu, >= 0
};

/// Distributes (eta, mu), drawn afresh and independently at every collision.
///
/// Either truncated normals (eta on [0, 1] or less, mu on [0, inf)), joined by a Gaussian copula of the given
/// correlation, or an empirical list of pairs, each equally likely.
class ContactNoise {
 public:
  /// @param correlation of the normal scores of eta and mu, in (-1, 1)
  /// @throws std::invalid_argument as TruncatedNormal, and for a correlation out of range
  /// @param most_restitution upper bound of eta, in (0, 1]
  static ContactNoise normal(double restitution_mean, double restitution_sd, double friction_mean, double friction_sd,
                             double correlation = 0, double most_restitution = 1);
  /// @throws std::invalid_argument for an empty list, eta outside [0, 1] or mu < 0 (with the index)
  static ContactNoise empirical(std::vector<Contact> pairs);

  /// Counts the standard normal scores used by draw(): 2 (normal) or 1 (empirical).
  int dimension() const;
  /// @param score dimension() standard normal scores
  Contact draw(std::span<const double> score) const;
  /// Holds the smallest and largest values possible (mu's upper end is +infinity for a normal with sd > 0).
  struct Support {
    double restitution_lower, restitution_upper, friction_lower, friction_upper;
  };
  Support support() const;

  bool is_empirical() const { return !pairs_.empty(); }
  std::span<const Contact> pairs() const { return pairs_; }
  const TruncatedNormal& restitution() const { return restitution_; }  ///< of the normal form
  const TruncatedNormal& friction() const { return friction_; }
  double correlation() const { return correlation_; }

 private:
  ContactNoise(TruncatedNormal restitution, TruncatedNormal friction, double correlation, std::vector<Contact> pairs);
  TruncatedNormal restitution_, friction_;
  double correlation_ = 0;
  std::vector<Contact> pairs_;
};

}  // namespace metastable::dynamics
