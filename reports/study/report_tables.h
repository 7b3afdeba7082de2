#pragma once
// Makes the tables of `metastable report`, from finished studies.

#include <string>
#include <vector>

#include "analysis/paper/energy_losses.h"
#include "analysis/sensitivity/sweep.h"
#include "analysis/study/metastability.h"
#include "analysis/study/rest_thresholds.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Holds a study of a setting with what else is known of its rest.
struct Studied {
  analysis::Metastability study;
  analysis::RestThresholds thresholds;
};

/// Puts all ramps under all laws side by side: quantities down, settings across.
Table ramps_table(const std::vector<Studied>& columns, const Provenance& provenance);

/// Says in one sentence under which of these laws some trials rest on every ramp and others do not.
std::string laws_text(const std::vector<Studied>& columns);

/// Lists expected steps over two parameters; `studies` row by row (`down` slow, `across` fast).
Table grid_table(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                 const analysis::SweepAxis& across, const std::vector<analysis::Metastability>& studies,
                 const Provenance& provenance);

/// Lists energy losses at equal spreads 0.05 k of eta and mu, k = 1 .. 4, beside those printed with the paper's Fig. 8.
Table energy_table(const std::vector<analysis::EnergyLosses>& losses, const Provenance& provenance);

}  // namespace metastable::reports
