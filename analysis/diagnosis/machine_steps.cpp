#include "analysis/diagnosis/machine_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <stdexcept>

#include "analysis/statistics/interval_95.h"
#include "analysis/statistics/median.h"
#include "analysis/statistics/random.h"
#include "markov/dense_matrix.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// Draws of what stands for the machine, and of the recalibrated model: fewer save time.
constexpr int draws_of_machine = 40, draws_of_recalibrated = 24;
constexpr double of_no_say = 3;   // sd of the logarithm
constexpr double few_steps = 20;  // Fewer later steps say nothing of how failures are spread along trials.
// The grid of a model's error has so many nodes, out to so many sds on either side.
constexpr int error_nodes = 241;
constexpr double error_reach = 4;

// Says whether the fit's information holds all of its parameters.
bool has_information(const Fit& fit) {
  std::size_t count = fit.nuisance.size();
  for (const EffectTerm& term : fit.terms) count += term.values.size();
  return count > 0 && fit.information.rows() == static_cast<Eigen::Index>(count);
}

// Returns a fit's parameters drawn from the normal distribution that the information leaves, inside their bounds.
Fit drawn_fit(const TransitionModel& model, const Fit& fit, std::uint64_t seed, std::uint64_t draw) {
  Fit drawn;
  drawn.nuisance = fit.nuisance;
  drawn.terms = fit.terms;
  if (!has_information(fit)) return drawn;
  Eigen::MatrixXd covariance = markov::floored_inverse(fit.information, resolved_share);
  // An error of form moves a parameter, and the fit moves the others with it.
  const Eigen::MatrixXd by_data = covariance;
  for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
    const auto at = static_cast<Eigen::Index>(p);
    if (!(model.nuisances()[p].form_sd > 0 && by_data(at, at) > 0)) continue;
    const Eigen::VectorXd moved = model.nuisances()[p].form_sd / by_data(at, at) * by_data.col(at);
    covariance += moved * moved.transpose();
  }
  const std::vector<double> normals =
      normal_multipliers(seed, draw, DrawStream::steps, static_cast<std::size_t>(covariance.rows()));
  const Eigen::VectorXd shift =
      markov::symmetric_root(covariance) * Eigen::VectorXd::Map(normals.data(), covariance.rows());
  Eigen::Index at = 0;
  for (std::size_t p = 0; p < drawn.nuisance.size(); ++p) {
    const Nuisance& n = model.nuisances()[p];
    drawn.nuisance[p] = std::clamp(drawn.nuisance[p] + shift[at++], n.lower, n.upper);
  }
  for (EffectTerm& term : drawn.terms)
    for (std::size_t k = 0; k < term.values.size(); ++k) {
      const FreeParameter& p = term.candidate->parameters[k];
      term.values[k] = std::clamp(term.values[k] + shift[at++], p.lower, p.upper);
    }
  return drawn;
}

// Moments of the logarithms of draws that come to rest, and the share of those that never do.
struct LogMoments {
  double mean = 0, sd = 0, endless = 0;
};
LogMoments log_moments(const std::vector<double>& draws) {
  LogMoments log;
  double count = 0, squares = 0;
  for (const double one : draws)
    if (std::isfinite(one)) log.mean += std::log(one), ++count;
  log.endless = 1 - count / static_cast<double>(draws.size());
  if (count == 0) return log;
  log.mean /= count;
  for (const double one : draws)
    if (std::isfinite(one)) squares += std::pow(std::log(one) - log.mean, 2);
  log.sd = count > 1 ? std::sqrt(squares / (count - 1)) : 0;
  return log;
}

// Returns the value below which a share of the weights lies. @param sorted  values with weights, rising
double weighted_quantile(const std::vector<std::pair<double, double>>& sorted, double share) {
  double all = 0, sum = 0;
  for (const auto& [value, weight] : sorted) all += weight;
  for (const auto& [value, weight] : sorted) {
    sum += weight;
    if (sum >= share * all * (1 - 1e-9)) return value;  // equal weights reach a share up to rounding
  }
  return sorted.back().first;
}

double error_at(int node) { return error_reach * (2.0 * node / (error_nodes - 1) - 1); }

// Returns the weights of the nodes of a model's error, by the failures counted; their sum is one.
std::array<double, error_nodes> error_weights(double steps, const ModelError& error, double at_risk, double rests) {
  std::array<double, error_nodes> weight{};
  double sum = 0;
  for (int k = 0; k < error_nodes; ++k) {
    const double z = error_at(k), expected = at_risk / (steps * std::exp(error.here * z));
    // In units of the weight at no error, of which the exponent is within reach of any count.
    const double gained = at_risk > 0 ? -rests * error.here * z - (expected - at_risk / steps) : 0;
    weight[static_cast<std::size_t>(k)] = std::exp(std::min(600.0, gained - 0.5 * z * z));
    sum += weight[static_cast<std::size_t>(k)];
  }
  for (double& one : weight) one /= sum;
  return weight;
}

// Returns the median of weighed values with their 5 and 95 % quantiles.
Estimate middle_of(std::vector<std::pair<double, double>> weighed) {
  std::ranges::sort(weighed);
  return {weighted_quantile(weighed, 0.5), weighted_quantile(weighed, 0.05), weighted_quantile(weighed, 0.95)};
}

// Says what of the gap the chosen model leaves, in the logarithm of the expected steps. A gap in nats is a square of
// its size: of what the effect changes, as much may be wrong as the root of the share that stays. Where nothing says
// how large that is, a factor of e.
ModelError model_error(const Diagnosis& d) {
  const StepsBeforeFailure& s = d.shrinkage.steps;
  const bool known = !d.shrinkage.measures.empty() && d.shrinkage.measures.front().closed;
  const double changed = std::isfinite(s.with_effect) && std::isfinite(s.baseline) && s.with_effect > 0
                             ? std::abs(std::log(s.with_effect / s.baseline))
                             : 1;
  double stays = 0;
  if (d.verdict == Verdict::partly_explained)
    stays = known ? std::clamp(1 - *d.shrinkage.measures.front().closed, d.rules.square_error(), 1.0) : 1;
  ModelError error;
  if (d.verdict == Verdict::unexplained) return {of_no_say, 1};
  error.here = stays > 0 ? std::sqrt(stays) * std::max(1.0, changed) : d.rules.model_error * changed;
  error.elsewhere = std::sqrt(stays);
  return error;
}

}  // namespace

void set_observed(StepsBeforeFailure& steps, std::pair<double, double> rests) {
  const auto [at_risk, rested] = rests;
  if (!(at_risk > 0)) return;
  const auto limit = [](double degrees, double p) {
    return degrees > 0 ? boost::math::quantile(boost::math::chi_squared(degrees), p) / 2 : 0.0;
  };
  const double most = limit(2 * rested + 2, 0.95), least = limit(2 * rested, 0.05);
  steps.observed = rested > 0 ? at_risk / rested : infinite;
  steps.observed_lower = at_risk / most;
  steps.observed_upper = least > 0 ? at_risk / least : infinite;
}

std::vector<double> drawn_steps(const TransitionModel& model, const TransitionModel& at,
                                const std::vector<WeighedFit>& fits, int draws, std::uint64_t seed, int threads,
                                const std::function<void()>& heartbeat) {
  double all = 0;
  for (const WeighedFit& one : fits) all += one.weight;
  std::vector<double> steps(static_cast<std::size_t>(draws));
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  model.side_by_side(steps.size(), threads, [&](std::size_t i) {
    beat();
    // Each fit has its share of the draws, in their order.
    const double place = (static_cast<double>(i) + 0.5) / static_cast<double>(draws) * all;
    std::size_t k = 0;
    for (double sum = fits[0].weight; sum < place && k + 1 < fits.size(); sum += fits[k].weight) ++k;
    const Fit fit = drawn_fit(model, *fits[k].fit, seed, i);
    const std::unique_ptr<TransitionModel> again = at.relaunched(seed + 1 + i);
    steps[i] = (again ? *again : at).expected_steps(fit.nuisance, fit.terms, seed + 1 + i);
  });
  return steps;
}

Estimate interval_of_draws(const std::vector<double>& draws) {
  if (draws.empty()) throw std::invalid_argument("interval_of_draws: there are no draws");
  const LogMoments log = log_moments(draws);
  if (log.endless > 0.5)
    return {infinite, log.endless > 0.95 ? infinite : std::exp(log.mean - normal_90 * log.sd), infinite};
  const double half = normal_90 * log.sd;
  return {std::exp(log.mean), std::exp(log.mean - half), log.endless > 0.05 ? infinite : std::exp(log.mean + half)};
}

Estimate joined_steps(const std::vector<double>& here, const std::vector<double>& there, const ModelError& error,
                      double at_risk, double rests) {
  if (here.empty() || here.size() != there.size())
    throw std::invalid_argument(fmt::format("joined_steps: {} draws here and {} there", here.size(), there.size()));
  // A few draws stand for all: each is spread by a normal kernel (Silverman's rule), and drawn towards their mean, so
  // that together they spread no more than without it (West 1993, J. R. Statist. Soc. B 55, 409).
  const LogMoments drawn = log_moments(there);
  const double share = std::min(1.0, 1.06 * std::pow(static_cast<double>(there.size()), -0.2)),
               kernel = share * drawn.sd;
  const auto towards_mean = [&](double steps) {
    return std::isfinite(steps) ? std::exp(drawn.mean + std::sqrt(1 - share * share) * (std::log(steps) - drawn.mean))
                                : steps;
  };
  std::vector<std::pair<double, double>> weighed;
  for (std::size_t i = 0; i < here.size(); ++i) {
    if (!std::isfinite(here[i])) {  // such a machine has no rests
      if (rests == 0) weighed.emplace_back(there[i], 2 * error_nodes);
      continue;
    }
    const std::array<double, error_nodes> weight = error_weights(here[i], error, at_risk, rests);
    // The error differs elsewhere by more, the more the model says is different there.
    const double further = std::isfinite(there[i]) ? error.elsewhere * std::abs(std::log(there[i] / here[i])) : 0;
    for (int k = 0; k < error_nodes; ++k)
      for (const double more : {-1.0, 1.0})
        for (const double place : {-1.2247, 0.0, 1.2247})  // three equal weights of mean 0 and variance 1
          weighed.emplace_back(
              towards_mean(there[i]) * std::exp(error.here * error_at(k) + more * further + kernel * place),
              weight[static_cast<std::size_t>(k)] * error_nodes / 3);
  }
  if (weighed.empty()) {  // every draw is refuted: the count alone is left
    StepsBeforeFailure counted;
    set_observed(counted, {at_risk, rests});
    return {counted.observed, counted.observed_lower, counted.observed_upper};
  }
  return middle_of(std::move(weighed));
}

Estimate steps_of_model_by_machine(const std::vector<double>& here, const ModelError& error, double at_risk,
                                   double rests) {
  std::vector<std::pair<double, double>> weighed;
  for (const double steps : here) {
    if (!std::isfinite(steps)) {  // the machine fails and the model never does
      weighed.emplace_back(infinite, 1);
      continue;
    }
    const std::array<double, error_nodes> weight = error_weights(steps, error, at_risk, rests);
    for (int k = 0; k < error_nodes; ++k)
      weighed.emplace_back(std::exp(-error.here * error_at(k)), weight[static_cast<std::size_t>(k)]);
  }
  return middle_of(std::move(weighed));
}

Estimate bounded_by_count(const Estimate& joined, const StepsBeforeFailure& counted) {
  if (!(counted.observed_lower > 0) || !std::isfinite(counted.observed_upper)) return joined;
  const bool narrower = joined.upper * counted.observed_lower <= counted.observed_upper * joined.lower;
  return narrower ? joined : Estimate{counted.observed, counted.observed_lower, counted.observed_upper};
}

MachineSteps survivors_steps(const std::string& where, double model_lower, const StepsBeforeFailure& counted,
                             bool explained) {
  const double seen = where.empty() ? counted.observed_lower : 0;
  const double known = explained && std::isfinite(model_lower) ? model_lower : 0;
  return {where, {infinite, std::max({1.0, seen, known}), infinite}, true};
}

void set_later_steps(StepsBeforeFailure& steps, const TransitionModel& model, const Fit& fit) {
  const std::vector<Event>& events = model.events();
  const std::vector<double> chances = model.rest_chances(fit.nuisance, fit.terms);
  std::vector<double> numbers;
  for (const Event& event : events)
    if (event.rested) numbers.push_back(event.number);
  if (numbers.empty()) return;
  const double half = median(numbers);
  double all = 0, later = 0, failures = 0, later_failures = 0;
  for (std::size_t e = 0; e < events.size(); ++e) {
    if (!events[e].rested) continue;
    ++all, failures += chances[e];
    if (events[e].number > half) ++later, later_failures += chances[e];
  }
  if (later < few_steps || !(failures > 0)) return;
  steps.later = later_failures > 0 ? later / later_failures : infinite;
  steps.later_times = steps.later * failures / all;
}

void add_counted_steps(StepsBeforeFailure& steps, std::pair<double, double> rests) {
  set_observed(steps, rests);
  if (rests.second > 0)
    steps.machine.push_back({"", {steps.observed, steps.observed_lower, steps.observed_upper}, false});
  else if (rests.first > 0)
    steps.machine.push_back(survivors_steps("", infinite, steps, false));
}

void add_machine_steps(Diagnosis& d, const TransitionModel& model, const WeighedFit& recalibrated,
                       const std::vector<WeighedFit>& fits, const Elsewhere& elsewhere, const DiagnosisOptions& options,
                       const std::function<void()>& heartbeat) {
  StepsBeforeFailure& s = d.shrinkage.steps;
  const std::vector<WeighedFit> plain{recalibrated};
  const auto draw = [&](const TransitionModel& at, const std::vector<WeighedFit>& of, int draws) {
    return drawn_steps(model, at, of, draws, options.seed, options.threads, heartbeat);
  };
  const std::vector<double> of_plain = draw(model, plain, fits.empty() ? draws_of_machine : draws_of_recalibrated);
  const std::vector<double> of_effects = fits.empty() ? of_plain : draw(model, fits, draws_of_machine);
  // A few draws may miss the number that stands beside their interval, which is another draw where it is simulated.
  const auto about = [](Estimate interval, double value) {
    interval.lower = std::min(interval.lower, value);
    interval.upper = std::max(interval.upper, value);
    return interval;
  };
  s.recalibrated_90 = about(interval_of_draws(of_plain), s.recalibrated);
  s.with_effect_90 = is_gap(d.verdict) ? about(interval_of_draws(of_effects), s.with_effect) : s.recalibrated_90;
  const auto [at_risk, rests] = model.rests();
  const ModelError error = model_error(d);
  const auto add = [&](const std::string& where, const std::vector<double>& there) {
    MachineSteps machine{where, joined_steps(of_effects, there, error, at_risk, rests), false};
    if (at_risk > 0 && rests == 0) {
      machine = survivors_steps(where, machine.steps.lower, s, d.verdict != Verdict::unexplained);
      if (machine.steps.lower > 1) s.machine.push_back(std::move(machine));
      return;
    }
    if (where.empty()) machine.steps = bounded_by_count(machine.steps, s);
    machine.at_least = !std::isfinite(machine.steps.upper);
    for (double* one : {&machine.steps.lower, &machine.steps.value, &machine.steps.upper})
      *one = std::max(1.0, *one);  // the step that fails counts
    if (std::isfinite(machine.steps.lower)) s.machine.push_back(std::move(machine));
  };
  add("", of_effects);
  if (rests > 0 && (d.verdict == Verdict::partly_explained || d.verdict == Verdict::unexplained))
    s.without_unnamed =
        steps_of_model_by_machine(d.verdict == Verdict::unexplained ? of_plain : of_effects, error, at_risk, rests);
  if (elsewhere.second) add(elsewhere.first, draw(*elsewhere.second, fits.empty() ? plain : fits, draws_of_machine));
}

}  // namespace metastable::analysis
