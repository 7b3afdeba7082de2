#include "markov/mesh/mesh_passage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

namespace metastable::markov {
namespace {

constexpr double still_distance = 1e-6;  // distance between distributions a revolution apart
constexpr int in_a_row = 3;

// The fate, in one revolution, of those alive at its beginning, as shares of them.
struct Revolution {
  std::vector<double> survival;                                 // after each phase
  double failures = 0, steps = 0;                               // if what leaves the mesh goes on as the others do
  double failures_lower = 0, alive_lower = 1, steps_lower = 0;  // if it fails at once
  std::vector<double> distribution, visits;  // of the survivors of each phase; of the steps that begin in each node
  bool extinct = false;                      // nobody survives
};

std::array<double, 2> total(const MassRows& rows, std::array<double, 2> own) {
  if (rows.add_up) rows.add_up(own);
  return own;
}

// Follows survivors over one revolution. @param x  their distribution, before and after @param y  of the same size
// @param turn  what becomes of them; its lists are used again
void revolve(const MassRows& rows, std::vector<double>& x, std::vector<double>& y, Revolution& turn) {
  const std::size_t n = x.size();
  turn.survival.clear();
  turn.failures = turn.steps = turn.failures_lower = turn.steps_lower = 0;
  turn.alive_lower = 1;
  turn.distribution.assign(n, 0.0);
  turn.visits.assign(n, 0.0);
  double here = 1;
  for (int phase = 0; phase < rows.phases; ++phase) {
    std::array<double, 2> lost{};
    for (std::size_t i = 0; i < n; ++i) {
      lost[0] += x[i] * rows.kill[i];
      lost[1] += x[i] * rows.leave[i];
      turn.distribution[i] += x[i];
      turn.visits[i] += here * x[i];
    }
    const auto [kill, leave] = total(rows, lost);
    turn.steps += here;
    turn.failures += here * kill;
    here *= 1 - kill;
    turn.steps_lower += turn.alive_lower;
    turn.failures_lower += turn.alive_lower * std::min(1.0, kill + leave);
    turn.alive_lower *= std::max(0.0, 1 - kill - leave);
    turn.survival.push_back(here);
    rows.apply_left(x, y);
    const double mass = total(rows, {std::accumulate(y.begin(), y.end(), 0.0), 0})[0];
    turn.extinct = !(mass > 0);
    if (turn.extinct) return;
    for (std::size_t i = 0; i < n; ++i) x[i] = y[i] / mass;
  }
}

// Returns the total variation between two distributions, as far as a process holds them.
double distance_of(const std::vector<double>& x, const std::vector<double>& before) {
  double moved = 0;
  for (std::size_t i = 0; i < x.size(); ++i) moved += 0.5 * std::abs(x[i] - before[i]);
  return moved;
}

// Returns in how many steps the distance from the quasi-stationary distribution falls by a factor of e; 0 where it does
// not fall. It falls by |lambda_2 / lambda_1| a step, oscillating: a line through the logarithms of its second half
// tells.
// @param distances  between distributions a revolution apart
double mixing_steps_of(const std::vector<double>& distances, int phases) {
  const std::size_t last = distances.size() - 1, first = last / 2;
  if (!(distances[last] > 0 && distances[first] > distances[last])) return 0;
  const double middle = 0.5 * static_cast<double>(first + last);
  double fall = 0, squares = 0;
  for (std::size_t k = first; k <= last; ++k) {
    fall -= (static_cast<double>(k) - middle) * std::log(distances[k]);
    squares += (static_cast<double>(k) - middle) * (static_cast<double>(k) - middle);
  }
  return fall > 0 ? static_cast<double>(phases) * squares / fall : 0;
}

}  // namespace

MeshPassage follow_survivors(const MassRows& rows, std::vector<double> x, double still_to_come, int most_products,
                             bool or_stop) {
  const std::size_t n = rows.kill.size();
  MeshPassage passage;
  double alive = 1, alive_lower = 1, steps_lower = 0, last_failures = 0;
  std::vector<double> y(n), before, distances;
  Revolution turn;
  int settled = 0;
  passage.visits.assign(n, 0.0);
  const auto visit = [&](double times) {
    for (std::size_t i = 0; i < n; ++i) passage.visits[i] += times * turn.visits[i];
  };
  while (settled < in_a_row) {
    if (passage.products >= most_products && !or_stop)
      throw ConvergenceError("mesh", last_failures,
                             "survivors still change after " + std::to_string(most_products) + " products");
    before = x;
    revolve(rows, x, y, turn);
    passage.products += static_cast<int>(turn.survival.size());
    for (const double share : turn.survival) passage.survival.push_back(alive * share);
    if (turn.extinct) {
      passage.steps += alive * turn.steps;
      passage.steps_lower = steps_lower + alive_lower * turn.steps_lower;
      passage.failure_rate = 1;
      visit(alive);
      passage.distribution = std::move(turn.distribution);
      return passage;
    }
    distances.push_back(total(rows, {distance_of(x, before), 0})[0]);
    // Changes fall as distances do: what is to come is the last one times the revolutions that mixing takes.
    const double to_come =
        std::abs(turn.failures - last_failures) * std::max(1.0, mixing_steps_of(distances, rows.phases) / rows.phases);
    const bool still = to_come <= still_to_come * turn.failures && distances.back() <= still_distance;
    settled = still ? settled + 1 : 0;
    if (or_stop && passage.products >= most_products && settled < in_a_row) {
      passage.settled = false;
      settled = in_a_row;
    }
    last_failures = turn.failures;
    if (settled == in_a_row) {
      passage.steps += alive * turn.steps / turn.failures;
      passage.steps_lower = steps_lower + alive_lower * turn.steps_lower / turn.failures_lower;
      passage.failure_rate = rows.phases == 1 ? turn.failures : -std::expm1(std::log1p(-turn.failures) / rows.phases);
      passage.distribution = std::move(turn.distribution);
      visit(alive / turn.failures);
    } else {
      visit(alive);
      passage.steps += alive * turn.steps;
      steps_lower += alive_lower * turn.steps_lower;
      alive *= turn.survival.back();
      alive_lower *= turn.alive_lower;
    }
  }
  passage.mixing_steps = mixing_steps_of(distances, rows.phases);
  return passage;
}

MeshPassage mesh_passage(const Mesh& mesh, std::span<const double> start, double still_to_come, int most_products,
                         bool or_stop, int revolutions) {
  std::vector<double> x(mesh.size(), 0.0);
  const Mesh::Corners corners = mesh.corners(0, start);
  for (int c = 0; c < corners.count; ++c)
    x[corners.node[static_cast<std::size_t>(c)]] += corners.weight[static_cast<std::size_t>(c)];
  MeshPassage passage = follow_survivors(
      {mesh.phases() * revolutions, mesh.kill(), mesh.leave(), [&](auto from, auto to) { mesh.apply_left(from, to); }},
      std::move(x), still_to_come, most_products, or_stop);
  for (double& share : passage.distribution) share /= revolutions;
  return passage;
}

std::vector<std::vector<double>> failure_in_step(const Mesh& mesh, int window) {
  std::vector<std::vector<double>> u{{mesh.kill().begin(), mesh.kill().end()}};
  for (int n = 1; n <= window; ++n) {
    u.emplace_back(mesh.size());
    mesh.apply(u[u.size() - 2], u.back());
  }
  return u;
}

}  // namespace metastable::markov
