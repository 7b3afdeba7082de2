#include "dynamics/return_map/rough_terrain.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double widest_sd = 10 * degree;  // beyond it slopes wrap around

// x' = keep x - G (1 - keep) + G amplitude cos(gamma - best), the map with the slope's two cosines joined.
struct Joined {
  double keep, gain, amplitude, best;
  explicit Joined(const RoughTerrainWheel::Options& o) {
    const double a = o.half_leg_angle_rad, cosine = std::cos(2 * a);
    keep = cosine * cosine;
    gain = 2 * o.gravity / o.leg_length;
    const double along = (1 - keep) * std::cos(a), across = (1 + keep) * std::sin(a);
    amplitude = std::hypot(along, across);
    best = std::atan2(across, along);
  }
  double extreme(double state, double cosine) const {
    return keep * state - gain * (1 - keep) + gain * amplitude * cosine;
  }
};

void require(bool valid, const char* name, double value, const char* range) {
  if (!valid) throw std::invalid_argument(fmt::format("{}: {:.6g} is outside {}", name, value, range));
}

}  // namespace

RoughTerrainWheel::RoughTerrainWheel(Options options) : options_(options) {
  const Options& o = options_;
  require(std::abs(o.mean_slope_rad) < 45 * degree, "mean_slope [deg]", o.mean_slope_rad / degree, "(-45, 45)");
  require(o.sd_slope_rad >= 0 && o.sd_slope_rad <= widest_sd, "sd_slope [deg]", o.sd_slope_rad / degree, "[0, 10]");
  require(o.half_leg_angle_rad > 0 && o.half_leg_angle_rad < 45 * degree, "half_leg_angle [deg]",
          o.half_leg_angle_rad / degree, "(0, 45)");
  require(o.gravity > 0 && std::isfinite(o.gravity), "gravity [m/s^2]", o.gravity, "(0, inf)");
  require(o.leg_length > 0 && std::isfinite(o.leg_length), "leg_length [m]", o.leg_length, "(0, inf)");
}

double RoughTerrainWheel::next(double state, double slope) const {
  const double a = options_.half_leg_angle_rad, cosine = std::cos(2 * a),
               gain = 2 * options_.gravity / options_.leg_length;
  return cosine * cosine * (state + gain * (1 - std::cos(a + slope))) - gain * (1 - std::cos(a - slope));
}

double RoughTerrainWheel::fixed_point() const {
  const double cosine = std::cos(2 * options_.half_leg_angle_rad);
  const double fixed = next(0, options_.mean_slope_rad) / (1 - cosine * cosine);
  if (!(fixed > 0))
    throw std::domain_error(
        fmt::format("fixed point: the wheel rests on a slope of {:.6g} deg", options_.mean_slope_rad / degree));
  return fixed;
}

std::pair<double, double> RoughTerrainWheel::state_interval(int) const {
  const Joined joined(options_);
  return {0, joined.extreme(0, 1) / (1 - joined.keep)};
}

std::optional<double> RoughTerrainWheel::landing(double state, int, std::span<const double> score) const {
  const double landed = next(state, options_.mean_slope_rad + options_.sd_slope_rad * score[0]);
  if (landed <= 0) return std::nullopt;
  return landed;
}

std::optional<double> RoughTerrainWheel::rest_probability(double state, int) const {
  const Joined joined(options_);
  if (options_.sd_slope_rad == 0) return next(state, options_.mean_slope_rad) <= 0 ? 1 : 0;
  // It rests where cos(gamma - best) <= threshold: on slopes too flat, and on slopes too steep.
  const double threshold = -joined.extreme(state, 0) / (joined.gain * joined.amplitude);
  if (threshold >= 1) return 1;
  if (threshold < -1) return 0;
  const double reach = std::acos(threshold);
  return normal_cdf((joined.best - reach - options_.mean_slope_rad) / options_.sd_slope_rad) +
         normal_cdf((options_.mean_slope_rad - joined.best - reach) / options_.sd_slope_rad);
}

double RoughTerrainWheel::landing_density(double state, int phase, std::span<const double> next,
                                          std::span<double> density) const {
  const double sd = options_.sd_slope_rad;
  if (sd == 0)
    throw std::invalid_argument("method integrated: a constant slope leaves no density; use the sampled method");
  const Joined joined(options_);
  const double reach = joined.gain * joined.amplitude, level = joined.extreme(state, 0);
  for (std::size_t k = 0; k < next.size(); ++k) {
    const double cosine = (next[k] - level) / reach;
    density[k] = 0;
    if (!(std::abs(cosine) < 1)) continue;
    const double angle = std::acos(cosine), speed = reach * std::sqrt((1 - cosine) * (1 + cosine));
    for (const double slope : {joined.best - angle, joined.best + angle})
      density[k] += normal_density((slope - options_.mean_slope_rad) / sd) / (sd * speed);
  }
  return *rest_probability(state, phase);
}

std::pair<double, double> RoughTerrainWheel::landing_range(double state, int) const {
  const auto landed = [](double x) { return x > 0 ? x : -std::numeric_limits<double>::infinity(); };
  if (options_.sd_slope_rad == 0) {
    const double only = landed(next(state, options_.mean_slope_rad));
    return {only, only};
  }
  const Joined joined(options_);
  return {landed(joined.extreme(state, -1)), landed(joined.extreme(state, 1))};
}

}  // namespace metastable::dynamics
