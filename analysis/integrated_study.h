#pragma once
// The metastability study by exact rows on Gauss-Legendre nodes.

#include "analysis/metastability.h"
#include "analysis/problem.h"

namespace metastable::analysis {

/// Nodes doubled until ln(expected steps) from the launch and the ln of the failure rate change by less than the
/// tolerance; the finest nodes' values are reported, the last change is their error (a safe one: the coarser nodes'
/// own, and convergence is fast). No sampling error; cells counts the nodes of a phase. Options that speak of draws do
/// not matter, but for the shares of violated assumptions, which stay sampled. Where rest is uncertain there is no
/// first passage to integrate: the sampled study answers then, and its `method` says so. Cost: the landing densities of
/// every pair of nodes, for the wheel 30 to 100 us each.
/// @throws std::invalid_argument where the landing has no density (names the reason); ConvergenceError as study()
Metastability integrated_study(const Problem& problem, const StudyOptions& options);

}  // namespace metastable::analysis
