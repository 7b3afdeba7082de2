#include "dynamics/laboratory/outside_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <ranges>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

constexpr double turn = 2 * std::numbers::pi;
constexpr double plank = 0.31;                             // [m]
constexpr double resonance = 5.3, resonance_width = 0.35;  // [rad/s]
constexpr double usual_speed = 5;                          // [rad/s]
constexpr double warming_time = 1;                         // [s]
constexpr double sway_frequency = 0.8;                     // [Hz]

using At = OutsidePlace;
using Ratios = OutsideRatios;

double share_of_trials(const At& at) { return static_cast<double>(at.trial) / static_cast<double>(at.trials); }

}  // namespace

const std::vector<OutsideInfo>& outside_effects() {
  static const std::vector<OutsideInfo> all{
      {"sloshing_fluid", "a fluid in the hub keeps its spin through collisions", 1},
      {"planks", "friction undulates along the ramp", 0.9,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + size * std::cos(turn * at.position / plank); }},
      {"frame_resonance", "restitution dips in a band of speeds", 0.95,
       [](double size, const At& at, Ratios& r) {
         r.restitution *= 1 - size * std::exp(-std::pow((at.speed - resonance) / resonance_width, 2));
       }},
      {"stored_energy", "part of one collision's loss comes back at the next", 0.9},
      {"speed_spread", "contact noise grows with speed", 1,
       [](double size, const At& at, Ratios& r) { r.scatter *= std::pow(at.speed / usual_speed, 8 * size); }},
      {"double_plate", "odd and even legs differ in friction", 0.6,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + (at.leg % 2 == 1 ? size : -size); }},
      {"warming_feet", "friction falls as a trial goes on, by the clock", 0.27,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + size * std::expm1(-at.clock / warming_time); }},
      {"two_crews", "every other trial has another friction", 0.075,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + (at.trial % 2 == 0 ? size : -size); }},
      {"loose_feet", "the contact of two legs scatters more", 1.2,
       [](double size, const At& at, Ratios& r) {
         if (at.leg == 2 || at.leg == 5) r.scatter *= 1 + size;
       }},
      {"second_memory", "collisions remember the last but one", 0.6},
      {"crosswind", "each trial has a torque of its own", 0.003},
      {"wet_day", "friction differs in the last condition", 0.16,
       [](double size, const At& at, Ratios& r) {
         if (at.conditions > 1 && at.condition + 1 == at.conditions) r.friction *= 1 + size;
       }},
      {"daily_cycle", "friction rises and falls over the trials", 0.1,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + size * std::sin(2 * turn * share_of_trials(at)); }},
      {"hysteresis", "friction depends on the change of speed since the last collision", 0.3,
       [](double size, const At& at, Ratios& r) { r.friction *= 1 + size * at.slowed; }},
      {"wearing_leg", "one leg's friction falls over the trials", 0.36,
       [](double size, const At& at, Ratios& r) {
         if (at.leg == 3) r.friction *= 1 + size * (1 - 2 * share_of_trials(at));
       }},
      {"rough_stretch", "contact scatters more on a stretch of the ramp", 1.2,
       [](double size, const At& at, Ratios& r) {
         if (at.position > 0.5 && at.position < 1) r.scatter *= 1 + size;
       }},
      {"sticky_start", "friction differs at the first collision", 0.3,
       [](double size, const At& at, Ratios& r) {
         if (at.first) r.friction *= 1 + size;
       }},
      {"swaying_floor", "friction swings with the clock, from a phase that each trial draws", 0.13,
       [](double size, const At& at, Ratios& r) {
         r.friction *= 1 + size * std::cos(turn * sway_frequency * at.clock + at.phase);
       }},
  };
  return all;
}

const OutsideInfo& outside_info(std::string_view id) {
  const auto& all = outside_effects();
  const auto found = std::find_if(all.begin(), all.end(), [id](const OutsideInfo& info) { return info.id == id; });
  if (found != all.end()) return *found;
  throw std::invalid_argument(fmt::format("outside effect: \"{}\" is none of {}", id,
                                          fmt::join(all | std::views::transform(&OutsideInfo::id), ", ")));
}

}  // namespace metastable::dynamics
