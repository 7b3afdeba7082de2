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
/// @param where  law and ramp, or walker, for the title: "settled, 7.02 deg"; "" for none
Table last_moments_table(const analysis::LastMoments& moments, const std::string& id, const std::string& where,
                         const Provenance& provenance);
/// Returns the place of the number, of the state's and then the noise's, whose median in the step that fails lies
/// furthest from that of all steps, in widths of their middle 90 %; 0 where none has a width.
std::size_t telling_number(const analysis::LastMoments& moments);
/// Says in one sentence what that number is in the step that fails and in all steps: "the step that fails meets
/// a friction of 0.26 (middle 90 %: 0.16 to 0.30), all steps of 0.40 (0.24 to 0.56)".
std::string last_moments_sentence(const analysis::LastMoments& moments);
/// Writes that table, the shares of the legs and the most likely path; or why there is nothing.
/// @param phase  what a phase is called, "leg"
std::string last_moments_text(const analysis::LastMoments& moments, const std::string& phase, std::size_t width);
/// Writes an object, as text.
std::string last_moments_json(const analysis::LastMoments& moments);
/// Draws state and noise, number by number, over the last steps: median and middle 90 %, those of all steps beside
/// them. @param where  as of last_moments_table()
std::vector<Figure> last_moments_figures(const analysis::LastMoments& moments, const std::string& id,
                                         const std::string& where, const Provenance& provenance);

}  // namespace metastable::reports
