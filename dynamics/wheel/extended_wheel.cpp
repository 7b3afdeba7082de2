#include "dynamics/wheel/extended_wheel.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double reference_speed = 5;  // [rad/s], of speed_dependent_restitution

Wheel changed(Wheel wheel, const Extension& extension) {
  for (std::size_t i = 0; i < wheel.leg_length.size() && i < extension.leg_change.size(); ++i)
    wheel.leg_length[i] += extension.leg_change[i];
  wheel.validate();
  return wheel;
}

}  // namespace

ExtendedWheel::ExtendedWheel(const Wheel& stated, double slope, Law law, const ContactSpread& contact,
                             const Extension& extension)
    : extension_(extension),
      slope_(slope + extension.slope_offset),
      model_(contact_model(stated, extension.law.value_or(law))),
      density_(model_, contact) {
  const Wheel wheel = changed(stated, extension);
  const auto legs = wheel.leg_length.size();
  for (std::size_t k = 0; k < legs; ++k) {
    const double first = wheel.leg_length[(k + legs - 1) % legs], second = wheel.leg_length[k];
    Leg leg;
    leg.triangle = triangle(first, second, wheel.leg_angle());
    leg.length = second;
    // The stated wheel's: legs that differ from the stated lengths do not change what is known of the inertia.
    leg.before = stance_inertia(stated, model_.law, first) * extension.inertia_ratio;
    leg.inertia = stance_inertia(stated, model_.law, second) * extension.inertia_ratio;
    leg.eccentric_phase = -static_cast<double>(k) * wheel.leg_angle();
    const double offset2 = extension.hub_forward * extension.hub_forward + extension.hub_aside * extension.hub_aside;
    if (offset2 > 0) {
      // A centre of mass nearer to the foot or farther from it changes the inertia by parallel axes.
      const auto along = [&](double phase) {  // of the offset, towards the leg
        return extension.hub_forward * std::cos(phase) - extension.hub_aside * std::sin(phase);
      };
      leg.inertia += model_.mass * (offset2 - 2 * second * along(leg.eccentric_phase));
      leg.before += model_.mass * (offset2 - 2 * first * along(leg.eccentric_phase + wheel.leg_angle()));
    }
    geometry_.push_back(leg);
  }
  drag_ = extension.viscous != 0 || extension.rolling != 0 || extension.air != 0;
  profile_ = extension.sag != 0;
}

double ExtendedWheel::local_slope(double position) const {
  if (!profile_) return slope_;
  const Extension& e = extension_;
  const double half = (e.sag_to - e.sag_from) / 2;
  const double t = (position - e.sag_from) / half - 1;  // -1..1 along the stretch
  double change = 0;
  if (std::abs(t) <= 1.05) {
    switch (e.sag_shape) {
      case Extension::Shape::parabola:
        change = -2 * e.sag / half * t;
        break;
      case Extension::Shape::sine:
        change = e.sag * pi / (2 * half) * std::cos(pi / 2 * (t + 1));
        break;
      case Extension::Shape::step:
        change = (t < 0 ? e.sag : -e.sag) / half;
        break;
    }
  }
  return slope_ + change;
}

ExtendedWheel::Path ExtendedWheel::path(const StepContext& context) const {
  const Leg& leg = geometry_[index(context.leg)];
  const Triangle& ahead = geometry_[index(context.leg + 1)].triangle;
  Path p;
  p.start = leg.triangle.beta_second_rad + local_slope(context.position - leg.triangle.chord / 2);
  p.end = pi - (ahead.beta_first_rad - local_slope(context.position + ahead.chord / 2));
  const double weight = 2 * model_.mass * model_.gravity / leg.inertia;
  p.inertia = leg.inertia;
  p.pendulum = weight * leg.length;
  p.gain = p.pendulum * (std::sin(p.start) - std::sin(p.end));
  if (extension_.hub_forward != 0 || extension_.hub_aside != 0) {
    // The centre of mass is L sin(theta) - e sin(theta - phase of the offset from this leg) over the foot.
    const auto height = [&](double theta) {
      const double at = theta - leg.eccentric_phase;
      return extension_.hub_aside * std::cos(at) - extension_.hub_forward * std::sin(at);
    };
    p.gain += weight * (height(p.start) - height(p.end));
  }
  return p;
}

// Returns the omega^2 that the resisting torques take off over the stance.
double ExtendedWheel::work(const Path& p, double omega_plus_squared) const {
  if (!drag_) return 0;
  using Rule = boost::math::quadrature::gauss<double, 7>;
  const auto torque = [&](double squared) {
    squared = std::max(0.0, squared);
    return extension_.rolling + extension_.viscous * std::sqrt(squared) + extension_.air * squared;
  };
  const double slowing = 2 * torque(omega_plus_squared) / p.inertia;  // what the torques have taken off on the way
  const auto along = [&](double theta) {
    return torque(omega_plus_squared + p.pendulum * (std::sin(p.start) - std::sin(theta)) -
                  slowing * (theta - p.start));
  };
  return 2 * Rule::integrate(along, p.start, p.end) / p.inertia;
}

double ExtendedWheel::barrier(const StepContext& context) const {
  const Path p = path(context);
  const Leg& leg = geometry_[index(context.leg)];
  if (p.start >= pi / 2) return 0;
  const double climb = p.pendulum * (1 - std::sin(p.start));
  const double mean = std::sqrt(climb) / 2;
  const double torque = extension_.rolling + extension_.viscous * mean + extension_.air * mean * mean;
  return std::sqrt(climb + 2 * torque * (pi / 2 - p.start) / leg.inertia);
}

std::optional<double> ExtendedWheel::next(const StepContext& context, double omega_plus) const {
  const Path p = path(context);
  const double squared = omega_plus * omega_plus + p.gain - work(p, omega_plus * omega_plus);
  if (!(squared > 0)) return std::nullopt;
  return std::sqrt(squared);
}

std::optional<double> ExtendedWheel::back(const StepContext& context, double omega_next) const {
  const Path p = path(context);
  const double without = omega_next * omega_next - p.gain;
  double squared = without;
  if (drag_)
    for (int i = 0; i < 4; ++i) squared = without + work(p, std::max(0.0, squared));
  if (!(squared > 0)) return std::nullopt;
  return std::sqrt(squared);
}

double ExtendedWheel::duration(const StepContext& context, double omega_plus) const {
  using Rule = boost::math::quadrature::gauss<double, 15>;
  const Path p = path(context);
  const double floor = 1e-3 * omega_plus * omega_plus + 1e-6;
  return Rule::integrate(
      [&](double theta) {
        const double squared = omega_plus * omega_plus + p.pendulum * (std::sin(p.start) - std::sin(theta));
        return 1 / std::sqrt(std::max(floor, squared));
      },
      p.start, p.end);
}

Collision ExtendedWheel::collision(const StepContext& context, double omega) const {
  const Leg& leg = geometry_[index(context.leg)];
  Collision c;
  c.stance_length = geometry_[index(context.leg + legs() - 1)].length;
  c.landing_length = leg.length;
  c.contact_x = leg.triangle.contact_x;
  c.contact_y = leg.triangle.hub_height;
  if (extension_.hub_forward != 0 || extension_.hub_aside != 0) {  // the impulse acts about the centre of mass
    const double at = leg.triangle.beta_second_rad - leg.eccentric_phase;
    c.contact_x -= extension_.hub_forward * std::cos(at) + extension_.hub_aside * std::sin(at);
    c.contact_y += extension_.hub_aside * std::cos(at) - extension_.hub_forward * std::sin(at);
  }
  c.chord = leg.triangle.chord;
  c.normal_speed = leg.triangle.chord * omega;
  c.slope_rad = local_slope(context.position - leg.triangle.chord / 2);
  return c;
}

CollisionChange ExtendedWheel::change(const StepContext& context, double omega) const {
  const Extension& e = extension_;
  CollisionChange change;
  change.friction_shift = context.friction_shift;
  if (omega >= e.hops_from) change.rebound_lost = e.rebound_lost;
  change.friction_ratio = 1 + e.drift * context.run_share;
  if (e.stribeck != 0) change.friction_ratio *= 1 + e.stribeck * std::exp(-omega / e.stribeck_speed);
  if (e.patch_friction != 1 && context.position >= e.patch_from && context.position <= e.patch_to)
    change.friction_ratio *= e.patch_friction;
  if (e.restitution_exponent != 0)
    change.restitution_ratio = std::pow(omega / reference_speed, -e.restitution_exponent);
  if (context.leg == e.leg) {
    change.friction_ratio *= e.leg_friction;
    change.restitution_ratio *= e.leg_restitution;
  }
  if ((e.ring_cosine != 0 || e.ring_sine != 0) && context.since_previous) {
    const double angle = 2 * pi * e.ring_frequency * *context.since_previous;
    change.loss_ratio = std::max(0.05, 1 + e.ring_cosine * std::cos(angle) + e.ring_sine * std::sin(angle));
  }
  change.friction_ratio = std::max(0.02, change.friction_ratio);
  return change;
}

SpeedDensity ExtendedWheel::after_collision(const StepContext& context, double omega, double omega_plus) const {
  const Leg& leg = geometry_[index(context.leg)];
  CollisionChange usual = change(context, omega);
  const Collision at = collision(context, omega);
  SpeedDensity result = density_.at(at, leg.before, leg.inertia, usual, omega_plus);
  if (extension_.outlier_share > 0) {
    usual.friction_ratio *= extension_.outlier_friction;
    const SpeedDensity rare = density_.at(at, leg.before, leg.inertia, usual, omega_plus);
    result.density += extension_.outlier_share * (rare.density - result.density);
    result.below += extension_.outlier_share * (rare.below - result.below);
  }
  return result;
}

std::optional<double> ExtendedWheel::omega_plus(const StepContext& context, double omega, const Contact& drawn,
                                                bool outlier) const {
  const Leg& leg = geometry_[index(context.leg)];
  const CollisionChange c = change(context, omega);
  Contact contact;
  contact.restitution = std::clamp(drawn.restitution * c.restitution_ratio, 0.0, 1.0);
  contact.friction = std::max(0.0, drawn.friction + c.friction_shift) * c.friction_ratio;
  if (outlier) contact.friction *= extension_.outlier_friction;
  const Loss loss = collide(model_, collision(context, omega), contact);
  if (loss.jammed) return std::nullopt;
  double lost = loss.total();
  if (c.rebound_lost > 0) {  // restitution gives back eta^2 of what compression took: v0^2 / 2 times the normal mass
    Contact dead = contact;
    dead.restitution = 0;
    const Loss whole = collide(model_, collision(context, omega), dead);
    lost += c.rebound_lost * contact.restitution * contact.restitution * whole.normal();
  }
  const double squared = (leg.before * omega * omega - 2 * c.loss_ratio * lost) / leg.inertia;
  if (!(squared > 0)) return std::nullopt;
  return std::sqrt(squared);
}

}  // namespace metastable::dynamics
