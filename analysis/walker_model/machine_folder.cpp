#include "analysis/walker_model/machine_folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "analysis/experiment/experiment_toml.h"
#include "analysis/walker_model/steps_reader.h"

namespace metastable::analysis {
namespace {

constexpr dynamics::Range any_state{.low = -1e300, .high = 1e300};

bool is_text_of(double stated, double own) {
  return std::abs(stated - own) <= 1e-9 * std::max(std::abs(stated), std::abs(own));
}

// Refuses a description that contradicts the machine: the folder is another one's.
void require_same_machine(const std::string& file, const MachineDescription& told, const Machine& machine) {
  const auto refuse = [&](const std::string& what) {
    throw InputError({fmt::format("{}: {}: is the folder of another machine?", file, what)});
  };
  for (const auto& [name, known] : told.parameters) {
    const auto own = std::ranges::find(machine.parameters, name, &MachineParameter::name);
    if (own == machine.parameters.end())
      refuse(fmt::format("machine.parameters.{}: the machine has no such one", name));
    if (!is_text_of(known.mean, own->nominal) || !is_text_of(known.sd, own->sd))
      refuse(fmt::format("machine.parameters.{}: {} with sd {}, where the machine has {} with sd {}", name, known.mean,
                         known.sd, own->nominal, own->sd));
  }
  for (const WalkDescription::Column& column : told.columns) {
    const auto own = std::ranges::find(machine.observe, column.state, &MachineSensor::state);
    if (own == machine.observe.end()) refuse(fmt::format("columns.{}: the machine does not observe it", column.state));
    if (column.sd && own->sd && !is_text_of(*column.sd, *own->sd))
      refuse(fmt::format("columns.{}: sd {}, where the machine's sensor has {}", column.state, *column.sd, *own->sd));
    if (!is_text_of(column.correlation, own->correlation))
      refuse(fmt::format("columns.{}: correlation {}, where the machine's sensor has {}", column.state,
                         column.correlation, own->correlation));
  }
  const std::set<std::string> stated(told.inputs.begin(), told.inputs.end()),
      own(machine.inputs.begin(), machine.inputs.end());
  if (!stated.empty() && stated != own)
    refuse(fmt::format("machine.inputs: {}, where the machine takes {}", fmt::join(stated, ", "),
                       own.empty() ? "none" : fmt::format("{}", fmt::join(own, ", "))));
}

}  // namespace

MachineRuns read_machine_folder(const std::filesystem::path& folder, const Machine& machine,
                                const std::vector<std::string>& labels) {
  const ExperimentSource source = read_source(folder);
  const std::string file = (std::filesystem::path(source.folder) / "experiment.toml").string();
  Defects defects;
  const std::optional<MachineDescription> told = parse_machine_toml(file, source.experiment_toml, defects);
  defects.check();
  require_same_machine(file, *told, machine);
  StepColumns columns;
  for (const MachineSensor& sensor : machine.observe) columns.states.emplace_back(sensor.state, any_state);
  columns.inputs = machine.inputs;
  columns.labels = told->labels;
  if (const std::string objection = label_objection(labels, columns); !objection.empty()) throw InputError({objection});
  for (const std::string& label : labels)
    if (std::ranges::find(told->labels, label) == told->labels.end()) columns.labels_of_call.push_back(label);
  MachineRuns runs;
  read_steps(source, columns, runs, defects);
  defects.check();
  return runs;
}

}  // namespace metastable::analysis
