#include "analysis/machine_model/machine.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "analysis/machine_model/machine_effects.h"
#include "markov/mesh/joined_steps.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_states = 30;
constexpr int most_scores = 16;
constexpr double beyond_all_bounds = 1e100;  // size of a state from which a map may overflow
constexpr std::size_t most_works = 8;  // works whose steps are joined: more of them hold more memory and save little

void require_finite(const std::string& what, double value) {
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("{}: {} is not a finite number", what, value));
}

// Refuses bounds that hold no range.
void require_bounds(const std::string& what, double lower, double upper) {
  if (lower > upper)
    throw std::invalid_argument(fmt::format("{}: lower is above upper in its bounds [{}, {}]", what, lower, upper));
  if (!(lower < upper))
    throw std::invalid_argument(fmt::format("{}: its bounds [{}, {}] leave it no room", what, lower, upper));
}

// A plus sign joins the names of several effects, some of which hold the name of a parameter.
void require_single_name(const std::string& what, const std::string& name) {
  if (name.find('+') != std::string::npos)
    throw std::invalid_argument(fmt::format("{}: \"{}\": a name holds no +, which joins several effects", what, name));
}

void require_parameter(const MachineParameter& p) {
  require_single_name("parameters", p.name);
  require_finite("parameters: " + p.name, p.nominal);
  if (!(p.sd >= 0) || !std::isfinite(p.sd))
    throw std::invalid_argument(fmt::format("parameters: {}: the sd {} is not in [0, inf)", p.name, p.sd));
  require_bounds("parameters: " + p.name, p.lower, p.upper);
  if (!(p.lower <= p.nominal && p.nominal <= p.upper))
    throw std::invalid_argument(fmt::format("parameters: {}: the nominal value {} is outside its bounds [{}, {}]",
                                            p.name, p.nominal, p.lower, p.upper));
}

// These words stand for answers without an effect.
void require_own_name(const std::string& id) {
  for (const char* taken : {"no_gap", "recalibration", "none_of_these", "even push"})
    if (id == taken)
      throw std::invalid_argument(fmt::format("effects: \"{}\" is a name that answers give to no effect", id));
  require_single_name("effects", id);
}

void require_effect(const MachineEffect& effect) {
  require_own_name(effect.id);
  if (effect.parameters.empty()) throw std::invalid_argument(fmt::format("effects: {}: has no parameter", effect.id));
  for (const SuspectedParameter& p : effect.parameters) {
    const std::string what = fmt::format("effects: {}: {}", effect.id, p.name);
    require_finite(what, p.neutral);
    require_finite(what + ": lower", p.lower);
    require_finite(what + ": upper", p.upper);
    require_bounds(what, p.lower, p.upper);
    if (!(p.lower <= p.neutral && p.neutral <= p.upper))
      throw std::invalid_argument(
          fmt::format("{}: the neutral value {} is outside its bounds [{}, {}]", what, p.neutral, p.lower, p.upper));
  }
}

// Names end in these words for units; where two fit, the first counts.
constexpr std::pair<std::string_view, std::string_view> unit_endings[] = {
    {"rad_s2", "rad/s^2"}, {"rad_s", "rad/s"}, {"rad", "rad"}, {"deg_s", "deg/s"},  {"deg", "deg"},
    {"n_m_s2", "N m s^2"}, {"n_m_s", "N m s"}, {"n_m", "N m"}, {"kg_m2", "kg m^2"}, {"m_s2", "m/s^2"},
    {"m_s", "m/s"},        {"kg", "kg"},       {"mm", "mm"},   {"cm", "cm"},        {"ms", "ms"},
    {"hz", "Hz"},          {"m", "m"},         {"s", "s"}};

// Refuses an empty name, and one that is given twice.
void require_distinct(const std::string& what, const std::vector<std::string>& names) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (name.empty()) throw std::invalid_argument(fmt::format("{}: a name is empty", what));
    if (!seen.insert(name).second) throw std::invalid_argument(fmt::format("{}: \"{}\" is there twice", what, name));
  }
}

}  // namespace

std::string Machine::unit_of(const std::string& name) const {
  if (const auto stated = units.find(name); stated != units.end()) return stated->second;
  for (const auto& [ending, unit] : unit_endings) {
    if (name == fmt::format("per_{}", ending) || name.ends_with(fmt::format("_per_{}", ending)))
      return unit.find_first_of(" /") == std::string_view::npos ? fmt::format("1/{}", unit)
                                                                : fmt::format("1/({})", unit);
    if (name.ends_with(fmt::format("_{}", ending))) return std::string(unit);
  }
  return "";
}

std::vector<std::string> Machine::value_names() const {
  std::vector<std::string> names;
  for (const MachineParameter& p : parameters) names.push_back(p.name);
  for (const MachineEffect& effect : effects)
    for (const SuspectedParameter& p : effect.parameters) names.push_back(p.name);
  names.insert(names.end(), inputs.begin(), inputs.end());
  return names;
}

std::size_t Machine::state_index(const std::string& state, const std::string& where) const {
  const auto at = std::ranges::find(states, state);
  if (at == states.end())
    throw std::invalid_argument(
        fmt::format("{}\"{}\" is none of the states {}", where, state, fmt::join(states, ", ")));
  return static_cast<std::size_t>(at - states.begin());
}

const MachineLaunch* Machine::stated_launch(const std::string& state) const {
  const auto found = std::ranges::find(launches, state, &MachineLaunch::state);
  return found == launches.end() || found->assumed ? nullptr : &*found;
}

void Machine::require_valid() const {
  if (!step) throw std::invalid_argument("step: there is none");
  if (states.empty() || states.size() > most_states)
    throw std::invalid_argument(fmt::format("states: {} are outside 1 to {}", states.size(), most_states));
  if (scores < 1 || scores > most_scores)
    throw std::invalid_argument(fmt::format("noise: {} is outside 1 to {}", scores, most_scores));
  require_distinct("states", states);
  require_distinct("parameters, effects and inputs", value_names());
  for (const char* word : {"trial", "condition", "phase", "time_s", "position_m", "outcome"})
    if (std::ranges::find(states, word) != states.end())
      throw std::invalid_argument(fmt::format("states: \"{}\" is a word of the runs' own", word));
  for (const MachineParameter& p : parameters) require_parameter(p);
  std::vector<std::string> ids, observed;
  for (const MachineEffect& effect : effects) {
    require_effect(effect);
    ids.push_back(effect.id);
  }
  require_distinct("effects", ids);
  const std::vector<std::string> generic = generic_effect_names(*this);
  for (const std::string& id : ids)
    if (std::ranges::find(generic, id) != generic.end())
      throw std::invalid_argument(
          fmt::format("effects: \"{}\" is the name of an effect that any machine may have: give yours another", id));
  for (const std::string& name : may_vary)
    if (std::ranges::find(parameters, name, &MachineParameter::name) == parameters.end())
      throw std::invalid_argument(fmt::format("may_vary: \"{}\" is none of the parameters", name));
  require_distinct("may_vary", may_vary);
  if (observe.empty()) throw std::invalid_argument("sensor: no state is measured");
  for (const MachineSensor& sensor : observe) {
    state_index(sensor.state, "sensor: ");
    observed.push_back(sensor.state);
    if (sensor.sd && !(*sensor.sd >= 0 && std::isfinite(*sensor.sd)))
      throw std::invalid_argument(fmt::format("sensor: {}: the sd {} is not in [0, inf)", sensor.state, *sensor.sd));
    if (!(std::abs(sensor.correlation) <= 0.5))
      throw std::invalid_argument(
          fmt::format("sensor: {}: the correlation {} between neighbouring rows is outside "
                      "[-0.5, 0.5]",
                      sensor.state, sensor.correlation));
  }
  require_distinct("sensor", observed);
  for (const MachineLaunch& launch : launches) {
    state_index(launch.state, "launch: ");
    require_finite("launch: " + launch.state, launch.mean);
    if (!(launch.sd >= 0) || !std::isfinite(launch.sd))
      throw std::invalid_argument(fmt::format("launch: {}: the sd {} is not in [0, inf)", launch.state, launch.sd));
  }
  if (!(most_wild >= 0 && most_wild <= 0.2))
    throw std::invalid_argument(fmt::format("most_wild: {} is outside [0, 0.2]", most_wild));
}

namespace {

// Says whether a row of a call holds numbers from which a step of the machine can be asked for: a state that has grown
// beyond all bounds is one that the map need not understand.
bool answerable(const MachineBatch& batch, std::size_t row, std::size_t states, std::size_t scores) {
  const auto real = [](double x) { return std::isfinite(x); };
  const auto bounded = [](double x) { return std::abs(x) < beyond_all_bounds; };
  return std::ranges::all_of(batch.states.subspan(row * states, states), bounded) &&
         std::ranges::all_of(batch.scores.subspan(row * scores, scores), real) &&
         std::ranges::all_of(batch.values, [&](const auto& one) { return real(one.size() == 1 ? one[0] : one[row]); });
}

[[noreturn]] void refuse_nan(const Machine& machine, const MachineBatch& batch, std::size_t row, std::size_t state) {
  std::vector<std::string> from;
  const std::size_t states = machine.states.size(), scores = static_cast<std::size_t>(machine.scores);
  for (std::size_t s = 0; s < states; ++s)
    from.push_back(fmt::format("{} {:.6g}", machine.states[s], batch.states[row * states + s]));
  for (std::size_t m = 0; m < scores; ++m)
    from.push_back(
        fmt::format("noise{} {:.6g}", scores > 1 ? fmt::format(" {}", m + 1) : "", batch.scores[row * scores + m]));
  const std::vector<std::string> names = machine.value_names();
  for (std::size_t v = 0; v < names.size(); ++v)
    from.push_back(fmt::format("{} {:.6g}", names[v], batch.value(v, row)));
  throw std::invalid_argument(fmt::format(
      "step: the next {} is NaN, and not marked as failed, from {}: where there is no next state, failed has "
      "to be true",
      machine.states[state], fmt::join(from, ", ")));
}

}  // namespace

std::shared_ptr<const Machine> refusing_nan(std::shared_ptr<const Machine> machine) {
  if (!machine->step) return machine;
  auto all = std::make_shared<Machine>(*machine);
  all->step = [machine = std::move(machine)](const MachineBatch& batch) {
    machine->step(batch);
    const std::size_t states = machine->states.size(), scores = static_cast<std::size_t>(machine->scores);
    for (std::size_t i = 0; i < batch.next.size(); ++i)
      if (std::isnan(batch.next[i]) && !batch.failed[i / states] && answerable(batch, i / states, states, scores))
        refuse_nan(*machine, batch, i / states, i % states);
  };
  return all;
}

namespace {

// The machine's map as joint calls take it: the values of a row follow its scores.
markov::BatchMap joint_map(const Machine& machine) {
  const std::size_t values = machine.value_names().size(), scores = static_cast<std::size_t>(machine.scores);
  markov::BatchMap map;
  map.dimension = static_cast<int>(machine.states.size());
  map.scores = static_cast<int>(scores + values);
  map.step = [&machine, values, scores](int, auto states, auto given, auto next, auto failed) {
    const std::size_t rows = failed.size();
    std::vector<double> own;
    std::vector<std::vector<double>> by_value(values);
    own.reserve(rows * scores);
    for (std::vector<double>& one : by_value) one.reserve(rows);
    for (std::size_t row = 0; row < rows; ++row) {
      const double* here = given.data() + row * (scores + values);
      own.insert(own.end(), here, here + scores);
      for (std::size_t v = 0; v < values; ++v) by_value[v].push_back(here[scores + v]);
    }
    for (std::vector<double>& one : by_value)
      if (std::ranges::adjacent_find(one, std::not_equal_to()) == one.end()) one.resize(1);
    const std::vector<std::span<const double>> spans(by_value.begin(), by_value.end());
    machine.step({rows, states, own, spans, next, failed});
  };
  return map;
}

void step_jointly(const MachineBatch& batch) {
  const std::size_t scores = batch.scores.size() / batch.rows;
  std::vector<double> given;
  given.reserve(batch.rows * (scores + batch.values.size()));
  for (std::size_t row = 0; row < batch.rows; ++row) {
    const auto own = batch.scores.subspan(row * scores, scores);
    given.insert(given.end(), own.begin(), own.end());
    for (std::size_t v = 0; v < batch.values.size(); ++v) given.push_back(batch.value(v, row));
  }
  markov::joined_map()->step(0, batch.states, given, batch.next, batch.failed);
}

}  // namespace

Machine joining_steps(std::shared_ptr<const Machine> machine) {
  Machine all = *machine;
  all.step = [machine = std::move(machine)](const MachineBatch& batch) {
    if (batch.rows > 0 && markov::joined_map())
      step_jointly(batch);
    else
      machine->step(batch);
  };
  return all;
}

void side_by_side(const Machine& machine, std::size_t count, int threads,
                  const std::function<void(std::size_t)>& work) {
  if (markov::joined_map() || count < 2) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  markov::joined_for(joint_map(machine), count, most_works, threads,
                     [&](std::size_t i, const markov::BatchMap&) { work(i); });
}

}  // namespace metastable::analysis
