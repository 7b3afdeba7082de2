#pragma once
// Makes maps in batches whose expected steps are known from elsewhere.

#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "markov/chain/solver.h"
#include "markov/mesh/batch_map.h"
#include "markov/passage/first_passage.h"
#include "markov/transition_rows/integrated.h"
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

/// Maps x' = x^3 / 5 - 6/5 x + sd z, failed beyond -2 and 2: without noise 0 is unstable, and 1 and -1 follow each
/// other.
inline double cubic(double x) { return x * (0.2 * x * x - 1.2); }
inline BatchMap cubic_batch(double sd) {
  BatchMap map;
  map.names = {"x"};
  map.step = [sd](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = cubic(states[i]) + sd * scores[i];
      failed[i] = std::abs(next[i]) > 2;
    }
  };
  return map;
}

/// The logistic map x' = r x (1 - x) + sd z, failed outside (0, high).
inline BatchMap logistic_batch(double r, double sd, double high = 1) {
  BatchMap map;
  map.step = [=](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = r * states[i] * (1 - states[i]) + sd * scores[i];
      failed[i] = !(next[i] > 0 && next[i] < high);
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

/// Maps x' = x / 2 + z, failed where |x'| > 6 or `also` says so of x, z and x'.
template <class Also>
BatchMap damped_batch(Also also) {
  BatchMap map;
  map.step = [also](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      next[i] = states[i] / 2 + scores[i];
      failed[i] = std::abs(next[i]) > 6 || also(states[i], scores[i], next[i]);
    }
  };
  return map;
}

/// Has gaits near -1 and `high`, and fails below -1 - far.
struct TwoGaits {
  double high = 1, sd = 0.12, far = 0.85;
  double mean(double x) const { return (high - 1) / 2 + (high + 1) / 2 * std::tanh(3 * x); }
  BatchMap batch() const {
    BatchMap map;
    map.step = [*this](int, auto states, auto scores, auto next, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) {
        next[i] = mean(states[i]) + sd * scores[i];
        failed[i] = next[i] < -1 - far;
      }
    };
    return map;
  }
  /// Returns the expected steps from -1: those on ever finer cells, whose error falls with the square of their width.
  double steps() const { return (4 * steps_on(700) - steps_on(350)) / 3; }
  /// Returns them on so many cells, whose probabilities are those of tails, by elimination.
  double steps_on(std::size_t cells) const {
    const double low = -1 - far, top = high + 14 * sd, width = (top - low) / static_cast<double>(cells);
    const auto mass = [](double a, double b) {
      const auto tail = [](double z) { return 0.5 * std::erfc(z / std::sqrt(2)); };
      return a > 0 ? tail(a) - tail(b) : tail(-b) - tail(-a);
    };
    std::vector<double> matrix(cells * cells), kill(cells);
    for (std::size_t i = 0; i < cells; ++i)
      for (const double aside : {-0.5 / std::sqrt(3), 0.5 / std::sqrt(3)}) {  // Gauss's two points of the cell
        const double to = mean(low + width * (static_cast<double>(i) + 0.5 + aside));
        kill[i] += 0.5 * mass(-INFINITY, (low - to) / sd);
        for (std::size_t j = 0; j < cells; ++j)
          matrix[i * cells + j] += 0.5 * mass((low + width * static_cast<double>(j) - to) / sd,
                                              (low + width * static_cast<double>(j + 1) - to) / sd);
      }
    const std::vector<double> steps = mean_first_passage(ChainSolver(Chain::from_dense(cells, matrix, kill)));
    return steps[static_cast<std::size_t>(far / width)];
  }
};

}  // namespace metastable::markov::testing
