#pragma once
// A coarse solve that says where the cells of a study belong.

#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"
#include "markov/rows/discretization.h"
#include "markov/rows/state_space.h"

namespace metastable::analysis {

struct Pilot {
  markov::StateSpace space;
  std::vector<double> nu, h, visits;  ///< as in markov::graded_space()
  /// Cells of one phase, graded.
  markov::StateSpace graded(std::size_t cells) const { return markov::graded_space(space, nu, h, visits, cells); }
};

/// Wide enough for the metastable regime; nothing if some of the pilot's states do not come to rest with the draws that
/// reach `options.tail`.
std::optional<Pilot> solve_pilot(const Problem& problem, const StudyOptions& options);

/// The draws of one replicate of a study.
markov::DrawOptions draw_options(const StudyOptions& options, std::size_t samples, int replicate);

/// Does every state of the chain come to rest for certain?
bool rests(const markov::SampledChain& sampled);

}  // namespace metastable::analysis
