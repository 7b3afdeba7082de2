#include "reports/commands/steps_command.h"

#include <fmt/format.h>

#include <optional>

#include "analysis/study/certify.h"
#include "analysis/study/consistency.h"
#include "analysis/study/how_it_fails.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/study/last_moments_text.h"
#include "reports/study/study_json.h"
#include "reports/study/study_progress.h"
#include "reports/study/study_text.h"

namespace metastable::reports {

void run_steps(const StepsRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const analysis::Metastability study = [&] {
    Progress progress("steps", study_units);
    analysis::StudyOptions options = request.study;
    options.progress = study_progress(progress);
    return analysis::study(request.setting, options);
  }();
  const analysis::RestThresholds thresholds = analysis::rest_thresholds(study);
  StepsExtras extras;
  if (request.certify) {
    Progress progress("certificate", study_units);
    extras.certified = analysis::certify(
        request.setting,
        {.tolerance = request.study.tolerance, .threads = request.study.threads, .progress = study_progress(progress)});
    analysis::require_consistent(study, *extras.certified);
  }
  if (request.sensitivities || !request.standard_errors.empty()) {
    Progress progress("sensitivities", study_units);
    analysis::StudyOptions options = request.study;
    options.progress = study_progress(progress);
    extras.sensitivities = analysis::sensitivities(study, options);
    if (!request.standard_errors.empty() && extras.sensitivities->reason.empty())
      extras.propagated =
          analysis::propagate(study.steps.from_start.value, *extras.sensitivities, request.standard_errors);
  }
  if (request.how_it_fails) {
    analysis::StudyOptions options = request.study;
    options.progress = {};
    extras.last_moments = analysis::how_it_fails(request.setting, study, options);
  }
  if (json) {
    const Provenance provenance{request.command, request.setting.describe(), request.study.seed, version()};
    json->stream() << steps_json(study, thresholds, provenance, extras);
    json->commit();
  }
  if (request.json == "-") return;
  say("{}", study_text(study, thresholds));
  if (extras.certified) say("  {:<38}{}\n", "certificate", analysis::certificate_text(*extras.certified));
  if (extras.propagated) say("  {:<38}{}\n", "95 % interval from standard errors", propagated_text(*extras.propagated));
  if (extras.sensitivities) say("\n{}", sensitivities_text(*extras.sensitivities));
  if (extras.last_moments) say("\n{}", last_moments_text(*extras.last_moments, "leg", terminal_width()));
  if (study.status != analysis::Status::rest_unresolved)
    say("\n{}", words_text(study, request.explain, terminal_width()));
}

}  // namespace metastable::reports
