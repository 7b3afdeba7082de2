#include "reports/compare_command.h"

#include <fmt/format.h>

#include "analysis/comparison.h"
#include "reports/output_file.h"
#include "reports/study_json.h"
#include "reports/study_progress.h"
#include "reports/study_text.h"
#include "reports/version.h"

namespace metastable::reports {
namespace {

std::string trials_text(const analysis::Contrast& contrast, int collisions) {
  if (!contrast.trials_needed)
    return fmt::format("  measured trials of {} collisions do not tell the two apart\n", collisions);
  return fmt::format("  {:.4g} measured trials of {} collisions on each tell the two apart (5 % level, 80 % power)\n",
                     *contrast.trials_needed, collisions);
}

}  // namespace

void run_compare(const CompareRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const analysis::Comparison comparison = [&] {
    Progress progress("compare", study_units);
    analysis::StudyOptions options = request.study;
    options.progress = study_progress(progress);
    return analysis::compare(request.settings, options, request.collisions);
  }();
  std::vector<RestThresholds> thresholds;
  for (std::size_t i = 0; i < comparison.settings.size(); ++i)
    thresholds.push_back(rest_thresholds(comparison.settings[i], comparison.studies[i]));
  if (json) {
    std::string settings;
    for (const analysis::Setting& setting : request.settings) settings += setting.describe() + "\n";
    json->stream() << compare_json(comparison, thresholds, {request.command, settings, request.study.seed, version()});
    json->commit();
  }
  if (request.json == "-") return;
  for (std::size_t i = 0; i < comparison.settings.size(); ++i)
    fmt::print("{}\n", study_text(comparison.settings[i], comparison.studies[i], thresholds[i]));
  for (const analysis::Contrast& contrast : comparison.contrasts)
    fmt::print("{}\n{}", contrast.sentence, trials_text(contrast, request.collisions));
}

}  // namespace metastable::reports
