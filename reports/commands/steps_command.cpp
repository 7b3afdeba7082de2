#include "reports/commands/steps_command.h"

#include <fmt/format.h>

#include <optional>
#include <span>
#include <string>
#include <utility>

#include "analysis/study/certify.h"
#include "analysis/study/consistency.h"
#include "analysis/study/how_it_fails.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/study/last_moments_text.h"
#include "reports/study/study_text.h"

namespace metastable::reports {
namespace {

// Rolls wheels beside a study, which is complete without them: a limit that ends it is the reason for no answer.
analysis::BesideRigidBodies rolled_within_limit(const analysis::Metastability& study,
                                                const analysis::StudyOptions& options) {
  try {
    return analysis::beside_rigid_bodies(study, "", options);
  } catch (const TimeLimitReached& limit) {
    analysis::RigidBodyCheck check;
    check.reason = fmt::format("the time limit of {:.6g} s ended the check", limit.seconds());
    return {"", analysis::answered_steps(study), std::move(check)};
  }
}

}  // namespace

StepsAnswer answer_steps(const StepsRequest& request, const BeginPart& begin_part) {
  const BeginPart begin = within(request.time_limit, begin_part);
  analysis::StudyOptions options = request.study;
  options.progress = begin("steps");
  StepsAnswer answer{analysis::study(request.setting, options), {}, {}};
  const analysis::Metastability& study = answer.study;
  StepsExtras& extras = answer.extras;
  answer.thresholds = analysis::rest_thresholds(study);
  if (request.certify) {
    extras.certified = analysis::certify(
        request.setting,
        {.tolerance = request.study.tolerance, .threads = request.study.threads, .progress = begin("certificate")});
    analysis::require_consistent(study, *extras.certified);
  }
  if (request.sensitivities || !request.standard_errors.empty()) {
    options.progress = begin("sensitivities");
    extras.sensitivities = analysis::sensitivities(study, options);
    if (!request.standard_errors.empty() && extras.sensitivities->reason.empty())
      extras.propagated =
          analysis::propagate(study.steps.from_start.value, *extras.sensitivities, request.standard_errors);
  }
  if (request.how_it_fails) {
    options.progress = begin("how it fails");
    extras.last_moments = analysis::how_it_fails(study.setting.value(), study, options);
  }
  if (request.rigid_bodies) {
    options.progress = begin("rigid bodies");
    extras.rigid_bodies = rolled_within_limit(study, options);
  }
  return answer;
}

std::string steps_answer_json(const StepsRequest& request, const StepsAnswer& answer) {
  return steps_json(answer.study, answer.thresholds,
                    {request.command, answer.study.setting.value().describe(), request.study.seed, version()},
                    answer.extras);
}

std::string steps_answer_text(const StepsRequest& request, const StepsAnswer& answer, std::size_t width) {
  const StepsExtras& extras = answer.extras;
  const analysis::BesideRigidBodies* beside = extras.rigid_bodies ? &*extras.rigid_bodies : nullptr;
  std::string text = study_text(answer.study, answer.thresholds, beside);
  if (extras.certified)
    text += fmt::format("  {:<38}{}\n", "certificate", analysis::certificate_text(*extras.certified));
  if (extras.propagated)
    text += fmt::format("  {:<38}{}\n", "95 % interval from standard errors", propagated_text(*extras.propagated));
  if (extras.sensitivities) text += "\n" + sensitivities_text(*extras.sensitivities);
  if (extras.last_moments) text += "\n" + last_moments_text(*extras.last_moments, "leg", width);
  if (beside) text += "\n" + analysis::rigid_body_sentence(std::span(beside, 1), request.setting.law) + "\n";
  if (answer.study.status != analysis::Status::rest_unresolved)
    text += "\n" + words_text(answer.study, request.explain, width);
  return text;
}

void run_steps(const StepsRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const StepsAnswer answer = [&] {
    ProgressParts progress;
    return answer_steps(request, progress.begin());
  }();
  if (json) {
    json->stream() << steps_answer_json(request, answer);
    json->commit();
  }
  if (request.json != "-") say("{}", steps_answer_text(request, answer, terminal_width()));
}

}  // namespace metastable::reports
