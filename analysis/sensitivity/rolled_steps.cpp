#include "analysis/sensitivity/rolled_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <vector>

#include "analysis/statistics/interval_95.h"
#include "dynamics/return_map/trials.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::uint64_t fewest_rests = 100;  // the interval of their mean is then normal, and known to a tenth
// What a parameter is moved by: means and sds in sds, all else in parts of itself. Under `published` at 9.59 deg a
// quarter of the sd of mu is 9 % off in its derivative by the third order, a tenth 1.4 %.
constexpr double mean_step = 0.25, sd_step = 0.1, other_step = 0.025;
constexpr double cut = 50;         // times the expected steps: a wheel in e^50 rolls longer
constexpr std::size_t block = 64;  // wheels between two looks at the progress

// Rolls the wheels of one setting, under any law.
class Roller {
 public:
  explicit Roller(const Setting& setting)
      : noise_(setting.noise()), launch_(setting.launch()), first_(setting.first_landing_leg) {
    setting.validate();
    if (setting.law == dynamics::Law::settled)
      motion_.emplace(setting.motion());
    else
      map_.emplace(setting.map());
  }

  // Returns at most `limit`; less says that the wheel rested.
  std::uint64_t steps(std::uint64_t seed, std::uint64_t wheel, std::uint64_t limit) const {
    return motion_ ? dynamics::steps_to_rest(*motion_, noise_, launch_, first_, seed, wheel, limit)
                   : dynamics::steps_to_rest(*map_, launch_, first_, seed, wheel, limit);
  }

 private:
  std::optional<dynamics::SettledMotion> motion_;
  std::optional<dynamics::WheelMap> map_;
  dynamics::ContactNoise noise_;
  dynamics::LaunchSpeed launch_;
  int first_;
};

double step_of(const Setting& setting, Parameter parameter) {
  const double eta = setting.restitution.sd, mu = setting.friction.sd;
  if (parameter == Parameter::restitution_sd) return sd_step * eta;
  if (parameter == Parameter::friction_sd) return sd_step * mu;
  if (parameter == Parameter::restitution_mean && eta > 0) return mean_step * eta;
  if (parameter == Parameter::friction_mean && mu > 0) return mean_step * mu;
  return other_step * parameter_value(setting, parameter);
}

constexpr Parameter moved_parameters[] = {
    Parameter::slope,        Parameter::restitution_mean,  Parameter::restitution_sd, Parameter::friction_mean,
    Parameter::friction_sd,  Parameter::leg_length,        Parameter::inertia,        Parameter::ramp_stiffness,
    Parameter::contact_mass, Parameter::radius_of_gyration};

// Returns d ln(mean of plus / mean of minus) / distance, of pairs with common random numbers.
Sensitivity difference(Sensitivity one, const std::vector<double>& minus, const std::vector<double>& plus,
                       double distance) {
  const auto n = static_cast<double>(minus.size());
  double mean_minus = 0, mean_plus = 0, squares = 0;
  for (std::size_t t = 0; t < minus.size(); ++t) mean_minus += minus[t] / n, mean_plus += plus[t] / n;
  for (std::size_t t = 0; t < minus.size(); ++t) {
    const double pair = plus[t] / mean_plus - minus[t] / mean_minus;
    squares += pair * pair;
  }
  one.derivative = std::log(mean_plus / mean_minus) / distance;
  one.error = normal_95 * std::sqrt(squares / (n - 1) / n) / distance;
  return one;
}

}  // namespace

std::optional<Estimate> rolled_steps(const Setting& setting, const RollOptions& options) {
  const Roller roller(setting);
  double landings = 0, rests = 0, squares = 0, rested = 0;
  for (std::uint64_t wheel = 0, left = options.landings; left > 0; ++wheel) {
    const std::uint64_t steps = roller.steps(options.seed, wheel, left);
    landings += static_cast<double>(steps);
    if (steps < left) {
      const auto count = static_cast<double>(steps);
      rests += 1, rested += count, squares += count * count;
    }
    left -= steps;
    if (options.progress && wheel % block == 0)
      options.progress(1 - static_cast<double>(left) / static_cast<double>(options.landings));
  }
  if (rests < static_cast<double>(fewest_rests)) return std::nullopt;
  const double mean = rested / rests, variance = std::max(0.0, squares / rests - mean * mean);
  const double value = landings / rests, half = normal_95 * std::sqrt(variance / rests);
  return Estimate{value, std::max(1.0, value - half), value + half};
}

Sensitivities rolled_sensitivities(const Setting& setting, const RollOptions& options) {
  RollOptions pilot = options;
  pilot.progress = {};
  const std::optional<Estimate> steps = rolled_steps(setting, pilot);
  if (!steps)
    return {{}, fmt::format("fewer than {} wheels came to rest in {} landings", fewest_rests, options.landings)};
  const auto wheels = static_cast<std::size_t>(static_cast<double>(options.landings) / steps->value);
  const auto limit = static_cast<std::uint64_t>(std::ceil(cut * steps->value));

  struct Side {
    std::unique_ptr<Roller> roller;
    std::vector<double> steps;
  };
  Sensitivities result;
  std::vector<Side> sides;  // minus and plus of each parameter
  std::vector<double> distance;
  for (const Parameter parameter : moved_parameters) {
    const double value = matters(setting, parameter) ? parameter_value(setting, parameter) : 0;
    const double by = step_of(setting, parameter);
    if (!(value > 0) || !(by > 0)) continue;
    try {
      for (const double to : {value - by, value + by}) {
        Setting moved = setting;
        set_parameter(moved, parameter, to);
        sides.push_back({std::make_unique<Roller>(moved), std::vector<double>(wheels)});
      }
    } catch (const std::invalid_argument&) {  // at the end of its range it cannot be moved to both sides
      sides.resize(2 * distance.size());
      continue;
    }
    result.ranked.push_back({parameter, {}, value, 0, 0});
    distance.push_back(2 * by);
  }
  const std::size_t blocks = (wheels + block - 1) / block;
  const auto roll = [&](std::size_t k) {
    Side& side = sides[k / blocks];
    const std::size_t from = k % blocks * block;
    for (std::size_t t = from; t < std::min(from + block, wheels); ++t)
      side.steps[t] = static_cast<double>(side.roller->steps(options.seed, t, limit));
  };
  markov::parallel_for(sides.size() * blocks, options.threads, roll, options.progress);
  for (std::size_t i = 0; i < distance.size(); ++i)
    result.ranked[i] = difference(result.ranked[i], sides[2 * i].steps, sides[2 * i + 1].steps, distance[i]);
  std::ranges::stable_sort(result.ranked, [](const Sensitivity& a, const Sensitivity& b) {
    return std::abs(a.elasticity()) > std::abs(b.elasticity());
  });
  return result;
}

}  // namespace metastable::analysis
