#include "analysis/experiment/experiment_notes.h"

#include <fmt/format.h>

#include <string_view>

namespace metastable::analysis {

std::vector<std::string> notes_on(const Experiment& experiment) {
  std::vector<std::string> notes;
  const auto missing = [&](Presence presence, std::string_view column) {
    if (presence == Presence::none) notes.push_back(fmt::format("{} is not given.", column));
    if (presence == Presence::some) notes.push_back(fmt::format("{} is given for some collisions only.", column));
  };
  if (experiment.system == System::rimless_wheel) missing(experiment.columns.leg, "leg");
  missing(experiment.columns.time, "time_s");
  if (experiment.system == System::rimless_wheel) missing(experiment.columns.position, "position_m");
  missing(experiment.columns.omega_plus, "omega_plus_rad_s");
  if (!experiment.columns.outcomes) notes.push_back("There is no trials.csv: how the trials ended is not known.");
  for (std::size_t c = 0; c < experiment.conditions.size(); ++c) {
    const Condition& condition = experiment.conditions[c];
    std::size_t trials = 0, others = 0;
    for (const MeasuredTrial& roll : experiment.trials) {
      if (roll.condition != c) continue;
      ++trials;
      others += roll.collisions.front().leg.value_or(condition.first_landing_leg) != condition.first_landing_leg;
    }
    if (trials == 0) notes.push_back(fmt::format("Condition '{}' has no trial.", condition.id));
    if (others > 0)
      notes.push_back(
          fmt::format("Condition '{}': {} of {} trials do not begin with first_landing_leg = {}; the "
                      "column leg counts.",
                      condition.id, others, trials, condition.first_landing_leg));
  }
  return notes;
}

}  // namespace metastable::analysis
