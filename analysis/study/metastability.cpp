#include "analysis/study/metastability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/interval_95.h"
#include "analysis/study/chain_summary.h"
#include "analysis/study/consistency.h"
#include "analysis/study/followed_study.h"
#include "analysis/study/integrated_study.h"
#include "analysis/study/landing_error.h"
#include "analysis/study/pilot.h"
#include "analysis/study/rest_reachability.h"
#include "analysis/study/steady_launch.h"
#include "analysis/study/trial_study.h"
#include "markov/parallel.h"
#include "markov/transition_rows/chain_pool.h"
#include "markov/transition_rows/discretization.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t first_cells = 128;
constexpr std::size_t first_samples = 4096;
constexpr std::size_t most_endless = 2048;     // cells a phase
constexpr double narrowest_integrated = 1e-3;  // sd of eta or mu: between its nodes rest is lost
constexpr int sizes = 3;                       // cell sizes a ladder holds: cells, cells / 2, cells / 4
// The extrapolation's last change over the error left in it: the error falls by four at least with each cell size.
constexpr double change_over_error = 3;

// Removes the error of order 2 in the cell size.
double extrapolate(double fine, double coarse) { return fine + (fine - coarse) / 3; }

// Returns nested cells for the whole range, coarsest first.
std::vector<markov::StateSpace> nested(markov::StateSpace coarsest) {
  std::vector<markov::StateSpace> spaces{std::move(coarsest)};
  while (spaces.size() < sizes) spaces.push_back(spaces.back().halved());
  return spaces;
}

// Holds one resolution's samples: the chain of all replicates' draws per cell size, and each replicate's
// answer.
struct Ladder {
  std::vector<markov::StateSpace> spaces;
  std::vector<markov::SampledChain> pooled;        // per cell size, coarsest first
  std::vector<std::vector<ChainSteps>> replicate;  // per cell size, per replicate
  bool rest_resolved = true;
};

class Study {
 public:
  Study(const Problem& problem, const StudyOptions& options) : problem_(problem), options_(options) {}

  Metastability run() {
    const RestReachability reach = rest_reachability(problem_);
    Metastability result = reach.certain ? finite(reach.safe_state.has_value()) : endless();
    result.steps.safe_state = reach.safe_state;
    return result;
  }

 private:
  // `beside` says that some states never come to rest, but the launch does not reach them.
  Metastability finite(bool beside) {
    for (;;) {
      tell(0, "pilot");
      const std::optional<Pilot> pilot = solve_pilot(problem_, options_, beside);
      if (pilot) {
        std::optional<Metastability> result = refine(*pilot);
        if (result) return *std::move(result);
      }
      if (beside) return endless();  // cells smear the launch over them, or no launch survives at all
      // Rest is possible, but no draw came to it, or hardly: look deeper into the tails, as far as doubles go.
      if (!can_look_deeper()) return unresolved();
      options_.tail = std::max(1e-300, options_.tail * options_.tail * options_.tail);
    }
  }

  bool can_look_deeper() const { return options_.weighting == markov::Weighting::weighted && options_.tail > 1e-300; }

  // Solves all replicates at one resolution, in batches of as many as there are threads; sums run in replicate order.
  Ladder climb(const Pilot& pilot, std::size_t cells, std::size_t samples, double work_before, double work_after) {
    Ladder ladder{nested(pilot.graded(cells >> (sizes - 1))), {}, {}};
    std::vector<markov::ChainPool> pools(sizes);
    const auto replicates = static_cast<std::size_t>(options_.replicates);
    const auto threads = static_cast<std::size_t>(markov::thread_count(options_.threads));
    const std::size_t batch = std::min(threads, replicates);
    const int inner = static_cast<int>(std::max<std::size_t>(1, threads / batch));
    std::vector<std::vector<ChainSteps>> steps(sizes, std::vector<ChainSteps>(replicates));
    for (std::size_t first = 0; first < replicates; first += batch) {
      tell(work_before + (work_after - work_before) * static_cast<double>(first) / static_cast<double>(replicates),
           fmt::format("{} cells, {} samples", cells, samples));
      const std::size_t count = std::min(batch, replicates - first);
      std::vector<std::vector<markov::SampledChain>> chains(count);
      parallel(count, [&](std::size_t k) {
        const auto draws = draw_options(options_, samples, static_cast<int>(first + k));
        for (const markov::StateSpace& space : ladder.spaces)
          chains[k].push_back(
              markov::discretize(problem_.map, space, problem_.launch, {.draws = draws, .threads = inner}));
        for (std::size_t s = 0; s < sizes; ++s) {
          if (pilot.beside) chains[k][s] = without_unreached(std::move(chains[k][s]));
          ChainSteps& one = steps[s][first + k];
          if (!rests(chains[k][s])) {
            one.from_start = infinite;
            continue;
          }
          const SolvedChain solved(chains[k][s], pilot.regime(ladder.spaces[s]));
          one = chain_steps(problem_.map, ladder.spaces[s], solved, {draws});
          one.reach_end = asked_reach_end(problem_, solved, chains[k][s].launch, options_);
        }
      });
      for (std::vector<markov::SampledChain>& one : chains)
        for (std::size_t s = 0; s < sizes; ++s) pools[s].add(one[s]);
    }
    for (const markov::ChainPool& pool : pools) {
      ladder.pooled.push_back(pool.mean());
      ladder.rest_resolved = ladder.rest_resolved && rests(ladder.pooled.back());
    }
    for (const std::vector<ChainSteps>& size : steps)
      for (const ChainSteps& one : size) ladder.rest_resolved = ladder.rest_resolved && std::isfinite(one.from_start);
    ladder.replicate = std::move(steps);
    return ladder;
  }

  std::optional<Metastability> refine(const Pilot& pilot) {
    const bool free_cells = options_.cells == 0, free_samples = options_.samples == 0;
    std::size_t cells = free_cells ? first_cells : (options_.cells + 3) / 4 * 4;
    std::size_t samples = free_samples ? first_samples : options_.samples;
    const std::size_t most_cells = problem_.map.phases() > 1 ? options_.largest_cells / 2 : options_.largest_cells;
    for (double done = 0;;) {
      const double next = free_cells || free_samples ? done + 0.5 * (1 - done) : 0.95;
      const Ladder ladder = climb(pilot, cells, samples, done, next);
      done = next;
      if (!ladder.rest_resolved) return std::nullopt;
      Assessed assessed = assess(pilot, ladder, cells, samples);
      Metastability& result = assessed.result;
      // A failure this rare may hang on noise rarer than the draws reach.
      if (can_look_deeper() && std::log(result.spectrum.failure_rate.value) < 0.6 * std::log(options_.tail))
        return std::nullopt;
      // What is read off the finest chain as it is must be within the tolerance too.
      const double unextrapolated = std::abs(std::log(result.steps.from_start.value / assessed.finest.from_start));
      const double change = change_over_error * result.steps.discretization_error;
      const double half = std::hypot(result.steps.discretization_error, result.steps.sampling_error);
      const auto within = [&](double error) { return std::max(error, unextrapolated) <= options_.tolerance; };
      const bool met = within(change + result.steps.sampling_error);
      bool refined = false;
      if (!met && free_cells && (change > options_.tolerance / 3 || unextrapolated > options_.tolerance) &&
          cells < most_cells) {
        cells *= 2;
        refined = true;
      }
      if (!met && free_samples && result.steps.sampling_error > options_.tolerance / 2 &&
          samples < options_.largest_samples) {
        samples *= 4;
        refined = true;
      }
      if (refined) continue;
      if (within(half)) {
        result.status = Status::converged;
      } else if (!free_cells && !free_samples) {
        result.status = Status::fixed_resolution;
      } else {
        result.status = Status::tolerance_not_met;
        result.message = fmt::format(
            "tolerance {} not met: the interval's half-width is {:.2g} (discretization {:.2g}, sampling {:.2g}) at {} "
            "cells and {} samples",
            options_.tolerance, half, result.steps.discretization_error, result.steps.sampling_error, cells, samples);
      }
      tell(0.96, "summary");
      const markov::StateSpace& space = ladder.spaces.back();
      const std::vector<double> states = midpoints(space);
      summarize(problem_, space, states, ladder.pooled.back(), assessed.finest, options_, result);
      if (!options_.brief)
        compare_survivors(problem_, midpoints(ladder.spaces[sizes - 2]), ladder.pooled[sizes - 2], assessed.middle,
                          result);
      add_landing_error(
          result, landing_error(problem_, space.phases(), states, ladder.pooled.back(), assessed.finest, options_),
          options_.tolerance);
      return std::move(result);
    }
  }

  struct Assessed {
    Metastability result;
    SolvedChain middle, finest;
  };

  // Gives the expected steps with their errors from the ladder.
  Assessed assess(const Pilot& pilot, const Ladder& ladder, std::size_t cells, std::size_t samples) const {
    std::vector<markov::DrawOptions> draws;
    for (int r = 0; r < options_.replicates; ++r) draws.push_back(draw_options(options_, samples, r));
    std::vector<ChainSteps> pooled;
    std::optional<SolvedChain> before_finest, finest;
    for (std::size_t s = 0; s < sizes; ++s) {
      std::swap(before_finest, finest);
      finest.emplace(ladder.pooled[s], pilot.regime(ladder.spaces[s]));
      pooled.push_back(chain_steps(problem_.map, ladder.spaces[s], *finest, draws));
      pooled.back().reach_end = asked_reach_end(problem_, *finest, ladder.pooled[s].launch, options_);
    }

    Metastability result;
    result.cells = cells;
    result.samples = samples;
    result.replicates = options_.replicates;
    const auto estimate = [&](double ChainSteps::*which, double& discretization, double& sampling) {
      std::vector<double> log_replicate;
      for (std::size_t r = 0; r < ladder.replicate[2].size(); ++r)
        log_replicate.push_back(
            extrapolate(std::log(ladder.replicate[2][r].*which), std::log(ladder.replicate[1][r].*which)));
      const double fine = std::log(pooled[2].*which), middle = std::log(pooled[1].*which),
                   coarse = std::log(pooled[0].*which);
      const double extrapolated = extrapolate(fine, middle), before = extrapolate(middle, coarse);
      discretization = std::abs(extrapolated - before) / change_over_error;
      sampling = t_interval(log_replicate).half_width;
      const double half = std::hypot(discretization, sampling);
      // One step is the least there is, whatever the extrapolation says.
      const auto steps = [](double logarithm) { return std::max(1.0, std::exp(logarithm)); };
      return Estimate{steps(extrapolated), steps(extrapolated - half), steps(extrapolated + half)};
    };
    double unused_d = 0, unused_s = 0;
    result.steps.from_start =
        estimate(&ChainSteps::from_start, result.steps.discretization_error, result.steps.sampling_error);
    result.steps.from_quasi_stationary = estimate(&ChainSteps::from_quasi_stationary, unused_d, unused_s);
    result.steps.worst_start = estimate(&ChainSteps::worst_start, unused_d, unused_s);
    const Estimate& quasi = result.steps.from_quasi_stationary;
    result.spectrum.failure_rate = {1 / quasi.value, 1 / quasi.upper, 1 / quasi.lower};
    for (std::size_t r = 0; r < ladder.replicate[2].size(); ++r)
      result.steps.replicate_logs.push_back(
          extrapolate(std::log(ladder.replicate[2][r].from_start), std::log(ladder.replicate[1][r].from_start)));
    if (pooled.back().reach_end) result.steps.reach_end_interval = reach_end(pooled, ladder.replicate.back());
    return {std::move(result), *std::move(before_finest), *std::move(finest)};
  }

  // Returns the probability as the finest chain has it. Its interval joins what the replicates on those cells leave
  // open and what the step to an extrapolated value would move.
  static Estimate reach_end(const std::vector<ChainSteps>& pooled, const std::vector<ChainSteps>& replicates) {
    std::vector<double> all;
    for (const std::vector<ChainSteps>* some : {&pooled, &replicates})
      for (const ChainSteps& one : *some) all.push_back(*one.reach_end);
    const SurvivalScale scale(all);
    const auto at = [&](std::size_t s) { return scale.at(*pooled[s].reach_end); };
    const double fine = at(2), extrapolated = extrapolate(fine, at(1)), before = extrapolate(at(1), at(0));
    std::vector<double> sampled;
    for (const ChainSteps& one : replicates) sampled.push_back(scale.at(*one.reach_end));
    const double cells = std::abs(extrapolated - fine) + std::abs(extrapolated - before) / change_over_error;
    return scale.interval(*pooled[2].reach_end, std::hypot(cells, t_interval(sampled).half_width));
  }

  // Answers where some states never come to rest: there is no first passage, but a stationary regime.
  Metastability endless() {
    Metastability result;
    result.status = Status::rest_unreachable;
    result.message = "infinite: rest is unreachable";
    result.cells = options_.cells == 0 ? 4 * first_cells : options_.cells;
    result.samples = options_.samples == 0 ? 4 * first_samples : options_.samples;
    result.replicates = 1;
    tell(0.1, "stationary distribution");
    for (;; result.cells *= 2) {
      const markov::StateSpace space =
          markov::covering_space(problem_.map, problem_.launch, result.cells, options_.seed);
      const markov::SampledChain sampled =
          markov::discretize(problem_.map, space, problem_.launch,
                             {.draws = draw_options(options_, result.samples, 0), .threads = options_.threads});
      if (!never_rests(sampled)) {
        if (options_.cells == 0 && result.cells < most_endless) continue;
        throw markov::ConvergenceError(
            "endless study", static_cast<double>(result.cells),
            "the states that never come to rest are too close to those that do for these cells");
      }
      tell(0.7, "summary");
      summarize_endless(problem_, space, sampled, options_, result);
      if (options_.reach_end_interval && problem_.last_event)
        result.steps.reach_end_interval = endless_reach_end(result);
      break;
    }
    if (std::isfinite(result.steps.from_start.value)) {
      result.status = Status::converged;
      result.message.clear();
      if (!result.survivors.by_phase.empty())
        result.message =
            "the metastable regime is of wheels that never rest: fewer than 1e-15 of the launches come to such speeds";
    }
    return result;
  }

  // Returns the probability that one set of draws gives, with an interval for what other draws and wider cells make of
  // it.
  Estimate endless_reach_end(const Metastability& result) const {
    const auto told = [&](std::size_t cells, int replicate) {
      const markov::StateSpace space = markov::covering_space(problem_.map, problem_.launch, cells, options_.seed);
      const auto draws = draw_options(options_, result.samples, replicate);
      return followed_survival(
          markov::discretize(problem_.map, space, problem_.launch, {.draws = draws, .threads = options_.threads}),
          *problem_.last_event);
    };
    const double wider = told(result.cells / 2, 0);
    std::vector<double> replicates{*result.steps.reach_end};
    for (int r = 1; r < options_.replicates; ++r) replicates.push_back(told(result.cells, r));
    std::vector<double> all = replicates;
    all.push_back(wider);
    const SurvivalScale scale(all);
    std::vector<double> sampled;
    for (const double p : replicates) sampled.push_back(scale.at(p));
    const double of_one = t_interval(sampled).half_width * std::sqrt(static_cast<double>(sampled.size()));
    return scale.interval(replicates.front(), std::hypot(scale.at(wider) - sampled.front(), of_one));
  }

  Metastability unresolved() const {
    Metastability result = rest_unresolved(problem_, options_,
                                           options_.weighting == markov::Weighting::plain
                                               ? "no plain draw came to it: use weighted draws"
                                               : "only by noise beyond probabilities of 1e-300");
    result.samples = options_.samples == 0 ? first_samples : options_.samples;
    result.cells = options_.cells == 0 ? first_cells : options_.cells;
    result.replicates = options_.replicates;
    result.steps.sampling_error = infinite;
    return result;
  }

  void parallel(std::size_t count, const std::function<void(std::size_t)>& work) const {
    markov::parallel_for(count, options_.threads, work);
  }
  void tell(double done, const std::string& what) const {
    if (options_.progress) options_.progress(done, what);
  }

  const Problem& problem_;
  StudyOptions options_;
};

}  // namespace

void StudyOptions::validate() const {
  if (method == Method::followed) throw std::invalid_argument("method: followed is none that can be asked for");
  if (cells != 0 && (cells < 8 || cells > 4096))
    throw std::invalid_argument(fmt::format("cells: {} is outside 8..4096", cells));
  if (samples != 0 && (samples < 16 || samples > (1u << 24)))
    throw std::invalid_argument(fmt::format("samples: {} is outside 16..{}", samples, 1u << 24));
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument(fmt::format("tolerance: {} is outside (0, 1)", tolerance));
  if (threads < 0 || threads > 1024)
    throw std::invalid_argument(fmt::format("threads: {} is outside 0..1024", threads));
  if (replicates < 2 || replicates > 64)
    throw std::invalid_argument(fmt::format("replicates: {} is outside 2..64", replicates));
  if (!(tail >= 1e-300 && tail <= 1e-3))
    throw std::invalid_argument(fmt::format("tail: {} is outside [1e-300, 1e-3]", tail));
  if (!(mixing_distance > 0 && mixing_distance < 1))
    throw std::invalid_argument(fmt::format("mixing distance: {} is outside (0, 1)", mixing_distance));
  if (eigenvalues < 1 || eigenvalues > 64)
    throw std::invalid_argument(fmt::format("eigenvalues: {} is outside 1..64", eigenvalues));
}

Metastability study(const Problem& problem, const StudyOptions& options) {
  options.validate();
  try {
    Metastability result = without_noise(problem)                 ? followed_study(problem, options)
                           : options.method == Method::integrated ? integrated_study(problem, options)
                                                                  : Study(problem, options).run();
    require_consistent(result);
    require_followed(problem, result, options);
    result = held_against_trials(problem, std::move(result), options);
    // Interpolated rows keep to that within their error; a curve that rises in its ninth digit is not to be shown.
    for (std::size_t n = 1; n < result.steps.survival.size(); ++n)
      result.steps.survival[n] = std::min(result.steps.survival[n], result.steps.survival[n - 1]);
    return result;
  } catch (const markov::RestTooRare&) {
    if (options.method == Method::integrated) {  // or a jump of the density lies between its nodes: draws tell
      StudyOptions sampled = options;
      sampled.method = Method::sampled;
      return study(problem, sampled);
    }
    return rest_unresolved(problem, options,
                           "so rare that the expected steps or their square exceed the range of double precision");
  }
}

void check_setting(const Setting& setting, Method method) {
  setting.validate();
  if (method == Method::integrated && setting.pairs.empty())
    for (const auto& [name, sd] :
         {std::pair("restitution", setting.restitution.sd), std::pair("friction", setting.friction.sd)})
      if (sd > 0 && sd < narrowest_integrated)
        throw std::invalid_argument(
            fmt::format("{}: sd {} is too narrow for method integrated, which takes 0 and {} or more; method sampled "
                        "takes any",
                        name, sd, narrowest_integrated));
}

namespace {

// Does a launch faster than most rest under `settled` although its foot sticks? One landing tells.
bool fast_launch_rests(const Setting& setting) {
  constexpr double sticks = 100;  // mu
  const double omega = setting.launch().at_score(2);
  const double eta =
      setting.pairs.empty() ? setting.noise().restitution().truncated_mean() : setting.pairs.front().restitution;
  const dynamics::LandingEnd end = setting.motion().land(setting.first_landing_leg, omega, {eta, sticks}).end;
  return end == dynamics::LandingEnd::rest || end == dynamics::LandingEnd::given_up;
}

}  // namespace

LandingOptions landing_options(const StudyOptions& options, double from, double to) {
  LandingOptions landings{options.direct, options.threads, {}};
  if (options.progress)
    landings.progress = [tell = options.progress, from, to](double share) {
      tell(from + (to - from) * share, "table of landings");
    };
  return landings;
}

void tabulate_landings(const Setting& setting, const StudyOptions& options) {
  if (setting.law != dynamics::Law::settled) return;
  try {
    setting.problem(landing_options(options));
  } catch (const markov::ConvergenceError&) {
    // The studies will say so.
  }
}

Metastability study(const Setting& setting, const StudyOptions& options) {
  check_setting(setting, options.method);
  // A table of landings takes part of the time.
  const bool tabulates = setting.law == dynamics::Law::settled && !options.direct && !setting.noise_free();
  const bool launch_known = !setting.steady_launch || setting.steady_speed;
  if (tabulates && launch_known &&
      fast_launch_rests(setting)) {  // a table is not worth its time where no launch passes
    const Problem direct = setting.problem({.direct = true});
    if (rests_at_once(direct)) {
      Metastability result = followed_study(direct, options);
      result.setting = setting;
      return result;
    }
  }
  const bool by_table = tabulates && options.progress;
  constexpr double of_table = 0.3;
  StudyOptions own = options;
  if (by_table)
    own.progress = [&](double share, const std::string& what) {
      options.progress(of_table + (1 - of_table) * share, what);
    };
  const Problem problem = setting.problem(landing_options(options, 0, of_table));
  if (!setting.steady_launch || setting.steady_speed) {
    Metastability result = study(problem, own);
    result.setting = setting;
    return result;
  }
  // The regime takes one half of the work, the steps from it the other.
  StudyOptions first = own, second = own;
  if (own.progress) {
    first.progress = [&](double share, const std::string& what) { own.progress(0.5 * share, "regime, " + what); };
    second.progress = [&](double share, const std::string& what) { own.progress(0.5 + 0.5 * share, what); };
  }
  const Setting launched = steadily_launched(setting, first);
  // Of faster launches the table may be another one.
  Metastability result = study(launched.problem(landing_options(own, 0.5, 0.5)), second);
  result.setting = launched;
  return result;
}

RestThresholds rest_thresholds(const Metastability& study) {
  RestThresholds thresholds;
  if (study.steps.safe_state) thresholds.safe_speed = std::sqrt(*study.steps.safe_state);
  thresholds.safe_slope_deg = safe_slope_deg(study.setting.value());
  thresholds.slope_sought = study.setting->law != dynamics::Law::settled;
  return thresholds;
}

void StepsToRest::widen_reach_end(double less, double more) {
  if (!reach_end_interval) return;
  double& lower = reach_end_interval->lower;
  double& upper = reach_end_interval->upper;
  lower = std::isfinite(less) ? std::pow(lower, std::exp(less)) : 0;
  upper = std::isfinite(more) ? std::pow(upper, std::exp(-more)) : 1;
}

std::optional<double> Accumulated::quantile(double level) const {
  for (const Quantile& one : quantiles)
    if (one.level == level) return one.value;
  return std::nullopt;
}

std::string_view method_name(Method method) {
  return method == Method::sampled ? "sampled" : method == Method::integrated ? "integrated" : "followed";
}

Method method_from_name(std::string_view name) {
  for (const Method method : {Method::sampled, Method::integrated})
    if (name == method_name(method)) return method;
  throw std::invalid_argument(
      fmt::format("method: '{}' is neither 'sampled' nor 'integrated', which wheels have", name));
}

std::string status_text(Status status) {
  switch (status) {
    case Status::converged:
      return "converged";
    case Status::tolerance_not_met:
      return "tolerance_not_met";
    case Status::fixed_resolution:
      return "fixed_resolution";
    case Status::rest_unreachable:
      return "rest_unreachable";
    case Status::solver_failed:
      return "solver_failed";
    case Status::rest_unresolved:
      return "rest_unresolved";
    case Status::no_regime:
      return "no_regime";
  }
  throw std::logic_error("unknown status");
}

}  // namespace metastable::analysis
