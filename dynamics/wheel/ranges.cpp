#include "dynamics/wheel/ranges.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/wheel/contact_law.h"

namespace metastable::dynamics {
namespace {

constexpr double most_gyration = 3;  // r_g over the mean leg: axle and weights far wider than the wheel
constexpr double rounding = 1e-3;    // a point mass written with three digits is still one

}  // namespace

bool Range::holds(double value) const {
  return std::isfinite(value) && (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
}

std::string Range::text() const {
  return fmt::format("{}{:.6g}, {:.6g}{}", low_open || std::isinf(low) ? '(' : '[', low, high,
                     high_open || std::isinf(high) ? ')' : ']');
}

Range slope_range(int legs) { return {.low = 0.001, .high = 180.0 / legs, .high_open = true}; }

std::string inertia_objection(const Wheel& wheel) {
  if (!wheel.inertia) return "";
  const double point = wheel.hub_mass * wheel.mean_leg_length() * wheel.mean_leg_length();
  if (*wheel.inertia < point * (1 - rounding))
    return fmt::format(
        "{} kg m^2 is below M (mean L)^2 = {:.4g} kg m^2, the least about the stance foot; if it is the inertia about "
        "the hub, {:.4g} kg m^2 is meant",
        *wheel.inertia, point, *wheel.inertia + point);
  const double most = point * (1 + most_gyration * most_gyration);
  if (*wheel.inertia > most)
    return fmt::format("{} kg m^2 is above {:.4g} kg m^2, where the radius of gyration is {} mean legs", *wheel.inertia,
                       most, most_gyration);
  return "";
}

std::string gyration_objection(const Wheel& wheel, Law law) {
  const double most = most_gyration * wheel.mean_leg_length();
  const bool turns = law == Law::settled;
  if (!wheel.radius_of_gyration) return "";
  if (*wheel.radius_of_gyration <= most && (*wheel.radius_of_gyration > 0 || !turns)) return "";
  return fmt::format("{} m is outside {}0, {:.4g}] m ({} mean legs{})", *wheel.radius_of_gyration, turns ? '(' : '[',
                     most, most_gyration, turns ? "; law settled" : "");
}

std::string tip_objection(const Wheel& wheel) {
  const double most = *std::min_element(wheel.leg_length.begin(), wheel.leg_length.end()) / 20;
  if (wheel.tip_radius >= 0 && wheel.tip_radius <= most) return "";
  return fmt::format("{} m is outside [0, {:.6g}] m (a twentieth of the shortest leg)", wheel.tip_radius, most);
}

}  // namespace metastable::dynamics
