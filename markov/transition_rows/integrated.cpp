#include "markov/transition_rows/integrated.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace metastable::markov {
namespace {

constexpr double most_above_edge = 1e-13;     // survivors beyond the upper edge
constexpr double first_reach = 1.5;           // lowest states that the first try covers above the lowest one
constexpr double most_launched_above = 1e-9;  // landings of the launch beyond it
constexpr std::size_t most_pilot_panels = 64;
constexpr double least_corrected = 1e-6;  // survivors of a row whose total is worth correcting

NodeRow node_row(const AnyReturnMap& map, const NodeSpace& space, double state, int phase) {
  const int next = (phase + 1) % space.phases();
  const auto weights = space.weights(next);
  NodeRow row;
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
  if (survivors > least_corrected && sum > 0.1 * survivors)
    for (double& p : row.landing) p *= survivors / sum;
  return row;
}

MakeNodeRow panel_rows(const AnyReturnMap& map, const NodeSpace& space) {
  return [&](double state, int phase) { return node_row(map, space, state, phase); };
}

}  // namespace

IntegratedChain integrate(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int threads) {
  return chain_of_rows(map, space, launch, panel_rows(map, space), false, {}, threads);
}

Launch integrated_launch(const AnyReturnMap& map, const NodeSpace& space, const LaunchState& launch, int halvings,
                         int threads) {
  return launch_of_rows(panel_rows(map, space), space, launch, {}, halvings, threads);
}

std::vector<std::pair<double, double>> node_ranges(const AnyReturnMap& map, const LaunchState& launch, int threads,
                                                   double bulk) {
  double lower = map.state_interval(0).first, highest_lower = lower, highest = 0;
  for (int p = 0; p < map.phases(); ++p) {
    const auto [least, most] = map.state_interval(p);
    lower = std::min(lower, least);
    highest_lower = std::max(highest_lower, least);
    highest = std::max(highest, most);
  }
  // One upper edge serves all phases: what the launch leaves high up at one phase comes by at the next.
  const auto ranges = [&](double upper) {
    std::vector<std::pair<double, double>> all;
    for (int p = 0; p < map.phases(); ++p) all.emplace_back(map.state_interval(p).first, upper);
    return all;
  };
  const double launched = std::max(launch.state(3), highest_lower + first_reach * std::abs(highest_lower));
  const double length = std::max({launched - lower, 0.1 * std::abs(launched), 1e-3});
  double upper = std::min(highest, lower + 1.2 * length);
  for (std::size_t panels = map.phases() > 1 ? 1 : 2;;) {
    const NodeSpace space(ranges(upper), panels, bulk);
    const IntegratedChain pilot = integrate(map, space, launch, threads);
    const Reachability reachable = classify(pilot.chain.chain);
    const bool rests =
        std::find(reachable.must_rest.begin(), reachable.must_rest.end(), 0) == reachable.must_rest.end();
    if ((!rests || pilot.row_error > 0.5) && panels < most_pilot_panels) {
      panels *= 2;
      continue;
    }
    if (!rests) return {};
    const std::vector<double> quasi = survivors_or_visits(pilot.chain.chain, pilot.chain.launch.after);
    // This finds the lowest node that has at most the shares wanted at it and above it, at every phase.
    std::size_t first = 0;
    for (int p = 0; p < space.phases(); ++p) {
      const std::size_t base = static_cast<std::size_t>(p) * space.nodes();
      double above = 0, after = 0;
      std::size_t k = space.nodes();
      while (k > 0 && above + quasi[base + k - 1] <= most_above_edge &&
             after + pilot.chain.launch.after[base + k - 1] <= most_launched_above) {
        --k;
        above += quasi[base + k];
        after += pilot.chain.launch.after[base + k];
      }
      first = std::max(first, k);
    }
    if (first == space.nodes() && upper < highest) {
      upper = std::min(highest, lower + 1.5 * (upper - lower));
      if (upper > lower + most_growth * length)
        throw ConvergenceError("method integrated", upper, "states grow without limit; method sampled takes them");
      continue;
    }
    if (first < space.nodes())
      upper =
          std::max(space.node(first), space.node(first + static_cast<std::size_t>(space.phases() - 1) * space.nodes()));
    return ranges(upper);
  }
}

}  // namespace metastable::markov
