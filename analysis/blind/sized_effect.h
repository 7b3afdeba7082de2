#pragma once
// Gives the effects of blind cases as functions of one size each, and where they may be found. Each has one entry.

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "analysis/blind/blind_dice.h"
#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::analysis {

/// An effect as a function of its size: the rest of it (which leg, where, which sign) is drawn once.
struct SizedEffect {
  std::function<dynamics::Effect(double)> at;  ///< of a size in [0, largest]; at 0 the effect is neutral
  double start = 0;                            ///< where a search for a power of 16 begins, in (0, largest]
  double largest = 0;                          ///< end of the range
  std::set<std::string> needs = {};            ///< columns and statements without which nobody can tell it
};

/// @param id     of the catalogue. slip_reversal is there or not: it is the same at every size
/// @param truth  contact and legs to which the effect is added
/// @throws std::logic_error naming an id for which nothing says how it is drawn
SizedEffect sized_effect(const std::string& id, const dynamics::NominalValues& truth, BlindDice& dice);

/// Lists facets, and aspects (with a leading ':'), in which an effect may rightly be found; none for an unknown id.
const std::vector<std::string>& rightful_places(const std::string& id);

}  // namespace metastable::analysis
