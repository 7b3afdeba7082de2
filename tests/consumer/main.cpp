// Makes a study, a comparison, simulated trials, their diagnosis, a return map and a chain of one's own, through the
// installed headers and libraries. consumer FOLDER: writes the simulated trials there as an experiment folder.
#include <metastable/analysis/experiment/experiment_folder.h>
#include <metastable/analysis/experiment_model/diagnose.h>
#include <metastable/analysis/sensitivity/comparison.h>
#include <metastable/analysis/study/metastability.h>
#include <metastable/markov/chain/solver.h>
#include <metastable/markov/chain/sparse_solver.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

namespace analysis = metastable::analysis;
namespace dynamics = metastable::dynamics;
namespace markov = metastable::markov;

namespace {

bool all_right = true;
void check(bool right, const char* what) {
  std::printf("%s: %s\n", right ? "right" : "WRONG", what);
  all_right = all_right && right;
}

bool inside(const analysis::Estimate& estimate, double value, double slack) {
  return estimate.lower - slack <= value && value <= estimate.upper + slack;
}

// Direct simulation gives 4.26 and 6.17 steps with equal legs (tests/analysis/study/known_answers_test.cpp).
analysis::Setting equal_legs(double slope_deg) {
  analysis::Setting setting;
  setting.wheel.leg_length.assign(8, 0.1519);
  setting.slope_deg = slope_deg;
  setting.initial_speed = *analysis::paper_launch(slope_deg);
  return setting;
}

void study_and_compare() {
  const analysis::Comparison pair = analysis::compare({equal_legs(7.02), equal_legs(9.59)}, {.tolerance = 0.02});
  check(inside(pair.studies[0].steps.from_start, 4.26, 0.01) && pair.studies[0].setting->slope_deg == 7.02, "a study");
  check(inside(*pair.contrasts[0].ratio, 6.17 / 4.26, 0.01), "a comparison");
}

// Wheels have less friction than their experiment believes: that is to be found, and no missing physics.
void simulate_and_diagnose(const std::filesystem::path& folder) {
  const analysis::Setting believed = equal_legs(9.59);
  analysis::Setting real = believed;
  real.friction = {0.3, 0.05};
  const auto trials = analysis::simulate_trials(real, {.trials = 20, .collisions = 10});
  const auto survived = std::count_if(trials.begin(), trials.end(), [](const dynamics::Trial& trial) {
    return trial.outcome == dynamics::Outcome::max_collisions;
  });
  check(survived == 20, "trials under little friction survive");  // they take some 46600 steps
  const analysis::ExperimentFiles files = analysis::experiment_files(believed, trials, "less friction", {});
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "collisions.csv") << files.collisions_csv;
  std::ofstream(folder / "trials.csv") << files.trials_csv;
  std::ofstream(folder / "experiment.toml") << files.experiment_toml;
  const analysis::Diagnosis diagnosis = analysis::diagnose(folder, {.catalogue = {"slope_offset"}, .draws = 200});
  check(diagnosis.verdict == analysis::Verdict::recalibrate && diagnosis.model->trials() == 20, "a diagnosis");
}

// Falls with probability 1/20 at every step, wherever it is: 20 steps before failure.
struct Memoryless {
  std::pair<double, double> state_interval(int) const { return {0, std::numeric_limits<double>::infinity()}; }
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double, int, std::span<const double> score) const {
    constexpr double quantile_at_5_percent = -1.6448536269514722;
    if (score[0] < quantile_at_5_percent) return std::nullopt;
    return 1 + std::abs(score[0]);
  }
};

void bring_a_return_map() {
  const analysis::Problem problem{Memoryless{}, {[](double) { return 1.0; }, 0}};
  const analysis::Metastability study = analysis::study(problem, {.tolerance = 0.02});
  check(inside(study.steps.from_start, 20, 0) && !study.setting, "a return map of one's own");
}

// 0 -> 1 with 1/2, 1 -> 0 with 1/4, to rest with 1/4 and 1/2: 3 x0 = 4 + 2 x1 and 3 x1 = 4 + x0.
void bring_a_chain() {
  const auto chain = markov::Chain::from_dense(2, std::vector{0.0, 0.5, 0.25, 0.0}, std::vector{0.25, 0.5});
  const std::vector<double> one{1.0, 1.0};
  for (const std::vector<double>& steps :
       {markov::ChainSolver(chain).solve(one), markov::SparseSolver(chain).solve(one)})
    check(std::abs(steps[0] - 20.0 / 7) < 1e-12 && std::abs(steps[1] - 16.0 / 7) < 1e-12, "a chain of one's own");
}

}  // namespace

int main(int, char** arguments) {
  study_and_compare();
  simulate_and_diagnose(arguments[1]);
  bring_a_return_map();
  bring_a_chain();
  return all_right ? 0 : 1;
}
