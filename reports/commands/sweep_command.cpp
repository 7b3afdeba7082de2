#include "reports/commands/sweep_command.h"

#include <fmt/format.h>

#include <cmath>

#include "reports/commands/sweep_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/progress.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

// States everything the numbers depend on; a partial file with another head belongs to another sweep.
std::string head(const SweepRequest& request) {
  const analysis::StudyOptions& study = request.study;
  std::string text = fmt::format("# sweep: {}\n# axes:", analysis::sweep_description(request.setting, request.axes));
  for (const analysis::SweepAxis& axis : request.axes) {
    text += fmt::format(" {} =", analysis::parameter_name(axis.parameter));
    for (const double value : axis.values) text += fmt::format(" {}", value);
    text += ';';
  }
  text += "\n";
  for (const dynamics::Contact& pair : request.setting.pairs)
    text += fmt::format("# pair: restitution {}, friction {}\n", pair.restitution, pair.friction);
  const auto size = [](std::size_t given) {
    return given == 0 ? std::string("as the tolerance needs") : std::to_string(given);
  };
  text += fmt::format(
      "# method {}, cells {}, samples {}, tolerance {}, seed {}, replicates {}, sequence {}, draws {}, tail {}\n",
      analysis::method_name(study.method), size(study.cells), size(study.samples), study.tolerance, study.seed,
      study.replicates, study.sequence == markov::Sequence::sobol ? "sobol" : "random",
      study.weighting == markov::Weighting::weighted ? "weighted" : "plain", study.tail);
  text += fmt::format("# version: {}\n", version());
  for (const analysis::SweepAxis& axis : request.axes)
    text += fmt::format("{} [{}],", analysis::parameter_name(axis.parameter), analysis::parameter_unit(axis.parameter));
  text +=
      "expected_steps,expected_steps_low95,expected_steps_high95,expected_steps_quasi_stationary,failure_rate_per_step,"
      "quasi_stationary_mean_rad_s,quasi_stationary_sd_rad_s,reach_ramp_end,status\n";
  return text;
}

std::string number(double value) {
  if (std::isnan(value)) return "";  // there is none
  return std::isinf(value) ? "infinite" : fmt::format("{}", value);
}

std::string row(const analysis::SweepPoint& point) {
  const analysis::Metastability& study = point.study;
  std::string text;
  for (const double value : point.at) text += fmt::format("{},", value);
  if (study.status == analysis::Status::solver_failed)
    return text + fmt::format(",,,,,,,,{}\n", analysis::status_text(study.status));
  return text + fmt::format("{},{},{},{},{},{},{},{},{}\n", number(study.steps.from_start.value),
                            number(study.steps.from_start.lower), number(study.steps.from_start.upper),
                            number(study.steps.from_quasi_stationary.value), number(study.spectrum.failure_rate.value),
                            number(study.survivors.mean), number(study.survivors.sd),
                            study.steps.reach_end ? number(*study.steps.reach_end) : "",
                            analysis::status_text(study.status));
}

}  // namespace

void run_sweep(const SweepRequest& request) {
  const std::size_t size = analysis::sweep_size(request.axes);
  for (std::size_t i = 0; i < size; ++i)  // wrong settings are found before the first is computed
    analysis::check_setting(analysis::sweep_setting(request.setting, request.axes, i), request.study.method);
  SweepFile sweep{
      request.out,
      head(request),
      {},
      {request.command, analysis::sweep_description(request.setting, request.axes), request.study.seed, version()},
      request.json};
  for (const analysis::SweepAxis& axis : request.axes)
    sweep.axes.push_back({std::string(analysis::parameter_label(axis.parameter)),
                          axis.parameter == analysis::Parameter::slope ? "deg" : "", axis.values});
  analysis::StudyOptions study = request.study;
  study.progress = [](double, const std::string&) { check_interrupt(); };
  if (request.sharing)
    return share_sweep_file(sweep, *request.sharing, [&](std::size_t point) {
      return row(analysis::sweep_point(request.setting, request.axes, point, study));
    });
  run_sweep_file(sweep, [&](std::size_t had, const auto& add) {
    Progress progress("sweep", size);
    progress.skip(had);
    analysis::sweep(request.setting, request.axes, had, study, [&](std::size_t, const analysis::SweepPoint& point) {
      add(row(point));
      progress.advance();
    });
  });
}

}  // namespace metastable::reports
