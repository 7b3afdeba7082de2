#include "analysis/paper/stopping.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>

#include "analysis/description/speed_profile.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/statistics/interval_95.h"
#include "dynamics/return_map/trials.h"
#include "dynamics/settled/settled_map.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr int most_collisions = 200;
constexpr int curve_points = 40;
constexpr double curve_end = 8;                // [rad/s]
constexpr std::uint64_t longest_design = 300;  // collisions

// Returns the landings of the setting's wheel, each followed.
std::shared_ptr<const dynamics::SettledMap> followed(const Setting& setting) {
  dynamics::SettledMapOptions options;
  options.direct = true;
  return dynamics::SettledMap::of(setting.motion().wheel(), options);
}

RestingCurve resting_curve(const dynamics::SettledMap& map, int leg, double eta) {
  RestingCurve curve{leg, {}, {}};
  const double slowest = std::sqrt(map.motion().foot(leg).barrier_squared());
  const double sticks = map.sticking_friction(leg);
  for (int i = 0; i <= curve_points; ++i) {
    // Points lie closer where the wheel barely passes.
    const double share = static_cast<double>(i) / curve_points;
    const double omega = slowest + (curve_end - slowest) * share * share;
    const double friction = map.resting_friction(leg, omega, eta);
    if (!(friction <= sticks)) continue;
    curve.speed.push_back(omega);
    curve.friction.push_back(friction);
  }
  return curve;
}

// Returns collisions over rests of wheels rolled, each for so many collisions at most: once the launch is forgotten the
// rate of rests stays, so that what is cut off changes nothing.
Estimate rolled_steps(const Setting& setting, int trials, std::uint64_t seed, int threads) {
  const dynamics::SettledMotion motion = setting.motion();
  const dynamics::ContactNoise noise = setting.noise();
  const dynamics::LaunchSpeed launch = setting.launch();
  std::vector<std::uint64_t> steps(static_cast<std::size_t>(trials));
  markov::parallel_for(steps.size(), threads, [&](std::size_t t) {
    steps[t] = dynamics::steps_to_rest(motion, noise, launch, setting.first_landing_leg, seed, t, longest_design + 1);
  });
  double collisions = 0, rests = 0;
  for (const std::uint64_t one : steps) {
    collisions += static_cast<double>(std::min(one, longest_design));
    rests += one <= longest_design;
  }
  if (rests == 0) return {infinite, collisions / 3, infinite};  // 95 %: three rests would have been likely
  const double error = normal_95 / std::sqrt(rests), value = collisions / rests;
  return {value, value * std::exp(-error), value * std::exp(error)};
}

struct Change {
  const char* what;
  void (*make)(DesignChange&);
};

void scale_legs(DesignChange& change, double factor) {
  std::vector<double>& legs = change.setting.wheel.leg_length;
  const double mean = change.setting.wheel.mean_leg_length();
  const auto reach = [&] {
    const auto [low, high] = std::minmax_element(legs.begin(), legs.end());
    return fmt::format("{:.2g} mm", 1e3 * (*high - *low));
  };
  change.from = reach();
  for (double& length : legs) length = mean + (length - mean) * factor;
  change.to = reach();
}

void set(DesignChange& change, double& value, double to, const char* unit) {
  change.from = fmt::format("{:.4g}{}", value, unit);
  change.to = fmt::format("{:.4g}{}", to, unit);
  value = to;
}

void scale_inertia(DesignChange& change, double factor) {
  dynamics::Wheel& wheel = change.setting.wheel;
  const double gyration = change.setting.motion().wheel().radius_of_gyration;
  const auto inertia = [&](double r) { return fmt::format("{:.3g} kg m²", wheel.hub_mass * r * r); };
  wheel.inertia.reset();
  wheel.radius_of_gyration = gyration * std::sqrt(factor);
  change.from = inertia(gyration);
  change.to = inertia(*wheel.radius_of_gyration);
}

constexpr Change changes[] = {
    {"nothing", [](DesignChange&) {}},
    {"inertia about the hub doubled", [](DesignChange& c) { scale_inertia(c, 2); }},
    {"inertia about the hub halved", [](DesignChange& c) { scale_inertia(c, 0.5); }},
    {"longest less shortest leg halved", [](DesignChange& c) { scale_legs(c, 0.5); }},
    {"legs all alike", [](DesignChange& c) { scale_legs(c, 0); }},
    {"mean of μ raised by 5 %",
     [](DesignChange& c) { set(c, c.setting.friction.mean, 1.05 * c.setting.friction.mean, ""); }},
    {"sd of μ lowered by 20 %",
     [](DesignChange& c) { set(c, c.setting.friction.sd, 0.8 * c.setting.friction.sd, ""); }},
    {"mean of η lowered by a quarter",
     [](DesignChange& c) { set(c, c.setting.restitution.mean, 0.75 * c.setting.restitution.mean, ""); }},
    {"slope raised by 1 deg", [](DesignChange& c) { set(c, c.setting.slope_deg, c.setting.slope_deg + 1, " deg"); }},
    {"tips rounded by 1 mm",
     [](DesignChange& c) { set(c, c.setting.wheel.tip_radius, c.setting.wheel.tip_radius + 1e-3, " m"); }},
};

}  // namespace

int Stopping::landings() const {
  return std::accumulate(legs.begin(), legs.end(), 0, [](int sum, const StoppingLeg& l) { return sum + l.landings; });
}

int Stopping::rests() const {
  return std::accumulate(legs.begin(), legs.end(), 0, [](int sum, const StoppingLeg& l) { return sum + l.rests; });
}

Setting stopping_setting() {
  Setting setting;
  setting.law = dynamics::Law::settled;
  setting.wheel.radius_of_gyration = 0.0424;  // J = 0.0025 kg m^2
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.4, 0.03};
  return setting;
}

Stopping stopping(const Setting& setting, int trials, std::uint64_t seed, int threads) {
  Stopping result;
  result.setting = setting;
  const auto map = followed(setting);
  const std::vector<double>& length = setting.wheel.leg_length;
  const dynamics::TruncatedNormal friction = setting.noise().friction();
  for (int leg = 0; leg < map->legs(); ++leg) {
    StoppingLeg one;
    one.leg = leg;
    one.longer =
        length[static_cast<std::size_t>(leg)] - length[static_cast<std::size_t>((leg + map->legs() - 1) % map->legs())];
    one.sticking = map->sticking_friction(leg);
    one.slides = friction.constant() ? (friction.mean() < one.sticking ? 1 : 0) : friction.cdf(one.sticking);
    result.legs.push_back(one);
  }
  Setting endless = setting;
  endless.ramp_length = std::numeric_limits<double>::infinity();
  for (const dynamics::Trial& trial :
       simulate_trials(endless, {.trials = trials, .collisions = most_collisions, .seed = seed, .threads = threads}))
    for (const dynamics::TrialCollision& c : trial.collisions) {
      if (c.number < steady_collision) continue;
      StoppingLeg& one = result.legs[static_cast<std::size_t>(c.leg)];
      ++one.landings;
      one.speed += c.omega_minus;
      if (&c == &trial.collisions.back() && trial.outcome == dynamics::Outcome::rest) ++one.rests;
    }
  const double eta = setting.restitution.mean;
  for (StoppingLeg& one : result.legs) {
    if (one.landings > 0) one.speed /= one.landings;
    if (one.landings > 0) one.resting = std::min(one.sticking, map->resting_friction(one.leg, one.speed, eta));
  }
  std::vector<int> by_sticking(result.legs.size());
  std::iota(by_sticking.begin(), by_sticking.end(), 0);
  std::sort(by_sticking.begin(), by_sticking.end(),
            [&](int a, int b) { return map->sticking_friction(a) < map->sticking_friction(b); });
  for (const int leg : {by_sticking.front(), by_sticking[by_sticking.size() / 2], by_sticking.back()})
    result.curves.push_back(resting_curve(*map, leg, eta));
  return result;
}

std::size_t design_change_count() { return std::size(changes); }

std::vector<DesignChange> design_changes(const Setting& base, int trials, std::uint64_t seed, int threads,
                                         const std::function<void()>& progress) {
  std::vector<DesignChange> all;
  for (const Change& of : changes) {
    DesignChange change{of.what, "", "", base, {}, 1};
    of.make(change);
    change.steps = rolled_steps(change.setting, trials, seed, threads);
    if (!all.empty()) change.times = change.steps.value / all.front().steps.value;
    all.push_back(std::move(change));
    if (progress) progress();
  }
  return all;
}

}  // namespace metastable::analysis
