#include "reports/experiment_commands/simulate_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/input_error.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/study/steady_launch.h"
#include "reports/experiment_commands/experiment_output.h"
#include "reports/output/answer.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

// Begins a part of the work.
markov::Share begun(const BeginPart& begin, const char* name) {
  return [tell = begin(name), name](double share) { tell(share, name); };
}

// Takes it as it is given, and tells of its part.
std::optional<analysis::CameraOptions> filmed(std::optional<analysis::CameraOptions> camera, const BeginPart& begin) {
  if (camera) camera->progress = begun(begin, "recording angles");
  return camera;
}

// Returns the setting with a launch that trials can be drawn from.
analysis::Setting launched(const analysis::Setting& setting, std::uint64_t seed, int threads, const BeginPart& begin) {
  if (!setting.steady_launch) return setting;
  return analysis::steadily_launched(setting, {.seed = seed, .threads = threads, .progress = begin("steady launch")});
}

analysis::SimulatedCondition one_condition(const SimulateRequest& request, const BeginPart& begin) {
  const analysis::Setting setting = launched(request.setting, request.seed, request.threads, begin);
  const markov::Share progress = begun(begin, "simulate");
  return {fmt::format("{}", setting.slope_deg), setting,
          analysis::simulate_trials(setting, {.trials = request.trials,
                                              .collisions = request.collisions,
                                              .seed = request.seed,
                                              .threads = request.threads,
                                              .progress = progress})};
}

template <typename Request>
void run_into_folder(const Request& request) {
  ExperimentOutput folder(request.out);
  Answer answer(request.json);
  const SimulatedExperiment made = [&] {
    ProgressParts progress;
    return simulated_experiment(request, progress.begin());
  }();
  folder.write(made.source);
  for (const std::string& line : made.said) answer.say("{}: {}", request.out, line);
  answer.fact("folder", request.out);
  answer.finish(made.provenance);
}

// Refuses a ramp without end: experiment.toml states where the ramp ends.
void require_end(const analysis::Setting& setting) {
  if (std::isinf(setting.ramp_length))
    throw std::invalid_argument("--ramp-length: inf: the ramp of an experiment ends; up to 100000 m do");
}

// Refuses trials that no reader of experiment folders takes: on steep ramps wheels fly, and legs do not land in turn.
void require_readable(const analysis::ExperimentSource& source) {
  try {
    analysis::parse_experiment(source);
  } catch (const analysis::InputError& error) {
    throw std::runtime_error(
        fmt::format("nothing was written: no reader of experiment folders takes these trials ({}); where a wheel flies "
                    "over a leg, a flatter slope or slower launches do",
                    error.lines().front()));
  }
}

}  // namespace

SimulatedExperiment simulated_experiment(const SimulateRequest& request, const BeginPart& begin) {
  require_end(request.setting);
  const std::vector<analysis::SimulatedCondition> conditions =
      request.stand_in ? analysis::stand_in(request.setting, request.seed, request.threads, begun(begin, "simulate"))
                       : std::vector<analysis::SimulatedCondition>{one_condition(request, begin)};
  Provenance provenance{request.command, {}, request.seed, version()};
  for (const analysis::SimulatedCondition& condition : conditions)
    provenance.settings += (provenance.settings.empty() ? "" : "\n") + condition.setting.describe();
  const std::string title = request.stand_in
                                ? "Simulated stand-in of the paper's three experiments (not a measurement)"
                                : fmt::format("Simulated rimless wheel, {} deg", request.setting.slope_deg);
  analysis::ExperimentFiles files = analysis::experiment_files(conditions, title, provenance_lines(provenance));
  if (request.camera) files.experiment_toml += fmt::format("\n[sensor]\nrate_hz = {}\n", request.camera->rate);
  SimulatedExperiment made{analysis::source_of(files, request.out), {}, provenance};
  if (const auto camera = filmed(request.camera, begin))
    made.source.angle_csv = analysis::angle_csv(conditions, *camera);
  for (const auto& [id, setting, trials] : conditions) {
    const auto rested = std::count_if(trials.begin(), trials.end(),
                                      [](const auto& trial) { return trial.outcome == dynamics::Outcome::rest; });
    made.said.push_back(fmt::format("{} trials{}, {} of them came to rest", trials.size(),
                                    request.stand_in ? " of " + id : "", rested));
  }
  require_readable(made.source);
  return made;
}

SimulatedExperiment simulated_experiment(const LaboratoryRequest& asked, const BeginPart& begin) {
  LaboratoryRequest request = asked;
  for (analysis::LaboratoryCondition& condition : request.conditions) {
    require_end(condition.setting);
    condition.setting = launched(condition.setting, request.reality.seed, request.reality.threads, begin);
  }
  const dynamics::LaboratorySetup setup = analysis::laboratory_setup(request.conditions, request.reality);
  const std::vector<dynamics::LaboratoryTrial> trials =
      analysis::run_laboratory(setup, request.reality.threads, begun(begin, "simulate"));
  analysis::FolderOptions options;
  options.title = "Rimless wheel in the virtual laboratory";
  const Provenance provenance{request.command, {}, request.reality.seed, version()};
  options.comment = provenance_lines(provenance);
  options.dropped = request.dropped;
  options.camera = filmed(request.camera, begin);
  const analysis::LaboratoryFiles files = analysis::laboratory_files(request.conditions, setup, trials, options);
  SimulatedExperiment made{analysis::source_of(files.files, request.out), {}, provenance};
  made.source.angle_csv = files.angle_csv;
  std::size_t collisions = 0, rested = 0, flown = 0;
  for (const dynamics::LaboratoryTrial& trial : trials) {
    collisions += trial.collisions.size();
    rested += trial.outcome == dynamics::Outcome::rest;
    for (const dynamics::LaboratoryCollision& c : trial.collisions) flown += c.flew;
  }
  made.said = {fmt::format("{} trials, {} of them came to rest; {} collisions, {} of them after a flight",
                           trials.size(), rested, collisions, flown)};
  require_readable(made.source);
  return made;
}

void run_simulate(const SimulateRequest& request) { run_into_folder(request); }

void simulate_in_laboratory(const LaboratoryRequest& request) { run_into_folder(request); }

}  // namespace metastable::reports
