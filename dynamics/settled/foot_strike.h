#pragma once
// One foot of a rigid body strikes the plane here: Stronge's energetic impact with slip, slip stop, stick, reversal,
// jam.

#include "dynamics/wheel/contact_noise.h"

namespace metastable::dynamics {

/// Holds the plane motion of the wheel's hub [m/s] and its spin [rad/s], positive as it rolls down the plane.
struct PlaneVelocity {
  double along = 0;  ///< of the hub, down the plane
  double out = 0;    ///< of the hub, out of the plane
  double spin = 0;
};

/// Says where the contact lies as seen from the hub.
struct ContactLever {
  double behind = 0;       ///< of the hub ahead of the contact point [m]: negative at a landing
  double height = 0;       ///< of the hub over the contact point [m], > 0
  double gyration_sq = 0;  ///< J / M [m^2], > 0

  /// Return the speed of the body's point in contact, down the plane and out of it [m/s].
  double slip(const PlaneVelocity& v) const { return v.along - v.spin * height; }
  double lift(const PlaneVelocity& v) const { return v.out + v.spin * behind; }
};

/// Returns the velocity after the foot has struck. Slip keeps its direction until it stops; then the foot sticks where
/// the friction cone allows it and is driven the other way where not. Restitution gives back eta^2 of the work that
/// compression took (Stronge, Proc. R. Soc. A 431, 1990): no eta, mu raises the energy. A foot that slides without
/// approaching (lift 0) and jams (Painleve: pressing makes it dig in) is struck, too; any other foot that does not
/// approach keeps its velocity.
/// @param contact eta in [0, 1], mu >= 0. O(1): at most four pieces of constant slip direction.
/// @param rubbed_off if given: set to the work that friction took per unit mass [m^2/s^2]
PlaneVelocity strike(const ContactLever& lever, const Contact& contact, const PlaneVelocity& before,
                     double* rubbed_off = nullptr);

/// The slip down the plane that a foot would have left at the end of its compression and of the whole impact if
/// friction held against it without an end [m/s]: below 0 it stops before. Smooth in mu and eta.
struct SlipLeft {
  double compressed = 0, struck = 0;
};
/// @param before of a foot that approaches; if it does not slip down the plane, both are the slip that it has
SlipLeft slip_left(const ContactLever& lever, const Contact& contact, const PlaneVelocity& before);

}  // namespace metastable::dynamics
