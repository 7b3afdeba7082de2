#include "analysis/diagnosis/not_possible.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "analysis/gap/map_cells.h"

namespace metastable::analysis {
namespace {

constexpr double most_trials = 1e5;  // beyond, no number of trials is worth naming
constexpr double surely = 0.95;

std::optional<std::size_t> whole(double trials) {
  if (!(trials < most_trials)) return std::nullopt;
  return static_cast<std::size_t>(std::ceil(std::max(1.0, trials) - 1e-9));
}

/// Returns the effects asked for that these data or their law cannot show, with the reason.
std::map<std::string, std::string> asked_in_vain(const TransitionModel& model,
                                                 const std::vector<std::string>& catalogue) {
  std::map<std::string, std::string> reasons;
  const auto look_at = [&](const std::string& id) {
    if (id == model.recalibration_id()) return;  // it is fitted in any case
    const auto candidate = std::ranges::find(model.candidates(), id, &Candidate::id);
    if (candidate == model.candidates().end())
      reasons[id] = "the model does not have it with this law and these columns";
    else if (!candidate->undecidable.empty())
      reasons[id] = candidate->undecidable;
  };
  for (const std::string& entry : catalogue) {
    const auto plus = entry.find('+');
    look_at(entry.substr(0, plus));
    if (plus != std::string::npos) look_at(entry.substr(plus + 1));
  }
  return reasons;
}

}  // namespace

std::optional<std::size_t> trials_to_explain(const Diagnosis::Data& data) {
  constexpr std::size_t trials = Rules::least_trials_to_explain, transitions = Rules::least_transitions_to_explain;
  if (data.trials >= trials && data.collisions >= transitions) return {};
  const double each = static_cast<double>(std::max<std::size_t>(1, data.collisions)) /
                      static_cast<double>(std::max<std::size_t>(1, data.trials));
  return std::max(trials, static_cast<std::size_t>(std::ceil(static_cast<double>(transitions) / each - 1e-9)));
}

std::vector<NotPossible> not_possible(const TransitionModel& model, const Diagnosis& d,
                                      const DiagnosisOptions& options) {
  std::vector<NotPossible> all;
  const auto trials = static_cast<double>(d.data.trials);
  const bool gap = is_gap(d.verdict);
  if (const auto would_do = trials_to_explain(d.data))
    all.push_back({"what causes a gap",
                   fmt::format("{} {} with {} {}; causes are named from {} trials and {} transitions on", d.data.trials,
                               d.data.trials == 1 ? "trial" : "trials", d.data.collisions,
                               d.data.collisions == 1 ? "transition" : "transitions", Rules::least_trials_to_explain,
                               Rules::least_transitions_to_explain),
                   would_do, true});
  if (d.data.trials < trials_for_folds(options.folds)) {
    all.push_back({"how far the gap shrinks, held out",
                   fmt::format("{} {} cannot fill {} folds with two each", d.data.trials,
                               d.data.trials == 1 ? "trial" : "trials", options.folds),
                   trials_for_folds(options.folds), true});
  } else if (gap && !d.shrinkage.measures.empty() && !d.shrinkage.measures[0].closed) {
    const Shrinkage& s = d.shrinkage.measures[0];
    const double size = s.baseline - s.floor, half = 0.5 * (s.baseline_upper - s.baseline_lower);
    all.push_back({"the share of the gap that closes, held out",
                   fmt::format("the held-out gap of {:.2g} {} a {} is not beyond its own uncertainty of {:.2g}", size,
                               s.unit, d.data.step_name, half),
                   size > 0 ? whole(1.1 * trials * half * half / (size * size)) : std::nullopt, true});
  }
  const auto speeds = static_cast<double>(d.data.collisions);
  if (d.gap.recalibrated.cells.empty() && trials > 0)
    all.push_back({"where the gap lies",
                   fmt::format("{:.0f} transitions; a cell of the map takes {}", speeds, least_cell_events),
                   speeds > 0 ? whole(least_cell_events * trials / speeds) : std::nullopt, true});
  else if (model.legs() > 1 && speeds < least_cell_events * model.legs() && speeds > 0)
    all.push_back({fmt::format("which {} the gap lies in", model.leg_name()),
                   fmt::format("{:.0f} transitions for {} {}s; a cell of the map takes {}", speeds, model.legs(),
                               model.leg_name(), least_cell_events),
                   whole(least_cell_events * model.legs() * trials / speeds), true});
  for (const auto& [id, because] : asked_in_vain(model, options.catalogue))
    all.push_back({fmt::format("whether {} is at work", id), because, {}});
  for (const Detectability& v : d.limits.visible)
    if (v.times_more > 1)
      all.push_back({fmt::format("whether {} is at work", v.effect),
                     "at the end of its range it would still be hidden by the recalibration and the noise",
                     whole(trials * v.times_more)});
  const auto [at_risk, rests] = model.rests();
  if (at_risk == 0) {
    all.push_back({"the observed steps before failure", "how the trials ended is not known", std::nullopt});
  } else if (rests == 0) {
    const double steps = d.shrinkage.steps.with_effect, each = at_risk / trials;
    const bool known = std::isfinite(steps) && steps > 1;
    const char* ended = d.data.collides() ? "came to rest" : "failed";
    all.push_back({"the observed steps before failure but for their lower end",
                   known ? fmt::format("no trial {} in {:.0f} {}s; the model expects one in {:.3g}", ended, at_risk,
                                       d.data.step_name, steps)
                         : fmt::format("no trial {} in {:.0f} {}s{}", ended, at_risk, d.data.step_name,
                                       std::isinf(steps) ? ", and none of those that the model draws" : ""),
                   known ? whole(std::log1p(-surely) / (each * std::log1p(-1 / steps))) : std::nullopt});
  }
  return all;
}

}  // namespace metastable::analysis
