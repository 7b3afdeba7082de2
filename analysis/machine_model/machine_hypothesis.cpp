#include "analysis/machine_model/machine_hypothesis.h"

#include <algorithm>
#include <cmath>

namespace metastable::analysis {
namespace {

// Says whether a hypothesis has nothing but values, sensors and what adds to single transitions.
bool only_adds(const MachineHypothesis& h, const MachineHypothesis& plain) {
  return h.values == plain.values && h.sensor_sd == plain.sensor_sd && h.wild == plain.wild && h.laws.empty() &&
         h.spreads.empty() && h.push_spreads.empty() && h.memory.empty() && h.added_noise.empty() && h.bias.empty() &&
         h.launch_offset.empty() && h.launch_scatter.empty() && h.lag.empty() && h.filter.empty() && h.outliers == 0;
}

std::vector<double> per(double step, std::vector<double> transition) {
  for (double& one : transition) one /= step;
  return transition;
}

}  // namespace

std::vector<double> MachineHypothesis::offset_sds() const {
  std::vector<double> all;
  for (const Spread& one : spreads) all.push_back(one.sd);
  for (const PushSpread& one : push_spreads) all.push_back(one.sd);
  return all;
}

NormalLaunch supposed_launch(const MachineHypothesis& hypothesis, const MachineLaunch& launch, std::size_t state) {
  NormalLaunch at{launch.mean, launch.sd};
  if (!hypothesis.launch_offset.empty()) at.mean += hypothesis.launch_offset[state];
  if (!hypothesis.launch_scatter.empty()) at.sd = std::hypot(at.sd, hypothesis.launch_scatter[state]);
  return at;
}

void add(MachineHypothesis& hypothesis, std::size_t states, const Addition& added) {
  const std::size_t values = hypothesis.values.size();
  if (added.number < values) {
    hypothesis.changes.push_back({added.number, added.weights});
  } else if (added.number < values + states) {
    hypothesis.pushes.push_back({added.number - values, added.weights});
  } else {
    hypothesis.scatter.resize(added.weights.size(), 1.0);
    for (std::size_t k = 0; k < added.weights.size(); ++k) hypothesis.scatter[k] *= std::exp(added.weights[k]);
  }
}

std::optional<Addition> addition_of(const MachineHypothesis& plain, const MachineHypothesis& changed,
                                    std::size_t states, double step) {
  if (!only_adds(changed, plain)) return std::nullopt;
  const std::size_t values = changed.values.size();
  const auto moves = [](const std::vector<double>& one) {
    return std::ranges::any_of(one, [](double x) { return x != 0; });
  };
  std::vector<Addition> found;
  for (const auto& one : changed.changes) found.push_back({one.value, per(step, one.transition)});
  for (const auto& one : changed.pushes)
    if (moves(one.transition)) found.push_back({values + one.state, per(step, one.transition)});
  for (const auto& one : changed.hidden) {
    if (one.pull == 0) continue;
    std::vector<double> pushed;
    for (const double ahead : one.ahead) pushed.push_back(one.pull * ahead);
    found.push_back({values + one.pushes, per(step, std::move(pushed))});
  }
  if (!changed.scatter.empty()) {
    std::vector<double> logarithms;
    for (const double one : changed.scatter) logarithms.push_back(std::log(one));
    found.push_back({values + states, per(step, std::move(logarithms))});
  }
  return found.size() == 1 ? std::optional(std::move(found.front())) : std::nullopt;
}

}  // namespace metastable::analysis
