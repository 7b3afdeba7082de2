#pragma once
// Reads off one chain the numbers of a study that need no replicates.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"
#include "markov/chain/solver.h"
#include "markov/passage/quasi_stationary.h"
#include "markov/transition_rows/discretization.h"

namespace metastable::analysis {

/// A chain whose every state reaches rest, solved once for all that is read off it.
struct SolvedChain {
  /// @param regime  the states, ascending, among which the metastable regime is sought; none: all
  /// @throws std::domain_error, markov::ConvergenceError as markov::ChainSolver, markov::quasi_stationary
  explicit SolvedChain(const markov::SampledChain& sampled, const std::vector<std::uint32_t>& regime = {});

  markov::ChainSolver solver;
  std::vector<double> mean;  ///< expected steps from every state
  markov::QuasiStationary quasi;
  /// The distribution of the regime's survivors, each cyclic class (a landing leg) summing to one.
  std::vector<double> survivors;
  double from_start = 0;  ///< expected steps from the launch
};

struct ChainSteps {
  double from_start = 0;
  double from_quasi_stationary = 0;
  double worst_start = 0;
  std::optional<double> reach_end;  ///< as StepsToRest::reach_end, where it is asked for
};

/// Finds the expected steps of a sampled chain. The worst start is the lowest state a survivor can have, at the phase
/// where that is worst; its landings are drawn with `draws` (each at most 16384, the first four).
ChainSteps chain_steps(const markov::AnyReturnMap& map, const markov::StateSpace& space, const SolvedChain& solved,
                       const std::vector<markov::DrawOptions>& draws);

/// Returns StepsToRest::reach_end of a chain where a study is asked for its interval; nothing otherwise.
std::optional<double> asked_reach_end(const Problem& problem, const SolvedChain& solved, const markov::Launch& launch,
                                      const StudyOptions& options);

/// Returns the probability of surviving so many events, by following the chain; no more than 100000 are followed.
double followed_survival(const markov::SampledChain& sampled, int events);

/// Holds the scale on which probabilities of survival have intervals: ln(-ln p), on which survival of many steps moves
/// as ln(expected steps) does; or p itself, if one of the probabilities is 0 or 1.
class SurvivalScale {
 public:
  explicit SurvivalScale(std::span<const double> probabilities);
  double at(double p) const;
  /// Returns p with the interval that reaches to `half` on either side on this scale.
  Estimate interval(double p, double half) const;

 private:
  bool by_hazard_ = true;
};

/// The levels of all quantiles.
inline constexpr double quantile_levels[] = {0.05, 0.25, 0.5, 0.75, 0.95};

/// Counts the values of the survival curve that a study gives: to the end of the course, where that is not too far.
std::size_t survival_steps(const Problem& problem);

/// Returns what a study says where rest is too rare for it. @param message  follows "rest is possible, but "
Metastability rest_unresolved(const Problem& problem, const StudyOptions& options, const std::string& message);

/// Returns the middle of every cell.
std::vector<double> midpoints(const markov::StateSpace& space);

/// Fills everything of `result` that is read off one chain (all but the estimates and their errors).
/// @param states  that the chain's states stand for: the midpoints of the cells of `space`, or the nodes in them
void summarize(const Problem& problem, const markov::StateSpace& space, std::span<const double> states,
               const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options,
               Metastability& result);

/// Fills the errors of result.survivors by what the same chain of half as many cells says.
void compare_survivors(const Problem& problem, std::span<const double> states, const markov::SampledChain& sampled,
                       const SolvedChain& solved, Metastability& result);

/// Fills `result` for a chain with states that never come to rest. Expected steps are infinite unless all launches
/// rest.
void summarize_endless(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
                       const StudyOptions& options, Metastability& result);

}  // namespace metastable::analysis
