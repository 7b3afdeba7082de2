#pragma once
// Finds the frictions at which a collision under `published` loses a given energy, for many restitutions at once.

#include <array>
#include <cstddef>

namespace metastable::dynamics {

/// Describes one collision under `published` that ends at one omega+. In units of M v0^2 r^2 / 2 its loss is
/// [alpha D + (beta + delta D) mu (c mu - b)] / D^2 with D = a - b mu, alpha = 1 - kept eta^2, beta = (1 + eta)^2 and
/// delta = pull (1 + eta) time s(eta).
struct PublishedLoss {
  double a = 0, b = 0, c = 0;
  double loss = 0;            ///< that is seen
  double kept = 1;            ///< share of the rebound that is not lost
  double pull = 0;            ///< of gravity while the foot is in contact
  double time = 0;            ///< half period of the contact [s]
  double usual_friction = 0;  ///< mu where the small term with delta is put into beta
};

/// Holds restitutions, and for each the frictions that lose as much. Those above the upper root lose more, and so do
/// those below the lower one.
struct FrictionRoots {
  static constexpr std::size_t most = 64;
  std::array<double, most> restitution, duration;  ///< eta in [0, 1]; s(eta), in half periods
  std::array<double, most> discriminant;           ///< not positive: every friction loses more
  std::array<double, most> upper, upper_rate;      ///< mu, and by how much it changes with the loss
  std::array<double, most> lower, lower_rate;      ///< likewise; lower is 0 where there is none
};

/// Fills in all but restitution and duration. Roots are those of the quadratic without the small term, after one Newton
/// step for what it leaves out. @param count  0 .. most
void find_friction_roots(const PublishedLoss& loss, FrictionRoots& roots, std::size_t count);

}  // namespace metastable::dynamics
