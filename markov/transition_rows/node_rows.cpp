#include "markov/transition_rows/node_rows.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "markov/chain/elimination.h"
#include "markov/chain/solver.h"
#include "markov/parallel.h"
#include "markov/passage/quasi_stationary.h"

namespace metastable::markov {
namespace {

constexpr double score_step = 0.5;  // of the coarsest trapezoidal rule
constexpr int score_steps = 13;     // on each side: 8e-11 of the launches are beyond

}  // namespace

std::vector<LaunchPoint> launch_points(const LaunchState& launch, std::span<const double> states, int halvings) {
  if (launch.state(-1) == launch.state(1)) return {{0, 1}};
  std::vector<LaunchPoint> rule;
  constexpr double furthest = score_step * score_steps;
  const auto inside = [&](double kink) { return launch.state(-furthest) < kink && kink < launch.state(furthest); };
  if (std::none_of(states.begin(), states.end(), inside)) {
    const int steps = score_steps << halvings;
    for (int k = -steps; k <= steps; ++k) rule.push_back({k * furthest / steps, 1});
  } else {
    std::vector<double> cuts{-furthest};
    for (const double kink : states) {
      double low = -furthest, high = furthest;
      if (!inside(kink)) continue;
      for (int i = 0; i < 60; ++i) (launch.state(0.5 * (low + high)) < kink ? low : high) = 0.5 * (low + high);
      cuts.push_back(low);
    }
    cuts.push_back(furthest);
    for (std::size_t i = 1; i < cuts.size(); ++i) {
      const int panels = (1 + static_cast<int>((cuts[i] - cuts[i - 1]) / 4)) << halvings;
      for (int p = 0; p < panels; ++p)
        for (std::size_t k = 0; k < NodeSpace::order; ++k) {
          const double share = (p + 0.5 + 0.5 * gauss_abscissa(k)) / panels;
          // Both ends go by the squared sine: rows may have square roots there.
          const double s = std::sin(std::numbers::pi / 2 * share);
          rule.push_back({cuts[i - 1] + (cuts[i] - cuts[i - 1]) * s * s,
                          gauss_weight(k) * (cuts[i] - cuts[i - 1]) / panels * std::sin(std::numbers::pi * share)});
        }
    }
  }
  double total = 0;
  for (LaunchPoint& r : rule) total += r.weight *= std::exp(-0.5 * r.score * r.score);
  for (LaunchPoint& r : rule) r.weight /= total;
  return rule;
}

std::vector<double> survivors_or_visits(const Chain& chain, std::span<const double> after) {
  const ChainSolver solver(chain);
  try {
    return shares_in_classes(solver.period(), quasi_stationary(solver, FewSurvivors::unsettled).distribution);
  } catch (const RestTooRare&) {
    throw;
  } catch (const ConvergenceError&) {
    std::vector<double> visits = solver.solve_left(after);
    const double all = std::accumulate(visits.begin(), visits.end(), 0.0);
    for (double& share : visits) share /= all;
    return visits;
  }
}

Launch launch_of_rows(const MakeNodeRow& make_row, const NodeSpace& space, const LaunchState& launch,
                      std::span<const double> kinks, int halvings, int threads) {
  const std::size_t base = static_cast<std::size_t>((launch.phase + 1) % space.phases()) * space.nodes();
  const std::vector<LaunchPoint> rule = launch_points(launch, kinks, halvings);
  std::vector<NodeRow> rows(rule.size());
  parallel_for(rule.size(), threads,
               [&](std::size_t k) { rows[k] = make_row(launch.state(rule[k].score), launch.phase); });
  Launch result;
  result.after.assign(space.size(), 0.0);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    result.rest += rule[k].weight * rows[k].rest;
    for (std::size_t j = 0; j < space.nodes(); ++j) result.after[base + j] += rule[k].weight * rows[k].landing[j];
  }
  const double after = std::accumulate(result.after.begin(), result.after.end(), 0.0);
  if (after > 0)
    for (double& p : result.after) p *= (1 - result.rest) / after;
  return result;
}

IntegratedChain chain_of_rows(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch,
                              const MakeNodeRow& make_row, bool interpolated, std::span<const double> kinks,
                              int threads) {
  const std::size_t n = space.nodes();
  std::vector<NodeRow> rows(space.size());
  parallel_for(space.size(), threads, [&](std::size_t i) { rows[i] = make_row(space.node(i), space.phase(i)); });
  IntegratedChain result;
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  for (std::size_t i = 0; i < space.size(); ++i) {
    const std::size_t base = static_cast<std::size_t>((space.phase(i) + 1) % space.phases()) * n;
    for (std::size_t j = 0; j < n; ++j) {
      if (base + j == i || rows[i].landing[j] == 0) continue;
      column.push_back(static_cast<std::uint32_t>(base + j));
      value.push_back(rows[i].landing[j]);
    }
    row_start.push_back(value.size());
    kill.push_back(rows[i].rest);
    result.row_error = std::max(result.row_error, rows[i].error);
    std::vector<double>().swap(rows[i].landing);
  }
  // Rows that are not scaled hold few survivors; their sum may exceed 1 by the quadrature's error of those.
  result.chain.chain =
      interpolated ? Chain::interpolated(std::move(row_start), std::move(column), std::move(value), std::move(kill))
                   : Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill), 1.0);
  result.chain.launch = launch_of_rows(make_row, space, launch, kinks, 0, threads);
  result.chain.launch.interpolated = interpolated;
  const auto before = [&](std::size_t i) { return (space.phase(i) + space.phases() - 1) % space.phases(); };
  if (map.duration(space.node(0), before(0)))
    for (std::size_t i = 0; i < space.size(); ++i)
      result.chain.duration.push_back(*map.duration(space.node(i), before(i)));
  if (map.advance(0))
    for (std::size_t i = 0; i < space.size(); ++i) result.chain.advance.push_back(*map.advance(before(i)));
  return result;
}

}  // namespace metastable::markov
