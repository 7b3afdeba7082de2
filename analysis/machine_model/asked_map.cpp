#include "analysis/machine_model/asked_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr double values_apart = 0.15, scatters_apart = 0.5;  // of logarithms; scatter is known roughly
constexpr double same_share = 1e-6;                          // of the largest value of a state, asked for twice
constexpr std::size_t most_asked = 256;                      // At most so many rows are asked about anew.
constexpr double move_share = 0.05;  // A parameter is moved by this share of its value, an effect of its range.
// Solvers share their steps among rows. What each state differs by, summed over rows, may hence be the first share of
// what the moved parameters change, and the second one of the state's largest value.
constexpr double mixed_share = 0.1, solver_share = 1e-4;
constexpr std::size_t fewest_for_units = 10;  // rows
constexpr double beyond_any_effect = 9;       // of logarithms: 8000 times what the machine makes of a row, or a share

// The measured rows from which the next one is known, as the nominal map takes them.
struct NominalSteps {
  std::vector<double> states;
  std::vector<std::vector<double>> values;  // by value, of length 1 or one a row
  std::vector<const MachineRow*> after;
};

NominalSteps nominal_steps(const Machine& machine, const MachineRuns& runs) {
  NominalSteps all;
  for (const MachineParameter& p : machine.parameters) all.values.push_back({p.nominal});
  for (const MachineEffect& effect : machine.effects)
    for (const SuspectedParameter& p : effect.parameters) all.values.push_back({p.neutral});
  const std::size_t inputs = all.values.size();
  all.values.resize(inputs + machine.inputs.size());
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k + 1 < trial.rows.size(); ++k) {
      std::vector<double> state(machine.states.size(), 0.0);
      for (const MachineLaunch& launch : machine.launches) state[machine.state_index(launch.state)] = launch.mean;
      bool known = true;
      for (std::size_t j = 0; j < machine.observe.size(); ++j) {
        known = known && !std::isnan(trial.rows[k].seen[j]);
        state[machine.state_index(machine.observe[j].state)] = trial.rows[k].seen[j];
      }
      if (!known) continue;
      all.states.insert(all.states.end(), state.begin(), state.end());
      all.after.push_back(&trial.rows[k + 1]);
      for (std::size_t i = 0; i < machine.inputs.size(); ++i) all.values[inputs + i].push_back(trial.rows[k].inputs[i]);
    }
  return all;
}

// Returns the next states, NaN where the machine failed.
std::vector<double> next_states(const Machine& machine, const std::vector<double>& states,
                                const std::vector<double>& scores, const std::vector<std::vector<double>>& values) {
  const std::size_t width = machine.states.size(), rows = states.size() / width;
  std::vector<double> next(states.size(), 0.0);
  std::vector<std::uint8_t> failed(rows);
  const std::vector<std::span<const double>> spans(values.begin(), values.end());
  machine.step({rows, states, scores, spans, next, failed});
  for (std::size_t i = 0; i < next.size(); ++i)
    if (failed[i / width]) next[i] = std::numeric_limits<double>::quiet_NaN();
  return next;
}

// Returns them with one score at `z` and the others at zero.
std::vector<double> stepped(const Machine& machine, const NominalSteps& from, std::size_t score, double z) {
  const auto m = static_cast<std::size_t>(machine.scores);
  std::vector<double> scores(from.after.size() * m, 0.0);
  for (std::size_t i = 0; i < from.after.size(); ++i) scores[i * m + score] = z;
  return next_states(machine, from.states, scores, from.values);
}

// Asks the map about a few rows in several ways that must not matter.
class AskedAnew {
 public:
  AskedAnew(const Machine& machine, const NominalSteps& from)
      : machine_(machine),
        states_(machine.states.size()),
        scores_(static_cast<std::size_t>(machine.scores)),
        rows_(std::min(from.after.size(), most_asked)) {
    from_.assign(from.states.begin(), from.states.begin() + at(rows_ * states_));
    for (std::size_t i = 0; i < rows_ * scores_; ++i) noise_.push_back(std::sin(1.7 * static_cast<double>(i + 1)));
    for (const std::vector<double>& values : from.values)
      nominal_.push_back(values.size() == 1 ? values : Values(values.begin(), values.begin() + at(rows_)));
    moved_ = nominal_;
    std::size_t v = 0;
    for (const MachineParameter& p : machine.parameters) {
      // A parameter that is neither fitted nor varies is only ever one number.
      const bool varies = std::ranges::find(machine.may_vary, p.name) != machine.may_vary.end();
      if (p.sd > 0 || varies) move(v, p.sd > 0 ? p.sd : move_share * std::abs(p.nominal), p.lower, p.upper);
      ++v;
    }
    for (const MachineEffect& effect : machine.effects)
      for (const SuspectedParameter& p : effect.parameters)
        move(v++, move_share * (p.upper - p.lower), p.lower, p.upper);
  }

  // Says what of the map's answers hangs on more than its arguments; it is empty where nothing of the kind was seen.
  std::string fault() const {
    if (rows_ == 0) return "";
    const Values plain = asked(from_, noise_, nominal_);
    if (!same(plain, asked(from_, noise_, nominal_)))
      return "it makes something else of the same states and noise when it is asked again; it must be a function of "
             "its arguments alone, and take what it draws from the noise";
    std::vector<std::size_t> backwards;
    for (std::size_t i = rows_; i-- > 0;) backwards.push_back(i);
    if (!same(picked(plain, states_, backwards), asked_for(backwards)))
      return "it makes something else of a row when the rows stand in another order; each row must be stepped by "
             "itself, with its own state, noise and parameters";
    for (const std::vector<std::size_t>& some : halves())
      if (!close(picked(plain, states_, some), asked_for(some)))
        return "it makes something else of a row when some of the others are not asked for; each row must be stepped "
               "by "
               "itself, whatever the mean or the largest of all rows is";
    if (!each_takes_its_own(plain))
      return "it makes something else of a row when parameters are arrays of one number a row than with the same "
             "numbers alone; each row must take its own";
    return "";
  }

  // Lists the numbers of the noise, from 1 on, that changed nothing anywhere.
  std::vector<std::size_t> idle() const {
    std::vector<std::size_t> list;
    for (std::size_t m = 0; m < scores_ && rows_ > 0; ++m)
      if (idles(m, nominal_) && idles(m, moved_)) list.push_back(m + 1);
    return list;
  }

 private:
  using Values = std::vector<double>;
  using Columns = std::vector<Values>;

  static std::ptrdiff_t at(std::size_t i) { return static_cast<std::ptrdiff_t>(i); }
  // Moves a value up by as much as its bounds leave, or down where there is more room.
  void move(std::size_t value, double by, double lower, double upper) {
    double& to = moved_[value][0];
    const double up = std::min(by, upper - to), down = std::min(by, to - lower);
    to += up >= down ? std::max(0.0, up) : -down;
  }
  Values asked(const Values& states, const Values& noise, const Columns& values) const {
    return next_states(machine_, states, noise, values);
  }
  Values largest(const Values& all) const {
    Values most(states_, 0.0);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (std::isfinite(all[i])) most[i % states_] = std::max(most[i % states_], std::abs(all[i]));
    return most;
  }
  bool same(const Values& a, const Values& b) const {
    const Values most = largest(a);
    std::size_t flips = 0;  // Rows at the edge of a failure may fail in one order and not in another.
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (std::isfinite(a[i]) != std::isfinite(b[i])) ++flips;
      if (std::abs(a[i] - b[i]) > same_share * most[i % states_]) return false;
    }
    return flips <= states_ * std::max<std::size_t>(2, rows_ / 50);
  }
  // Rows take nominal and moved values in turn; summed over them, each state must be what it is with these alone. A
  // solver may share its steps among rows, and is as close as its tolerance.
  bool each_takes_its_own(const Values& plain) const {
    const Values moved = asked(from_, noise_, moved_), mixed = asked(from_, noise_, alternating()),
                 most = largest(plain);
    Values wrong(states_, 0.0), apart(states_, 0.0);
    for (std::size_t i = 0; i < plain.size(); ++i) {
      const double right = i / states_ % 2 == 0 ? plain[i] : moved[i];
      if (!std::isfinite(plain[i] - moved[i]) || !std::isfinite(mixed[i])) continue;
      wrong[i % states_] += std::abs(mixed[i] - right);
      apart[i % states_] += 0.5 * std::abs(plain[i] - moved[i]);
    }
    for (std::size_t s = 0; s < states_; ++s)
      if (wrong[s] > mixed_share * apart[s] + solver_share * most[s] * static_cast<double>(rows_)) return false;
    return true;
  }
  bool idles(std::size_t score, const Columns& values) const {
    std::optional<Values> first;
    for (const double z : {-3.0, -1.5, -0.5, 0.5, 1.5, 3.0}) {
      Values noise = noise_;
      for (std::size_t i = 0; i < rows_; ++i) noise[i * scores_ + score] = z;
      const Values next = asked(from_, noise, values);
      if (!first) first = next;
      for (std::size_t i = 0; i < next.size(); ++i)
        if (next[i] != (*first)[i] && !(std::isnan(next[i]) && std::isnan((*first)[i]))) return false;
    }
    return true;
  }
  Values picked(const Values& all, std::size_t width, const std::vector<std::size_t>& rows) const {
    Values some;
    for (const std::size_t i : rows)
      some.insert(some.end(), all.begin() + at(i * width), all.begin() + at((i + 1) * width));
    return some;
  }
  // Returns every other row; and for each state and each noise the rows where it is below its middle, whose mean and
  // whose largest value are others than those of all rows.
  std::vector<std::vector<std::size_t>> halves() const {
    std::vector<std::vector<std::size_t>> all(1);
    for (std::size_t i = 0; i < rows_; i += 2) all[0].push_back(i);
    const auto add_lower = [&](const Values& values, std::size_t width) {
      for (std::size_t column = 0; column < width; ++column) {
        Values one;
        for (std::size_t i = 0; i < rows_; ++i) one.push_back(values[i * width + column]);
        const double middle = median(one);
        std::vector<std::size_t>& lower = all.emplace_back();
        for (std::size_t i = 0; i < rows_; ++i)
          if (one[i] < middle) lower.push_back(i);
        if (lower.empty()) all.pop_back();
      }
    };
    add_lower(from_, states_);
    add_lower(noise_, scores_);
    return all;
  }
  Values asked_for(const std::vector<std::size_t>& rows) const {
    Columns values = nominal_;
    for (Values& one : values)
      if (one.size() > 1) one = picked(one, 1, rows);
    return asked(picked(from_, states_, rows), picked(noise_, scores_, rows), values);
  }
  // Says whether the rows' mean differences are within what a solver that shares its steps among rows leaves.
  bool close(const Values& a, const Values& b) const {
    const Values most = largest(a);
    Values apart(states_, 0.0);
    std::size_t flips = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
      if (std::isfinite(a[i]) != std::isfinite(b[i]))
        ++flips;
      else if (std::isfinite(a[i]))
        apart[i % states_] += std::abs(a[i] - b[i]);
    if (flips > states_ * std::max<std::size_t>(2, rows_ / 50)) return false;
    for (std::size_t s = 0; s < states_; ++s)
      if (apart[s] * static_cast<double>(states_) > solver_share * most[s] * static_cast<double>(a.size()))
        return false;
    return true;
  }
  // Returns the nominal values in every other row and the moved ones between, of those that were moved.
  Columns alternating() const {
    Columns mixed = nominal_;
    for (std::size_t v = 0; v < mixed.size(); ++v) {
      if (nominal_[v][0] == moved_[v][0]) continue;
      mixed[v].assign(rows_, nominal_[v][0]);
      for (std::size_t i = 1; i < rows_; i += 2) mixed[v][i] = moved_[v][0];
    }
    return mixed;
  }

  const Machine& machine_;
  std::size_t states_, scores_, rows_;
  Values from_, noise_;
  Columns nominal_, moved_;
};

// Refuses a map that hangs on more than its arguments, row by row, and says which noise changes nothing.
std::vector<std::string> ask_anew(const Machine& machine, const NominalSteps& from) {
  const AskedAnew map(machine, from);
  if (const std::string fault = map.fault(); !fault.empty()) throw std::invalid_argument("step: " + fault);
  std::vector<std::string> said;
  for (const std::size_t number : map.idle())
    said.push_back(fmt::format("step: number {} of the noise changes nothing: it may not be used", number));
  return said;
}

bool may_be_angle(const std::string& unit) {
  return unit.empty() || unit.find("rad") != std::string::npos || unit.find("deg") != std::string::npos;
}

// Puts the measured next values beside those of the nominal map, and what lies between beside its noise, and asks
// whether one is a unit's factor of the other.
std::vector<std::string> other_units(const Machine& machine, const NominalSteps& from) {
  const std::size_t rows = from.after.size(), d = machine.states.size();
  if (rows < fewest_for_units) return {};
  const std::vector<double> middle = stepped(machine, from, 0, 0);
  std::vector<double> variance(middle.size(), 0.0);
  for (std::size_t m = 0; m < static_cast<std::size_t>(machine.scores); ++m) {
    const std::vector<double> up = stepped(machine, from, m, 1), down = stepped(machine, from, m, -1);
    for (std::size_t i = 0; i < middle.size(); ++i)
      if (std::isfinite(up[i]) && std::isfinite(down[i])) variance[i] += 0.25 * (up[i] - down[i]) * (up[i] - down[i]);
  }
  std::vector<std::string> said;
  const auto suspect = [&](const std::string& state, const char* what, double ratio, double apart) {
    const double size = std::log(std::abs(ratio));
    const char* words = std::isfinite(size) && std::abs(size) > beyond_any_effect ? "another unit" : nullptr;
    for (const UnitFactor& unit : unit_factors)
      if ((!unit.of_angles || may_be_angle(machine.unit_of(state))) && std::abs(size - std::log(unit.factor)) < apart)
        words = unit.words;
    if (words)
      said.push_back(fmt::format("{}: {} {:.3g} times what the machine makes of the rows before: is it in {}?", state,
                                 what, ratio, words));
  };
  for (std::size_t j = 0; j < machine.observe.size(); ++j) {
    const std::size_t s = machine.state_index(machine.observe[j].state);
    const double error = machine.observe[j].sd.value_or(0);
    std::vector<double> ratios, scatters;
    for (std::size_t i = 0; i < rows; ++i) {
      const double seen = from.after[i]->seen[j], foretold = middle[i * d + s];
      if (std::isnan(seen) || std::isnan(foretold)) continue;
      if (foretold != 0) ratios.push_back(seen / foretold);
      if (const double own = variance[i * d + s] + 2 * error * error; own > 0)
        scatters.push_back(median_deviation_to_sd * (seen - foretold) / std::sqrt(own));
    }
    // Values about zero have ratios of any size and sign, whose median is small by chance.
    if (ratios.size() >= fewest_for_units && median_deviation(ratios) < std::abs(median(ratios)))
      suspect(machine.observe[j].state, "its values are", median(ratios), values_apart);
    if (scatters.size() >= fewest_for_units)  // An effect may have moved all rows alike.
      suspect(machine.observe[j].state, "it scatters", median_deviation(scatters), scatters_apart);
  }
  return said;
}

}  // namespace

MapAsked ask_map(const Machine& machine, const MachineRuns& runs) {
  const NominalSteps from = nominal_steps(machine, runs);
  return {ask_anew(machine, from), other_units(machine, from)};
}

}  // namespace metastable::analysis
