#include "analysis/experiment/experiment_notes.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "analysis/experiment/rolling_speeds.h"
#include "analysis/experiment/stance_check.h"

namespace metastable::analysis {
namespace {

constexpr double beyond_lifting = 1.2;  // landings of engines reach 1.0

// Names speeds that a wheel on this ramp hardly has; those that none has are refused before.
void note_odd_speeds(const Experiment& experiment, std::size_t condition, std::vector<std::string>& notes) {
  const RollingSpeeds bounds = rolling_speeds(experiment, condition);
  std::size_t slow = 0, fast = 0;
  for (const MeasuredTrial& roll : experiment.trials) {
    if (roll.condition != condition) continue;
    for (const MeasuredCollision& c : roll.collisions) {
      slow += c.number > 1 && c.omega_minus < bounds.slowest;
      fast += c.omega_minus > beyond_lifting * bounds.lifting;
    }
  }
  const std::string& id = experiment.conditions[condition].id;
  if (slow > 0)
    notes.push_back(fmt::format(
        "Condition '{}': {} speeds from collision 2 on are below {:.3g} rad/s, where a wheel that has come over a leg "
        "reaches {:.3g} rad/s.",
        id, slow, bounds.slowest, bounds.slowest / RollingSpeeds::room));
  if (fast > 0)
    notes.push_back(
        fmt::format("Condition '{}': {} speeds are above {:.3g} rad/s, where feet lift off at {:.3g} rad/s.", id, fast,
                    beyond_lifting * bounds.lifting, bounds.lifting));
}

}  // namespace

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
  if (experiment.system == System::rimless_wheel)
    for (std::string& question : questions_on_stances(experiment)) notes.push_back(std::move(question));
  for (std::size_t c = 0; c < experiment.conditions.size(); ++c) {
    const Condition& condition = experiment.conditions[c];
    if (experiment.system == System::rimless_wheel) note_odd_speeds(experiment, c, notes);
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
