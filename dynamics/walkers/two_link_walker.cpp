#include "dynamics/walkers/two_link_walker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

void require_positive(double value, const char* name, const char* unit) {
  if (!(value > 0 && std::isfinite(value)))
    throw std::invalid_argument(fmt::format("{}: {} is not a positive number [{}]", name, value, unit));
}

void require_ground(const Ground& ground) {
  if (!(std::isfinite(ground.slope_rad) && std::isfinite(ground.last_slope_rad)))
    throw std::invalid_argument(
        fmt::format("walker: slopes of {} and {} rad are not finite", ground.slope_rad, ground.last_slope_rad));
}

void require_walkable(const Stride& s) {
  if (!(s.half_angle_rad > 0 && s.half_angle_rad < std::numbers::pi / 2 && std::isfinite(s.stance_rate) &&
        std::isfinite(s.swing_rate)))
    throw std::invalid_argument(
        fmt::format("walker: the state (half angle {} rad, stance rate {}, swing rate {}) is not finite with a half "
                    "angle between 0 and pi/2",
                    s.half_angle_rad, s.stance_rate, s.swing_rate));
}

LegMotion start(const Stride& stride, const Ground& ground) {
  const double turn = ground.slope_rad - ground.last_slope_rad;
  return {0, stride.half_angle_rad + turn, -stride.half_angle_rad + turn, stride.stance_rate, stride.swing_rate};
}

}  // namespace

TwoLinkWalker::TwoLinkWalker(const CompassOptions& masses, const LegEquations& equations, int dimension)
    : masses_(masses), equations_(equations), dimension_(dimension) {
  const double length = masses.foot_to_mass + masses.mass_to_hip;
  course_ = {(dimension == 2 ? 0.3 : 0.25) * std::sqrt(std::min(length, masses.mass_to_hip) / masses.gravity),
             30 * std::sqrt(length / masses.gravity)};
}

TwoLinkWalker TwoLinkWalker::simplest() {
  return {{.leg_mass = 0, .hip_mass = 1, .foot_to_mass = 0, .mass_to_hip = 1, .gravity = 1},
          {.p = 0, .q = 1, .r = 1, .w = 1},
          2};
}

TwoLinkWalker TwoLinkWalker::compass(const CompassOptions& o) {
  require_positive(o.leg_mass, "leg mass", "kg");
  require_positive(o.foot_to_mass, "foot to mass", "m");
  require_positive(o.mass_to_hip, "mass to hip", "m");
  require_positive(o.gravity, "gravity", "m/s^2");
  if (!(o.hip_mass >= 0 && std::isfinite(o.hip_mass)))
    throw std::invalid_argument(fmt::format("hip mass: {} is not a number >= 0 [kg]", o.hip_mass));
  const double m = o.leg_mass, a = o.foot_to_mass, b = o.mass_to_hip, l = a + b;
  const double stance_inertia = (o.hip_mass + m) * l * l + m * a * a;
  return {o,
          {.p = m * l * b / stance_inertia,
           .q = o.gravity * (o.hip_mass * l + m * (a + l)) / stance_inertia,
           .r = l / b,
           .w = o.gravity / b},
          3};
}

Stride TwoLinkWalker::stride(std::span<const double> state) const {
  if (dimension_ == 3) return {state[0], state[1], state[2]};
  return {state[0], state[1], std::cos(2 * state[0]) * state[1]};
}

Stride TwoLinkWalker::strike(const LegMotion& before) const {
  const double m = masses_.leg_mass, hip = masses_.hip_mass, a = masses_.foot_to_mass, b = masses_.mass_to_hip;
  const double l = a + b, apart = std::cos(2 * before.swing_angle);
  const double stance = before.stance_rate, swing = before.swing_rate;
  // About the struck foot it is, before, that of the hip, the old swing leg and the old stance leg.
  const double momentum =
      hip * l * l * apart * stance + m * a * (l * apart * stance - b * swing) + m * a * stance * (l * apart - b);
  // The new swing leg keeps its own about the hip: b swing' = l cos(2 alpha) stance' - a stance.
  const double carried = (l * apart - b) * a * stance;
  const double inertia = hip * l * l + m * a * a + m * l * (l - b * apart) - m * (l * apart - b) * l * apart;
  Stride after;
  after.half_angle_rad = before.swing_angle;
  after.stance_rate = (momentum - m * carried) / inertia;
  after.swing_rate = (l * apart * after.stance_rate - a * stance) / b;
  return after;
}

double TwoLinkWalker::energy(const LegMotion& s, double slope) const {
  const double m = masses_.leg_mass, hip = masses_.hip_mass, a = masses_.foot_to_mass, b = masses_.mass_to_hip;
  const double l = a + b, g = masses_.gravity;
  const double kinetic = 0.5 * ((hip + m) * l * l + m * a * a) * s.stance_rate * s.stance_rate +
                         0.5 * m * b * b * s.swing_rate * s.swing_rate -
                         m * l * b * std::cos(s.stance_angle - s.swing_angle) * s.stance_rate * s.swing_rate;
  const double height =
      (hip * l + m * (a + l)) * std::cos(s.stance_angle - slope) - m * b * std::cos(s.swing_angle - slope);
  return kinetic + g * height;
}

LegMotion TwoLinkWalker::at(const Stride& begin, const Ground& ground, double time) const {
  require_walkable(begin);
  return legs_at(start(begin, ground), ground.slope_rad, equations_, course_.taylor_step, time);
}

void TwoLinkWalker::step(std::span<const double> states, std::span<const Ground> grounds, std::span<double> next,
                         std::span<std::uint8_t> fell) const {
  const auto dimension = static_cast<std::size_t>(dimension_);
  const std::size_t n = grounds.size();
  if (states.size() != n * dimension || next.size() != states.size() || fell.size() != n)
    throw std::invalid_argument("walkers: states, slopes and landings differ in number");
  std::array<LegEquations, legs_at_once> equations;
  std::array<LegCourse, legs_at_once> courses;
  equations.fill(equations_);
  courses.fill(course_);
  for (std::size_t first = 0; first < n; first += legs_at_once) {
    const std::size_t lanes = std::min(legs_at_once, n - first);
    std::array<LegMotion, legs_at_once> from;
    std::array<double, legs_at_once> slopes{};
    for (std::size_t k = 0; k < lanes; ++k) {
      const Stride begin = stride(states.subspan((first + k) * dimension, dimension));
      require_walkable(begin);
      require_ground(grounds[first + k]);
      from[k] = start(begin, grounds[first + k]);
      slopes[k] = grounds[first + k].slope_rad;
    }
    const StruckLegs struck = follow_legs(std::span(from).first(lanes), slopes, equations, courses);
    for (std::size_t k = 0; k < lanes; ++k) {
      const std::size_t i = first + k;
      fell[i] = struck[k] ? 0 : 1;
      if (!struck[k]) continue;
      const Stride after = strike(*struck[k]);
      const std::array<double, 3> all{after.half_angle_rad, after.stance_rate, after.swing_rate};
      std::copy_n(all.begin(), dimension, next.begin() + static_cast<std::ptrdiff_t>(i * dimension));
    }
  }
}

std::optional<LegMotion> TwoLinkWalker::before_strike(const Stride& begin, const Ground& ground) const {
  require_walkable(begin);
  require_ground(ground);
  const LegMotion from = start(begin, ground);
  return follow_legs({&from, 1}, {&ground.slope_rad, 1}, {&equations_, 1}, {&course_, 1})[0];
}

}  // namespace metastable::dynamics
