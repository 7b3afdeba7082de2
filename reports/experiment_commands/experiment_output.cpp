#include "reports/experiment_commands/experiment_output.h"

#include <fmt/format.h>

namespace metastable::reports {
namespace {

const std::filesystem::path& without_experiment(const std::filesystem::path& folder) {
  for (const char* name : {"experiment.toml", "collisions.csv", "trials.csv", "angle.csv", "steps.csv"})
    if (std::filesystem::exists(folder / name))
      throw OutputError(folder, fmt::format("already holds {}; choose another folder", name));
  return folder;
}

}  // namespace

ExperimentOutput::ExperimentOutput(const std::filesystem::path& folder) : whole_(without_experiment(folder)) {}

void ExperimentOutput::write(const analysis::ExperimentSource& source) {
  constexpr const char* description = "experiment.toml";  // a folder without it is not an experiment yet
  const std::filesystem::path& folder = whole_.path();
  if (source.collisions_csv) write_file(folder / "collisions.csv", *source.collisions_csv);
  if (source.steps_csv) write_file(folder / "steps.csv", *source.steps_csv);
  if (source.trials_csv) write_file(folder / "trials.csv", *source.trials_csv);
  if (source.angle_csv) write_file(folder / "angle.csv", *source.angle_csv);
  write_file(folder / description, source.experiment_toml);
  whole_.commit(description);
}

}  // namespace metastable::reports
