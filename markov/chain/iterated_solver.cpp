#include "markov/chain/iterated_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;
using Side = FlowNetwork::Side;
using Grouping = FlowNetwork::Grouping;

constexpr Extended rounding = std::numeric_limits<Extended>::epsilon();
constexpr std::size_t most_directions = 30;
constexpr int most_rounds = 30;              // of directions
constexpr Extended round_gain = 1e-10L;      // after which a residual is taken anew
constexpr Extended round_needs = 0.5L;       // a round that leaves more than this of the residual has stopped
constexpr Extended exact = 1e-17L;           // residual, of the right side
constexpr Extended rounded = 16 * rounding;  // residual, of the solution: rounding
constexpr int first_sweeps = 20;             // of visits, from an even start
constexpr int most_balances = 60;
constexpr Extended rough_balance = 1e-3L,
                   fine_balance = 1e-9L;      // wanted of one correction, before and after a per cent
constexpr Extended balanced = 20 * rounding;  // difference between what enters and leaves a state, of the latter
constexpr Extended nearly_balanced = 1e-15L;  // which must be reached
constexpr Extended least_factor = 0.05L;      // by which visits change at once

Extended all_of(std::span<const Extended> v) { return std::accumulate(v.begin(), v.end(), Extended{0}); }

Extended dot(std::span<const Extended> a, std::span<const Extended> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), Extended{0});
}

void add(Row& to, Extended weight, const Row& what) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += weight * what[i];
}

/// Takes the mean off, each state counted by what leaves it.
void center(Row& x, std::span<const Extended> total) {
  const Extended mean = dot(x, total) / all_of(total);
  for (Extended& entry : x) entry -= mean;
}

/// Residuals are measured by what leaves the state.
Row scaled(Row residual, std::span<const Extended> total) {
  for (std::size_t i = 0; i < residual.size(); ++i) residual[i] /= total[i];
  return residual;
}

/// Lowers a residual by `gain`, in up to most_directions directions. Returns what to add to the solution.
template <typename Apply, typename Correct>
Row descended(Row residual, std::span<const Extended> total, Extended gain, const Apply& apply, const Correct& correct,
              const Heard& heard) {
  Row step(residual.size(), 0);
  std::vector<Row> directions, images;  // images are orthonormal once scaled, and kept so
  Row rest = scaled(residual, total);
  const Extended first = std::sqrt(dot(rest, rest));
  while (directions.size() < most_directions) {
    if (heard) heard();
    Row direction = correct(residual);
    center(direction, total);
    Row image = scaled(apply(direction), total);
    for (std::size_t k = 0; k < images.size(); ++k) {
      const Extended share = dot(image, images[k]);
      add(image, -share, images[k]);
      add(direction, -share, directions[k]);
    }
    const Extended length = std::sqrt(dot(image, image));
    if (!(length > 0) || !std::isfinite(length)) break;
    for (Extended& entry : image) entry /= length;
    for (Extended& entry : direction) entry /= length;
    const Extended along = dot(rest, image);
    add(step, along, direction);
    add(rest, -along, image);
    for (std::size_t i = 0; i < rest.size(); ++i) residual[i] = rest[i] * total[i];
    directions.push_back(std::move(direction));
    images.push_back(std::move(image));
    if (std::sqrt(dot(rest, rest)) <= gain * first) break;
  }
  return step;
}

/// Visits after some sweeps from those given.
Row swept(const Generator& generator, std::span<const Extended> start) {
  const std::size_t n = generator.size();
  Row leaving(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e) leaving[i] += generator.rate[e];
  Row visits(start.begin(), start.end());
  if (!visits.empty()) return visits;
  visits.resize(n);
  for (std::size_t i = 0; i < n; ++i) visits[i] = 1 / leaving[i];
  for (int sweep = 0; sweep < first_sweeps; ++sweep) {
    Row next(n, 0);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e)
        next[generator.column[e]] += visits[i] * generator.rate[e];
    // The mean with what there was: a chain that goes round in circles settles as well.
    for (std::size_t i = 0; i < n; ++i) visits[i] = (visits[i] + next[i] / leaving[i]) / 2;
  }
  return visits;
}

/// Finds the visits of an irreducible generator, its kill rates left out. Each correction solves A^T (1 + d) = 0, in
/// which all columns of A sum to zero whatever the visits are.
Row balanced_visits(const Generator& generator, std::span<const Extended> start, Grouping& grouping,
                    const Heard& heard) {
  Row visits = swept(generator, start), best;
  Extended least = std::numeric_limits<Extended>::infinity();
  for (int balance = 0; balance < most_balances; ++balance) {
    if (heard) heard();
    if (balance == most_balances / 2) grouping = Grouping::strongest;
    const FlowNetwork network(generator, visits, true, grouping);
    const auto total = network.total();
    Row surplus = network.arriving();
    Extended largest = 0;
    for (std::size_t i = 0; i < surplus.size(); ++i) {
      surplus[i] -= total[i];
      largest = std::max(largest, std::abs(surplus[i]) / total[i]);
    }
    const bool stands = !(largest < least / 2);
    if (largest < least) {
      least = largest;
      best = visits;
    }
    if (least <= balanced || (stands && least <= nearly_balanced)) break;
    const Row change = descended(
        surplus, total, largest > 0.01L ? rough_balance : fine_balance,
        [&](const Row& x) { return network.apply_unbalanced(x); },
        [&](const Row& r) { return network.corrected(r, Side::into); }, heard);
    for (std::size_t i = 0; i < visits.size(); ++i)
      visits[i] *= std::clamp(1 + change[i], least_factor, 1 / least_factor);
    const Extended all = all_of(visits);
    for (Extended& entry : visits) entry /= all;
  }
  if (!(least <= nearly_balanced))
    throw ConvergenceError("balance of visits", static_cast<double>(least),
                           "states of this chain change places too slowly for iteration");
  const Extended all = all_of(best);
  for (Extended& entry : best) entry /= all;
  return best;
}

}  // namespace

IteratedSolver::IteratedSolver(Generator generator, std::span<const Extended> start, Heard heard)
    : generator_(std::move(generator)), heard_(std::move(heard)) {
  visits_ = balanced_visits(generator_, start, grouping_, heard_);
}

const FlowNetwork& IteratedSolver::network(Grouping grouping) {
  if (!network_ || grouping != grouping_)
    network_ = std::make_unique<FlowNetwork>(generator_, visits_, false, grouping);
  grouping_ = grouping;
  return *network_;
}

/// Iterates on A u - l (l u) / sum l = g - l (sum g) / sum l, both sides of which sum to zero; constants solve it with
/// 0.
IteratedSolver::Solution IteratedSolver::solved(Row right, Side side) {
  const FlowNetwork* flows = &network(grouping_);
  const Row loss(flows->loss().begin(), flows->loss().end()), total(flows->total().begin(), flows->total().end());
  const Extended lost = all_of(loss);
  if (!(lost > 0)) throw std::domain_error("iterated solver: a chain that is never left");
  const Extended given = all_of(right);
  add(right, -given / lost, loss);
  const auto apply = [&](const Row& x) {
    Row image = flows->apply(x, side);
    add(image, -dot(loss, x) / lost, loss);
    return image;
  };
  const auto correct = [&](const Row& residual) { return flows->corrected(residual, side); };
  const auto norm = [&](const Row& residual) {
    const Row relative = scaled(residual, total);
    return std::sqrt(dot(relative, relative));
  };
  Row rest(right.size(), 0), residual = right;
  const Extended first = norm(residual);
  Extended now = first;
  const auto done = [&] { return now <= exact * first + rounded * std::sqrt(dot(rest, rest)); };
  for (int round = 0; round < most_rounds && !done(); ++round) {
    Row tried = rest;
    add(tried, 1, descended(residual, total, round_gain, apply, correct, heard_));
    Row left = right;
    add(left, -1, apply(tried));
    const Extended before = now, after = norm(left);
    if (after < now) {
      rest = std::move(tried);
      residual = std::move(left);
      now = after;
    }
    if (after < round_needs * before) continue;
    if (grouping_ == Grouping::strongest) break;
    flows = &network(Grouping::strongest);
  }
  return {(given - dot(loss, rest)) / lost, std::move(rest)};
}

IteratedSolver::Solution IteratedSolver::solve(std::span<const Extended> rhs) {
  Row right(rhs.begin(), rhs.end());
  for (std::size_t i = 0; i < right.size(); ++i) right[i] *= visits_[i];
  return solved(std::move(right), Side::from);
}

Row IteratedSolver::solve_left(std::span<const Extended> rhs) {
  Solution solution = solved(Row(rhs.begin(), rhs.end()), Side::into);
  for (std::size_t i = 0; i < solution.rest.size(); ++i)
    solution.rest[i] = visits_[i] * (solution.base + solution.rest[i]);
  return std::move(solution.rest);
}

}  // namespace metastable::markov
