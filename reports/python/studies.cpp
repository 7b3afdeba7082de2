// Binds study, compare and sweep of settings.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <atomic>
#include <limits>
#include <optional>

#include "analysis/sensitivity/sweep.h"
#include "reports/command_line/requests.h"
#include "reports/command_line/walker_options.h"
#include "reports/commands/compare_command.h"
#include "reports/commands/steps_command.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"
#include "reports/study/report_tables.h"

namespace metastable::reports::python {
namespace {

using Command = std::string;

// Gives the options of a command what they are in Python.
LooseOptions options_of(void (*declare)(Options&), const Arguments& given) {
  LooseOptions options(declare);
  given.give(*options);
  options->check_given();
  asks_for_walker(*options);  // which a wheel does not
  if (given.given("guided_samples")) throw std::invalid_argument("--guided-samples: has a meaning with --walker only");
  return options;
}

// Takes an axis that the command line has too as it does.
analysis::SweepAxis axis_of(const Options& declared, const std::string& name, const std::vector<double>& values,
                            const analysis::Setting& base) {
  const std::string option = option_of(name);
  if (values.empty()) throw std::invalid_argument(fmt::format("{}: holds no value", name));
  if (!declared.has(option) || declared.value(option) != "RANGE") {
    for (std::size_t i = 1; i < values.size(); ++i)
      if (!(values[i] > values[i - 1])) throw std::invalid_argument(fmt::format("{}: values must rise", name));
    const analysis::SweepAxis axis{analysis::parameter_from_name(option), values};
    if (!analysis::matters(base, axis.parameter))
      throw std::invalid_argument(fmt::format("{}: has no meaning under this setting", name));
    return axis;
  }
  LooseOptions given(declare_sweep);
  given->give(option, {fmt::format("{}", fmt::join(values, ","))});
  return sweep_axis(*given, option.c_str(), base);
}

py::dict study(const py::dict& setting, const py::dict& options, const Command& command, const py::object& progress) {
  const Arguments given(options);
  const LooseOptions asked = options_of(declare_steps, given);
  StepsRequest request = steps_request(*asked, setting_of(Arguments(setting)), command);
  request.rigid_bodies = !Arguments(setting).given("law");
  request.standard_errors = standard_errors_of(given, request.setting);
  const auto found = std::make_shared<StepsAnswer>();
  Call call(progress);
  call.run([&] { *found = answer_steps(request, parts_of(call)); });
  const analysis::Metastability& s = found->study;
  py::dict arrays;
  arrays["survival"] = array_view(s.steps.survival.data(), s.steps.survival.size(), found);
  arrays["eigenvalue_moduli"] = array_view(s.spectrum.moduli.data(), s.spectrum.moduli.size(), found);
  const Provenance provenance{command, s.setting.value().describe(), request.study.seed, version()};
  py::dict all = answer(steps_answer_json(request, *found), steps_answer_text(request, *found, line_width),
                        to_html(ramps_table({{s, found->thresholds}}, provenance)), arrays);
  py::list regime;
  for (const analysis::PhaseDistribution& phase : s.survivors.by_phase) {
    py::dict one;
    one["edges"] = array_view(phase.edges.data(), phase.edges.size(), found);
    one["mass"] = array_view(phase.mass.data(), phase.mass.size(), found);
    regime.append(one);
  }
  all["regime"] = regime;
  return all;
}

py::dict compare(const py::list& settings, const py::dict& options, const Command& command,
                 const py::object& progress) {
  const Arguments given(options);
  std::vector<analysis::Setting> all;
  bool named = false;
  for (const py::handle& one : settings) {
    const Arguments fields(one.cast<py::dict>());
    named = named || fields.given("law");
    all.push_back(setting_of(fields));
  }
  const LooseOptions asked = options_of(declare_compare, given);
  CompareRequest request = compare_request(*asked, all, command);
  request.standard_errors = standard_errors_of(given, request.settings.front());
  request.rigid_bodies = !named;
  CompareAnswer found;
  Call call(progress);
  call.run([&] { found = answer_compare(request, parts_of(call)); });
  std::vector<Studied> columns;
  std::string described;
  for (std::size_t i = 0; i < found.comparison.studies.size(); ++i) {
    columns.push_back({found.comparison.studies[i], found.thresholds[i]});
    described += request.settings[i].describe() + "\n";
  }
  Table table = ramps_table(columns, {command, described, request.study.seed, version()});
  table.title = "The settings side by side";
  for (std::size_t i = 0; i < columns.size(); ++i) table.columns[2 + i].name = found.comparison.labels[i];
  std::string html = to_html(table);
  for (const analysis::Contrast& contrast : found.comparison.contrasts)
    html += "<p>" + escape_html(contrast.sentence) + "</p>";
  if (request.rigid_bodies)
    html += "<p>" +
            escape_html(analysis::rigid_body_sentence(found.extras.rigid_bodies, request.settings.front().law)) +
            "</p>";
  return answer(compare_answer_json(request, found), compare_answer_text(request, found), html);
}

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Holds the columns of a sweep, as the command line names them.
struct Columns {
  std::vector<std::string> names;  // of the axes
  std::vector<std::vector<double>> at;
  std::vector<double> steps, low, high, quasi, rate, mean, sd, reach_end, rigid, rigid_low, rigid_high;
  std::vector<analysis::BesideRigidBodies> beside;
  std::vector<std::string> status, message;
};

// Adds what rolled wheels show at the point, NaN where none were rolled.
void add_rigid_bodies(Columns& c, const analysis::SweepPoint& point) {
  const bool known = point.rigid_bodies && point.rigid_bodies->reason.empty();
  const analysis::RigidBodyCheck check = known ? *point.rigid_bodies : analysis::RigidBodyCheck{};
  c.rigid.push_back(known && !check.at_least ? check.steps.value : unknown);
  c.rigid_low.push_back(known ? check.steps.lower : unknown);
  c.rigid_high.push_back(known ? check.steps.upper : unknown);
  if (!known || point.failure) return;
  std::string name;
  for (std::size_t a = 0; a < c.names.size(); ++a)
    name += fmt::format("{}{} {}", a == 0 ? "" : ", ", c.names[a], point.at[a]);
  c.beside.push_back({name, analysis::answered_steps(point.study), check});
}

// Adds the point, NaN for the numbers of one whose solver failed.
void add_point(Columns& c, const analysis::SweepPoint& point) {
  const analysis::Metastability& s = point.study;
  const auto add = [failed = point.failure != nullptr](std::vector<double>& column, double value) {
    column.push_back(failed ? unknown : value);
  };
  for (std::size_t a = 0; a < c.at.size(); ++a) c.at[a].push_back(point.at[a]);
  add(c.steps, s.steps.from_start.value), add(c.low, s.steps.from_start.lower);
  add(c.high, s.steps.from_start.upper), add(c.quasi, s.steps.from_quasi_stationary.value);
  add(c.rate, s.spectrum.failure_rate.value), add(c.mean, s.survivors.mean), add(c.sd, s.survivors.sd);
  add(c.reach_end, s.steps.reach_end.value_or(unknown));
  c.status.push_back(analysis::status_text(s.status));
  c.message.push_back(s.message);
  add_rigid_bodies(c, point);
}

// @param rigid  with the columns of rolled wheels
py::dict columns_of(Columns&& c, bool rigid) {
  py::dict columns;
  for (std::size_t a = 0; a < c.at.size(); ++a) columns[c.names[a].c_str()] = array_of(std::move(c.at[a]));
  columns["expected_steps"] = array_of(std::move(c.steps));
  columns["expected_steps_low95"] = array_of(std::move(c.low));
  columns["expected_steps_high95"] = array_of(std::move(c.high));
  columns["expected_steps_quasi_stationary"] = array_of(std::move(c.quasi));
  columns["failure_rate_per_step"] = array_of(std::move(c.rate));
  columns["quasi_stationary_mean_rad_s"] = array_of(std::move(c.mean));
  columns["quasi_stationary_sd_rad_s"] = array_of(std::move(c.sd));
  columns["reach_ramp_end"] = array_of(std::move(c.reach_end));
  columns["status"] = py::cast(c.status);
  columns["message"] = py::cast(c.message);
  if (!rigid) return columns;
  columns["rigid_bodies_steps"] = array_of(std::move(c.rigid));
  columns["rigid_bodies_steps_low95"] = array_of(std::move(c.rigid_low));
  columns["rigid_bodies_steps_high95"] = array_of(std::move(c.rigid_high));
  return columns;
}

py::dict sweep(const py::dict& setting, const py::dict& axes, const py::dict& options, const py::object& progress) {
  const LooseOptions asked = options_of(declare_sweep, Arguments(options));
  analysis::StudyOptions study = study_options(*asked);
  analysis::Setting base = setting_of(Arguments(setting));
  // One rule for all slopes: the paper's launch is that of one of them.
  if (axes.contains("slope_deg") && !Arguments(setting).given("initial_speed")) base.steady_launch = true;
  const bool asked_rigid = !Arguments(setting).given("law");
  std::vector<analysis::SweepAxis> all;
  Columns c;
  for (const auto& [key, value] : axes) {
    c.names.push_back(py::str(key).cast<std::string>());
    all.push_back(axis_of(*asked, c.names.back(), Arguments(axes).numbers(c.names.back().c_str()), base));
  }
  if (all.empty()) throw std::invalid_argument("sweep: no range given");
  const std::size_t size = analysis::sweep_size(all);
  for (std::size_t i = 0; i < size; ++i) analysis::check_setting(analysis::sweep_setting(base, all, i), study.method);
  c.at.resize(all.size());
  Call call(progress);
  std::atomic<std::size_t> done = 0;
  study.progress = [&call, &done, size](double, const std::string&) {
    call.tell(static_cast<double>(done.load()) / static_cast<double>(size), "sweep");
  };
  call.run([&] {
    analysis::sweep(
        base, all, 0, study,
        [&c, &done, &study](std::size_t, const analysis::SweepPoint& point) {
          add_point(c, point);
          ++done;
          study.progress(0, "");
        },
        asked_rigid ? analysis::RigidBodies::asked : analysis::RigidBodies::left_out);
  });
  py::dict result;
  result["rigid_bodies"] = py::none();
  if (asked_rigid) result["rigid_bodies"] = analysis::rigid_body_sentence(c.beside, base.law);
  result["columns"] = columns_of(std::move(c), asked_rigid);
  return result;
}

// Makes the request of a wheel or of a walker.
SolveRequest solve_request_of(const py::dict& fields, bool is_walker, const std::string& parameter,
                              const Arguments& given, const Command& command) {
  LooseOptions asked(declare_solve);
  given.without({"survive", "guided_samples"}).give(*asked);
  const std::string solved = option_of(parameter);
  asked->give("PARAMETER", {solved});
  if (given.given("survive")) {
    const std::vector<double> pair = given.numbers("survive");
    if (pair.size() != 2) throw std::invalid_argument("survive: (steps, share) expected");
    asked->give("survive", {fmt::format("{}:{}", pair[0], pair[1])});
  }
  if (!is_walker) {
    asked->check_given();
    asks_for_walker(*asked);
    const Arguments setting(fields);
    analysis::Setting base = setting_of(setting);
    if (solved == "slope" && !setting.given("initial_speed")) base.steady_launch = true;
    SolveRequest request = solve_request(*asked, base, command);
    request.rigid_bodies = !setting.given("law");
    return request;
  }
  asked->give("walker", {Arguments(fields).text("walker")});
  asked->check_given();
  SolveRequest request = walker_solve_request(*asked, walker_setting_of(Arguments(fields)), command);
  read_guided_samples(given, request.meshes);
  return request;
}

py::dict solve(const py::dict& setting, bool is_walker, const std::string& parameter, const py::dict& options,
               const Command& command, const py::object& progress) {
  const SolveRequest request = solve_request_of(setting, is_walker, parameter, Arguments(options), command);
  SolveAnswer found;
  Call call(progress);
  call.run([&] { found = answer_solve(request, parts_of(call)); });
  std::string html;
  for (const std::string& sentence : found.solution.sentences())
    html += fmt::format("<p>{}: {}</p>", escape_html(found.solution.parameter), escape_html(sentence));
  return answer(solve_answer_json(request, found), solve_answer_text(request, found), html);
}

}  // namespace

void add_studies(py::module_& module) {
  module.def("describe_setting", [](const py::dict& fields) { return setting_of(Arguments(fields)).describe(); });
  module.def("launch", [](const py::dict& fields) {
    const analysis::Setting setting = setting_of(Arguments(fields));
    if (setting.steady_launch) return std::optional<std::pair<double, double>>();
    return std::optional(std::pair(setting.initial_speed.mean, setting.initial_speed.sd));
  });
  module.def("study", study);
  module.def("compare", compare);
  module.def("sweep", sweep);
  module.def("solve", solve);
}

}  // namespace metastable::reports::python
