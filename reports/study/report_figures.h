#pragma once
// Draws the figures of `metastable report`, from finished studies.

#include <string>
#include <utility>
#include <vector>

#include "analysis/sensitivity/sweep.h"
#include "reports/output/figure.h"
#include "reports/study/report_tables.h"

namespace metastable::reports {

/// Draws quasi-stationary densities of the speed before a collision, all legs together, one curve a setting.
Figure density_figure(const std::vector<Studied>& settings, const Provenance& provenance);

/// Draws P(steps > n) on a logarithmic axis, one curve a setting: a colour a law, and dashes for every second ramp.
Figure survival_figure(const std::vector<Studied>& settings, const Provenance& provenance);

/// Draws the speed before a collision against the speed before the next: a cloud of simulated steps and the mean of the
/// survivors.
Figure return_map_figure(const analysis::Setting& setting, const Provenance& provenance);

/// Draws what one per cent more of each parameter does to the expected steps, as bars; single legs are left out.
Figure sensitivity_figure(const std::string& id, const Hanging& one, const Provenance& provenance);

/// Draws expected steps over two parameters as a labelled map. Takes arguments as grid_table().
/// @param scale  lower and upper end of the colours, for maps side by side
Figure grid_figure(const std::string& id, const std::string& title, const analysis::SweepAxis& down,
                   const analysis::SweepAxis& across, const std::vector<Estimate>& steps,
                   const std::pair<double, double>& scale, const Provenance& provenance);

}  // namespace metastable::reports
