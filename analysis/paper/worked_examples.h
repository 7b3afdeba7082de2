#pragma once
// Provides what the worked examples of the diagnosis (`metastable lessons`) compute and diagnose.

#include <array>
#include <cstdint>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/statistics/estimate.h"
#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::analysis {

/// Returns the stand-in's three conditions (stand_in_conditions()) run in the virtual laboratory, with a sensor noise
/// of 0.008 rad/s, as an experiment.
/// @param trials  of each condition; 0: the paper's numbers
/// @throws std::invalid_argument for effects out of range
Experiment laboratory_stand_in(const std::vector<dynamics::Effect>& effects, std::uint64_t seed, int threads,
                               int trials = 0);

/// Holds expected steps of the paper's wheel with equal legs of 0.1519 m, launched as in the paper, on one ramp.
struct ChargeOnSticking {
  double slope_deg = 0;
  double critical_friction = 0;            ///< mu_c = x y/(L^2 + y^2): a foot with more sticks
  double share_above = 0;                  ///< of mu ~ N(0.4, 0.1^2) above it
  Estimate published, uncharged, coulomb;  ///< under the law, without its charge (analysis/paper/uncharged_sticking.h)
};
/// Studies the paper's two ramps, with intervals of 5 %. @throws as study()
std::vector<ChargeOnSticking> charge_on_sticking(std::uint64_t seed, int threads);

/// Names what the paper's hypotheses H1, H2 and H3 are about, and none of these.
enum class VariabilitySource { none, launch, legs, contact };
inline constexpr std::array variability_sources{VariabilitySource::none, VariabilitySource::launch,
                                                VariabilitySource::legs, VariabilitySource::contact};
/// Returns the experiment with one source half as wide in its nominal model as it states: the sds of the launches, the
/// legs' distances from their mean, or the sds of eta and mu. @throws std::invalid_argument for launches that are not
/// stated
Experiment believed_half_as_wide(Experiment experiment, VariabilitySource source);

/// Holds one experiment under another nominal law.
struct UnderLaw {
  dynamics::Law law = dynamics::Law::published;
  bool whole_steps = false;  ///< omega_plus is left out, so that steps count and not collisions
  Experiment experiment;
};
/// Puts it under `published`, `coulomb` and its own law, each with omega_plus and, where it was measured, without.
std::vector<UnderLaw> under_each_law(const Experiment& experiment);

}  // namespace metastable::analysis
