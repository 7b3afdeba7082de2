// Binds experiments: read, simulated, or made of arrays; described and diagnosed.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment_model/diagnose.h"
#include "reports/command_line/requests.h"
#include "reports/diagnosis/diagnosis_figures.h"
#include "reports/diagnosis/diagnosis_json.h"
#include "reports/diagnosis/diagnosis_tables.h"
#include "reports/diagnosis/diagnosis_text.h"
#include "reports/experiment_commands/describe_command.h"
#include "reports/experiment_commands/experiment_output.h"
#include "reports/experiment_commands/simulate_command.h"
#include "reports/output/table_json.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"

namespace metastable::reports::python {
namespace {

/// An experiment with the texts it was read from.
struct Held {
  analysis::ExperimentSource source;
  analysis::Experiment experiment;
  std::vector<std::string> said;  ///< of a simulation
};
using HeldExperiment = std::shared_ptr<Held>;

HeldExperiment held(analysis::ExperimentSource source) {
  analysis::Experiment experiment = analysis::parse_experiment(source);
  return std::make_shared<Held>(Held{std::move(source), std::move(experiment), {}});
}

HeldExperiment read(const std::string& folder) { return held(analysis::read_source(folder)); }

HeldExperiment of_simulation(SimulatedExperiment made) {
  HeldExperiment experiment = held(std::move(made.source));
  experiment->said = std::move(made.said);
  return experiment;
}

void write(const Held& held, const std::string& folder) { ExperimentOutput(folder).write(held.source); }

// Holds columns as they are measured; NaN or -1 where nothing is known.
struct CollisionRow {
  std::int64_t condition, trial, collision, leg;
  double time, position, omega_minus, omega_plus;
};

py::dict collisions_of(const Held& held) {
  const auto rows = std::make_shared<std::vector<CollisionRow>>();
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  for (const analysis::MeasuredTrial& trial : held.experiment.trials)
    for (const analysis::MeasuredCollision& c : trial.collisions)
      rows->push_back({static_cast<std::int64_t>(trial.condition), trial.number, c.number, c.leg.value_or(-1),
                       c.time.value_or(unknown), c.position.value_or(unknown), c.omega_minus,
                       c.omega_plus.value_or(unknown)});
  py::dict columns;
  const CollisionRow none{};
  const CollisionRow& first = rows->empty() ? none : rows->front();
  const auto column = [&](const char* name, const auto& field) {
    columns[name] = array_view(&field, rows->size(), rows, sizeof(CollisionRow));
  };
  column("condition", first.condition);
  column("trial", first.trial);
  column("collision", first.collision);
  column("leg", first.leg);
  column("time_s", first.time);
  column("position_m", first.position);
  column("omega_minus_rad_s", first.omega_minus);
  column("omega_plus_rad_s", first.omega_plus);
  return columns;
}

py::dict trials_of(const Held& held) {
  std::vector<std::int64_t> condition, number, collisions;
  std::vector<std::optional<std::string>> outcome;
  for (const analysis::MeasuredTrial& trial : held.experiment.trials) {
    condition.push_back(static_cast<std::int64_t>(trial.condition));
    number.push_back(trial.number);
    collisions.push_back(static_cast<std::int64_t>(trial.collisions.size()));
    outcome.push_back(trial.outcome ? std::optional(std::string(analysis::outcome_name(*trial.outcome)))
                                    : std::nullopt);
  }
  py::dict columns;
  columns["condition"] = array_of(std::move(condition));
  columns["trial"] = array_of(std::move(number));
  columns["collisions"] = array_of(std::move(collisions));
  columns["outcome"] = py::cast(outcome);
  return columns;
}

// Returns a field of a CSV file; what is not known is left empty.
std::string field_of(const py::handle& value) {
  if (value.is_none()) return "";
  if (py::isinstance<py::float_>(value)) {
    const auto number = value.cast<double>();
    return std::isnan(number) ? "" : fmt::format("{}", number);
  }
  return csv_field(py::str(value).cast<std::string>());
}

std::string csv_of(const py::dict& columns, const char* name) {
  std::string text;
  std::vector<py::list> values;
  for (const auto& [key, column] : columns) {
    text += (text.empty() ? "" : ",") + csv_field(py::str(key).cast<std::string>());
    const py::object list = py::hasattr(column, "tolist") ? py::object(column.attr("tolist")())
                                                          : py::reinterpret_borrow<py::object>(column);
    values.emplace_back(list);
    if (values.back().size() != values.front().size())
      throw std::invalid_argument(fmt::format("{}: column {} has {} values where the first has {}", name,
                                              std::string(py::str(key)), values.back().size(), values.front().size()));
  }
  text += "\n";
  for (std::size_t row = 0; !values.empty() && row < values.front().size(); ++row) {
    for (std::size_t k = 0; k < values.size(); ++k) text += (k > 0 ? "," : "") + field_of(values[k][row]);
    text += "\n";
  }
  return text;
}

HeldExperiment from_arrays(const py::list& ids, const py::list& settings, const py::dict& collisions,
                           const py::object& trials, const py::dict& options) {
  const Arguments given(options);
  analysis::ExperimentSource source;
  source.folder = "arrays";
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const analysis::Setting setting = setting_of(Arguments(settings[i].cast<py::dict>()));
    if (i == 0)
      source.experiment_toml =
          analysis::wheel_description(setting, setting.restitution, setting.friction, given.text("title"), {});
    // A first leg of 0 is the default, which states nothing.
    source.experiment_toml +=
        analysis::condition_description(ids[i].cast<std::string>(), setting, true, setting.first_landing_leg != 0);
  }
  if (given.given("rate_hz") || given.given("noise_sd")) source.experiment_toml += "\n[sensor]\n";
  if (given.given("rate_hz")) source.experiment_toml += fmt::format("rate_hz = {}\n", given.number("rate_hz"));
  if (given.given("noise_sd")) source.experiment_toml += fmt::format("noise_sd_rad_s = {}\n", given.number("noise_sd"));
  source.collisions_csv = csv_of(collisions, "collisions");
  if (!trials.is_none()) source.trials_csv = csv_of(trials.cast<py::dict>(), "trials");
  return held(std::move(source));
}

HeldExperiment simulate(const py::dict& setting, const py::dict& options, const std::string& command,
                        const py::object& progress) {
  const Arguments given(options);
  LooseOptions asked(declare_simulate);
  const Pairs pairs = give_setting(Arguments(setting), *asked);
  give_simulation(given, *asked);
  asked->give("out", {"simulated"});
  asked->check_given();
  const SimulateRequest request = simulate_request(*asked, command, pairs);
  HeldExperiment experiment;
  const bool reality = asked->flag("reality");
  const LaboratoryRequest laboratory = reality ? laboratory_request(*asked, request) : LaboratoryRequest{};
  Call call(progress);
  call.run([&] {
    const BeginPart begin = parts_of(call);
    experiment =
        of_simulation(reality ? simulated_experiment(laboratory, begin) : simulated_experiment(request, begin));
  });
  return experiment;
}

py::dict diagnose(const HeldExperiment& held, const py::dict& options, const std::string& command,
                  const py::object& progress) {
  const Arguments given(options);
  LooseOptions asked(declare_diagnose);
  const std::vector<std::string> catalogue = given.texts("catalogue");
  if (!catalogue.empty()) asked->give("catalogue", {fmt::format("{}", fmt::join(catalogue, ","))});
  given.without({"catalogue"}).give(*asked);
  analysis::DiagnosisOptions study = diagnose_request(*asked, command).options;
  analysis::Diagnosis found;
  Call call(progress);
  study.progress = [&](double share, const std::string& doing) { call.tell(share, doing); };
  std::vector<std::string> figures;
  call.run([&] {
    found = analysis::diagnose(held->experiment, study);
    figures = notebook_figures(found);
  });
  const Provenance provenance{command, "experiment: " + held->experiment.title, study.seed, version()};
  return diagnosis_answer(found, provenance, figures);
}

py::dict describe(const HeldExperiment& held, const py::dict& options, const std::string& command,
                  const py::object& progress) {
  const Arguments given(options);
  LooseOptions asked(declare_describe);
  const std::vector<std::string> against = given.texts("against");
  if (!against.empty()) asked->give("against", {fmt::format("{}", fmt::join(against, ","))});
  given.without({"against"}).give(*asked);
  asked->check_given();
  DescribeRequest request = describe_request(*asked, command);
  const Provenance provenance{command, "experiment: " + held->experiment.title, request.options.seed, version()};
  Call call(progress);
  // A fit takes some 500 to 1000 evaluations of its likelihood.
  const double all = 1000.0 * static_cast<double>(held->experiment.conditions.size() + 1 + request.against.size());
  std::atomic<int> done = 0;
  request.options.progress = [&] { call.tell(std::min(1.0, ++done / all), "describe"); };
  std::optional<DescribeAnswer> found;
  call.run([&] { found = answer_describe(held->experiment, request, provenance); });
  std::string text;
  for (const Table& table : found->tables) text += to_text(table, 1000, line_width) + "\n";
  return answer(tables_json(found->tables, provenance), text, tables_html(found->tables));
}

}  // namespace

std::vector<std::string> notebook_figures(const analysis::Diagnosis& found) {
  std::vector<std::string> scripts;
  for (const auto& figures : {ranking_figures(found), closes_figures(found), furthest_figures(found),
                              return_map_figures(found), profile_figures(found)})
    for (const Figure& figure : figures) scripts.push_back(gnuplot_script(figure));
  return scripts;
}

py::dict diagnosis_answer(const analysis::Diagnosis& found, const Provenance& provenance,
                          const std::vector<std::string>& figures) {
  std::vector<Table> tables{gap_table(found),    contact_table(found),   where_table(found), at_work_table(found),
                            causes_table(found), shrinkage_table(found), steps_table(found), visibility_table(found)};
  std::erase_if(tables, [](const Table& table) { return table.rows.empty(); });
  py::dict given =
      answer(diagnosis_json(found, provenance), diagnosis_text(found, line_width),
             "<p>" + escape_html(fmt::format("{}", fmt::join(found.sentences, " "))) + "</p>" + tables_html(tables));
  given["figures"] = figures;
  return given;
}

void add_experiments(py::module_& module) {
  py::class_<Held, HeldExperiment>(module, "Experiment")
      .def_property_readonly("title", [](const Held& h) { return h.experiment.title; })
      .def_property_readonly("notes", [](const Held& h) { return h.experiment.notes; })
      .def_property_readonly("conditions",
                             [](const Held& h) {
                               std::vector<std::string> ids;
                               for (const auto& condition : h.experiment.conditions) ids.push_back(condition.id);
                               return ids;
                             })
      .def_property_readonly("said", [](const Held& h) { return h.said; })
      .def("collisions", collisions_of)
      .def("trials", trials_of)
      .def("write", write);
  module.def("read_experiment", read);
  module.def("experiment_from_arrays", from_arrays);
  module.def("simulate", simulate);
  module.def("diagnose", diagnose);
  module.def("describe", describe);
  module.def("effects_json", [] { return effects_json(); });
}

}  // namespace metastable::reports::python
