#pragma once
// Runs walks of a compass gait as it might really be, with effects of the catalogue and others that no catalogue holds,
// and measures them. The motion is RodWalker's.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/laboratory/outside_effect.h"
#include "dynamics/laboratory/rod_walker.h"

namespace metastable::dynamics {

/// Lists effects of walkers that no catalogue holds; they stay out of walker_effects() for good.
///
/// round_feet     feet are arcs of radius `size` [m] that roll
/// hip_spring     a spring of `size` [N m/rad] draws the legs together
/// slow_motor     a motor asks for `size` [N m] on the swinging leg, forward, and reaches it with a lag of 0.3 s
/// swinging_load  a load of `size` [kg] hangs from the hip on a cord of 0.25 m
/// swaying_ramp   the ramp sways along itself by `size` [m] at 0.6 Hz, from a phase that each trial draws
/// loose_knee     the knee of the leg that stands gives by `size` [rad/(N m)], with a damper that is critical (see
///                RodWalkerOptions::knee_compliance); not with round_feet
const std::vector<OutsideInfo>& walker_outside_effects();
/// @throws std::invalid_argument naming the id and all known ones
const OutsideInfo& walker_outside_info(std::string_view id);

/// Says what is walked. Without effects it is the stated model, on slopes N(slope, sd^2) from step to step.
struct WalkerLaboratorySetup {
  double slope_deg = 3;                                     ///< (0, 45)
  double slope_sd_deg = 0.5;                                ///< >= 0
  RodStride launch{0.271028680, -1.09238359, -0.37737395};  ///< of every trial
  double launch_spread = 0;                                 ///< sd of each of its numbers, as a share of it, [0, 0.2]
  std::array<double, 3> sensor_sd{0.0005, 0.005, 0.005};    ///< of half angle [rad], stance and swing rate [rad/s]
  std::vector<Effect> effects = {};                         ///< of walker_effects(), each at most once
  std::vector<OutsideEffect> outside = {};                  ///< of walker_outside_effects()
  std::size_t trials = 50;                                  ///< >= 1
  std::size_t longest = 1000;                               ///< steps of a walk, >= 1
  std::uint64_t seed = 1;
};

/// The walker just after a strike, or as it starts.
struct WalkedRow {
  int leg = 1;          ///< that stands, 1 or 2
  double time = 0;      ///< [s] by one clock for all trials
  double position = 0;  ///< of the standing foot, down the slope from the trial's first [m]
  RodStride truth, seen;
};

struct WalkedTrial {
  std::vector<WalkedRow> rows;  ///< at most WalkerLaboratorySetup::longest
  bool fell = false;            ///< in the step after the last row
};

class WalkerLaboratory {
 public:
  /// @throws std::invalid_argument naming what is out of range, an effect that is unknown or given twice
  explicit WalkerLaboratory(WalkerLaboratorySetup setup);

  const WalkerLaboratorySetup& setup() const { return setup_; }
  /// Runs trial `index` (leg 1 stands first in the even ones). Random numbers come from Philox at counter (trial,
  /// step): the bits are the same in any order.
  WalkedTrial run(std::size_t index) const;

 private:
  struct Terrain {
    double offset = 0, by_phase = 0, drift = 0, spread = 0, clock = 0, clock_hz = 0, stretch = 0, from = 0, to = 0;
    double memory = 0, outliers = 0;
  };
  double slope(const WalkedRow& row, std::size_t trial, double own, double score) const;

  WalkerLaboratorySetup setup_;
  RodWalkerOptions walker_;
  Terrain terrain_;
  std::array<double, 3> added_noise_{}, bias_{}, launch_offset_{}, launch_scatter_{};  // by number of the state
};

}  // namespace metastable::dynamics
