#include "analysis/study/chain_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "markov/chain/eigenpairs.h"
#include "markov/chain/sparse_solver.h"
#include "markov/passage/first_passage.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t least_survival = 64, most_survival = 10000;  // values of the curve
constexpr std::size_t violation_draws = 65536, launch_violation_draws = 4096, fewest_violation_draws = 16;
constexpr double least_violated = 1e-9;  // share of collisions at a state
constexpr std::size_t slowest_draws = 16384;
constexpr std::size_t most_forward = 100000;  // steps followed where some states never rest
constexpr double still_resting = 1e-6;        // This share of the launches may be left to rest after them.
constexpr double same_chain = 1e-6;           // agreement wanted of two ways to solve it
constexpr double same_spectrum = 1e-6;        // and of two ways to its lambda_1
constexpr double frequent_rest = 0.01;        // a step
constexpr double rarest_launch = 1e-15;       // that counts: beyond 8 sds
constexpr double rarest_rest = 1e-9;          // worth a word where the others never rest
constexpr double least_regime = 1e-12;        // survivors of a step: fewer are the rounding of row sums

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

struct MeanSd {
  double mean = 0, sd = 0;
};

bool goes_on(const markov::Launch& launch) {
  return std::accumulate(launch.after.begin(), launch.after.end(), 0.0) > rarest_launch;
}

// Returns mean and sd of the observable, states weighted by `mass` (any total).
MeanSd observe(const Problem& problem, std::span<const double> states, std::span<const double> mass) {
  double total = 0, first = 0, second = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double value = problem.observable(states[i]);
    total += mass[i];
    first += mass[i] * value;
    second += mass[i] * value * value;
  }
  first /= total;
  return {first, std::sqrt(std::max(0.0, second / total - first * first))};
}

void describe_survivors(const Problem& problem, const markov::StateSpace& space, std::span<const double> states,
                        const std::vector<double>& nu, Metastability& result) {
  for (int p = 0; p < space.phases(); ++p) {
    const auto edges = space.grid(p).edges();
    const auto mass = std::span(nu).subspan(space.index(p, 0), space.cells());
    const double total = std::accumulate(mass.begin(), mass.end(), 0.0);
    PhaseDistribution phase{{edges.begin(), edges.end()}, {}, 0, 0};
    for (const double share : mass) phase.mass.push_back(share / total);
    const MeanSd observed = observe(problem, states.subspan(space.index(p, 0), space.cells()), phase.mass);
    phase.mean = observed.mean;
    phase.sd = observed.sd;
    result.survivors.by_phase.push_back(std::move(phase));
  }
  const MeanSd all = observe(problem, states, nu);
  result.survivors.mean = all.mean;
  result.survivors.sd = all.sd;
}

// Returns what the observable is if every wheel that rests is launched again; NaN where no launch goes on.
MeanSd relaunched(const Problem& problem, std::span<const double> states, const markov::ChainSolver& solver,
                  const markov::Launch& launch) {
  if (!goes_on(launch)) return {undefined, undefined};
  return observe(problem, states, markov::stationary_with_restart(solver, launch.after));
}

// Returns the moduli per step of the eigenvalues of a chain watched once a revolution of `period` steps. It is lambda_1
// alone where Spectra does not converge (its message is then added to `message`).
std::vector<double> moduli_per_step(const markov::Chain& revolution, int period, int count, double failure_rate,
                                    std::string& message) {
  const std::vector<double> first{1 - failure_rate};
  constexpr double rounding = 1e-13;  // of a revolution's eigenvalue
  // Eigenvalues beyond the first are off by some 5e-12, rounding times their condition (the same chain on two
  // processors): from 1e-6 on that leaves their moduli six digits. The second one tells how fast the chain mixes.
  constexpr double resolved = 1e-6;
  std::vector<double> moduli;
  try {
    for (const std::complex<double>& value : markov::leading_eigenpairs(revolution, count).values)
      if (moduli.empty() || std::abs(value) > (moduli.size() == 1 ? rounding : resolved))
        moduli.push_back(std::pow(std::abs(value), 1.0 / period));
    // Inverse iteration subtracts nothing. Spectra does, and where a launch takes many steps to come down to the others
    // (Q is nearly nilpotent) its rounding alone looks like eigenvalues larger than lambda_1.
    const double largest = *std::max_element(moduli.begin(), moduli.end()),
                 same = same_spectrum * largest + rounding / std::pow(largest, period - 1);
    if (largest > 0 && !(std::max(largest - first.front(), first.front() - moduli.front()) <= same))
      throw markov::ConvergenceError(
          "Spectra", largest - first.front(),
          fmt::format("rounding hides them (largest {:.4g}, lambda_1 by inverse iteration {:.4g})", largest,
                      first.front()));
  } catch (const markov::ConvergenceError& error) {
    message += (message.empty() ? "" : "; ") + std::string("eigenvalues beyond lambda_1: ") + error.what();
    return first;
  }
  return moduli;
}

// Draws go to states as they are visited, so that shares have the error of so many draws altogether.
void describe_violations(const Problem& problem, const markov::StateSpace& space, const std::vector<double>& nu,
                         const std::vector<double>& visits, const StudyOptions& options, Metastability& result) {
  const std::vector<std::string> names = problem.map.assumptions();
  if (names.empty()) return;
  const double nu_total = std::accumulate(nu.begin(), nu.end(), 0.0);
  const double visit_total = 1.0 + std::accumulate(visits.begin(), visits.end(), 0.0);
  std::vector<std::size_t> counts(space.size());
  for (std::size_t i = 0; i < space.size(); ++i) {
    const double share = std::max(nu[i] / nu_total, visits[i] / visit_total);
    if (share > least_violated)
      counts[i] = std::bit_ceil(
          std::max(fewest_violation_draws, static_cast<std::size_t>(share * static_cast<double>(violation_draws))));
  }
  const auto rates = markov::violation_rates(problem.map, space, problem.launch, counts,
                                             {.count = launch_violation_draws, .seed = options.seed});
  // Interpolated weights, some of them below 0, may put a share of nothing as far below it.
  const auto share = [](double weight, double total) { return std::clamp(weight / total, 0.0, 1.0); };
  for (std::size_t a = 0; a < names.size(); ++a) {
    const double at_launch = rates[a].back();
    const std::vector<double> by_state(rates[a].begin(), std::prev(rates[a].end()));
    double nu_variance = 0, visit_variance = at_launch * (1 - at_launch) / launch_violation_draws;
    for (std::size_t i = 0; i < by_state.size(); ++i) {
      if (counts[i] == 0) continue;
      const double one = by_state[i] * (1 - by_state[i]) / static_cast<double>(counts[i]);
      nu_variance += nu[i] * nu[i] * one;
      visit_variance += visits[i] * visits[i] * one;
    }
    result.violations.push_back(
        {names[a], share(dot(nu, by_state), nu_total), share(dot(visits, by_state) + at_launch, visit_total),
         std::sqrt(std::max(0.0, nu_variance)) / nu_total, std::sqrt(std::max(0.0, visit_variance)) / visit_total});
  }
}

// Finds ln of a revolution's survival in the quasi-stationary distribution, class by class.
double log_survival_of_a_revolution(const SolvedChain& solved) {
  double log_survival = 0;
  for (const std::vector<std::uint32_t>& of_class : solved.solver.period().classes) {
    double rest = 0;
    for (const std::uint32_t i : of_class) rest += solved.survivors[i] * solved.solver.chain().kill(i);
    log_survival += std::log1p(-std::min(1.0, rest));
  }
  return log_survival;
}

Accumulated accumulated(const markov::Moments& moments, const std::vector<double>& quantiles) {
  Accumulated total{moments.mean, moments.sd, {}};
  for (std::size_t i = 0; i < quantiles.size(); ++i) total.quantiles.push_back({quantile_levels[i], quantiles[i]});
  return total;
}

// Finds the regime of the survivors among `states` alone (none: all). Cells that only a fast launch passes are wide
// enough to lead back into themselves, which no wheel does; they would pass for a regime of their own.
markov::QuasiStationary regime_of(const markov::ChainSolver& solver, const std::vector<std::uint32_t>& states) {
  constexpr auto few = markov::FewSurvivors::unsettled;  // where hardly anybody survives, there is no regime to tell of
  if (states.empty()) return markov::quasi_stationary(solver, few);
  const markov::ChainSolver inside(solver.chain().restricted_to(states));
  if (inside.period().period != solver.period().period) return markov::quasi_stationary(solver, few);
  markov::QuasiStationary quasi = markov::quasi_stationary(inside, few);
  // Where rest is rare no such cell keeps anything as long, and the few who leave the states would count as failures.
  if (quasi.failure_rate < frequent_rest) return markov::quasi_stationary(solver, few);
  const auto scatter = [&](std::vector<double>& vector) {
    std::vector<double> all(solver.chain().size(), 0.0);
    for (std::size_t i = 0; i < states.size(); ++i) all[states[i]] = vector[i];
    vector = std::move(all);
  };
  scatter(quasi.distribution);
  scatter(quasi.survival_weight);
  return quasi;
}

}  // namespace

std::size_t survival_steps(const Problem& problem) {
  const auto course = static_cast<std::size_t>(problem.last_event.value_or(0)) + 1;
  return std::clamp(course, least_survival, most_survival);
}

SolvedChain::SolvedChain(const markov::SampledChain& sampled, const std::vector<std::uint32_t>& regime)
    : solver(sampled.chain),
      mean(markov::mean_first_passage(solver)),
      quasi(regime_of(solver, regime)),
      survivors(markov::shares_in_classes(solver.period(), quasi.distribution)),
      from_start(1 + dot(sampled.launch.after, mean)) {}

Metastability rest_unresolved(const Problem& problem, const StudyOptions& options, const std::string& message) {
  Metastability result;
  result.method = options.method;
  result.status = Status::rest_unresolved;
  result.phases = problem.map.phases();
  result.message = "rest is possible, but " + message;
  result.steps.from_start = result.steps.from_quasi_stationary = result.steps.worst_start = {infinite, 1.0, infinite};
  result.spectrum.failure_rate = {0, 0, 1};
  return result;
}

std::vector<double> midpoints(const markov::StateSpace& space) {
  std::vector<double> states;
  for (std::size_t i = 0; i < space.size(); ++i) states.push_back(space.grid(space.phase(i)).midpoint(space.cell(i)));
  return states;
}

ChainSteps chain_steps(const markov::AnyReturnMap& map, const markov::StateSpace& space, const SolvedChain& solved,
                       const std::vector<markov::DrawOptions>& draws) {
  const std::vector<double>& mean = solved.mean;
  ChainSteps steps;
  steps.from_start = solved.from_start;
  steps.from_quasi_stationary = 1 / solved.quasi.failure_rate;
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

std::optional<double> asked_reach_end(const Problem& problem, const SolvedChain& solved, const markov::Launch& launch,
                                      const StudyOptions& options) {
  if (!options.reach_end_interval || !problem.last_event) return std::nullopt;
  return markov::Survival(solved.solver, solved.quasi, launch).at(*problem.last_event);
}

double followed_survival(const markov::SampledChain& sampled, int events) {
  std::vector<double> alive = sampled.launch.after;
  const int most = std::min(events, static_cast<int>(most_forward));
  for (int n = 1; n < most; ++n) alive = markov::apply_left(sampled.chain, alive);
  return std::clamp(std::accumulate(alive.begin(), alive.end(), 0.0), 0.0, 1.0);
}

SurvivalScale::SurvivalScale(std::span<const double> probabilities) {
  by_hazard_ = std::ranges::all_of(probabilities, [](double p) { return p > 0 && p < 1; });
}

double SurvivalScale::at(double p) const { return by_hazard_ ? std::log(-std::log(p)) : p; }

Estimate SurvivalScale::interval(double p, double half) const {
  if (!by_hazard_) return {p, std::max(0.0, p - half), std::min(1.0, p + half)};
  return {p, std::pow(p, std::exp(half)), std::pow(p, std::exp(-half))};
}

void summarize(const Problem& problem, const markov::StateSpace& space, std::span<const double> states,
               const markov::SampledChain& sampled, const SolvedChain& solved, const StudyOptions& options,
               Metastability& result) {
  const markov::ChainSolver& solver = solved.solver;
  const markov::QuasiStationary& quasi = solved.quasi;
  const markov::Launch& launch = sampled.launch;
  result.phases = space.phases();
  result.spectrum.period = solver.period().period;

  const std::vector<double> second = markov::second_moment(solver, solved.mean);
  const markov::Survival survival(solver, quasi, launch);
  std::vector<double> quantiles;
  for (const double level : quantile_levels) quantiles.push_back(survival.quantile(level));
  result.steps.distribution = accumulated(markov::steps_from_launch(launch, solved.mean, second), quantiles);
  const auto reward = [&](const std::vector<double>& pay) {
    return accumulated(markov::reward_from_launch(solver, launch, pay),
                       markov::reward_quantiles(solver, quasi, launch, pay, quantile_levels));
  };
  if (!options.brief && !sampled.duration.empty()) result.steps.seconds = reward(sampled.duration);
  if (!options.brief && !sampled.advance.empty()) result.steps.metres = reward(sampled.advance);
  // The survival of interpolated rows ends where entries of both signs leave nobody or less: true to the rows' error.
  const double same_sum =
      result.method == Method::integrated ? std::max(same_chain, result.steps.discretization_error) : same_chain;
  result.agreements.push_back(
      {"expected steps, solved and summed over survival", result.steps.distribution.mean, survival.mean(), same_sum});
  result.agreements.push_back({"failure rate of a revolution, and that of its survivors", quasi.revolution_failure_rate,
                               -std::expm1(log_survival_of_a_revolution(solved)), same_chain});
  const std::size_t shown = survival_steps(problem);
  for (std::size_t n = 0; n < shown; ++n) result.steps.survival.push_back(survival.at(static_cast<double>(n)));
  if (problem.last_event) result.steps.reach_end = survival.at(*problem.last_event);

  if (!options.brief) {
    result.spectrum.moduli = moduli_per_step(solver.revolution(), result.spectrum.period, options.eigenvalues,
                                             quasi.failure_rate, result.message);
    result.spectrum.mixing_steps = markov::spectral_mixing_steps(result.spectrum.moduli);
    if (goes_on(launch))
      result.spectrum.total_variation_steps =
          markov::total_variation_mixing(solver, quasi, launch.after, options.mixing_distance);
  }
  describe_survivors(problem, space, states, solved.survivors, result);
  const bool regime = 1 - quasi.failure_rate > least_regime;
  if (!regime) result.survivors.mean = result.survivors.sd = undefined;
  const MeanSd again = relaunched(problem, states, solver, launch);
  result.survivors.restart_mean = again.mean;
  result.survivors.restart_sd = again.sd;
  if (!options.brief)
    describe_violations(problem, space, solved.survivors, solver.solve_left(launch.after), options, result);
  if (!regime)
    for (ViolationShare& share : result.violations) share.quasi_stationary = share.quasi_stationary_error = undefined;

  const markov::SparseSolver check(solver.revolution());
  const std::vector<double> ones(solver.revolution().size(), 1.0);
  const std::vector<double> by_elimination = solver.revolution_elimination().solve(ones), by_klu = check.solve(ones);
  for (std::size_t i = 0; i < ones.size(); ++i)
    result.steps.solver_disagreement =
        std::max(result.steps.solver_disagreement, std::abs(by_klu[i] - by_elimination[i]) / by_elimination[i]);
}

void compare_survivors(const Problem& problem, std::span<const double> states, const markov::SampledChain& sampled,
                       const SolvedChain& solved, Metastability& result) {
  Survivors& fine = result.survivors;
  const MeanSd coarse = observe(problem, states, solved.survivors),
               again = relaunched(problem, states, solved.solver, sampled.launch);
  if (!std::isnan(fine.mean)) fine.error = std::max(std::abs(fine.mean - coarse.mean), std::abs(fine.sd - coarse.sd));
  if (!std::isnan(fine.restart_mean))
    fine.restart_error = std::max(std::abs(fine.restart_mean - again.mean), std::abs(fine.restart_sd - again.sd));
}

namespace {

// The states from which rest can be reached, and those that roll for ever, as weights of 1 and 0.
struct RollingStates {
  std::vector<std::uint32_t> mortal;
  std::vector<double> rolling, met;  // met: those of them that a launch can reach
};

RollingStates rolling_states(const markov::SampledChain& sampled) {
  const std::size_t size = sampled.chain.size();
  const markov::Reachability reach = markov::classify(sampled.chain);
  const std::vector<std::uint8_t> met = markov::reachable_from(sampled.chain, sampled.launch.after);
  RollingStates states{{}, std::vector<double>(size, 0.0), std::vector<double>(size, 0.0)};
  for (std::size_t i = 0; i < size; ++i) {
    if (reach.can_rest[i]) states.mortal.push_back(static_cast<std::uint32_t>(i));
    states.rolling[i] = reach.can_rest[i] ? 0 : 1;
    states.met[i] = states.rolling[i] * met[i];
  }
  return states;
}

std::vector<double> stationary_of(const markov::Chain& chain, const std::vector<double>& rolling) {
  try {
    return markov::stationary(chain, rolling);
  } catch (const std::domain_error& error) {  // a speed that noise hardly moves, between two cells that both keep it
    throw markov::ConvergenceError(
        "rolling for ever", 1,
        fmt::format("{}: {} cells are too coarse to tell at which speed; take more", error.what(), chain.size()));
  }
}

// Fills the spectrum of the chain of states that a wheel rolling for ever comes back to.
void describe_recurrent(const markov::Chain& chain, const std::vector<double>& stationary, int eigenvalues,
                        Metastability& result) {
  std::vector<std::uint32_t> recurrent;
  for (std::size_t i = 0; i < stationary.size(); ++i)
    if (stationary[i] > 0) recurrent.push_back(static_cast<std::uint32_t>(i));
  const markov::Chain closed = chain.restricted_to(recurrent);
  const markov::Period period = markov::find_period(closed);
  result.spectrum.period = period.period;
  result.spectrum.moduli =
      moduli_per_step(markov::revolution_chain(closed, period), period.period, eigenvalues, 0.0, result.message);
  result.spectrum.mixing_steps = markov::spectral_mixing_steps(result.spectrum.moduli);
}

// The share of launches that never rest, and the expected steps of the others until rest or until they roll for ever.
struct LaunchEnds {
  double never = 0, steps = 1;
};

LaunchEnds launch_ends(const markov::SampledChain& sampled, const RollingStates& states) {
  LaunchEnds ends{dot(sampled.launch.after, states.rolling)};
  if (states.mortal.empty()) return ends;
  const markov::ChainSolver until(sampled.chain.restricted_to(states.mortal));
  std::vector<double> entering, after;
  const std::vector<double> leads = markov::apply(sampled.chain, states.rolling);
  for (const std::uint32_t i : states.mortal) {
    entering.push_back(leads[i]);
    after.push_back(sampled.launch.after[i]);
  }
  const std::vector<double> visits = until.solve_left(after);
  ends.never += dot(visits, entering);
  ends.steps += std::accumulate(visits.begin(), visits.end(), 0.0);
  return ends;
}

// The launch followed forwards: survival until only those who never rest are left, visits of the first `shown` steps.
// It throws markov::ConvergenceError where others are left after most_forward steps.
struct ForwardCourse {
  std::vector<double> survival{1.0}, visits;
};

ForwardCourse followed_course(const markov::SampledChain& sampled, double never, std::size_t shown) {
  std::vector<double> alive = sampled.launch.after;
  ForwardCourse course;
  course.visits.assign(alive.size(), 0.0);
  for (std::size_t n = 1; n < most_forward; ++n) {
    const double surviving = std::min(course.survival.back(), std::accumulate(alive.begin(), alive.end(), 0.0));
    if (n >= shown && surviving <= never * (1 + 1e-12)) return course;
    course.survival.push_back(surviving);
    if (n < shown)
      for (std::size_t i = 0; i < course.visits.size(); ++i) course.visits[i] += alive[i];
    alive = markov::apply_left(sampled.chain, alive);
  }
  if (const double left = course.survival.back() - never; left < still_resting) return course;
  throw markov::ConvergenceError(
      "endless study", course.survival.back() - never,
      fmt::format("launches still come to rest after {} steps, beside others that never do", most_forward));
}

// Reads sd and quantiles of the steps off their survival.
Accumulated accumulated(double mean, bool finite, const std::vector<double>& survival) {
  double square = 0;
  for (std::size_t n = 0; finite && n < survival.size(); ++n) square += (2 * static_cast<double>(n) + 1) * survival[n];
  Accumulated steps{mean, finite ? std::sqrt(std::max(0.0, square - mean * mean)) : infinite, {}};
  for (const double level : quantile_levels) {
    const auto reached =
        std::find_if(survival.begin(), survival.end(), [&](double surviving) { return surviving <= 1 - level; });
    steps.quantiles.push_back(
        {level, reached == survival.end() ? infinite : static_cast<double>(reached - survival.begin())});
  }
  return steps;
}

}  // namespace

void summarize_endless(const Problem& problem, const markov::StateSpace& space, const markov::SampledChain& sampled,
                       const StudyOptions& options, Metastability& result) {
  const RollingStates states = rolling_states(sampled);
  const bool ever = dot(states.met, states.met) > 0;
  result.phases = space.phases();
  const std::vector<double> stationary = stationary_of(sampled.chain, ever ? states.met : states.rolling);
  describe_recurrent(sampled.chain, stationary, options.eigenvalues, result);
  describe_survivors(problem, space, midpoints(space), stationary, result);

  const LaunchEnds ends = launch_ends(sampled, states);
  const bool finite = ends.never < rarest_launch;
  const bool relaunches = ever && !finite;  // else the long run is one of launches that rest
  result.survivors.restart_mean = relaunches ? result.survivors.mean : undefined;
  result.survivors.restart_sd = relaunches ? result.survivors.sd : undefined;
  result.steps.from_quasi_stationary = result.steps.worst_start = {infinite, infinite, infinite};
  result.steps.from_start = finite ? Estimate{ends.steps, ends.steps, ends.steps} : result.steps.from_quasi_stationary;
  if (!finite && 1 - ends.never > rarest_rest)
    result.message =
        fmt::format("infinite: rest is unreachable for {:.4g} % of the launches, the others rest", 100 * ends.never);

  const std::size_t shown = survival_steps(problem);
  ForwardCourse course = followed_course(sampled, ends.never, shown);
  result.steps.distribution = accumulated(result.steps.from_start.value, finite, course.survival);
  if (problem.last_event)  // beyond what was followed nobody rests any more
    result.steps.reach_end =
        course.survival[std::min(static_cast<std::size_t>(*problem.last_event), course.survival.size() - 1)];
  course.survival.resize(std::min(course.survival.size(), shown));
  result.steps.survival = std::move(course.survival);
  describe_violations(problem, space, stationary, course.visits, options, result);
}

}  // namespace metastable::analysis
