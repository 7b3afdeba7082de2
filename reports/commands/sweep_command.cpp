#include "reports/commands/sweep_command.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dynamics/wheel/contact_law.h"
#include "reports/commands/sweep_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/progress.h"
#include "reports/output/version.h"
#include "reports/study/study_progress.h"

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
      "quasi_stationary_mean_rad_s,quasi_stationary_sd_rad_s,reach_ramp_end,status";
  if (request.rigid_bodies) text += ",rigid_bodies_steps,rigid_bodies_steps_low95,rigid_bodies_steps_high95";
  return text + "\n";
}

std::string number(double value) {
  if (std::isnan(value)) return "";  // there is none
  return std::isinf(value) ? "infinite" : fmt::format("{}", value);
}

// Empty where no wheels were rolled; of what is bounded below alone it has the interval.
std::string rigid_bodies_columns(const std::optional<analysis::RigidBodyCheck>& check) {
  if (!check || !check->reason.empty()) return ",,,";
  return fmt::format(",{},{},{}", check->at_least ? "" : number(check->steps.value), number(check->steps.lower),
                     number(check->steps.upper));
}

std::string row(const SweepRequest& request, const analysis::SweepPoint& point) {
  const analysis::Metastability& study = point.study;
  std::string text;
  for (const double value : point.at) text += fmt::format("{},", value);
  const std::string last = (request.rigid_bodies ? rigid_bodies_columns(point.rigid_bodies) : "") + "\n";
  if (point.failure) return text + fmt::format(",,,,,,,,{}", analysis::status_text(study.status)) + last;
  return text +
         fmt::format("{},{},{},{},{},{},{},{},{}", number(study.steps.from_start.value),
                     number(study.steps.from_start.lower), number(study.steps.from_start.upper),
                     number(study.steps.from_quasi_stationary.value), number(study.spectrum.failure_rate.value),
                     number(study.survivors.mean), number(study.survivors.sd),
                     study.steps.reach_end ? number(*study.steps.reach_end) : "", analysis::status_text(study.status)) +
         last;
}

// Says what rolled wheels show, from the table's numbers: points taken over from a file count too.
std::string rigid_bodies_remark(const SweepRequest& request, const Table& table) {
  const std::size_t axes = request.axes.size(), rolled = table.columns.size() - 3;
  const auto number_of = [&](const Cell& cell) {
    const double* number = std::get_if<double>(&cell.value());
    return number ? *number : std::numeric_limits<double>::infinity();
  };
  const auto says = [](const Cell& cell, const std::string& what) {
    const std::string* text = std::get_if<std::string>(&cell.value());
    return text && *text == what;
  };
  const auto empty = [&](const Cell& cell) { return says(cell, ""); };
  std::vector<analysis::BesideRigidBodies> all;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<Cell>& cells = table.rows[i];
    if (empty(cells[axes]) || empty(cells[rolled + 1])) continue;
    const auto estimate = [&](std::size_t at) {
      return analysis::Estimate{number_of(cells[at]), number_of(cells[at + 1]), number_of(cells[at + 2])};
    };
    analysis::BesideRigidBodies one{{}, estimate(axes), {}};
    if (says(cells[rolled - 1], analysis::status_text(analysis::Status::rest_unresolved)))
      one.steps.lower = one.steps.value;  // rarer than any draw
    one.check.steps = estimate(rolled);
    one.check.at_least = empty(cells[rolled]);
    if (one.check.at_least) one.check.steps.value = one.check.steps.lower;
    for (std::size_t a = 0; a < axes; ++a)
      one.name += fmt::format("{}{} {}", a == 0 ? "" : ", ", analysis::parameter_name(request.axes[a].parameter),
                              number_of(cells[a]));
    all.push_back(std::move(one));
  }
  return analysis::rigid_body_sentence(all, request.setting.law);
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
      request.json,
      std::string(dynamics::law_name(request.setting.law)),
      {}};
  const auto rolled = request.rigid_bodies ? analysis::RigidBodies::asked : analysis::RigidBodies::left_out;
  if (request.rigid_bodies) sweep.remark = [&](const Table& table) { return rigid_bodies_remark(request, table); };
  for (const analysis::SweepAxis& axis : request.axes)
    sweep.axes.push_back({std::string(analysis::parameter_label(axis.parameter)),
                          axis.parameter == analysis::Parameter::slope ? "deg" : "", axis.values});
  analysis::StudyOptions study = request.study;
  study.progress = [](double, const std::string&) { check_interrupt(); };
  if (request.sharing)
    return share_sweep_file(sweep, *request.sharing, [&](std::size_t point) {
      return row(request, analysis::sweep_point(request.setting, request.axes, point, study, rolled));
    });
  run_sweep_file(sweep, [&](std::size_t had, const auto& add) {
    if (had < size) {  // all points of one slope share the first one's table of landings
      ProgressParts parts;
      analysis::StudyOptions table = request.study;
      table.progress = parts.begin()("table of landings");
      analysis::tabulate_landings(analysis::sweep_setting(request.setting, request.axes, had), table);
    }
    Progress progress("sweep", size);
    progress.skip(had);
    analysis::sweep(
        request.setting, request.axes, had, study,
        [&](std::size_t, const analysis::SweepPoint& point) {
          add(row(request, point));
          progress.advance();
        },
        rolled);
  });
}

}  // namespace metastable::reports
