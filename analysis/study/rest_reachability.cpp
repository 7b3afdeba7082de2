#include "analysis/study/rest_reachability.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr double launch_score = 8.0;  // reach of the launch's distribution
constexpr int most_revolutions = 100000;

// Does the worst orbit from `state` at `phase` settle without ever coming to rest?
bool safe(const markov::AnyReturnMap& map, double state, int phase) {
  const int phases = map.phases();
  for (int revolution = 0; revolution < most_revolutions; ++revolution) {
    double next = state;
    for (int k = 0; k < phases; ++k) {
      next = map.landing_range(next, (phase + k) % phases)->first;
      if (next == markov::rest_landing) return false;
    }
    if (next >= state * (1 - 1e-13)) return true;
    state = next;
  }
  return true;
}

}  // namespace

RestReachability rest_reachability(const Problem& problem) {
  const markov::AnyReturnMap& map = problem.map;
  const int phase = problem.launch.phase;
  RestReachability result;
  const double launch = problem.launch.state(launch_score);
  if (!map.landing_range(launch, phase)) return result;
  const auto [lowest, highest] = map.state_interval(phase);
  double high = std::max(launch, std::isfinite(highest) ? highest : 100 * std::max(1.0, lowest));
  if (!safe(map, high, phase)) return result;
  double low = std::min(0.0, lowest);
  while (high - low > 1e-10 * std::max(1e-3, std::abs(high))) {
    const double middle = 0.5 * (low + high);
    (safe(map, middle, phase) ? high : low) = middle;
  }
  result.safe_state = high;
  // This follows the best orbit of the launch, until it is safe or falls.
  double best = launch;
  for (int step = 0; step < 1000 * map.phases(); ++step) {
    if (step % map.phases() == 0 && best >= high) {
      result.certain = false;
      return result;
    }
    const double next = map.landing_range(best, (phase + step) % map.phases())->second;
    if (next == markov::rest_landing) return result;
    best = next;
  }
  return result;
}

std::optional<double> safe_slope_deg(const Setting& setting) {
  // Every slope tried would need a table of landings.
  if (setting.law == dynamics::Law::settled) return std::nullopt;
  const double steepest = dynamics::steepest_slope(setting.wheel.legs()) * 180.0 / std::numbers::pi;
  const auto has_safe_states = [&](double slope_deg) {
    Setting tilted = setting;
    tilted.slope_deg = slope_deg;
    const markov::AnyReturnMap map = tilted.map();
    const double top = 100 * std::max(1.0, map.state_interval(0).first);
    return safe(map, top, 0);
  };
  double low = 1e-6 * steepest, high = steepest * (1 - 1e-9);
  if (!has_safe_states(high)) return std::nullopt;
  while (high - low > 1e-6) {
    const double middle = 0.5 * (low + high);
    (has_safe_states(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace metastable::analysis
