// Machines that their user brings in unusual bounds, phases and units get the same answers as others.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/machine_steps.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_effects.h"
#include "analysis/machine_model/machine_transitions.h"
#include "tests/analysis/machine_model/machines.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

Diagnosis answer_to(const Machine& machine, MachineRuns runs, std::vector<std::string> catalogue) {
  return diagnose(machine_transitions(std::make_shared<const Machine>(machine), std::move(runs)),
                  {.catalogue = std::move(catalogue), .draws = 400});
}

std::string told(const Diagnosis& d) {
  std::string all = verdict_name(d.verdict);
  for (const std::string& sentence : d.sentences) all += "\n  " + sentence;
  return all;
}

// A share that is kept is 1 at most, and none of it is lost in the model.
TEST(MachineAnswers, NameAnEffectThatHasRoomBelowNoneOnly) {
  Machine machine = linear_machine(0.02);
  machine.parameters = {{"b", 0.2, 0.02}, {"s", 0.05, 0.02, 0.001, 2}};
  machine.effects = {{"loss", {{"kept", 1, 0.8, 1}}}};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] =
          batch.value(2, i) * (0.8 * batch.states[i] + batch.value(0, i)) + batch.value(1, i) * batch.scores[i];
  };
  const auto next = [](double x, double z, std::size_t) { return 0.85 * (0.8 * x + 0.2) + 0.05 * z; };
  const Diagnosis d = answer_to(machine, scalar_runs(30, 20, 1, 0.02, 1, next), {"loss", "b_with_x"});
  ASSERT_EQ(d.verdict, Verdict::explained) << told(d);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"loss"}) << told(d);
  EXPECT_NEAR(d.causes.ranked.front().parameters[0][0].value, 0.85, 0.02);
  EXPECT_EQ(d.limits.visible.front().undecidable, "");
}

// With two phases a parameter that pushes is the same as a push by phase, which has no name of its own.
TEST(MachineAnswers, NameAParameterThatDiffersBetweenTwoPhases) {
  Machine machine = linear_machine(0.01);
  machine.effects.clear();
  machine.parameters = {{"grip", 1, 0.1, 0, 2}, {"s", 0.05, 0.02, 0.001, 2}};
  machine.may_vary = {"grip"};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = 0.8 * batch.states[i] + 0.2 * batch.value(0, i) + batch.value(1, i) * batch.scores[i];
  };
  std::size_t step = 0;
  const auto next = [&](double x, double z, std::size_t) {
    return 0.8 * x + 0.2 * (step++ % 19 % 2 == 0 ? 1 : 0.85) + 0.05 * z;
  };
  MachineRuns runs = scalar_runs(40, 20, 1, 0.01, 1, next);
  runs.phases = {"left", "right"};
  for (MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k < trial.rows.size(); ++k) trial.rows[k].phase = static_cast<int>(k % 2);
  const Diagnosis d = answer_to(machine, std::move(runs), {});
  ASSERT_EQ(d.verdict, Verdict::explained) << told(d);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"grip_by_phase"}) << told(d);
  EXPECT_NE(d.causes.even_push.find("goes by phase"), std::string::npos) << told(d);
}

// A difference between two phases that alternate may pass for a memory below zero, and the answer says so.
TEST(MachineAnswers, SayThatAMemoryBelowZeroAlternatesAsPhasesDo) {
  double before = 0;
  std::size_t trial = 0;
  MachineRuns runs = scalar_runs(50, 20, 1.5, 0.02, 8, [&](double x, double z, std::size_t t) {
    before = (t == trial ? -0.6 * before : 0) + 0.8 * z;
    trial = t;
    return 0.8 * x + 0.3 + 0.2 * before;
  });
  runs.phases = {"left", "right"};
  for (MachineTrial& one : runs.trials)
    for (std::size_t k = 0; k < one.rows.size(); ++k) one.rows[k].phase = static_cast<int>(k % 2);
  const auto said = [](const Diagnosis& d) { return d.causes.size.find("phases left and right"); };
  const Diagnosis d = answer_to(linear_machine(0.02), runs, {"memory", "b_spread"});
  ASSERT_EQ(d.causes.set, std::vector<std::string>{"memory"}) << told(d);
  EXPECT_NE(told(d).find("What the model leaves out of its state"), std::string::npos) << told(d);
  EXPECT_NE(said(d), std::string::npos) << told(d);
  for (MachineTrial& one : runs.trials)
    for (std::size_t k = 0; k < one.rows.size(); ++k) one.rows[k].phase = static_cast<int>(k / 2 % 2);
  EXPECT_EQ(said(answer_to(linear_machine(0.02), std::move(runs), {"memory", "b_spread"})), std::string::npos);
}

// A drum that coasts down by itself, and loses a constant amount more than its model at every step: far more than its
// changes scatter by.
TEST(MachineAnswers, GiveNoNameToALargeConstantLoss) {
  Machine machine = linear_machine(0.1);
  machine.parameters = {{"kept", 0.9985, 0.0001}, {"s", 0.02, 0.02, 0.0005, 1}};
  machine.effects = {{"drag", {{"more", 0, 0, 0.02}}}};
  machine.may_vary = {"kept"};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] =
          (batch.value(0, i) - batch.value(2, i)) * batch.states[i] - 0.1 + batch.value(1, i) * batch.scores[i];
  };
  MachineRuns runs = scalar_runs(10, 30, 0, 0.1, 4, [](double x, double z, std::size_t t) {
    const double from = x < 10 ? 150 + 80 * static_cast<double>((7 * t) % 10) : x;  // The first value is about 0.
    return 0.9985 * from - 0.7 + 0.02 * z;
  });
  for (MachineTrial& trial : runs.trials) trial.rows.erase(trial.rows.begin());
  const Diagnosis d = answer_to(machine, std::move(runs), {});
  EXPECT_EQ(d.verdict, Verdict::unexplained) << told(d);
  EXPECT_NE(d.causes.even_push.find("(x -0.6)"), std::string::npos) << d.causes.even_push;
}

// The likelihood follows failures along one noise.
TEST(MachineAnswers, RefuseAStepThatFailsWhereTwoNoisesAreLargeTogether) {
  Machine machine = linear_machine(0.1);
  machine.scores = 2;
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double* z = &batch.scores[2 * i];
      batch.next[i] = 0.8 * batch.states[i] + 0.3 + 0.2 * z[0] + 0.1 * z[1];
      batch.failed[i] = z[0] > 1.2 && z[1] < -1.2;
    }
  };
  const MachineRuns runs =
      scalar_runs(10, 20, 1.5, 0.1, 6, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  EXPECT_EQ(message_of<std::runtime_error>([&] { machine_as_stated(std::make_shared<const Machine>(machine), runs); }),
            "step: it fails only where two noises are large together; the likelihood follows failures along one noise");
}

// One long run that was cut into trials: the order of trials goes with the speed.
TEST(MachineAnswers, TellNoDriftWhereTheOrderOfTrialsGoesWithTheState) {
  Machine machine = linear_machine(0.1);
  double now = 900;
  MachineRuns runs;
  for (int t = 0; t < 20; ++t) {
    runs.trials.emplace_back();
    for (int k = 0; k < 30; ++k) runs.trials.back().rows.push_back({.seen = {now = 0.998 * now}});
  }
  const auto design = std::make_shared<const MachineDesign>(machine_design(machine, runs));
  const auto drift = [](const std::vector<MachineCandidate>& all) {
    return std::ranges::find(all, "b_drift", [](const MachineCandidate& one) { return one.candidate.id; })
        ->candidate.undecidable;
  };
  EXPECT_NE(drift(machine_effects(machine, design)).find("goes with x"), std::string::npos);
  // The same trials in another order.
  for (std::size_t t = 0; t < runs.trials.size(); ++t) std::swap(runs.trials[t], runs.trials[(7 * t) % 20]);
  const auto mixed = std::make_shared<const MachineDesign>(machine_design(machine, runs));
  EXPECT_EQ(drift(machine_effects(machine, mixed)), "");
  // A drift that moves the state from trial to trial is told.
  const MachineRuns drifting = scalar_runs(40, 12, 1.5, 0.01, 3, [](double x, double z, std::size_t t) {
    return (x > 0 ? 0.5 * x : 0) + 0.5 + 0.8 * static_cast<double>(t) / 39 + 0.01 * z;
  });
  const auto moved = std::make_shared<const MachineDesign>(machine_design(machine, drifting));
  EXPECT_EQ(drift(machine_effects(machine, moved)), "");
}

TEST(MachineAnswers, AskAboutGlitchesAndFailuresThatTheModelLacks) {
  const Machine machine = linear_machine(0.1);
  MachineRuns runs =
      scalar_runs(10, 20, 1.5, 0.1, 6, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  EXPECT_TRUE(far_values(machine, runs).empty());
  runs.trials[3].rows[7].seen[0] = 12;
  ASSERT_EQ(far_values(machine, runs).size(), 1u);
  EXPECT_EQ(far_values(machine, runs).front().find("x is 12 in trial 4, row 8, where it goes from"), 0u)
      << far_values(machine, runs).front();
  for (const double mark : {-999.0, 9999.0}) {
    runs.trials[3].rows[7].seen[0] = runs.trials[3].rows[8].seen[0] = mark;  // two rows, one behind the other
    EXPECT_NE(message_of([&] { far_values(machine, runs); }).find("otherwise: give NaN for a value that is missing"),
              std::string::npos);
  }
  runs.trials[3].rows[7].seen[0] = runs.trials[3].rows[8].seen[0] = 500;  // That is a machine's business.
  EXPECT_TRUE(far_values(machine, runs).empty());
  runs.trials[3].rows[8].seen[0] = 1.5;
  runs.trials[3].rows[7].seen[0] = 1.5;
  runs.trials[2].outcome = MachineOutcome::failed;
  const std::vector<std::string> notes =
      machine_as_stated(std::make_shared<const Machine>(machine), std::move(runs))->notes();
  EXPECT_TRUE(std::ranges::any_of(notes, [](const std::string& note) {
    return note.find("one trial is said to have failed, but the step fails from no measured row within 4.5 sds") == 0;
  }));
}

// Makes a machine whose state follows a command. @param suspected  that its actuator saturates, below its range at most
Machine commanded_machine(bool suspected) {
  Machine machine = linear_machine(0.05);
  machine.inputs = {"command"};
  machine.parameters = {{"a", 0.7, 0.05}, {"pull", 0.5, 0.05}, {"s", 0.1, 0.02, 0.01, 1}};
  machine.may_vary = {"pull"};
  machine.effects.clear();
  if (suspected) machine.effects = {{"saturation", {{"limit", 5, 0.2, 5}}}};
  machine.step = [suspected](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double most = suspected ? batch.value(3, i) : 5, command = batch.value(suspected ? 4 : 3, i);
      batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) * std::clamp(command, -most, most) +
                      batch.value(2, i) * batch.scores[i];
    }
  };
  return machine;
}

// A command acts one step after it was given, as through an actuator that lags, or through a filter.
TEST(MachineAnswers, NameAnInputThatActsLate) {
  const Machine machine = commanded_machine(false);
  constexpr std::size_t trials = 30, rows = 15;
  const auto command = [](std::size_t t, std::size_t k) { return std::sin(1.3 * static_cast<double>(t * t + k)); };
  for (const std::string cause : {"", "lag_command", "filtered_command"}) {
    std::size_t step = 0;
    double acts = 0;
    const auto next = [&](double x, double z, std::size_t t) {
      const std::size_t k = step++ % (rows - 1), late = cause == "lag_command" ? 1 : 0;
      const double given = command(t, k > late ? k - late : 0);
      acts = k == 0 || cause != "filtered_command" ? given : 0.6 * acts + 0.4 * given;
      return 0.7 * x + 0.5 * acts + 0.1 * z;
    };
    MachineRuns runs = scalar_runs(trials, rows, 0, 0.05, 3, next);
    for (std::size_t t = 0; t < trials; ++t)
      for (std::size_t k = 0; k < rows; ++k) runs.trials[t].rows[k].inputs = {command(t, k)};
    const Diagnosis d = answer_to(machine, std::move(runs), {});
    ASSERT_EQ(d.verdict, cause.empty() ? Verdict::no_gap : Verdict::explained) << told(d);
    if (cause.empty()) continue;
    EXPECT_EQ(d.causes.set, std::vector<std::string>{cause}) << told(d);
    EXPECT_NEAR(d.causes.ranked.front().parameters[0][0].value, cause == "lag_command" ? 1 : -1 / std::log(0.6), 0.25);
  }
}

// A plate that a wall draws back, which follows it: 19.5 steps of time constant.
TEST(MachineAnswers, NameAStateThatTheMapLacks) {
  Machine machine = linear_machine(0.02);
  for (const bool walled : {false, true}) {
    double wall = 0, before = 0;
    std::size_t step = 0;
    const auto next = [&](double x, double z, std::size_t) {
      wall = step++ % 39 == 0 ? x : wall + 0.05 * (before - wall);
      before = x;
      return 0.8 * x + 0.3 + 0.2 * z + (walled ? 0.15 * (wall - x) : 0);
    };
    const Diagnosis d = answer_to(machine, scalar_runs(60, 40, 6, 0.02, 3, next), {});
    if (!walled) {
      EXPECT_NE(d.verdict, Verdict::explained) << told(d);
      continue;
    }
    ASSERT_EQ(d.causes.set, std::vector<std::string>{"hidden_state_x"}) << told(d);
    EXPECT_NEAR(d.causes.ranked.front().parameters[0][0].value, 0.15, 0.02);
    EXPECT_NEAR(d.causes.ranked.front().parameters[0][1].value, 19.5, 4);
  }
}

// An actuator that saturates is no effect of the catalogue: few long trials show that something goes by its input. A
// user who suspects it gets its name, though nothing saturates at the neutral value.
TEST(MachineAnswers, NameAnActuatorThatSaturatesWhereItIsSuspected) {
  constexpr std::size_t trials = 20, rows = 50;
  const auto command = [](std::size_t t, std::size_t k) { return 2 * std::sin(1.3 * static_cast<double>(t * t + k)); };
  std::size_t step = 0;
  const auto next = [&](double x, double z, std::size_t t) {
    return 0.7 * x + 0.5 * std::clamp(command(t, step++ % (rows - 1)), -1.0, 1.0) + 0.1 * z;
  };
  MachineRuns runs = scalar_runs(trials, rows, 0, 0.05, 3, next);
  for (std::size_t t = 0; t < trials; ++t)
    for (std::size_t k = 0; k < rows; ++k) runs.trials[t].rows[k].inputs = {command(t, k)};
  const Diagnosis without = answer_to(commanded_machine(false), runs, {});
  EXPECT_EQ(without.verdict, Verdict::unexplained) << told(without);
  EXPECT_TRUE(without.gap.variations_tested);
  EXPECT_FALSE(without.gap.facets_tested);
  EXPECT_NE(told(without).find("acts by command"), std::string::npos) << told(without);
  const Diagnosis d = answer_to(commanded_machine(true), runs, {});
  ASSERT_EQ(d.causes.set, std::vector<std::string>{"saturation"}) << told(d);
  EXPECT_NEAR(d.causes.ranked.front().parameters[0][0].value, 1, 0.05);
}

// Readings that are off alone, by 10 or 60 sds of the noise, and one of them in a first row.
TEST(MachineAnswers, TakeGlitchesOfASensorForWildRows) {
  Machine machine = linear_machine(0.02);
  machine.most_wild = 0.05;
  for (const double size : {2.0, 12.0}) {
    MachineRuns runs =
        scalar_runs(40, 24, 1.5, 0.02, 5, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
    for (std::size_t row = 7; row < 40 * 24; row += 61)
      runs.trials[row / 24].rows[row % 24].seen[0] += row % 2 == 0 ? size : -size;
    const Diagnosis d = answer_to(machine, std::move(runs), {});
    EXPECT_EQ(d.verdict, Verdict::recalibrate) << told(d);
  }
}

// The same runs in metres and in micrometres.
TEST(MachineAnswers, DoNotDependOnTheUnitOfAState) {
  std::vector<double> p_values;
  for (const double unit : {1.0, 1e-6}) {
    Machine machine = linear_machine(0.05 * unit);
    machine.parameters = {{"a", 0.8, 0.05}, {"b", 0.3 * unit, 0.1 * unit}, {"s", 0.2 * unit, 0.05 * unit, 0, unit}};
    machine.effects = {{"bend", {{"c", 0, -0.5 / unit, 0.5 / unit}}}};
    MachineRuns runs =
        scalar_runs(25, 20, 1.5, 0.05, 4, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
    for (MachineTrial& trial : runs.trials)
      for (MachineRow& row : trial.rows) row.seen[0] *= unit;
    const Diagnosis d = answer_to(machine, std::move(runs), {"bend", "b_drift", "memory"});
    EXPECT_EQ(d.verdict, Verdict::no_gap) << told(d);
    for (const Cause& cause : d.causes.ranked) p_values.push_back(cause.p_value);
  }
  ASSERT_EQ(p_values.size(), 6U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(p_values[i], p_values[i + 3], 0.02);
}

// A pendulum that is drawn with a drag lies some ten sds off its model, row by row, until its parameters are refitted.
TEST(MachineAnswers, DoNotTakeRowsForWildThatOtherParametersBringBack) {
  Machine machine = linear_machine(0.0005);
  machine.most_wild = 0.01;
  machine.parameters = {{"decay", 0.975, 0.01}, {"s", 0.003, 0.003, 0, 0.1}};
  machine.effects = {{"drag", {{"per", 0, 0, 0.5}}}};
  machine.may_vary = {"decay"};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double x = batch.states[i];
      batch.next[i] = batch.value(0, i) * x + batch.value(1, i) * batch.scores[i] - batch.value(2, i) * x * x;
    }
  };
  const auto next = [](double x, double z, std::size_t) { return 0.975 * x - 0.05 * x * x + 0.003 * z; };
  for (const unsigned seed : {1U, 2U}) {
    const Diagnosis d = answer_to(machine, scalar_runs(30, 20, 0.8, 0.0005, seed, next), {"drag"});
    ASSERT_EQ(d.verdict, Verdict::explained) << told(d);
    EXPECT_NEAR(d.causes.ranked.front().parameters[0][0].value, 0.05, 0.01);
  }
}

// Trials begin about 1.2, where a noise below -1.2 is a failure, and go up to 4, where it has to be below -4.
TEST(MachineAnswers, KnowThatFailuresComeEarly) {
  Machine machine = linear_machine(0.05);
  machine.effects.clear();
  machine.may_vary.clear();
  machine.parameters = {{"s", 0.5, 0.05, 0.01, 2}};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      batch.next[i] = batch.states[i] / 2 + 2 + batch.value(0, i) * batch.scores[i];
      batch.failed[i] = batch.scores[i] < -batch.states[i];
    }
  };
  MachineRuns runs =
      scalar_runs(20, 12, 1.2, 0.05, 3, [](double x, double z, std::size_t) { return x / 2 + 2 + 0.5 * std::abs(z); });
  const auto model = machine_transitions(std::make_shared<const Machine>(machine), std::move(runs));
  StepsBeforeFailure steps;
  set_later_steps(steps, *model, fit(*model, nominal_values(*model), {}));
  EXPECT_GT(steps.later_times, 2);
  EXPECT_GT(steps.later, 1);
}

// A parameter that is lost in proportion to a state and one that changes with that state are the same. Their scores
// promise different shares of a large gain; both have to stand in the sets.
TEST(MachineAnswers, RankEffectsThatActAlikeInTheSameSets) {
  Machine machine;
  machine.states = {"period"};
  machine.parameters = {{"kept", 0.93, 0.05}, {"scatter", 0.003, 0.003, 0, 0.1}};
  machine.effects = {{"loss", {{"per_s", 0, -0.5, 0.5}}}, {"pause", {{"pause_s", 0, -0.05, 0.05}}}};
  machine.may_vary = {"kept"};
  machine.observe = {{"period", 0.0005, -0.5}};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double period = batch.states[i];
      batch.next[i] = (batch.value(0, i) - batch.value(2, i) * period) * period + batch.value(3, i) +
                      batch.value(1, i) * batch.scores[i];
    }
  };
  for (const unsigned seed : {1U}) {
    std::mt19937_64 generator(seed);
    std::uniform_real_distribution<double> share;
    const auto next = [&](double x, double z, std::size_t) {
      return (1 - 0.15 * x) * x - 0.0045 + (share(generator) < 0.15 ? 0.004 : 0.001) * z;
    };
    const Diagnosis d = answer_to(machine, scalar_runs(25, 8, 0.35, 0.0003, seed, next),
                                  {"loss", "pause", "kept_with_period", "outliers"});
    for (const char* one : {"loss", "kept_with_period"}) {
      const auto with = [&](const Cause& cause) {
        std::set<std::string> effects(cause.effects.begin(), cause.effects.end());
        return effects == std::set<std::string>{one, "pause", "outliers"} &&
               cause.probability > 0.3 * d.causes.ranked.front().probability;
      };
      EXPECT_TRUE(std::ranges::any_of(d.causes.ranked, with)) << one << told(d);
    }
  }
}

// Returns a mass that a recorded force with noise holds near zero, and runs of one on which a constant force acts, too.
std::pair<Machine, MachineRuns> held_mass(double constant_force) {
  Machine machine;
  machine.name = "mass";
  machine.states = {"x_m", "v_m_s"};
  machine.observe = {{"x_m", 0.002}, {"v_m_s", 0.005}};
  machine.inputs = {"force_n"};
  machine.parameters = {{"gain", 1, 0.05}, {"sd", 0.5, 0.1, 0.05, 3}};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double v =
          batch.states[2 * i + 1] + 0.1 * (batch.value(0, i) * batch.value(2, i) + batch.value(1, i) * batch.scores[i]);
      batch.next[2 * i] = batch.states[2 * i] + 0.1 * v;
      batch.next[2 * i + 1] = v;
    }
  };
  MachineRuns runs;
  std::mt19937_64 generator(1);
  std::normal_distribution<double> normal;
  for (int t = 0; t < 30; ++t) {
    MachineTrial& trial = runs.trials.emplace_back();
    double x = 0.2 * normal(generator), v = 0.2 * normal(generator);
    for (int k = 0; k < 15; ++k) {
      const double force = -x - 1.5 * v + normal(generator);
      MachineRow& row = trial.rows.emplace_back();
      row.seen = {x + 0.002 * normal(generator), v + 0.005 * normal(generator)};
      row.inputs = {force};
      v += 0.1 * (force + 0.5 * normal(generator) + constant_force);
      x += 0.1 * v;
    }
    trial.outcome = MachineOutcome::stopped;
  }
  return {machine, runs};
}

// A force that no effect has is no memory of the noise, which can do some of what it does.
TEST(MachineAnswers, GiveAConstantForceNoName) {
  const auto [machine, runs] = held_mass(0.6);
  const Diagnosis d = answer_to(machine, runs, {});
  EXPECT_EQ(d.verdict, Verdict::unexplained) << told(d);
  EXPECT_TRUE(d.causes.at_work.empty()) << told(d);
  EXPECT_NE(d.causes.even_push.find("fits better than any name of the catalogue"), std::string::npos) << told(d);
}

// A simulation replays the force, whatever the state: what holds the machine is not in it.
TEST(MachineAnswers, TellNoStepsOfAMachineWhoseInputsWereRecorded) {
  auto [machine, runs] = held_mass(0);
  const Diagnosis d = answer_to(machine, runs, {"memory"});
  EXPECT_EQ(d.verdict, Verdict::no_gap) << told(d);
  EXPECT_EQ(d.shrinkage.steps.with_effect, 0);
  ASSERT_EQ(d.shrinkage.steps.machine.size(), 1u) << told(d);
  EXPECT_TRUE(d.shrinkage.steps.machine[0].at_least);
  EXPECT_NEAR(d.shrinkage.steps.machine[0].steps.lower, 30 * 14 / 2.9957, 0.5);  // No trial failed.
  EXPECT_TRUE(std::ranges::any_of(d.data.notes, [](const std::string& note) {
    return note.find("no model tells the expected steps: force_n was recorded") != std::string::npos;
  })) << told(d);
}

}  // namespace
}  // namespace metastable::analysis::test
