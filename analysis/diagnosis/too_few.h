#pragma once
// Lists statements for which an experiment has too few trials, collisions or rests, and how many would do.

#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// Counts the trials that the held-out measures need: two a fold.
inline std::size_t trials_for_folds(int folds) { return 2 * static_cast<std::size_t>(folds); }

/// The trials, and transitions of a speed in all of them, from which a gap is put down to a cause: contact
/// parameters, an effect of the catalogue, or something without a name. A rule: five transitions for each of the eight
/// parameters that a hypothesis fits (means and sds of eta and mu, shape, noise, an effect's own), and as many trials
/// as a trend among them takes to be told from one odd trial. The tests for a gap are honest below (of 384 folders
/// without one, of 2 to 6 trials of 2 to 16 collisions, 5 at the level of 2 %; tests/benchmarks/own_data.py --few);
/// what bends most would pass for its cause.
inline constexpr std::size_t least_trials_to_explain = 4, least_transitions_to_explain = 40;

/// Says how many trials like these would do to put a gap down to a cause; nothing: these do.
std::optional<std::size_t> trials_to_explain(const Diagnosis& d);

/// @param d  complete but for `not_possible`
std::vector<NotPossible> too_few(const TransitionModel& model, const Diagnosis& d, const DiagnosisOptions& options);

}  // namespace metastable::analysis
