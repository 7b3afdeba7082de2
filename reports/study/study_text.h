#pragma once
// Writes a study in words and numbers for the terminal, and its words shared with tables and pages.

#include <cstddef>
#include <string>

#include "analysis/sensitivity/propagation.h"
#include "analysis/sensitivity/rigid_body_check.h"
#include "analysis/sensitivity/sensitivity.h"
#include "analysis/study/metastability.h"

namespace metastable::reports {

/// Writes everything `metastable steps` prints. @param rigid_bodies  shown too where it is there
std::string study_text(const analysis::Metastability& study, const analysis::RestThresholds& thresholds,
                       const analysis::BesideRigidBodies* rigid_bodies = nullptr);

/// Says what the words of study_text() mean: a line each, or with `more` what stands behind them as well; lines of at
/// most `width` characters.
std::string words_text(const analysis::Metastability& study, bool more, std::size_t width);

/// Writes the sensitivities as a table, ranked, or why there are none.
std::string sensitivities_text(const analysis::Sensitivities& sensitivities);

/// Writes "3.9 to 4.6 (from friction-mean 93 %, slope 7 %)": the interval of the parameters' standard errors alone.
std::string propagated_text(const analysis::Propagated& propagated);

/// Writes "4.256 (95 % interval 4.254 to 4.258)", or "infinite".
std::string estimate_text(const analysis::Estimate& estimate);

/// Says what the thresholds mean, one sentence.
std::string thresholds_text(const analysis::RestThresholds& thresholds);

}  // namespace metastable::reports
