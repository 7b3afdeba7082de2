#pragma once
// Draws the figures of `metastable describe`.

#include <optional>
#include <string>
#include <vector>

#include "analysis/description/description.h"
#include "reports/output/figure.h"

namespace metastable::reports {

/// Adds a mean profile with its standard error as a band, as two series of one colour.
void add_profile(Figure& figure, const std::vector<analysis::SpeedSummary>& profile, const std::string& label,
                 int colour);
/// Returns an empty figure of speeds over collisions.
Figure profile_figure(const std::string& id, const std::string& title, const Provenance& provenance);

Figure profiles_figure(const analysis::Description& description, const Provenance& provenance);
/// Returns nothing where no outcome is known.
std::optional<Figure> survival_curves_figure(const analysis::Description& description, const Provenance& provenance);
/// Returns nothing where no trial has a second collision.
std::optional<Figure> measured_map_figure(const analysis::ConditionDescription& condition,
                                          const Provenance& provenance);
/// Returns nothing where no leg is known.
std::optional<Figure> legs_figure(const analysis::Description& description, const Provenance& provenance);

}  // namespace metastable::reports
