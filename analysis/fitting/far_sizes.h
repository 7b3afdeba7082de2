#pragma once
// Finds effects whose likely size lies where the slope of the likelihood at none does not lead.

#include <vector>

namespace metastable::analysis {

struct Candidate;
struct Fit;
struct RankedCause;
class TransitionModel;

/// Returns the candidates again, FreeParameter::likely and FreeParameter::blur set where a size far from none makes the
/// data likelier than the effect's own fit has reached, which starts where the slope at none leads. The list is empty
/// where there is no such effect. An effect is sought so if Candidate::seek_far says it. Some six likelihoods for each
/// of them, and some eighty for each of two that these make likeliest.
/// @param singles  fit of each candidate, in their order
std::vector<Candidate> with_far_sizes(const TransitionModel& model, const Fit& recalibrated,
                                      const std::vector<const Candidate*>& candidates,
                                      const std::vector<RankedCause>& singles, int threads);

}  // namespace metastable::analysis
