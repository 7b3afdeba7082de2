#pragma once
// Lists effects that a model of the compass gait may lack, by the names that a diagnosis of walks gives them.

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/catalogue/effect_catalogue.h"

namespace metastable::dynamics {

/// Lists all effects, in a fixed order. Leg 1 is the one that stands in rows of phase 1. slope_deg_offset is the one
/// that a recalibration of the slope removes.
const std::vector<EffectInfo>& walker_effects();
/// @throws std::invalid_argument naming the id and all known ones
const EffectInfo& walker_effect_info(std::string_view id);
/// Finds an effect of a walker or of the wheel. @throws std::invalid_argument as effect_info()
const EffectInfo& any_effect_info(std::string_view id);

/// The one that is no missing physics: another mean slope.
inline constexpr std::string_view slope_offset_id = "slope_deg_offset";

}  // namespace metastable::dynamics
