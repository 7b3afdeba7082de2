#include "analysis/machine_model/machine_variations.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>
#include <utility>

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;
using Weight = std::function<double(const StepPlace&, std::size_t parameter)>;

// Pushes are at most so many of a column's usual changes from row to row. One that is the same at every step may be
// most of what a machine does, as the loss of a drum that coasts down.
constexpr double largest_push = 1, largest_even_push = 3;
constexpr double largest_scatter = 1;  // of the logarithm of the scores' spread
constexpr double step = 1e-3;
constexpr int waves = 3;  // along the way, and over the runs

// Something swings: frequencies are tried so far apart [cycles a step], below the fastest that steps can show. What a
// launch sets swinging comes to rest within about so many steps.
constexpr double swings_apart = 0.05, fastest_swing = 0.475, steps_of_a_swing = 10;

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

// Returns an input of this step or of those before, then the square and the cube of this step's, without its line.
double by_input(const StepPlace& at, std::size_t input, std::size_t part) {
  if (part < input_lags) return at.inputs[input_lags * input + part];
  const double x = std::clamp(at.inputs[input_lags * input], -4.0, 4.0);
  return part == input_lags ? (x * x - 1) / std::numbers::sqrt2 : (x * x - 3) * x / std::sqrt(6.0);
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
      all.push_back({machine.inputs[i], design.inputs[i].changes ? 2 + input_lags : 1,
                     [i](const StepPlace& at, std::size_t part) { return by_input(at, i, part); }});
  if (design.phases.size() > 1)
    all.push_back({"phase", design.phases.size() - 1,
                   [](const StepPlace& at, std::size_t i) { return at.phase == static_cast<int>(i) ? 1.0 : 0.0; },
                   of_two(design.phases.size(), "phase")});
  if (design.trials >= trials_of_a_spread)
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

double usual_change(const MachineDesign& design, std::size_t sensor) {
  return design.usual_change[sensor] > 0 ? design.usual_change[sensor] : 1;
}

std::vector<std::size_t> observed_states(const Machine& machine) {
  std::vector<std::size_t> states;
  for (const MachineSensor& sensor : machine.observe) states.push_back(machine.state_index(sensor.state));
  return states;
}

std::vector<double> summed(const MachineDesign& design, const Facet& facet, const Values& v) {
  return by_step(design, [&](const StepPlace& at) {
    double sum = 0;
    for (std::size_t i = 0; i < v.size(); ++i)
      if (v[i] != 0) sum += v[i] * facet.weight(at, i);
    return sum;
  });
}

// Returns a swing of some cycles a step: its cosine and its sine.
double swing(const StepPlace& at, double cycles, std::size_t part) {
  const double angle = 2 * std::numbers::pi * cycles * at.number;
  return part == 0 ? std::cos(angle) : std::sin(angle);
}

// Something swings with a frequency, which is the entry of its variant, and no effect does.
void let_swing(Variation& one) {
  one.beside = true;
  one.candidate.variants.clear();
  for (double cycles = swings_apart; cycles < fastest_swing; cycles += swings_apart)
    one.candidate.variants.push_back({cycles});
  one.candidate.refine = {swings_apart};
}

// A swing that every launch sets off alike pushes all states that are measured.
MachineVariation swing_from_launch(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  MachineVariation one = even_push(machine, design);
  one.variation.facet = "a swing from the launch";
  one.variation.aspect = "mean";
  one.variation.candidate.id = "a swing from the launch";
  const std::vector<FreeParameter> parts = one.variation.candidate.parameters;
  std::ranges::copy(parts, std::back_inserter(one.variation.candidate.parameters));
  let_swing(one.variation);
  one.apply = [design, states = observed_states(machine)](MachineHypothesis& h, const Values& variant,
                                                          const Values& v) {
    for (std::size_t j = 0; j < states.size(); ++j)
      h.pushes.push_back({states[j], by_step(*design, [&](const StepPlace& at) {
                            return std::exp(-at.number / steps_of_a_swing) *
                                   (v[j] * swing(at, variant[0], 0) + v[states.size() + j] * swing(at, variant[0], 1));
                          })});
  };
  return one;
}

// Something that swings on from a phase of its own in each trial pushes a state.
MachineVariation swing_in_trial(const Machine& machine, std::shared_ptr<const MachineDesign> design, std::size_t sensor,
                                double most) {
  const std::string& name = machine.observe[sensor].state;
  MachineVariation one = variation({"a swing in each trial", 1, {}}, "mean " + name, most);
  one.variation.candidate.parameters = {{0, 0, most * most, 1e-6 * most * most, 1e-2 * most * most}};
  let_swing(one.variation);
  one.apply = [design, state = machine.state_index(name)](MachineHypothesis& h, const Values& variant,
                                                          const Values& v) {
    if (!(v[0] > 0)) return;
    for (const std::size_t part : {0, 1})
      h.push_spreads.push_back(
          {state, std::sqrt(v[0]), by_step(*design, [&](const StepPlace& at) { return swing(at, variant[0], part); })});
  };
  return one;
}

}  // namespace

std::vector<MachineVariation> machine_variations(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  std::vector<MachineVariation> all;
  for (const Facet& facet : facets(machine, *design)) {
    for (std::size_t j = 0; j < machine.observe.size(); ++j) {
      const double most = largest_push * usual_change(*design, j);
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
  all.push_back(swing_from_launch(machine, design));
  // A swing of its own in each trial takes a likelihood for every frequency and state in each scan, and more points in
  // each: three states, a tenth of all rows of a diagnosis. Where calls are dear they are spared.
  const bool many = machine.dear && machine.observe.size() > 1;
  for (std::size_t j = 0; !many && design->trials >= trials_of_a_spread && j < machine.observe.size(); ++j)
    all.push_back(swing_in_trial(machine, design, j, largest_push * usual_change(*design, j)));
  return all;
}

MachineVariation even_push(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  MachineVariation one;
  one.variation.candidate.id = "even push";
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const double most = largest_even_push * usual_change(*design, j);
    one.variation.candidate.parameters.push_back({0, -most, most, step * most});
  }
  one.apply = [states = observed_states(machine), steps = design->steps.size()](MachineHypothesis& h, const Values&,
                                                                                const Values& v) {
    for (std::size_t j = 0; j < states.size(); ++j) h.pushes.push_back({states[j], Values(steps, v[j])});
  };
  return one;
}

}  // namespace metastable::analysis
