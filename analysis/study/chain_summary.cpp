#include "analysis/study/chain_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>

#include "markov/chain/eigenpairs.h"
#include "markov/chain/sparse_solver.h"
#include "markov/passage/first_passage.h"

namespace metastable::analysis {
namespace {

constexpr double quantile_levels[] = {0.05, 0.25, 0.5, 0.75, 0.95};
constexpr std::size_t least_survival = 64, most_survival = 10000;  // values of the curve
constexpr std::size_t violation_draws = 64;                        // a state
constexpr std::size_t slowest_draws = 16384;
constexpr std::size_t most_forward = 100000;  // steps followed where some launches never rest

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

struct MeanSd {
  double mean = 0, sd = 0;
};

// Of the observable, states weighted by `mass` (any total).
MeanSd observe(const Problem& problem, const markov::StateSpace& space, const std::vector<double>& mass) {
  double total = 0, first = 0, second = 0;
  for (std::size_t i = 0; i < space.size(); ++i) {
    const double value = problem.observable(space.grid(space.phase(i)).midpoint(space.cell(i)));
    total += mass[i];
    first += mass[i] * value;
    second += mass[i] * value * value;
  }
  first /= total;
  return {first, std::sqrt(std::max(0.0, second / total - first * first))};
}

void describe_survivors(const Problem& problem, const markov::StateSpace& space, const std::vector<double>& nu,
                        Metastability& result) {
  for (int p = 0; p < space.phases(); ++p) {
    const auto edges = space.grid(p).edges();
    PhaseDistribution phase{{edges.begin(), edges.end()}, {}, 0, 0};
    std::vector<double> only(space.size(), 0.0);
    double total = 0;
    for (std::size_t c = 0; c < space.cells(); ++c) total += nu[space.index(p, c)];
    for (std::size_t c = 0; c < space.cells(); ++c) {
      only[space.index(p, c)] = nu[space.index(p, c)] / total;
      phase.mass.push_back(only[space.index(p, c)]);
    }
    const MeanSd observed = observe(problem, space, only);
    phase.mean = observed.mean;
    phase.sd = observed.sd;
    result.survivors.by_phase.push_back(std::move(phase));
  }
  const MeanSd all = observe(problem, space, nu);
  result.survivors.mean = all.mean;
  result.survivors.sd = all.sd;
}

// Does the noise leave the landings of the launches alone? Then the chain is an orbit smeared over cells: nilpotent but
// for rounding, without a spectrum beyond lambda_1 that means anything.
bool noise_free(const Problem& problem) {
  for (const double score : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
    const auto range = problem.map.landing_range(problem.launch.state(score), problem.launch.phase);
    if (!range || range->first != range->second) return false;
  }
  return true;
}

// Moduli per step of the eigenvalues of a chain watched once a revolution of `period` steps. lambda_1 alone for a map
// without noise, and where Spectra does not converge (its message is then added to `message`).
std::vector<double> moduli_per_step(const Problem& problem, const markov::Chain& revolution, int period, int count,
                                    double failure_rate, std::string& message) {
  const std::vector<double> first{1 - failure_rate};
  if (noise_free(problem)) return first;
  constexpr double rounding = 1e-13;  // of a revolution's eigenvalue: below it a modulus means nothing
  std::vector<double> moduli;
  try {
    for (const std::complex<double>& value : markov::leading_eigenpairs(revolution, count).values)
      if (moduli.empty() || std::abs(value) > rounding) moduli.push_back(std::pow(std::abs(value), 1.0 / period));
  } catch (const markov::ConvergenceError& error) {
    message += (message.empty() ? "" : "; ") + std::string("eigenvalues beyond lambda_1: ") + error.what();
    return first;
  }
  return moduli;
}

void describe_violations(const Problem& problem, const markov::StateSpace& space, const std::vector<double>& nu,
                         const std::vector<double>& visits, const StudyOptions& options, Metastability& result) {
  const std::vector<std::string> names = problem.map.assumptions();
  if (names.empty()) return;
  const double nu_total = std::accumulate(nu.begin(), nu.end(), 0.0);
  const double visit_total = 1.0 + std::accumulate(visits.begin(), visits.end(), 0.0);
  std::vector<double> mask(space.size());
  for (std::size_t i = 0; i < space.size(); ++i)
    mask[i] = nu[i] / nu_total > 1e-9 || visits[i] / visit_total > 1e-9 ? 1.0 : 0.0;
  const auto rates = markov::violation_rates(problem.map, space, problem.launch, mask,
                                             {.count = violation_draws, .seed = options.seed});
  for (std::size_t a = 0; a < names.size(); ++a) {
    const double at_launch = rates[a].back();
    const std::vector<double> by_state(rates[a].begin(), std::prev(rates[a].end()));
    result.violations.push_back(
        {names[a], dot(nu, by_state) / nu_total, (dot(visits, by_state) + at_launch) / visit_total});
  }
}

Accumulated accumulated(const markov::Moments& moments, const std::vector<double>& quantiles) {
  Accumulated total{moments.mean, moments.sd, {}};
  for (std::size_t i = 0; i < quantiles.size(); ++i) total.quantiles.push_back({quantile_levels[i], quantiles[i]});
  return total;
}

// To the end of the course, where that is not too far.
std::size_t survival_steps(const Problem& problem) {
  const auto course = static_cast<std::size_t>(problem.last_event.value_or(0)) + 1;
  return std::clamp(course, least_survival, most_survival);
}

}  // namespace

ChainSteps chain_steps(const markov::AnyReturnMap& map, const markov::StateSpace& space,
                       const markov::SampledChain& sampled, const std::vector<markov::DrawOptions>& draws) {
  const markov::ChainSolver solver(sampled.chain);
  const std::vector<double> mean = markov::mean_first_passage(solver);
  ChainSteps steps;
  steps.from_start = 1 + dot(sampled.launch.after, mean);
  steps.from_quasi_stationary = 1 / markov::quasi_stationary(solver).failure_rate;
  int worst_phase = 0;
  for (int p = 1; p < space.phases(); ++p)
    if (mean[space.index(p, 0)] < mean[space.index(worst_phase, 0)]) worst_phase = p;
  const double lowest = map.state_interval(worst_phase).first;
  const std::size_t rows = std::min<std::size_t>(4, draws.size());
  for (std::size_t r = 0; r < rows; ++r) {
    markov::DrawOptions row_draws = draws[r];
    row_draws.count = std::min(row_draws.count, slowest_draws);
    const markov::Launch row =
        markov::launch_row(map, space, {[lowest](double) { return lowest; }, worst_phase}, row_draws);
    steps.worst_start += (1 + dot(row.after, mean)) / static_cast<double>(rows);
  }
  return steps;
}

void summarize(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
               const StudyOptions& options, Metastability& result) {
  const markov::ChainSolver solver(sampled.chain);
  const markov::QuasiStationary quasi = markov::quasi_stationary(solver);
  const markov::Launch& launch = sampled.launch;
  result.phases = space.phases();
  result.spectrum.period = solver.period().period;

  const std::vector<double> mean = markov::mean_first_passage(solver);
  const std::vector<double> second = markov::second_moment(solver, mean);
  const markov::Survival survival(solver, quasi, launch);
  std::vector<double> quantiles;
  for (const double level : quantile_levels) quantiles.push_back(survival.quantile(level));
  result.steps.distribution = accumulated(markov::steps_from_launch(launch, mean, second), quantiles);
  const auto reward = [&](const std::vector<double>& pay) {
    return accumulated(markov::reward_from_launch(solver, launch, pay),
                       markov::reward_quantiles(solver, quasi, launch, pay, quantile_levels));
  };
  if (!options.brief && !sampled.duration.empty()) result.steps.seconds = reward(sampled.duration);
  if (!options.brief && !sampled.advance.empty()) result.steps.metres = reward(sampled.advance);
  const std::size_t shown = survival_steps(problem);
  for (std::size_t n = 0; n < shown; ++n) result.steps.survival.push_back(survival.at(static_cast<double>(n)));
  if (problem.last_event) result.steps.reach_end = survival.at(*problem.last_event);

  if (!options.brief) {
    result.spectrum.moduli = moduli_per_step(problem, solver.revolution(), result.spectrum.period, options.eigenvalues,
                                             quasi.failure_rate, result.message);
    result.spectrum.mixing_steps = markov::spectral_mixing_steps(result.spectrum.moduli);
    result.spectrum.total_variation_steps =
        markov::total_variation_mixing(solver, quasi, launch.after, options.mixing_distance);
  }
  describe_survivors(problem, space, quasi.distribution, result);
  if (dot(launch.after, launch.after) > 0) {  // otherwise no launch survives its first collision
    const MeanSd restarted = observe(problem, space, markov::stationary_with_restart(solver, launch.after));
    result.survivors.restart_mean = restarted.mean;
    result.survivors.restart_sd = restarted.sd;
  }
  if (!options.brief)
    describe_violations(problem, space, quasi.distribution, solver.solve_left(launch.after), options, result);

  const markov::SparseSolver check(solver.revolution());
  const std::vector<double> ones(solver.revolution().size(), 1.0);
  const std::vector<double> by_elimination = solver.revolution_elimination().solve(ones), by_klu = check.solve(ones);
  for (std::size_t i = 0; i < ones.size(); ++i)
    result.steps.solver_disagreement =
        std::max(result.steps.solver_disagreement, std::abs(by_klu[i] - by_elimination[i]) / by_elimination[i]);
}

void summarize_endless(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
                       const StudyOptions& options, Metastability& result) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const markov::Launch& launch = sampled.launch;
  result.phases = space.phases();
  result.steps.from_start = result.steps.from_quasi_stationary = {infinite, infinite, infinite};
  result.steps.worst_start = {infinite, infinite, infinite};
  result.steps.distribution = {infinite, infinite, {}};

  const std::vector<double> stationary = markov::stationary(sampled.chain, launch.after);
  std::vector<std::uint32_t> recurrent;
  for (std::size_t i = 0; i < stationary.size(); ++i)
    if (stationary[i] > 0) recurrent.push_back(static_cast<std::uint32_t>(i));
  const markov::Chain closed = sampled.chain.restricted_to(recurrent);
  const markov::Period period = markov::find_period(closed);
  result.spectrum.period = period.period;
  result.spectrum.moduli = moduli_per_step(problem, markov::revolution_chain(closed, period), period.period,
                                           options.eigenvalues, 0.0, result.message);
  result.spectrum.mixing_steps = markov::spectral_mixing_steps(result.spectrum.moduli);
  describe_survivors(problem, space, stationary, result);
  result.survivors.restart_mean = result.survivors.mean;
  result.survivors.restart_sd = result.survivors.sd;

  // Forward from the launch: survival, visits on the course, and the share that has come to rest when no more do.
  std::vector<double> alive = launch.after, visits(space.size(), 0.0);
  result.steps.survival = {1.0};
  const std::size_t shown = survival_steps(problem);
  for (std::size_t n = 1; n < most_forward; ++n) {
    const double surviving = std::min(result.steps.survival.back(), std::accumulate(alive.begin(), alive.end(), 0.0));
    const bool settled =
        n > 2 * static_cast<std::size_t>(result.spectrum.period) &&
        surviving > result.steps.survival[n - static_cast<std::size_t>(result.spectrum.period)] * (1 - 1e-12);
    if (n >= shown && settled) break;
    result.steps.survival.push_back(surviving);
    if (n < shown)
      for (std::size_t i = 0; i < visits.size(); ++i) visits[i] += alive[i];
    alive = markov::apply_left(sampled.chain, alive);
  }
  const double ever_rests = 1 - result.steps.survival.back();
  if (ever_rests > 1e-9)
    result.message = fmt::format("infinite: rest is unreachable for {:.4g} % of the launches, the others rest",
                                 100 * result.steps.survival.back());
  for (const double level : quantile_levels) {
    const auto reached = std::find_if(result.steps.survival.begin(), result.steps.survival.end(),
                                      [&](double surviving) { return surviving <= 1 - level; });
    result.steps.distribution.quantiles.push_back(
        {level, reached == result.steps.survival.end() ? infinite
                                                       : static_cast<double>(reached - result.steps.survival.begin())});
  }
  if (problem.last_event)  // beyond what was followed nobody rests any more
    result.steps.reach_end =
        result.steps
            .survival[std::min(static_cast<std::size_t>(*problem.last_event), result.steps.survival.size() - 1)];
  result.steps.survival.resize(std::min(result.steps.survival.size(), shown));
  describe_violations(problem, space, stationary, visits, options, result);
}

}  // namespace metastable::analysis
