#pragma once
// metastable diagnose

#include <string>

#include "analysis/diagnosis/diagnosis.h"
#include "reports/commands/request.h"
#include "reports/output/table.h"

namespace metastable::reports {

void run_diagnose(const DiagnoseRequest& request);

/// Writes page, figures and tables of a diagnosis into `folder`. @param title  of the experiment
void write_diagnosis(const analysis::Diagnosis& diagnosis, const std::string& title, const std::string& law,
                     const Provenance& provenance, const std::string& folder);

}  // namespace metastable::reports
