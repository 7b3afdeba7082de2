#include "analysis/walker_model/walker_experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "analysis/experiment/suggestion.h"
#include "dynamics/walkers/gait.h"
#include "markov/parallel.h"

namespace metastable::analysis {

const std::vector<std::string>& walk_columns_left_out() {
  static const std::vector<std::string> names{"phase", "time_s", "position_m", "outcome"};
  return names;
}

dynamics::WalkerLaboratory walker_laboratory(const WalkerSetting& truth, const WalkerReality& reality,
                                             const WalkOptions& options) {
  if (truth.walker != Walker::compass)
    throw std::invalid_argument(
        fmt::format("--reality: the laboratory has no walker {}; it has the compass", walker_name(truth.walker)));
  if (truth.terrain != dynamics::Terrain::fresh)
    throw std::invalid_argument("--terrain: the laboratory has a plane that tilts anew at every step, fresh");
  const std::vector<double> gait =
      gait_state(truth, dynamics::find_gait(truth.map().walker(), truth.slope_deg * degree));
  dynamics::WalkerLaboratorySetup setup;
  setup.slope_deg = truth.slope_deg;
  setup.slope_sd_deg = truth.slope_sd_deg;
  setup.launch = {gait[0], gait[1], gait[2]};
  setup.launch_spread = reality.launch_spread;
  setup.effects = reality.effects;
  setup.outside = reality.outside;
  setup.trials = options.trials;
  setup.longest = options.longest;
  setup.seed = options.seed;
  return dynamics::WalkerLaboratory(setup);
}

std::vector<dynamics::WalkedTrial> run_walks(const dynamics::WalkerLaboratory& laboratory, const WalkOptions& options) {
  std::vector<dynamics::WalkedTrial> trials(laboratory.setup().trials);
  markov::parallel_for(
      trials.size(), options.threads, [&](std::size_t trial) { trials[trial] = laboratory.run(trial); },
      options.progress);
  return trials;
}

WalkFiles laboratory_walks(const dynamics::WalkerLaboratory& laboratory,
                           const std::vector<dynamics::WalkedTrial>& trials, WalkStatement statement,
                           const std::vector<std::string>& left_out) {
  for (const std::string& name : left_out) require_word("--drop", name, walk_columns_left_out());
  const auto has = [&](const char* name) { return std::ranges::find(left_out, name) == left_out.end(); };
  const std::array<double, 3>& sd = laboratory.setup().sensor_sd;
  if (statement.columns.empty())
    statement.columns = {{"half_angle_rad", sd[0]}, {"stance_rate_rad_s", sd[1]}, {"swing_rate_rad_s", sd[2]}};
  if (statement.launches.empty()) {
    const dynamics::RodStride& launch = laboratory.setup().launch;
    const double spread = laboratory.setup().launch_spread;
    for (const auto& [state, mean] :
         {std::pair("half_angle_rad", launch.half_angle), std::pair("stance_rate_rad_s", launch.stance_rate),
          std::pair("swing_rate_rad_s", launch.swing_rate)})
      statement.launches.emplace_back(state, Spread{mean, spread * std::abs(mean)});
  }
  WalkFiles files;
  files.experiment_toml = walk_toml(statement);
  files.steps_csv = "trial,step";
  for (const char* name : {"phase", "time_s", "position_m"})
    if (has(name)) files.steps_csv += fmt::format(",{}", name);
  for (const auto& column : statement.columns) files.steps_csv += "," + column.first;
  files.steps_csv += "\n";
  files.trials_csv = "trial,outcome\n";
  for (std::size_t t = 0; t < trials.size(); ++t) {
    for (std::size_t k = 0; k < trials[t].rows.size(); ++k) {
      const dynamics::WalkedRow& row = trials[t].rows[k];
      files.steps_csv += fmt::format("{},{}", t + 1, k + 1);
      if (has("phase")) files.steps_csv += fmt::format(",{}", row.leg);
      if (has("time_s")) files.steps_csv += fmt::format(",{:.4f}", row.time);
      if (has("position_m")) files.steps_csv += fmt::format(",{:.4f}", row.position);
      files.steps_csv +=
          fmt::format(",{:.9g},{:.9g},{:.9g}\n", row.seen.half_angle, row.seen.stance_rate, row.seen.swing_rate);
    }
    files.fallen += trials[t].fell;
    files.trials_csv += fmt::format("{},{}\n", t + 1, trials[t].fell ? "failed" : "stopped");
  }
  if (!has("outcome")) files.trials_csv.clear();
  return files;
}

}  // namespace metastable::analysis
