#include "analysis/diagnosis/even_push.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"

namespace metastable::analysis {

std::optional<EvenPush> fitted_even_push(const TransitionModel& model, const Fit& recalibrated, const RankedCause& best,
                                         const Rules& rules, int threads) {
  const Candidate* push = model.even_push();
  if (!push || !best.fitted()) return {};
  const EffectScan scan = scan_effects(model, recalibrated, {push}, threads);
  if (scan.effects.empty()) return {};
  Fit pushed = fit_one_more(model, effort_for(model, recalibrated), recalibrated, scan.effects.front(), true);
  // A noise that a recalibration widened to take up the push may hide it; the hypothesis found its way out of that.
  FitOptions options;
  options.ends_as_foretold = true;
  options.to_beat = pushed.penalised;
  Fit again = fit(model, best.fit.nuisance, pushed.terms, options);
  if (again.penalised > pushed.penalised) pushed = std::move(again);
  EvenPush all{pushed.terms.back().values, 2 * (pushed.penalised - recalibrated.penalised),
               2 * (best.fit.penalised - recalibrated.penalised)};
  all.log_odds = evidence_of_gain(std::max(0.0, all.gain), static_cast<double>(all.by.size()), rules) - best.evidence;
  return all;
}

std::string even_push_in_words(const TransitionModel& model, const EvenPush& push, const Rules& rules) {
  if (!(push.gain > push.of_best - rules.told_apart)) return {};
  std::vector<std::string> by;
  const std::vector<ObservedColumn> columns = model.columns();
  for (std::size_t j = 0; j < columns.size(); ++j) by.push_back(fmt::format("{} {:+.2g}", columns[j].name, push.by[j]));
  const std::string how = fmt::format("same push at every {} ({})", model.step_name(), fmt::join(by, ", "));
  if (push.instead(rules))
    return fmt::format(
        "The {} fits better than any name of the catalogue (2 Δ ln L {:.0f}, beside {:.0f}): look for what acts so.",
        how, push.gain, push.of_best);
  return fmt::format(
      "These data show no more of it than the {}, which fits {} (2 Δ ln L {:.0f}, beside {:.0f}): an effect outside "
      "the catalogue that pushes so would get this name.",
      how, push.gain > push.of_best + rules.told_apart ? "better" : "as well", push.gain, push.of_best);
}

std::string same_push_in_words(const Variation& same) {
  return fmt::format(
      "These data show no more of it than that the {} goes by {}, which fits as well: an effect outside the catalogue "
      "that does so would get this name.",
      same.aspect, same.facet);
}

}  // namespace metastable::analysis
