#include "markov/mesh/mesh_passage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

namespace metastable::markov {
namespace {

constexpr double kStill = 1e-6;  // distance between distributions a revolution apart
constexpr int kInARow = 3;

}  // namespace

MeshPassage follow_survivors(const MassRows& rows, std::vector<double> x, double settled_change, int most_products,
                             bool or_stop) {
  const std::size_t n = rows.kill.size();
  const int phases = rows.phases;
  std::vector<double> y(n), before;
  const auto total = [&](std::array<double, 2> own) {
    if (rows.add_up) rows.add_up(own);
    return own;
  };
  MeshPassage passage;
  double alive = 1, alive_lower = 1, steps_lower = 0, last_failures = 0;
  std::vector<double> distances;
  int settled = 0;
  passage.visits.assign(n, 0.0);
  std::vector<double> met(n);
  const auto visit = [&](double times) {
    for (std::size_t i = 0; i < n; ++i) passage.visits[i] += times * met[i];
  };
  while (settled < kInARow) {
    if (passage.products >= most_products && !or_stop)
      throw ConvergenceError("mesh", last_failures,
                             "survivors still change after " + std::to_string(most_products) + " products");
    // Of those alive at the beginning of a revolution this finds which fail in it, and how many steps they take.
    before = x;
    std::fill(met.begin(), met.end(), 0.0);
    double here = 1, failures = 0, taken = 0, here_lower = 1, failures_lower = 0, taken_lower = 0;
    std::vector<double> distribution(n, 0.0);
    for (int phase = 0; phase < phases; ++phase) {
      std::array<double, 2> lost{};
      for (std::size_t i = 0; i < n; ++i) {
        lost[0] += x[i] * rows.kill[i];
        lost[1] += x[i] * rows.leave[i];
        distribution[i] += x[i];
        met[i] += here * x[i];
      }
      const auto [kill, leave] = total(lost);
      taken += here;
      failures += here * kill;
      here *= 1 - kill;
      taken_lower += here_lower;
      failures_lower += here_lower * std::min(1.0, kill + leave);
      here_lower *= std::max(0.0, 1 - kill - leave);
      passage.survival.push_back(alive * here);
      rows.apply_left(x, y);
      ++passage.products;
      const double mass = total({std::accumulate(y.begin(), y.end(), 0.0), 0})[0];
      if (!(mass > 0)) {  // nobody survives
        passage.steps = passage.steps_upper = passage.steps + alive * taken;
        passage.steps_lower = steps_lower + alive_lower * taken_lower;
        passage.failure_rate = 1;
        visit(alive);
        passage.distribution = std::move(distribution);
        return passage;
      }
      for (std::size_t i = 0; i < n; ++i) x[i] = y[i] / mass;
    }
    double moved = 0;
    for (std::size_t i = 0; i < n; ++i) moved += 0.5 * std::abs(x[i] - before[i]);
    const double distance = total({moved, 0})[0];
    distances.push_back(distance);
    const bool still = std::abs(failures - last_failures) <= settled_change * failures && distance <= kStill;
    settled = still ? settled + 1 : 0;
    if (or_stop && passage.products >= most_products) settled = kInARow;
    last_failures = failures;
    if (settled == kInARow) {
      passage.steps_upper = passage.steps + alive * taken / failures;
      passage.steps_lower = steps_lower + alive_lower * taken_lower / failures_lower;
      passage.steps = std::sqrt(passage.steps_upper * passage.steps_lower);
      passage.failure_rate = phases == 1 ? failures : -std::expm1(std::log1p(-failures) / phases);
      passage.distribution = std::move(distribution);
      visit(alive / failures);
    } else {
      visit(alive);
      passage.steps += alive * taken;
      steps_lower += alive_lower * taken_lower;
      alive *= here;
      alive_lower *= here_lower;
    }
  }
  // The distance falls by |lambda_2 / lambda_1| a step, oscillating: its decline over the second half tells.
  const std::size_t last = distances.size() - 1, first = last / 2;
  if (distances[last] > 0 && distances[first] > distances[last])
    passage.mixing_steps = static_cast<double>((last - first) * static_cast<std::size_t>(phases)) /
                           std::log(distances[first] / distances[last]);
  return passage;
}

MeshPassage mesh_passage(const Mesh& mesh, std::span<const double> start, double settled_change, int most_products,
                         bool or_stop) {
  std::vector<double> x(mesh.size(), 0.0);
  const Mesh::Corners corners = mesh.corners(0, start);
  for (int c = 0; c < corners.count; ++c)
    x[corners.node[static_cast<std::size_t>(c)]] += corners.weight[static_cast<std::size_t>(c)];
  return follow_survivors(
      {mesh.phases(), mesh.kill(), mesh.leave(), [&](auto from, auto to) { mesh.apply_left(from, to); }}, std::move(x),
      settled_change, most_products, or_stop);
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
