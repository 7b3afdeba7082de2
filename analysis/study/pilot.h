#pragma once
// Says by a coarse solve where the cells of a study belong.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"
#include "markov/transition_rows/discretization.h"
#include "markov/transition_rows/state_space.h"

namespace metastable::analysis {

struct Pilot {
  markov::StateSpace space;
  std::vector<double> nu, h, visits;  ///< as in markov::graded_space()
  bool beside = false;                ///< some states never come to rest, but no launch leads to them
  double regime_top =
      0;  ///< state above which all but 1e-13 of nu lies in no phase; infinity if the bulk holds the launch
  /// Lists the states of `cells` below that; none if all are.
  std::vector<std::uint32_t> regime(const markov::StateSpace& cells) const;
  /// Returns the cells of one phase, graded.
  markov::StateSpace graded(std::size_t cells) const { return markov::graded_space(space, nu, h, visits, cells); }
};

/// Makes a pilot wide enough for the metastable regime; nothing if some of the pilot's states do not come to rest with
/// the draws that reach `options.tail`.
/// @param beside  such states are left out as long as the launch does not lead to them (and leads anywhere)
std::optional<Pilot> solve_pilot(const Problem& problem, const StudyOptions& options, bool beside = false);

/// Returns as many cells as give the bulk `cells` of them where a fast launch needs some of its own.
std::size_t with_launch(const Problem& problem, std::size_t cells, std::uint64_t seed);

/// Returns the options with a tail as deep as a study goes where failures have this rate.
StudyOptions deep_enough(StudyOptions options, double failure_rate);

/// Returns the draws of one replicate of a study.
markov::DrawOptions draw_options(const StudyOptions& options, std::size_t samples, int replicate);

/// Does every state of the chain come to rest for certain? Is there one that never does?
bool rests(const markov::SampledChain& sampled);
bool never_rests(const markov::SampledChain& sampled);

/// Returns the chain in which states that need not come to rest, and that the launch does not lead to, rest at once.
markov::SampledChain without_unreached(markov::SampledChain sampled);

}  // namespace metastable::analysis
