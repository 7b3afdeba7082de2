#include "reports/commands/compare_command.h"

#include <fmt/format.h>

#include "analysis/sensitivity/propagation.h"
#include "analysis/sensitivity/sensitivity.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"
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
CompareExtras from_standard_errors(const CompareRequest& request, const analysis::Comparison& comparison,
                                   const BeginPart& begin) {
  if (request.standard_errors.empty()) return {};
  std::vector<analysis::Sensitivities> all;
  for (const analysis::Metastability& study : comparison.studies) {
    analysis::StudyOptions options = request.study;
    options.progress = begin("sensitivities");
    all.push_back(analysis::sensitivities(study, options));
    if (!all.back().reason.empty()) return {};
  }
  CompareExtras extras;
  for (std::size_t i = 0; i < all.size(); ++i)
    extras.steps.push_back(
        analysis::propagate(comparison.studies[i].steps.from_start.value, all[i], request.standard_errors));
  for (const analysis::Contrast& contrast : comparison.contrasts)
    extras.ratios.push_back(analysis::propagate_ratio(
        contrast.ratio->value, {*comparison.studies[contrast.of].setting, all[contrast.of]},
        {*comparison.studies[contrast.against].setting, all[contrast.against]}, request.standard_errors));
  return extras;
}

}  // namespace

CompareAnswer answer_compare(const CompareRequest& request, const BeginPart& begin) {
  analysis::StudyOptions options = request.study;
  options.progress = begin("compare");
  CompareAnswer answer{analysis::compare(request.settings, options, request.collisions), {}, {}};
  answer.extras = from_standard_errors(request, answer.comparison, begin);
  for (std::size_t i = 0; i < answer.comparison.studies.size(); ++i) {
    const analysis::Metastability& study = answer.comparison.studies[i];
    answer.thresholds.push_back(analysis::rest_thresholds(study));
    if (!request.rigid_bodies) continue;
    options.progress = begin("rigid bodies");
    answer.extras.rigid_bodies.push_back(analysis::beside_rigid_bodies(study, answer.comparison.labels[i], options));
  }
  return answer;
}

std::string compare_answer_json(const CompareRequest& request, const CompareAnswer& answer) {
  std::string settings;
  for (const analysis::Setting& setting : request.settings) settings += setting.describe() + "\n";
  return compare_json(answer.comparison, answer.thresholds, {request.command, settings, request.study.seed, version()},
                      answer.extras);
}

std::string compare_answer_text(const CompareRequest& request, const CompareAnswer& answer) {
  const analysis::Comparison& comparison = answer.comparison;
  const CompareExtras& extras = answer.extras;
  std::string text;
  for (std::size_t i = 0; i < comparison.studies.size(); ++i) {
    const std::string& label = comparison.labels[i];
    if (!request.settings[i].describe().starts_with(label)) text += label + ": ";
    text += study_text(comparison.studies[i], answer.thresholds[i],
                       extras.rigid_bodies.empty() ? nullptr : &extras.rigid_bodies[i]);
    if (!extras.steps.empty())
      text += fmt::format("  {:<38}{}\n", "95 % interval from standard errors", propagated_text(extras.steps[i]));
    text += "\n";
  }
  for (std::size_t i = 0; i < comparison.contrasts.size(); ++i) {
    const analysis::Contrast& contrast = comparison.contrasts[i];
    text += contrast.sentence + "\n" + trials_text(contrast, request.collisions);
    if (!extras.ratios.empty())
      text += fmt::format("  95 % interval of the ratio from standard errors: {}\n", propagated_text(extras.ratios[i]));
  }
  if (!extras.rigid_bodies.empty())
    text += analysis::rigid_body_sentence(extras.rigid_bodies, request.settings.front().law) + "\n";
  return text;
}

void run_compare(const CompareRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const CompareAnswer answer = [&] {
    ProgressParts progress;
    return answer_compare(request, progress.begin());
  }();
  if (json) {
    json->stream() << compare_answer_json(request, answer);
    json->commit();
  }
  if (request.json != "-") say("{}", compare_answer_text(request, answer));
}

}  // namespace metastable::reports
