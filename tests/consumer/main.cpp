// The README's program and a two-state chain with a known answer, through the installed headers and libraries.
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "dynamics/wheel/wheel.h"
#include "markov/chain/chain.h"
#include "markov/chain/solver.h"
#include "markov/chain/sparse_solver.h"

int main() {
  const metastable::dynamics::Wheel wheel;
  wheel.validate();
  const double steepest = metastable::dynamics::steepest_slope(wheel.legs());
  bool right = std::abs(steepest - std::numbers::pi / 8) < 1e-12;
  std::printf("steepest slope %.6f rad\n", steepest);

  // 0 -> 1 with 1/2, 1 -> 0 with 1/4, to rest with 1/4 and 1/2: 3 x0 = 4 + 2 x1 and 3 x1 = 4 + x0.
  const auto chain = metastable::markov::Chain::from_dense(2, std::vector{0.0, 0.5, 0.25, 0.0}, std::vector{0.25, 0.5});
  const std::vector<double> one{1.0, 1.0};
  for (const std::vector<double>& steps :
       {metastable::markov::ChainSolver(chain).solve(one), metastable::markov::SparseSolver(chain).solve(one)}) {
    std::printf("expected steps %.6f and %.6f\n", steps[0], steps[1]);
    right = right && std::abs(steps[0] - 20.0 / 7) < 1e-12 && std::abs(steps[1] - 16.0 / 7) < 1e-12;
  }

  metastable::analysis::Setting setting;
  setting.slope_deg = 9.59;
  setting.initial_speed = {5.83, 0.28};
  const auto study = metastable::analysis::study(setting, {.tolerance = 0.005});
  std::printf("%.3f steps before failure (95 %%: %.3f to %.3f)\n", study.steps.from_start.value,
              study.steps.from_start.lower, study.steps.from_start.upper);
  right = right && std::abs(study.steps.from_start.value - 6.13) < 0.03;
  return right ? 0 : 1;
}
