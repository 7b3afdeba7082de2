#pragma once
// Finds moments, survival and quantiles of the first passage to rest, in steps, seconds and metres.

#include <span>
#include <vector>

#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {

/// Says where a launch leads. The launch is event number 1: with probability `rest` it comes to rest there and
/// then (1 step), with probability after[j] it goes on to state j.
struct Launch {
  std::vector<double> after;  ///< size n
  double rest = 0;            ///< sum(after) + rest = 1 up to rounding
  bool interpolated = false;  ///< `after` holds weights of node values, of any sign (Chain::interpolated)
};

/// Returns the mean first-passage time to rest from each of n states [steps], (I - Q) m = 1, all >= 1. Takes one solve.
std::vector<double> mean_first_passage(const ChainSolver& solver);

/// Returns the moment f = E[T (T + 1)] / 2 [steps^2] from each of n states, (I - Q) f = m, with m = `mean`, the result
/// of mean_first_passage(). Takes one solve. @throws std::invalid_argument on a size that is not the chain's.
std::vector<double> second_moment(const ChainSolver& solver, std::span<const double> mean);

/// Returns the sd of the first-passage time from each of n states [steps], with m = `mean`: its square is solved for
/// from the variance of m_j after a step, a sum of squares. A certain number of steps has an sd of rounding, not of its
/// square root. Takes one solve. @throws std::invalid_argument on a size that is not the chain's.
std::vector<double> first_passage_sd(const ChainSolver& solver, std::span<const double> mean);

struct Moments {
  double mean = 0;  ///< steps, the last one (that leads to rest) counted
  double sd = 0;
};
/// Returns mean and sd of the steps from a launch, from the results of mean_first_passage() and second_moment().
/// @throws std::invalid_argument when the launch is not a distribution over the states (to 1e-9).
Moments steps_from_launch(const Launch& launch, std::span<const double> mean, std::span<const double> second);

/// Returns mean and sd of the total reward until rest, when entering state j (after the launch or from another state)
/// pays reward[j] >= 0 (seconds of the stance that ends there, metres of the chord; size n). A step that stays in j
/// pays it again. Takes two solves. @throws std::invalid_argument on a negative reward or a launch that is no
/// distribution.
Moments reward_from_launch(const ChainSolver& solver, const Launch& launch, std::span<const double> reward);

/// Knows P(steps > n) from a launch for n = 0, 1, 2, ..., the geometric tail in closed form. For a chain whose
/// launches settle elsewhere than its quasi-stationary distribution the iteration ends in an error, not in a wrong
/// tail.
class Survival {
 public:
  /// Iterates until the survivors' hazard is constant to 1e-12 over a period (or `limit` steps) and agrees with the
  /// failure rate, with which it then continues. O(entries) a step. @throws ConvergenceError("survival iteration", ...)
  /// at the limit.
  Survival(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch, int limit = 200000);
  /// Returns the probability of surviving n steps; n >= 0 (otherwise std::invalid_argument; 0 gives 1, fractions are
  /// cut). It holds for any n, however large.
  double at(double n) const;
  /// Returns the least n with P(steps <= n) >= p, 0 < p < 1 (otherwise std::invalid_argument); rounded to double above
  /// 9e15.
  double quantile(double p) const;
  /// Sums P(steps > n) over all n, the tail in closed form: the expected steps, without a linear system [steps].
  double mean() const;

 private:
  double log_at(double n) const;

  std::vector<double> log_head_;  // log_head_[n] = log P(steps > n)
  double log_factor_ = 0;         // log of the survival over one period
  int period_ = 1;
};

/// Returns quantiles of a reward accumulated until rest (seconds): given the number of steps, the total is matched by a
/// shifted gamma with its exact conditional mean, variance and skewness (trials of one reward are taken as they are);
/// the mixture over steps is inverted. `probabilities` in (0,1), one quantile each. The moments are exact, the shape is
/// approximate: the tests hold it against trials. A launch that rests at once is an atom at 0. Costs O(entries) a step
/// until the law of a step has settled, and then does not depend on how rare rest is: steps of the geometric tail count
/// in blocks of 1/500 of the steps before them.
/// @throws ConvergenceError("reward iteration", ...) when it has not settled after 20000 steps; std::invalid_argument
/// on a probability outside (0,1), a negative reward, or a launch that is no distribution.
std::vector<double> reward_quantiles(const ChainSolver& solver, const QuasiStationary& quasi, const Launch& launch,
                                     std::span<const double> reward, std::span<const double> probabilities);

}  // namespace metastable::markov
