#include "reports/commands/compare_command.h"

#include <fmt/format.h>

#include "analysis/sensitivity/comparison.h"
#include "analysis/sensitivity/propagation.h"
#include "analysis/sensitivity/sensitivity.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"
#include "reports/study/study_json.h"
#include "reports/study/study_progress.h"
#include "reports/study/study_text.h"

namespace metastable::reports {
namespace {

std::string trials_text(const analysis::Contrast& contrast, int collisions) {
  if (!contrast.trials_needed)
    return fmt::format("  measured trials of {} collisions do not tell the two apart\n", collisions);
  return fmt::format("  {:.4g} measured trials of {} collisions on each tell the two apart (5 % level, 80 % power)\n",
                     *contrast.trials_needed, collisions);
}

// Empty without standard errors, and where some side has no sensitivities.
CompareExtras from_standard_errors(const CompareRequest& request, const analysis::Comparison& comparison) {
  if (request.standard_errors.empty()) return {};
  Progress progress("sensitivities", comparison.studies.size());
  std::vector<analysis::Sensitivities> all;
  for (std::size_t i = 0; i < comparison.studies.size(); ++i) {
    all.push_back(analysis::sensitivities(comparison.studies[i], request.study));
    progress.advance();
    if (!all.back().reason.empty()) return {};
  }
  CompareExtras extras;
  for (std::size_t i = 0; i < all.size(); ++i)
    extras.steps.push_back(
        analysis::propagate(comparison.studies[i].steps.from_start.value, all[i], request.standard_errors));
  for (const analysis::Contrast& contrast : comparison.contrasts)
    extras.ratios.push_back(analysis::propagate_ratio(contrast.ratio->value, all[contrast.of], all[contrast.against],
                                                      request.standard_errors));
  return extras;
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
  const CompareExtras extras = from_standard_errors(request, comparison);
  std::vector<analysis::RestThresholds> thresholds;
  for (std::size_t i = 0; i < comparison.studies.size(); ++i)
    thresholds.push_back(analysis::rest_thresholds(comparison.studies[i]));
  if (json) {
    std::string settings;
    for (const analysis::Setting& setting : request.settings) settings += setting.describe() + "\n";
    json->stream() << compare_json(comparison, thresholds, {request.command, settings, request.study.seed, version()},
                                   extras);
    json->commit();
  }
  if (request.json == "-") return;
  for (std::size_t i = 0; i < comparison.studies.size(); ++i) {
    say("{}", study_text(comparison.studies[i], thresholds[i]));
    if (!extras.steps.empty())
      say("  {:<38}{}\n", "95 % interval from standard errors", propagated_text(extras.steps[i]));
    say("\n");
  }
  for (std::size_t i = 0; i < comparison.contrasts.size(); ++i) {
    const analysis::Contrast& contrast = comparison.contrasts[i];
    say("{}\n{}", contrast.sentence, trials_text(contrast, request.collisions));
    if (!extras.ratios.empty())
      say("  95 % interval of the ratio from standard errors: {}\n", propagated_text(extras.ratios[i]));
  }
}

}  // namespace metastable::reports
