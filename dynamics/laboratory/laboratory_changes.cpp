#include "dynamics/laboratory/laboratory_changes.h"

#include <fmt/format.h>

#include <functional>
#include <map>
#include <set>
#include <span>
#include <stdexcept>
#include <string>

namespace metastable::dynamics {
namespace {

using Values = std::span<const double>;
struct Change {
  std::function<void(LaboratoryChanges&, Values)> make;
  bool may_repeat = false;  // another leg, another patch
};

const std::map<std::string, Change, std::less<>>& changes() {
  using C = LaboratoryChanges;
  static const std::map<std::string, Change, std::less<>> all{
      {"contact_distribution", {[](C& c, Values v) {
         c.stated.restitution_mean = v[0], c.stated.restitution_sd = v[1];
         c.stated.friction_mean = v[2], c.stated.friction_sd = v[3];
       }}},
      {"initial_speed", {[](C& c, Values v) { c.launch_mean = v[0], c.launch_sd = v[1]; }}},
      {"leg_lengths", {[](C& c, Values v) { c.stated.leg_lengths.assign(v.begin(), v.end()); }}},
      {"leg_contact",
       {[](C& c, Values v) {
          c.legs.push_back({static_cast<int>(v[0]), v[1], v[2]});
        },
        true}},
      {"hub_eccentricity", {[](C& c, Values v) { c.mass_offset = v[0], c.mass_angle_rad = v[1]; }}},
      {"inertia", {[](C& c, Values v) { c.inertia_ratio = v[0]; }}},
      {"slope_offset", {[](C& c, Values v) { c.slope_offset_deg = v[0]; }}},
      {"slope_profile", {[](C& c, Values v) { c.sag = v[0], c.sag_from = v[1], c.sag_to = v[2]; }}},
      {"axle_drag_viscous", {[](C& c, Values v) { c.linear_drag = v[0]; }}},
      {"rolling_resistance", {[](C& c, Values v) { c.constant_drag = v[0]; }}},
      {"air_drag", {[](C& c, Values v) { c.quadratic_drag = v[0]; }}},
      {"speed_dependent_restitution", {[](C& c, Values v) { c.restitution_exponent = v[0]; }}},
      {"speed_dependent_friction", {[](C& c, Values v) { c.stribeck_amplitude = v[0], c.stribeck_speed = v[1]; }}},
      {"contact_memory", {[](C& c, Values v) { c.memory = v[0]; }}},
      {"friction_patch",
       {[](C& c, Values v) {
          c.patches.push_back({v[0], v[1], v[2]});
        },
        true}},
      {"trial_drift", {[](C& c, Values v) { c.drift = v[0]; }}},
      {"trial_spread", {[](C& c, Values v) { c.trial_sd = v[0]; }}},
      {"contact_outliers", {[](C& c, Values v) { c.outlier_share = v[0], c.outlier_ratio = v[1]; }}},
      {"sensor_noise", {[](C& c, Values v) { c.sensor_noise = v[0]; }}},
      {"sensor_bias", {[](C& c, Values v) { c.sensor_bias = v[0]; }}},
      {"bounce", {[](C& c, Values v) { c.rebound_lost = v[0], c.hops_from = v[1]; }}},
      {"soft_contact", {[](C& c, Values v) { c.compliance = v[0]; }}},
      {"ramp_vibration", {[](C& c, Values v) { c.vibration = v[0], c.vibration_hz = v[1]; }}},
      {"slip_reversal", {[](C& c, Values) { c.slip_reversal = true; }}},
  };
  return all;
}

// Takes the effect through the catalogue's own checks.
void check(const Effect& effect, const NominalValues& stated) {
  const EffectInfo& info = effect_info(effect.id);
  std::map<std::string, std::vector<double>> named;
  std::size_t at = 0;
  for (const EffectParameter& p : info.parameters) {
    const std::size_t count = p.per_leg ? stated.leg_lengths.size() : 1;
    if (at + count > effect.values.size())
      throw std::invalid_argument(fmt::format("effect {}: {} values are too few", effect.id, effect.values.size()));
    const auto first = effect.values.begin() + static_cast<std::ptrdiff_t>(at);
    named[p.name].assign(first, first + static_cast<std::ptrdiff_t>(count));
    at += count;
  }
  if (at != effect.values.size())
    throw std::invalid_argument(
        fmt::format("effect {}: {} values, {} are needed", effect.id, effect.values.size(), at));
  effect_from_values(effect.id, named, stated);
}

}  // namespace

LaboratoryChanges laboratory_changes(const NominalValues& stated, const std::vector<Effect>& effects,
                                     const std::vector<OutsideEffect>& outside) {
  LaboratoryChanges c;
  c.stated = stated;
  std::set<std::string> seen;
  for (const Effect& effect : effects) {
    check(effect, stated);
    const auto found = changes().find(effect.id);
    if (found == changes().end())
      throw std::logic_error(fmt::format("laboratory_changes: nothing says what {} changes", effect.id));
    if (!seen.insert(effect.id).second && !found->second.may_repeat)
      throw std::invalid_argument(fmt::format("effect {}: given twice", effect.id));
    found->second.make(c, effect.values);
  }
  using C = LaboratoryChanges;
  const std::map<std::string, double C::*, std::less<>> sizes{{"sloshing_fluid", &C::slosh},
                                                              {"stored_energy", &C::stored},
                                                              {"second_memory", &C::second_memory},
                                                              {"crosswind", &C::wind}};
  for (const OutsideEffect& effect : outside) {
    const OutsideInfo& info = outside_info(effect.id);
    if (!(effect.size >= 0 && effect.size <= info.upper))
      throw std::invalid_argument(
          fmt::format("effect {}: size {} is outside [0, {}]", effect.id, effect.size, info.upper));
    if (!seen.insert(effect.id).second) throw std::invalid_argument(fmt::format("effect {}: given twice", effect.id));
    if (info.change)
      c.of_contact.push_back(effect);
    else
      c.*sizes.at(effect.id) = effect.size;
  }
  return c;
}

}  // namespace metastable::dynamics
