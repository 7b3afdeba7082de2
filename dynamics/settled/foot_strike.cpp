#include "dynamics/settled/foot_strike.h"

#include <cmath>
#include <limits>

namespace metastable::dynamics {

PlaneVelocity strike(const ContactLever& lever, const Contact& contact, const PlaneVelocity& before,
                     double* rubbed_off) {
  if (rubbed_off != nullptr) *rubbed_off = 0;
  const double d = lever.behind, h = lever.height, k2 = lever.gyration_sq;
  // The contact's response to an impulse (tangential, normal) per unit mass is [[along, -cross], [-cross, normal]].
  const double along = 1 + h * h / k2, normal = 1 + d * d / k2, cross = d * h / k2;
  const double mu = contact.friction;
  double slip = lever.slip(before), lift = lever.lift(before);
  const auto direction = [&](double speed) {
    if (speed != 0) return speed > 0 ? 1 : -1;
    if (std::abs(cross) <= mu * along) return 0;  // it sticks
    return cross > 0 ? -1 : 1;
  };
  int way = direction(slip);
  // These are per unit of normal impulse: tangential impulse, gain of lift and of slip.
  double drag = 0, rise = 0, drive = 0;
  const auto set_rates = [&] {
    drag = way == 0 ? cross / along : -way * mu;
    rise = normal - cross * drag;
    drive = way == 0 ? 0 : along * drag - cross;
  };
  set_rates();
  constexpr double rounding = 1e-12;  // [m/s], of the lift of a foot that slides on the plane
  if (rise < 0 ? lift > rounding : lift >= 0) return before;
  if (lift > 0) lift = 0;
  constexpr double never = std::numeric_limits<double>::infinity();
  double pressed = 0, rubbed = 0;
  double left = 0;  // of the work, per unit mass: taken by compression, then still to be given back
  bool compressing = true;
  for (;;) {
    const double stop = way * drive < 0 ? -slip / drive : never;
    double phase = never;
    if (compressing)
      phase = rise > 0 ? -lift / rise : never;
    else
      phase = 2 * left / (lift + std::sqrt(lift * lift + 2 * rise * left));
    if (!(left > 0) && !compressing) phase = 0;
    const double part = stop < phase ? stop : phase;
    const double work = part * (lift + rise * part / 2);
    pressed += part;
    rubbed += drag * part;
    if (rubbed_off != nullptr) *rubbed_off -= drag * part * (slip + drive * part / 2);
    lift += rise * part;
    slip += drive * part;
    left -= work;
    if (stop < phase) {
      slip = 0;
      way = direction(slip);
      set_rates();
    } else if (compressing) {
      compressing = false;
      lift = 0;
      left *= contact.restitution * contact.restitution;
    } else {
      break;
    }
  }
  return {before.along + rubbed, before.out + pressed, before.spin + (d * pressed - h * rubbed) / k2};
}

SlipLeft slip_left(const ContactLever& lever, const Contact& contact, const PlaneVelocity& before) {
  const double slip = lever.slip(before), d = lever.behind, h = lever.height, k2 = lever.gyration_sq;
  if (slip <= 0) return {slip, slip};
  const double rise = 1 + d * d / k2 + contact.friction * d * h / k2;
  const double drive = -contact.friction * (1 + h * h / k2) - d * h / k2;
  if (rise <= 0) return {-slip, -slip};  // it jams
  const double compression = -lever.lift(before) / rise;
  return {slip + drive * compression, slip + drive * compression * (1 + contact.restitution)};
}

}  // namespace metastable::dynamics
