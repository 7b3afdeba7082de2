#include "markov/passage/bounded_passage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "markov/passage/distribution_bound.h"
#include "markov/passage/nested_solver.h"

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;

constexpr Extended extended_rounding = std::numeric_limits<Extended>::epsilon();
constexpr double outwards = 4 * std::numeric_limits<double>::epsilon();  // a bound as a double
constexpr double narrow = 1e-9;                                          // bounds that are not refined
constexpr double enough = 1e-12;    // width of the bounds of a rate that need not be narrower
constexpr int most_sweeps = 300;    // of a probability
constexpr int most_refined = 4;     // corrections of a mean or a variance; where groups mix slowly each leaves 1e-3
constexpr Extended swept = 1e-17L;  // residual, of what leaves the state

/// v_i - sum q_ij v_j as a sum of products, and what its rounding may be.
struct Difference {
  Extended value = 0, error = 0;
};

Difference difference(const Chain& chain, std::size_t i, const SplitVector& v) {
  Extended value = chain.kill(i) * v.base[i] + chain.kill(i) * v.rest[i], size = std::abs(value);
  const auto columns = chain.columns(i);
  const auto values = chain.values(i);
  for (std::size_t e = 0; e < columns.size(); ++e) {
    const Extended part = values[e] * v.difference(i, columns[e]);
    value += part;
    size += std::abs(part);
  }
  return {value, 2 * extended_rounding * static_cast<Extended>(columns.size() + 3) * size};
}

/// Returns the probability of leaving state i.
Extended leaving(const Chain& chain, std::size_t i) {
  const auto values = chain.values(i);
  return std::accumulate(values.begin(), values.end(), static_cast<Extended>(chain.kill(i)));
}

[[noreturn]] void refuse(const char* what, double bound) {
  throw ConvergenceError("iteration", bound,
                         fmt::format("the proven bound of the {} is wider than {:g}, relative", what, widest_bound));
}

/// Corrects a solution of (I - Q) x = right by what it leaves of the right side. The correction stays apart, so that
/// neighbours differ by digits that their sums would round.
SplitVector refined(const Chain& chain, GeneratorSolver& solver, std::span<const Extended> right,
                    const SplitVector& x) {
  SplitVector better = x;
  Row left(right.begin(), right.end());
  for (std::size_t i = 0; i < left.size(); ++i) {
    left[i] -= difference(chain, i, x).value;
    better.base[i] = x.sum(i);
    const Extended off = (x.base[i] - better.base[i]) + x.rest[i];  // what the sum rounds, |base| above |rest|
    better.rest[i] = off;
  }
  const Row correction = solver.solve(left);
  for (std::size_t i = 0; i < left.size(); ++i) better.rest[i] += correction[i];
  return better;
}

/// Returns by state the variance that the next step adds to the steps before failure, in units of the largest mean
/// squared: first_passage_sd() sums it along the way.
Row variance_of_a_step(const Chain& chain, const SplitVector& mean, Extended unit) {
  const auto square = [&](Extended off) { return off / unit * (off / unit); };
  Row variance(chain.size());
  for (std::size_t i = 0; i < chain.size(); ++i) {
    variance[i] = chain.kill(i) * square(1 - mean.sum(i)) + chain.stay(i) * square(1);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e)
      variance[i] += chain.values(i)[e] * square(1 + mean.difference(chain.columns(i)[e], i));
  }
  return variance;
}

/// Sweeps a probability, (I - Q) v = b, until its small entries follow from the large ones.
void sweep(const Chain& chain, const Row& right, Row& v, const Heard& heard) {
  for (int pass = 0; pass < most_sweeps; ++pass) {
    if (heard) heard();
    Extended most = 0;
    for (std::size_t i = 0; i < v.size(); ++i) {
      Extended arriving = right[i];
      for (std::size_t e = 0; e < chain.columns(i).size(); ++e) arriving += chain.values(i)[e] * v[chain.columns(i)[e]];
      const Extended now = arriving / leaving(chain, i);
      if (now > 0) most = std::max(most, std::abs(now - v[i]) / now);
      v[i] = now;
    }
    if (most <= swept) return;
  }
}

/// Bounds the relative error of v, (I - Q) v = right.
double relative_error(const Chain& chain, NestedSolver& solver, const Row& right, const SplitVector& v) {
  Row leave(chain.size());
  Extended most = 0;
  for (std::size_t i = 0; i < leave.size(); ++i) {
    const Difference one = difference(chain, i, v);
    leave[i] = leaving(chain, i) * v.sum(i);
    const Extended off = std::abs(one.value - right[i]) + one.error;
    if (off > 0) most = std::max(most, off / leave[i]);
  }
  const SplitVector z = solver.solve(leave);
  Extended reached = 1, largest = 0;
  for (std::size_t i = 0; i < leave.size(); ++i) {
    const Difference one = difference(chain, i, z);
    if (leave[i] > 0) reached = std::min(reached, (one.value - one.error) / leave[i]);
    if (v.sum(i) > 0) largest = std::max(largest, z.sum(i) / v.sum(i));
  }
  return reached > 0 ? static_cast<double>(most / reached * largest) : std::numeric_limits<double>::infinity();
}

/// Solves a passage to a set that some states of `inside` enter at once, with probabilities `entering`, and leads a
/// probability that is structurally zero to none.
struct Decided {
  std::vector<double> probability;
  double error = 0;
};
Decided decided(const Chain& inside, GeneratorSolver& solver, const std::vector<double>& entering, const Heard& heard) {
  // Only states that can come there at all; to be elsewhere is to fail then.
  const Incoming into = incoming(inside);
  std::vector<std::uint8_t> comes(inside.size(), 0);
  std::vector<std::uint32_t> queue;
  for (std::uint32_t i = 0; i < inside.size(); ++i)
    if (entering[i] > 0) comes[i] = 1, queue.push_back(i);
  while (!queue.empty()) {
    const std::uint32_t at = queue.back();
    queue.pop_back();
    for (std::size_t e = into.start[at]; e < into.start[at + 1]; ++e)
      if (!comes[into.row[e]]) comes[into.row[e]] = 1, queue.push_back(into.row[e]);
  }
  const Row right(entering.begin(), entering.end());
  NestedSolver nested(inside, solver, comes, heard);
  SplitVector v = nested.solve(right);
  for (std::size_t i = 0; i < right.size(); ++i) v.rest[i] = v.sum(i);
  std::fill(v.base.begin(), v.base.end(), Extended{0});
  sweep(inside, right, v.rest, heard);
  Decided decided{{v.rest.begin(), v.rest.end()}, relative_error(inside, nested, right, v)};
  if (!(decided.error <= widest_bound)) refuse("probabilities", decided.error);
  return decided;
}

/// Holds expected steps and their bounds.
struct Steps {
  SplitVector mean;
  VectorBounds bounds;
  double error() const { return error_within(bounds, mean); }
  void refine(const Chain& chain, GeneratorSolver& solver) {
    mean = refined(chain, solver, Row(chain.size(), 1), mean);
    bounds = steps_enclosed(chain, mean);
  }
};

/// Solves for the expected steps, as narrowly as it takes, and bounds them.
Steps expected_steps(const Chain& chain, GeneratorSolver& solver) {
  Steps steps{solver.solve_split(Row(chain.size(), 1)), {}};
  steps.bounds = steps_enclosed(chain, steps.mean);
  if (!(steps.error() <= narrow)) steps.refine(chain, solver);
  for (int again = 1; again < most_refined && !(steps.error() <= widest_bound); ++again) steps.refine(chain, solver);
  if (!(steps.error() <= widest_bound)) refuse("expected steps", steps.error());
  return steps;
}

/// Bounds the error of standard deviations, relative to them or, where they are less, to one step.
///
/// With m the means found, w the largest of |m - Q m - 1|, g the variance that a step adds by them, v the variance
/// found, and what (I - Q) v leaves of g at most b (2 m - 1 + g), the second moment v + m^2, whose right side is 2 m -
/// 1, is at most 6 w + 3 b off, because the solution for g is no more than the second moment, and v at most 9 w + 3 b
/// of that.
/// @param unit  of the means; the variances are in its square
double sd_error(const Chain& chain, const Steps& steps, Extended unit, const Row& of_a_step,
                const SplitVector& variance) {
  Extended beside = 0, mean_off = 0;  // b, w
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Difference mean = difference(chain, i, steps.mean), one = difference(chain, i, variance);
    mean_off = std::max(mean_off, std::abs(mean.value - 1) + mean.error);
    const auto terms = static_cast<Extended>(chain.columns(i).size() + 3);
    const Extended off = std::abs(of_a_step[i] - one.value) + one.error + 4 * terms * extended_rounding * of_a_step[i];
    if (!std::isfinite(off)) return std::numeric_limits<double>::infinity();
    const Extended against = (2 * std::max<Extended>(1, steps.bounds.lower[i]) - 1) / unit / unit + of_a_step[i];
    beside = std::max(beside, off / against);
  }
  const Extended share = 9 * mean_off + 3 * beside;
  if (!(share < 0.5L)) return std::numeric_limits<double>::infinity();
  Extended most = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Extended found = unit * unit * std::max<Extended>(0, variance.sum(i));
    const Extended off = share / (1 - share) * (found + steps.mean.sum(i) * steps.mean.sum(i));
    const Extended of_sd = found > off ? off / std::sqrt(found) : std::sqrt(off);
    most = std::max(most, of_sd / std::max<Extended>(1, std::sqrt(found)));
  }
  return static_cast<double>(most);
}

/// Solves for the standard deviations, and refines means and variances as often as that takes.
std::vector<double> standard_deviations(const Chain& chain, GeneratorSolver& solver, Steps& steps) {
  Extended unit = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) unit = std::max(unit, steps.mean.sum(i));
  Row of_a_step = variance_of_a_step(chain, steps.mean, unit);
  SplitVector variance = solver.solve_split(of_a_step);
  double error = sd_error(chain, steps, unit, of_a_step, variance);
  for (int again = 0; again < most_refined && !(error <= widest_bound); ++again) {
    steps.refine(chain, solver);
    of_a_step = variance_of_a_step(chain, steps.mean, unit);
    variance = refined(chain, solver, of_a_step, variance);
    error = sd_error(chain, steps, unit, of_a_step, variance);
  }
  if (!(error <= widest_bound)) refuse("standard deviations of the steps", error);
  std::vector<double> sd;
  for (std::size_t i = 0; i < chain.size(); ++i)
    sd.push_back(static_cast<double>(unit * std::sqrt(std::max<Extended>(0, variance.sum(i)))));
  return sd;
}

}  // namespace

VectorBounds steps_enclosed(const Chain& chain, const SplitVector& v) {
  Extended low = std::numeric_limits<Extended>::infinity(), high = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Difference one = difference(chain, i, v);
    low = std::min(low, one.value - one.error);
    high = std::max(high, one.value + one.error);
  }
  VectorBounds bounds;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    bounds.lower.push_back(static_cast<double>(v.sum(i) / high) * (1 - outwards));
    bounds.upper.push_back(low > 0 ? static_cast<double>(v.sum(i) / low) * (1 + outwards)
                                   : std::numeric_limits<double>::infinity());
  }
  return bounds;
}

double error_within(const VectorBounds& bounds, const SplitVector& v) {
  const auto first = static_cast<double>(v.sum(0));
  return std::max(bounds.upper[0] / first - 1, 1 - bounds.lower[0] / first);
}

BoundedSteps bounded_first_passage(const Chain& chain, const Heard& heard) {
  const std::vector<std::uint8_t> can_rest = classify(chain).can_rest;
  const auto stuck = std::find(can_rest.begin(), can_rest.end(), 0);
  if (stuck != can_rest.end())
    throw std::domain_error(
        fmt::format("chain solver: rest cannot be reached from state {}", stuck - can_rest.begin()));
  GeneratorSolver solver(generator_of(chain), heard);
  Steps found = expected_steps(chain, solver);
  BoundedSteps steps;
  steps.sd = standard_deviations(chain, solver, found);
  steps.bounds = std::move(found.bounds);
  for (std::size_t i = 0; i < chain.size(); ++i)
    steps.mean.push_back(std::max(1.0, static_cast<double>(found.mean.sum(i))));
  return steps;
}

SplitVector split(std::span<const double> v) { return {Row(v.size(), 0), {v.begin(), v.end()}}; }

void enclose_rate(const Chain& chain, const SplitVector& weight, BoundedQuasiStationary& bounded) {
  Extended low = std::numeric_limits<Extended>::infinity(), high = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Extended own = weight.sum(i);
    if (own < 0) return;
    if (own == 0) continue;
    const Difference one = difference(chain, i, weight);
    low = std::min(low, (one.value - one.error) / own);
    high = std::max(high, (one.value + one.error) / own);
  }
  bounded.rate_lower = std::max(bounded.rate_lower, static_cast<double>(low) * (1 - outwards));
  bounded.rate_upper = std::min(bounded.rate_upper, static_cast<double>(high) * (1 + outwards));
}

BoundedQuasiStationary bounded_quasi_stationary(const Chain& chain, const Heard& heard) {
  BoundedQuasiStationary bounded;
  LeadingPair pair;
  bounded.quasi = quasi_stationary_as_a_whole(chain, pair, heard);
  if (pair.rate == 1 || pair.rate == 0) {
    bounded.rate_lower = bounded.rate_upper = bounded.quasi.failure_rate;
    bound_distribution(chain, pair.left, pair.right, Way::iterated, bounded, heard);
    return bounded;
  }
  SplitVector weight{Row(chain.size(), 0), pair.right};
  enclose_rate(chain, weight, bounded);
  const auto can_rest = classify(chain).can_rest;
  if (bounded.rate_upper > (1 + enough) * bounded.rate_lower && std::count(can_rest.begin(), can_rest.end(), 0) == 0) {
    // One more iteration, whose vector is known to more digits of the differences between neighbours.
    const bool everywhere = std::all_of(pair.left.begin(), pair.left.end(), [](Extended share) { return share > 0; });
    GeneratorSolver solver(generator_of(chain), heard, everywhere ? pair.left : Row());
    weight = solver.solve_split(pair.right);
    enclose_rate(chain, weight, bounded);
    if (bounded.rate_upper > (1 + narrow) * bounded.rate_lower)
      enclose_rate(chain, refined(chain, solver, pair.right, weight), bounded);
  }
  double& rate = bounded.quasi.failure_rate;
  const double error =
      std::max({bounded.rate_upper / bounded.rate_lower, bounded.rate_upper / rate, rate / bounded.rate_lower}) - 1;
  if (!(error <= widest_bound)) refuse("failure rate", error);
  rate = std::max(bounded.rate_lower, std::min(bounded.rate_upper, rate));
  bound_distribution(chain, pair.left, pair.right, Way::iterated, bounded, heard);
  return bounded;
}

BoundedPassage bounded_passage_to(const Chain& chain, std::span<const std::uint8_t> set, const Heard& heard) {
  PassageQuestion question = passage_question(chain, set);
  if (question.undecided.empty()) return {question.passage, 0};
  const Chain& inside = question.inside;
  GeneratorSolver solver(generator_of(inside), heard);
  const Steps steps = expected_steps(inside, solver);
  const Decided reach = decided(inside, solver, question.to_set, heard),
                fail = decided(inside, solver, question.kill, heard);
  std::vector<double> expected;
  for (std::size_t i = 0; i < inside.size(); ++i) expected.push_back(static_cast<double>(steps.mean.sum(i)));
  question.answer(reach.probability, fail.probability, expected);
  return {question.passage, std::max({reach.error, fail.error, steps.error()})};
}

}  // namespace metastable::markov
