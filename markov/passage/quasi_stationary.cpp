#include "markov/passage/quasi_stationary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>

namespace metastable::markov {
namespace {

constexpr int iteration_limit = 10000;  // of interpolated rows
constexpr int patience = 500;           // of all others, before leading_pair() is asked
constexpr std::size_t small = 64;       // states, of which leading_pair() is asked at once
constexpr std::size_t whole = 512;      // states of a cyclic chain, up to which leading_pair() takes all of them
constexpr double same_end = 1e-9;       // of two starts, relative
constexpr double worst_residual = 1e-8;
constexpr double small_entry = 1e-12;     // of the largest: below it an entry's relative change is not watched
constexpr double accuracy = 1e-13;        // wanted of an entry, relative
constexpr double rounding_floor = 1e-11;  // a change that has stopped falling below this is rounding
constexpr int stagnant = 8;               // iterations without a smaller change
constexpr double rate_accuracy = 1e-14;
constexpr double stays = 1e-12;          // a probability of staying below it is the rounding of a row sum
constexpr double nobody_rate = 1e-13;    // lambda_1 of interpolated rows from which nobody survives: rounding
constexpr int nobody_left = 100;         // iterations spent on its vectors
constexpr double hardly_anybody = 1e-6;  // lambda_1 of rows that keep so few that neighbouring eigenvalues are rounding
constexpr int few_left = patience;       // iterations spent on theirs

double total(const std::vector<double>& v) { return std::accumulate(v.begin(), v.end(), 0.0); }

void divide(std::vector<double>& v, double by) {
  for (double& entry : v) entry /= by;
}

/// Returns the largest relative change of an entry above small_entry of the largest.
double relative_change(const std::vector<double>& before, const std::vector<double>& after) {
  const double floor = small_entry * *std::max_element(after.begin(), after.end());
  double change = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (after[i] > floor) change = std::max(change, std::abs(after[i] - before[i]) / after[i]);
  }
  return change;
}

/// Decides when a linearly converging iteration is done: the geometric tail of the changes is below accuracy, or they
/// have stopped falling at the level of rounding.
class StoppingRule {
 public:
  bool done(double change) {
    // Of the first change it is not known how it falls.
    const double ratio = std::isinf(previous_) ? slowest : std::clamp(change / previous_, 0.0, slowest);
    previous_ = change;
    stagnant_ = change < smallest_ ? 0 : stagnant_ + 1;
    smallest_ = std::min(smallest_, change);
    return change * ratio / (1 - ratio) <= accuracy || (change <= rounding_floor && stagnant_ >= stagnant);
  }

 private:
  static constexpr double slowest = 0.9999;
  double previous_ = std::numeric_limits<double>::infinity();
  double smallest_ = std::numeric_limits<double>::infinity();
  int stagnant_ = 0;
};

struct IteratedPair {
  std::vector<double> left;   ///< sum 1
  std::vector<double> right;  ///< max 1
  double rate = 1;
  int iterations = 0;
  double residual = 0;
  bool settled = true;
};

/// Says whether no state can be visited twice: lambda_1 = 0.
bool never_returns(const Chain& chain) {
  const std::size_t n = chain.size();
  std::vector<std::size_t> sources(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    if (chain.stay(i) > stays) return false;
    for (const std::uint32_t j : chain.columns(i)) ++sources[j];
  }
  std::vector<std::uint32_t> queue;
  for (std::size_t i = 0; i < n; ++i) {
    if (sources[i] == 0) queue.push_back(static_cast<std::uint32_t>(i));
  }
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (const std::uint32_t j : chain.columns(queue[head])) {
      if (--sources[j] == 0) queue.push_back(j);
    }
  }
  return queue.size() == n;
}

/// Returns the eigenvectors of a chain that never returns (eigenvalue 0): the last survivors of an even start, and the
/// states survival from which lasts longest.
IteratedPair last_survivors(const Chain& chain) {
  const std::size_t n = chain.size();
  IteratedPair pair;
  pair.left.assign(n, 1.0 / static_cast<double>(n));
  pair.right.assign(n, 1.0);
  for (;; ++pair.iterations) {
    std::vector<double> left(n, 0.0), right(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const auto to = chain.columns(i);
      for (std::size_t e = 0; e < to.size(); ++e) {
        left[to[e]] += pair.left[i] * chain.values(i)[e];
        right[i] += chain.values(i)[e] * pair.right[to[e]];
      }
    }
    const double survivors = total(left);
    if (survivors == 0) {
      pair.settled = false;  // there is no rate to tell of
      return pair;
    }
    divide(left, survivors);
    divide(right, *std::max_element(right.begin(), right.end()));
    pair.left = std::move(left);
    pair.right = std::move(right);
  }
}

std::string still_changing(int iterations) {
  return "still changing after " + std::to_string(iterations) +
         " iterations: survivors of two kinds fade at nearly the same rate; other --cells or --method may tell them "
         "apart";
}

/// Does one iteration of left vectors; returns what all entries sum to before the step, 1 / rate.
double iterate_left(const Chain& chain, const Elimination& elimination, std::vector<double>& left) {
  std::vector<double> next = elimination.solve_left(left);
  const double visits = total(next);
  next = apply_left(chain, next);
  divide(next, total(next));
  left = std::move(next);
  return visits;
}

/// Goes from a start that favours some states to where the even one has ended. A component that fades so slowly that
/// its changes pass for rounding is of another size there.
double distance_between_ends(const Chain& chain, const Elimination& elimination, const IteratedPair& pair) {
  constexpr double golden = 0.6180339887498949, least = 0.1;
  std::vector<double> left(chain.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = least + std::fmod(golden * static_cast<double>(i + 1), 1);
  for (int k = 0; k < pair.iterations; ++k) iterate_left(chain, elimination, left);
  return relative_change(left, pair.left);
}

/// Iterates with Q (I - Q)^{-1}, whose eigenvalues are lambda / (1 - lambda): lambda_2 fades at least as fast as under
/// inverse iteration (rare rest) and as under plain iteration (frequent rest). Returns nothing where that does not
/// tell.
std::optional<IteratedPair> iterate(const Chain& chain, const Elimination& elimination, FewSurvivors few) {
  const std::size_t n = chain.size();
  const bool unsettled_ends = chain.interpolated() || few == FewSurvivors::unsettled;
  IteratedPair pair;
  pair.left.assign(n, 1.0 / static_cast<double>(n));
  pair.right.assign(n, 1.0);
  StoppingRule left_rule, right_rule;
  bool left_done = false, right_done = false;
  while (pair.iterations < (chain.interpolated() ? iteration_limit : patience)) {
    ++pair.iterations;
    std::vector<double> left = pair.left;
    const double rate = 1 / iterate_left(chain, elimination, left);
    std::vector<double> right = markov::apply(chain, elimination.solve(pair.right));
    divide(right, *std::max_element(right.begin(), right.end()));

    const double left_change = relative_change(pair.left, left);
    const double right_change = relative_change(pair.right, right);
    const double rate_change = std::abs(rate - pair.rate) / rate;
    pair.left = std::move(left);
    pair.right = std::move(right);
    pair.rate = rate;
    pair.residual = std::max(left_change, right_change);
    left_done = left_rule.done(left_change) || left_done;
    right_done = right_rule.done(right_change) || right_done;
    const bool settled = left_done && right_done && (rate_change <= rate_accuracy || left_change <= accuracy);
    if (settled) {
      if (chain.interpolated()) return pair;
      pair.residual = std::max(pair.residual, distance_between_ends(chain, elimination, pair));
      if (pair.residual > same_end) return std::nullopt;
      return pair;
    }
    if (unsettled_ends && ((pair.iterations >= nobody_left && std::abs(1 - rate) <= nobody_rate) ||
                           (pair.iterations >= few_left && std::abs(1 - rate) <= hardly_anybody))) {
      // Of vectors that are still changing the rate is that of the survivors they tell of.
      pair.rate = 1 - std::clamp(total(apply_left(chain, pair.left)), 0.0, 1.0);
      pair.settled = false;
      return pair;
    }
  }
  if (chain.interpolated()) throw ConvergenceError("inverse iteration", pair.residual, still_changing(iteration_limit));
  return std::nullopt;
}

/// Fills the classes after class 0 of a left eigenvector, y_{c+1} = y_c Q_c / lambda with lambda per step, from what is
/// left after a revolution. Returns log lambda.
double propagate_distribution(const Chain& chain, const Period& period, std::vector<double>& y) {
  double log_survival = 0;  // each class is scaled on its way, so that none is lost
  std::vector<double> log_mass{0};
  for (std::size_t c = 0; c < period.classes.size(); ++c) {
    double left = 0;
    std::vector<double> next(y.size(), 0.0);
    for (const std::uint32_t i : period.classes[c]) {
      const auto to = chain.columns(i);
      for (std::size_t e = 0; e < to.size(); ++e) {
        next[to[e]] += y[i] * chain.values(i)[e];
        left += y[i] * chain.values(i)[e];
      }
    }
    if (left == 0) break;
    log_survival += std::log(std::abs(left));
    log_mass.push_back(log_survival);
    if (c + 1 < period.classes.size())
      for (const std::uint32_t j : period.classes[c + 1]) y[j] = next[j] / left;
  }
  const double log_lambda = log_survival / static_cast<double>(period.classes.size());
  for (std::size_t c = 0; c < std::min(period.classes.size(), log_mass.size()); ++c) {
    const double mass = std::exp(log_mass[c] - static_cast<double>(c) * log_lambda);
    for (const std::uint32_t i : period.classes[c]) y[i] *= mass;
  }
  divide(y, total(y));
  return log_lambda;
}

/// Fills the classes after class 0 of a right eigenvector: lambda x_c = Q_c x_{c+1} with lambda per step.
void propagate_weight(const Chain& chain, const Period& period, double lambda, std::vector<double>& x) {
  for (std::size_t c = period.classes.size(); c-- > 1;) {
    for (const std::uint32_t i : period.classes[c]) {
      const auto to = chain.columns(i);
      double sum = 0;
      for (std::size_t e = 0; e < to.size(); ++e) sum += chain.values(i)[e] * x[to[e]];
      x[i] = lambda > 0 ? sum / lambda : 0;
    }
  }
  const double largest = *std::max_element(x.begin(), x.end());
  divide(x, largest);
}

/// Tells of all cyclic classes what is known of class 0.
QuasiStationary of_all_classes(const ChainSolver& solver, const IteratedPair& pair) {
  const Period& period = solver.period();
  const double revolution_rate = std::min(1.0, pair.rate);
  QuasiStationary quasi{pair.left, pair.right, revolution_rate, revolution_rate, pair.iterations, pair.residual};
  if (period.period == 1) return quasi;
  quasi.failure_rate = -std::expm1(std::log1p(-revolution_rate) / period.period);
  quasi.distribution.assign(solver.chain().size(), 0.0);
  quasi.survival_weight.assign(solver.chain().size(), 0.0);
  for (std::size_t i = 0; i < pair.left.size(); ++i) {
    quasi.distribution[period.classes[0][i]] = pair.left[i];
    quasi.survival_weight[period.classes[0][i]] = pair.right[i];
  }
  const double log_lambda = propagate_distribution(solver.chain(), period, quasi.distribution);
  // Where most fail in a revolution, those who do not are known better than by difference.
  if (revolution_rate > 0.5 && pair.settled && !solver.chain().interpolated()) {
    quasi.failure_rate = -std::expm1(log_lambda);
    quasi.revolution_failure_rate = -std::expm1(period.period * log_lambda);
  }
  propagate_weight(solver.chain(), period, 1 - quasi.failure_rate, quasi.survival_weight);
  return quasi;
}

QuasiStationary of_whole_chain(const LeadingPair& exact) {
  const auto rate = static_cast<double>(exact.rate);
  return {{exact.left.begin(), exact.left.end()},
          {exact.right.begin(), exact.right.end()},
          rate,
          rate,
          exact.iterations,
          exact.error};
}

/// Takes the chain as it is, or, where that would take long, watched once a revolution.
QuasiStationary by_classes(const ChainSolver& solver) {
  const Period& period = solver.period();
  if (period.period == 1 || solver.chain().size() <= whole) {
    QuasiStationary quasi = of_whole_chain(leading_pair(generator_of(solver.chain())));
    if (period.period > 1) quasi.revolution_failure_rate = -std::expm1(period.period * std::log1p(-quasi.failure_rate));
    return quasi;
  }
  try {
    const LeadingPair exact = leading_pair(generator_of(solver.revolution()));
    return of_all_classes(solver, {{exact.left.begin(), exact.left.end()},
                                   {exact.right.begin(), exact.right.end()},
                                   static_cast<double>(exact.rate),
                                   exact.iterations,
                                   exact.error});
  } catch (const NotUnique& error) {
    throw NotUnique(period.classes[0][error.one()], period.classes[0][error.other()], error.rate(), error.equal());
  }
}

/// Returns the largest of |flow - (exit - rate) v| / (exit v): y Q - lambda y, or Q x - lambda x, over v's own terms.
double residual_of(const Generator& generator, Extended rate, const std::vector<double>& vector, bool left) {
  constexpr double least = 1e-290;  // products with smaller entries leave the range of doubles
  std::vector<Extended> flow(vector.size(), 0);
  for (std::size_t i = 0; i < vector.size(); ++i)
    for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e)
      (left ? flow[generator.column[e]] : flow[i]) +=
          generator.rate[e] * static_cast<Extended>(vector[left ? i : generator.column[e]]);
  Extended largest = 0;
  for (std::size_t i = 0; i < vector.size(); ++i) {
    const Extended exit = generator.exit(i), own = exit * static_cast<Extended>(vector[i]);
    const Extended off = std::abs(flow[i] - (exit - rate) * static_cast<Extended>(vector[i]));
    if (std::max(own, flow[i]) > least) largest = std::max(largest, off / std::max(own, flow[i]));
  }
  return static_cast<double>(largest);
}

/// Returns the larger residual of both vectors, and what is known of their error.
double residual_of(const Generator& generator, const QuasiStationary& quasi) {
  const auto rate = static_cast<Extended>(quasi.failure_rate);
  return std::max({quasi.residual, residual_of(generator, rate, quasi.distribution, true),
                   residual_of(generator, rate, quasi.survival_weight, false)});
}

void require_small_residual(const QuasiStationary& quasi) {
  if (!(quasi.residual <= worst_residual))
    throw ConvergenceError("inverse iteration", quasi.residual, "the vectors found are not those of the chain");
}

std::vector<std::uint32_t> marked_states(const std::vector<std::uint8_t>& marked) {
  std::vector<std::uint32_t> states;
  for (std::size_t i = 0; i < marked.size(); ++i) {
    if (marked[i]) states.push_back(static_cast<std::uint32_t>(i));
  }
  return states;
}

/// Finds the states from which `target` can be reached.
std::vector<std::uint8_t> leading_to(const Incoming& into, std::uint32_t target) {
  std::vector<std::uint8_t> marked(into.start.size() - 1, 0);
  std::vector<std::uint32_t> queue{target};
  marked[target] = 1;
  while (!queue.empty()) {
    const std::uint32_t state = queue.back();
    queue.pop_back();
    for (std::size_t e = into.start[state]; e < into.start[state + 1]; ++e) {
      if (marked[into.row[e]]) continue;
      marked[into.row[e]] = 1;
      queue.push_back(into.row[e]);
    }
  }
  return marked;
}

/// Finds the only closed class among the `reachable` states of a chain without rest.
std::vector<std::uint32_t> closed_class(const Chain& chain, const std::vector<std::uint8_t>& reachable) {
  const Incoming into = incoming(chain);
  std::uint32_t candidate = marked_states(reachable).front();
  for (;;) {
    std::vector<double> start(chain.size(), 0.0);
    start[candidate] = 1;
    const std::vector<std::uint32_t> ahead = marked_states(reachable_from(chain, start));
    const std::vector<std::uint8_t> returns = leading_to(into, candidate);
    const auto lost = std::find_if(ahead.begin(), ahead.end(), [&](std::uint32_t state) { return !returns[state]; });
    if (lost != ahead.end()) {
      candidate = *lost;  // its own future does not contain the old candidate: this ends
      continue;
    }
    for (std::size_t i = 0; i < reachable.size(); ++i) {
      if (reachable[i] && !returns[i]) {
        throw std::domain_error("stationary distribution: several closed classes can be reached (state " +
                                std::to_string(i) + " never leads to state " + std::to_string(candidate) + ")");
      }
    }
    return ahead;
  }
}

}  // namespace

QuasiStationary quasi_stationary(const ChainSolver& solver, FewSurvivors few) {
  const Chain& revolution = solver.revolution();
  if (revolution.size() == 0) throw std::invalid_argument("quasi-stationary distribution: the chain has no states");
  const bool unsettled = few == FewSurvivors::unsettled;
  if (unsettled && never_returns(revolution)) return of_all_classes(solver, last_survivors(revolution));
  if (!unsettled && never_returns(solver.chain())) {
    IteratedPair last = last_survivors(solver.chain());
    return {std::move(last.left), std::move(last.right), 1, 1, last.iterations, 0};
  }
  if (unsettled || revolution.interpolated() || solver.chain().size() > small) {
    const std::optional<IteratedPair> pair = iterate(revolution, solver.revolution_elimination(), few);
    if (pair) {
      QuasiStationary quasi = of_all_classes(solver, *pair);
      if (unsettled || revolution.interpolated()) return quasi;
      // Entries far below the largest settle later than the others, and are not watched.
      quasi.residual = residual_of(generator_of(solver.chain()), quasi);
      if (quasi.residual <= same_end) return quasi;
    }
  }
  QuasiStationary quasi = by_classes(solver);
  quasi.residual = residual_of(generator_of(solver.chain()), quasi);
  require_small_residual(quasi);
  return quasi;
}

QuasiStationary quasi_stationary_as_a_whole(const Chain& chain, LeadingPair& pair, const Heard& heard) {
  if (chain.size() == 0) throw std::invalid_argument("quasi-stationary distribution: the chain has no states");
  if (never_returns(chain)) {
    IteratedPair last = last_survivors(chain);
    pair = {{last.left.begin(), last.left.end()}, {last.right.begin(), last.right.end()}, 1, last.iterations, 0};
    return {std::move(last.left), std::move(last.right), 1, 1, last.iterations, 0};
  }
  const Generator generator = generator_of(chain);
  pair = leading_pair(generator, heard);
  QuasiStationary quasi = of_whole_chain(pair);
  quasi.residual = residual_of(generator, quasi);
  require_small_residual(quasi);
  return quasi;
}

std::vector<double> shares_in_classes(const Period& period, std::vector<double> distribution) {
  for (const std::vector<std::uint32_t>& states : period.classes) {
    double sum = 0;
    for (const std::uint32_t i : states) sum += distribution[i];
    for (const std::uint32_t i : states) distribution[i] /= sum != 0 ? sum : 1;
  }
  return distribution;
}

std::vector<double> stationary(const Chain& chain, std::span<const double> start) {
  const std::vector<std::uint8_t> reachable = reachable_from(chain, start);
  for (std::size_t i = 0; i < reachable.size(); ++i) {
    if (reachable[i] && chain.kill(i) > 0) {
      throw std::domain_error("stationary distribution: rest can be reached (from state " + std::to_string(i) + ")");
    }
  }
  if (std::find(reachable.begin(), reachable.end(), 1) == reachable.end()) {
    throw std::invalid_argument("stationary distribution: the start has no mass");
  }
  const std::vector<std::uint32_t> states = closed_class(chain, reachable);
  // This solves for the visits to the other states between two visits to the first one.
  const std::span<const std::uint32_t> others(states.begin() + 1, states.end());
  std::vector<double> departures(chain.size(), 0.0);
  for (std::size_t e = 0; e < chain.columns(states[0]).size(); ++e) {
    departures[chain.columns(states[0])[e]] = chain.values(states[0])[e];
  }
  std::vector<double> rhs;
  for (const std::uint32_t state : others) rhs.push_back(departures[state]);
  const std::vector<double> visits =
      on_states(others, [&] { return Elimination(chain.restricted_to(others)).solve_left(rhs); });
  std::vector<double> distribution(chain.size(), 0.0);
  distribution[states[0]] = 1;
  for (std::size_t i = 0; i < others.size(); ++i) distribution[others[i]] = visits[i];
  divide(distribution, total(distribution));
  return distribution;
}

std::vector<double> stationary_with_restart(const ChainSolver& solver, std::span<const double> restart) {
  std::vector<double> distribution = solver.solve_left(restart);
  const double sum = total(distribution);
  if (!(sum > 0)) throw std::invalid_argument("stationary distribution with restart: the restart has no mass");
  divide(distribution, sum);
  return distribution;
}

std::optional<int> total_variation_mixing(const ChainSolver& solver, const QuasiStationary& quasi,
                                          std::span<const double> start, double distance, int limit) {
  const Chain& chain = solver.chain();
  const Period& period = solver.period();
  if (start.size() != chain.size()) throw std::invalid_argument("mixing: one start entry per state expected");
  if (!(distance > 0)) throw std::invalid_argument("mixing: the distance must be positive");
  const std::vector<double> settled = shares_in_classes(period, quasi.distribution);
  std::vector<double> survivors(start.begin(), start.end());
  int within = 0;
  for (int step = 0; step <= limit; ++step) {
    const double mass = total(survivors);
    if (!(mass > (chain.interpolated() ? nobody_rate : 0))) return std::nullopt;  // nobody is left to be mixed
    divide(survivors, mass);
    std::vector<double> class_mass(period.classes.size(), 0.0);
    for (std::size_t i = 0; i < survivors.size(); ++i) {
      class_mass[static_cast<std::size_t>(period.state_class[i])] += survivors[i];
    }
    double variation = 0;
    for (std::size_t i = 0; i < survivors.size(); ++i) {
      const double expected = class_mass[static_cast<std::size_t>(period.state_class[i])] * settled[i];
      variation += 0.5 * std::abs(survivors[i] - expected);
    }
    within = variation <= distance ? within + 1 : 0;
    if (within > period.period) return step - period.period;
    survivors = apply_left(chain, survivors);
  }
  return std::nullopt;
}

double spectral_mixing_steps(std::span<const double> moduli) {
  for (const double modulus : moduli) {
    if (!(modulus >= 0)) throw std::invalid_argument("spectral mixing time: a modulus is negative or undefined");
  }
  if (moduli.size() < 2 || moduli[1] == 0) return 0;
  if (moduli[1] >= moduli[0]) return std::numeric_limits<double>::infinity();
  return 1 / std::log(moduli[0] / moduli[1]);
}

}  // namespace metastable::markov
