#pragma once
// What a hypothesis leaves, facet by facet: evidence that something acts there which has no name.

#include <string>
#include <vector>

namespace metastable::analysis {

class TransitionModel;
struct Fit;
struct Rules;
struct PhaseGain;

/// Holds what is left in one facet and aspect of it, all its cells together.
struct LeftInFacet {
  std::string facet, aspect;  ///< as GapCell's, or of a facet that the map lacks
  bool stance = false;
  double quadratic = 0;  ///< chi-squared of that many degrees where nothing is left, by the model's scatter at least
  double degrees = 0;
  double p_value = 1;   ///< of it
  double evidence = 0;  ///< log Bayes factor of shifts of all its cells, see evidence_of_gain()
};

/// Judges the facets of the map; and what no effect of a catalogue does: every other trial, slow swings over the
/// trials, smooth changes along them, trends of single legs, memory beyond the last collision, the change of speed
/// since then. What the fit's parameters could take up is projected out. Empty of a fit that did not converge.
/// @param forgiven  2 Delta log likelihood that an error of form may leave in a facet
std::vector<LeftInFacet> left_by_facet(const TransitionModel& model, const Fit& fit, const PhaseGain& forgiven,
                                       const Rules& rules);

/// Bounds the evidence of facets by a hypothesis that was fitted: a facet beside it, which includes the facet alone,
/// gains no more than it and what it leaves in the facet. Far from the fit scores promise more than that.
/// @param gain  2 Delta log likelihood of the hypothesis over the fit of `alone`  @param beside  what it leaves
void bound_evidence(std::vector<LeftInFacet>& alone, double gain, const std::vector<LeftInFacet>& beside,
                    const Rules& rules);

/// Returns the log of the mean of the facets' Bayes factors: something without a name, in a facet that nobody told.
/// -infinity where there are none.
double evidence_of_more(const std::vector<LeftInFacet>& facets);

}  // namespace metastable::analysis
