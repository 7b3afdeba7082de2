#pragma once
// Draws random numbers of the laboratories by counter: the same bits in any order of trials and events.

#include <array>
#include <cstdint>

namespace metastable::dynamics {

/// Says what numbers are drawn for. Wheels and walkers have purposes of their own.
enum class LaboratoryDraw : std::uint64_t {
  trial = 100,
  contact = 101,
  sensor = 102,
  walk_slope = 110,
  walk_sensor = 111,
  walk_noise = 112,
  walk_trial = 113,
  walk_sway = 114,
  walk_launch = 115
};

/// Returns four independent numbers, even on (0, 1), of Philox at (trial, event, purpose) under the seed.
std::array<double, 4> laboratory_uniforms(std::uint64_t seed, std::uint64_t trial, std::uint64_t event,
                                          LaboratoryDraw purpose);
/// Returns the standard normal numbers that these are the probabilities of.
std::array<double, 4> laboratory_normals(std::uint64_t seed, std::uint64_t trial, std::uint64_t event,
                                         LaboratoryDraw purpose);

}  // namespace metastable::dynamics
