// The likelihood of a machine's trials, against closed forms.

#include "analysis/machine_model/machine_filter.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"
#include "tests/analysis/machine_model/machines.h"
#include "tests/message_of.h"

namespace metastable::analysis::test {
namespace {

Evaluation followed(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& h) {
  const ScorePlan plan = score_plan(machine, runs, h);
  return follow_machine(machine, runs, plan, machine_events(machine, runs, plan), h);
}

// The log density of the seen rows after the first, given the first, by the covariance of all rows together: the first
// state is that seen less its error, with nothing known of it before.
// @param pushes  by what differs between trials: its sd times its weight in each step
double exact_log_density(const MachineTrial& trial, double a, double b, double s, double error, double correlation,
                         const std::vector<std::vector<double>>& pushes = {}) {
  const auto n = static_cast<Eigen::Index>(trial.rows.size());
  // Rows as a linear function of (e_0, e_1, ..., z_1, ...): x_0 = y_0 - e_0.
  Eigen::MatrixXd from = Eigen::MatrixXd::Zero(n, 2 * n), noise = Eigen::MatrixXd::Identity(2 * n, 2 * n);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(2 * n);
  x[0] = -1;
  double middle = trial.rows[0].seen[0];
  for (Eigen::Index k = 1; k < n; ++k) {
    x *= a;
    x[n + k] = s;
    middle = a * middle + b;
    from.row(k) = x;
    from(k, k) += 1;
    mean[k] = middle;
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    noise(k, k) = error * error;
    if (k > 0) noise(k, k - 1) = noise(k - 1, k) = correlation * error * error;
  }
  std::vector<Eigen::Index> seen;
  for (Eigen::Index k = 1; k < n; ++k)
    if (!std::isnan(trial.rows[static_cast<std::size_t>(k)].seen[0])) seen.push_back(k);
  const auto m = static_cast<Eigen::Index>(seen.size());
  Eigen::MatrixXd all = from * noise * from.transpose();
  for (const std::vector<double>& push : pushes) {
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(n);
    for (Eigen::Index k = 1; k < n; ++k) moved[k] = a * moved[k - 1] + push[static_cast<std::size_t>(k) - 1];
    all += moved * moved.transpose();
  }
  Eigen::MatrixXd covariance(m, m);
  Eigen::VectorXd off(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    off[i] = trial.rows[static_cast<std::size_t>(seen[static_cast<std::size_t>(i)])].seen[0] -
             mean[seen[static_cast<std::size_t>(i)]];
    for (Eigen::Index j = 0; j < m; ++j)
      covariance(i, j) = all(seen[static_cast<std::size_t>(i)], seen[static_cast<std::size_t>(j)]);
  }
  const Eigen::LLT<Eigen::MatrixXd> root(covariance);
  const Eigen::VectorXd white = root.matrixL().solve(off);
  return -0.5 * white.squaredNorm() - root.matrixL().toDenseMatrix().diagonal().array().log().sum() -
         0.5 * static_cast<double>(m) * std::log(2 * std::numbers::pi);
}

// The log density of all rows of a trial whose first state comes from N(mean, sd^2).
double exact_with_launch(const MachineTrial& trial, const MachineLaunch& launch, double error, double correlation) {
  const auto n = static_cast<Eigen::Index>(trial.rows.size());
  Eigen::MatrixXd covariance(n, n);
  Eigen::VectorXd off(n);
  std::vector<double> mean{launch.mean}, variance{launch.sd * launch.sd};
  for (Eigen::Index k = 1; k < n; ++k) {
    mean.push_back(0.8 * mean.back() + 0.3);
    variance.push_back(0.64 * variance.back() + 0.04);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    off[i] = trial.rows[static_cast<std::size_t>(i)].seen[0] - mean[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double shared = i == j ? 1 : i == j + 1 ? correlation : 0;
      covariance(i, j) = covariance(j, i) =
          std::pow(0.8, static_cast<double>(i - j)) * variance[static_cast<std::size_t>(j)] + shared * error * error;
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> root(covariance);
  const Eigen::VectorXd white = root.matrixL().solve(off);
  return -0.5 * white.squaredNorm() - root.matrixL().toDenseMatrix().diagonal().array().log().sum() -
         0.5 * static_cast<double>(n) * std::log(2 * std::numbers::pi);
}

TEST(MachineFilter, AStatedLaunchIsPartOfTheExactLikelihood) {
  for (const double correlation : {0.0, -0.5, 0.3})
    for (const double sd : {0.0, 0.02, 0.3}) {
      Machine machine = linear_machine(0.1, correlation);
      machine.launches = {{"x", 1.0, sd}};
      const MachineRuns runs =
          scalar_runs(5, 12, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
      MachineHypothesis h = nominal_of(machine);
      double exact = 0;
      for (const MachineTrial& trial : runs.trials)
        exact += exact_with_launch(trial, machine.launches[0], 0.1, correlation);
      EXPECT_NEAR(followed(machine, runs, h).total(), exact, 1e-9 * std::abs(exact)) << correlation << ' ' << sd;
      h.launch_offset = {0.4};
      h.launch_scatter = {0.2};
      exact = 0;
      for (const MachineTrial& trial : runs.trials)
        exact += exact_with_launch(trial, {"x", 1.4, std::hypot(sd, 0.2)}, 0.1, correlation);
      EXPECT_NEAR(followed(machine, runs, h).total(), exact, 1e-9 * std::abs(exact)) << correlation << ' ' << sd;
    }
}

// A launch that nobody stated fills in what a first row lacks, and says nothing where the row has the value.
TEST(MachineFilter, AnAssumedLaunchIsNoEvidence) {
  Machine machine = linear_machine(0.1);
  const MachineRuns runs =
      scalar_runs(5, 12, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  const double without = followed(machine, runs, nominal_of(machine)).total();
  machine.launches = {{"x", 7, 0.1, true}};
  EXPECT_EQ(followed(machine, runs, nominal_of(machine)).total(), without);
}

TEST(MachineFilter, IsTheExactLikelihoodOfALinearMachine) {
  for (const double correlation : {0.0, -0.5, 0.3}) {
    const Machine machine = linear_machine(0.1, correlation);
    MachineRuns runs =
        scalar_runs(5, 12, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
    runs.trials[1].rows[4].seen[0] = runs.trials[1].rows[5].seen[0] = runs.trials[2].rows[11].seen[0] = missing;
    runs.trials[3].rows.resize(7);
    double exact = 0;
    for (const MachineTrial& trial : runs.trials) exact += exact_log_density(trial, 0.8, 0.3, 0.2, 0.1, correlation);
    EXPECT_NEAR(followed(machine, runs, nominal_of(machine)).total(), exact, 1e-9 * std::abs(exact)) << correlation;
  }
}

TEST(MachineFilter, PushesOfASizeOfItsOwnInEachTrialArePartOfTheExactLikelihood) {
  const Machine machine = linear_machine(0.1);
  const MachineRuns runs =
      scalar_runs(5, 12, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  MachineHypothesis h = nominal_of(machine);
  std::vector<std::vector<double>> pushes(2);
  for (std::size_t part = 0; part < 2; ++part) {
    const double sd = part == 0 ? 0.3 : 0.1;
    h.push_spreads.push_back({0, sd, {}});
    for (const MachineTrial& trial : runs.trials)
      for (std::size_t k = 0; k < steps_of(trial); ++k) {
        const double weight = part == 0 ? std::cos(2.6 * static_cast<double>(k)) : 1;
        h.push_spreads.back().transition.push_back(weight);
        if (&trial == &runs.trials[0]) pushes[part].push_back(sd * weight);
      }
  }
  double exact = 0;
  for (const MachineTrial& trial : runs.trials) exact += exact_log_density(trial, 0.8, 0.3, 0.2, 0.1, 0, pushes);
  const ScorePlan plan = score_plan(machine, runs, nominal_of(machine));
  const Evaluation found = follow_machine(machine, runs, plan, machine_events(machine, runs, plan), h);
  EXPECT_NEAR(found.total(), exact, 1e-9 * std::abs(exact));
}

Machine skewed_machine(double error) {
  Machine machine = linear_machine(error);
  machine.parameters = {{"a", 0.5, 0.05}};
  machine.effects.clear();
  machine.may_vary.clear();
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = batch.values[0][0] * batch.states[i] + std::exp(batch.scores[i] / 2);
  };
  return machine;
}

TEST(MachineFilter, ScoresOfASkewedLandingAreNormal) {
  for (const double error : {0.0, 0.05, 0.5}) {
    const Machine machine = skewed_machine(error);
    const MachineRuns runs =
        scalar_runs(200, 101, 2.0, error, 7, [](double x, double z, std::size_t) { return x / 2 + std::exp(z / 2); });
    const Evaluation evaluation = followed(machine, runs, nominal_of(machine));
    ASSERT_EQ(evaluation.score.size(), 20000u);
    EXPECT_LT(kolmogorov(evaluation.score), 1.63) << error;  // 1 % of normal samples exceed it
  }
}

// Returns the density of the score z of a step that is an outlier with this probability.
double outlier_density(double z, double share) {
  return (1 - share) * dynamics::normal_density(z) +
         share * dynamics::normal_density(z / outlier_width) / outlier_width;
}

// The noise of an outlier is wide, and not the belief of the state before it. The density is that of each second row,
// given the first one and its error.
TEST(MachineFilter, OutliersOfALinearMachineHaveTheirLikelihood) {
  const double error = 0.3, share = 0.1;
  const Machine machine = linear_machine(error);
  const MachineRuns runs =
      scalar_runs(50, 2, 1.5, error, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.4 * z; });
  MachineHypothesis h = nominal_of(machine);
  h.outliers = share;
  const Evaluation evaluation = followed(machine, runs, h);
  for (std::size_t t = 0; t < runs.trials.size(); ++t) {
    const double off = runs.trials[t].rows[1].seen[0] - 0.8 * runs.trials[t].rows[0].seen[0] - 0.3;
    double density = 0;
    for (const auto& [weight, sd] : {std::pair{1 - share, 0.2}, {share, 0.2 * outlier_width}}) {
      const double spread = std::hypot(sd, error * std::hypot(1, 0.8));
      density += weight * dynamics::normal_density(off / spread) / spread;
    }
    EXPECT_NEAR(evaluation.log_density[t], std::log(density), 1e-6) << t;
  }
}

// The map bends in an outlier's noise: x' = x / 2 + exp(z / 8) shows each z, which reaches the tails of the lattice.
TEST(MachineFilter, OutliersWhereTheMapBendsHaveTheirLikelihood) {
  const double share = 0.1;
  for (const double edge : {100.0, 9.0}) {  // The machine fails above it.
    Machine machine = skewed_machine(0);
    machine.step = [edge](const MachineBatch& batch) {
      for (std::size_t i = 0; i < batch.rows; ++i) {
        batch.next[i] = batch.values[0][0] * batch.states[i] + std::exp(batch.scores[i] / 8);
        batch.failed[i] = batch.scores[i] > edge;
      }
    };
    std::mt19937_64 generator(12);
    std::uniform_real_distribution<double> uniform;
    double exact = 0;
    std::vector<double> scores;
    const MachineRuns runs = scalar_runs(100, 11, 2.0, 0, 5, [&](double x, double z, std::size_t) {
      if (uniform(generator) < share) z *= outlier_width;
      z = std::min(z, 8.9);
      scores.push_back(z);
      exact += std::log(outlier_density(z, share) * 8 * std::exp(-z / 8));
      return x / 2 + std::exp(z / 8);
    });
    EXPECT_GT(std::ranges::count_if(scores, [](double z) { return std::abs(z) > 5; }), 10);
    MachineHypothesis h = nominal_of(machine);
    h.outliers = share;
    EXPECT_NEAR(followed(machine, runs, h).total(), exact, 1) << edge;
  }
}

// Two columns that the same two noises move along one curve, as the speeds before and after a collision are moved: the
// second, given the first, is known to the error of its measurement.
TEST(MachineFilter, ScoresOfColumnsThatBendTogetherAreNormal) {
  Machine machine = linear_machine(0.01);
  machine.scores = 2;
  machine.states = {"p", "q"};
  machine.parameters = {{"push", 0.3, 0.1}};
  machine.effects.clear();
  machine.may_vary.clear();
  machine.observe = {{"q", 0.01, 0}, {"p", 0.01, 0}};
  const auto next = [](double push, const double* state, const double* z) {
    const double p = push + 0.5 * state[0] + 0.2 * z[0] + 0.06 * z[0] * z[0] + 0.1 * z[1] + 0.05 * z[0] * z[1];
    return std::array{p, 2 + 0.8 * p + 0.3 * p * p};
  };
  machine.step = [&](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const auto [p, q] = next(batch.value(0, i), &batch.states[2 * i], &batch.scores[2 * i]);
      batch.next[2 * i] = p;
      batch.next[2 * i + 1] = q;
      batch.failed[i] = 0;
    }
  };
  std::mt19937_64 generator(8);
  std::normal_distribution<double> normal;
  MachineRuns runs;
  for (int trial = 0; trial < 100; ++trial) {
    runs.trials.emplace_back();
    std::array state{0.6, 3.0};
    for (int row = 0; row < 21; ++row) {
      runs.trials.back().rows.push_back(
          {.seen = {state[1] + 0.01 * normal(generator), state[0] + 0.01 * normal(generator)}});
      const std::array z{normal(generator), normal(generator)};
      state = next(0.3, state.data(), z.data());
    }
  }
  MachineHypothesis h = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, h);
  ASSERT_EQ(plan.lattice.size(), 2u);
  const std::vector<Event> events = machine_events(machine, runs, plan);
  const Evaluation evaluation = follow_machine(machine, runs, plan, events, h);
  for (const std::size_t column : {0u, 1u}) {
    std::vector<double> scores;
    double square = 0;
    for (std::size_t e = 0; e < events.size(); ++e)
      if (events[e].column == column) {
        scores.push_back(evaluation.score[e]);
        square += scores.back() * scores.back() / 2000;
      }
    ASSERT_EQ(scores.size(), 2000u);
    EXPECT_LT(kolmogorov(scores), 1.63) << column;
    EXPECT_NEAR(square, 1, 3 * std::sqrt(2.0 / 2000)) << column;
  }
}

// Two columns that one value w moves along a curve, where w scatters from trial to trial as widely as from step to
// step, and above an edge of w the machine fails: x' = exp(w) shows it, so that each w is normal given those before.
TEST(MachineFilter, ASpreadBetweenTrialsWhereTheMapBendsHasItsLikelihood) {
  constexpr double sd = 0.3, between = 0.4, error = 0.01;
  for (const double edge : {100.0, 0.5}) {
    Machine machine = linear_machine(error);
    machine.states = {"x", "y"};
    machine.parameters = {{"b", 0, 0.1}, {"s", sd, 0.05, 0.01, 2}};
    machine.effects.clear();
    machine.observe = {{"x", error, 0}, {"y", error, 0}};
    machine.step = [edge](const MachineBatch& batch) {
      for (std::size_t i = 0; i < batch.rows; ++i) {
        const double w = batch.value(0, i) + batch.value(1, i) * batch.scores[i];
        batch.next[2 * i] = std::exp(w);
        batch.next[2 * i + 1] = w + 0.4 * w * w;
        batch.failed[i] = w > edge;
      }
    };
    std::mt19937_64 generator(8);
    std::normal_distribution<double> normal;
    MachineRuns runs;
    double exact = 0;
    std::size_t failed = 0;
    for (std::size_t t = 0; t < 12; ++t) {
      MachineTrial& trial = runs.trials.emplace_back();
      trial.rows.push_back({.seen = {1, 0}});
      trial.outcome = MachineOutcome::stopped;
      const double offset = between * normal(generator);
      double sum = 0;
      for (int k = 0; k < 8; ++k) {
        const double w = offset + sd * normal(generator), off = error * normal(generator);
        const double known = 1 / (1 / (between * between) + k / (sd * sd));  // variance of the offset, given k of w
        const double mean = known * sum / (sd * sd), spread = std::sqrt(known + sd * sd);
        if (w > edge) {
          trial.outcome = MachineOutcome::failed;
          exact += std::log(dynamics::normal_cdf((mean - edge) / spread));
          ++failed;
          break;
        }
        trial.rows.push_back({.seen = {std::exp(w), w + 0.4 * w * w + off}});
        const double across = error * std::hypot(1, (1 + 0.8 * w) * std::exp(-w));       // of y, given x
        exact += std::log(dynamics::normal_density((w - mean) / spread) / spread) - w +  // of x: dw / dx
                 std::log(dynamics::normal_density(off / across) / across);
        sum += w;
      }
    }
    EXPECT_EQ(failed > 2, edge < 1);
    MachineHypothesis h = nominal_of(machine);
    h.spreads = {{0, between}};
    const ScorePlan plan = score_plan(machine, runs, nominal_of(machine));
    EXPECT_THROW(score_plan(machine, runs, h), std::invalid_argument);
    const std::vector<Event> events = machine_events(machine, runs, plan);
    EXPECT_NEAR(follow_machine(machine, runs, plan, events, h).total(), exact, 1) << edge;
  }
}

// A machine that fails below an edge: x' = x / 2 + 1 + z / 2 where z > edge.
TEST(MachineFilter, FailureHasTheProbabilityOfTheScoresThatFail) {
  Machine machine = linear_machine(0.05);
  machine.parameters = {{"edge", -1.5, 0.1}};
  machine.effects.clear();
  machine.may_vary.clear();
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      batch.next[i] = batch.states[i] / 2 + 1 + batch.scores[i] / 2;
      batch.failed[i] = batch.scores[i] < batch.values[0][0];
    }
  };
  MachineRuns runs =
      scalar_runs(20, 10, 2.0, 0.05, 11, [](double x, double z, std::size_t) { return x / 2 + 1 + std::abs(z) / 2; });
  for (std::size_t t = 0; t < 4; ++t) runs.trials[t].outcome = MachineOutcome::failed;
  const MachineHypothesis h = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, h);
  ASSERT_TRUE(plan.failing);
  const std::vector<Event> events = machine_events(machine, runs, plan);
  std::vector<double> chances;
  const Evaluation evaluation = follow_machine(machine, runs, plan, events, h, &chances);
  const double chance = dynamics::normal_cdf(-1.5);
  int failed = 0;
  for (std::size_t e = 0; e < events.size(); ++e) {
    EXPECT_NEAR(chances[e], chance, 1e-7);
    if (events[e].kind != EventKind::rest) continue;
    ++failed;
    EXPECT_NEAR(evaluation.log_density[e], std::log(chance), 1e-6);
  }
  EXPECT_EQ(failed, 4);
}

// A machine that goes on above a floor, x' = 0.8 x + 0.2 + 0.1 z > 0.95, where a second state follows the first one.
// From a state that fails without noise the second state still moves by its own noise, and the first one by what is not
// known of it: rows that went on have the density of the machine's own formula; the first state has it roughly where
// the floor cuts a cell of scores.
TEST(MachineFilter, AStateThatFailsWithoutNoiseIsSteppedWithAllItsNoise) {
  const double floor = 0.95, error = 1e-3;
  Machine machine = linear_machine(error);
  machine.states = {"x", "y"};
  machine.scores = 2;
  machine.observe = {{"x", error}, {"y", error}};
  machine.parameters = {{"floor", floor, 0.01}};
  machine.effects.clear();
  machine.may_vary.clear();
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double x = 0.8 * batch.states[2 * i] + 0.2 + 0.1 * batch.scores[2 * i];
      batch.next[2 * i] = x;
      batch.next[2 * i + 1] = 0.5 * batch.states[2 * i + 1] + 0.3 * x + 0.1 * batch.scores[2 * i + 1];
      batch.failed[i] = x < batch.value(0, i);
    }
  };
  MachineRuns runs;
  for (const double x : {1.3, 1.2, 0.9, 0.8})  // Without noise 0.9 leads to 0.92 and 0.8 to 0.84, below the floor.
    for (const double y : {0.45, 0.6, 0.75}) {
      MachineTrial& trial = runs.trials.emplace_back();
      trial.rows.resize(2);
      trial.rows[0].seen = {x, 0.6};
      trial.rows[1].seen = {1.1, y};
      trial.outcome = MachineOutcome::stopped;
    }
  const MachineHypothesis h = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, h);
  const std::vector<Event> events = machine_events(machine, runs, plan);
  const Evaluation evaluation = follow_machine(machine, runs, plan, events, h);
  const double root_two_pi = std::sqrt(2 * std::numbers::pi), sd_x = std::hypot(0.1, 0.8 * error, error),
               sd_y = std::hypot(0.1, 0.5 * error, 1.05 * error);
  for (std::size_t e = 0; e < events.size(); ++e) {
    const MachineTrial& trial = runs.trials[events[e].trial];
    const bool first = events[e].column == 0;
    const double middle = first ? 0.8 * trial.rows[0].seen[0] + 0.2 : 0.5 * 0.6 + 0.3 * 1.1;
    const double sd = first ? sd_x : sd_y, z = (trial.rows[1].seen[events[e].column] - middle) / sd;
    EXPECT_NEAR(evaluation.log_density[e], -0.5 * z * z - std::log(root_two_pi * sd), first ? 0.2 : 0.01)
        << trial.rows[0].seen[0] << ' ' << trial.rows[1].seen[1] << ' ' << events[e].column;
  }
}

// Two noises in which the map is straight lead to failure together; failed states are NaN, as simulators have them.
TEST(MachineFilter, FailureKnowsEveryNoiseThatLeadsToIt) {
  Machine machine = linear_machine(0.02);
  machine.scores = 2;
  machine.parameters = {{"edge", 3, 0.1}};
  machine.effects.clear();
  machine.may_vary.clear();
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i) {
      const double next = batch.states[i] / 2 + batch.scores[2 * i] + batch.scores[2 * i + 1];
      batch.failed[i] = std::abs(next) > batch.value(0, i);
      batch.next[i] = batch.failed[i] ? missing : next;
    }
  };
  MachineRuns runs = scalar_runs(10, 6, 0.0, 0.02, 5, [](double x, double z, std::size_t) { return x / 2 + z; });
  for (MachineTrial& trial : runs.trials)
    for (MachineRow& row : trial.rows) row.seen[0] = std::clamp(row.seen[0], -2.9, 2.9);
  runs.trials[0].rows[0].seen[0] = 0;
  const MachineHypothesis h = nominal_of(machine);
  const ScorePlan plan = score_plan(machine, runs, h);
  EXPECT_EQ(plan.lattice.size(), 2u);
  const std::vector<Event> events = machine_events(machine, runs, plan);
  std::vector<double> chances;
  const Evaluation evaluation = follow_machine(machine, runs, plan, events, h, &chances);
  for (std::size_t e = 0; e < events.size(); ++e) {
    const double middle = events[e].speed / 2, sd = std::sqrt(2 + 0.01 * 0.01);
    const double exact = dynamics::normal_cdf((-3 - middle) / sd) + dynamics::normal_cdf((middle - 3) / sd);
    EXPECT_NEAR(chances[e], exact, 0.02 * exact) << e;
    EXPECT_GT(evaluation.log_density[e], -20) << e;
  }
}

TEST(MachineFilter, AMapThatFailsWhereTheMachineGoesOnIsRefused) {
  Machine machine = linear_machine(0.05);
  const auto goes_on = machine.step;
  machine.step = [goes_on](const MachineBatch& batch) {
    goes_on(batch);
    std::ranges::fill(batch.failed, std::uint8_t{1});  // what is alive is said to have failed
  };
  const MachineRuns runs =
      scalar_runs(5, 12, 1.0, 0.1, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  EXPECT_EQ(
      message_of<FailsFromMostRows>([&] { score_plan(machine, runs, nominal_of(machine)); }),
      "step: without noise the machine fails from 55 of 55 measured rows after which it went on (trial 5, row 11 is "
      "one): check the units, signs and order of the columns");
}

}  // namespace
}  // namespace metastable::analysis::test
