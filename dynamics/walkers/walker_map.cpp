#include "dynamics/walkers/walker_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {

WalkerMap::WalkerMap(TwoLinkWalker walker, Options options) : walker_(std::move(walker)), options_(options) {
  if (!(std::abs(options.slope_rad) < std::numbers::pi / 2))
    throw std::invalid_argument(fmt::format("slope: {} rad is outside (-pi/2, pi/2)", options.slope_rad));
  if (!(options.slope_sd_rad >= 0 && options.slope_sd_rad < std::numbers::pi / 2))
    throw std::invalid_argument(fmt::format("sd of the slope: {} rad is outside [0, pi/2)", options.slope_sd_rad));
}

int WalkerMap::dimension() const { return walker_.dimension() + (options_.terrain == Terrain::facets ? 1 : 0); }

std::vector<std::string> WalkerMap::names() const {
  std::vector<std::string> names{"half angle [rad]", "stance rate [rad/s]", "swing rate [rad/s]"};
  names.resize(static_cast<std::size_t>(walker_.dimension()));
  if (options_.terrain == Terrain::facets) names.emplace_back("slope underfoot [rad]");
  return names;
}

void WalkerMap::step(std::span<const double> states, std::span<const double> scores, std::span<double> next,
                     std::span<std::uint8_t> fell) const {
  const auto all = static_cast<std::size_t>(dimension()), own = static_cast<std::size_t>(walker_.dimension());
  const std::size_t n = scores.size();
  if (states.size() != n * all || next.size() != n * all || fell.size() != n)
    throw std::invalid_argument("walker map: states, scores and landings differ in number");
  std::vector<Ground> ground(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double slope = options_.slope_rad + options_.slope_sd_rad * scores[i];
    ground[i] = {slope, all == own ? slope : states[i * all + own]};
  }
  if (all == own) return walker_.step(states, ground, next, fell);
  std::vector<double> from(n * own), to(n * own);
  for (std::size_t i = 0; i < n; ++i) std::copy_n(states.data() + i * all, own, from.data() + i * own);
  walker_.step(from, ground, to, fell);
  for (std::size_t i = 0; i < n; ++i) {
    std::copy_n(to.data() + i * own, own, next.data() + i * all);
    next[i * all + own] = ground[i].slope_rad;
  }
}

}  // namespace metastable::dynamics
