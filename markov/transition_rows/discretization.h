#pragma once
// Leads from a return map to a chain: sampled rows, launch row.

#include <cstddef>
#include <span>
#include <vector>

#include "markov/chain/chain.h"
#include "markov/passage/first_passage.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/return_map.h"
#include "markov/transition_rows/state_space.h"

namespace metastable::markov {

/// A chain sampled from a return map, and what goes with it.
///
/// A row is averaged over its cell: draw k starts at lower + width * offset[k] of every cell, with the cell offsets a
/// further dimension of the same point set. All cells of one phase share their draws (common errors keep rows smooth in
/// the state and make differences between settings precise); phases have their own. Landing in [edge_j, edge_{j+1})
/// counts for cell j. With S Sobol draws the sampling error of the results falls about like 1/S, with random draws like
/// 1/sqrt(S); for N cells the discretization error falls like 1/N^2 (expected steps come out low).
struct SampledChain {
  Chain chain;
  Launch launch;
  std::vector<double> duration;  ///< per state: time of the step that ends there [s]; empty if the map does not tell
  std::vector<double> advance;   ///< per state: distance of the step that ends there [m]; empty likewise
};

struct Discretization {
  DrawOptions draws;
  /// Take the probability of rest from the map (averaged over each cell by three Gauss nodes) where it offers it,
  /// instead of counting draws that rest. Exact tails; only landings are then sampled.
  bool exact_rest = false;
  int threads = 1;
};

/// Makes all phases' rows and the launch row. Cost: size() x draws landings. Deterministic for any number of threads.
SampledChain discretize(const AnyReturnMap& map, const StateSpace& space, const LaunchState& launch,
                        const Discretization& options);

/// Makes the launch row alone: where event number 1 leads. Launches of which hardly any survive are drawn down to the
/// tail too, where draws are weighted: those few may go on for ever so long.
Launch launch_row(const AnyReturnMap& map, const StateSpace& space, const LaunchState& launch, const DrawOptions& draws,
                  int threads = 1);

/// Says how often events violate each of the map's assumptions: [assumption][state], and for the launch [assumption] at
/// the back (one extra entry: index size()). Plain draws, another randomisation for each state.
/// @param counts  of draws at each state; where 0, rates are left at 0
/// @param draws  their `count` is that at the launch
std::vector<std::vector<double>> violation_rates(const AnyReturnMap& map, const StateSpace& space,
                                                 const LaunchState& launch, std::span<const std::size_t> counts,
                                                 DrawOptions draws);

}  // namespace metastable::markov
