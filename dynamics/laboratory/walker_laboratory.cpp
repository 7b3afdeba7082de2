#include "dynamics/laboratory/walker_laboratory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <ranges>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/laboratory/laboratory_draws.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr double radians = std::numbers::pi / 180;
constexpr double outlier_ratio = 4;     // of the slope's spread, as the catalogue has it
constexpr double clock_for_a_step = 2;  // [s] that the clock leaves for a step of each trial
constexpr double least_half_angle = 0.01, largest_half_angle = 1.5;  // [rad] of a launch that scatters

void require_walk(bool fine, const char* name, double value, const char* range) {
  if (!fine) throw std::invalid_argument(fmt::format("laboratory: {}: {} is outside {}", name, value, range));
}

// Returns the number of the walker that an outside effect sets.
double& size_of(RodWalkerOptions& walker, std::string_view id) {
  if (id == "round_feet") return walker.foot_radius;
  if (id == "hip_spring") return walker.hip_spring;
  if (id == "slow_motor") return walker.drive_torque;
  if (id == "swinging_load") return walker.load_mass;
  if (id == "swaying_ramp") return walker.sway;
  if (id == "loose_knee") return walker.knee_compliance;
  throw std::logic_error(fmt::format("walker_laboratory: nothing says where {} acts", id));
}

std::array<double, 3> numbers_of(const RodStride& s) { return {s.half_angle, s.stance_rate, s.swing_rate}; }

}  // namespace

const std::vector<OutsideInfo>& walker_outside_effects() {
  static const std::vector<OutsideInfo> all{
      {"round_feet", "feet are arcs that roll", 0.2},
      {"hip_spring", "a spring draws the legs together", 4},
      {"slow_motor", "a motor swings the leg forward, with a lag", 1.5},
      {"swinging_load", "a load hangs from the hip on a cord", 2},
      {"swaying_ramp", "the ramp sways along itself, from a phase that each trial draws", 0.02},
      {"loose_knee", "the standing leg's knee gives", 0.01},
  };
  return all;
}

const OutsideInfo& walker_outside_info(std::string_view id) {
  const auto& all = walker_outside_effects();
  const auto found = std::ranges::find(all, id, &OutsideInfo::id);
  if (found != all.end()) return *found;
  throw std::invalid_argument(fmt::format("outside effect: \"{}\" is none of {}", id,
                                          fmt::join(all | std::views::transform(&OutsideInfo::id), ", ")));
}

WalkerLaboratory::WalkerLaboratory(WalkerLaboratorySetup setup) : setup_(std::move(setup)) {
  const WalkerLaboratorySetup& s = setup_;
  require_walk(s.slope_deg > 0 && s.slope_deg < 45, "slope", s.slope_deg, "(0, 45) deg");
  require_walk(s.slope_sd_deg >= 0 && s.slope_sd_deg < 45, "slope_sd", s.slope_sd_deg, "[0, 45) deg");
  require_walk(s.launch.half_angle > 0 && s.launch.half_angle < std::numbers::pi / 2, "launch: half angle",
               s.launch.half_angle, "(0, pi/2) rad");
  require_walk(s.launch_spread >= 0 && s.launch_spread <= 0.2, "launch_spread", s.launch_spread, "[0, 0.2]");
  require_walk(s.trials >= 1, "trials", static_cast<double>(s.trials), "[1, inf)");
  require_walk(s.longest >= 1, "longest", static_cast<double>(s.longest), "[1, inf)");
  for (const double sd : s.sensor_sd) require_walk(sd >= 0, "sensor_sd", sd, "[0, inf)");
  using Values = const std::vector<double>&;
  std::map<std::string, std::function<void(Values)>, std::less<>> acts{
      {"hip_damping", [&](Values v) { walker_.hip_damping = v[0]; }},
      {"hip_dry_friction", [&](Values v) { walker_.hip_friction = v[0]; }},
      {"impact_loss", [&](Values v) { walker_.impact_loss = v[0]; }},
      {"foot_slip", [&](Values v) { walker_.foot_slip = v[0]; }},
      {"leg_mass",
       [&](Values v) {
         RodLeg& leg = walker_.legs[0];
         leg = {leg.mass * v[0], leg.foot_to_mass + v[1], leg.mass_to_hip - v[1]};
       }},
      {"leg_length", [&](Values v) { walker_.legs[0].foot_to_mass += v[0]; }},
      {"slope_deg_offset", [&](Values v) { terrain_.offset = v[0]; }},
      {"slope_deg_by_phase", [&](Values v) { terrain_.by_phase = v[0]; }},
      {"slope_deg_drift", [&](Values v) { terrain_.drift = v[0]; }},
      {"slope_deg_spread", [&](Values v) { terrain_.spread = v[0]; }},
      {"slope_deg_clock", [&](Values v) { terrain_.clock = v[0], terrain_.clock_hz = v[1]; }},
      {"slope_deg_stretch", [&](Values v) { terrain_.stretch = v[0], terrain_.from = v[1], terrain_.to = v[2]; }},
      {"memory", [&](Values v) { terrain_.memory = v[0]; }},
      {"outliers", [&](Values v) { terrain_.outliers = v[0]; }}};
  constexpr std::array states{"half_angle_rad", "stance_rate_rad_s", "swing_rate_rad_s"};
  for (std::size_t i = 0; i < states.size(); ++i)
    for (const auto& [what, numbers] : {std::pair("sensor_noise_", &added_noise_),
                                        {"sensor_bias_", &bias_},
                                        {"launch_", &launch_offset_},
                                        {"launch_spread_", &launch_scatter_}})
      acts[std::string(what) + states[i]] = [&number = (*numbers)[i]](Values v) { number = v[0]; };
  std::set<std::string> seen;
  for (const Effect& effect : s.effects) {
    const EffectInfo& info = walker_effect_info(effect.id);
    std::map<std::string, std::vector<double>> named;
    if (effect.values.size() != info.parameters.size())
      throw std::invalid_argument(
          fmt::format("effect {}: {} values, {} are needed", effect.id, effect.values.size(), info.parameters.size()));
    for (std::size_t p = 0; p < info.parameters.size(); ++p) named[info.parameters[p].name] = {effect.values[p]};
    effect_from_values(info, named, {});
    if (!seen.insert(effect.id).second) throw std::invalid_argument(fmt::format("effect {}: given twice", effect.id));
    acts.at(effect.id)(effect.values);
  }
  for (const OutsideEffect& effect : s.outside) {
    const OutsideInfo& info = walker_outside_info(effect.id);
    if (!(effect.size >= 0 && effect.size <= info.upper))
      throw std::invalid_argument(
          fmt::format("effect {}: size {} is outside [0, {}]", effect.id, effect.size, info.upper));
    if (!seen.insert(effect.id).second) throw std::invalid_argument(fmt::format("effect {}: given twice", effect.id));
    size_of(walker_, effect.id) = effect.size;
  }
  if (walker_.foot_radius > 0 && walker_.knee_compliance > 0)
    throw std::invalid_argument("effect loose_knee: it is not known with round_feet");
}

// Returns the slope that the step from a row meets [rad]. @param own  the trial's part [deg]
double WalkerLaboratory::slope(const WalkedRow& row, std::size_t trial, double own, double score) const {
  const Terrain& t = terrain_;
  const double last = setup_.trials > 1 ? static_cast<double>(setup_.trials - 1) : 1;
  double degrees = setup_.slope_deg + t.offset + own + setup_.slope_sd_deg * score;
  if (row.leg == 1) degrees += t.by_phase;
  degrees += t.drift * (static_cast<double>(trial) / last - 0.5);
  if (t.clock != 0) degrees += t.clock * std::cos(2 * std::numbers::pi * t.clock_hz * row.time);
  if (row.position >= t.from && row.position < t.to) degrees += t.stretch;
  return radians * degrees;
}

WalkedTrial WalkerLaboratory::run(std::size_t index) const {
  const std::uint64_t seed = setup_.seed;
  const std::array<double, 4> own = laboratory_normals(seed, index, 0, LaboratoryDraw::walk_trial);
  RodWalkerOptions options = walker_;
  options.sway_phase_rad = 2 * std::numbers::pi * laboratory_uniforms(seed, index, 0, LaboratoryDraw::walk_sway)[0];
  const std::array<double, 4> off = laboratory_normals(seed, index, 0, LaboratoryDraw::walk_launch);
  const auto launched = [&](double value, std::size_t i) {
    return value * (1 + setup_.launch_spread * own[i + 1]) + launch_offset_[i] + launch_scatter_[i] * off[i];
  };
  const RodStride launch{std::clamp(launched(setup_.launch.half_angle, 0), least_half_angle, largest_half_angle),
                         launched(setup_.launch.stance_rate, 1), launched(setup_.launch.swing_rate, 2)};
  RodWalker walker(options, static_cast<int>(index % 2), launch);
  const double start = clock_for_a_step * static_cast<double>(setup_.longest) * static_cast<double>(index);
  const double first_foot = walker.position();
  WalkedTrial trial;
  double last_score = laboratory_normals(seed, index, 1, LaboratoryDraw::walk_trial)[0];
  for (;;) {
    const std::uint64_t step = trial.rows.size();
    WalkedRow row{walker.stance_leg() + 1, start + walker.time(), walker.position() - first_foot, walker.stride(), {}};
    const std::array<double, 4> errors = laboratory_normals(seed, index, step, LaboratoryDraw::walk_sensor);
    const std::array<double, 4> noise = laboratory_normals(seed, index, step, LaboratoryDraw::walk_noise);
    std::array<double, 3> seen = numbers_of(row.truth);
    for (std::size_t i = 0; i < 3; ++i)
      seen[i] += setup_.sensor_sd[i] * errors[i] + added_noise_[i] * noise[i] + bias_[i];
    row.seen = {seen[0], seen[1], seen[2]};
    const std::array<double, 4> drawn = laboratory_uniforms(seed, index, step, LaboratoryDraw::walk_slope);
    double score = normal_quantile(drawn[0]);
    if (drawn[1] < terrain_.outliers) score *= outlier_ratio;
    score = terrain_.memory * last_score + std::sqrt(1 - terrain_.memory * terrain_.memory) * score;
    last_score = score;
    trial.rows.push_back(row);
    if (trial.rows.size() == setup_.longest) return trial;
    trial.fell = !walker.step(slope(row, index, terrain_.spread * own[0], score));
    if (trial.fell) return trial;
  }
}

}  // namespace metastable::dynamics
