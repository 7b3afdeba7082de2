#include "analysis/paper/variance_sources.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "analysis/description/speed_profile.h"
#include "dynamics/return_map/trials.h"
#include "dynamics/settled/settled_roll.h"

namespace metastable::analysis {

namespace {

// A trial that goes on whatever happens: from collision to collision.
class MappedTrial {
 public:
  MappedTrial(const Setting& setting, double slope, const dynamics::ContactNoise& noise, double omega)
      : map_(setting.wheel, slope, setting.law, noise, setting.rebound_lost),
        leg_(setting.first_landing_leg),
        state_(omega * omega) {}

  double speed() const { return std::sqrt(state_); }
  bool vaults(const dynamics::Contact& contact) {
    const int phase = leg_++ % map_.phases();
    const double after = map_.after_collision(state_, phase, contact);
    state_ = std::max(0.0, after + map_.stance(phase).gain);
    return after >= map_.stance(phase).barrier;
  }

 private:
  dynamics::WheelMap map_;
  int leg_;
  double state_;
};

class RolledTrial {
 public:
  RolledTrial(const Setting& setting, double omega) : motion_(setting.motion()), speed_(omega) {
    leg_ = setting.first_landing_leg;
  }

  double speed() const { return speed_; }
  bool vaults(const dynamics::Contact& contact) {
    if (!roll_) roll_.emplace(motion_, leg_, speed_, contact, contact);
    roll_->set_contact(contact);
    const dynamics::Step step = roll_->step();
    speed_ = step.omega_minus;
    if (!step.touched) {
      const dynamics::StandingFoot& foot = motion_.foot(leg_);
      speed_ = std::sqrt(foot.next_squared(foot.barrier_squared()));
      roll_.reset();
    }
    ++leg_;
    return step.touched;
  }

 private:
  dynamics::SettledMotion motion_;
  std::optional<dynamics::SettledRoll> roll_;
  int leg_ = 0;
  double speed_;
};

}  // namespace

VarianceSources variance_of_trials(const Setting& setting, double leg_sd, const SobolOptions& options) {
  if (!setting.pairs.empty() || setting.correlation != 0)
    throw std::invalid_argument("variance shares: restitution and friction must be independent normals");
  constexpr int last_steady = 16;
  const dynamics::WheelMap base = setting.map();
  const int course =
      std::max(last_steady, dynamics::last_collision_on_ramp(base, setting.first_landing_leg, setting.ramp_length));
  const auto count = static_cast<std::size_t>(course), legs = setting.wheel.leg_length.size();
  const dynamics::LaunchSpeed launch = setting.launch();
  const dynamics::ContactNoise noise = setting.noise();
  const dynamics::TruncatedNormal length(setting.wheel.mean_leg_length(), leg_sd, 0);
  const double slope = setting.slope_deg * std::numbers::pi / 180;
  const auto trial = [&](std::span<const double> u, std::span<double> out) {
    Setting one = setting;
    for (std::size_t leg = 0; leg < legs; ++leg)
      one.wheel.leg_length[leg] = length.at_score(dynamics::normal_quantile(u[1 + leg]));
    const std::span<const double> restitution = u.subspan(1 + legs, count),
                                  friction = u.subspan(1 + legs + count, count);
    const double omega = launch.at_score(dynamics::normal_quantile(u[0]));
    double sum = 0;
    int steps = course;
    const auto follow = [&](auto&& wheel) {
      for (int n = 1; n <= course; ++n) {
        if (n >= steady_collision && n <= last_steady) sum += wheel.speed();
        if (n >= last_steady && steps < course) break;
        const auto k = static_cast<std::size_t>(n) - 1;
        const double score[2] = {dynamics::normal_quantile(restitution[k]), dynamics::normal_quantile(friction[k])};
        if (!wheel.vaults(noise.draw(score))) steps = std::min(steps, n);
      }
    };
    if (setting.law == dynamics::Law::settled)
      follow(RolledTrial(one, omega));
    else
      follow(MappedTrial(one, slope, noise, omega));
    out[0] = sum / (last_steady - steady_collision + 1);
    out[1] = steps;
  };
  std::vector<SobolResult> results = sobol_indices({1, legs, count, count}, 2, trial, options);
  return {results[0], results[1]};
}

}  // namespace metastable::analysis
