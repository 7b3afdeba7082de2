#pragma once
// Draws the figures of `metastable report`, from finished studies.

#include <string>
#include <vector>

#include "analysis/sensitivity/sweep.h"
#include "reports/output/figure.h"
#include "reports/study/report_tables.h"

namespace metastable::reports {

/// Draws quasi-stationary densities of the speed before a collision, all legs together, one curve a setting.
Figure density_figure(const std::vector<Studied>& settings, const Provenance& provenance);

/// Draws P(steps > n) on a logarithmic axis, one curve a setting.
Figure survival_figure(const std::vector<Studied>& settings, const Provenance& provenance);

/// Draws the speed before a collision against the speed before the next: a cloud of simulated steps and the mean of the
/// survivors.
Figure return_map_figure(const analysis::Setting& setting, const Provenance& provenance);

/// Draws expected steps over two parameters as a labelled map. Takes arguments as grid_table().
Figure grid_figure(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                   const analysis::SweepAxis& across, const std::vector<analysis::Metastability>& studies,
                   const Provenance& provenance);

}  // namespace metastable::reports
