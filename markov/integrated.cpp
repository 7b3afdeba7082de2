#include "markov/integrated.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "markov/parallel.h"
#include "markov/quasi_stationary.h"
#include "markov/solver.h"

namespace metastable::markov {
namespace {

// Trapezoidal rule over the launch's score: exact to rounding for densities wider than a third of the launch's spread.
constexpr double score_step = 0.5;
constexpr int score_steps = 17;         // on each side
constexpr double most_above = 1e-13;    // survivors beyond the upper edge
constexpr double most_launched = 1e-9;  // landings of the launch beyond it
constexpr std::size_t most_pilot_panels = 64;
constexpr double least_scaled = 1e-6;  // survivors of a row whose total is worth correcting

struct Row {
  std::vector<double> landing;  // on the nodes of the next phase
  double rest = 0;
  double error = 0;
};

Row make_row(const AnyReturnMap& map, const NodeSpace& space, double state, int phase) {
  const int next = (phase + 1) % space.phases();
  const auto weights = space.weights(next);
  Row row;
  row.landing.resize(space.nodes());
  const std::optional<double> rest = map.landing_density(state, phase, space.nodes(next), row.landing);
  if (!rest)
    throw std::invalid_argument(
        "method integrated: the map does not tell its landing's density; use the sampled method");
  row.rest = *rest;
  double sum = 0;
  for (std::size_t j = 0; j < row.landing.size(); ++j) sum += row.landing[j] *= weights[j];
  if (!std::isfinite(sum))
    throw ConvergenceError("integrated rows", sum,
                           "a density of the landing from state " + std::to_string(state) + " is not finite");
  const double survivors = 1 - row.rest;
  row.error = std::abs(sum - survivors);
  if (survivors > least_scaled && sum > 0.1 * survivors)
    for (double& p : row.landing) p *= survivors / sum;
  return row;
}

Launch launch_by_quadrature(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads) {
  std::vector<std::pair<double, double>> rule;  // score, weight
  if (launch.state(-1) == launch.state(1)) {
    rule.emplace_back(0, 1);
  } else {
    double total = 0;
    for (int k = -score_steps; k <= score_steps; ++k) {
      const double score = k * score_step;
      total += rule.emplace_back(score, std::exp(-0.5 * score * score)).second;
    }
    for (auto& [score, weight] : rule) weight /= total;
  }
  std::vector<Row> rows(rule.size());
  parallel_for(rule.size(), threads,
               [&](std::size_t k) { rows[k] = make_row(map, space, launch.state(rule[k].first), launch.phase); });
  Launch result;
  result.after.assign(space.size(), 0.0);
  const std::size_t base = static_cast<std::size_t>((launch.phase + 1) % space.phases()) * space.nodes();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    result.rest += rule[k].second * rows[k].rest;
    for (std::size_t j = 0; j < space.nodes(); ++j) result.after[base + j] += rule[k].second * rows[k].landing[j];
  }
  const double after = std::accumulate(result.after.begin(), result.after.end(), 0.0);
  if (after > 0)
    for (double& p : result.after) p *= (1 - result.rest) / after;
  return result;
}

}  // namespace

NodeSpace::NodeSpace(std::vector<std::pair<double, double>> range, std::size_t panels)
    : range_(std::move(range)), panels_(panels) {
  using Rule = boost::math::quadrature::gauss<double, order>;
  if (range_.empty() || panels == 0) throw std::invalid_argument("nodes: at least one phase and one panel are needed");
  for (const auto& [lower, upper] : range_) {
    if (!(lower < upper) || !std::isfinite(lower) || !std::isfinite(upper))
      throw std::invalid_argument("nodes: a range is not a finite interval");
    const auto edge = [&, from = lower, length = upper - lower](std::size_t p) {
      const double share = static_cast<double>(p) / static_cast<double>(panels);
      return from + length * share * share;
    };
    for (std::size_t p = 0; p < panels; ++p) {
      const double half = 0.5 * (edge(p + 1) - edge(p)), middle = 0.5 * (edge(p + 1) + edge(p));
      for (std::size_t k = 0; k < order; ++k) {  // Boost holds the upper half of an even rule, ascending
        const bool below = k < order / 2;
        const std::size_t at = below ? order / 2 - 1 - k : k - order / 2;
        node_.push_back(middle + (below ? -half : half) * Rule::abscissa()[at]);
        weight_.push_back(half * Rule::weights()[at]);
      }
    }
  }
}

std::span<const double> NodeSpace::nodes(int phase) const {
  return std::span(node_).subspan(static_cast<std::size_t>(phase) * nodes(), nodes());
}

std::span<const double> NodeSpace::weights(int phase) const {
  return std::span(weight_).subspan(static_cast<std::size_t>(phase) * nodes(), nodes());
}

StateSpace NodeSpace::cells() const {
  std::vector<Grid> grids;
  for (int p = 0; p < phases(); ++p) {
    const auto& [lower, upper] = range_[static_cast<std::size_t>(p)];
    std::vector<double> edges{lower};
    double inside = 0;
    for (std::size_t j = 0; j < nodes(); ++j) {
      inside += weights(p)[j];
      edges.push_back(lower + inside);
    }
    edges.back() = upper;
    grids.emplace_back(std::move(edges));
  }
  return StateSpace(std::move(grids));
}

IntegratedChain integrate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads) {
  const std::size_t n = space.nodes();
  std::vector<Row> rows(space.size());
  parallel_for(space.size(), threads,
               [&](std::size_t i) { rows[i] = make_row(map, space, space.node(i), space.phase(i)); });
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
  result.chain.chain = Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill), 1.0);
  result.chain.launch = launch_by_quadrature(map, space, launch, threads);
  const auto before = [&](std::size_t i) { return (space.phase(i) + space.phases() - 1) % space.phases(); };
  if (map.duration(space.node(0), before(0)))
    for (std::size_t i = 0; i < space.size(); ++i)
      result.chain.duration.push_back(*map.duration(space.node(i), before(i)));
  if (map.advance(0))
    for (std::size_t i = 0; i < space.size(); ++i) result.chain.advance.push_back(*map.advance(before(i)));
  return result;
}

Launch integrated_row(const AnyReturnMap& map, const NodeSpace& space, double state, int phase) {
  return launch_by_quadrature(map, space, {[state](double) { return state; }, phase}, 1);
}

std::vector<std::pair<double, double>> node_ranges(const AnyReturnMap& map, const LaunchState& launch, int threads) {
  double lower = 0, highest = 0;
  for (int p = 0; p < map.phases(); ++p) {
    const auto [least, most] = map.state_interval(p);
    lower = p == 0 ? least : std::min(lower, least);
    highest = std::max(highest, most);
  }
  // One upper edge for all phases: what the launch leaves high up at one phase comes by at the next.
  const auto ranges = [&](double upper) {
    std::vector<std::pair<double, double>> all;
    for (int p = 0; p < map.phases(); ++p) all.emplace_back(map.state_interval(p).first, upper);
    return all;
  };
  const double launched = launch.state(3), length = std::max({launched - lower, 0.1 * std::abs(launched), 1e-3});
  double upper = std::min(highest, lower + 1.2 * length);
  for (std::size_t panels = map.phases() > 1 ? 1 : 2;;) {
    const NodeSpace space(ranges(upper), panels);
    const IntegratedChain pilot = integrate(map, space, launch, threads);
    const Reachability reachable = classify(pilot.chain.chain);
    const bool rests =
        std::find(reachable.must_rest.begin(), reachable.must_rest.end(), 0) == reachable.must_rest.end();
    if ((!rests || pilot.row_error > 0.5) && panels < most_pilot_panels) {
      panels *= 2;
      continue;
    }
    if (!rests) return {};
    const std::vector<double> quasi = quasi_stationary(ChainSolver(pilot.chain.chain)).distribution;
    // The lowest node that has at most the shares wanted at it and above it, at every phase.
    std::size_t first = 0;
    for (int p = 0; p < space.phases(); ++p) {
      const std::size_t base = static_cast<std::size_t>(p) * space.nodes();
      double above = 0, after = 0;
      std::size_t k = space.nodes();
      while (k > 0 && above + quasi[base + k - 1] <= most_above &&
             after + pilot.chain.launch.after[base + k - 1] <= most_launched) {
        --k;
        above += quasi[base + k];
        after += pilot.chain.launch.after[base + k];
      }
      first = std::max(first, k);
    }
    if (first == space.nodes() && upper < highest) {
      upper = std::min(highest, lower + 1.5 * (upper - lower));
      if (!std::isfinite(upper)) throw std::invalid_argument("method integrated: states grow without limit");
      continue;
    }
    if (first < space.nodes())
      upper =
          std::max(space.node(first), space.node(first + static_cast<std::size_t>(space.phases() - 1) * space.nodes()));
    return ranges(upper);
  }
}

}  // namespace metastable::markov
