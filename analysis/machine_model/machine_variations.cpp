#include "analysis/machine_model/machine_variations.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;
using Weight = std::function<double(const StepPlace&, std::size_t parameter)>;

constexpr double largest_push = 1;     // in sds of a column's change from row to row
constexpr double largest_scatter = 1;  // of the logarithm of the scores' spread
constexpr double step = 1e-3;
constexpr int waves = 3;  // along the way, and over the runs

// Something that a step may go by, with a number for each of its parameters.
struct Facet {
  std::string name;
  std::size_t parameters;
  Weight weight;
  std::vector<std::string> named = {};  // effects that go by it with one number, too
};

double wave(double share, std::size_t parameter) {
  const double angle = std::numbers::pi * static_cast<double>(parameter / 2 + 1) * share;
  return parameter % 2 == 0 ? std::cos(angle) : std::sin(angle);
}

std::vector<Facet> facets(const Machine& machine, const MachineDesign& design) {
  std::vector<Facet> all;
  // A parameter that differs between two values of a column is one number.
  const auto of_two = [&](std::size_t values, const std::string& column) {
    std::vector<std::string> named;
    for (std::size_t k = 0; values == 2 && k < machine.may_vary.size(); ++k)
      named.push_back(machine.may_vary[k] + "_by_" + column);
    return named;
  };
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    all.push_back({machine.observe[j].state, 2, [j](const StepPlace& at, std::size_t i) {
                     const double x = std::clamp(at.seen[j], -4.0, 4.0);
                     return i == 0 ? x : (x * x - 1) / std::numbers::sqrt2;
                   }});
  for (std::size_t i = 0; i < machine.inputs.size(); ++i)
    if (!design.inputs[i].by_phase)
      all.push_back({machine.inputs[i], design.inputs[i].changes ? input_lags : 1,
                     [i](const StepPlace& at, std::size_t lag) { return at.inputs[input_lags * i + lag]; }});
  if (design.phases.size() > 1)
    all.push_back({"phase", design.phases.size() - 1,
                   [](const StepPlace& at, std::size_t i) { return at.phase == static_cast<int>(i) ? 1.0 : 0.0; },
                   of_two(design.phases.size(), "phase")});
  if (design.trials > 4)
    all.push_back(
        {"order of trials", 2 * waves, [](const StepPlace& at, std::size_t i) { return wave(at.run + 0.5, i); }});
  all.push_back({"step number", 2, [](const StepPlace& at, std::size_t i) {
                   return i == 0 ? 2 / std::sqrt(1.0 + at.number) : (at.number % 2 == 0 ? 1.0 : -1.0);
                 }});
  if (design.placed) {
    const double from = design.first_position, way = design.last_position - design.first_position;
    all.push_back({"place", 4 * waves,
                   [from, way](const StepPlace& at, std::size_t i) { return wave((at.position - from) / way, i); }});
  }
  if (design.timed) {
    const double from = design.first_time, whole = design.last_time - design.first_time;
    all.push_back({"clock", 4 * waves,
                   [from, whole](const StepPlace& at, std::size_t i) { return wave((at.time - from) / whole, i); }});
  }
  for (std::size_t l = 0; l < design.labels.size(); ++l)
    if (design.labels[l].values.size() > 1)
      all.push_back(
          {design.labels[l].name, design.labels[l].values.size() - 1,
           [l](const StepPlace& at, std::size_t i) { return at.labels[l] == static_cast<int>(i) ? 1.0 : 0.0; },
           of_two(design.labels[l].values.size(), design.labels[l].name)});
  return all;
}

MachineVariation variation(const Facet& facet, const std::string& aspect, double most) {
  MachineVariation one;
  one.variation.facet = facet.name;
  one.variation.aspect = aspect;
  one.variation.named = facet.named;
  one.variation.candidate.id = aspect + " by " + facet.name;
  one.variation.candidate.parameters.assign(facet.parameters, {0, -most, most, step * most});
  return one;
}

std::vector<double> summed(const MachineDesign& design, const Facet& facet, const Values& v) {
  return by_step(design, [&](const StepPlace& at) {
    double sum = 0;
    for (std::size_t i = 0; i < v.size(); ++i)
      if (v[i] != 0) sum += v[i] * facet.weight(at, i);
    return sum;
  });
}

}  // namespace

std::vector<MachineVariation> machine_variations(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  std::vector<MachineVariation> all;
  for (const Facet& facet : facets(machine, *design)) {
    for (std::size_t j = 0; j < machine.observe.size(); ++j) {
      const double most = largest_push * (design->change[j] > 0 ? design->change[j] : 1);
      MachineVariation one = variation(facet, "mean " + machine.observe[j].state, most);
      one.apply = [design, facet, state = machine.state_index(machine.observe[j].state)](
                      MachineHypothesis& h, const Values&, const Values& v) {
        h.pushes.push_back({state, summed(*design, facet, v)});
      };
      all.push_back(std::move(one));
    }
    MachineVariation one = variation(facet, "scatter", largest_scatter);
    one.apply = [design, facet](MachineHypothesis& h, const Values&, const Values& v) {
      std::vector<double> log_ratio = summed(*design, facet, v);
      h.scatter.resize(log_ratio.size(), 1.0);
      for (std::size_t i = 0; i < log_ratio.size(); ++i) h.scatter[i] *= std::exp(std::clamp(log_ratio[i], -3.0, 3.0));
    };
    all.push_back(std::move(one));
  }
  return all;
}

MachineVariation even_push(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  MachineVariation one;
  one.variation.candidate.id = "even push";
  std::vector<std::size_t> states;
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const double most = largest_push * (design->change[j] > 0 ? design->change[j] : 1);
    one.variation.candidate.parameters.push_back({0, -most, most, step * most});
    states.push_back(machine.state_index(machine.observe[j].state));
  }
  one.apply = [states, steps = design->steps.size()](MachineHypothesis& h, const Values&, const Values& v) {
    for (std::size_t j = 0; j < states.size(); ++j) h.pushes.push_back({states[j], Values(steps, v[j])});
  };
  return one;
}

}  // namespace metastable::analysis
