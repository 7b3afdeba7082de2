#include "markov/transition_rows/state_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "markov/transition_rows/draws.h"

namespace metastable::markov {
namespace {

constexpr double launch_reach = 6.0;       // scores of the launch state that the bulk must hold
constexpr std::size_t probe_draws = 2048;  // to find the end of the bulk
constexpr double probe_level = 0.02;       // noise exceeded once in 50 events
constexpr double sparse = 0.15;            // cells per factor of e beyond the bulk, relative to the bulk's
constexpr double grading_ratio = 4.0;      // widest over narrowest cell, in pilot cells
constexpr double least_bulk = 0.3;         // of the lowest state
constexpr double far_above = 4.0;          // the regime: where the landings of a launch are a transient of their own
constexpr double beyond_launch = 1.5;      // what the cells hold above its landings
constexpr int most_steps = 1000;           // mapped to find the end of the bulk

// Returns the state below which all but probe_level of the landings from `state` fall; rest counts as lowest.
double high_landing(const NoiseTable& table, std::span<const double> weight, double state) {
  std::vector<double> landing(weight.size());
  const std::vector<double> offset(weight.size(), 0.0);
  table.land(state, 0.0, offset, 0, landing);
  std::vector<std::size_t> order(weight.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return landing[a] > landing[b]; });
  double above = 0;
  for (const std::size_t k : order) {
    above += weight[k];
    if (above > probe_level) return landing[k];
  }
  return rest_landing;
}

// Holds widths over the lowest state.
struct Widths {
  double bulk = 0, launched = 0;
};

// The bulk holds the launch's own landings and ends where its top edge, mapped, no longer rises. Launches far above
// that are left out of it: their landings fall to the bulk within some steps.
Widths widths(const AnyReturnMap& map, const LaunchState& launch, double lowest, std::uint64_t seed) {
  const int phases = map.phases();
  const Draws draws = make_draws(map.noise_dimension(), {.count = probe_draws, .seed = seed});
  std::vector<std::unique_ptr<NoiseTable>> tables;
  for (int p = 0; p < phases; ++p) tables.push_back(map.tabulate(p, draws.score));
  const auto land = [&](double state, int step) {
    return std::max(
        lowest, high_landing(*tables[static_cast<std::size_t>((launch.phase + step) % phases)], draws.weight, state));
  };
  const double least = std::max(least_bulk * std::abs(lowest), 1e-6 * std::max(1.0, std::abs(lowest)));
  const double launched = std::max(land(launch.state(launch_reach), 0), lowest + least);
  const double most = lowest + 10 * std::max(launched - lowest, std::abs(lowest));  // if most noise gains energy
  double top = launched, fallen = launched;
  for (int step = 1, quiet = 0; step < most_steps && quiet < phases && top < most; ++step) {
    const double next = land(top, step);
    quiet = next > top + 1e-3 * (top - lowest) ? 0 : quiet + 1;
    top = std::max(top, next);
  }
  for (int step = 1, quiet = 0; step < most_steps && quiet < phases && fallen > lowest; ++step) {
    const double next = land(fallen, step);
    quiet = next < fallen - 1e-3 * (fallen - lowest) ? 0 : quiet + 1;
    fallen = std::min(fallen, next);
  }
  const double regime = std::max(fallen - lowest, least);
  if (top == launched && launched - lowest > far_above * regime) return {regime, launched - lowest};
  const double bulk = std::min(top, most) - lowest;
  return {bulk, bulk};
}

// Returns the place of the end of the cells, in bulks: up to 1 it is the share of the bulk; beyond it, sparse cells on
// a logarithmic scale.
double place(double end) { return end <= 1 ? end : 1 + sparse * std::log(end); }

double highest_low(const AnyReturnMap& map) {
  double lowest = map.state_interval(0).first;
  for (int p = 1; p < map.phases(); ++p) lowest = std::max(lowest, map.state_interval(p).first);
  return lowest;
}

}  // namespace

StateSpace::StateSpace(std::vector<Grid> grids) : grids_(std::move(grids)) {
  if (grids_.empty()) throw std::invalid_argument("state space: no phases");
  for (const Grid& grid : grids_)
    if (grid.cells() != cells()) throw std::invalid_argument("state space: phases differ in their number of cells");
}

StateSpace StateSpace::halved() const {
  std::vector<Grid> grids;
  grids.reserve(grids_.size());
  for (const Grid& grid : grids_) grids.push_back(grid.halved());
  return StateSpace(std::move(grids));
}

double bulk_below_launch(const AnyReturnMap& map, const LaunchState& launch, std::uint64_t seed) {
  const Widths width = widths(map, launch, highest_low(map), seed);
  return width.launched > width.bulk ? width.bulk : std::numeric_limits<double>::infinity();
}

double launch_cells(const AnyReturnMap& map, const LaunchState& launch, std::uint64_t seed) {
  const Widths width = widths(map, launch, highest_low(map), seed);
  return width.launched > width.bulk ? place(beyond_launch * width.launched / width.bulk) : 1;
}

StateSpace covering_space(const AnyReturnMap& map, const LaunchState& launch, std::size_t cells, std::uint64_t seed,
                          double reach) {
  if (!(reach >= 1)) throw std::invalid_argument("state space: reach below 1");
  const Widths width = widths(map, launch, highest_low(map), seed);
  const double bulk = width.bulk;
  if (width.launched > bulk) reach = std::max(reach, beyond_launch * width.launched / bulk);
  std::vector<Grid> grids;
  for (int p = 0; p < map.phases(); ++p) {
    const auto [lower, upper] = map.state_interval(p);
    const double last = place(std::isfinite(upper) ? std::clamp((upper - lower) / bulk, 1e-6, reach) : reach);
    std::vector<double> edges(cells + 1);
    for (std::size_t i = 0; i <= cells; ++i) {
      const double s = last * static_cast<double>(i) / static_cast<double>(cells);
      edges[i] = lower + bulk * (s <= 1 ? s : std::exp((s - 1) / sparse));
    }
    grids.emplace_back(std::move(edges));
  }
  return StateSpace(std::move(grids));
}

double top_share(const StateSpace& space, std::span<const double> nu) {
  double share = 0;
  for (int p = 0; p < space.phases(); ++p) share = std::max(share, nu[space.index(p, space.cells() - 1)]);
  return share;
}

StateSpace graded_space(const StateSpace& pilot, std::span<const double> nu, std::span<const double> h,
                        std::span<const double> visits, std::size_t cells) {
  std::vector<Grid> grids;
  const std::size_t n = pilot.cells();
  for (int p = 0; p < pilot.phases(); ++p) {
    const Grid& grid = pilot.grid(p);
    const auto at = [&](std::span<const double> v, std::size_t c) { return v[pilot.index(p, c)]; };
    std::size_t used = n;
    for (double nu_above = 0, visits_above = 0; used > 2; --used) {
      nu_above += at(nu, used - 1);
      visits_above += at(visits, used - 1);
      if (nu_above > 1e-13 || visits_above > 1e-9) break;
    }
    // The monitor of a pilot cell takes centred differences of the density and of h, smoothed over neighbours.
    std::vector<double> monitor(used, 0.0);
    for (std::size_t c = 0; c < used; ++c) {
      const std::size_t a = c == 0 ? 0 : c - 1, b = std::min(c + 1, n - 1);
      const double run = grid.midpoint(b) - grid.midpoint(a);
      const double slope_nu = (at(nu, b) / grid.width(b) - at(nu, a) / grid.width(a)) / run;
      const double slope_h = (at(h, b) - at(h, a)) / run;
      monitor[c] = std::cbrt(std::abs(slope_nu * slope_h));
    }
    std::vector<double> smooth(used);
    for (std::size_t c = 0; c < used; ++c) {
      const std::size_t a = c < 2 ? 0 : c - 2, b = std::min(c + 2, used - 1);
      smooth[c] = std::accumulate(monitor.begin() + static_cast<std::ptrdiff_t>(a),
                                  monitor.begin() + static_cast<std::ptrdiff_t>(b) + 1, 0.0) /
                  static_cast<double>(b - a + 1);
    }
    for (std::size_t c = 0; c < used; ++c) smooth[c] *= grid.width(c);
    const double floor = *std::max_element(smooth.begin(), smooth.end()) / grading_ratio;
    std::vector<double> mass(used + 1, 0.0);  // cumulative monitor at the pilot's edges
    for (std::size_t c = 0; c < used; ++c) mass[c + 1] = mass[c] + (floor > 0 ? std::max(smooth[c], floor) : 1.0);
    std::vector<double> edges(cells + 1);
    std::size_t c = 0;
    for (std::size_t i = 0; i <= cells; ++i) {
      const double wanted = mass.back() * static_cast<double>(i) / static_cast<double>(cells);
      while (c + 1 < used && mass[c + 1] < wanted) ++c;
      edges[i] = grid.lower(c) + grid.width(c) * (wanted - mass[c]) / (mass[c + 1] - mass[c]);
    }
    edges.front() = grid.lower(0);
    grids.emplace_back(std::move(edges));
  }
  return StateSpace(std::move(grids));
}

}  // namespace metastable::markov
