#pragma once
// Lists effects that a model of the wheel may lack: their names, parameters and meaning. No formula lives here: the
// virtual laboratory and the diagnosis each put them into their own equations.

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace metastable::dynamics {

/// Describes one parameter of an effect.
struct EffectParameter {
  std::string name;
  std::string unit;               ///< "" for a ratio
  std::optional<double> neutral;  ///< value without effect; nothing: as the model states it (NominalValues)
  double lower = 0, upper = 0;    ///< allowed range, bounds included
  std::string meaning;
  bool integer = false;  ///< only whole numbers
  bool per_leg = false;  ///< a list, one value a leg
  bool place = false;    ///< it says where, when or how fast, not how much: by itself it does nothing
};

/// Describes a number on a range. @param neutral  as EffectParameter's
EffectParameter effect_parameter(std::string name, std::string unit, std::optional<double> neutral, double lower,
                                 double upper, std::string meaning);

/// Describes a number that says where, when or how fast.
EffectParameter effect_place(std::string name, std::string unit, std::optional<double> neutral, double lower,
                             double upper, std::string meaning);

/// Describes one effect. eta and mu stand for the restitution and friction drawn at a collision.
struct EffectInfo {
  std::string id;
  std::string summary;
  std::vector<EffectParameter> parameters;
  bool takes_all_sizes = false;  ///< of several sizes each alone does nothing
};

/// The one effect that is no missing physics: other contact parameters, which a recalibration refits.
inline constexpr std::string_view contact_distribution_id = "contact_distribution";

/// Lists all effects, in a fixed order.
const std::vector<EffectInfo>& effect_catalogue();
/// Lists their ids.
std::vector<std::string> effect_ids();
/// @throws std::invalid_argument naming the id and all known ones
const EffectInfo& effect_info(std::string_view id);
/// Returns the unit of an effect's parameter; "" for a ratio and for what the catalogue does not hold.
std::string effect_unit(std::string_view effect, std::string_view parameter);

/// Names an effect and its size. `values` follow the parameters' order; a list takes as many places as it has values.
struct Effect {
  std::string id;
  std::vector<double> values;
};

/// Holds what the model states, for parameters without a neutral value of their own.
struct NominalValues {
  double restitution_mean = 0, restitution_sd = 0, friction_mean = 0, friction_sd = 0;
  std::vector<double> leg_lengths;  ///< [m]
};

/// Makes the effect with named values; a parameter that is not named is neutral.
/// @throws std::invalid_argument naming effect, parameter, value and allowed range: unknown id or parameter, a value
///         out of range, no whole number where one is needed, a list of the wrong length, from_m >= to_m
Effect effect_from_values(std::string_view id, const std::map<std::string, std::vector<double>>& values,
                          const NominalValues& nominal);
Effect effect_from_values(const EffectInfo& info, const std::map<std::string, std::vector<double>>& values,
                          const NominalValues& nominal);

/// Reads "leg_contact:leg=3,friction_ratio=1.4" (a list is 0.15;0.151;...; an effect without parameters is its id).
/// @param info_of  the catalogue: a wheel's, or walker_effect_info
/// @throws std::invalid_argument as effect_from_values, for text that cannot be read (quotes it), and for text that
///         names no size, so that the effect would do nothing
Effect effect_from_text(std::string_view text, const NominalValues& nominal,
                        const EffectInfo& (*info_of)(std::string_view) = effect_info);
/// The same of one effect, by whose id the text begins.
Effect effect_from_text(std::string_view text, const NominalValues& nominal, const EffectInfo& info);
/// Does the inverse, of a wheel's effects and of a walker's, with every value in as many digits as it needs.
std::string effect_text(const Effect& effect);

}  // namespace metastable::dynamics
