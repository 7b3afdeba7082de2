#pragma once
// Finds the quasi-stationary distribution, the escape rate and the mixing times.

#include <optional>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/solver.h"

namespace metastable::markov {

/// Describes how survivors of an absorbing chain behave (Byl & Tedrake 2009, their lambda_2 is lambda_1 here).
struct QuasiStationary {
  /// Is the left eigenvector of lambda_1 (size n), which says what survivors look like. For period d it is the
  /// distribution per class: each class's entries sum to one (one distribution per landing leg).
  std::vector<double> distribution;
  /// Is the right eigenvector, max 1, which is the relative long-run survival from each state.
  std::vector<double> survival_weight;
  /// It is 1 - lambda_1 per step, with relative accuracy near rounding: for period d, 1 - (lambda of the
  /// revolution)^(1/d), evaluated as -expm1(log1p(-rate of the revolution) / d).
  double failure_rate = 0;
  /// It is 1 - lambda of one revolution (failure_rate when the period is 1).
  double revolution_failure_rate = 0;
  int iterations = 0;
  double residual = 0;  ///< largest relative change of an entry > 1e-12 in the last iteration
};

/// Iterates inversely with the subtraction-free factors, each time followed by one step of the chain (iterates stay
/// positive; an iteration shrinks the rest by (1 - lambda_1) |lambda_2| / (lambda_1 |1 - lambda_2|)). A chain that
/// cannot visit a state twice has lambda_1 = 0: failure_rate = 1, and the distribution is that of the last survivors
/// (zero on classes they do not reach). O(n^2) an iteration for full rows. Where 500 iterations were not enough,
/// because |lambda_2| is nearly lambda_1, shifts follow (Noda, Numer. Math. 17, 1971), each with an elimination. Where
/// nobody survives (lambda_1 < 1e-13) the vectors are those of 100 iterations, settled or not; where hardly anybody
/// does (lambda_1 < 1e-6), those of 500.
/// @throws ConvergenceError("inverse iteration", residual, ...) after 10000 iterations of interpolated rows, or 100
/// shifts of others.
QuasiStationary quasi_stationary(const ChainSolver& solver);

/// Finds the stationary distribution of a chain without rest (all kill rates zero on its only closed class) by
/// subtraction-free elimination. It has size n, sums to one, is zero on transient states, and is the time average
/// of periodic chains. @throws std::domain_error if rest can be reached or there are several closed classes
/// among the states reachable from `start`.
std::vector<double> stationary(const Chain& chain, std::span<const double> start);

/// Finds the stationary distribution of the chain that is put back after rest: on reaching rest it restarts in
/// `restart` (size n, sums to restart_mass <= 1: the rest 1 - restart_mass of the launches comes to rest at
/// its very first collision and is launched again; those events are not counted). It sums to one.
/// @throws std::invalid_argument when `restart` has a negative entry or no mass.
std::vector<double> stationary_with_restart(const ChainSolver& solver, std::span<const double> restart);

/// Counts the steps after which the distribution of the survivors, started from `start` (size n), is within
/// `distance` in total variation of the quasi-stationary one (of the class it is in), and stays there for one
/// more period (the distance, 0 < distance < 1, is half the sum of absolute differences). Returns nothing after `limit`
/// steps, or when nobody survives so long. A step takes O(entries).
std::optional<int> total_variation_mixing(const ChainSolver& solver, const QuasiStationary& quasi,
                                          std::span<const double> start, double distance, int limit = 100000);

/// Returns the spectral mixing time [steps], 1 / ln(lambda_1 / |lambda_2|), moduli per step, falling; 0 if
/// lambda_2 = 0 or absent, infinite if the two are equal.
double spectral_mixing_steps(std::span<const double> moduli);

}  // namespace metastable::markov
