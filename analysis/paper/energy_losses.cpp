#include "analysis/paper/energy_losses.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "dynamics/return_map/trials.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

struct Sums {
  double first = 0, second = 0;
  void add(double x) {
    first += x;
    second += x * x;
  }
};

MeanSpread spread(const std::vector<Sums>& trials, const std::vector<int>& collisions) {
  double count = 0, first = 0, second = 0;
  for (std::size_t t = 0; t < trials.size(); ++t) {
    count += collisions[t];
    first += trials[t].first;
    second += trials[t].second;
  }
  const double mean = first / count;
  double between = 0;  // of the ratio estimator, collisions of a trial being dependent
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const double residual = trials[t].first - mean * collisions[t];
    between += residual * residual;
  }
  return {mean, std::sqrt(std::max(0.0, second / count - mean * mean)), std::sqrt(between) / count};
}

}  // namespace

EnergyLosses energy_losses(const Setting& setting, const EnergyLossOptions& options) {
  if (options.trials < 2) throw std::invalid_argument(fmt::format("trials: {} is below 2", options.trials));
  const dynamics::WheelMap map = setting.map();
  const std::optional<dynamics::SettledMotion> motion =
      setting.law == dynamics::Law::settled ? std::optional(setting.motion()) : std::nullopt;
  const dynamics::LaunchSpeed launch = setting.launch();
  const dynamics::TrialOptions trial{.first_landing_leg = setting.first_landing_leg,
                                     .max_collisions = options.collisions,
                                     .ramp_length = std::numeric_limits<double>::infinity(),
                                     .rest_rule = options.rest_rule,
                                     .seed = options.seed};
  const auto count = static_cast<std::size_t>(options.trials);
  std::vector<Sums> tangential(count), normal(count);
  std::vector<int> collisions(count);
  markov::parallel_for(count, options.threads, [&](std::size_t t) {
    const dynamics::Trial rolled = motion ? dynamics::simulate_trial(*motion, map.noise(), launch, trial, t)
                                          : dynamics::simulate_trial(map, launch, trial, t);
    for (const dynamics::TrialCollision& collision : rolled.collisions) {
      tangential[t].add(collision.loss.tangential() - collision.loss.potential);
      normal[t].add(collision.loss.normal());
      ++collisions[t];
    }
  });
  EnergyLosses losses{spread(tangential, collisions), spread(normal, collisions), 0};
  for (const int n : collisions) losses.collisions += static_cast<std::uint64_t>(n);
  return losses;
}

}  // namespace metastable::analysis
