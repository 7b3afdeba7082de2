#include "dynamics/catalogue/effect_catalogue.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <ranges>
#include <stdexcept>
#include <utility>

#include "dynamics/catalogue/walker_effects.h"

namespace metastable::dynamics {
namespace {

constexpr double full_turn = 2 * std::numbers::pi;

std::vector<EffectInfo> make_catalogue() {
  const std::string stretch_end = "end of the stretch, down the ramp from foot 1; 0: the ramp's end";
  std::vector<EffectInfo> all{
      {"contact_distribution",
       "means or spreads of restitution and friction differ from the nominal ones",
       {effect_parameter("restitution_mean", "", std::nullopt, 0, 1, "mean of eta (before truncation to [0, 1])"),
        effect_parameter("restitution_sd", "", std::nullopt, 0, 0.5, "standard deviation of eta (before truncation)"),
        effect_parameter("friction_mean", "", std::nullopt, 0, 2, "mean of mu (before truncation to [0, inf))"),
        effect_parameter("friction_sd", "", std::nullopt, 0, 1, "standard deviation of mu (before truncation)")}},
      {"initial_speed",
       "the launch speeds differ from the stated distribution",
       {effect_parameter("mean_rad_s", "rad/s", 0, -3, 3, "added to the mean launch speed of every condition"),
        effect_parameter("sd_rad_s", "rad/s", 0, -1, 1,
                         "added to the standard deviation of every condition's launch speed (not below 0)")}},
      {"leg_lengths",
       "legs differ from the stated lengths",
       {{.name = "leg_lengths_m",
         .unit = "m",
         .neutral = std::nullopt,
         .lower = 0.01,
         .upper = 2,
         .meaning = "true lengths, in the order the legs land",
         .per_leg = true}}},
      {"leg_contact",
       "one leg has another friction or restitution",
       {{.name = "leg",
         .unit = "",
         .neutral = 0,
         .lower = 0,
         .upper = 63,
         .meaning = "the leg, from 0",
         .integer = true,
         .place = true},
        effect_parameter("friction_ratio", "", 1, 0.1, 5, "multiplies mu when that leg lands"),
        effect_parameter("restitution_ratio", "", 1, 0, 3, "multiplies eta when that leg lands (at most 1)")}},
      {"hub_eccentricity",
       "the centre of mass lies off the geometric centre",
       {effect_parameter("offset_m", "m", 0, 0, 0.05,
                         "distance of the centre of mass from the geometric centre, in stance, inertia and contact"),
        effect_place("phase_rad", "rad", 0, -full_turn, full_turn,
                     "its direction, from leg 0 the way the landing legs follow each other (leg k lies at k alpha)")}},
      {"inertia",
       "the inertia differs",
       {effect_parameter("ratio", "", 1, 0.5, 2,
                         "multiplies the inertia about the foot, in stance and energy balance")}},
      {"slope_offset",
       "the ramp's slope is misread",
       {effect_parameter("offset_deg", "deg", 0, -3, 3, "true slope minus stated slope")}},
      {"slope_profile",
       "the slope varies along the ramp",
       {effect_parameter(
            "sag_m", "m", 0, -0.1, 0.1,
            "depth by which a parabola sags below its chord in the middle of the stretch; negative: bows up"),
        effect_place("from_m", "m", 0, 0, 100, "start of the stretch, down the ramp from foot 1"),
        effect_place("to_m", "m", 0, 0, 100, stretch_end)}},
      {"axle_drag_viscous",
       "a resisting torque proportional to the speed",
       {effect_parameter("n_m_s", "N m s", 0, 0, 10, "b in the torque b omega during stance")}},
      {"rolling_resistance",
       "a constant resisting torque",
       {effect_parameter("torque_n_m", "N m", 0, 0, 100, "the torque during stance")}},
      {"air_drag",
       "a resisting torque proportional to the speed squared",
       {effect_parameter("n_m_s2", "N m s^2", 0, 0, 1, "c in the torque c omega^2 during stance")}},
      {"speed_dependent_restitution",
       "restitution falls or rises with the impact speed",
       {effect_parameter("exponent", "", 0, -2, 2, "p in eta (omega / 5 rad/s)^-p (at most 1)")}},
      {"speed_dependent_friction",
       "friction falls from a static to a kinetic value with the speed",
       {effect_parameter("amplitude", "", 0, -0.9, 5, "a in mu (1 + a exp(-omega / speed_rad_s))"),
        effect_place("speed_rad_s", "rad/s", 5, 0.1, 50, "the speed on which it falls")}},
      {"contact_memory",
       "successive collisions of a trial are correlated",
       {effect_parameter(
           "correlation", "", 0, -0.99, 0.99,
           "of successive normal scores of eta, and of mu, within a trial (first-order autoregression)")}},
      {"friction_patch",
       "friction differs over an interval of the ramp",
       {effect_place("from_m", "m", 0, 0, 100, "start of the interval, down the ramp from foot 1"),
        effect_place("to_m", "m", 0, 0, 100, "end of the interval; 0: the ramp's end"),
        effect_parameter("friction_ratio", "", 1, 0.1, 5, "multiplies mu of feet that land in the interval")}},
      {"trial_drift",
       "friction drifts over the trials (wear, static charge)",
       {effect_parameter("relative_change", "", 0, -0.9, 5,
                         "r in mu (1 + r (t - 1)/(N - 1)) of trial t = 1..N, in the order they were run")}},
      {"trial_spread",
       "every trial has its own mean friction",
       {effect_parameter("friction_sd", "", 0, 0, 0.5,
                         "standard deviation of what each trial adds to mu (mu at least 0)")}},
      {"contact_outliers",
       "rare collisions with much larger losses (grit)",
       {effect_parameter("share", "", 0, 0, 0.5, "probability of a collision to be one"),
        effect_parameter("friction_ratio", "", 1, 0.1, 10, "multiplies mu of such a collision")},
       true},
      {"sensor_noise",
       "white noise on the reported speeds, beyond the stated one",
       {effect_parameter("sd_rad_s", "rad/s", 0, 0, 2, "its standard deviation, independent at every reported speed")}},
      {"sensor_bias",
       "smoothing and peak picking bias the reported speeds",
       {effect_parameter("bias_rad_s", "rad/s", 0, -2, 2,
                         "added to every reported speed, before and after collisions")}},
      {"bounce",
       "the rebound's energy, or a share of it, is lost in hops, above a speed at which feet begin to hop",
       {effect_parameter("rebound_lost", "", 0, 0, 1,
                         "share of the kinetic energy given back by restitution at the foot that is lost as well"),
        effect_place("onset_rad_s", "rad/s", 0, 0, 50, "collisions of lower omega- do not hop; 0: all do")}},
      {"soft_contact",
       "the tips of legs are soft: the wheel turns on while one is pressed; law settled",
       {effect_parameter("compliance_m_n", "m/N", 0, 0, 1e-5,
                         "1 / stiffness of a tip along the normal, a spring with a damper that gives back eta")}},
      {"ramp_vibration",
       "the ramp rings: a loss depends on the time since the previous collision",
       {effect_parameter("amplitude", "", 0, 0, 1,
                         "A in the factor 1 + A cos(2 pi f dt) on a collision's loss; first collision of a trial: 1"),
        effect_place("frequency_hz", "Hz", 10, 0.5, 60, "f in that factor; dt: time since the previous collision")}},
      {"slip_reversal", "collisions obey `coulomb` with the wheel's radius of gyration", {}},
  };
  return all;
}

[[noreturn]] void refuse(std::string_view id, std::string_view name, const std::string& what) {
  throw std::invalid_argument(fmt::format("effect {}: {}{}{}", id, name, name.empty() ? "" : ": ", what));
}

void check(std::string_view id, const EffectParameter& p, double value) {
  if (!(value >= p.lower && value <= p.upper))
    refuse(
        id, p.name,
        fmt::format("{}{}{} is outside [{:.6g}, {:.6g}]", value, p.unit.empty() ? "" : " ", p.unit, p.lower, p.upper));
  if (p.integer && value != std::floor(value)) refuse(id, p.name, fmt::format("{} is not a whole number", value));
}

std::vector<double> as_stated(const EffectParameter& p, const NominalValues& nominal) {
  if (p.per_leg) return nominal.leg_lengths;
  if (p.name == "restitution_mean") return {nominal.restitution_mean};
  if (p.name == "restitution_sd") return {nominal.restitution_sd};
  if (p.name == "friction_mean") return {nominal.friction_mean};
  if (p.name == "friction_sd") return {nominal.friction_sd};
  throw std::logic_error("as_stated: " + p.name + " has no neutral value");
}

double number(std::string_view effect, std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    throw std::invalid_argument(fmt::format("effect {}: \"{}\" is not a number", effect, text));
  return value;
}

// Refuses an effect of which no size is named: it would be silently without effect.
void require_size(const EffectInfo& info, const std::map<std::string, std::vector<double>>& named,
                  const NominalValues& nominal) {
  std::vector<std::string> sizes, ranges, form;
  bool all = true, any = false;
  for (const EffectParameter& p : info.parameters) {
    const bool counted = p.name == "leg" && !nominal.leg_lengths.empty();
    const double upper = counted ? static_cast<double>(nominal.leg_lengths.size() - 1) : p.upper;
    ranges.push_back(
        fmt::format("{} in [{:.6g}, {:.6g}]{}{}", p.name, p.lower, upper, p.unit.empty() ? "" : " ", p.unit));
    form.push_back(fmt::format("{}=VALUE{}", p.name, p.per_leg ? ";VALUE;..." : ""));
    if (p.place) continue;
    sizes.push_back(p.name);
    any = any || named.contains(p.name);
    all = all && named.contains(p.name);
  }
  if (sizes.empty() || (info.takes_all_sizes ? all : any)) return;
  refuse(info.id, "",
         fmt::format("does nothing without {}; it takes {}, written {}:{}",
                     fmt::join(sizes, info.takes_all_sizes ? " and " : " or "), fmt::join(ranges, ", "), info.id,
                     fmt::join(form, ",")));
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const auto at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

}  // namespace

EffectParameter effect_parameter(std::string name, std::string unit, std::optional<double> neutral, double lower,
                                 double upper, std::string meaning) {
  return {.name = std::move(name),
          .unit = std::move(unit),
          .neutral = neutral,
          .lower = lower,
          .upper = upper,
          .meaning = std::move(meaning)};
}

EffectParameter effect_place(std::string name, std::string unit, std::optional<double> neutral, double lower,
                             double upper, std::string meaning) {
  EffectParameter one = effect_parameter(std::move(name), std::move(unit), neutral, lower, upper, std::move(meaning));
  one.place = true;
  return one;
}

const std::vector<EffectInfo>& effect_catalogue() {
  static const std::vector<EffectInfo> catalogue = make_catalogue();
  return catalogue;
}

std::vector<std::string> effect_ids() {
  std::vector<std::string> ids;
  for (const EffectInfo& info : effect_catalogue()) ids.push_back(info.id);
  return ids;
}

std::string effect_unit(std::string_view effect, std::string_view parameter) {
  for (const EffectInfo& info : effect_catalogue())
    if (info.id == effect)
      for (const EffectParameter& p : info.parameters)
        if (p.name == parameter) return p.unit;
  return "";
}

const EffectInfo& effect_info(std::string_view id) {
  const auto& all = effect_catalogue();
  const auto found = std::find_if(all.begin(), all.end(), [id](const EffectInfo& info) { return info.id == id; });
  if (found != all.end()) return *found;
  throw std::invalid_argument(fmt::format("effect: \"{}\" is none of {}", id, fmt::join(effect_ids(), ", ")));
}

Effect effect_from_values(std::string_view id, const std::map<std::string, std::vector<double>>& values,
                          const NominalValues& nominal) {
  return effect_from_values(effect_info(id), values, nominal);
}

Effect effect_from_values(const EffectInfo& info, const std::map<std::string, std::vector<double>>& values,
                          const NominalValues& nominal) {
  const std::string_view id = info.id;
  for (const auto& [name, given] : values)
    if (std::none_of(info.parameters.begin(), info.parameters.end(),
                     [&name = name](const EffectParameter& p) { return p.name == name; })) {
      const std::string known =
          fmt::format("{}", fmt::join(info.parameters | std::views::transform(&EffectParameter::name), ", "));
      refuse(id, "", fmt::format("\"{}\" is none of its parameters ({})", name, known.empty() ? "it has none" : known));
    }
  Effect effect{info.id, {}};
  double from = 0;
  for (const EffectParameter& p : info.parameters) {
    const auto named = values.find(p.name);
    const std::vector<double> given = named != values.end() ? named->second
                                      : p.neutral           ? std::vector{*p.neutral}
                                                            : as_stated(p, nominal);
    const std::size_t needed = p.per_leg ? nominal.leg_lengths.size() : 1;
    if (given.size() != needed) refuse(id, p.name, fmt::format("{} values, {} are needed", given.size(), needed));
    for (const double value : given) check(id, p, value);
    if (p.name == "leg" && !nominal.leg_lengths.empty() && given[0] >= static_cast<double>(nominal.leg_lengths.size()))
      refuse(id, p.name, fmt::format("{} is outside [0, {}]", given[0], nominal.leg_lengths.size() - 1));
    if (p.name == "from_m") from = given[0];
    if (p.name == "to_m" && given[0] != 0 && given[0] <= from)
      refuse(id, p.name, fmt::format("{} m does not lie beyond from_m, {} m", given[0], from));
    effect.values.insert(effect.values.end(), given.begin(), given.end());
  }
  return effect;
}

Effect effect_from_text(std::string_view text, const NominalValues& nominal, const EffectInfo& info) {
  const auto colon = text.find(':');
  const std::string_view id = info.id;
  std::map<std::string, std::vector<double>> values;
  if (colon != std::string_view::npos)
    for (const std::string_view part : split(text.substr(colon + 1), ',')) {
      const auto equals = part.find('=');
      if (equals == std::string_view::npos)
        throw std::invalid_argument(fmt::format("effect {}: \"{}\" is not of the form parameter=value", id, part));
      std::vector<double>& list = values[std::string(part.substr(0, equals))];
      if (!list.empty())
        throw std::invalid_argument(fmt::format("effect {}: {} is given twice", id, part.substr(0, equals)));
      for (const std::string_view one : split(part.substr(equals + 1), ';')) list.push_back(number(id, one));
    }
  Effect effect = effect_from_values(info, values, nominal);
  require_size(info, values, nominal);
  return effect;
}

Effect effect_from_text(std::string_view text, const NominalValues& nominal,
                        const EffectInfo& (*info_of)(std::string_view)) {
  return effect_from_text(text, nominal, info_of(text.substr(0, text.find(':'))));
}

std::string effect_text(const Effect& effect) {
  const EffectInfo& info = any_effect_info(effect.id);
  std::string text = effect.id;
  std::size_t at = 0;
  for (std::size_t p = 0; p < info.parameters.size(); ++p) {
    const std::size_t count = info.parameters[p].per_leg ? effect.values.size() - (info.parameters.size() - 1) : 1;
    text += fmt::format("{}{}=", p == 0 ? ":" : ",", info.parameters[p].name);
    for (std::size_t k = 0; k < count; ++k) text += fmt::format("{}{}", k == 0 ? "" : ";", effect.values.at(at++));
  }
  return text;
}

}  // namespace metastable::dynamics
