#include "analysis/fitting/stepwise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {
namespace {

double parameters_of(const Fit& fit) {
  double count = static_cast<double>(fit.nuisance.size());
  for (const EffectTerm& term : fit.terms)
    count += static_cast<double>(term.values.size() + (term.candidate->variants.size() > 1 ? term.variant.size() : 0));
  return count;
}

bool holds_all(const RankedCause& cause, const std::vector<std::string>& ids) {
  return std::ranges::all_of(ids, [&](const std::string& id) {
    return std::ranges::any_of(cause.terms, [&](const EffectTerm& term) { return term.candidate->id == id; });
  });
}

}  // namespace

double corrected_akaike(double log_likelihood, double parameters, double events) {
  if (events <= parameters + 1) return std::numeric_limits<double>::infinity();
  return -2 * log_likelihood + 2 * parameters + 2 * parameters * (parameters + 1) / (events - parameters - 1);
}

double schwarz(double log_likelihood, double parameters, double events) {
  return -2 * log_likelihood + parameters * std::log(events);
}

std::vector<StepwiseChoice> stepwise_selection(const TransitionModel& model, const Fit& recalibrated,
                                               const CauseRanking& ranking) {
  const auto events = static_cast<double>(model.events().size());
  std::vector<StepwiseChoice> choices;
  for (const auto& [name, criterion] :
       {std::pair<const char*, decltype(&schwarz)>{"AICc", corrected_akaike}, {"BIC", schwarz}}) {
    StepwiseChoice& choice = choices.emplace_back(StepwiseChoice{name, {}});
    double best = criterion(recalibrated.log_likelihood, parameters_of(recalibrated), events);
    for (std::size_t size = 1;; ++size) {
      const RankedCause* found = nullptr;
      for (const std::vector<RankedCause>* hypotheses : {&ranking.singles, &ranking.pairs, &ranking.sets})
        for (const RankedCause& cause : *hypotheses) {
          if (cause.terms.size() != size || cause.fit.nuisance.empty() || !holds_all(cause, choice.effects)) continue;
          const double value = criterion(cause.fit.log_likelihood, parameters_of(cause.fit), events);
          if (!(value < best)) continue;
          best = value;
          found = &cause;
        }
      if (!found) break;
      for (const EffectTerm& term : found->terms)
        if (std::ranges::find(choice.effects, term.candidate->id) == choice.effects.end())
          choice.effects.push_back(term.candidate->id);
    }
  }
  return choices;
}

}  // namespace metastable::analysis
