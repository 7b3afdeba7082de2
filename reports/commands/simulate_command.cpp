#include "reports/commands/simulate_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/stand_in.h"
#include "reports/commands/experiment_output.h"
#include "reports/output/standard_output.h"
#include "reports/output/table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

analysis::SimulatedCondition one_condition(const SimulateRequest& request) {
  return {fmt::format("{}", request.setting.slope_deg), request.setting,
          analysis::simulate_trials(request.setting, {.trials = request.trials,
                                                      .collisions = request.collisions,
                                                      .seed = request.seed,
                                                      .threads = request.threads})};
}

template <typename Request>
void run_into_folder(const Request& request) {
  ExperimentOutput folder(request.out);
  const SimulatedExperiment made = simulated_experiment(request);
  folder.write(made.source);
  for (const std::string& line : made.said) say("{}: {}\n", request.out, line);
}

}  // namespace

SimulatedExperiment simulated_experiment(const SimulateRequest& request) {
  const std::vector<analysis::SimulatedCondition> conditions =
      request.stand_in ? analysis::stand_in(request.setting, request.seed, request.threads)
                       : std::vector<analysis::SimulatedCondition>{one_condition(request)};
  Provenance provenance{request.command, {}, request.seed, version()};
  for (const analysis::SimulatedCondition& condition : conditions)
    provenance.settings += (provenance.settings.empty() ? "" : "\n") + condition.setting.describe();
  const std::string title = request.stand_in
                                ? "Simulated stand-in of the paper's three experiments (not a measurement)"
                                : fmt::format("Simulated rimless wheel, {} deg", request.setting.slope_deg);
  analysis::ExperimentFiles files = analysis::experiment_files(conditions, title, provenance_lines(provenance));
  if (request.camera) files.experiment_toml += fmt::format("\n[sensor]\nrate_hz = {}\n", request.camera->rate);
  SimulatedExperiment made{analysis::source_of(files, request.out), {}};
  if (request.camera) made.source.angle_csv = analysis::angle_csv(conditions, *request.camera);
  for (const auto& [id, setting, trials] : conditions) {
    const auto rested = std::count_if(trials.begin(), trials.end(),
                                      [](const auto& trial) { return trial.outcome == dynamics::Outcome::rest; });
    made.said.push_back(fmt::format("{} trials{}, {} of them came to rest", trials.size(),
                                    request.stand_in ? " of " + id : "", rested));
  }
  return made;
}

SimulatedExperiment simulated_experiment(const RealityRequest& request) {
  const dynamics::LaboratorySetup setup = analysis::laboratory_setup(request.conditions, request.reality);
  const std::vector<dynamics::LaboratoryTrial> trials = analysis::run_laboratory(setup, request.reality.threads);
  analysis::FolderOptions options;
  options.title = "Rimless wheel in the virtual laboratory";
  options.comment = provenance_lines({request.command, {}, request.reality.seed, version()});
  options.dropped = request.dropped;
  options.camera = request.camera;
  const analysis::RealityFiles files = analysis::reality_files(request.conditions, setup, trials, options);
  SimulatedExperiment made{analysis::source_of(files.files, request.out), {}};
  made.source.angle_csv = files.angle_csv;
  std::size_t collisions = 0, rested = 0, flown = 0;
  for (const dynamics::LaboratoryTrial& trial : trials) {
    collisions += trial.collisions.size();
    rested += trial.outcome == dynamics::Outcome::rest;
    for (const dynamics::LaboratoryCollision& c : trial.collisions) flown += c.flew;
  }
  made.said = {fmt::format("{} trials, {} of them came to rest; {} collisions, {} of them after a flight",
                           trials.size(), rested, collisions, flown)};
  return made;
}

void run_simulate(const SimulateRequest& request) { run_into_folder(request); }

void run_reality(const RealityRequest& request) { run_into_folder(request); }

}  // namespace metastable::reports
