#pragma once
// Takes the derivative of sampled expected steps along the draws, without differences of noisy solves.

#include <vector>

#include "analysis/study/setting.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/state_space.h"

namespace metastable::analysis {

/// Holds two settings on either side of the one in question, `distance` apart in the parameter that moves.
struct Neighbours {
  Setting minus, plus;
  double distance = 0;
};

/// Returns d ln(expected steps from the launch) / d parameter for each pair of neighbours, on one sampled chain.
///
/// Given a draw, the next state is T(x) = scale x - drag sqrt(x) + gain beyond the x* where it comes over the barrier.
/// With m the mean first passage (linear between the midpoints of cells), y the density of visits, and a the lowest
/// state of a survivor,
///   dM = E [ integral of y m'(T) dT dx - y(x*) m(a) dx* ],
/// where every derivative is that of four numbers of the draw (scale, drag, barrier, gain), taken by central
/// differences at fixed scores. Nothing jumps, so the weighted draws of the study are enough. Cost: one solve, and one
/// landing per cell and draw, whatever the number of parameters.
/// @throws std::invalid_argument for a constant launch with correlated noise; markov::ConvergenceError if the draws do
/// not come to rest from everywhere
std::vector<double> pathwise_slopes(const Setting& setting, const std::vector<Neighbours>& neighbours,
                                    const markov::StateSpace& space, const markov::DrawOptions& draws);

}  // namespace metastable::analysis
