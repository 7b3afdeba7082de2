#pragma once
// Says what landings leave, leg by leg: a law's signature that needs no launch and no rest.

#include <optional>
#include <string>
#include <vector>

#include "analysis/description/speed_profile.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Holds the landings on one leg from collision 13 on that were followed by another, one value each.
struct LegLandings {
  std::vector<double> kept;   ///< share of omega-^2: that of a foot which stands at the landing angle and reaches the
                              ///< same speed at the next touch
  std::vector<double> slide;  ///< of the foot down the plane, to the next foot less their distance [m]; may be empty
};

/// Returns one entry a leg. @param wheel of rigid feet, with the condition's slope
std::vector<LegLandings> leg_landings(const Experiment& experiment, std::size_t condition,
                                      const dynamics::SettledMotion& wheel);
std::vector<LegLandings> leg_landings(const std::vector<dynamics::Trial>& trials, const dynamics::SettledMotion& wheel);

/// Puts one leg of one condition, as measured, beside what is predicted.
struct LegRow {
  std::string condition;
  int leg = 0;
  SpeedSummary kept_measured, kept, slide_measured, slide;  ///< count 0: not known
  std::optional<double> p_kept, p_slide;                    ///< Welch
};
LegRow compare_landings(const LegLandings& measured, const LegLandings& predicted);

}  // namespace metastable::analysis
