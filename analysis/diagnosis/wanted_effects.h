#pragma once
// Says which effects a diagnosis considers: all of the catalogue, or those that its user lists.

#include <string>
#include <utility>
#include <vector>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Checks a list of effects, each entry of which is one ("leg_contact") or a pair ("leg_contact+trial_drift").
/// @throws std::invalid_argument for an id that the system does not know, and a pair of one effect with itself
void require_known_effects(const TransitionModel& model, const std::vector<std::string>& catalogue);

/// Returns the candidates that are considered: all where the list is empty. Pairs alone extend the whole catalogue;
/// beside single effects they add theirs.
/// @throws std::invalid_argument where these data can show none of them
std::vector<const Candidate*> wanted(const TransitionModel& model, const std::vector<std::string>& catalogue);

/// Returns the pairs of the list, of effects that are among the candidates.
std::vector<std::pair<const Candidate*, const Candidate*>> wanted_pairs(const std::vector<const Candidate*>& candidates,
                                                                        const std::vector<std::string>& catalogue);

}  // namespace metastable::analysis
