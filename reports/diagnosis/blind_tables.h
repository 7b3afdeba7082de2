#pragma once
// Makes tables of the grades of a blind check.

#include <vector>

#include "analysis/blind/blind_grade.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Lists measures with their Wilson intervals beside the aims; confusion; calibration; ambiguity groups; every case.
std::vector<Table> blind_tables(const analysis::BlindGrades& grades, const std::vector<analysis::BlindTruth>& truths,
                                const std::vector<std::optional<analysis::BlindAnswer>>& answers,
                                const Provenance& provenance);

}  // namespace metastable::reports
