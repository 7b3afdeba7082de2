#include "analysis/diagnosis/fits_without.h"

#include "analysis/fitting/effect_fit.h"

namespace metastable::analysis {

FitsWithout::FitsWithout(const TransitionModel& model, const CauseRanking& ranking, const RankedCause& best,
                         const Fit& recalibrated)
    : model_(model), ranking_(ranking), best_(best), recalibrated_(recalibrated), known_(best.fit.terms.size()) {}

const Fit& FitsWithout::term(std::size_t place, const std::function<void()>& heartbeat) {
  const Fit*& known = known_.at(place);
  if (known) return *known;
  std::vector<EffectTerm> others = best_.fit.terms;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(place));
  if (others.empty()) return *(known = &recalibrated_);
  for (const auto* causes : {&ranking_.singles, &ranking_.pairs, &ranking_.sets})
    for (const RankedCause& one : *causes)
      if (one.fitted() && one.terms.size() == others.size() && extends(one.terms, others)) return *(known = &one.fit);
  if (heartbeat) heartbeat();
  made_.push_back(fit(
      model_, best_.fit.nuisance, others,
      {.count = {}, .refit_nuisances = true, .most_iterations = effort_for(model_, recalibrated_).most_iterations}));
  return *(known = &made_.back());
}

}  // namespace metastable::analysis
