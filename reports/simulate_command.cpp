#include "reports/simulate_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "analysis/experiment_folder.h"
#include "reports/output_file.h"
#include "reports/table.h"
#include "reports/version.h"

namespace metastable::reports {

void run_simulate(const SimulateRequest& request) {
  const std::filesystem::path folder = request.out;
  for (const char* name : {"experiment.toml", "collisions.csv", "trials.csv", "angle.csv"})
    if (std::filesystem::exists(folder / name))
      throw OutputError(folder, fmt::format("already holds {}; choose another folder", name));
  make_folder(folder);
  const std::vector<dynamics::Trial> trials = analysis::simulate_trials(
      request.setting,
      {.trials = request.trials, .collisions = request.collisions, .seed = request.seed, .threads = request.threads});
  const Provenance provenance{request.command, request.setting.describe(), request.seed, version()};
  analysis::ExperimentFiles files = analysis::experiment_files(
      request.setting, trials, fmt::format("Simulated rimless wheel, {} deg", request.setting.slope_deg),
      provenance_lines(provenance));
  if (request.camera) {
    files.experiment_toml += fmt::format("\n[sensor]\nrate_hz = {}\n", request.camera->rate);
    write_file(folder / "angle.csv", analysis::angle_csv(request.setting, trials, *request.camera));
  }
  // experiment.toml last: a folder without it is not an experiment yet.
  write_file(folder / "collisions.csv", files.collisions_csv);
  write_file(folder / "trials.csv", files.trials_csv);
  write_file(folder / "experiment.toml", files.experiment_toml);
  const auto rested = std::count_if(trials.begin(), trials.end(),
                                    [](const auto& trial) { return trial.outcome == dynamics::Outcome::rest; });
  fmt::print("{}: {} trials, {} of them came to rest\n", request.out, trials.size(), rested);
}

}  // namespace metastable::reports
