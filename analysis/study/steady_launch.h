#pragma once
// Finds the launch from a setting's own metastable regime.

#include <stdexcept>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Says that no wheel of a setting rolls on, so that there is no regime to launch from.
class NoRegime : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Returns the setting with steady_speed found, and its mean and sd in initial_speed; as it is where there is nothing
/// to find. The speeds are those of the quasi-stationary distribution when the first landing leg touches, or of the
/// stationary one where the regime never comes to rest, from a brief study with these options, of 128 cells and 4096
/// draws where they leave that open; of a wheel without noise they are its orbit's. Where rest is possible but lies
/// beyond all draws (Status::rest_unresolved) they are those of the wheel without noise, too: nothing else is known of
/// the regime, and nothing of the steps hangs on it.
/// @throws NoRegime where fewer than 1e-12 of the wheels survive a step, and where one without noise rests; as study()
Setting steadily_launched(const Setting& setting, const StudyOptions& options);

}  // namespace metastable::analysis
