#pragma once
// Says how a wheel stops under `settled`, and what to do about it, as `metastable study` shows it.

#include <string>
#include <vector>

#include "analysis/paper/stopping.h"
#include "reports/output/figure.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Tells what happens from the slide to the rest, in a few sentences with their numbers.
std::string stopping_story(const analysis::Stopping& stopping);
/// Draws mu_c of each leg over what it is longer than the leg before it, and the density of mu.
Figure sticking_figure(const analysis::Stopping& stopping, const Provenance& provenance);
/// Draws mu_r of three legs against the speed, and the density of mu.
Figure resting_figure(const analysis::Stopping& stopping, const Provenance& provenance);
Table stopping_table(const analysis::Stopping& stopping, const Provenance& provenance);
Table design_table(const std::vector<analysis::DesignChange>& changes, const Provenance& provenance);

}  // namespace metastable::reports
