#include "markov/transition_rows/collocation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "markov/parallel.h"

namespace metastable::markov {
namespace {

constexpr double least_scaled = 1e-6;     // survivors of a row whose total is worth correcting
constexpr double least_panel = 1e-7;      // between two edges, of the range
constexpr double most_above = 1e-13;      // survivors beyond the upper edge
constexpr double few_lower = 1.5;         // lowest states that the first try covers above the lowest one
constexpr double most_launched = 1e-9;    // landings of the launch beyond it
constexpr std::size_t cells = 64;         // of a phase, to find it
constexpr std::size_t few_points = 4000;  // of a row
constexpr std::size_t lanes = 8;          // landings worked on together
constexpr std::size_t few_edges = 12, many_edges = 24;
constexpr int most_generations = 8;         // of cheap rows
constexpr int noise_free_generations = 24;  // of maps whose expected steps are a staircase, a step at each
constexpr double edge_ratio = 4;            // beyond the bulk
constexpr const char* no_points =
    "method integrated: the map does not tell its landing's distribution; use the sampled method";

// Finds the expectations of the polynomials that are 1 at one node and 0 at the others of its panel: from moments of
// the Legendre polynomials.
NodeRow make_row(const AnyReturnMap& map, const NodeSpace& space, double state, int phase) {
  static const std::array<Legendre, NodeSpace::order> at_nodes = [] {
    std::array<Legendre, NodeSpace::order> all;
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = legendre(gauss_abscissa(k));
    return all;
  }();
  const int next = (phase + 1) % space.phases();
  std::vector<std::pair<double, double>> points;
  const std::optional<double> rest = map.landing_points(state, phase, space.edges(next), points);
  if (!rest) throw std::invalid_argument(no_points);
  std::vector<Legendre> moments(space.panels(), Legendre{});
  double sum = 0;
  std::array<double, lanes> place{};
  std::array<std::size_t, lanes> panel{};
  std::array<Legendre, lanes> p;
  for (std::size_t first = 0; first < points.size(); first += lanes) {
    const std::size_t count = std::min(lanes, points.size() - first);
    for (std::size_t l = 0; l < count; ++l) std::tie(panel[l], place[l]) = space.locate(next, points[first + l].first);
    legendre<lanes>(place.data(), p.data());
    for (std::size_t l = 0; l < count; ++l) {
      const double weight = points[first + l].second;
      for (std::size_t n = 0; n < p[l].size(); ++n) moments[panel[l]][n] += weight * p[l][n];
      sum += weight;
    }
  }
  if (!std::isfinite(sum))
    throw ConvergenceError("integrated rows", sum, "a landing from state " + std::to_string(state) + " is not finite");
  NodeRow row;
  row.rest = *rest;
  row.error = std::abs(sum + row.rest - 1);
  const double survivors = 1 - row.rest,
               scale = survivors > least_scaled && sum > 0.1 * survivors ? survivors / sum : 1;
  row.landing.reserve(space.nodes());
  for (const Legendre& m : moments)
    for (std::size_t k = 0; k < NodeSpace::order; ++k) {
      double value = 0;
      for (std::size_t n = 0; n < m.size(); ++n) value += (static_cast<double>(n) + 0.5) * m[n] * at_nodes[k][n];
      row.landing.push_back(scale * gauss_weight(k) * value);
    }
  return row;
}

// Counts the points that a row is made of. Of few of them, many do not matter; a map without noise has one.
std::size_t points_of_a_row(const AnyReturnMap& map) {
  std::vector<std::pair<double, double>> points;
  map.landing_points(map.state_interval(0).first + 1, 0, {}, points);
  return points.size();
}

bool cheap(const AnyReturnMap& map) { return points_of_a_row(map) < few_points; }

MakeNodeRow rows(const AnyReturnMap& map, const NodeSpace& space) {
  return [&](double state, int phase) { return make_row(map, space, state, phase); };
}

// Finds the states of a launch from which extreme landings meet an edge: rows have kinks there.
std::vector<double> launch_kinks(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch) {
  const std::span<const double> met = space.edges((launch.phase + 1) % space.phases());
  return map.states_of_extremes(launch.phase, cheap(map) ? met.first(met.size() - 1) : met.first(1));
}

// Coarse cells of every phase, to find how far states go: equal, or as far apart as nodes where there is a bulk.
class CoarseCells {
 public:
  CoarseCells(const AnyReturnMap& map, std::vector<std::pair<double, double>> ranges, double bulk)
      : map_(map), ranges_(std::move(ranges)), bulk_(bulk), inner_edges_(ranges_.size()) {
    for (std::size_t p = 0; p < phases(); ++p)
      for (std::size_t c = 1; c < cells; ++c) inner_edges_[p].push_back(edge(p, c));
  }
  std::size_t phases() const { return ranges_.size(); }
  double edge(std::size_t phase, std::size_t cell) const {
    const auto [from, to] = ranges_[phase];
    const double share = static_cast<double>(cell) / cells;
    return std::isfinite(bulk_) ? graded_edge(ranges_[phase], bulk_, share) : from + (to - from) * share;
  }
  double middle(std::size_t phase, std::size_t cell) const { return 0.5 * (edge(phase, cell) + edge(phase, cell + 1)); }
  // Says in which cells of the next phase a state lands.
  NodeRow row(double state, int phase) const {
    const std::vector<double>& above = inner_edges_[(static_cast<std::size_t>(phase) + 1) % phases()];
    NodeRow result;
    result.landing.assign(cells, 0.0);
    std::vector<std::pair<double, double>> points;
    const std::optional<double> rest = map_.landing_points(state, phase, {}, points);
    if (!rest) throw std::invalid_argument(no_points);
    result.rest = *rest;
    for (const auto& [landing, weight] : points) {
      const auto cell = std::upper_bound(above.begin(), above.end(), landing) - above.begin();
      result.landing[static_cast<std::size_t>(cell)] += weight;
    }
    return result;
  }

 private:
  const AnyReturnMap& map_;
  std::vector<std::pair<double, double>> ranges_;
  double bulk_;
  std::vector<std::vector<double>> inner_edges_;
};

// Returns the chain of the cells, each a start at its middle; nothing if rest is out of reach for one of them.
std::optional<Chain> chain_of_cells(const CoarseCells& coarse, int threads) {
  const std::size_t n = coarse.phases() * cells;
  std::vector<NodeRow> of_cells(n);
  parallel_for(n, threads, [&](std::size_t i) {
    const auto phase = i / cells;
    of_cells[i] = coarse.row(coarse.middle(phase, i % cells), static_cast<int>(phase));
  });
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  bool rests = false;
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t base = (i / cells + 1) % coarse.phases() * cells;
    for (std::size_t j = 0; j < cells; ++j) {
      if (base + j == i || of_cells[i].landing[j] == 0) continue;
      column.push_back(static_cast<std::uint32_t>(base + j));
      value.push_back(of_cells[i].landing[j]);
    }
    row_start.push_back(value.size());
    kill.push_back(of_cells[i].rest);
    rests = rests || of_cells[i].rest > 0;
  }
  if (!rests) return std::nullopt;
  Chain chain(std::move(row_start), std::move(column), std::move(value), std::move(kill));
  const Reachability reachable = classify(chain);
  if (std::find(reachable.must_rest.begin(), reachable.must_rest.end(), 0) != reachable.must_rest.end())
    return std::nullopt;
  return chain;
}

// Returns the first cell from which on hardly any survivor is, nor any launch after its first step.
std::size_t first_cell_above(const CoarseCells& coarse, const Chain& chain, const LaunchState& launch) {
  std::vector<double> of_launch(coarse.phases() * cells, 0.0);
  const std::size_t met = (static_cast<std::size_t>(launch.phase) + 1) % coarse.phases();
  const auto after = std::span(of_launch).subspan(met * cells, cells);
  for (const auto& [score, weight] : launch_points(launch, {})) {
    const NodeRow landed = coarse.row(launch.state(score), launch.phase);
    for (std::size_t j = 0; j < cells; ++j) after[j] += weight * landed.landing[j];
  }
  const std::vector<double> quasi = survivors_or_visits(chain, of_launch);
  std::size_t first = 0;
  for (std::size_t p = 0; p < coarse.phases(); ++p) {
    double above = 0, launched_above = 0;
    std::size_t k = cells;
    while (k > 0 && above + quasi[p * cells + k - 1] <= most_above && launched_above + after[k - 1] <= most_launched) {
      --k;
      above += quasi[p * cells + k];
      launched_above += after[k];
    }
    first = std::max(first, k);
  }
  return first;
}

}  // namespace

IntegratedChain collocate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads) {
  return chain_of_rows(map, space, launch, rows(map, space), true, launch_kinks(map, space, launch), threads);
}

Launch collocated_launch(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int halvings,
                         int threads) {
  Launch result = launch_of_rows(rows(map, space), space, launch, launch_kinks(map, space, launch), halvings, threads);
  result.interpolated = true;
  return result;
}

std::vector<std::vector<double>> collocation_edges(const AnyReturnMap& map,
                                                   const std::vector<std::pair<double, double>>& ranges,
                                                   int generations, double bulk) {
  const std::size_t points = points_of_a_row(map);
  std::size_t most = points < few_points ? many_edges : few_edges;
  if (points < few_points) generations = points > 1 ? most_generations : noise_free_generations;
  const std::size_t phases = ranges.size();
  std::vector<std::vector<double>> edges, last;
  for (const auto& [lower, upper] : ranges) {
    edges.push_back({lower});
    for (double width = bulk; lower + edge_ratio * width < upper; width *= edge_ratio)
      edges.back().push_back(lower + width);
    edges.back().push_back(upper);
    last.push_back({lower});
  }
  most += edges.front().size() - 2;
  for (int generation = 0; generation < generations; ++generation) {
    std::vector<std::vector<double>> more = edges, before(phases);
    std::size_t largest = 0;
    for (std::size_t p = 0; p < phases; ++p) {
      const auto& [lower, upper] = ranges[p];
      const double apart = least_panel * (upper - lower);
      for (const double state : map.states_of_extremes(static_cast<int>(p), last[(p + 1) % phases])) {
        const auto above = std::lower_bound(more[p].begin(), more[p].end(), state);
        if (above == more[p].begin() || above == more[p].end()) continue;
        if (*above - state < apart || state - *(above - 1) < apart) continue;
        more[p].insert(above, state);
        before[p].push_back(state);
      }
      largest = std::max(largest, more[p].size());
    }
    if (generation > 0 && largest > most) break;
    edges = std::move(more);
    last = std::move(before);
  }
  std::size_t largest = 0;
  for (const std::vector<double>& of_phase : edges) largest = std::max(largest, of_phase.size());
  for (std::vector<double>& of_phase : edges)
    while (of_phase.size() < largest) {
      std::size_t widest = 1;
      for (std::size_t e = 1; e < of_phase.size(); ++e)
        if (of_phase[e] - of_phase[e - 1] > of_phase[widest] - of_phase[widest - 1]) widest = e;
      of_phase.insert(of_phase.begin() + static_cast<std::ptrdiff_t>(widest),
                      0.5 * (of_phase[widest - 1] + of_phase[widest]));
    }
  return edges;
}

std::vector<std::pair<double, double>> collocation_ranges(const AnyReturnMap& map, const LaunchState& launch,
                                                          int threads, double bulk) {
  const int phases = map.phases();
  double lower = map.state_interval(0).first, highest_lower = lower, highest = 0;
  for (int p = 0; p < phases; ++p) {
    const auto [least, most] = map.state_interval(p);
    lower = std::min(lower, least);
    highest_lower = std::max(highest_lower, least);
    highest = std::max(highest, most);
  }
  const double launched = std::max(launch.state(3), highest_lower + few_lower * std::abs(highest_lower));
  const double length = std::max({launched - lower, 0.1 * std::abs(launched), 1e-3});
  double upper = std::min(highest, lower + 1.2 * length);
  for (;;) {
    std::vector<std::pair<double, double>> ranges;
    for (int p = 0; p < phases; ++p) ranges.emplace_back(map.state_interval(p).first, upper);
    const CoarseCells coarse(map, ranges, bulk);
    const std::optional<Chain> chain = chain_of_cells(coarse, threads);
    if (!chain) return {};
    const std::size_t first = first_cell_above(coarse, *chain, launch);
    if (first < cells || upper >= highest) {
      for (std::size_t p = 0; p < ranges.size(); ++p) ranges[p].second = coarse.edge(p, first);
      return ranges;
    }
    upper = std::min(highest, lower + 1.5 * (upper - lower));
    if (upper > lower + most_growth * length)
      throw ConvergenceError("method integrated", upper, "states grow without limit; method sampled takes them");
  }
}

}  // namespace metastable::markov
