// Binds machines that are brought in Python: a step map with names, and runs of the real one.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/suggestion.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/walker_model/machine_folder.h"
#include "analysis/walker_model/walk_folder.h"
#include "reports/command_line/requests.h"
#include "reports/output/version.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"
#include "reports/python/step_arrays.h"

namespace metastable::reports::python {
namespace {

// Returns the numbers of a tuple.
std::vector<double> tuple_of(const py::handle& value) { return value.cast<std::vector<double>>(); }

std::vector<analysis::MachineParameter> parameters_of(const py::dict& fields) {
  std::vector<analysis::MachineParameter> all;
  for (const auto& [name, value] : fields) {
    const std::vector<double> v = tuple_of(value);  // nominal, sd, lower, upper
    all.push_back({name.cast<std::string>(), v.at(0), v.at(1), v.at(2), v.at(3)});
  }
  return all;
}

std::vector<analysis::MachineEffect> effects_of(const py::dict& fields) {
  std::vector<analysis::MachineEffect> all;
  for (const auto& [id, parameters] : fields) {
    analysis::MachineEffect effect{id.cast<std::string>(), {}};
    for (const auto& [name, value] : parameters.cast<py::dict>()) {
      const std::vector<double> v = tuple_of(value);  // neutral, lower, upper
      effect.parameters.push_back({name.cast<std::string>(), v.at(0), v.at(1), v.at(2)});
    }
    all.push_back(std::move(effect));
  }
  return all;
}

// Refuses a step that changed the values it was given: it would be asked for one machine and answer for another.
void require_untouched(const py::dict& values, const std::vector<std::string>& names,
                       const std::vector<py::object>& given) {
  for (std::size_t v = 0; v < names.size(); ++v)
    if (!values.contains(names[v].c_str()) || !py::object(values[names[v].c_str()]).is(given[v]))
      throw std::invalid_argument(
          fmt::format("step: it writes into p, whose \"{}\" is not what it was given any more", names[v]));
  if (values.size() != names.size())
    throw std::invalid_argument("step: it writes into p, which has names that it was not given");
}

// Asks the step map of a machine, with its values by name.
void ask_step(const py::object& step, const std::vector<std::string>& names, const analysis::MachineBatch& batch) {
  py::dict values;
  std::vector<py::object> given;
  for (std::size_t v = 0; v < names.size(); ++v) {
    const std::span<const double> one = batch.values[v];
    if (one.size() == 1) {
      given.emplace_back(py::float_(one[0]));
    } else {
      py::array_t<double> array(static_cast<py::ssize_t>(one.size()), one.data());
      array.attr("setflags")(py::arg("write") = false);
      given.push_back(std::move(array));
    }
    values[names[v].c_str()] = given.back();
  }
  const py::object returned = call_step([&]() -> py::object {
    try {
      return step(rows_of(batch.states, batch.rows), rows_of(batch.scores, batch.rows), values);
    } catch (py::error_already_set& error) {
      if (!error.matches(PyExc_KeyError)) throw;
      raise_instead(error, "InputError",
                    fmt::format("step: it asks a dict for {}, which is not there; p has {}",
                                std::string(py::str(error.value())), fmt::join(names, ", ")));
    }
  });
  require_untouched(values, names, given);
  take_step(returned, batch.rows, batch.next, batch.failed);
}

std::shared_ptr<analysis::Machine> machine_of(const py::dict& fields) {
  auto machine = std::make_shared<analysis::Machine>();
  const Arguments given(fields);
  machine->name = given.text("name");
  machine->states = given.texts("states");
  machine->scores = static_cast<int>(given.whole("noise", 1, 16));
  machine->parameters = parameters_of(fields["parameters"]);
  machine->effects = effects_of(fields["effects"]);
  machine->may_vary = given.texts("may_vary");
  machine->inputs = given.texts("inputs");
  machine->most_wild = given.number("most_wild");
  machine->units = fields["units"].cast<std::map<std::string, std::string>>();
  for (const auto& [state, value] : fields["sensor"].cast<py::dict>()) {
    const auto both = value.cast<std::pair<std::optional<double>, double>>();
    machine->observe.push_back({state.cast<std::string>(), both.first, both.second});
  }
  for (const auto& [state, value] : fields["launch"].cast<py::dict>()) {
    const auto both = value.cast<std::pair<double, double>>();
    machine->launches.push_back({state.cast<std::string>(), both.first, both.second});
  }
  return machine;
}

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

std::optional<analysis::MachineOutcome> outcome_of(const py::handle& value) {
  if (value.is_none()) return std::nullopt;
  const auto word = value.cast<std::string>();
  if (word == "failed") return analysis::MachineOutcome::failed;
  if (word == "stopped") return analysis::MachineOutcome::stopped;
  if (word == "lost") return analysis::MachineOutcome::lost;
  throw std::invalid_argument(fmt::format("outcome: \"{}\" is none of failed, stopped, lost", word));
}

// Reads runs as metastable._machines lays them out: rows in order, each with the index of its trial.
analysis::MachineRuns runs_of(const py::dict& fields) {
  analysis::MachineRuns runs;
  runs.conditions = fields["conditions"].cast<std::vector<std::string>>();
  runs.phases = fields["phases"].cast<std::vector<std::string>>();
  for (const auto& [name, values] : fields["labels"].cast<py::dict>())
    runs.labels.push_back({name.cast<std::string>(), values.cast<std::vector<std::string>>()});
  const auto indices = [&](const char* name) { return Indices(py::object(fields[name])); };
  const auto numbers = [&](const char* name) { return Numbers(py::object(fields[name])); };
  const Indices trial = indices("trial"), phase = indices("phase"), labels = indices("label_index");
  const Indices condition = indices("trial_condition");
  const Numbers seen = numbers("seen"), inputs = numbers("input_values");
  const Numbers time = numbers("time"), position = numbers("position");
  const auto outcomes = fields["outcome"].cast<py::list>();
  const auto names = fields["trial_names"].cast<std::vector<std::string>>();
  for (py::ssize_t t = 0; t < condition.size(); ++t)
    runs.trials.push_back({static_cast<std::size_t>(condition.at(t)),
                           outcome_of(outcomes[static_cast<std::size_t>(t)]),
                           {},
                           names[static_cast<std::size_t>(t)]});
  for (py::ssize_t i = 0; i < trial.size(); ++i) {
    analysis::MachineRow row;
    for (py::ssize_t j = 0; j < seen.shape(1); ++j) row.seen.push_back(seen.at(i, j));
    for (py::ssize_t j = 0; j < inputs.shape(1); ++j) row.inputs.push_back(inputs.at(i, j));
    for (py::ssize_t j = 0; j < labels.shape(1); ++j) row.labels.push_back(static_cast<int>(labels.at(i, j)));
    row.phase = static_cast<int>(phase.at(i));
    row.time = time.at(i);
    row.position = position.at(i);
    runs.trials[static_cast<std::size_t>(trial.at(i))].rows.push_back(std::move(row));
  }
  return runs;
}

py::dict diagnose_machine(const py::dict& machine_fields, const py::dict& runs_fields, const py::dict& options,
                          const std::string& command, const py::object& progress) {
  const std::shared_ptr<analysis::Machine> machine = machine_of(machine_fields);
  const py::object step = machine_fields["step"];
  const Arguments given(options);
  analysis::DiagnosisOptions study;
  study.seed = given.whole("seed", 0, UINT64_MAX);
  study.threads = static_cast<int>(given.whole("threads", 0, 1024));
  study.catalogue = given.texts("catalogue");
  analysis::MachineRuns runs = runs_of(runs_fields);
  analysis::Diagnosis found;
  Call call(progress);
  std::vector<std::string> figures;
  const std::vector<std::string> names = machine->value_names();
  machine->dear = true;
  machine->step = [&](const analysis::MachineBatch& batch) {
    if (batch.rows > 0) call.ask([&] { ask_step(step, names, batch); });
  };
  study.progress = [&](double share, const std::string& doing) { call.tell(share, doing); };
  call.run([&] {
    std::shared_ptr<const analysis::TransitionModel> model = analysis::machine_transitions(machine, std::move(runs));
    analysis::require_effects(study.catalogue, model->effect_ids());
    found = analysis::diagnose(model, study);
    figures = notebook_figures(found);
  });
  return diagnosis_answer(found, {command, "machine: " + machine->name, study.seed, version()}, figures);
}

// Reads a folder of a machine's runs, `model = "none"`: its columns by name, its labels and inputs as dicts, and the
// outcomes in the order of the trials.
py::dict read_runs(const py::dict& machine_fields, const std::string& folder, const std::vector<std::string>& labels) {
  const std::shared_ptr<analysis::Machine> machine = machine_of(machine_fields);
  const analysis::MachineRuns runs = analysis::read_machine_folder(folder, *machine, labels);
  const auto word = [](const std::vector<std::string>& words, int index) -> py::object {
    if (index < 0) return py::none();
    return py::str(words[static_cast<std::size_t>(index)]);
  };
  py::dict columns, labelled, inputs;
  py::list trial, condition, phase, time, position, outcomes;
  std::vector<py::list> seen(machine->observe.size()), label(runs.labels.size()), input(machine->inputs.size());
  for (const analysis::MachineTrial& one : runs.trials) {
    outcomes.append(!one.outcome                                        ? py::object(py::none())
                    : *one.outcome == analysis::MachineOutcome::failed  ? py::object(py::str("failed"))
                    : *one.outcome == analysis::MachineOutcome::stopped ? py::object(py::str("stopped"))
                                                                        : py::object(py::str("lost")));
    for (const analysis::MachineRow& row : one.rows) {
      trial.append(std::stoll(one.name));
      condition.append(runs.conditions[one.condition]);
      phase.append(word(runs.phases, row.phase));
      time.append(row.time);
      position.append(row.position);
      for (std::size_t j = 0; j < seen.size(); ++j) seen[j].append(row.seen[j]);
      for (std::size_t l = 0; l < label.size(); ++l) label[l].append(word(runs.labels[l].values, row.labels[l]));
      for (std::size_t i = 0; i < input.size(); ++i) input[i].append(row.inputs[i]);
    }
  }
  columns["trial"] = trial;
  columns["condition"] = condition;
  if (!runs.phases.empty()) columns["phase"] = phase;
  columns["time_s"] = time;
  columns["position_m"] = position;
  for (std::size_t j = 0; j < seen.size(); ++j) columns[machine->observe[j].state.c_str()] = seen[j];
  for (std::size_t l = 0; l < label.size(); ++l) labelled[runs.labels[l].name.c_str()] = label[l];
  for (std::size_t i = 0; i < input.size(); ++i) inputs[machine->inputs[i].c_str()] = input[i];
  py::dict all;
  all["columns"] = columns;
  all["labels"] = labelled;
  all["inputs"] = inputs;
  all["outcome"] = outcomes;
  return all;
}

// Returns nothing for a folder that holds no walks.
py::object diagnose_walks(const std::string& folder, const py::dict& options, const std::string& command,
                          const py::object& progress) {
  std::optional<analysis::Walks> walks;
  Call call(progress);
  call.run([&] { walks = analysis::read_walks(folder); });
  if (!walks) return py::none();
  for (const char* name : {"at_slope", "at_speed"})
    if (options.contains(name)) throw std::invalid_argument(std::string(name) + ": has no meaning with walks");
  const Arguments given(options);
  analysis::DiagnosisOptions study;
  study.seed = given.whole("seed", 0, UINT64_MAX);
  study.threads = static_cast<int>(given.whole("threads", 0, 1024));
  study.catalogue = given.texts("catalogue");
  study.progress = [&](double share, const std::string& doing) { call.tell(share, doing); };
  analysis::Diagnosis found;
  std::vector<std::string> figures;
  call.run([&] {
    found = analysis::diagnose_walks(*walks, study);
    figures = notebook_figures(found);
  });
  return diagnosis_answer(found, {command, "experiment: " + walks->title, study.seed, version()}, figures);
}

}  // namespace

void add_machines(py::module_& module) {
  module.def("check_machine", [](const py::dict& fields) {
    const std::shared_ptr<analysis::Machine> machine = machine_of(fields);
    machine->step = [](const analysis::MachineBatch&) {};
    machine->require_valid();
  });
  module.def("diagnose_machine", diagnose_machine);
  module.def("read_runs", read_runs);
  module.def("diagnose_walks", diagnose_walks);
}

}  // namespace metastable::reports::python
