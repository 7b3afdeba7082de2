#include "dynamics/catalogue/walker_effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <ranges>
#include <stdexcept>
#include <tuple>

namespace metastable::dynamics {
namespace {

EffectParameter sized(std::string name, std::string unit, double lower, double upper, std::string meaning,
                      double neutral = 0) {
  return effect_parameter(std::move(name), std::move(unit), neutral, lower, upper, std::move(meaning));
}

EffectParameter placed(std::string name, std::string unit, double lower, double upper, std::string meaning,
                       double neutral = 0) {
  return effect_place(std::move(name), std::move(unit), neutral, lower, upper, std::move(meaning));
}

void add_sensors(std::vector<EffectInfo>& all) {
  for (const auto& [state, unit, most] : {std::tuple("half_angle_rad", "rad", 0.02),
                                          {"stance_rate_rad_s", "rad/s", 0.2},
                                          {"swing_rate_rad_s", "rad/s", 0.2}}) {
    all.push_back({fmt::format("sensor_noise_{}", state),
                   fmt::format("the sensor of {} is noisier than stated", state),
                   {sized("sd", unit, 0, most, "of an error beside the stated one")}});
    all.push_back({fmt::format("sensor_bias_{}", state),
                   fmt::format("the sensor of {} is off", state),
                   {sized("bias", unit, -most, most, "added to every value")}});
  }
}

void add_launches(std::vector<EffectInfo>& all) {
  for (const auto& [state, unit, most] : {std::tuple("half_angle_rad", "rad", 0.1),
                                          {"stance_rate_rad_s", "rad/s", 1.0},
                                          {"swing_rate_rad_s", "rad/s", 1.0}}) {
    all.push_back({fmt::format("launch_{}", state),
                   fmt::format("walks begin with another {} than stated", state),
                   {sized("offset", unit, -most, most, "added to the stated mean of first values")}});
    all.push_back({fmt::format("launch_spread_{}", state),
                   fmt::format("the {} with which walks begin scatters more than stated", state),
                   {sized("sd_between_trials", unit, 0, 0.5 * most, "of first values, beside the stated sd")}});
  }
}

std::vector<EffectInfo> make_effects() {
  std::vector<EffectInfo> all{
      {"hip_damping",
       "the hip resists turning in proportion to its rate",
       {sized("damping", "N m s/rad", 0, 5, "torque between the legs a rate of turning against each other")}},
      {"hip_dry_friction",
       "the hip resists turning with a constant torque",
       {sized("torque", "N m", 0, 5, "its size; it never holds the legs still")}},
      {"impact_loss",
       "a strike takes more energy than a plastic one",
       {sized("share", "", -0.3, 0.3, "of the energy of motion after a plastic strike")}},
      {"foot_slip",
       "the struck foot slips on as it is loaded",
       {sized("slip", "m", 0, 0.2, "away from the other foot")}},
      {"leg_mass",
       "the mass of leg 1 differs from the stated one, in size or place",
       {sized("mass_ratio", "", 0.5, 2, "the mass over the stated one", 1),
        sized("higher", "m", -0.2, 0.2, "by which it sits nearer to the hip")}},
      {"leg_length",
       "leg 1 is longer than stated",
       {sized("longer", "m", -0.05, 0.05, "by which it reaches further below its mass")}},
      {"slope_deg_offset",
       "the mean slope differs from the stated one",
       {sized("offset_deg", "deg", -2, 2, "added to it")}},
      {"slope_deg_by_phase",
       "the slope differs by the standing leg",
       {sized("change_in_1", "deg", -1.5, 1.5, "added where leg 1 stands")}},
      {"slope_deg_drift",
       "the mean slope drifts over the trials",
       {sized("change_over_the_runs", "deg", -1.5, 1.5, "from the first trial to the last, about the stated mean")}},
      {"slope_deg_spread",
       "the mean slope differs from trial to trial",
       {sized("sd_between_trials", "deg", 0, 1.5, "its standard deviation")}},
      {"slope_deg_clock",
       "the mean slope swings with the clock",
       {sized("amplitude", "deg", 0, 1.5, "A in A cos(2 pi f t), t since the first row of the first trial"),
        placed("frequency_hz", "Hz", 1e-4, 2, "f in that", 0.05)}},
      {"slope_deg_stretch",
       "the mean slope differs on a stretch of the way",
       {sized("change", "deg", -1.5, 1.5, "added there"),
        placed("from_m", "m", 0, 1000, "beginning of the stretch, by the standing foot's position"),
        placed("to_m", "m", 0, 1000, "its end", 1)}},
      {"memory",
       "the slopes of successive steps are correlated",
       {sized("correlation", "", -0.9, 0.9, "of a step's slope with the last one's"),
        placed("noise_number", "", 1, 1, "the slope is the only noise", 1)}},
      {"outliers",
       "some steps meet a slope from a spread four times as wide",
       {sized("share", "", 0, 0.2, "of the steps")}},
  };
  add_sensors(all);
  add_launches(all);
  return all;
}

const EffectInfo* found(const std::vector<EffectInfo>& all, std::string_view id) {
  const auto at = std::ranges::find(all, id, &EffectInfo::id);
  return at == all.end() ? nullptr : &*at;
}

}  // namespace

const std::vector<EffectInfo>& walker_effects() {
  static const std::vector<EffectInfo> all = make_effects();
  return all;
}

const EffectInfo& walker_effect_info(std::string_view id) {
  if (const EffectInfo* info = found(walker_effects(), id)) return *info;
  throw std::invalid_argument(fmt::format("effect: \"{}\" is none of {}", id,
                                          fmt::join(walker_effects() | std::views::transform(&EffectInfo::id), ", ")));
}

const EffectInfo& any_effect_info(std::string_view id) {
  const EffectInfo* info = found(walker_effects(), id);
  return info ? *info : effect_info(id);
}

}  // namespace metastable::dynamics
