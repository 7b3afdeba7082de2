#pragma once
// metastable describe

#include <optional>
#include <vector>

#include "analysis/description/description.h"
#include "analysis/description/law_comparison.h"
#include "analysis/experiment/experiment.h"
#include "reports/commands/request.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Shows an experiment folder's trials: in tables on the terminal (Markdown), or a folder with tables,
/// figures and a page. @throws analysis::InputError, OutputError, std::invalid_argument (user errors: exit code 2)
void run_describe(const DescribeRequest& request);

/// Holds what `describe` finds, with its tables for the terminal: conditions, and where there are such, tests, fits,
/// laws and their landings.
struct DescribeAnswer {
  analysis::Description description;
  std::optional<analysis::LawComparison> laws;
  std::vector<Table> tables;
};
/// @throws std::invalid_argument as analysis::describe() and analysis::compare_laws(); as request.options.progress
DescribeAnswer answer_describe(const analysis::Experiment& experiment, const DescribeRequest& request,
                               const Provenance& provenance);

}  // namespace metastable::reports
