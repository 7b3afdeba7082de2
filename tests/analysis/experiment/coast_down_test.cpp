#include "analysis/experiment/coast_down.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "analysis/experiment/input_error.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

// Returns tick times of a drum driven up that then coasts: omega^2 loses 0.15 + 0.002 omega^2 a revolution, with noise.
std::vector<double> ticks(double constant, double quadratic, double noise_sd, unsigned seed) {
  std::mt19937_64 bits(seed);
  std::normal_distribution<double> normal;
  std::vector<double> times{0};
  const auto turn = [&](double square) { times.push_back(times.back() + 2 * std::numbers::pi / std::sqrt(square)); };
  for (double omega = 8; omega < 31; omega += 0.4) turn(omega * omega);
  for (double square = 31 * 31; square > 16; square -= constant + quadratic * square + noise_sd * normal(bits))
    turn(square);
  return times;
}

std::string log_text(const std::vector<double>& times) {
  std::string text;
  for (std::size_t k = 0; k < times.size(); ++k) {
    text += fmt::format("{:.0f},40.5,{},39.1,{}\n", times[k] * 1e6 + 1000, k, 3 * k);
    text += fmt::format("{:.0f},40.5,{},39.1,{}\n", times[k] * 1e6 + 9000, k, 3 * k + 1);
  }
  return text;
}

CoastDownRun run_of(const std::vector<double>& times) {
  return coast_down(parse_counter_log("log.csv", log_text(times)), {});
}

TEST(CoastDown, FindsTheLossOfASimulatedDrum) {
  for (const double constant : {0.15, 2.0}) {
    const CoastDownRun run = run_of(ticks(constant, 0.002, 0.05, 3));
    EXPECT_NEAR(run.top, 31, 0.5);
    EXPECT_EQ(run.missed + run.doubled + run.displaced, 0U);
    for (const auto& block : run.blocks) EXPECT_LE(block.size(), 50U);
    for (const bool linear : {false, true}) {
      const LossFit fit = fit_loss({run}, linear);
      EXPECT_NEAR(fit.loss.constant, constant, 4 * fit.constant_error);
      EXPECT_NEAR(fit.loss.linear, 0, 4 * fit.linear_error);
      EXPECT_NEAR(fit.loss.quadratic, 0.002, 4 * fit.quadratic_error);
      EXPECT_NEAR(fit.loss.noise_sd, 0.05, 0.01);
      EXPECT_LT(fit.constant_error, 0.1);
    }
  }
}

TEST(CoastDown, ReportsMissedDoubleAndDisplacedTicks) {
  std::vector<double> times = ticks(0.15, 0.002, 0.02, 4);
  ASSERT_GT(times.size(), 900U);
  times[500] += 0.02 * (times[501] - times[500]);
  times.insert(times.begin() + 400, (times[399] + times[400]) / 2);
  times.erase(times.begin() + 300);
  const CoastDownRun run = run_of(times);
  EXPECT_EQ(run.missed, 1U);
  EXPECT_EQ(run.doubled, 1U);
  EXPECT_EQ(run.displaced, 1U);
  // The loss is that of the clean run: no transition goes over a defect.
  const LossFit fit = fit_loss({run}, false);
  EXPECT_EQ(fit.outliers, 0U);
  EXPECT_NEAR(fit.loss.constant, 0.15, 4 * fit.constant_error);
}

TEST(CoastDown, ObjectsToLogsThatAreNoBasis) {
  std::vector<double> times = ticks(0.15, 0.002, 0.02, 4);
  EXPECT_EQ(objection(run_of(times), {0.15, 0, 0.002, 0.02}), "");
  EXPECT_EQ(objection(run_of(times), {0.15, -0.05, 0.002, 0.02}),
            ": the nominal loss falls to -0.162 rad^2/s^2 a revolution between 5 and 30.8 rad/s, and a drum that "
            "coasts down loses more than nothing");
  CoastDownRun in_milliseconds = run_of(times);
  in_milliseconds.top *= 1000;
  EXPECT_EQ(objection(in_milliseconds, {0.15, 0, 0.002, 0.02}),
            ": a top speed of 3.08e+04 rad/s, where a drum turns at 3000 at most: is time_us in microseconds?");
  for (std::size_t k = 400; k > 200; k -= 8) times.erase(times.begin() + static_cast<std::ptrdiff_t>(k));
  EXPECT_NE(objection(run_of(times), {0.15, 0, 0.002, 0.02}).find("revolutions left out for ticks"), std::string::npos);
}

TEST(CoastDown, SaysHowRunsDiffer) {
  const CoastDownRun first = run_of(ticks(0.15, 0.002, 0.005, 3)), same = run_of(ticks(0.15, 0.002, 0.005, 4)),
                     other = run_of(ticks(0.165, 0.0022, 0.005, 5));  // a tenth more
  EXPECT_NEAR(run_to_run_of({first, same}, false), usual_run_to_run / std::sqrt(2.0), 0.005);
  EXPECT_NEAR(run_to_run_of({first, other}, false), std::sqrt((2 * 0.05 * 0.05 + 0.03 * 0.03) / 2), 0.008);
}

// Runs that differ by more than an experiment may state are no basis of one.
TEST(CoastDown, RunsOfTwoLossesAreRefused) {
  CoastDownRun light = run_of(ticks(0.05, 0.0007, 0.005, 3)), heavy = run_of(ticks(0.25, 0.0035, 0.005, 4));
  light.name = "light", heavy.name = "heavy";
  EXPECT_GT(run_to_run_of({light, run_of(ticks(0.09, 0.00126, 0.005, 4))}, false), 0.15);
  try {
    run_to_run_of({light, heavy}, false);
    FAIL();
  } catch (const std::invalid_argument& error) {
    const std::string said = error.what();
    EXPECT_NE(said.find("loss: from run to run it differs by 67 % of its mean, more than 50 %"), std::string::npos)
        << said;
    EXPECT_NE(said.find("rad/s light loses "), std::string::npos) << said;
    EXPECT_NE(said.find("and heavy "), std::string::npos) << said;
  }
}

TEST(CoastDown, FolderIsReadBack) {
  CoastDownRun run = run_of(ticks(0.15, 0.002, 0.05, 5));
  run.name = "free";
  const ExperimentFiles files =
      coast_down_files({run}, {0.15, 0, 0.002, 0.05, 0.04, "its \"ticks\""}, 2.5, "drum \"A\"", {"a comment"});
  const Experiment e =
      parse_experiment({"folder", files.experiment_toml, files.collisions_csv, std::nullopt, std::nullopt});
  EXPECT_EQ(e.system, System::coast_down);
  EXPECT_EQ(e.title, "drum \"A\"");
  EXPECT_EQ(e.trials.size(), run.blocks.size());
  EXPECT_EQ(e.loss.quadratic, 0.002);
  EXPECT_EQ(e.loss.run_to_run, 0.04);
  EXPECT_EQ(e.loss.accepted_defects, "its \"ticks\"");
  EXPECT_EQ(e.rotor_inertia, 2.5);
}

TEST(CoastDown, NamesWhatIsWrongWithALog) {
  const auto message = [](const std::string& text) {
    try {
      parse_counter_log("log.csv", text);
    } catch (const InputError& error) {
      return error.lines().front();
    }
    return std::string("accepted");
  };
  EXPECT_EQ(message("1,2,3,4\n"), "log.csv:1:1: 4 fields where five are expected");
  EXPECT_EQ(message("1,2,3,4,5,6\n"), "log.csv:1:11: more than five fields");
  EXPECT_EQ(message("1,x,3,4,5\n"), "log.csv:1:3: drum_speed_km_h: 'x' is not a number");
  EXPECT_EQ(message("1,2,3.5,4,5\n"), "log.csv:1:5: drum_revolutions: 3.5 is no whole number");
  EXPECT_EQ(message("1,-2,3,4,5\n"), "log.csv:1:3: drum_speed_km_h: -2 is outside [0, 1e+15]");
  EXPECT_EQ(message("1,2,3,4,5\n\n1,2,3,4,5\n"), "log.csv:2:1: time_us: '' is not a number");
  EXPECT_EQ(message("1,2,3,4,5\r\n\r\n\n"), "log.csv: 0 drum revolutions are too few, 20 are needed");
  EXPECT_EQ(message("9,2,3,4,5\n8,2,3,4,5\n"), "log.csv:2:1: time_us: falls to 8");
  EXPECT_EQ(message("9,2,3,4,5\n10,2,2,4,5\n"), "log.csv:2:1: drum_revolutions: falls to 2");
  EXPECT_EQ(message("1,2,3,4,5\n"), "log.csv: 0 drum revolutions are too few, 20 are needed");
  EXPECT_THROW((CoastDownOptions{.stop = 0}.validate()), std::invalid_argument);
  EXPECT_THROW((CoastDownOptions{.block = 3}.validate()), std::invalid_argument);
}

TEST(CoastDown, NeedsTicksAndASkipForEach) {
  CounterLog log{.name = "free", .time = {}, .skipped = {}};
  const auto message = [&log] { return message_of([&] { coast_down(log, {}); }); };
  EXPECT_EQ(message(), "free: 0 ticks are too few, 10 are needed");
  log.time = {0.5};
  log.skipped = {0};
  EXPECT_EQ(message(), "free: 1 ticks are too few, 10 are needed");
  log.time = ticks(0.15, 0.002, 0.05, 3);
  EXPECT_EQ(message(), fmt::format("free: skipped has 1 entries for {} ticks", log.time.size()));
  log.skipped.assign(log.time.size(), 0);
  EXPECT_EQ(message(), "nothing was thrown");
}

}  // namespace
}  // namespace metastable::analysis::test
