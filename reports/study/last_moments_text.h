#pragma once
// Shows how something fails, for the terminal, as JSON, as table and figures.

#include <cstddef>
#include <string>
#include <vector>

#include "analysis/statistics/last_moments.h"
#include "reports/output/figure.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Lists the last steps one below the other, and all steps of the regime.
Table last_moments_table(const analysis::LastMoments& moments, const std::string& id, const Provenance& provenance);
/// Writes that table, the shares of the legs and the most likely path; or why there is nothing.
/// @param phase  what a phase is called, "leg"
std::string last_moments_text(const analysis::LastMoments& moments, const std::string& phase, std::size_t width);
/// Writes an object, as text.
std::string last_moments_json(const analysis::LastMoments& moments);
/// Draws state and noise, number by number, over the last steps: median and middle 90 %, those of all steps beside
/// them.
std::vector<Figure> last_moments_figures(const analysis::LastMoments& moments, const std::string& id,
                                         const Provenance& provenance);

}  // namespace metastable::reports
