#include "analysis/machine_model/machine_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;

constexpr double fine_step = 1e-4;     // of a range, for differences
constexpr double widest_change = 0.5;  // of a nominal value, or
constexpr double most_sds = 5;         //   of the sd with which it is known: how far a parameter may vary
// Frequencies of a clock lie half a period of the record apart, where a sine between two of them shows nine tenths of
// itself in the nearer one. All parameters that may vary share 512 frequencies: those of a single one reach 256 periods
// in the record.
constexpr std::size_t most_waves = 512, fewest_waves = 128;
constexpr double waves_apart = 0.5;
constexpr int stretches = 6;  // of the way
// A sine of the clock is not told from what the switches of an input do where so much of them, by their sizes, falls on
// one phase of it. Fewer switches fall on one by chance.
constexpr double most_in_phase = 0.8;
constexpr std::size_t fewest_switches = 3;
// A drift is not told from what changes with a state whose column keeps less than a tenth of its variance beside the
// order of trials.
constexpr double most_along_order = 0.95;
constexpr long much_rarer =
    2;  // The second of two values is named where the first has more than so many times its steps.
constexpr double largest_memory = 0.9, all_noises = -1;
// Zeros of sensors are known to a share of what a column spans, or to some of its errors.
constexpr double usual_bias = 0.1, bias_errors = 3;
constexpr double largest_share = 0.2;  // of outliers
constexpr double longest_lag = 3;      // Inputs act so many steps late at most.
constexpr double longest_kept = 0.98;  // A filter of an input keeps such a share from step to step at most.
// States that the map lacks follow a measured one with time constants this far apart (of their logarithms), from this
// shortest one [steps] to the longest trial; trials of so few steps show none.
constexpr double constants_apart = 0.5, shortest_constant = 1.5;
constexpr std::size_t fewest_followed = 8;
// They are not told from what changes with the states where these leave less of their variance, at every constant.
constexpr double least_beside_states = 0.2;
constexpr double widest_launch = 10;  // launches are off by so many of their stated sds at most, at least
constexpr double launch_errors = 4;   // standard errors from which on first rows suggest a size by themselves

// Returns how far a parameter may vary to either side.
double range_of(const MachineParameter& p) {
  const double range = std::max(widest_change * std::abs(p.nominal), most_sds * p.sd);
  return range > 0 ? range : 1;
}

std::function<std::vector<NamedValue>(const Values&, const Values&)> reporting(std::vector<std::string> variant,
                                                                               std::vector<std::string> values) {
  return [variant = std::move(variant), values = std::move(values)](const Values& at, const Values& v) {
    std::vector<NamedValue> all;
    for (std::size_t i = 0; i < values.size(); ++i) all.emplace_back(values[i], v[i]);
    for (std::size_t i = 0; i < variant.size(); ++i) all.emplace_back(variant[i], at[i]);
    return all;
  };
}

MachineCandidate suspected(const MachineEffect& effect, std::size_t first) {
  MachineCandidate one;
  one.candidate.id = effect.id;
  std::vector<std::string> names;
  for (const SuspectedParameter& p : effect.parameters) {
    one.candidate.parameters.push_back({p.neutral, p.lower, p.upper, fine_step * (p.upper - p.lower)});
    names.push_back(p.name);
  }
  one.candidate.seek_far = effect.parameters.size() == 1;
  one.candidate.report = reporting({}, std::move(names));
  one.apply = [first](MachineHypothesis& h, const Values&, const Values& v) {
    for (std::size_t i = 0; i < v.size(); ++i) h.values[first + i] = v[i];
  };
  return one;
}

// Reports a change in one of several, by its name.
std::function<std::vector<NamedValue>(const Values&, const Values&)> changed_in(std::vector<std::string> names) {
  return [names = std::move(names)](const Values& at, const Values& v) {
    return std::vector<NamedValue>{{"change_in_" + names.at(static_cast<std::size_t>(at[0])), v[0]}};
  };
}

// Says whether an input switches at one phase of a sine of the clock, period by period.
bool input_switches_at(const MachineDesign& design, double frequency) {
  for (std::size_t i = 0; i < design.inputs.size(); ++i) {
    double all = 0, cosines = 0, sines = 0;
    std::size_t switches = 0;
    for (const StepPlace& at : design.steps) {
      const double size = std::abs(at.inputs[input_lags * i] - at.inputs[input_lags * i + 1]);
      if (size == 0) continue;
      const double angle = 2 * std::numbers::pi * frequency * (at.time - design.first_time);
      ++switches;
      all += size;
      cosines += size * std::cos(angle);
      sines += size * std::sin(angle);
    }
    if (switches >= fewest_switches && std::hypot(cosines, sines) > most_in_phase * all) return true;
  }
  return false;
}

// The effects in which one parameter of the machine varies.
class Varying {
 public:
  Varying(const Machine& machine, const MachineParameter& parameter, std::size_t value,
          std::shared_ptr<const MachineDesign> design)
      : machine_(machine),
        parameter_(parameter),
        value_(value),
        shared_(std::move(design)),
        design_(*shared_),
        range_(range_of(parameter)) {}

  std::vector<MachineCandidate> all() const {
    const std::size_t waves = std::max(fewest_waves, most_waves / machine_.may_vary.size());
    std::vector<MachineCandidate> list{by_phase(), drift(), spread(), clock(waves), stretch()};
    for (std::size_t j = 0; j < machine_.observe.size(); ++j) list.push_back(with_state(j));
    for (std::size_t l = 0; l < design_.labels.size(); ++l) list.push_back(by_label(l));
    return list;
  }

 private:
  using Weight = std::function<double(const StepPlace&, const Values& variant, std::size_t parameter)>;

  FreeParameter change() const { return {0, -range_, range_, fine_step * range_}; }
  MachineCandidate named(const std::string& suffix) const {
    MachineCandidate one;
    one.candidate.id = parameter_.name + suffix;
    return one;
  }
  // Adds a sum of weights times values to the parameter, step by step.
  std::function<void(MachineHypothesis&, const Values&, const Values&)> adding(Weight weight) const {
    return [value = value_, design = shared_, weight = std::move(weight)](MachineHypothesis& h, const Values& variant,
                                                                          const Values& v) {
      h.changes.push_back({value, by_step(*design, [&](const StepPlace& place) {
                             double sum = 0;
                             for (std::size_t i = 0; i < v.size(); ++i)
                               if (v[i] != 0) sum += v[i] * weight(place, variant, i);
                             return sum;
                           })});
    };
  }

  // Two values of a column differ from each other by the same, whichever is said to differ, if the nominal value is
  // fitted: one of them is enough. It is the first one unless the second is much rarer, because what is stated of a
  // parameter holds for most steps.
  template <class ValueAt>
  void keep_rarer_of_two(Candidate& one, ValueAt value_at) const {
    if (one.variants.size() != 2 || !(parameter_.sd > 0)) return;
    const auto count = [&](int value) { return std::ranges::count(design_.steps, value, value_at); };
    if (much_rarer * count(1) < count(0)) std::swap(one.variants[0], one.variants[1]);
    one.variants.resize(1);
  }

  MachineCandidate by_phase() const {
    MachineCandidate one = named("_by_phase");
    one.candidate.parameters = {change()};
    one.candidate.variants.clear();
    for (std::size_t phase = 0; phase < std::max<std::size_t>(1, design_.phases.size()); ++phase)
      one.candidate.variants.push_back({static_cast<double>(phase)});
    keep_rarer_of_two(one.candidate, [](const StepPlace& at) { return at.phase; });
    if (design_.phases.size() < 2) one.candidate.undecidable = "the runs have no column of phases with two of them";
    one.candidate.report = changed_in(design_.phases);
    one.candidate.form_of = [phase = one.candidate.variants.front()](const Values& v) {
      return FittedForm{phase, {v[0]}};
    };
    one.apply = adding([](const StepPlace& at, const Values& variant, std::size_t) {
      return at.phase == static_cast<int>(variant[0]) ? 1.0 : 0.0;
    });
    return one;
  }
  MachineCandidate drift() const {
    MachineCandidate one = named("_drift");
    one.candidate.parameters = {change()};
    one.candidate.report = reporting({}, {"change_over_the_runs"});
    if (design_.trials < 3) one.candidate.undecidable = "a drift over the runs takes three trials";
    for (std::size_t j = 0; one.candidate.undecidable.empty() && j < design_.along_order.size(); ++j)
      if (std::abs(design_.along_order[j]) > most_along_order)
        one.candidate.undecidable = fmt::format(
            "the order of trials goes with {} (correlation {:.2f}), as where one long run was cut into trials: what "
            "changes with the one would be called a drift",
            machine_.observe[j].state, design_.along_order[j]);
    one.apply = adding([](const StepPlace& at, const Values&, std::size_t) { return at.run; });
    return one;
  }
  MachineCandidate spread() const {
    MachineCandidate one = named("_spread");
    one.candidate.parameters = {{0, 0, range_ * range_, 1e-6 * range_ * range_, 1e-2 * range_ * range_}};
    one.candidate.report = [](const Values&, const Values& v) {
      return std::vector<NamedValue>{{"sd_between_trials", std::sqrt(std::max(0.0, v[0]))}};
    };
    one.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] * v[0]}}; };
    if (design_.trials < trials_of_a_spread)
      one.candidate.undecidable = fmt::format("a spread between trials takes {} of them", trials_of_a_spread);
    one.apply = [value = value_](MachineHypothesis& h, const Values&, const Values& v) {
      if (v[0] > 0) h.spreads.push_back({value, std::sqrt(v[0])});
    };
    return one;
  }
  MachineCandidate clock(std::size_t waves) const {
    MachineCandidate one = named("_clock");
    one.candidate.parameters = {change(), change()};
    one.candidate.variants.clear();
    const double whole = design_.last_time - design_.first_time, fastest = 2 * design_.usual_gap;
    if (design_.timed && whole > 2 * fastest) {
      const double apart = waves_apart / whole;
      // The fastest frequency itself is left out, as rounding would decide whether the list reaches it.
      const double end = 0.999 / fastest;
      for (double f = 1 / whole; one.candidate.variants.size() < waves && f < end; f += apart)
        if (!input_switches_at(design_, f)) one.candidate.variants.push_back({f});
      one.candidate.refine = {apart};
      if (one.candidate.variants.empty()) {
        one.candidate.variants = {{1 / whole}};
        one.candidate.undecidable = "an input switches by the clock, at every frequency that could be told";
      }
    } else {
      one.candidate.variants = {{1.0}};
      one.candidate.undecidable = "the runs have no clock: a time_s for every row, by one clock for all trials";
    }
    one.candidate.report = [](const Values& variant, const Values& v) {
      return std::vector<NamedValue>{{"amplitude", std::hypot(v[0], v[1])}, {"frequency_hz", variant[0]}};
    };
    one.candidate.form_of = [](const Values& v) { return FittedForm{{v[1]}, {v[0], 0}}; };  // it begins at its height
    one.apply = adding([first = design_.first_time](const StepPlace& at, const Values& variant, std::size_t i) {
      const double angle = 2 * std::numbers::pi * variant[0] * (at.time - first);
      return i == 0 ? std::cos(angle) : std::sin(angle);
    });
    return one;
  }
  MachineCandidate stretch() const {
    MachineCandidate one = named("_stretch");
    one.candidate.parameters = {change()};
    one.candidate.variants.clear();
    const double way = (design_.last_position - design_.first_position) / stretches;
    if (design_.placed) {
      for (int from = 0; from < stretches; ++from)
        for (int to = from + 1; to <= std::min(stretches, from + stretches / 2); ++to)
          one.candidate.variants.push_back({design_.first_position + from * way, design_.first_position + to * way});
      one.candidate.refine = {0.5 * way, 0.5 * way};
    } else {
      one.candidate.variants = {{0.0, 0.0}};
      one.candidate.undecidable = "the runs have no position_m for every row";
    }
    one.candidate.report = reporting({"from_m", "to_m"}, {"change"});
    one.candidate.form_of = [](const Values& v) { return FittedForm{{v[1], v[2]}, {v[0]}}; };
    one.apply = adding([](const StepPlace& at, const Values& variant, std::size_t) {
      return at.position >= variant[0] && at.position < variant[1] ? 1.0 : 0.0;
    });
    return one;
  }
  MachineCandidate with_state(std::size_t sensor) const {
    MachineCandidate one = named("_with_" + machine_.observe[sensor].state);
    one.candidate.parameters = {change()};
    one.candidate.report = reporting({}, {"change_a_sd_of_the_state"});
    const double sd = design_.sd[sensor] > 0 ? design_.sd[sensor] : 1;
    one.apply = [value = value_, state = machine_.state_index(machine_.observe[sensor].state), sd,
                 mean = design_.mean[sensor]](MachineHypothesis& h, const Values&, const Values& v) {
      h.laws.push_back({value, state, v[0] / sd, mean});
    };
    return one;
  }
  MachineCandidate by_label(std::size_t label) const {
    const MachineLabel& column = design_.labels[label];
    MachineCandidate one = named("_by_" + column.name);
    one.candidate.parameters = {change()};
    one.candidate.variants.clear();
    for (std::size_t v = 0; v < std::max<std::size_t>(1, column.values.size()); ++v)
      one.candidate.variants.push_back({static_cast<double>(v)});
    keep_rarer_of_two(one.candidate, [label](const StepPlace& at) { return at.labels[label]; });
    if (column.values.size() < 2) one.candidate.undecidable = fmt::format("{} has one value", column.name);
    one.candidate.report = changed_in(column.values);
    one.apply = adding([label](const StepPlace& at, const Values& variant, std::size_t) {
      return at.labels[label] == static_cast<int>(variant[0]) ? 1.0 : 0.0;
    });
    return one;
  }

  const Machine& machine_;
  const MachineParameter& parameter_;
  std::size_t value_;
  std::shared_ptr<const MachineDesign> shared_;
  const MachineDesign& design_;
  double range_;
};

// One noise remembers, or all of them do alike, as where they come from the same ground: noise number 0.
MachineCandidate memory(const Machine& machine) {
  MachineCandidate one;
  one.candidate.id = "memory";
  one.candidate.parameters = {{0, -largest_memory, largest_memory, 1e-3}};
  one.candidate.variants.clear();
  for (int m = 0; m < machine.scores; ++m) one.candidate.variants.push_back({static_cast<double>(m)});
  if (machine.scores > 1) one.candidate.variants.push_back({all_noises});
  one.candidate.report = [](const Values& variant, const Values& v) {
    return std::vector<NamedValue>{{"correlation", v[0]}, {"noise_number", variant[0] + 1}};
  };
  one.candidate.form_of = [](const Values& v) { return FittedForm{{v[1] - 1}, {v[0]}}; };
  one.apply = [scores = static_cast<std::size_t>(machine.scores)](MachineHypothesis& h, const Values& variant,
                                                                  const Values& v) {
    h.memory.resize(scores);
    if (variant[0] == all_noises)
      std::ranges::fill(h.memory, v[0]);
    else
      h.memory[static_cast<std::size_t>(variant[0])] = v[0];
  };
  return one;
}

// A recorded input acts later, as through an actuator that lags.
MachineCandidate lag(const Machine& machine, const MachineDesign& design, std::size_t input) {
  MachineCandidate one;
  one.candidate.id = "lag_" + machine.inputs[input];
  one.candidate.parameters = {{0, 0, longest_lag, fine_step * longest_lag}};
  one.candidate.seek_far = true;
  one.candidate.report = reporting({}, {"steps"});
  if (!design.inputs[input].changes)
    one.candidate.undecidable = machine.inputs[input] + " changes within no trial";
  else if (design.inputs[input].code)
    one.candidate.undecidable = machine.inputs[input] +
                                " has few values, all whole, and is taken for a code (a gear, a leg), which has no "
                                "values in between; one that has a unit, by the end of its name or stated, is none";
  one.apply = [input, inputs = machine.inputs.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.lag.resize(inputs);
    h.lag[input] = v[0];
  };
  return one;
}

// A recorded input acts through a filter of first order, as through a slow actuator.
MachineCandidate filter(const Machine& machine, const MachineDesign& design, std::size_t input) {
  MachineCandidate one = lag(machine, design, input);
  one.candidate.id = "filtered_" + machine.inputs[input];
  one.candidate.parameters = {{0, 0, longest_kept, fine_step}};
  one.candidate.report = [](const Values&, const Values& v) {
    return std::vector<NamedValue>{{"time_constant_steps", v[0] > 0 ? -1 / std::log(v[0]) : 0}};
  };
  one.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] > 0 ? std::exp(-1 / v[0]) : 0}}; };
  one.apply = [input, inputs = machine.inputs.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.filter.resize(inputs);
    h.filter[input] = v[0];
  };
  return one;
}

// Returns what is kept from step to step with a time constant, given by its logarithm.
double kept_with(double log_constant) { return std::exp(-std::exp(-log_constant)); }

// The map lacks a state that follows a measured one and pushes it or another one, as the wall of a room that is heated,
// or what hangs on a compliance. An entry of a variant is the logarithm of its time constant [steps], and a sensor.
MachineCandidate hidden_state(const Machine& machine, std::shared_ptr<const MachineDesign> design, std::size_t sensor) {
  MachineCandidate one;
  one.candidate.id = "hidden_state_" + machine.observe[sensor].state;
  double most = 1;
  for (const double sd : design->sd)
    if (design->sd[sensor] > 0) most = std::max(most, sd / design->sd[sensor]);
  one.candidate.parameters = {{0, -most, most, fine_step}};
  int longest = 0;
  for (const StepPlace& at : design->steps) longest = std::max(longest, at.number);
  one.candidate.variants.clear();
  double beside = 0;
  for (double constant = std::log(shortest_constant); constant < std::log(longest); constant += constants_apart) {
    beside = std::max(beside, share_beside_states(*design, sensor, ahead_of(*design, sensor, kept_with(constant))));
    for (std::size_t j = 0; j < machine.observe.size(); ++j)
      one.candidate.variants.push_back({constant, static_cast<double>(j)});
  }
  one.candidate.refine = {constants_apart, 0};
  const bool short_trials = longest < static_cast<int>(fewest_followed);
  if (short_trials || beside < least_beside_states) {
    one.candidate.variants = {{std::log(shortest_constant), static_cast<double>(sensor)}};
    one.candidate.undecidable =
        short_trials ? fmt::format("it takes trials of {} steps and more", fewest_followed)
                     : fmt::format(
                           "what follows {0} goes with {0} and the number of the step in these trials, so that "
                           "whatever goes with these would be called so: it takes trials that differ more",
                           machine.observe[sensor].state);
  }
  one.candidate.report = [sensors = machine.observe.size()](const Values& variant, const Values& v) {
    std::vector<NamedValue> all{{"pull", v[0]}, {"time_constant_steps", std::exp(variant[0])}};
    if (sensors > 1) all.emplace_back("state_number", variant[1] + 1);
    return all;
  };
  one.candidate.form_of = [sensor](const Values& v) {
    return FittedForm{{std::log(v[1]), v.size() > 2 ? v[2] - 1 : static_cast<double>(sensor)}, {v[0]}};
  };
  std::vector<std::size_t> states;
  for (const MachineSensor& of : machine.observe) states.push_back(machine.state_index(of.state));
  one.apply = [sensor, design, states](MachineHypothesis& h, const Values& variant, const Values& v) {
    const double kept = kept_with(variant[0]);
    h.hidden.push_back(
        {states[sensor], states[static_cast<std::size_t>(variant[1])], kept, v[0], ahead_of(*design, sensor, kept)});
  };
  return one;
}

MachineCandidate outliers() {
  MachineCandidate one;
  one.candidate.id = "outliers";
  one.candidate.parameters = {{0, 0, largest_share, 1e-4, 0.02}};
  one.candidate.report = reporting({}, {"share"});
  one.apply = [](MachineHypothesis& h, const Values&, const Values& v) { h.outliers = v[0]; };
  return one;
}

MachineCandidate sensor_noise(const Machine& machine, const MachineDesign& design, std::size_t sensor) {
  MachineCandidate one;
  one.candidate.id = "sensor_noise_" + machine.observe[sensor].state;
  one.candidate.exact = true;
  const double most = design.sd[sensor] * design.sd[sensor], known = machine.observe[sensor].sd.value_or(0);
  const double usual = known > 0 ? known * known : 1e-4 * design.change[sensor] * design.change[sensor];
  one.candidate.parameters = {{0, 0, std::max(most, usual), 1e-2 * usual, usual}};
  one.candidate.report = [](const Values&, const Values& v) {
    return std::vector<NamedValue>{{"sd", std::sqrt(std::max(0.0, v[0]))}};
  };
  one.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] * v[0]}}; };
  if (!machine.observe[sensor].sd) one.candidate.undecidable = "the sensor's sd is not stated: it is fitted";
  one.apply = [sensor, sensors = machine.observe.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.added_noise.resize(sensors);
    h.added_noise[sensor] = std::sqrt(std::max(0.0, v[0]));
  };
  return one;
}

MachineCandidate sensor_bias(const Machine& machine, const MachineDesign& design, std::size_t sensor) {
  MachineCandidate one;
  one.candidate.id = "sensor_bias_" + machine.observe[sensor].state;
  one.candidate.exact = true;
  const double most = 2 * design.sd[sensor];
  const double known = std::max(usual_bias * design.sd[sensor], bias_errors * machine.observe[sensor].sd.value_or(0));
  one.candidate.parameters = {{0, -most, most, fine_step * most, 0, 0, known}};
  one.candidate.report = reporting({}, {"bias"});
  one.apply = [sensor, sensors = machine.observe.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.bias.resize(sensors);
    h.bias[sensor] = v[0];
  };
  return one;
}

// Holds the stated launch of a state beside the first values that were measured of it.
struct LaunchSeen {
  const MachineLaunch* stated;  // nullptr: nobody stated it
  bool measured;
  FirstValues first;
  double usual, most;  // sd that the first values have as stated; by how much they may be off
};

LaunchSeen launch_seen(const Machine& machine, const MachineDesign& design, std::size_t state) {
  const std::string& name = machine.states[state];
  const auto sensor = std::ranges::find(machine.observe, name, &MachineSensor::state);
  LaunchSeen seen{machine.stated_launch(name), sensor != machine.observe.end(), {}, 0, 0};
  if (seen.measured) {
    const auto j = static_cast<std::size_t>(sensor - machine.observe.begin());
    seen.first = design.first[j];
    seen.usual = sensor->sd.value_or(0);
    seen.most = 2 * design.sd[j];
  }
  if (seen.stated) {
    seen.usual = std::hypot(seen.usual, seen.stated->sd);
    seen.most = std::max({seen.most, std::abs(seen.stated->mean), widest_launch * seen.stated->sd});
  }
  if (!(seen.most > 0)) seen.most = 1;
  return seen;
}

MachineCandidate launch_effect(const std::string& id, const LaunchSeen& seen) {
  MachineCandidate one;
  one.candidate.id = id;
  one.candidate.exact = true;
  if (!seen.stated)
    one.candidate.undecidable = "no launch is stated of it";
  else if (seen.measured && seen.first.count < trials_of_a_spread)
    one.candidate.undecidable = fmt::format("it takes {} trials whose first row has it", trials_of_a_spread);
  return one;
}

// Trials begin elsewhere than it is stated. First rows that are far off suggest a size by themselves.
MachineCandidate launch_offset(const Machine& machine, const MachineDesign& design, std::size_t state) {
  const LaunchSeen seen = launch_seen(machine, design, state);
  MachineCandidate one = launch_effect("launch_" + machine.states[state], seen);
  FreeParameter offset{0, -seen.most, seen.most, fine_step * seen.most};
  if (seen.stated && seen.first.count > 0) {
    const double off = seen.first.mean - seen.stated->mean, count = static_cast<double>(seen.first.count);
    if (std::abs(off) > launch_errors * seen.usual / std::sqrt(count))
      offset.likely = std::clamp(off, offset.lower, offset.upper);
  }
  one.candidate.parameters = {offset};
  one.candidate.report = reporting({}, {"offset"});
  one.apply = [state, states = machine.states.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.launch_offset.resize(states);
    h.launch_offset[state] = v[0];
  };
  return one;
}

// Trials begin at places that scatter more than it is stated.
MachineCandidate launch_spread(const Machine& machine, const MachineDesign& design, std::size_t state) {
  const LaunchSeen seen = launch_seen(machine, design, state);
  MachineCandidate one = launch_effect("launch_spread_" + machine.states[state], seen);
  const double most = seen.most * seen.most, usual = seen.usual > 0 ? seen.usual * seen.usual : 1e-4 * most;
  FreeParameter variance{0, 0, std::max(most, usual), 1e-2 * usual, usual};
  if (seen.stated && seen.first.count > 0) {
    const double more = seen.first.sd * seen.first.sd - usual;
    if (more > launch_errors * std::sqrt(2 / static_cast<double>(seen.first.count)) * usual)
      variance.likely = std::min(more, variance.upper);
  }
  one.candidate.parameters = {variance};
  one.candidate.report = [](const Values&, const Values& v) {
    return std::vector<NamedValue>{{"sd_between_trials", std::sqrt(std::max(0.0, v[0]))}};
  };
  one.candidate.form_of = [](const Values& v) { return FittedForm{{}, {v[0] * v[0]}}; };
  one.apply = [state, states = machine.states.size()](MachineHypothesis& h, const Values&, const Values& v) {
    h.launch_scatter.resize(states);
    h.launch_scatter[state] = std::sqrt(std::max(0.0, v[0]));
  };
  return one;
}

}  // namespace

std::vector<MachineCandidate> machine_effects(const Machine& machine, std::shared_ptr<const MachineDesign> design) {
  std::vector<MachineCandidate> all;
  std::size_t value = machine.parameters.size();
  for (const MachineEffect& effect : machine.effects) {
    all.push_back(suspected(effect, value));
    value += effect.parameters.size();
  }
  for (std::size_t p = 0; p < machine.parameters.size(); ++p) {
    if (std::ranges::find(machine.may_vary, machine.parameters[p].name) == machine.may_vary.end()) continue;
    for (MachineCandidate& one : Varying(machine, machine.parameters[p], p, design).all())
      all.push_back(std::move(one));
  }
  all.push_back(memory(machine));
  for (std::size_t i = 0; i < machine.inputs.size(); ++i) all.push_back(lag(machine, *design, i));
  for (std::size_t i = 0; !machine.whole_state && i < machine.inputs.size(); ++i)
    all.push_back(filter(machine, *design, i));
  for (std::size_t j = 0; !machine.whole_state && j < machine.observe.size(); ++j)
    all.push_back(hidden_state(machine, design, j));
  all.push_back(outliers());
  for (std::size_t j = 0; j < machine.observe.size(); ++j) all.push_back(sensor_noise(machine, *design, j));
  for (std::size_t j = 0; j < machine.observe.size(); ++j) all.push_back(sensor_bias(machine, *design, j));
  for (std::size_t s = 0; s < machine.states.size(); ++s) {
    if (!machine.stated_launch(machine.states[s]) &&
        std::ranges::find(machine.observe, machine.states[s], &MachineSensor::state) == machine.observe.end())
      continue;
    all.push_back(launch_offset(machine, *design, s));
    all.push_back(launch_spread(machine, *design, s));
  }
  return all;
}

std::string alternating_memory(const MachineDesign& design, std::span<const EffectTerm> terms) {
  const bool below = std::ranges::any_of(
      terms, [](const EffectTerm& term) { return term.candidate->id == "memory" && term.values.front() < 0; });
  if (!below || design.phases.size() != 2) return {};
  for (std::size_t k = 1; k < design.steps.size(); ++k)
    if (design.steps[k].trial == design.steps[k - 1].trial && design.steps[k].phase == design.steps[k - 1].phase)
      return {};
  return fmt::format(
      "A memory below zero alternates from step to step, and so do the phases {} and {}: what differs between these "
      "may "
      "pass for it.",
      design.phases[0], design.phases[1]);
}

std::vector<std::string> generic_effect_names(const Machine& machine) {
  std::vector<std::string> names{"memory", "outliers"};
  for (const std::string& input : machine.inputs)
    for (const char* of : {"lag_", "filtered_"}) names.push_back(of + input);
  for (const std::string& state : machine.states)
    for (const char* of : {"hidden_state_", "sensor_noise_", "sensor_bias_", "launch_", "launch_spread_"})
      names.push_back(of + state);
  for (const std::string& varying : machine.may_vary) {
    for (const char* how : {"_by_phase", "_drift", "_spread", "_clock", "_stretch"}) names.push_back(varying + how);
    for (const std::string& state : machine.states) names.push_back(fmt::format("{}_with_{}", varying, state));
  }
  return names;
}

std::string machine_effect_unit(const Machine& machine, const std::string& effect, const std::string& parameter) {
  for (const MachineEffect& suspected : machine.effects)
    if (suspected.id == effect) return machine.unit_of(parameter);
  for (const char* plain :
       {"correlation", "noise_number", "share", "steps", "pull", "time_constant_steps", "state_number"})
    if (parameter == plain) return "";
  for (const char* place : {"frequency_hz", "from_m", "to_m"})
    if (parameter == place) return Machine{}.unit_of(parameter);
  for (const std::string& state : machine.states)
    for (const char* of : {"sensor_noise_", "sensor_bias_", "launch_", "launch_spread_"})
      if (effect == of + state) return machine.unit_of(state);
  std::string changed;  // It is the longest name that the effect begins with.
  for (const std::string& varying : machine.may_vary)
    if (effect.starts_with(varying + "_") && varying.size() > changed.size()) changed = varying;
  return machine.unit_of(changed);
}

}  // namespace metastable::analysis
