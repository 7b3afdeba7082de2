#include "dynamics/settled/settled_motion.h"

#include <utility>

#include "dynamics/settled/settled_roll.h"

namespace metastable::dynamics {

SettledMotion::SettledMotion(SettledWheel wheel) : wheel_(std::move(wheel)) {
  wheel_.validate();
  for (int leg = 0; leg < wheel_.legs(); ++leg) foot_.emplace_back(wheel_, leg);
}

const StandingFoot& SettledMotion::foot(int leg) const {
  const int index = leg % wheel_.legs();
  return foot_[static_cast<std::size_t>(index < 0 ? index + wheel_.legs() : index)];
}

Landing SettledMotion::land(int leg, double omega_minus, const Contact& landed, const Contact& old) const {
  return SettledRoll(*this, leg, omega_minus, landed, old).land();
}

std::optional<SlipLeft> SettledMotion::slip_left(int leg, double omega_minus, const Contact& contact,
                                                 int strike) const {
  return SettledRoll(*this, leg, omega_minus, contact, contact).slip_left(strike);
}

Step SettledMotion::step(int leg, double omega_minus, const Contact& landed, const Contact& old) const {
  return SettledRoll(*this, leg, omega_minus, landed, old).step();
}

}  // namespace metastable::dynamics
