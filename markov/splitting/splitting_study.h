#pragma once
// Finds expected steps of any return map by splitting, without a mesh: any dimension, any noise.

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "markov/mesh/batch_map.h"
#include "markov/mesh/mesh_study.h"
#include "markov/splitting/pooled_rounds.h"
#include "markov/splitting/weighted_ensemble.h"

namespace metastable::markov {

struct SplittingOptions {
  LevelFunction level = {};    ///< that ensembles are split by; empty: learnt, or a mesh's
  bool level_of_mesh = false;  ///< a mesh's (mesh_level()) instead of a learnt one, in up to four dimensions
  std::size_t level_bytes = std::size_t{3} << 30;  ///< most memory of that mesh, which takes most_calls / 4 at most
  std::size_t replicas = 0;  ///< of one ensemble, >= 100; 0: 1000, of a tolerance above 0.05 50 / tolerance, >= 200
  int rounds = 16;           ///< independent ensembles, >= 8, a multiple of the pilots
  int pilots = 4;            ///< that each learn a level of their own, >= 1
  double tolerance = 0.05;   ///< wanted half-width of the 95 % interval of ln steps, > 0
  std::uint64_t most_calls = 400000000;  ///< rows that the map is asked for, in all
  std::uint64_t seed = 1;
  int threads = 0;             ///< 0: all cores; the bits do not depend on it
  std::size_t last_steps = 0;  ///< of what fails after the burn-in that are remembered
  /// It is called with the share of the work that is done, 0 until that can be foretold, from any thread but one at a
  /// time, and may throw to stop.
  std::function<void(double)> progress = {};
};

/// Says what ensembles are split by.
enum class SplitBy {
  nothing,  ///< failures are frequent
  given,    ///< a level function
  learnt,
  mesh
};

struct SplittingStudy {
  MeshEstimate steps;         ///< expected steps before failure from the start
  MeshEstimate failure_rate;  ///< a step, from the quasi-stationary distribution
  double mixing_steps = 0;    ///< e-folding of what is remembered of a state, by a regression of ranks
  /// Holds the shares that walk on after 1, 2, ... steps, through the burn-in; beyond see survival_after().
  std::vector<MeshEstimate> survival;
  /// Walks fail before the start is forgotten (less than 1e-6 of a step is left to expect). Then steps are counted,
  /// nothing is split, and there are no survivors to speak of: the failure rate and the mixing steps are NaN, and
  /// `rates` is empty.
  bool all_failed = false;
  int rounds = 0;
  std::uint64_t round_steps = 0;  ///< that each took
  std::uint64_t calls = 0;        ///< rows that the map was asked for, those of the pilots included
  std::uint64_t pilot_calls = 0;
  SplitBy split_by = SplitBy::nothing;
  std::size_t level_nodes = 0;  ///< of a mesh whose level they are split by
  int level_window = 0;         ///< [steps] within which its level foretells failure
  double lines = 0;             ///< independent lines of descent that lead to failure: (sum w)^2 / sum w^2
  std::vector<double> rates;    ///< of each round
  FailingWalks failing;         ///< of all rounds, some thousands at most; weights are even in each round
  /// Holds states of the metastable regime [n x dimension] and their weights, of a revolution of phases.
  std::vector<double> regime_states, regime_weights;
  /// Say how many of these stand before the end of each round: round by round one after another.
  std::vector<std::size_t> failing_ends, regime_ends;
  PooledRounds pool;   ///< for survival_after()
  double widened = 1;  ///< the interval of the rate over that of the last look alone
  /// Empty, or a sentence that says why `steps` must not be used.
  std::string disagreement;
};

/// Returns the expected steps of survivors who have forgotten the start: one over the failure rate.
MeshEstimate steps_from_quasi_stationary(const SplittingStudy& study);

/// Returns the share that walks on after so many steps, from the start. Its interval is wider in proportion where that
/// of the failure rate is. The ends are NaN where the rounds lie too far apart (odds_interval), as where few have seen
/// a failure so early, and the share, too, where all walks have failed by then.
MeshEstimate survival_after(const SplittingStudy& study, std::uint64_t steps);

/// Lets `pilots` ensembles explore and learn what to split by, and `rounds` independent ones be split by that. Each
/// starts at `start`, is followed through a burn-in of three mixing times or two windows, which tells how survival
/// begins, and then until the failure rates of all give an interval as narrow as asked, or most_calls is reached.
/// Expected steps are the survival's sum through the burn-in, and the rate beyond. The intervals are Student's, of the
/// logarithm, over the jackknife's values of the rounds; they are looked at each time the rounds have walked on, and
/// the largest scatter seen counts, because an interval that ends the walk may be narrow by chance. Where the pilots'
/// levels disagree in a first stretch (at a level of 0.001), all is begun anew, twice at most. Where all replicas
/// of one ensemble fail, the rounds start anew, without levels, and walk until all of theirs have failed.
///
/// No number is given where fewer than 30 independent lines lead to failure (a line is founded one to two windows
/// before; a window is 1.5 mixing times, of a learnt level also as many steps as a failure takes), where the interval
/// is wider than a factor of four, where, at a level of 0.001, rates change between the halves of the rounds or rounds
/// split by different levels differ, and where walks have slipped into another gait (StartGait) and the share of those
/// has not settled: it may change by less than a tenth, two standard errors included, from the end of the burn-in to
/// that of the rounds. Maps that draw for themselves cannot be followed without noise: of these no other gait is seen.
/// @throws std::invalid_argument for options out of range; NoSplitting where no replica fails, saying after how
/// many steps of the map; MapError as WeightedEnsemble; as mesh_level() for a mesh's level
SplittingStudy splitting_study(const BatchMap& map, std::span<const double> start,
                               const SplittingOptions& options = {});

/// @param what  was studied, for the message
/// @throws Disagreement with SplittingStudy::disagreement, unless that is empty
void require_agreement(const SplittingStudy& study, const std::string& what);

/// Holds a mesh's expected steps against those of splitting, as the other ways of MeshStudy.
/// @throws Disagreement where they lie further apart than 1.7 times their joint half-width
void require_agreement(const MeshStudy& mesh, const SplittingStudy& splitting, const std::string& what);

}  // namespace metastable::markov
