#include "analysis/diagnosis/even_push.h"

#include <fmt/format.h>

#include <vector>

#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"

namespace metastable::analysis {

std::string even_push_in_words(const TransitionModel& model, const Fit& recalibrated, const RankedCause& best,
                               const Rules& rules, int threads) {
  const Candidate* push = model.even_push();
  if (!push || !best.fitted()) return {};
  const EffectScan scan = scan_effects(model, recalibrated, {push}, threads);
  if (scan.effects.empty()) return {};
  const Fit pushed = fit_one_more(model, effort_for(model, recalibrated), recalibrated, scan.effects.front());
  const double gain = 2 * (pushed.penalised - recalibrated.penalised);
  const double of_best = 2 * (best.fit.penalised - recalibrated.penalised);
  if (!(gain > of_best - rules.told_apart)) return {};
  std::vector<std::string> by;
  const std::vector<ObservedColumn> columns = model.columns();
  for (std::size_t j = 0; j < columns.size(); ++j)
    by.push_back(fmt::format("{} {:+.2g}", columns[j].name, pushed.terms.back().values[j]));
  return fmt::format(
      "These data show no more of it than the same push at every {} ({}), which fits as well (2 Δ ln L {:.0f}, beside "
      "{:.0f}): an effect outside the catalogue that pushes so would get this name.",
      model.step_name(), fmt::join(by, ", "), gain, of_best);
}

std::string same_push_in_words(const Variation& same) {
  return fmt::format(
      "These data show no more of it than that the {} goes by {}, which fits as well: an effect outside the catalogue "
      "that does so would get this name.",
      same.aspect, same.facet);
}

}  // namespace metastable::analysis
