#pragma once
// Makes the tables of `metastable report`, from finished studies.

#include <string>
#include <vector>

#include "analysis/paper/energy_losses.h"
#include "analysis/sensitivity/sensitivity.h"
#include "analysis/sensitivity/sweep.h"
#include "analysis/study/metastability.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Holds a study of a setting with what else is known of its rest.
struct Studied {
  analysis::Metastability study;
  analysis::RestThresholds thresholds;
};

/// Puts all ramps under all laws side by side: quantities down, settings across. Of one alone the title says so.
Table ramps_table(const std::vector<Studied>& columns, const Provenance& provenance);

/// Returns "the law of rigid bodies (settled)", "the paper's law (published)", ...
std::string law_words(dynamics::Law law);
/// Returns "settled, 7.02 deg", "published, 9.59 deg".
std::string law_and_ramp(const analysis::Setting& setting);

/// Answers for one ramp in one sentence: expected steps under the law of the first, with their interval, beside those
/// under the law of the second. @param beside nullptr: alone
std::string answer_sentence(const analysis::Metastability& study, const analysis::Metastability* beside);
/// Puts the expected steps side by side: ramps down, laws across, in the order in which `studies` has them.
Table answer_table(const std::vector<Studied>& studies, const Provenance& provenance);
/// Says by law which share of the trials comes to rest before the ramp ends.
std::string rests_text(const std::vector<Studied>& studies);
/// Says how each study was obtained: status, cells, draws, and what its interval holds.
Table resolution_table(const std::vector<Studied>& studies, const Provenance& provenance);

/// Holds what the expected steps of one setting depend on.
struct Hanging {
  analysis::Setting setting;
  analysis::Sensitivities sensitivities;
};
/// Lists what one per cent more of each parameter does to the steps: parameters down, laws across, one ramp.
Table sensitivity_table(const std::string& id, const std::vector<Hanging>& laws, const Provenance& provenance);
/// Says which two parameters the steps depend on most, of those whose effect has a sure sign: "1 % more mean of
/// friction μ makes 7.3 % more steps, 1 % more ..."; "" where there is none.
std::string sensitivity_sentence(const Hanging& one);
/// Returns by how many per cent the steps grow for 1 % more of the parameter, with the interval of its error.
Estimate for_one_per_cent(const analysis::Sensitivity& one);

/// Lists expected steps over two parameters; `steps` row by row (`down` slow, `across` fast). NaN: an empty cell.
Table grid_table(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                 const analysis::SweepAxis& across, const std::vector<Estimate>& steps, const Provenance& provenance);

/// Lists energy losses at equal spreads 0.05 k of eta and mu, k = 1 .. 4, beside those printed with the paper's Fig. 8.
Table energy_table(const std::vector<analysis::EnergyLosses>& losses, dynamics::Law law, const Provenance& provenance);

}  // namespace metastable::reports
