#pragma once
// Makes maps in batches whose expected steps are known from elsewhere.

#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "markov/chain/solver.h"
#include "markov/mesh/batch_map.h"
#include "markov/passage/first_passage.h"
#include "markov/rows/integrated.h"
#include "tests/markov/linear_map.h"

namespace metastable::markov::testing {

/// Maps x' = x / 2 + 1 + sd z, failed where x' <= 0.
inline BatchMap linear_batch(double sd) {
  BatchMap map;
  map.names = {"x"};
  map.step = [sd](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + sd * scores[i];
      failed[i] = next[i] <= 0;
    }
  };
  return map;
}

/// Does the same beside y' = 0.6 y + z_2, in the coordinates (x + y, y - x / 3): failures do not hang on y.
inline BatchMap skew_batch(double sd) {
  BatchMap map;
  map.dimension = map.scores = 2;
  map.step = [sd](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const double x = 0.75 * (states[2 * i] - states[2 * i + 1]), y = states[2 * i] - x;
      const double to_x = x / 2 + 1 + sd * scores[2 * i], to_y = 0.6 * y + scores[2 * i + 1];
      next[2 * i] = to_x + to_y;
      next[2 * i + 1] = to_y - to_x / 3;
      failed[i] = to_x <= 0;
    }
  };
  return map;
}

/// Has two phases with thresholds 0 and -1, so that failures are rarer in every second step.
inline BatchMap two_phase_batch(double sd) {
  BatchMap map = linear_batch(sd);
  map.phases = 2;
  map.step = [sd](int phase, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + 1 + sd * scores[i];
      failed[i] = next[i] <= (phase == 0 ? 0 : -1);
    }
  };
  return map;
}

/// Returns the expected steps of the linear map from x, by Gauss-Legendre quadrature of its density.
inline double linear_steps(double sd, double x) {
  const LinearWithDensity map{{.sd = sd}};
  const NodeSpace space(node_ranges(map, linear_launch(), 1), 8);
  const IntegratedChain rows = integrate(map, space, linear_launch());
  const std::vector<double> mean = mean_first_passage(ChainSolver(rows.chain.chain));
  const Launch row = integrated_launch(map, space, {[x](double) { return x; }});
  return 1 + std::inner_product(mean.begin(), mean.end(), row.after.begin(), 0.0);
}

}  // namespace metastable::markov::testing
