#pragma once
// Integrates one collision over its normal impulse, as the laboratory's counterpart of the contact laws.

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {

/// A body that is about to hit a surface with one point. "Along" is down the ramp, "up" is out of the surface.
struct Impact {
  Law law = Law::published;  ///< published or coulomb
  double mass = 0;           ///< [kg]
  double gyration = 0;       ///< radius of gyration about the centre of mass that the contact sees [m], > 0
  double behind = 0;         ///< centre of mass uphill of the contact point [m]
  double above = 0;          ///< centre of mass above it [m]
  double approach = 0;       ///< speed of the contact point into the surface [m/s], > 0
  double along = 0;          ///< its speed down the ramp [m/s]
  double restitution = 0;    ///< eta, energetic
  double friction = 0;       ///< mu
  double slope_rad = 0;      ///< of the surface [rad]; published
  double gravity = 9.81;     ///< [m/s^2]; published
  double stiffness = 9000;   ///< of the ramp [N/m]; published
  double contact_mass = 0;   ///< in the Kelvin-Voigt contact [kg]; published
};

/// Says what it costs [J].
struct ImpactWork {
  double normal = 0;     ///< absorbed less given back
  double released = 0;   ///< given back by restitution
  double friction = 0;   ///< charged to friction
  double potential = 0;  ///< gained by sliding uphill during contact; published
  bool jammed = false;   ///< the point digs in; the works cover only what went before
  double total() const { return normal + friction - potential; }
};

/// Marches normal and tangential speed and the works along the normal impulse by Runge-Kutta steps, with slip stop, end
/// of compression and end of restitution (eta^2 of the absorbed normal work is given back) found as events.
///
///   coulomb    when slip stops the point sticks if the friction cone allows it, else it slides the way it is driven
///   published  when slip stops it reverses and slides on, whatever the cone says, and friction is charged for its
///              impulse as (4)-(34) are printed; slide distances take their time from the Kelvin-Voigt ramp
///
/// Relative error about 1e-10. Some 100 Runge-Kutta steps of four numbers.
ImpactWork integrate_impact(const Impact& impact);

/// Returns the time a Kelvin-Voigt contact of restitution eta is closed [s]: the damped oscillator integrated until it
/// is back at zero. @param stiffness [N/m], mass [kg], restitution in [0, 1] (read as at least 2.2e-308)
double closed_time(double stiffness, double mass, double restitution);

}  // namespace metastable::dynamics
