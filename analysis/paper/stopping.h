#pragma once
// Says how a wheel comes to rest under `settled`: below one friction its foot slides, below another it stops; and what
// a designer changes about it.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "analysis/statistics/estimate.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Holds one leg's landings.
struct StoppingLeg {
  int leg = 0;
  double longer = 0;    ///< than the leg before it [m]
  double sticking = 0;  ///< mu_c: below it the foot slides
  double slides = 0;    ///< P(mu < mu_c)
  double speed = 0;     ///< mean of omega- from collision 13 on [rad/s]
  double resting = 0;   ///< mu_r at that speed and the mean of eta: below it the wheel stops
  int landings = 0;     ///< rolled, from collision 13 on
  int rests = 0;        ///< of these
};

/// Holds mu_r of one leg over omega-, at the mean of eta.
struct RestingCurve {
  int leg = 0;
  std::vector<double> speed;     ///< omega- [rad/s], from where even a sticking foot rests
  std::vector<double> friction;  ///< mu_r
};

struct Stopping {
  Setting setting;
  std::vector<StoppingLeg> legs;
  std::vector<RestingCurve> curves;  ///< of the legs with least, middle and largest mu_c
  int landings() const;              ///< of all legs
  int rests() const;
};

/// Returns the paper's wheel at 7.02 deg under `settled` with eta ~ N(0.4, 0.05^2), mu ~ N(0.4, 0.03^2), J = 0.0025 kg
/// m^2: the wheel of the engines (analysis/README.md), which rolls steadily and stops now and then.
Setting stopping_setting();

/// Finds the thresholds by landings that are followed, rests counted in trials rolled without an end of the ramp (at
/// most 200 collisions each).
/// @param trials >= 2; the same bits on any number of threads
Stopping stopping(const Setting& setting, int trials, std::uint64_t seed, int threads);

/// Holds one thing changed about a setting, and what that buys.
struct DesignChange {
  std::string what, from, to;
  Setting setting;
  Estimate steps;    ///< expected steps before failure
  double times = 1;  ///< as many as without the change
};

/// Changes the inertia of the hub, tolerance of the legs, friction, restitution, slope, tips: the first entry is `base`
/// itself. The steps are collisions over rests of `trials` wheels that are rolled, with the same random numbers for
/// every change, at most 300 collisions each: collisions over rests, so that what is cut off hardly matters. Infinite
/// where none rests.
/// @param base under `settled`; @param trials >= 1; the same bits on any number of threads
/// @param progress called after each of design_change_count() changes; may throw to stop
std::vector<DesignChange> design_changes(const Setting& base, int trials, std::uint64_t seed, int threads,
                                         const std::function<void()>& progress = {});
std::size_t design_change_count();

}  // namespace metastable::analysis
