#include "analysis/experiment/rolling_speeds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace metastable::analysis {

RollingSpeeds rolling_speeds(const Experiment& experiment, std::size_t condition) {
  const dynamics::Wheel& wheel = experiment.wheel;
  const double slope = experiment.conditions[condition].slope_deg * std::numbers::pi / 180;
  const auto [shortest, longest] = std::ranges::minmax(wheel.leg_length);
  const double gyration = wheel.radius_of_gyration.value_or(0),
               inertia = wheel.inertia.value_or(wheel.hub_mass * (longest * longest + gyration * gyration)),
               fallen = longest * (1 - std::cos(wheel.leg_angle() / 2 + slope)),
               lifting = std::sqrt(wheel.gravity / shortest);
  return {.slowest = RollingSpeeds::room * std::sqrt(2 * wheel.hub_mass * wheel.gravity * fallen / inertia),
          .lifting = lifting,
          .fastest = 3 * lifting};
}

double most_stance_gain(const dynamics::Wheel& wheel, double slope) {
  return 4 * wheel.gravity * std::sin(wheel.leg_angle() / 2) * std::sin(slope) / wheel.mean_leg_length();
}

}  // namespace metastable::analysis
