#include "dynamics/settled/settled_wheel.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {
namespace {

// Returns the angle past the normal of leg `first` with both it and `second` on the plane, `between` ahead of it [rad].
double both_down(double first, double second, double between) {
  return std::atan2(first - second * std::cos(between), second * std::sin(between));
}

void require(bool fine, const char* name, double value, const std::string& range) {
  if (!fine) throw std::invalid_argument(fmt::format("settled: {}: {} is outside {}", name, value, range));
}

}  // namespace

double SettledWheel::leg_angle() const { return 2 * std::numbers::pi / legs(); }

double SettledWheel::length(int leg) const {
  const int index = leg % legs();
  return leg_length[static_cast<std::size_t>(index < 0 ? index + legs() : index)] - tip_radius;
}

double SettledWheel::drag(double spin) const {
  const double size = std::abs(spin);
  return spin == 0 ? 0 : std::copysign(constant_drag + size * (linear_drag + size * quadratic_drag), spin) / mass;
}

void SettledWheel::validate() const {
  if (legs() < 3)
    throw std::invalid_argument(fmt::format("settled: leg_length: {} legs are given, 3 or more are needed", legs()));
  for (const double length : leg_length)
    require(length > 0 && std::isfinite(length), "leg_length", length, "(0, inf) m");
  require(mass > 0 && std::isfinite(mass), "mass", mass, "(0, inf) kg");
  require(radius_of_gyration > 0 && std::isfinite(radius_of_gyration), "radius_of_gyration", radius_of_gyration,
          "(0, inf) m");
  const double shortest = *std::min_element(leg_length.begin(), leg_length.end());
  require(tip_radius >= 0 && tip_radius <= shortest / 20, "tip_radius", tip_radius,
          fmt::format("[0, {:.6g}] m, a twentieth of the shortest leg", shortest / 20));
  require(gravity > 0 && std::isfinite(gravity), "gravity", gravity, "(0, inf) m/s^2");
  require(slope_rad > 0 && slope_rad < steepest_slope(legs()), "slope", slope_rad,
          fmt::format("(0, {:.6g}) rad", steepest_slope(legs())));
  require(constant_drag >= 0, "constant_drag", constant_drag, "[0, inf) N m");
  require(linear_drag >= 0, "linear_drag", linear_drag, "[0, inf) N m s");
  require(quadratic_drag >= 0, "quadratic_drag", quadratic_drag, "[0, inf) N m s^2");
  require(rest_speed > 0, "rest_speed", rest_speed, "(0, inf) m/s");
  require(tolerance > 0, "tolerance", tolerance, "(0, inf)");
  require(max_events > 0, "max_events", max_events, "[1, inf)");
}

SettledWheel settled_wheel(const Wheel& wheel, double slope) {
  wheel.validate();
  SettledWheel settled;
  settled.leg_length = wheel.leg_length;
  settled.mass = wheel.hub_mass;
  settled.gravity = wheel.gravity;
  settled.slope_rad = slope;
  settled.tip_radius = wheel.tip_radius;
  settled.radius_of_gyration = contact_model(wheel, Law::settled).radius_of_gyration;
  settled.validate();
  return settled;
}

StandingFoot::StandingFoot(const SettledWheel& wheel, int leg)
    : length_(wheel.length(leg)),
      radius_(wheel.tip_radius),
      gravity_(wheel.gravity),
      gyration_sq_(wheel.gyration_sq()),
      sine_(std::sin(wheel.slope_rad)),
      cosine_(std::cos(wheel.slope_rad)) {
  const double between = wheel.leg_angle();
  landing_ = -both_down(length_, wheel.length(leg - 1), between);
  next_ = both_down(length_, wheel.length(leg + 1), between);
  apex_ = -wheel.slope_rad - std::asin(radius_ * sine_ / length_);
  pace_ = triangle(length_, wheel.length(leg + 1), between).chord + radius_ * (next_ - landing_);
  landing_inertia_ = inertia(landing_);
  next_inertia_ = inertia(next_);
  fall_ = potential(landing_) - potential(next_);
  barrier_ = apex_ > landing_ ? 2 * (potential(apex_) - potential(landing_)) / landing_inertia_ : 0;
}

double StandingFoot::inertia(double angle) const {
  const double height = length_ * std::cos(angle) + radius_, ahead = length_ * std::sin(angle);
  return gyration_sq_ + height * height + ahead * ahead;
}

double StandingFoot::potential(double angle) const {
  return gravity_ * (length_ * std::cos(angle) * cosine_ - (length_ * std::sin(angle) + radius_ * angle) * sine_);
}

double StandingFoot::next_squared(double omega_eq_squared) const {
  return (landing_inertia_ * omega_eq_squared + 2 * fall_) / next_inertia_;
}

double StandingFoot::landing_squared(double next_squared) const {
  return (next_inertia_ * next_squared - 2 * fall_) / landing_inertia_;
}

double StandingFoot::duration(double next_squared) const {
  using Rule = boost::math::quadrature::gauss<double, 40>;
  constexpr double least_left = 1e-14;
  const double energy = next_inertia_ * next_squared / 2 + potential(next_);
  const double left = std::max(2 * (energy - potential(apex_)), apex_ > landing_ ? least_left * next_squared : 0);
  if (!(left > 0)) {  // on a slope without barrier, from a slow start: omega^2 rises with the angle
    return Rule::integrate(
        [&](double root) {
          const double angle = landing_ + root * root;
          return 2 * root / std::sqrt(std::max(spin_squared(angle, energy), least_left * next_squared));
        },
        0.0, std::sqrt(next_ - landing_));
  }
  // Around the top 2 (E - V) is left + bend (a - apex)^2: sinh makes 1 / omega smooth there.
  const double bend = gravity_ * length_ * std::cos(apex_ + std::atan2(sine_, cosine_)), width = std::sqrt(left / bend);
  const auto smooth = [&](double u) {
    const double angle = apex_ + width * std::sinh(u);
    const double squared =
        std::max(spin_squared(angle, energy), left * (1 + std::sinh(u) * std::sinh(u)) / 2 / inertia(angle));
    return width * std::cosh(u) / std::sqrt(squared);
  };
  const double from = std::asinh((landing_ - apex_) / width), to = std::asinh((next_ - apex_) / width);
  const double middle = std::clamp(0.0, from, to);
  return Rule::integrate(smooth, from, middle) + Rule::integrate(smooth, middle, to);
}

double sticking_friction(const SettledWheel& wheel, int leg) {
  const Triangle both = triangle(wheel.length(leg - 1), wheel.length(leg), wheel.leg_angle());
  const double height = both.hub_height + wheel.tip_radius;
  return both.contact_x * height / (wheel.gyration_sq() + height * height);
}

}  // namespace metastable::dynamics
