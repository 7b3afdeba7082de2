#include "analysis/machine_model/tolerant_starts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/fitting/effect_fit.h"
#include "analysis/machine_model/machine_transitions.h"

namespace metastable::analysis {
namespace {

constexpr double times_the_error = 3;  // that the tolerant model's sensors err
constexpr double far_off = 4;          // sds, beyond which no more values may lie than may be wild
constexpr double worth_a_start = 0.1;  // of the largest gain that the tolerant model's scores promise

std::shared_ptr<const Machine> without_wild_rows(const Machine& machine, double times) {
  auto copy = std::make_shared<Machine>(machine);
  copy->most_wild = 0;
  for (MachineSensor& sensor : copy->observe)
    if (sensor.sd) *sensor.sd *= times;
  return copy;
}

// Says whether more values lie far off the model with these nuisances than may be wild.
bool many_far_off(const TransitionModel& model, const std::vector<double>& nuisance, double most_wild) {
  const Evaluation evaluation = model.evaluate(nuisance, {});
  double values = 0, off = 0;
  for (std::size_t e = 0; e < evaluation.score.size(); ++e) {
    if (model.events()[e].kind != EventKind::step) continue;
    ++values;
    off += std::abs(evaluation.score[e]) > far_off;
  }
  return off > most_wild * values;
}

}  // namespace

TolerantStarts::TolerantStarts(std::shared_ptr<const Machine> machine, MachineRuns runs)
    : machine_(std::move(machine)), runs_(std::move(runs)) {}

std::unique_ptr<TolerantStarts::Tolerant> TolerantStarts::tolerant() const {
  const auto known = [](const MachineSensor& sensor) { return sensor.sd && *sensor.sd > 0; };
  if (!(machine_->most_wild > 0) || std::ranges::none_of(machine_->observe, known)) return nullptr;
  auto found = std::make_unique<Tolerant>();
  found->model = machine_transitions(without_wild_rows(*machine_, times_the_error), runs_);
  found->recalibrated = fit(*found->model, nominal_values(*found->model), {});
  const std::unique_ptr<TransitionModel> strict = machine_as_stated(without_wild_rows(*machine_, 1), runs_);
  found->for_effects = many_far_off(*strict, found->recalibrated.nuisance, machine_->most_wild);
  if (!found->for_effects)
    return many_far_off(*strict, nominal_values(*strict), machine_->most_wild) ? std::move(found) : nullptr;
  std::vector<const Candidate*> all;
  for (const Candidate& candidate : found->model->candidates()) all.push_back(&candidate);
  found->scan = scan_effects(*found->model, found->recalibrated, all, 1);
  return found;
}

void TolerantStarts::prepare() const {
  std::call_once(asked_, [this] { tolerant_ = tolerant(); });
}

std::vector<FitStart> TolerantStarts::starts(std::span<const EffectTerm> terms) const {
  prepare();
  if (!tolerant_ || (!tolerant_->for_effects && !terms.empty())) return {};
  const TransitionModel& model = *tolerant_->model;
  std::vector<EffectTerm> same;
  for (const EffectTerm& term : terms) {
    const auto found = std::ranges::find(model.candidates(), term.candidate->id, &Candidate::id);
    if (found == model.candidates().end()) return {};
    same.push_back({&*found, term.variant, term.values});
  }
  if (same.size() == 1) {
    double most = 0;
    for (const ScannedEffect& effect : tolerant_->scan.effects) most = std::max(most, effect.gain[effect.best]);
    const ScannedEffect* scanned = tolerant_->scan.find(same[0].candidate);
    const auto variant = std::ranges::find(same[0].candidate->variants, terms[0].variant);
    if (!scanned || variant == same[0].candidate->variants.end()) return {};
    const auto at = static_cast<std::size_t>(variant - same[0].candidate->variants.begin());
    if (!(scanned->gain[at] > worth_a_start * most)) return {};
    same[0] = term_at(*scanned, at);
  }
  const Fit fitted = same.empty() ? tolerant_->recalibrated : fit(model, tolerant_->recalibrated.nuisance, same);
  if (!std::isfinite(fitted.penalised)) return {};
  FitStart start{fitted.nuisance, {}, true};
  for (const EffectTerm& term : fitted.terms) start.values.push_back(term.values);
  return {start};
}

}  // namespace metastable::analysis
