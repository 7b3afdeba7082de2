#pragma once
// Quasi-stationary distribution, escape rate, mixing.

#include <optional>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/solver.h"

namespace metastable::markov {

/// Quasi-stationary behaviour of an absorbing chain (Byl & Tedrake 2009, their lambda_2 is lambda_1 here).
struct QuasiStationary {
  /// Left eigenvector of lambda_1: what survivors look like. Size n. For period d it is the distribution per
  /// class: each class's entries sum to one (one distribution per landing leg).
  std::vector<double> distribution;
  /// Right eigenvector, max 1: relative long-run survival from each state.
  std::vector<double> survival_weight;
  /// 1 - lambda_1 per step, relative accuracy near rounding: for period d, 1 - (lambda of the revolution)^(1/d),
  /// evaluated as -expm1(log1p(-rate of the revolution) / d).
  double failure_rate = 0;
  /// 1 - lambda of one revolution (= failure_rate when the period is 1).
  double revolution_failure_rate = 0;
  int iterations = 0;
  double residual = 0;  ///< largest relative change of an entry > 1e-12 in the last iteration
};

/// Inverse iteration with the subtraction-free factors, each followed by one step of the chain (every iterate stays
/// positive; an iteration shrinks the rest by (1 - lambda_1) |lambda_2| / (lambda_1 |1 - lambda_2|)). A chain that
/// cannot visit a state twice has lambda_1 = 0: failure_rate = 1, and the distribution is that of the last survivors
/// (zero on classes they do not reach). O(n^2) an iteration for full rows.
/// Where nobody survives (lambda_1 < 1e-13) the vectors are those of 100 iterations, settled or not.
/// @throws ConvergenceError("inverse iteration", residual, ...) after 10000 iterations.
QuasiStationary quasi_stationary(const ChainSolver& solver);

/// Stationary distribution of a chain without rest (all kill rates zero on its only closed class), by
/// subtraction-free elimination. Size n, sums to one; zero on transient states. Also right for periodic chains
/// (the time average). @throws std::domain_error if rest can be reached or there are several closed classes
/// among the states reachable from `start`.
std::vector<double> stationary(const Chain& chain, std::span<const double> start);

/// Stationary distribution of the chain that is put back after rest: on reaching rest it restarts in
/// `restart` (size n, sums to restart_mass <= 1: the rest 1 - restart_mass of the launches comes to rest at
/// its very first collision and is launched again; those events are not counted). Size n, sums to one.
/// @throws std::invalid_argument when `restart` has a negative entry or no mass.
std::vector<double> stationary_with_restart(const ChainSolver& solver, std::span<const double> restart);

/// Steps after which the distribution of the survivors, started from `start` (size n), is within
/// `distance` in total variation of the quasi-stationary one (of the class it is in), and stays there for one
/// more period (the distance, 0 < distance < 1, is half the sum of absolute differences). Nothing after `limit` steps,
/// or when nobody survives so long. O(entries) a step.
std::optional<int> total_variation_mixing(const ChainSolver& solver, const QuasiStationary& quasi,
                                          std::span<const double> start, double distance, int limit = 100000);

/// Spectral mixing time [steps]: 1 / ln(lambda_1 / |lambda_2|), moduli per step, falling; 0 if
/// lambda_2 = 0 or absent, infinite if the two are equal.
double spectral_mixing_steps(std::span<const double> moduli);

}  // namespace metastable::markov
