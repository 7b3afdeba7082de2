#pragma once
// Studies the metastability of one setting: expected steps before failure and what goes with them, with their errors.
//
// Example:
//   #include <metastable/analysis/study/metastability.h>
//
//   #include <cstdio>
//
//   int main() {
//     metastable::analysis::Setting setting;  // the paper's wheel, here on its steeper ramp
//     setting.slope_deg = 9.59;
//     setting.initial_speed = {5.83, 0.28};  // mean, sd [rad/s]
//     const auto study = metastable::analysis::study(setting, {.tolerance = 0.005});
//     const auto [value, lower, upper] = study.steps.from_start;
//     std::printf("%.2f steps before failure (95 %%: %.2f to %.2f)\n", value, lower, upper);
//   }
// prints
//   6.13 steps before failure (95 %: 6.13 to 6.14)

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/statistics/estimate.h"
#include "analysis/study/problem.h"
#include "analysis/study/setting.h"
#include "markov/transition_rows/draws.h"

namespace metastable::analysis {

/// Says how rows are made.
enum class Method {
  sampled,     ///< by draws of the noise in every cell
  integrated,  ///< from the landing's density on Gauss-Legendre nodes (integrated_study.h)
  followed,    ///< none: launches are followed one by one. Only of results (followed_study.h)
};

struct StudyOptions {
  Method method = Method::sampled;
  std::size_t cells = 0;    ///< per phase, 8 .. 4096; 0: refined until the tolerance is met
  std::size_t samples = 0;  ///< draws per cell and replicate, 16 .. 2^24; 0: raised until the tolerance is met
  double tolerance = 0.01;  ///< wanted relative half-width of the 95 % interval of the expected steps, (0, 1)
  std::uint64_t seed = 1;
  int threads = 0;      ///< 0: all cores. Results do not depend on it
  int replicates = 8;   ///< independent randomisations behind the interval, 2 .. 64
  bool direct = false;  ///< of a setting under `settled`: every landing followed (LandingOptions)
  markov::Sequence sequence = markov::Sequence::sobol;
  markov::Weighting weighting = markov::Weighting::weighted;
  double tail = 1e-30;  ///< tail probability the weighted draws reach; deepened by itself where failures are that rare
  double mixing_distance = 0.05;  ///< total variation distance that counts as mixed
  int eigenvalues = 6;            ///< how many moduli to report
  bool brief = false;             ///< leave out seconds, metres, spectrum, mixing and violated assumptions (sweeps do)
  bool reach_end_interval = false;         ///< work out StepsToRest::reach_end_interval too
  std::size_t largest_cells = 1024;        ///< refinement stops here
  std::size_t largest_samples = 1u << 18;  ///< and here
  /// It is called now and then, from any thread, with the work done so far in [0, 1] and what is being done, and may
  /// throw to stop. Of a part it may hear later again with less.
  std::function<void(double, const std::string&)> progress = {};
  void validate() const;
};

enum class Status {
  converged,          ///< tolerance met
  tolerance_not_met,  ///< refinement stopped at its largest size; the interval says how far it got
  fixed_resolution,   ///< tolerance not met, but cells and samples were both given: nothing was refined
  rest_unreachable,   ///< expected steps are infinite
  solver_failed,      ///< only in sweeps: a solver did not converge at this point, see the message
  rest_unresolved,    ///< rest is possible, but beyond the draws: expected steps exceed from_start.lower
  no_regime,          ///< only in sweeps: there is no metastable regime to launch from, see the message
};

/// Returns where the landings of a study with these options come from; the table's progress is told to options.progress
/// as a part of the work, that in [from, to].
LandingOptions landing_options(const StudyOptions& options, double from = 0, double to = 1);

/// Builds the table of landings of a setting under `settled`, which studies of this wheel and slope then find built
/// (SettledMap::of). It does nothing where they need none; where none can be had, the studies say why.
/// @throws std::invalid_argument as study(), and what options.progress throws
void tabulate_landings(const Setting& setting, const StudyOptions& options);

/// A value below which a share `level` of all launches stay.
struct Quantile {
  double level = 0;  ///< in (0, 1)
  double value = 0;
};

/// Holds the total of something accumulated from a launch until rest.
struct Accumulated {
  double mean = 0, sd = 0;
  std::vector<Quantile> quantiles;  ///< at 0.05, 0.25, 0.5, 0.75, 0.95; empty where a study could not resolve them
  /// Returns the quantile at one of these levels; nothing where it is not among them.
  std::optional<double> quantile(double level) const;
};

/// Says what survivors look like at one phase (one landing leg).
struct PhaseDistribution {
  std::vector<double> edges;  ///< of the cells, in state units; cells + 1
  std::vector<double> mass;   ///< sums to one
  double mean = 0, sd = 0;    ///< of the observable
};

struct ViolationShare {
  std::string name;
  double quasi_stationary = 0;  ///< of collisions in the metastable regime; NaN where there is none
  double until_rest =
      0;  ///< of all collisions from the launch to rest (to the end of `survival` where some never rest)
  double quasi_stationary_error = 0, until_rest_error = 0;  ///< standard errors of their draws
};

/// Holds the steps before failure, and what goes with them until then.
struct StepsToRest {
  Estimate from_start;                 ///< expected steps before failure, from the launch
  Estimate from_quasi_stationary;      ///< the same from the metastable regime = 1 / Spectrum::failure_rate
  Estimate worst_start;                ///< from the slowest survivor of a step
  double discretization_error = 0;     ///< relative, of from_start: a third of the extrapolation's last change
  double sampling_error = 0;           ///< relative 95 % half-width of from_start over replicates
  double landing_error = 0;            ///< relative, where landings are read from a table (landing_error.h)
  Estimate memory;                     ///< relative change of from_start by what states leave out (landing_error.h)
  double solver_disagreement = 0;      ///< relative difference of the launch's expected steps, elimination against KLU
  std::vector<double> replicate_logs;  ///< ln(expected steps from the launch) of each replicate, extrapolated
  Accumulated distribution;            ///< from the launch, the last step counted
  std::optional<Accumulated> seconds;  ///< from collision 1 to the last collision
  std::optional<Accumulated> metres;   ///< from the first foot to the last
  std::vector<double> survival;     ///< P(steps > n), n = 0, 1, ...: 64 values, or to the course's end (10000 at most)
  std::optional<double> reach_end;  ///< probability of surviving the last event of the course
  /// Holds reach_end with its 95 % interval, from chains and trials as from_start's; nothing where it was not asked for
  /// or launches were followed without noise.
  std::optional<Estimate> reach_end_interval;
  /// Widens that interval as if the logarithm of the expected steps might be so much less, and more; to an end of [0,
  /// 1] where that is not finite.
  void widen_reach_end(double less, double more);
  /// The state below which a launch may come to rest, when faster ones never do.
  std::optional<double> safe_state;
};

/// Holds the eigenvalues of the chain: they say how fast it fails, and how fast it forgets its start.
struct Spectrum {
  Estimate failure_rate;  ///< 1 - lambda_1 per step
  /// Per step, falling: lambda_1, and others that rounding leaves six digits, none for a map without noise.
  std::vector<double> moduli;
  int period = 1;                            ///< steps after which a phase comes again
  double mixing_steps = 0;                   ///< spectral, 1 / ln(lambda_1 / |lambda_2|)
  std::optional<int> total_variation_steps;  ///< from the launch to within StudyOptions::mixing_distance
};

/// Describes the metastable regime: what survivors look like once the start is forgotten.
struct Survivors {
  std::vector<PhaseDistribution> by_phase;
  double mean = 0, sd = 0;  ///< of the observable over all phases (equal shares); NaN where hardly any survives a step
  /// These are stationary, with a new launch after each rest; NaN where no launch goes on.
  double restart_mean = 0, restart_sd = 0;
  /// Say how far mean or sd moved with the last halving of the cells, at most; 0 where there was none, and
  /// in brief studies.
  double error = 0, restart_error = 0;
};

/// Holds one number of a chain, told in two ways that share little.
struct Agreement {
  std::string what;
  double one = 0, other = 0;
  double tolerance = 0;  ///< relative
};

/// Holds what a study answers, and what it was made with.
struct Metastability {
  std::optional<Setting> setting;  ///< studied; nothing for a return map of one's own
  Status status = Status::converged;
  std::string message;  ///< one sentence when there is something to say beside the numbers, empty otherwise
  Method method = Method::sampled;
  std::size_t cells = 0, samples = 0;
  int replicates = 0, phases = 1;

  StepsToRest steps;
  Spectrum spectrum;
  Survivors survivors;
  std::vector<ViolationShare> violations;  ///< of the return map's assumptions
  std::vector<Agreement> agreements;       ///< of the finest chain, checked before the study is given (consistency.h)
};

/// Studies by pilot grid, graded cells, replicated draws, three cell sizes, refinement until the tolerance
/// is met.
///
/// Expected steps and the failure rate are extrapolated (Richardson, order 2, in the logarithm) from the two finest
/// cell sizes of the chain of all replicates' draws; everything else is read off that chain at the finest size.
/// The 95 % interval is a t-interval over the replicates' extrapolations and, as an independent error, a third of the
/// difference of the last two extrapolations of all draws.
/// Method::integrated: integrated_study(). A problem without noise is followed whatever the method
/// (followed_study()), and every chain's answer is held against trials (held_against_trials()).
/// @throws std::invalid_argument for options out of range; markov::ConvergenceError when a solver fails or the results
/// contradict each other (consistency.h)
Metastability study(const Problem& problem, const StudyOptions& options = {});

/// Says whether a setting can be studied so, without studying it.
/// @throws std::invalid_argument for a setting out of range, and for Method::integrated with an sd of restitution or
/// friction below 1e-3 that is not 0
void check_setting(const Setting& setting, Method method);

/// Does the same for a wheel on a ramp: setting.problem(), with Metastability::setting in the answer; of a steady
/// launch the speeds are found first (steadily_launched()), and are in that setting.
/// @throws std::invalid_argument also as check_setting() and steadily_launched()
Metastability study(const Setting& setting, const StudyOptions& options = {});

/// Says what else is known of a setting's rest, beside its study.
struct RestThresholds {
  std::optional<double> safe_speed;      ///< launches at least this fast never come to rest [rad/s]
  std::optional<double> safe_slope_deg;  ///< steeper ramps have such launches [deg]
  bool slope_sought = true;              ///< false under `settled`: every slope would need a table of landings
};
/// Takes the speed from the study, the slope from safe_slope_deg(): a bisection.
/// @throws std::bad_optional_access for a study without a setting
RestThresholds rest_thresholds(const Metastability& study);

/// Returns "converged", "tolerance_not_met", "rest_unreachable", ...: one word per status.
std::string status_text(Status status);
/// Returns "sampled", "integrated", "followed".
std::string_view method_name(Method method);
/// Takes what may be asked for. @throws std::invalid_argument naming the two
Method method_from_name(std::string_view name);

}  // namespace metastable::analysis
