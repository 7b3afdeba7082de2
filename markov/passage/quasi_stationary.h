#pragma once
// Finds the quasi-stationary distribution, the escape rate and the mixing times.

#include <optional>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/chain/solver.h"
#include "markov/passage/leading_pair.h"

namespace metastable::markov {

/// Describes how survivors of an absorbing chain behave (Byl & Tedrake 2009, their lambda_2 is lambda_1 here).
struct QuasiStationary {
  /// The left eigenvector of lambda_1 (size n), y Q = lambda_1 y, sum 1, which says what survivors look like. For
  /// period d > 1 survivors are in one cyclic class at a time, and the shares that classes have in it are those of
  /// walkers spread over all of them; what survivors in one class look like is its part, see shares_in_classes().
  std::vector<double> distribution;
  /// The right eigenvector, max 1, which is the relative long-run survival from each state.
  std::vector<double> survival_weight;
  /// It is 1 - lambda_1 per step, with relative accuracy near rounding: for period d, 1 - (lambda of the
  /// revolution)^(1/d), evaluated as -expm1(log1p(-rate of the revolution) / d).
  double failure_rate = 0;
  /// It is 1 - lambda of one revolution (failure_rate when the period is 1).
  double revolution_failure_rate = 0;
  int iterations = 0;
  /// The largest of: |y Q - lambda_1 y| and |Q x - lambda_1 x| entry by entry, relative to that entry times the
  /// probability of leaving its state; and what is left of the error along other eigenvectors, relative, which these do
  /// not show where states change places slowly.
  double residual = 0;
};

enum class FewSurvivors { as_others, unsettled };

/// Iterates inversely with the subtraction-free factors, each time followed by one step of the chain (iterates stay
/// positive; an iteration shrinks the rest by (1 - lambda_1) |lambda_2| / (lambda_1 |1 - lambda_2|)), from two starts.
/// Chains of up to 64 states, and those for which 500 iterations were not enough or the starts lead to different ends,
/// take leading_pair(). A chain that cannot visit a state twice has lambda_1 = 0: failure_rate = 1, and the
/// distribution is that of the last survivors of an even start. O(n^2) an iteration for full rows.
/// @param few  unsettled, for studies, where entries below 1e-12 of the largest do not matter: these may be unsettled,
/// and where hardly anybody survives (lambda_1 < 1e-6) the vectors are those of 500 iterations, settled or not (of 100
/// for lambda_1 < 1e-13), and mean little; the residual is the last change. Interpolated rows are always taken so.
/// @throws NotUnique where the chain has several quasi-stationary distributions, or double precision does not tell;
/// ConvergenceError("inverse iteration", residual, ...) after 10000 iterations of interpolated rows, or where the
/// residual exceeds 1e-8.
QuasiStationary quasi_stationary(const ChainSolver& solver, FewSurvivors few = FewSurvivors::as_others);

/// Finds the same for the whole of a chain by leading_pair(), cyclic ones too, whose classes are not told apart.
/// @param pair  receives both vectors in extended precision
/// @throws NotUnique; ConvergenceError where the residual exceeds 1e-8
QuasiStationary quasi_stationary_as_a_whole(const Chain& chain, LeadingPair& pair, const Heard& heard = {});

/// Scales the entries of every cyclic class of a distribution to sum to one; classes without any stay 0.
std::vector<double> shares_in_classes(const Period& period, std::vector<double> distribution);

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
