#pragma once
// Makes the metastability study by exact rows on Gauss-Legendre nodes.

#include "analysis/study/metastability.h"
#include "analysis/study/problem.h"

namespace metastable::analysis {

/// Nodes are added (16, 32, 48, 64, 96, ... a phase) until the error of ln(expected steps) from the launch and of
/// ln(failure rate) is below the tolerance; the finest nodes' values are reported. Their error is twice the geometric
/// mean of the last change and the one before, and never less than twice the last change. There is no sampling error;
/// cells counts the nodes of a phase. Options that speak of draws do not matter, but for the shares of violated
/// assumptions, which stay sampled. Where some states never come to rest there is no first passage from every node: the
/// sampled study answers then, and its `method` says so. Rows: ExactRows. Cost: the landing densities of every pair of
/// nodes, 0.3 to 1 us each, or, collocated, 1 to 10 ms a node where eta and mu have spreads, 0.1 ms where one has.
/// @throws std::invalid_argument for correlated eta and mu; ConvergenceError as study()
Metastability integrated_study(const Problem& problem, const StudyOptions& options);

}  // namespace metastable::analysis
