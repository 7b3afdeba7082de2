#include "analysis/paper/variance_sources.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "analysis/description/speed_profile.h"
#include "dynamics/return_map/trials.h"

namespace metastable::analysis {

VarianceSources variance_of_trials(const Setting& setting, double leg_sd, const SobolOptions& options) {
  if (!setting.pairs.empty() || setting.correlation != 0)
    throw std::invalid_argument("variance shares: restitution and friction must be independent normals");
  constexpr int last_steady = 16;
  const dynamics::WheelMap base = setting.map();
  const int course =
      std::max(last_steady, dynamics::last_collision_on_ramp(base, setting.first_landing_leg, setting.ramp_length));
  const auto count = static_cast<std::size_t>(course), legs = setting.wheel.leg_length.size();
  const dynamics::TruncatedNormal launch = setting.launch();
  const dynamics::ContactNoise noise = setting.noise();
  const dynamics::TruncatedNormal length(setting.wheel.mean_leg_length(), leg_sd, 0);
  const double slope = setting.slope_deg * std::numbers::pi / 180;
  const auto trial = [&](std::span<const double> u, std::span<double> out) {
    Setting one = setting;
    for (std::size_t leg = 0; leg < legs; ++leg)
      one.wheel.leg_length[leg] = length.at_score(dynamics::normal_quantile(u[1 + leg]));
    const dynamics::WheelMap map(one.wheel, slope, one.law, noise, one.rebound_lost);
    const std::span<const double> restitution = u.subspan(1 + legs, count),
                                  friction = u.subspan(1 + legs + count, count);
    const double omega = launch.at_score(dynamics::normal_quantile(u[0]));
    double state = omega * omega, sum = 0;
    int steps = course;
    for (int n = 1; n <= course; ++n) {
      if (n >= steady_collision && n <= last_steady) sum += std::sqrt(state);
      if (n >= last_steady && steps < course) break;
      const int phase = (one.first_landing_leg + n - 1) % map.phases();
      const auto k = static_cast<std::size_t>(n) - 1;
      const double score[2] = {dynamics::normal_quantile(restitution[k]), dynamics::normal_quantile(friction[k])};
      const double after = map.after_collision(state, phase, noise.draw(score));
      if (!(after >= map.stance(phase).barrier)) steps = std::min(steps, n);
      state = std::max(0.0, after + map.stance(phase).gain);
    }
    out[0] = sum / (last_steady - steady_collision + 1);
    out[1] = steps;
  };
  std::vector<SobolResult> results = sobol_indices({1, legs, count, count}, 2, trial, options);
  return {results[0], results[1]};
}

}  // namespace metastable::analysis
