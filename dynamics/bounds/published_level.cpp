#include "dynamics/bounds/published_level.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

template <class T>
FrictionTerms<T> terms(const T& mu, const T& mass0, const T& mass1, const T& force0, const T& force1) {
  FrictionTerms<T> f;
  const T i = T(1) / (mass0 - mass1 * mu), i2 = i * i;
  f.a = i;
  f.a1 = mass1 * i2;
  f.a2 = T(2) * (mass1 * mass1) * (i2 * i);
  const T n = mu * (force0 + force1 * mu), n1 = force0 + T(2) * force1 * mu, n2 = T(2) * force1;
  f.u = n * i;
  f.u1 = n1 * i + n * f.a1;
  f.u2 = n2 * i + T(2) * (n1 * f.a1) + n * f.a2;
  f.b = f.u * i;
  f.b1 = f.u1 * i + f.u * f.a1;
  f.b2 = f.u2 * i + T(2) * (f.u1 * f.a1) + f.u * f.a2;
  return f;
}

// Encloses T_r over its factor sqrt(m_c/K_r).
Interval ringing(const Interval& eta) { return sqrt(square(around(std::numbers::pi)) + square(log(eta))); }

}  // namespace

PublishedLevel::PublishedLevel(const WheelMap& map, int phase) {
  if (map.law() != Law::published)
    throw NoBounds(fmt::format("bounds exist for the law published only, not for {}", law_name(map.law())));
  const Collision c = map.collision(phase, 1);
  const ContactModel& model = map.contact_model();
  if (!(c.contact_x > 0)) throw NoBounds("the hub is downhill of the landing foot");
  const Interval mass = model.mass, x = around(c.contact_x), y = around(c.contact_y);
  const Interval r2 = square(around(c.landing_length)), chord = around(c.chord);
  const Interval inertia = around(map.stance(phase).inertia);
  const Interval scale = inverse(mass * r2);
  mass0_ = (r2 + square(x)) * scale;
  mass1_ = x * y * scale;
  force0_ = -(x * y * scale);
  force1_ = (r2 + square(y)) * scale;
  kept = around(map.stance(phase > 0 ? phase - 1 : map.phases() - 1).inertia) / inertia;
  kappa = square(chord) / inertia;
  delta = mass * Interval(model.gravity) * around(std::sin(c.slope)) * chord / inertia *
          sqrt(Interval(model.contact_mass) / Interval(model.ramp_stiffness));
  barrier = around(map.stance(phase).barrier);
  gain = around(map.stance(phase).gain);
  inverse_mass = mass0_;
  turn = (x * y / (r2 + square(y))).upper;
  jam = (mass0_ / mass1_).lower;
  // The drag is negative below mu_c only; s is least there at eta = 0 and a = 1/A(mu_c).
  if (!((kept - kappa * inverse(mass0_ - mass1_ * Interval(turn))).lower >= 0))
    throw NoBounds("the landing cannot be shown to rise with the state");
}

FrictionTerms<Interval> PublishedLevel::at(const Interval& mu) const {
  return terms<Interval>(mu, mass0_, mass1_, force0_, force1_);
}

FrictionTerms<double> PublishedLevel::roughly_at(double mu) const {
  return terms<double>(mu, mass0_.middle(), mass1_.middle(), force0_.middle(), force1_.middle());
}

RestitutionTerms PublishedLevel::drive(const Interval& eta) const {
  const Interval one = Interval(1) + eta;
  return {kappa * (Interval(1) - square(eta)), kappa * square(one), delta * one * ringing(eta)};
}

RestitutionTerms PublishedLevel::drive_slope(const Interval& eta) const {
  const Interval t = ringing(eta), l = log(eta), one = Interval(1) + eta;
  return {kappa * Interval(-2) * eta, kappa * Interval(2) * one, delta * (t + one * (l / (eta * t)))};
}

RestitutionTerms PublishedLevel::drive_bend(const Interval& eta) const {
  const Interval t = ringing(eta), l = log(eta), one = Interval(1) + eta;
  const Interval first = l / (eta * t), second = (t - l * t - square(l) / t) / (square(eta) * square(t));
  return {kappa * Interval(-2), kappa * Interval(2), delta * (Interval(2) * first + one * second)};
}

}  // namespace metastable::dynamics
