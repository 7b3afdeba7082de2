#include "dynamics/walkers/uneven_walker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

constexpr double taylor_share = 0.25;  // of the time sqrt(l/g) of the shorter of leg and swinging part
constexpr double longest_share = 30;   // of sqrt(l/g), as of TwoLinkWalker

double stance_inertia(const UnevenWalker& w) {
  const double l = w.stance.length(), a = w.stance.foot_to_mass;
  return (w.hip_mass + w.swing.mass) * l * l + w.stance.mass * a * a;
}

LegEquations equations_of(const UnevenWalker& w) {
  const double l = w.stance.length(), b = w.swing.mass_to_hip, m = w.swing.mass;
  const double inertia = stance_inertia(w), swing_inertia = m * b * b;
  return {.p = m * l * b / inertia,
          .q = w.gravity * ((w.hip_mass + m) * l + w.stance.mass * w.stance.foot_to_mass) / inertia,
          .r = l / b,
          .w = w.gravity / b,
          .stance_damping = w.hip_damping / inertia,
          .swing_damping = w.hip_damping / swing_inertia,
          .stance_friction = w.hip_friction / inertia,
          .swing_friction = w.hip_friction / swing_inertia};
}

// Returns the angle to the slope's normal by which legs of unequal length lean as both feet stand; 0 for equal ones.
double lean(const UnevenWalker& w, double half) {
  const double stance = w.stance.length(), swing = w.swing.length();
  return std::atan((stance - swing) / (stance + swing) / std::tan(half));
}

// Returns half the angle between legs whose feet stand `slip` further apart than at `half`.
double half_after(double one, double other, double half, double slip) {
  if (slip == 0) return half;
  const double squares = one * one + other * other, twice = 2 * one * other;
  const double apart = std::sqrt(squares - twice * std::cos(2 * half)) + slip;
  return 0.5 * std::acos(std::clamp((squares - apart * apart) / twice, -1.0, 1.0));
}

void strike(const UnevenWalker& w, const LegMotion& before, double* after) {
  const WalkerLeg &old = w.stance, &struck = w.swing;
  const double apart = std::cos(before.stance_angle - before.swing_angle), hip = w.hip_mass;
  const double l = struck.length(), a = struck.foot_to_mass, b = struck.mass_to_hip;
  const double stance = before.stance_rate, swing = before.swing_rate;
  // About the struck foot; what the old stance leg has there is the same before and after, and left out.
  const double momentum =
      hip * old.length() * l * apart * stance + struck.mass * a * (old.length() * apart * stance - b * swing);
  const double inertia = hip * l * l + struck.mass * a * a + old.mass * l * l * (1 - apart * apart);
  const double kept = std::sqrt(1 - w.impact_loss), new_stance = momentum / inertia;
  const double half = 0.5 * (before.swing_angle - before.stance_angle);
  after[0] = half_after(old.length(), l, half, w.foot_slip);
  after[1] = kept * new_stance;
  // About the hip.
  after[2] = kept * (l * apart * new_stance - old.foot_to_mass * stance) / old.mass_to_hip;
}

bool walkable(const double* state) {
  return state[0] > 0 && state[0] < std::numbers::pi / 2 && std::isfinite(state[1]) && std::isfinite(state[2]);
}

}  // namespace

void step_uneven(std::span<const UnevenWalker> walkers, std::span<const double> states, std::span<const double> slopes,
                 std::span<double> next, std::span<std::uint8_t> fell) {
  for (std::size_t first = 0; first < walkers.size(); first += legs_at_once) {
    const std::size_t lanes = std::min(legs_at_once, walkers.size() - first);
    std::array<LegMotion, legs_at_once> from;
    std::array<double, legs_at_once> slope{};
    std::array<LegEquations, legs_at_once> equations;
    std::array<std::size_t, legs_at_once> which{};
    std::size_t walking = 0;
    std::array<LegCourse, legs_at_once> courses;
    for (std::size_t i = first; i < first + lanes; ++i) {
      fell[i] = 1;
      const UnevenWalker& w = walkers[i];
      if (!walkable(&states[3 * i]) || !std::isfinite(slopes[i])) continue;
      const double half = states[3 * i], leans = lean(w, half);
      from[walking] = {0, leans + half, leans - half, states[3 * i + 1], states[3 * i + 2]};
      slope[walking] = slopes[i];
      equations[walking] = equations_of(w);
      courses[walking] = {taylor_share * std::sqrt(std::min(w.stance.length(), w.swing.mass_to_hip) / w.gravity),
                          longest_share * std::sqrt(w.stance.length() / w.gravity),
                          w.swing.length() / w.stance.length()};
      which[walking++] = i;
    }
    if (walking == 0) continue;
    const StruckLegs struck = follow_legs(std::span(from).first(walking), slope, equations, courses);
    for (std::size_t k = 0; k < walking; ++k) {
      if (!struck[k]) continue;
      strike(walkers[which[k]], *struck[k], &next[3 * which[k]]);
      fell[which[k]] = walkable(&next[3 * which[k]]) ? 0 : 1;
    }
  }
}

}  // namespace metastable::dynamics
