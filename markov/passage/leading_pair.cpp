#include "markov/passage/leading_pair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "markov/chain/generator_solver.h"

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;
using States = std::vector<std::uint32_t>;

constexpr Extended rounding = std::numeric_limits<Extended>::epsilon();
constexpr int most_iterations = 400;
/// An iteration that changes no entry by more, twice running, leaves errors of its square: the shift has come as near.
constexpr Extended same_vector = 1e-10L;
/// One such iteration is enough where what is left of the kill rates moves the vectors by no more.
constexpr Extended hardly_moved = 1e-13L;
/// Rate at which the state that returns are counted to is left for good, of the largest rate of leaving a state: so
/// that what is subtracted for it is small beside the returns.
constexpr Extended caught = 16;
/// Of the rate, so much is taken for its rounding: sums of a few entries, some ten eliminations.
constexpr Extended rate_rounding = 16 * rounding;
/// A vector whose error may be larger than this is not given.
constexpr Extended undecided = 1e-8L;

Extended total(const Row& v) { return std::accumulate(v.begin(), v.end(), Extended{0}); }

/// Holds the leading pair of one communicating class, the rate without its base (see Classes).
struct ClassPair {
  Extended rate = 0;
  bool exact = true;  ///< whether that is a sum of kill rates and rates of leaving, not the end of an iteration
  Row left, right;
  int iterations = 0;
  double error = 0;
};

/// Returns how long, at most, walkers of a generator without its kill rates take to its most visited state, forwards or
/// backwards in time, and the state from which: about one over the distance of the next eigenvalue. Walkers are caught
/// there at a rate, so that the stationary distribution serves the solver; what that takes is subtracted.
std::pair<Extended, std::uint32_t> slowest_return(const Generator& closed, const Row& stationary,
                                                  std::uint32_t most_visited, const Heard& heard) {
  Generator caught_there = closed;
  std::fill(caught_there.kill.begin(), caught_there.kill.end(), Extended{0});
  Extended fastest = 0;
  for (std::size_t i = 0; i < closed.size(); ++i) fastest = std::max(fastest, caught_there.exit(i));
  caught_there.kill[most_visited] = caught * fastest;
  GeneratorSolver solver(caught_there, heard, stationary);
  const Row forwards = solver.solve(Row(closed.size(), 1)), backwards = solver.solve_left(stationary);
  const auto backwards_from = [&](std::uint32_t i) { return stationary[i] > 0 ? backwards[i] / stationary[i] : 0; };
  const Extended caught_forwards = forwards[most_visited], caught_backwards = backwards_from(most_visited);
  std::pair<Extended, std::uint32_t> slowest{0, most_visited};
  for (std::uint32_t i = 0; i < closed.size(); ++i) {
    const Extended time = std::max(forwards[i] - caught_forwards, backwards_from(i) - caught_backwards);
    if (time > slowest.first) slowest = {time, i};
  }
  return slowest;
}

/// Scales a generator that holds X^-1 (G - tau) X by the expected steps w, and moves tau up as far as it can. Returns
/// the move.
Extended move_up(Generator& scaled, const Row& steps, Extended longest) {
  for (std::size_t i = 0; i < scaled.size(); ++i) {
    for (std::size_t e = scaled.start[i]; e < scaled.start[i + 1]; ++e)
      scaled.rate[e] *= steps[scaled.column[e]] / steps[i];
    scaled.kill[i] = (longest - steps[i]) / longest / steps[i];
  }
  return 1 / longest;
}

/// Noda's iteration on one class, its least kill rate taken off.
struct Noda {
  Generator scaled;  ///< X^-1 (G - tau) X
  Row right, visits;
  Extended excess = 0;  ///< tau
  Extended change = 1, before = 1;
  int iterations = 0;

  bool ended() const {
    return std::all_of(scaled.kill.begin(), scaled.kill.end(), [](Extended kill) { return kill == 0; });
  }
  void iterate(const Heard& heard) {
    GeneratorSolver solver(scaled, heard, visits);
    const Row steps = solver.solve(Row(right.size(), 1));
    visits.assign(solver.visits().begin(), solver.visits().end());
    const auto [least, longest] = std::minmax_element(steps.begin(), steps.end());
    const Extended most = *longest;
    before = std::exchange(change, (most - *least) / *least);
    if (++iterations > most_iterations || !std::isfinite(change))
      throw ConvergenceError("Noda's iteration", static_cast<double>(change),
                             fmt::format("still changing after {} iterations", iterations));
    for (std::size_t i = 0; i < right.size(); ++i) right[i] *= steps[i] / most;
    excess += move_up(scaled, steps, most);
  }
};

/// @param base  what has been taken off all kill rates
ClassPair pair_of_class(Generator generator, const States& states, Extended base, const Heard& heard) {
  const std::size_t n = generator.size();
  ClassPair pair;
  if (n == 1) {
    pair.rate = generator.kill[0];
    pair.left = pair.right = {1};
    return pair;
  }
  const Extended common = *std::min_element(generator.kill.begin(), generator.kill.end());
  for (Extended& kill : generator.kill) kill -= common;
  Noda noda{std::move(generator), Row(n, 1), {}};
  while (!noda.ended() && !(noda.change <= same_vector)) noda.iterate(heard);
  Row stationary;
  Extended excess = 0, error = 0;
  for (;;) {
    stationary = stationary_distribution(noda.scaled, heard, noda.visits);
    const auto& kill = noda.scaled.kill;
    excess = noda.excess + std::inner_product(stationary.begin(), stationary.end(), kill.begin(), Extended{0});
    const auto most_visited =
        static_cast<std::uint32_t>(std::max_element(stationary.begin(), stationary.end()) - stationary.begin());
    const auto [time, from] = slowest_return(noda.scaled, stationary, most_visited, heard);
    const Extended moved = *std::max_element(kill.begin(), kill.end()) * time;
    const bool twice = noda.ended() || (noda.change <= same_vector && noda.before <= same_vector);
    if (!twice && !(moved <= hardly_moved)) {
      noda.iterate(heard);
      continue;
    }
    error = std::max(!twice                       ? moved
                     : noda.change <= same_vector ? noda.change * noda.change
                                                  : 0,
                     rate_rounding * excess * time);
    if (!(error <= undecided))
      throw NotUnique(states[most_visited], states[from], static_cast<double>(base + common + excess), false);
    break;
  }
  pair.rate = common + excess;
  pair.exact = excess == 0;
  pair.iterations = noda.iterations;
  pair.error = static_cast<double>(error);
  for (std::size_t i = 0; i < n; ++i) pair.left.push_back(stationary[i] / noda.right[i]);
  const Extended sum = total(pair.left);
  for (Extended& entry : pair.left) entry /= sum;
  pair.right = std::move(noda.right);
  return pair;
}

/// Holds a chain by its classes, those that may lead solved. From the kill rates in a class their smallest, its base,
/// is taken off before the rates of leaving the class are added, which may be far smaller.
class Classes {
 public:
  Classes(const Generator& generator, Heard heard)
      : heard_(std::move(heard)),
        all_(generator),
        states_(communicating_classes(generator)),
        class_of_(generator.size()) {
    std::vector<std::uint32_t> scratch(generator.size(), Generator::outside);
    for (std::size_t c = 0; c < states_.size(); ++c) {
      Extended base = std::numeric_limits<Extended>::infinity();
      for (const std::uint32_t i : states_[c]) base = std::min(base, all_.kill[i]);
      for (const std::uint32_t i : states_[c]) {
        class_of_[i] = c;
        all_.kill[i] -= base;
      }
      base_.push_back(base);
      parts_.push_back(all_.restricted_to(states_[c], scratch));
    }
    solve_those_that_may_lead();
  }

  LeadingPair lead() const {
    std::vector<std::size_t> tied;
    for (std::size_t c = 0; c < pairs_.size(); ++c)
      if (pairs_[c] && beyond_lowest(c, pairs_[c]->rate) <= tolerance(pairs_[c]->rate)) tied.push_back(c);
    const std::size_t left = only(tied, true), right = only(tied, false);
    LeadingPair lead{spread(left, true), spread(right, false), lowest(), 0, 0};
    for (const auto& pair : pairs_)
      if (pair) lead.iterations += pair->iterations;
    lead.error = std::max(pairs_[left]->error, pairs_[right]->error);
    return lead;
  }

 private:
  Extended lowest() const { return base_[lowest_] + lowest_rate_; }
  /// Returns how far a rate of class c, without its base, lies above the lowest.
  Extended beyond_lowest(std::size_t c, Extended rate) const {
    return (base_[c] - base_[lowest_]) + (rate - lowest_rate_);
  }

  /// Returns what rounding leaves open of that: bases are exact.
  Extended tolerance(Extended rate) const { return rate_rounding * (rate + lowest_rate_); }

  /// The rate of a class lies between its least kill rate and its least rate of leaving a state.
  void solve_those_that_may_lead() {
    pairs_.resize(states_.size());
    std::vector<Extended> least;
    for (std::size_t c = 0; c < states_.size(); ++c) {
      const Generator& part = parts_[c];
      least.push_back(*std::min_element(part.kill.begin(), part.kill.end()));
      for (std::size_t i = 0; i < part.size(); ++i) {
        const Extended leaving = part.exit(i);
        if ((c == 0 && i == 0) || beyond_lowest(c, leaving) < 0) {
          lowest_ = c;
          lowest_rate_ = leaving;
        }
      }
    }
    std::vector<std::size_t> order(states_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return base_[a] + least[a] < base_[b] + least[b]; });
    for (const std::size_t c : order) {
      if (beyond_lowest(c, least[c]) > tolerance(least[c])) continue;
      pairs_[c] = pair_of_class(parts_[c], states_[c], base_[c], heard_);
      if (beyond_lowest(c, pairs_[c]->rate) > 0) continue;
      lowest_ = c;
      lowest_rate_ = pairs_[c]->rate;
    }
  }

  /// Marks the classes that class c leads to (or that lead to it), without itself.
  std::vector<std::uint8_t> beyond(std::size_t c, bool after) const {
    std::vector<std::uint8_t> marked(states_.size(), 0);
    const auto reach = [&](std::size_t from) {
      bool any = false;
      for (const std::uint32_t i : states_[from])
        for (std::size_t e = all_.start[i]; e < all_.start[i + 1]; ++e) {
          const std::size_t to = class_of_[all_.column[e]];
          if (to == from) continue;
          if (after) marked[to] = 1;
          any = any || marked[to] || to == c;
        }
      return any;
    };
    if (after) {
      reach(c);
      for (std::size_t d = c + 1; d < states_.size(); ++d)
        if (marked[d]) reach(d);
    } else {
      for (std::size_t d = c; d-- > 0;) marked[d] = reach(d);
    }
    return marked;
  }

  [[noreturn]] void refuse(std::uint32_t one, std::uint32_t other, bool equal) const {
    throw NotUnique(std::min(one, other), std::max(one, other), static_cast<double>(lowest()), equal);
  }

  /// Finds the one of the tied classes that leads to no other (or that no other leads to): only there does a vector of
  /// one sign begin (Frobenius; Schneider, Linear Algebra Appl. 84, 1986). Rates that are only nearly equal may as well
  /// differ, whichever leads to which.
  std::size_t only(const std::vector<std::size_t>& tied, bool after) const {
    for (const std::size_t c : tied) {
      const std::size_t other = c == tied.front() ? tied.back() : tied.front();
      if (tied.size() > 1 && (!pairs_[c]->exact || beyond_lowest(c, pairs_[c]->rate) != 0))
        refuse(states_[c].front(), states_[other].front(), false);
    }
    std::vector<std::size_t> ends;
    for (const std::size_t c : tied) {
      const std::vector<std::uint8_t> marked = tied.size() == 1 ? std::vector<std::uint8_t>() : beyond(c, after);
      if (std::none_of(tied.begin(), tied.end(), [&](std::size_t d) { return d != c && marked[d]; })) ends.push_back(c);
    }
    if (ends.size() > 1) refuse(states_[ends[0]].front(), states_[ends[1]].front(), true);
    return ends.front();
  }

  /// Continues the vector of class c through the classes after it (before it, for the right vector).
  Row spread(std::size_t c, bool left) const {
    Row vector(all_.size(), 0);
    for (std::size_t i = 0; i < states_[c].size(); ++i)
      vector[states_[c][i]] = left ? pairs_[c]->left[i] : pairs_[c]->right[i];
    Row arriving(all_.size(), 0);
    const auto push = [&](std::size_t from) {
      for (const std::uint32_t i : states_[from])
        for (std::size_t e = all_.start[i]; e < all_.start[i + 1]; ++e)
          if (class_of_[all_.column[e]] != from) arriving[all_.column[e]] += vector[i] * all_.rate[e];
    };
    const auto pull = [&](std::size_t to) {
      for (const std::uint32_t i : states_[to])
        for (std::size_t e = all_.start[i]; e < all_.start[i + 1]; ++e)
          if (class_of_[all_.column[e]] != to) arriving[i] += all_.rate[e] * vector[all_.column[e]];
    };
    if (left) {
      push(c);
      for (std::size_t d = c + 1; d < states_.size(); ++d)
        if (follow(d, arriving, true, vector)) push(d);
    } else {
      for (std::size_t d = c; d-- > 0;) {
        pull(d);
        follow(d, arriving, false, vector);
      }
    }
    const Extended scale = left ? total(vector) : *std::max_element(vector.begin(), vector.end());
    for (Extended& entry : vector) entry /= scale;
    return vector;
  }

  /// Solves y (G_d - rate) = arriving, or (G_d - rate) x = arriving, in class d; false where nothing arrives.
  bool follow(std::size_t d, const Row& arriving, bool left, Row& vector) const {
    const States& states = states_[d];
    Row rhs;
    for (const std::uint32_t i : states) rhs.push_back(arriving[i]);
    if (total(rhs) == 0) return false;
    Generator shifted = parts_[d];
    Row scale(states.size(), 1);
    if (pairs_[d]) {  // its own right vector makes all kill rates the distance of the rates
      scale = pairs_[d]->right;
      for (std::size_t i = 0; i < states.size(); ++i) {
        shifted.kill[i] = beyond_lowest(d, pairs_[d]->rate);
        for (std::size_t e = shifted.start[i]; e < shifted.start[i + 1]; ++e)
          shifted.rate[e] *= scale[shifted.column[e]] / scale[i];
      }
    } else {
      for (Extended& kill : shifted.kill) kill = beyond_lowest(d, kill);
    }
    for (std::size_t i = 0; i < rhs.size(); ++i) rhs[i] = left ? rhs[i] * scale[i] : rhs[i] / scale[i];
    GeneratorSolver solver(shifted, heard_);
    const Row solved = left ? solver.solve_left(rhs) : solver.solve(rhs);
    for (std::size_t i = 0; i < states.size(); ++i)
      vector[states[i]] = left ? solved[i] / scale[i] : solved[i] * scale[i];
    return true;
  }

  Heard heard_;
  Generator all_;  ///< without the bases
  std::vector<States> states_;
  std::vector<std::size_t> class_of_;
  std::vector<Extended> base_;
  std::vector<Generator> parts_;
  std::vector<std::optional<ClassPair>> pairs_;
  std::size_t lowest_ = 0;  ///< class of the lowest rate, which is this and its base
  Extended lowest_rate_ = 0;
};

}  // namespace

NotUnique::NotUnique(std::uint32_t one, std::uint32_t other, double rate, bool equal)
    : ConvergenceError(fmt::format(
          "the quasi-stationary distribution is not unique: survivors around state {} and survivors around state {} "
          "fade at {} ({:.9g}), and {}",
          one, other, equal ? "the same rate" : "rates that double precision does not tell apart", rate,
          equal ? "neither kind leads to the other" : "their shares depend on the difference")),
      one_(one),
      other_(other),
      rate_(rate),
      equal_(equal) {}

LeadingPair leading_pair(const Generator& generator, const Heard& heard) { return Classes(generator, heard).lead(); }

}  // namespace metastable::markov
