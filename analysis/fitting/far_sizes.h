#pragma once
// Finds effects whose likely size lies where the slope of the likelihood at none does not lead.

#include <functional>
#include <vector>

namespace metastable::analysis {

struct Candidate;
struct Fit;
struct RankedCause;
struct Rules;
class TransitionModel;

/// Says whether there is an effect with far sizes that was not decided, as the data hold nothing of it at none.
/// @param singles  fit of each candidate, in their order
bool any_flat(const std::vector<const Candidate*>& candidates, const std::vector<RankedCause>& singles);

/// Returns the candidates again, FreeParameter::likely and FreeParameter::blur set where a size far from none makes the
/// data likelier than the effect's own fit has reached, which starts where the slope at none leads. The list is empty
/// where there is no such effect. Only effects with Candidate::seek_far are asked. Each of them takes six likelihoods,
/// or ten fits where the data hold nothing of it at none, and each of two that these make likeliest some 150 more and two fits.
/// @param singles  fit of each candidate, in their order
/// @param heartbeat  called before every stage, may throw to stop
std::vector<Candidate> with_far_sizes(const TransitionModel& model, const Fit& recalibrated,
                                      const std::vector<const Candidate*>& candidates,
                                      const std::vector<RankedCause>& singles, const Rules& rules, int threads,
                                      const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
