#pragma once
// Gives the density of the speed just after one collision, fast enough for likelihoods of whole experiments.

#include <array>
#include <vector>

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

/// Holds independent truncated normals: eta on [0, 1], mu on [0, inf); means and sds are those before truncation.
struct ContactSpread {
  double restitution_mean = 0.4;
  double restitution_sd = 0.1;  ///< > 0
  double friction_mean = 0.4;
  double friction_sd = 0.1;  ///< > 0
};

/// Says how one collision differs from what the law and the contact's distribution say.
struct CollisionChange {
  double friction_ratio = 1;     ///< multiplies the mu drawn, > 0
  double friction_shift = 0;     ///< added to the mean of mu
  double friction_scatter = 1;   ///< multiplies the deviation of mu from its mean, > 0
  double restitution_ratio = 1;  ///< multiplies the eta drawn (held at 1 where it would pass), > 0
  double loss_ratio = 1;         ///< multiplies the energy lost, > 0
  double rebound_lost = 0;       ///< share of the energy given back by restitution that is lost as well, in [0, 1]
};

/// Holds density and distribution function of omega+ at one value.
struct SpeedDensity {
  double density = 0;  ///< [s/rad]
  double below = 0;    ///< P(omega+ <= that value), rest included
};

/// Gives the density of omega+ just after a collision of a rolling wheel (u0 = 0) with random (eta, mu).
///
/// Under `published` it is a sum over eta with mu in closed form (the root of (18)-(34) in mu): trapezoidal in the
/// normal score, Gauss-Legendre where truncation, the least restitution that can lose so little, or the one that does
/// without friction cuts inside 4.6 sds. Error below 4e-4 of the peak while mu's mean is four sds above 0, below 2e-3
/// where it is nearer: smooth enough in every parameter for a likelihood of thousands of collisions to be climbed. One
/// value costs about a microsecond, some where friction reaches 0.
///
/// Under `coulomb` it is a sum over mu < mu_c with eta in closed form, the sticking collisions (mu >= mu_c) being one
/// term: Gauss-Legendre from break to break, which are the frictions at which the largest loss of all restitutions is
/// the one that was lost (there the density of a single friction is an inverse square root) and those at which eta
/// passes 0 or 1. Error below 1e-4 of the peak; one value costs some 4 microseconds. Where the truncated eta reaches 0
/// the density itself has an integrable pole, at the loss of a sticking foot that does not spring: it is made as high
/// as at eta = 0.03 and no higher, lest a likelihood has no bound.
///
/// LandingDensity is the exact, slower way.
class CollisionDensity {
 public:
  /// @throws std::invalid_argument for `plastic`, which has neither eta nor mu, and for sds <= 0
  CollisionDensity(const ContactModel& model, const ContactSpread& contact);

  /// @param collision  geometry and speed just before; tangential_speed is taken as 0
  /// @param before, after  inertia about the stance foot and about the landing foot [kg m^2]
  /// @param speed  omega+ [rad/s]
  SpeedDensity at(const Collision& collision, double before, double after, const CollisionChange& change,
                  double speed) const;

 private:
  struct Node {
    double restitution, weight;
    double duration;  // of the contact, in units of the half period sqrt(m_c/K_r) (26), (27)
  };
  SpeedDensity published(const Collision& collision, double before, double after, const CollisionChange& change,
                         double speed) const;
  SpeedDensity coulomb(const Collision& collision, double before, double after, const CollisionChange& change,
                       double speed) const;

  ContactModel model_;
  ContactSpread contact_;
  std::array<std::vector<Node>, 5> nodes_;  // published: restitutions, each level half as far apart
  double restitution_mass_ = 1;             // of the untruncated normal in [0, 1]
};

}  // namespace metastable::dynamics
