#include "analysis/fitting/bayes_factor.h"

#include <algorithm>
#include <cmath>

namespace metastable::analysis {

double evidence_of_gain(double gain, double parameters, const Rules& rules) {
  const double g = rules.expected_gain / std::max(1.0, parameters);
  return 0.5 * g / (1 + g) * gain - 0.5 * parameters * std::log1p(g);
}

PhaseGain phase_gain(const TransitionModel& model, const Fit& better, const Fit& worse) {
  PhaseGain gain;
  for (std::size_t i = 0; i < model.events().size(); ++i)
    (model.events()[i].kind == EventKind::stance ? gain.stances : gain.collisions) +=
        2 * (better.evaluation.log_density[i] - worse.evaluation.log_density[i]);
  return gain;
}

double evidence_of(const ScannedEffect& scanned, double gain, const Rules& rules) {
  const auto parameters = static_cast<double>(scanned.candidate->parameters.size());
  const double g = rules.expected_gain / std::max(1.0, parameters), shrink = g / (1 + g);
  const double best = scanned.gain[scanned.best];
  double sum = 0;
  for (std::size_t v = 0; v < scanned.gain.size(); ++v) {
    const double share = v == scanned.best || !(best > 0) ? 1 : scanned.gain[v] / best;
    sum += std::exp(0.5 * shrink * gain * (std::min(1.0, share) - 1));
  }
  return evidence_of_gain(gain, parameters, rules) + std::log(sum / static_cast<double>(scanned.gain.size()));
}

double earned(const TransitionModel& model, const Fit& pair, const Fit& first, const Fit& exact, const Rules& rules) {
  const PhaseGain before = phase_gain(model, first, exact), now = phase_gain(model, pair, first);
  const double tolerated = rules.square_error();
  // What the second effect gained by itself counts alone: one phase may have paid for the other, or for a prior.
  const double all = 2 * (pair.penalised - first.penalised);
  const double beyond = std::max(0.0, now.collisions - tolerated * std::max(0.0, before.collisions)) +
                        std::max(0.0, now.stances - tolerated * std::max(0.0, before.stances));
  return std::max(0.0, std::min(all, beyond));
}

}  // namespace metastable::analysis
