#pragma once
// Machines that the tests bring, and runs of them.

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_hypothesis.h"
#include "analysis/machine_model/machine_runs.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis::test {

inline constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// x' = a x + b + s z, seen with an error of sd `error` that neighbouring rows share by `correlation`.
inline Machine linear_machine(double error, double correlation = 0) {
  Machine machine;
  machine.states = {"x"};
  machine.parameters = {{"a", 0.8, 0.05}, {"b", 0.3, 0.1}, {"s", 0.2, 0.05, 0.01, 2}};
  machine.effects = {{"bend", {{"c", 0, -0.5, 0.5}}}};
  machine.may_vary = {"b"};
  machine.observe = {{"x", error, correlation}};
  machine.most_wild = 0;
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double x = batch.states[i];
      batch.next[i] =
          batch.value(0, i) * x + batch.value(1, i) + batch.value(2, i) * batch.scores[i] + batch.value(3, i) * x * x;
    }
  };
  return machine;
}

/// Runs of x' = f(x, z) with an error of measurement, from launches about `first`.
template <class Next>
MachineRuns scalar_runs(std::size_t trials, std::size_t rows, double first, double error, unsigned seed, Next next) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  MachineRuns runs;
  for (std::size_t t = 0; t < trials; ++t) {
    MachineTrial& trial = runs.trials.emplace_back();
    double x = first + 0.3 * normal(generator);
    for (std::size_t k = 0; k < rows; ++k) {
      if (k > 0) x = next(x, normal(generator), t);
      MachineRow& row = trial.rows.emplace_back();
      row.seen = {x + error * normal(generator)};
    }
    trial.outcome = MachineOutcome::stopped;
  }
  return runs;
}

/// Supposes what the machine states.
inline MachineHypothesis nominal_of(const Machine& machine) {
  MachineHypothesis h;
  for (const MachineParameter& p : machine.parameters) h.values.push_back(p.nominal);
  for (const MachineEffect& effect : machine.effects)
    for (const SuspectedParameter& p : effect.parameters) h.values.push_back(p.neutral);
  for (const MachineSensor& sensor : machine.observe) h.sensor_sd.push_back(sensor.sd.value_or(0));
  return h;
}

/// Returns the distance of scores from the standard normal, times the root of their number.
inline double kolmogorov(std::vector<double> scores) {
  std::ranges::sort(scores);
  const auto n = static_cast<double>(scores.size());
  double most = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const double p = dynamics::normal_cdf(scores[i]);
    most = std::max({most, std::abs(p - static_cast<double>(i) / n), std::abs(p - static_cast<double>(i + 1) / n)});
  }
  return most * std::sqrt(n);
}

}  // namespace metastable::analysis::test
