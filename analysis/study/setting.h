#pragma once
// Describes one setting: a wheel, a ramp, a contact law with its noise, a launch. Defaults are the paper's.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/study/problem.h"
#include "dynamics/return_map/launch_speed.h"
#include "dynamics/return_map/wheel_map.h"
#include "dynamics/settled/settled_motion.h"

namespace metastable::analysis {

/// Holds mean and sd of the normal before truncation.
struct Spread {
  double mean = 0;
  double sd = 0;
};

/// Says where landings under `settled` come from.
struct LandingOptions {
  bool direct = false;  ///< every landing followed instead of read from a table, hundreds of times slower
  int threads = 0;      ///< of the table, 0: all cores
  /// Called now and then, from any thread, one at a time: of the table, and with 1 while landings are followed or
  /// integrated later; it may throw to stop.
  std::function<void(double share)> progress = {};
};

/// Holds everything that fixes the chain of one wheel on one ramp.
struct Setting {
  dynamics::Wheel wheel;
  double slope_deg = 7.02;    ///< gamma [deg], in (0, alpha/2)
  double ramp_length = 3.66;  ///< [m], > 0
  dynamics::Law law = dynamics::Law::published;
  double rebound_lost = 0;               ///< share of the rebound's energy lost in hops, `coulomb` only
  Spread restitution{0.4, 0.1};          ///< eta, truncated to [0, 1] ([0, 0.95] under `settled`)
  Spread friction{0.4, 0.1};             ///< mu, truncated to [0, inf)
  double correlation = 0;                ///< of the normal scores of eta and mu
  std::vector<dynamics::Contact> pairs;  ///< not empty: an empirical list instead of the normals
  Spread initial_speed{7.35, 0.19};      ///< omega_0 just before collision 1 [rad/s], truncated at 0
  /// Says that omega_0 is that of wheels of this setting that still roll long after any launch, when the first landing
  /// leg touches (steady_launch.h); initial_speed is then not read.
  bool steady_launch = false;
  std::shared_ptr<const dynamics::LaunchSpeed> steady_speed = {};  ///< those speeds, once they are found
  int first_landing_leg = 0;

  dynamics::ContactNoise noise() const;
  /// Says whether all collisions of a leg at one speed are alike. (The launch may have a spread all the same.)
  bool noise_free() const;
  /// @throws std::invalid_argument for initial_speed out of range; std::logic_error for a steady launch not yet found
  dynamics::LaunchSpeed launch() const;
  /// Returns wheel, ramp and stances; under `settled` it says nothing about collisions.
  /// @throws std::invalid_argument, one line naming the quantity, its value and its range
  dynamics::WheelMap map() const;
  /// Returns the wheel of the law `settled`, whatever `law` is. @throws as map()
  dynamics::SettledMotion motion() const;
  /// Ranges are those of dynamics/wheel/ranges.h; a ramp may also be infinitely long.
  /// @throws std::invalid_argument, one line naming the quantity, its value and its range
  void validate() const;
  /// Returns the generic problem behind it: return map, launch state omega_0^2, speed as observable, last collision on
  /// the ramp. Under `settled` a table of landings is built, at most once for wheel and slope (SettledMap::of). For a
  /// steady launch not yet found the launch state is that of the wheel without noise, or a fast one where that rests.
  Problem problem(const LandingOptions& landings = {}) const;
  /// Returns one line that names every quantity, for captions and provenance.
  std::string describe() const;
};

/// Returns the launch speeds the paper measured: N(7.35, 0.19^2) at 7.02 deg and N(5.83, 0.28^2) at 9.59 deg (fast
/// start) [rad/s]; nothing for other slopes.
std::optional<Spread> paper_launch(double slope_deg);

}  // namespace metastable::analysis
