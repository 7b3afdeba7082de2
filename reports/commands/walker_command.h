#pragma once
// Runs steps, compare, sweep, simulate and report with --walker.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/statistics/last_moments.h"
#include "analysis/walker_model/walker_experiment.h"
#include "analysis/walkers/walker_study.h"
#include "analysis/walkers/walker_trials.h"
#include "reports/study/splitting_text.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

/// Says how `steps` finds its answer.
enum class WalkerMethod {
  mesh,
  splitting,
  both  ///< a mesh where it can be had, and splitting beside it
};

/// Says what splitting splits by.
enum class WalkerLevel { learnt, mesh };

/// Returns the options of splitting with that level; a level function of the user's stays.
markov::SplittingOptions with_level(markov::SplittingOptions options, WalkerLevel level);

/// Holds what all of them have.
struct WalkerRequest {
  std::vector<analysis::WalkerSetting> settings;  ///< one or more
  markov::MeshStudyOptions study;
  WalkerMethod method = WalkerMethod::mesh;                  ///< of steps
  markov::SplittingOptions splitting = {};                   ///< likewise
  WalkerLevel level = WalkerLevel::learnt;                   ///< likewise
  std::string json;                                          ///< file, "-" for standard output, "" for none
  std::string out;                                           ///< file of a sweep, folder of trials or of a report
  std::string command;                                       ///< the command line, for provenance
  bool how_it_fails = false;                                 ///< of steps
  double time_limit = usual_time_limit;                      ///< of steps [s]
  std::vector<double> slopes, slope_sds;                     ///< [deg], the axes of a sweep: settings slope by slope
  analysis::WalkOptions walks = {};                          ///< of simulate
  std::vector<std::pair<std::string, double>> effects = {};  ///< of simulate: "hip_damping.damping" and values
  std::optional<analysis::WalkerReality> reality = {};  ///< of simulate, in the laboratory, with effects of its own
  const struct Sharing* sharing = nullptr;              ///< of a sweep, with other processes
};

/// Holds what `steps` and `compare` find; moments where they were asked for.
struct WalkerAnswer {
  std::vector<analysis::WalkerStudy> studies;  ///< a setting each; none where there is no mesh
  std::optional<SplittingAnswer> splitting = {};
  std::optional<analysis::LastMoments> moments;
};
/// Finds a mesh's answer, that of splitting, or both, held against each other.
/// @param mesh  finds the mesh's answer; under `both`, what it throws for want of a mesh, or because other ways refute
///        it, becomes SplittingAnswer::no_mesh
/// @param split  finds the answer of splitting with a listener; under `both`, where there is a mesh, what it throws for
///        want of a number becomes SplittingAnswer::no_splitting
/// @returns the answer of splitting where it was asked
/// @throws as these; markov::Disagreement where the two contradict each other
std::optional<SplittingAnswer> ask_both_ways(WalkerMethod method, const std::string& name,
                                             const std::function<const markov::MeshStudy*()>& mesh,
                                             const std::function<markov::SplittingStudy()>& split);
/// @throws as agreed_walker()
WalkerAnswer answer_walker_steps(const WalkerRequest& request, const BeginPart& begin);
WalkerAnswer answer_walker_compare(const WalkerRequest& request, const BeginPart& begin);
std::string walker_answer_json(const WalkerRequest& request, const WalkerAnswer& answer);
/// @param width  of a line [characters]
std::string walker_answer_text(const WalkerRequest& request, const WalkerAnswer& answer, std::size_t width);

/// Prints gait, expected steps, rate, mixing and what stands behind them.
/// @throws markov::Disagreement where independent ways contradict each other: then no number is given (all but simulate
///         do)
void run_walker_steps(const WalkerRequest& request);

/// Prints every setting, and the ratio of the later ones' expected steps to the first one's.
void run_walker_compare(const WalkerRequest& request);

/// Writes expected steps over slopes and their sds; it is taken up again like every sweep.
void run_walker_sweep(const WalkerRequest& request);

/// Writes an experiment folder of walks (experiment.toml, steps.csv, trials.csv), of the model or of the laboratory;
/// with terrain that remembers, walks.csv (every step, exact) and trials.csv.
void run_walker_simulate(const WalkerRequest& request);

/// Writes the page of walkers: numbers, section, last steps.
void run_walker_report(const WalkerRequest& request);

}  // namespace metastable::reports
