#pragma once
// Gives the effects of blind cases of walkers as functions of one size each, and where they may be found.

#include <string>
#include <vector>

#include "analysis/blind/sized_effect.h"

namespace metastable::analysis {

/// @param id  of walker_effects()
/// @throws std::logic_error naming an id for which nothing says how it is drawn
SizedEffect sized_walker_effect(const std::string& id, BlindDice& dice);

/// Lists facets, and aspects (with a leading ':'), in which an effect may rightly be found; none for an unknown id.
const std::vector<std::string>& rightful_walker_places(const std::string& id);

}  // namespace metastable::analysis
