#include "analysis/experiment/stand_in.h"

namespace metastable::analysis {

Setting stand_in_setting() {
  Setting setting;
  setting.restitution = {0.54, 0.045};
  setting.friction = {0.352, 0.043};
  return setting;
}

std::vector<LaboratoryCondition> stand_in_conditions(const Setting& base) {
  std::vector<LaboratoryCondition> conditions{
      {"fast-9.59", base, 51}, {"slow-9.59", base, 48}, {"fast-7.02", base, 50}};
  conditions[0].setting.slope_deg = conditions[1].setting.slope_deg = 9.59;
  conditions[2].setting.slope_deg = 7.02;
  conditions[0].setting.initial_speed = {5.83, 0.28};
  conditions[1].setting.initial_speed = {4.51, 0.36};
  conditions[2].setting.initial_speed = {7.35, 0.19};
  return conditions;
}

std::vector<SimulatedCondition> stand_in(const Setting& base, std::uint64_t seed, int threads,
                                         const markov::Share& progress) {
  constexpr int collisions = 16;
  std::vector<SimulatedCondition> conditions;
  std::uint64_t first = 0;
  for (const auto& [id, setting, trials] : stand_in_conditions(base)) {
    conditions.push_back({id, setting,
                          simulate_trials(setting, {.trials = trials,
                                                    .collisions = collisions,
                                                    .seed = seed,
                                                    .threads = threads,
                                                    .first = first,
                                                    .progress = progress})});
    first += static_cast<std::uint64_t>(trials);
  }
  return conditions;
}

}  // namespace metastable::analysis
