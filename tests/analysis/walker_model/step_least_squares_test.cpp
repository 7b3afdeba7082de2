#include "analysis/walker_model/step_least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "analysis/walker_model/walk_folder.h"

namespace metastable::analysis::test {
namespace {

using Names = std::vector<std::string>;

// A number that decays at every step, with a push that may be there.
Machine decaying() {
  Machine machine;
  machine.states = {"x"};
  machine.parameters = {{"decay", 0.9, 0.05}};
  machine.effects = {{"push", {{"each_step", 0, -1, 1}}}};
  machine.observe = {{"x", 0.01}};
  machine.step = [](const MachineBatch& batch) {
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) + 0.1 * batch.scores[i];
  };
  return machine;
}

MachineRuns decayed(double push) {
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  MachineRuns runs;
  for (int t = 0; t < 6; ++t) {
    runs.trials.emplace_back();
    double x = 2 + normal(generator);
    for (int k = 0; k < 11; ++k) {
      runs.trials.back().rows.push_back({.seen = {x}});
      x = 0.85 * x + push + 0.1 * normal(generator);
    }
  }
  return runs;
}

// Returns the number of rows and, without the push and with it, the sum of squares of a straight line's residuals.
struct Lines {
  double n, sum[2];
};
Lines lines(const MachineRuns& runs) {
  std::vector<double> from, to;
  for (const MachineTrial& trial : runs.trials)
    for (std::size_t k = 0; k + 1 < trial.rows.size(); ++k)
      from.push_back(trial.rows[k].seen[0]), to.push_back(trial.rows[k + 1].seen[0]);
  const auto n = static_cast<Eigen::Index>(from.size());
  Eigen::MatrixXd a(n, 2);
  a.col(0) = Eigen::Map<const Eigen::VectorXd>(from.data(), n);
  a.col(1).setOnes();
  const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(to.data(), n);
  Lines found{static_cast<double>(n), {}};
  for (const Eigen::Index columns : {1, 2}) {
    const Eigen::MatrixXd some = a.leftCols(columns);
    found.sum[columns - 1] = (b - some * some.colPivHouseholderQr().solve(b)).squaredNorm();
  }
  return found;
}

// By hand: the push comes in where it lowers n log(sum/n) by more than its parameter costs.
TEST(StepLeastSquares, AnEffectComesInForWhatItsParameterCosts) {
  const Machine machine = decaying();
  int named = 0, aicc_alone = 0;
  for (double push = 0; push < 0.15; push += 0.003) {
    const MachineRuns runs = decayed(push);
    const Lines by_hand = lines(runs);
    const double gain = by_hand.n * std::log(by_hand.sum[0] / by_hand.sum[1]), n = by_hand.n;
    const auto correction = [n](double k) { return 2 * k * (k + 1) / (n - k - 1); };
    const double costs[] = {2 + correction(3) - correction(2), std::log(n)};
    const std::vector<StepwiseChoice> choices = least_squares_selection(machine, runs, {"push"});
    ASSERT_EQ(choices.size(), 2U);
    EXPECT_EQ(choices[0].criterion, "Gauss-Newton AICc");
    EXPECT_EQ(choices[1].criterion, "Gauss-Newton BIC");
    for (const std::size_t i : {0, 1}) {
      ASSERT_GT(std::abs(gain - costs[i]), 1e-6) << "undecided at " << push;
      EXPECT_EQ(choices[i].effects, gain > costs[i] ? Names{"push"} : Names{}) << push << " " << choices[i].criterion;
    }
    named += !choices[1].effects.empty();
    aicc_alone += choices[0].effects != choices[1].effects;
  }
  EXPECT_GT(named, 0);
  EXPECT_GT(aicc_alone, 0) << "AICc asks for less";
}

// Nothing is refitted where all parameters are known.
TEST(StepLeastSquares, AMachineWhoseParametersAreKnownHasAChoice) {
  Machine known = decaying();
  known.parameters = {{"decay", 0.85, 0}};
  const std::vector<StepwiseChoice> choices = least_squares_selection(known, decayed(0.3), {"push"});
  ASSERT_EQ(choices.size(), 2U);
  EXPECT_EQ(choices[1].effects, Names{"push"});
}

// Effects of noise alone leave the residuals as they are.
TEST(StepLeastSquares, NoiseIsNeverNamed) {
  Machine machine = decaying();
  machine.may_vary = {"decay"};
  const MachineRuns runs = decayed(0);
  EXPECT_EQ(least_squares_selection(machine, runs, {"decay_spread", "memory", "outliers"}).front().effects, Names{});
}

TEST(StepLeastSquares, WithoutResidualsThereIsNoChoice) {
  MachineRuns runs = decayed(0);
  for (MachineTrial& trial : runs.trials) trial.rows.resize(1);
  EXPECT_TRUE(least_squares_selection(decaying(), runs, {}).empty());
  Machine hidden = decaying();
  hidden.states.emplace_back("y");
  hidden.launches = {{"y", 0, 1}};
  EXPECT_TRUE(least_squares_selection(hidden, decayed(0), {}).empty());
}

Walks walks_with(const std::vector<std::pair<std::string, double>>& effects) {
  WalkerSetting setting{Walker::compass, walker_slope_deg(Walker::compass), 0.3, dynamics::Terrain::fresh};
  WalkOptions options;
  options.trials = 30;
  options.longest = 12;
  return *parse_walks(source_of(draw_walks(setting, effects, options, "drawn"), "drawn"));
}

TEST(StepLeastSquares, WalksNameAStrongEffectOfTheBody) {
  const Walks walks = walks_with({{"hip_damping.damping", 0.5}});
  for (const StepwiseChoice& choice : least_squares_selection(*walks.machine, walks.runs, {}))
    EXPECT_NE(std::ranges::find(choice.effects, "hip_damping"), choice.effects.end()) << choice.criterion;
}

TEST(StepLeastSquares, OnlyWhatTheCatalogueHoldsIsNamed) {
  const Walks walks = walks_with({{"hip_damping.damping", 0.5}});
  for (const StepwiseChoice& choice : least_squares_selection(*walks.machine, walks.runs, {"foot_slip", "memory"}))
    for (const std::string& id : choice.effects) EXPECT_EQ(id, "foot_slip") << choice.criterion;
}

}  // namespace
}  // namespace metastable::analysis::test
