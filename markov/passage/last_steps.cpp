#include "markov/passage/last_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "markov/chain/elimination.h"
#include "markov/chain/solver.h"

namespace metastable::markov {
namespace {

constexpr double log_of_zero = -std::numeric_limits<double>::infinity();
constexpr std::size_t eliminated_states = 3000;
constexpr int product_limit = 100000;
constexpr double exact = 1e-11;  // relative

double logarithm(double probability) { return probability > 0 ? std::log(probability) : log_of_zero; }

void require_size(const char* what, std::size_t given, const Chain& chain) {
  if (given != chain.size())
    throw std::invalid_argument(fmt::format("last steps: {} has {} entries for {} states", what, given, chain.size()));
}

/// Holds the log of the best path's density by its first state, and where it goes from there.
class BestPath {
 public:
  BestPath(const Chain& chain, std::span<const double> measure) : chain_(chain), best_(chain.size()) {
    for (std::size_t i = 0; i < chain.size(); ++i) best_[i] = logarithm(chain.kill(i));
    log_measure_.assign(chain.size(), 0.0);
    for (std::size_t i = 0; i < measure.size(); ++i) log_measure_[i] = std::log(measure[i]);
  }

  void one_step_earlier() {
    std::vector<double> worth(best_.size(), log_of_zero);
    std::vector<std::uint32_t> to(best_.size(), 0);
    const auto offer = [&](std::size_t i, std::size_t j, double probability) {
      const double log_density = logarithm(probability) - log_measure_[j] + best_[j];
      if (!(log_density > worth[i])) return;
      worth[i] = log_density;
      to[i] = static_cast<std::uint32_t>(j);
    };
    for (std::size_t i = 0; i < best_.size(); ++i) {
      offer(i, i, chain_.stay(i));
      for (std::size_t e = 0; e < chain_.columns(i).size(); ++e) offer(i, chain_.columns(i)[e], chain_.values(i)[e]);
    }
    best_ = std::move(worth);
    next_.push_back(std::move(to));
  }

  /// Goes from where it is best to start when states are met in proportion to `visits`; the last step comes first.
  std::vector<std::uint32_t> path(std::span<const double> visits) const {
    std::size_t at = 0;
    double most = log_of_zero;
    for (std::size_t i = 0; i < best_.size(); ++i) {
      const double log_density = logarithm(visits[i]) - log_measure_[i] + best_[i];
      if (log_density > most) {
        most = log_density;
        at = i;
      }
    }
    std::vector<std::uint32_t> states{static_cast<std::uint32_t>(at)};
    for (std::size_t k = next_.size(); k-- > 0;) states.push_back(next_[k][states.back()]);
    std::reverse(states.begin(), states.end());
    return states;
  }

 private:
  const Chain& chain_;
  std::vector<double> best_, log_measure_;
  std::vector<std::vector<std::uint32_t>> next_;
};

/// Solves x = Q x + rhs by products, each from nothing: sums of non-negative numbers that only grow.
std::vector<double> by_products(const Chain& chain, std::span<const double> rhs) {
  std::vector<double> x(rhs.begin(), rhs.end()), term(x);
  for (int product = 0; product < product_limit; ++product) {
    term = markov::apply(chain, term);
    double most = 0;  // of what this term and, at the same pace, all later ones add
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] += term[i];
      if (x[i] > 0) most = std::max(most, term[i] / x[i]);
    }
    if (most * static_cast<double>(product + 1) <= exact) return x;
  }
  throw ConvergenceError("passage", exact, "neither the set nor failure is reached within 100000 steps");
}

/// Not by ChainSolver: what is left outside of a set may be cyclic where the chain is not, and its products would fill.
PassageTo by_elimination(PassageQuestion& question, int threads) {
  if (question.undecided.empty()) return question.passage;
  const Elimination solver = on_states(question.undecided, [&] { return Elimination(question.inside, threads); });
  question.answer(solver.solve(question.to_set), solver.solve(question.kill),
                  solver.solve(std::vector<double>(question.undecided.size(), 1.0)));
  return question.passage;
}

}  // namespace

LastSteps last_steps(const Chain& chain, std::span<const double> visits, int steps, std::span<const double> measure) {
  require_size("visits", visits.size(), chain);
  if (!measure.empty()) require_size("measure", measure.size(), chain);
  if (steps < 1) throw std::invalid_argument(fmt::format("last steps: {} steps, 1 or more expected", steps));
  LastSteps last;
  BestPath best(chain, measure);
  std::vector<double> fails(chain.kill().begin(), chain.kill().end());
  for (int k = 0;; ++k) {
    std::vector<double> share(chain.size());
    double all = 0;
    for (std::size_t i = 0; i < share.size(); ++i) all += share[i] = visits[i] * fails[i];
    if (!(all > 0)) {
      if (k == 0) throw std::domain_error("last steps: none of the states visited fails");
      break;
    }
    if (k > 0) best.one_step_earlier();
    for (double& one : share) one /= all;
    last.share.push_back(std::move(share));
    last.fails_in.push_back(fails);
    if (k + 1 == steps) break;
    fails = markov::apply(chain, fails);
  }
  last.likeliest = best.path(visits);
  return last;
}

void PassageQuestion::answer(std::span<const double> reach, std::span<const double> fail,
                             std::span<const double> steps) {
  for (std::size_t n = 0; n < undecided.size(); ++n) {
    passage.reach[undecided[n]] = reach[n];
    passage.fail[undecided[n]] = fail[n];
    if (must[n]) passage.steps[undecided[n]] = steps[n];
  }
}

PassageQuestion passage_question(const Chain& chain, std::span<const std::uint8_t> set) {
  require_size("set", set.size(), chain);
  PassageQuestion question;
  PassageTo& passage = question.passage;
  passage.reach.assign(set.begin(), set.end());
  passage.fail.assign(set.size(), 0.0);
  passage.steps.assign(set.size(), 0.0);
  std::vector<std::uint32_t> outside;
  for (std::size_t i = 0; i < set.size(); ++i)
    if (!set[i]) outside.push_back(static_cast<std::uint32_t>(i));
  const Reachability either = classify(chain.restricted_to(outside));
  for (std::size_t n = 0; n < outside.size(); ++n) {
    if (!either.must_rest[n]) passage.steps[outside[n]] = std::numeric_limits<double>::infinity();
    if (!either.can_rest[n]) continue;
    question.undecided.push_back(outside[n]);
    question.must.push_back(either.must_rest[n]);
  }
  for (const std::uint32_t i : question.undecided) {
    question.kill.push_back(chain.kill(i));
    question.to_set.push_back(0);
    const auto columns = chain.columns(i);
    for (std::size_t e = 0; e < columns.size(); ++e)
      if (set[columns[e]]) question.to_set.back() += chain.values(i)[e];
  }
  question.inside = chain.restricted_to(question.undecided);
  return question;
}

PassageTo passage_to(const Chain& chain, std::span<const std::uint8_t> set) {
  PassageQuestion question = passage_question(chain, set);
  if (question.undecided.size() <= eliminated_states) return by_elimination(question, 1);
  const auto solve = [&](const std::vector<double>& rhs) { return by_products(question.inside, rhs); };
  question.answer(solve(question.to_set), solve(question.kill),
                  solve(std::vector<double>(question.undecided.size(), 1.0)));
  return question.passage;
}

PassageTo passage_by_elimination(const Chain& chain, std::span<const std::uint8_t> set, int threads) {
  PassageQuestion question = passage_question(chain, set);
  return by_elimination(question, threads);
}

}  // namespace metastable::markov
