#include "analysis/fitting/bayes_factor.h"

#include <algorithm>
#include <cmath>

namespace metastable::analysis {

namespace {

// Returns the expected gain a parameter: the rule's, or the larger one that makes the evidence of this gain largest.
double expected_of(double gain, double parameters, const Rules& rules) {
  return std::max(rules.expected_gain, gain - parameters) / std::max(1.0, parameters);
}

}  // namespace

double evidence_of_gain(double gain, double parameters, const Rules& rules) {
  const double g = expected_of(gain, parameters, rules);
  return 0.5 * g / (1 + g) * gain - 0.5 * parameters * std::log1p(g);
}

PhaseGain phase_gain(const TransitionModel& model, const Fit& better, const Fit& worse) {
  PhaseGain gain;
  for (std::size_t i = 0; i < model.events().size(); ++i)
    gain.of(model.events()[i]) += 2 * (better.evaluation.log_density[i] - worse.evaluation.log_density[i]);
  return gain;
}

double evidence_of(const ScannedEffect& scanned, double gain, const Rules& rules) {
  const auto parameters = static_cast<double>(scanned.candidate->parameters.size());
  const double g = expected_of(gain, parameters, rules), shrink = g / (1 + g);
  const double best = scanned.gain[scanned.best];
  double sum = 0;
  for (std::size_t v = 0; v < scanned.gain.size(); ++v) {
    const double share = v == scanned.best || !(best > 0) ? 1 : scanned.gain[v] / best;
    sum += std::exp(0.5 * shrink * gain * (std::min(1.0, share) - 1));
  }
  return evidence_of_gain(gain, parameters, rules) + std::log(sum / static_cast<double>(scanned.gain.size()));
}

namespace {

// Returns the part of a gain that an error of form of the gain before it does not account for, phase by phase.
double beyond_form(const PhaseGain& now, const PhaseGain& before, const Rules& rules) {
  const double tolerated = rules.square_error();
  return std::max(0.0, now.collisions - tolerated * std::max(0.0, before.collisions)) +
         std::max(0.0, now.stances - tolerated * std::max(0.0, before.stances));
}

}  // namespace

double earned(const TransitionModel& model, const Fit& pair, const Fit& first, const Fit& exact, const Rules& rules) {
  // What the second effect gained by itself counts alone: one phase may have paid for the other, or for a prior.
  const double all = 2 * (pair.penalised - first.penalised);
  return std::clamp(beyond_form(phase_gain(model, pair, first), phase_gain(model, first, exact), rules), 0.0,
                    std::max(0.0, all));
}

double promised_to_earn(const TransitionModel& model, const ScannedEffect& scanned, const Fit& first, const Fit& exact,
                        const Rules& rules) {
  return std::min(scanned.gain[scanned.best], beyond_form(scanned.by_phase, phase_gain(model, first, exact), rules));
}

}  // namespace metastable::analysis
