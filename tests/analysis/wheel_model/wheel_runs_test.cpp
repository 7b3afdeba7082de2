#include "analysis/wheel_model/wheel_runs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/wheel_model/wheel_columns.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

// Makes trials simulated under the nominal model, with this noise on every speed, printed with so many digits; before
// legs of odd number there comes some speed to it.
Experiment printed_experiment(double noise, int digits, std::optional<double> stated, double odd = 0, int trials = 60) {
  Setting setting = paper_setting(7.02, false);
  ExperimentFiles files =
      experiment_files(setting, simulate_trials(setting, {.trials = trials, .seed = 5}), "printed", {});
  Experiment e = parse_experiment(source_of(files, "printed"));
  std::mt19937_64 bits(7);
  std::normal_distribution<double> error(0, noise);
  const double in_one = std::pow(10, digits);
  const auto print = [&](double speed) { return std::round(std::max(0.01, speed + error(bits)) * in_one) / in_one; };
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) {
      c.omega_minus = print(c.omega_minus + (c.leg.value_or(0) % 2 == 1 ? odd : 0));
      if (*c.omega_plus > 0) c.omega_plus = print(*c.omega_plus);
    }
  e.sensor = {.rate = {}, .noise_sd = stated, .last_digit = 1 / in_one};
  return e;
}
WheelRuns printed(double noise, int digits, std::optional<double> stated, double odd = 0) {
  return wheel_runs(printed_experiment(noise, digits, stated, odd));
}

// A normal error of twice their own is added, see the next test.
TEST(WheelRuns, DigitsAreNoise) {
  for (const std::optional<double> stated : {std::optional<double>(), std::optional(0.0)})
    for (const int digits : {2, 3, 4})
      EXPECT_NEAR(printed(0, digits, stated).noise * std::pow(10, digits), std::sqrt(5 / 12.0), 0.04) << digits;
  EXPECT_TRUE(printed(0, 6, 0.0).exact_stances);
}

// Contacts that do not scatter leave speeds that repeat the model to rounding, against which nothing can be held: the
// noise of a good sensor is added.
TEST(WheelRuns, ConstantContactsGetTheNoiseOfAGoodSensor) {
  Experiment e = printed_experiment(0, 6, 0.0);
  e.contact.restitution.sd = 0;
  EXPECT_TRUE(wheel_runs(e).exact_stances);
  e.contact.friction.sd = 0;
  const WheelRuns measured = wheel_runs(e);
  EXPECT_FALSE(measured.exact_stances);
  EXPECT_DOUBLE_EQ(measured.noise, imagined_noise);
  EXPECT_NE(measured.runs[0].collisions[0].before, e.trials[0].collisions[0].omega_minus);
  Experiment noisy = printed_experiment(0.02, 6, 0.02);
  noisy.contact.restitution.sd = noisy.contact.friction.sd = 0;
  EXPECT_EQ(wheel_runs(noisy).runs[0].collisions[0].before, noisy.trials[0].collisions[0].omega_minus);
}

// Errors that are spread evenly have no tails: of the sum of two 0.9 % are beyond 2.2, of normal ones 2.8 %. Trials of
// another simulator, rounded to 1e-4 and without any gap, were called unexplained for it, ten of ten.
TEST(WheelRuns, StancesBetweenRoundedSpeedsHaveTheTailsOfNormalErrors) {
  const auto model = wheel_transitions(printed_experiment(0, 4, 0.0, 0, 900));
  const Evaluation seen = model->evaluate(nominal_values(*model), {});
  double stances = 0, squares = 0, beyond = 0;
  for (std::size_t i = 0; i < seen.score.size(); ++i)
    if (model->events()[i].kind == EventKind::stance) {
      ++stances;
      squares += seen.score[i] * seen.score[i];
      beyond += std::abs(seen.score[i]) > 2.2;
    }
  ASSERT_GT(stances, 2500);
  EXPECT_NEAR(squares / stances, 1, 4 * std::sqrt(2 / stances));
  EXPECT_NEAR(beyond / stances, 0.0278, 2.5 * std::sqrt(0.0278 / stances));
}

TEST(WheelRuns, NoiseIsWhatIsStatedUnlessTheStancesAreMoreExact) {
  EXPECT_NEAR(printed(0.1, 4, 0.02).noise, 0.02, 1e-4);
  EXPECT_TRUE(printed(0.1, 4, 0.02).noise_stated);
  EXPECT_NEAR(printed(0.1, 4, 0.02).noise_seen, 0.1, 0.02);
  EXPECT_NEAR(printed(0.003, 4, 0.02).noise, 0.003, 0.001);
  EXPECT_FALSE(printed(0.003, 4, 0.02).noise_stated);
  EXPECT_NEAR(printed(0.1, 4, 0.0).noise, 6.5e-5, 1e-5);
  EXPECT_NEAR(printed(0.1, 4, {}).noise, 0.1, 0.02);
}

// Legs, or a hub off its centre, shift the stances of a leg: that is an effect and no noise.
TEST(WheelRuns, WhatLegsDoIsNoNoise) {
  const WheelRuns shifted = printed(0.003, 4, {}, 0.1);
  EXPECT_NEAR(shifted.noise, 0.003, 0.001);
  EXPECT_FALSE(shifted.exact_stances);
  EXPECT_FALSE(printed(0, 6, 0.0, 0.1).exact_stances);
}

TEST(WheelRuns, LegsThatWereNotNotedAreFoundFromTheStances) {
  const auto design = wheel_transitions(test::wheel_design(20, 10));
  const auto data = design->simulate(nominal_values(*design), {}, 3);
  Experiment e = test::wheel_design(20, 10);
  e.columns.leg = Presence::none;
  // These are the simulated speeds, without legs.
  std::size_t event = 0;
  for (MeasuredTrial& trial : e.trials)
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) trial.collisions[k].leg.reset();
  for (; event < data->events().size(); ++event) {
    const Event& one = data->events()[event];
    auto& trial = e.trials[one.trial];
    if (static_cast<std::size_t>(one.number) > trial.collisions.size()) continue;
    MeasuredCollision& c = trial.collisions[static_cast<std::size_t>(one.number) - 1];
    if (one.kind == EventKind::collision) c.omega_minus = one.speed;
    if (one.kind == EventKind::stance) c.omega_plus = one.speed;
  }
  const WheelRuns read = wheel_runs(e);
  EXPECT_TRUE(read.legs_known);
  std::size_t right = 0, collisions = 0;
  for (const WheelRun& run : read.runs)
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      ++collisions;
      right += run.collisions[k].context.leg == static_cast<int>(k % 8);
    }
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(collisions));
  EXPECT_FALSE(read.notes.empty());
}

// Exact times tell the noise of speeds that have much of it; those of usual speeds judge.
TEST(WheelRuns, TimesJudgeWhereTheyTellNoNoise) {
  EXPECT_TRUE(printed(0.02, 6, 0.02).times_judge);
  const WheelRuns noisy = printed(0.4, 6, 0.4);
  EXPECT_FALSE(noisy.times_judge);
  EXPECT_TRUE(std::ranges::any_of(noisy.notes, [](const std::string& note) {
    return note.find("those that time_s implies") != std::string::npos;
  }));
  for (const Event& event : wheel_events(noisy)) EXPECT_FALSE(event.since_previous);
}

TEST(WheelRuns, SaysWhatItCannotRead) {
  const WheelRuns without = wheel_runs(test::wheel_design(4, 4, false));
  EXPECT_FALSE(without.speeds_after);
  EXPECT_NE(std::find(without.notes.begin(), without.notes.end(),
                      "omega_plus_rad_s is missing: collision and stance cannot be told apart"),
            without.notes.end());
}

// What is not measured follows from the geometry: a wheel of equal legs advances by its chord.
TEST(WheelRuns, PositionsAndTimesThatWereNotMeasuredAreCompleted) {
  Experiment e = test::wheel_design(2, 5);
  e.wheel.leg_length.assign(8, 0.15);
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) {
      c.time.reset();
      c.position.reset();
    }
  e.columns.time = e.columns.position = Presence::none;
  const WheelRuns read = wheel_runs(e);
  const double chord = 2 * 0.15 * std::sin(std::numbers::pi / 8);
  for (const WheelRun& run : read.runs)
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const dynamics::StepContext& context = run.collisions[k].context;
      EXPECT_NEAR(context.position, chord * static_cast<double>(k), 1e-12);
      ASSERT_EQ(context.since_previous.has_value(), k > 0);
      if (k == 0) continue;
      // It turns pi/4 at speeds that lie above the slowest of the stance and below the fastest reported.
      EXPECT_GT(*context.since_previous, std::numbers::pi / 4 / 5.5);
      EXPECT_LT(*context.since_previous, std::numbers::pi / 4 / 2.5);
    }
  EXPECT_EQ(read.notes.size(), 2U);
}

// With omega+ a step is two events, without it one; the last one tells rest from survival.
TEST(WheelRuns, EventsFollowFromWhatWasMeasured) {
  const auto kinds = [](const Experiment& e) {
    std::vector<EventKind> of_first_trial;
    for (const Event& event : wheel_events(wheel_runs(e)))
      if (event.trial == 0) of_first_trial.push_back(event.kind);
    return of_first_trial;
  };
  using enum EventKind;
  EXPECT_EQ(kinds(test::wheel_design(2, 2)), (std::vector{launch, collision, stance, collision}));
  Experiment e = test::wheel_design(2, 2, false);
  EXPECT_EQ(kinds(e), (std::vector{launch, step, survival}));
  e.trials[0].outcome = dynamics::Outcome::rest;
  e.conditions[0].initial_speed.reset();
  EXPECT_EQ(kinds(e), (std::vector{step, rest}));
}

// A foot that jams leaves no speed; what is reported there is noise (0.008 rad/s).
TEST(WheelRuns, NoiseAroundZeroIsNoSpeed) {
  Experiment e = test::wheel_design(2, 2);
  for (MeasuredTrial& trial : e.trials) trial.collisions.back().omega_plus = 0.02;
  e.trials[0].outcome = dynamics::Outcome::rest;
  const WheelRuns read = wheel_runs(e);
  EXPECT_EQ(*read.runs[0].collisions.back().after, 0);
  EXPECT_EQ(*read.runs[1].collisions.back().after, 0.02);  // this one went on
  const std::vector<Event> events = wheel_events(read);
  EXPECT_EQ(events[3].kind, EventKind::rest);
  EXPECT_EQ(events[3].rested, true);
  EXPECT_EQ(events[1].rested, false);
  EXPECT_EQ(events.back().kind, EventKind::collision);
  EXPECT_EQ(events.back().rested, false);
}

}  // namespace
}  // namespace metastable::analysis
