// Works that run side by side ask a machine's map in joint calls, and get the answers that they would get alone.
// Machines with bounds that hold no range, and steps that return NaN, are refused. Units are read off names.

#include "analysis/machine_model/machine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_effects.h"
#include "analysis/machine_model/machine_runs.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

// Counts calls of x' = a x + b + z, and the values that came as one number a row.
struct Counted {
  std::shared_ptr<Machine> machine = std::make_shared<Machine>();
  std::shared_ptr<std::atomic<int>> calls = std::make_shared<std::atomic<int>>(0),
                                    by_row = std::make_shared<std::atomic<int>>(0);
};

Counted counted_machine() {
  Counted counted;
  counted.machine->states = {"x"};
  counted.machine->parameters = {{"a", 0.5, 0.1}, {"b", 0, 0.1}};
  counted.machine->dear = true;
  counted.machine->step = [calls = counted.calls, by_row = counted.by_row](const MachineBatch& batch) {
    ++*calls;
    for (const auto& value : batch.values) *by_row += value.size() > 1;
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) + batch.scores[i];
  };
  return counted;
}

// Steps three rows a few times with this b.
std::vector<double> walk(const Machine& machine, double b, int steps) {
  std::vector<double> states{1, 2, 3}, next(3);
  const std::vector<double> scores{0.1, -0.2, 0.3}, a{0.5}, shift{b};
  std::vector<std::uint8_t> failed(3);
  const std::vector<std::span<const double>> values{a, shift};
  for (int step = 0; step < steps; ++step) {
    machine.step({3, states, scores, values, next, failed});
    states = next;
  }
  return states;
}

TEST(JoiningSteps, WorksSideBySideShareTheirCalls) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  std::vector<std::vector<double>> together(5);
  side_by_side(*counted.machine, 5, 2, [&](std::size_t i) { together[i] = walk(joining, static_cast<double>(i), 4); });
  EXPECT_EQ(*counted.calls, 4);
  EXPECT_EQ(*counted.by_row, 4) << "b alone differs between the works";
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(together[i], walk(*counted.machine, static_cast<double>(i), 4));
}

TEST(JoiningSteps, WorksWithinWorksRunOneAfterTheOther) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  std::vector<double> last(4);
  side_by_side(*counted.machine, 2, 1, [&](std::size_t i) {
    side_by_side(*counted.machine, 2, 1,
                 [&](std::size_t k) { last[2 * i + k] = walk(joining, static_cast<double>(2 * i + k), 3)[0]; });
  });
  EXPECT_EQ(*counted.calls, 6);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(last[k], walk(*counted.machine, static_cast<double>(k), 3)[0]);
  EXPECT_EQ(walk(joining, 1, 3), walk(*counted.machine, 1, 3)) << "outside of works";
}

TEST(JoiningSteps, AWorkThatThrowsEndsTheOthers) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  EXPECT_THROW(side_by_side(*counted.machine, 3, 2,
                            [&](std::size_t i) {
                              if (i == 1) throw std::domain_error("the second");
                              walk(joining, 1, 5);
                            }),
               std::domain_error);
}

// Returns sqrt(2 - z) x and what is said of a NaN in it, from these states and scores.
std::string said_of(std::vector<double> states, const std::vector<double>& scores, bool marks) {
  auto machine = std::make_shared<Machine>();
  machine->states = {"x"};
  machine->parameters = {{"room", 2, 0.1}};
  machine->step = [marks](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      batch.next[i] = std::sqrt(batch.value(0, i) - batch.scores[i]) * batch.states[i];
      batch.failed[i] = marks && std::isnan(batch.next[i]);
    }
  };
  std::vector<double> next(states.size());
  std::vector<std::uint8_t> failed(states.size());
  const std::vector<double> room{2};
  const std::vector<std::span<const double>> values{room};
  return message_of<std::invalid_argument>([&] {
    refusing_nan(machine)->step({states.size(), states, scores, values, next, failed});
  });
}

TEST(RefusingNan, NamesStateRowAndValues) {
  EXPECT_EQ(said_of({1, 3}, {0, 2.5}, false),
            "step: the next x is NaN, and not marked as failed, from x 3, noise 2.5, room 2: where there is no next "
            "state, failed has to be true");
}

TEST(RefusingNan, LetsPassWhatIsMarkedAndWhatHasGrownBeyondAllBounds) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(said_of({1, 3}, {0, 2.5}, true), "nothing was thrown");
  EXPECT_EQ(said_of({1, infinity}, {0, 2.5}, false), "nothing was thrown");
  EXPECT_EQ(said_of({1, 1e200}, {0, 2.5}, false), "nothing was thrown");
}

// A machine of one state that does not move, and what is said of it.
class MachineNames : public testing::Test {
 protected:
  MachineNames() {
    machine.states = {"x"};
    machine.observe = {{"x", 0.1}};
    machine.step = [](const MachineBatch&) {};
  }
  std::string refused() const {
    return message_of<std::invalid_argument>([&] { machine.require_valid(); });
  }
  Machine machine;
};

TEST_F(MachineNames, AreRefusedWithBoundsThatAreReversed) {
  EXPECT_EQ(refused(), "nothing was thrown");
  machine.parameters = {{"a", 0.5, 0.1, 1, 0}};
  EXPECT_EQ(refused(), "parameters: a: lower is above upper in its bounds [1, 0]");
  machine.parameters = {{"a", 0.5, 0.1, 0.5, 0.5}};
  EXPECT_EQ(refused(), "parameters: a: its bounds [0.5, 0.5] leave it no room");
  machine.parameters = {};
  machine.effects = {{"bend", {{"c", 0, 0.5, -0.5}}}};
  EXPECT_EQ(refused(), "effects: bend: c: lower is above upper in its bounds [0.5, -0.5]");
}

TEST_F(MachineNames, OfEffectsAreTheirOwn) {
  machine.effects = {{"no_gap", {{"c", 0, -0.5, 0.5}}}};
  EXPECT_EQ(refused(), "effects: \"no_gap\" is a name that answers give to no effect");
  machine.effects = {{"drag+friction", {{"c", 0, -0.5, 0.5}}}};
  EXPECT_EQ(refused(), "effects: \"drag+friction\": a name holds no +, which joins several effects");
}

TEST_F(MachineNames, OfEffectsAreNotThoseOfAnyMachine) {
  machine.parameters = {{"pace", 1, 0.1}, {"pace_drift", 1, 0.1}};
  machine.may_vary = {"pace"};
  machine.inputs = {"load"};
  for (const char* name : {"memory", "outliers", "pace_spread", "pace_with_x", "lag_load", "filtered_load",
                           "hidden_state_x", "sensor_noise_x", "launch_x"}) {
    machine.effects = {{name, {{"c", 0, -0.5, 0.5}}}};
    EXPECT_EQ(refused(), std::string("effects: \"") + name +
                             "\" is the name of an effect that any machine may have: give yours another");
  }
  machine.effects = {{"pace_by_floor", {{"c", 0, -0.5, 0.5}}}, {"pace_drift_drift", {{"d", 0, -0.5, 0.5}}}};
  EXPECT_EQ(refused(), "nothing was thrown");  // No label "floor" is known yet, and pace_drift does not vary.
}

// Whatever effect is added to those of any machine, its name is refused to its user's.
TEST_F(MachineNames, OfAnyMachinesEffectsAreAllTaken) {
  machine.parameters = {{"pace", 1, 0.1}};
  machine.may_vary = {"pace"};
  machine.inputs = {"load"};
  machine.states = {"x", "y"};
  machine.launches = {{"y", 0, 1}};
  MachineRuns runs;
  runs.conditions = {"all"};
  runs.labels = {{"floor", {"oak", "stone"}}};
  for (const double load : {0.5, 1.5}) {
    MachineTrial& trial = runs.trials.emplace_back();
    for (const double x : {0.0, 1.0 + load, 2.0}) {
      MachineRow& row = trial.rows.emplace_back();
      row.seen = {x};
      row.labels = {0};
      row.inputs = {load * x + 0.1 * x * x};
    }
  }
  const std::vector<std::string> taken = generic_effect_names(machine);
  const auto effects = machine_effects(machine, std::make_shared<MachineDesign>(machine_design(machine, runs)));
  EXPECT_GT(effects.size(), 10u);
  for (const MachineCandidate& one : effects) {
    const std::string& id = one.candidate.id;
    EXPECT_TRUE(id == "pace_by_floor" || std::ranges::find(taken, id) != taken.end()) << id;
  }
}

TEST(Machine, UnitsAreThoseThatNamesEndIn) {
  Machine machine;
  machine.units = {{"damping", "N m s/rad"}};
  for (const auto& [name, unit] : {std::pair("swing_rad_s", "rad/s"),
                                   {"swing_rad", "rad"},
                                   {"loss_n_m", "N m"},
                                   {"per_rad", "1/rad"},
                                   {"drag_n_m_s2", "N m s^2"},
                                   {"friction_per_m", "1/m"},
                                   {"slope_deg", "deg"},
                                   {"decay", ""},
                                   {"gains", ""},
                                   {"damping", "N m s/rad"}})
    EXPECT_EQ(machine.unit_of(name), unit) << name;
}

TEST(MachineEffectUnit, IsThatOfWhatTheEffectChanges) {
  Machine machine;
  machine.states = {"swing_rad", "rate_rad_s"};
  machine.parameters = {{"slope", 0.1, 0.1}, {"slope_deg", 3, 1}};
  machine.may_vary = {"slope", "slope_deg"};
  machine.effects = {{"drag", {{"per_rad", 0, 0, 1}}}};
  const auto unit = [&](const char* effect, const char* parameter) {
    return machine_effect_unit(machine, effect, parameter);
  };
  EXPECT_EQ(unit("drag", "per_rad"), "1/rad");
  EXPECT_EQ(unit("slope_deg_by_phase", "change_in_1"), "deg");
  EXPECT_EQ(unit("slope_drift", "change_over_the_runs"), "");
  EXPECT_EQ(unit("slope_deg_with_rate_rad_s", "change_a_sd_of_the_state"), "deg");
  EXPECT_EQ(unit("slope_deg_clock", "frequency_hz"), "Hz");
  EXPECT_EQ(unit("slope_deg_stretch", "to_m"), "m");
  EXPECT_EQ(unit("sensor_bias_rate_rad_s", "bias"), "rad/s");
  EXPECT_EQ(unit("launch_spread_swing_rad", "sd_between_trials"), "rad");
  EXPECT_EQ(unit("outliers", "share"), "");
  EXPECT_EQ(unit("hidden_state_swing_rad", "time_constant_steps"), "");
}

}  // namespace
}  // namespace metastable::analysis::test
