#pragma once
// Says what stepwise selection by an information criterion, as the field does it, would name over the same models.

#include <string>
#include <vector>

namespace metastable::analysis {

class TransitionModel;
struct Fit;
struct CauseRanking;

struct StepwiseChoice {
  std::string criterion;             ///< "AICc" or "BIC", or what selects by another way
  std::vector<std::string> effects;  ///< ids, in the order they came in; none: the recalibrated model
};

/// Selects forward, by AICc (Hurvich and Tsai 1989) and by BIC (Schwarz 1978) over the model's events: from the
/// recalibrated model to the best single effect that lowers the criterion, from it to the best pair with it, and on to
/// larger sets. Uses the fits of the ranking and makes none: sets that the ranking did not fit are not tried. The
/// entries of a chosen variant (a leg, an interval) count as parameters where there is a choice.
std::vector<StepwiseChoice> stepwise_selection(const TransitionModel& model, const Fit& recalibrated,
                                               const CauseRanking& ranking);

/// Return the criterion of a fit with `parameters` of `events`; the smaller the better.
/// AICc is infinite where events do not exceed parameters by more than one.
double corrected_akaike(double log_likelihood, double parameters, double events);
double schwarz(double log_likelihood, double parameters, double events);

}  // namespace metastable::analysis
