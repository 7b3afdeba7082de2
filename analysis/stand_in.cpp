#include "analysis/stand_in.h"

namespace metastable::analysis {

Setting stand_in_setting() {
  Setting setting;
  setting.restitution = {0.54, 0.045};
  setting.friction = {0.352, 0.043};
  return setting;
}

std::vector<SimulatedCondition> stand_in(const Setting& base, std::uint64_t seed, int threads) {
  struct Condition {
    const char* id;
    double slope_deg;
    Spread initial_speed;
    int trials;
  };
  constexpr int collisions = 16;
  std::vector<SimulatedCondition> conditions;
  std::uint64_t first = 0;
  for (const Condition& c : {Condition{"fast-9.59", 9.59, {5.83, 0.28}, 51},
                             {"slow-9.59", 9.59, {4.51, 0.36}, 48},
                             {"fast-7.02", 7.02, {7.35, 0.19}, 50}}) {
    Setting setting = base;
    setting.slope_deg = c.slope_deg;
    setting.initial_speed = c.initial_speed;
    conditions.push_back(
        {c.id, setting,
         simulate_trials(
             setting,
             {.trials = c.trials, .collisions = collisions, .seed = seed, .threads = threads, .first = first})});
    first += static_cast<std::uint64_t>(c.trials);
  }
  return conditions;
}

}  // namespace metastable::analysis
