#include "dynamics/wheel/published_law.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace metastable::dynamics {
namespace {

// Returns inverse masses of the contact point slipping in direction j = +1 (uphill) or -1 (5).
struct InverseMass {
  double normal;      // 1/m_j [1/kg]
  double tangential;  // mu/n_j [1/kg]: finite also at mu = 0
};

InverseMass inverse_mass(const ContactModel& model, const Collision& c, double friction, double j) {
  const double r2 = c.landing_length * c.landing_length;
  const double x = c.contact_x, y = c.contact_y;
  return {(r2 + x * x + j * friction * x * y) / (model.mass * r2),
          (friction * (r2 + y * y) + j * x * y) / (model.mass * r2)};
}

// Returns T_r (26), (27), with xi eliminated: sqrt(1 - xi^2) = pi / sqrt(pi^2 + ln^2 eta).
double contact_duration(const ContactModel& model, double restitution) {
  const double log_restitution = std::log(std::max(restitution, std::numeric_limits<double>::min()));
  const double stretched = std::sqrt(std::numbers::pi * std::numbers::pi + log_restitution * log_restitution);
  return std::sqrt(model.contact_mass / model.ramp_stiffness) * stretched;
}

}  // namespace

Loss published_loss(const ContactModel& model, const Collision& c, const Contact& contact) {
  const double eta = contact.restitution, mu = contact.friction;
  const double v0 = c.normal_speed, u0 = std::abs(c.tangential_speed);
  const double j = c.tangential_speed < 0 ? -1 : 1;
  const double duration = contact_duration(model, eta);  // T_r

  Loss loss;
  const auto finish = [&](double slip_before, double slip_after) {
    loss.slip_distance = j * (slip_before - slip_after);
    loss.potential = model.mass * model.gravity * loss.slip_distance * std::sin(c.slope);
    return loss;
  };

  // `before` slip stops (the paper's + for u0 > 0); without tangential speed there is no such phase.
  InverseMass before{};
  if (u0 > 0) {
    before = inverse_mass(model, c, mu, j);
    if (!(before.normal > 0)) {
      loss.jammed = true;
      return loss;
    }
    const double impulse = v0 / before.normal;            // P_+
    const double stopping = impulse * before.tangential;  // speed that the impulse P_+ takes off
    loss.zeta = stopping > 0 ? u0 / stopping : std::numeric_limits<double>::infinity();
    if (loss.zeta >= 1 + eta) {  // slip never stops
      loss.tau = 1 + eta;
      loss.normal_pre = v0 * loss.tau * impulse * (2 - loss.tau) / 2;
      const double mean_slip_speed = u0 - stopping * loss.tau / 2;
      loss.tangential_pre = mu * impulse * loss.tau * mean_slip_speed;
      return finish(mu * mean_slip_speed * duration, 0);
    }
    loss.normal_pre = v0 * loss.zeta * impulse * (2 - loss.zeta) / 2;
    loss.tangential_pre = mu * loss.zeta * u0 * impulse / 2;
  }

  const InverseMass after = inverse_mass(model, c, mu, -j);
  if (!(after.normal > 0)) {
    loss.jammed = true;
    return loss;
  }
  const double zeta = loss.zeta;
  const double ratio = u0 > 0 ? after.normal / before.normal : 1;  // P_+/P_-
  const double half_duration = duration / 2;                       // t_r
  double slipping_time = 0;                                        // T_p (28)
  if (zeta <= 1) {
    loss.tau = 1 + eta * std::sqrt((1 - zeta) * (1 - zeta) + zeta * (2 - zeta) * ratio);
    slipping_time = half_duration * zeta;
  } else {
    loss.tau = 1 + std::sqrt((zeta - 1) * (zeta - 1) * (1 - ratio) + eta * eta * ratio);
    slipping_time = half_duration * (1 + (zeta - 1) / eta);
  }
  const double impulse = v0 / after.normal;  // P_-
  const double rest = loss.tau - zeta;
  loss.normal_post = v0 * rest * impulse * (2 - zeta - loss.tau) / 2;
  const double reversed = v0 * mu * after.tangential / after.normal * rest;  // D_t,post / ((tau - zeta) P_- / 2)
  loss.tangential_post = reversed * rest * impulse / 2;
  return finish(mu * u0 * slipping_time / 2, reversed * (duration - slipping_time) / 2);
}

std::vector<double> published_friction_breaks(const Collision& c) {
  const double r2 = c.landing_length * c.landing_length;
  const double x = c.contact_x, y = c.contact_y;
  if (x <= 0) return {std::numeric_limits<double>::infinity()};
  return {x * y / (r2 + y * y), (r2 + x * x) / (x * y)};
}

}  // namespace metastable::dynamics
