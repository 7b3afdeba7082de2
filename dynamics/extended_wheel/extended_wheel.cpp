#include "dynamics/extended_wheel/extended_wheel.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double reference_speed = 5;         // [rad/s], of speed_dependent_restitution
constexpr double usual_slope = 8 * pi / 180;  // [rad], about which the error of `settled` may tilt

Wheel changed(Wheel wheel, const std::vector<double>& leg_change) {
  for (std::size_t i = 0; i < wheel.leg_length.size() && i < leg_change.size(); ++i)
    wheel.leg_length[i] += leg_change[i];
  wheel.validate();
  return wheel;
}

}  // namespace

ExtendedWheel::ExtendedWheel(const Wheel& stated, double slope, Law law, const ContactSpread& contact,
                             const Extension& extension, std::shared_ptr<const LandingShares> landings)
    : extension_(extension),
      slope_(slope + extension.geometry.slope_offset_rad),
      model_(contact_model(stated, extension.contact.law.value_or(law))),
      contact_(contact),
      density_(certain() ? std::nullopt : std::optional<CollisionDensity>(std::in_place, model_, contact)),
      landings_(std::move(landings)) {
  Wheel wheel = changed(stated, extension.geometry.leg_change);
  if (model_.law == Law::settled) {  // feet are discs about points that much nearer to the hub
    tip_radius_ = stated.tip_radius;
    for (double& length : wheel.leg_length) length -= tip_radius_;
  }
  for (std::size_t k = 0; k < wheel.leg_length.size(); ++k) geometry_.push_back(leg_of(stated, wheel, k));
  const Extension::Torques& torques = extension.torques;
  drag_ = torques.viscous != 0 || torques.rolling != 0 || torques.air != 0;
  profile_ = extension.geometry.sag != 0;
  if (!settles()) return;
  if (extension.contact.softness > 0) soft_.emplace(extension.contact.softness, contact.restitution_mean);
  hold_against_stated(ExtendedWheel(stated, slope, law, contact, Extension{}));
  read_landings_at_own_inertia();
}

// Returns what a leg is before anything is known of its landings. @param wheel  with the changed lengths
ExtendedWheel::Leg ExtendedWheel::leg_of(const Wheel& stated, const Wheel& wheel, std::size_t k) const {
  const Extension::Geometry& geometry = extension_.geometry;
  const auto legs = wheel.leg_length.size();
  const double first = wheel.leg_length[(k + legs - 1) % legs], second = wheel.leg_length[k];
  Leg leg;
  leg.triangle = triangle(first, second, wheel.leg_angle());
  leg.length = second;
  // This is the stated wheel's: legs that differ from the stated lengths do not change what is known of the inertia.
  leg.before = stance_inertia(stated, model_.law, first);
  leg.inertia = stance_inertia(stated, model_.law, second);
  if (model_.law == Law::settled) {
    const double hub = model_.mass * model_.radius_of_gyration * model_.radius_of_gyration;
    const double height = leg.triangle.hub_height + tip_radius_;
    const double ahead = leg.triangle.contact_x, behind = leg.triangle.chord - ahead;
    leg.before = hub * geometry.hub_inertia_ratio + model_.mass * (behind * behind + height * height);
    leg.inertia = hub * geometry.hub_inertia_ratio + model_.mass * (ahead * ahead + height * height);
  }
  leg.before *= geometry.inertia_ratio;
  leg.inertia *= geometry.inertia_ratio;
  leg.eccentric_phase = -static_cast<double>(k) * wheel.leg_angle();
  const double offset2 = geometry.hub_forward * geometry.hub_forward + geometry.hub_aside * geometry.hub_aside;
  if (offset2 > 0) {
    // A centre of mass nearer to the foot or farther from it changes the inertia by parallel axes.
    const auto along = [&](double phase) {  // of the offset, towards the leg
      return geometry.hub_forward * std::cos(phase) - geometry.hub_aside * std::sin(phase);
    };
    leg.inertia += model_.mass * (offset2 - 2 * second * along(leg.eccentric_phase));
    leg.before += model_.mass * (offset2 - 2 * first * along(leg.eccentric_phase + wheel.leg_angle()));
  }
  return leg;
}

// Stores for each leg the stated wheel's gain and barrier, how much more the torques take off a landing than off a
// standing foot, and by how much they raise the friction below which it rests.
void ExtendedWheel::hold_against_stated(const ExtendedWheel& stated) {
  const Extension::Torques& torques = extension_.torques;
  for (std::size_t k = 0; k < geometry_.size(); ++k) {
    const StepContext here{.leg = static_cast<int>(k)};
    geometry_[k].stated_gain = stated.path(here).gain;
    geometry_[k].stated_barrier = stated.barrier(here);
    const LandingShares::Drag& drag = landings_->legs[k].drag;
    const double standing = work(stated.path(here), drag.carried_squared);
    const double landing = torques.rolling * drag.lost[0] + torques.viscous * drag.lost[1] + torques.air * drag.lost[2];
    if (std::abs(standing) > 0) geometry_[k].drag_ratio = landing / standing;
    geometry_[k].resting_shift =
        torques.rolling * drag.resting[0] + torques.viscous * drag.resting[1] + torques.air * drag.resting[2];
  }
}

// Takes the landings to the wheel's own inertia about its centre of mass, where that is not the grid's.
void ExtendedWheel::read_landings_at_own_inertia() {
  std::vector<double> gyration_sq;
  bool same = true;
  for (std::size_t k = 0; k < geometry_.size(); ++k) {
    const Collision c = collision({.leg = static_cast<int>(k)}, 1);
    gyration_sq.push_back(geometry_[k].inertia / model_.mass - c.contact_x * c.contact_x - c.contact_y * c.contact_y);
    geometry_[k].gyration_sq = gyration_sq.back();
    const double of_grid = landings_->legs[k].gyration_sq;
    same = same && std::abs(gyration_sq.back() - of_grid) <= 1e-9 * of_grid;
  }
  if (!same) landings_ = std::make_shared<const LandingShares>(landings_->of_gyration(gyration_sq));
}

// Returns how deep the surface lies under the plane of the stated slope [m].
double ExtendedWheel::depth(double position) const {
  const Extension::Geometry& ground = extension_.geometry;
  const double half = (ground.sag_to - ground.sag_from) / 2;
  const double t = (position - ground.sag_from) / half - 1;  // -1..1 along the stretch
  if (std::abs(t) >= 1) return 0;
  switch (ground.sag_shape) {
    case Extension::Geometry::Shape::sine:
      return ground.sag * std::cos(pi / 2 * t);
    case Extension::Geometry::Shape::step:
      return ground.sag * (1 - std::abs(t));
    case Extension::Geometry::Shape::parabola:
      break;
  }
  return ground.sag * (1 - t * t);
}

double ExtendedWheel::chord_slope(double from, double to) const {
  if (!profile_) return slope_;
  return slope_ + std::atan((depth(to) - depth(from)) / (to - from));
}

ExtendedWheel::Path ExtendedWheel::path(const StepContext& context) const {
  const Leg& leg = geometry_[index(context.leg)];
  const Triangle& ahead = geometry_[index(context.leg + 1)].triangle;
  Path p;
  p.start = leg.triangle.beta_second_rad + chord_slope(context.position - leg.triangle.chord, context.position);
  p.end = pi - (ahead.beta_first_rad - chord_slope(context.position, context.position + ahead.chord));
  const double weight = 2 * model_.mass * model_.gravity / leg.inertia;
  p.inertia = leg.inertia;
  p.pendulum = weight * leg.length;
  p.gain = p.pendulum * (std::sin(p.start) - std::sin(p.end));
  const Extension::Geometry& geometry = extension_.geometry;
  if (geometry.hub_forward != 0 || geometry.hub_aside != 0) {
    // The centre of mass is L sin(theta) - e sin(theta - phase of the offset from this leg) over the foot.
    const auto height = [&](double theta) {
      const double at = theta - leg.eccentric_phase;
      return geometry.hub_aside * std::cos(at) - geometry.hub_forward * std::sin(at);
    };
    p.gain += weight * (height(p.start) - height(p.end));
  }
  return p;
}

// Returns the omega^2 that the resisting torques take off over the stance.
double ExtendedWheel::work(const Path& p, double omega_plus_squared) const {
  if (!drag_) return 0;
  using Rule = boost::math::quadrature::gauss<double, 7>;
  const Extension::Torques& torques = extension_.torques;
  const auto torque = [&](double squared) {
    squared = std::max(0.0, squared);
    return torques.rolling + torques.viscous * std::sqrt(squared) + torques.air * squared;
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
  const Extension::Torques& torques = extension_.torques;
  const double torque = torques.rolling + torques.viscous * mean + torques.air * mean * mean;
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
  c.contact_y = leg.triangle.hub_height + tip_radius_;
  const Extension::Geometry& geometry = extension_.geometry;
  if (geometry.hub_forward != 0 || geometry.hub_aside != 0) {  // the impulse acts about the centre of mass
    const double at = leg.triangle.beta_second_rad - leg.eccentric_phase;
    c.contact_x -= geometry.hub_forward * std::cos(at) + geometry.hub_aside * std::sin(at);
    c.contact_y += geometry.hub_aside * std::cos(at) - geometry.hub_forward * std::sin(at);
  }
  c.chord = leg.triangle.chord;
  c.normal_speed = leg.triangle.chord * omega;
  c.slope_rad = chord_slope(context.position - leg.triangle.chord, context.position);
  return c;
}

CollisionChange ExtendedWheel::change(const StepContext& context, double omega) const {
  const Extension::ContactChange& e = extension_.contact;
  CollisionChange change;
  change.friction_shift = context.friction_shift;
  change.friction_scatter = context.friction_scatter;
  change.restitution_ratio = context.restitution_ratio;
  if (omega >= e.hops_from) change.rebound_lost = e.rebound_lost;
  change.friction_ratio =
      context.friction_ratio * (1 + e.drift * context.run_share) / extension_.law_error.sticking_ratio;
  if (e.stribeck != 0) change.friction_ratio *= 1 + e.stribeck * std::exp(-omega / e.stribeck_speed);
  if (e.patch_friction != 1 && context.position >= e.patch_from && context.position <= e.patch_to)
    change.friction_ratio *= e.patch_friction;
  if (e.restitution_exponent != 0)
    change.restitution_ratio *= std::pow(omega / reference_speed, -e.restitution_exponent);
  if (context.leg == e.leg) {
    change.friction_ratio *= e.leg_friction;
    change.restitution_ratio *= e.leg_restitution;
  }
  change.loss_ratio += context.loss_added;
  if ((e.ring_cosine != 0 || e.ring_sine != 0) && context.since_previous) {
    const double angle = 2 * pi * e.ring_frequency * *context.since_previous;
    change.loss_ratio += e.ring_cosine * std::cos(angle) + e.ring_sine * std::sin(angle);
  }
  change.loss_ratio = std::max(0.05, change.loss_ratio);
  change.friction_ratio = std::max(0.02, change.friction_ratio);
  return change;
}

SpeedDensity ExtendedWheel::after_collision(const StepContext& context, double omega, double omega_plus) const {
  const Leg& leg = geometry_[index(context.leg)];
  CollisionChange usual = change(context, omega);
  if (settles()) {
    SpeedDensity first =
        after_first_impact(landing(context, omega), this->contact(usual), omega_plus / extension_.law_error.plus_ratio);
    first.density /= extension_.law_error.plus_ratio;
    return first;
  }
  if (certain()) return {0, omega_plus > this->omega_plus(context, omega, {}, false).value_or(0) ? 1.0 : 0.0};
  const Collision at = collision(context, omega);
  SpeedDensity result = density_->at(at, leg.before, leg.inertia, usual, omega_plus);
  if (extension_.contact.outlier_share > 0) {
    usual.friction_ratio *= extension_.contact.outlier_friction;
    const SpeedDensity rare = density_->at(at, leg.before, leg.inertia, usual, omega_plus);
    result.density += extension_.contact.outlier_share * (rare.density - result.density);
    result.below += extension_.contact.outlier_share * (rare.below - result.below);
  }
  return result;
}

Contact ExtendedWheel::changed_contact(const CollisionChange& c, const Contact& drawn, bool outlier) const {
  Contact contact;
  contact.restitution = std::clamp(drawn.restitution * c.restitution_ratio, 0.0, 1.0);
  const double widened = (c.friction_scatter - 1) * (drawn.friction - contact_.friction_mean);
  contact.friction = std::max(0.0, drawn.friction + widened + c.friction_shift) * c.friction_ratio;
  if (outlier) contact.friction *= extension_.contact.outlier_friction;
  return contact;
}

std::optional<double> ExtendedWheel::omega_plus(const StepContext& context, double omega, const Contact& drawn,
                                                bool outlier) const {
  const Leg& leg = geometry_[index(context.leg)];
  const CollisionChange c = change(context, omega);
  const Contact contact = changed_contact(c, drawn, outlier);
  if (settles()) {
    const double plus = extension_.law_error.plus_ratio * omega * landing(context, omega).first_impact(contact);
    return plus > 0 ? std::optional(plus) : std::nullopt;
  }
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

SettledLanding ExtendedWheel::landing(const StepContext& context, double omega) const {
  const Leg& leg = geometry_[index(context.leg)];
  const LandingShares::Leg& stated = landings_->legs[index(context.leg)];
  const Collision c = collision(context, omega);
  const double climb = barrier(context);
  SettledLanding at{.place = landings_->place(static_cast<int>(index(context.leg)), omega)};
  at.omega = omega;
  at.ahead = c.contact_x;
  at.height = c.contact_y;
  at.chord = c.chord;
  at.gyration_sq = leg.gyration_sq;
  at.barrier_squared = stated.barrier_squared + climb * climb - leg.stated_barrier * leg.stated_barrier;
  at.loss_ratio = change(context, omega).loss_ratio;
  at.resting_shift = leg.resting_shift;
  const Path way = path(context);
  at.next_rate = stated.next_rate;
  at.next_gain = stated.next_gain + way.gain - leg.stated_gain;
  at.next_ratio =
      extension_.law_error.next_ratio * std::exp(extension_.law_error.next_by_slope * (slope_ - usual_slope));
  if (drag_) {  // the parabola through three places between the barrier and a foot that sticks
    const double low = at.barrier_squared, half = std::max(1.0, stated.plastic * omega * omega - low) / 2;
    const double first = leg.drag_ratio * work(way, low), middle = leg.drag_ratio * work(way, low + half),
                 last = leg.drag_ratio * work(way, low + 2 * half);
    const double bend = (last - 2 * middle + first) / (2 * half * half), rise = (middle - first) / half - bend * half;
    at.dragged = {first - low * (rise - low * bend), rise - 2 * low * bend, bend};
  }
  if (soft_) soft_->soften(at, {model_.mass, model_.gravity, c.slope_rad});
  return at;
}

SettledContact ExtendedWheel::contact(const CollisionChange& c) const {
  return {contact_.restitution_mean * c.restitution_ratio,
          contact_.restitution_sd * c.restitution_ratio,
          (contact_.friction_mean + c.friction_shift) * c.friction_ratio,
          contact_.friction_sd * c.friction_scatter * c.friction_ratio,
          extension_.contact.outlier_share,
          extension_.contact.outlier_friction};
}

NextTouch ExtendedWheel::at_next_touch(const StepContext& context, double omega, const SeenOfLanding& seen, double blur,
                                       double next) const {
  SeenOfLanding first = seen;
  if (first.omega_plus) *first.omega_plus /= extension_.law_error.plus_ratio;
  return dynamics::at_next_touch(landing(context, omega), contact(change(context, omega)), first, blur, next);
}

double ExtendedWheel::rest_share(const StepContext& context, double omega, std::optional<double> omega_plus) const {
  if (omega_plus) *omega_plus /= extension_.law_error.plus_ratio;
  return dynamics::rest_share(landing(context, omega), contact(change(context, omega)), omega_plus);
}

ExtendedWheel::Drawn ExtendedWheel::land(const StepContext& context, double omega, const Contact& drawn,
                                         bool outlier) const {
  const SettledLanding at = landing(context, omega);
  const LandingShares::Kept kept = at.carried(changed_contact(change(context, omega), drawn, outlier));
  if (!(kept.share >= at.barrier_squared && kept.share > 0)) return {std::nullopt, kept.displacement};
  return {at.next(kept.share), kept.displacement};
}

}  // namespace metastable::dynamics
