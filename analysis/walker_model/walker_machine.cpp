#include "analysis/walker_model/walker_machine.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include "dynamics/catalogue/walker_effects.h"
#include "dynamics/walkers/uneven_walker.h"

namespace metastable::analysis {
namespace {

constexpr double feet = 1e-9;  // mass of the simplest walker's feet, in masses of the hip

// The index of each value in MachineBatch::values.
struct Places {
  std::size_t slope = 0, slope_sd = 1, damping = 2, torque = 3, loss = 4, slip = 5, mass_ratio = 6, higher = 7,
              longer = 8, stance_leg = 9;
};

dynamics::UnevenWalker ideal(Walker walker) {
  dynamics::UnevenWalker w;
  if (walker == Walker::compass) return w;
  w.stance = w.swing = {feet, 0, 1};
  w.hip_mass = w.gravity = 1;
  return w;
}

dynamics::UnevenWalker walker_of(const WalkerStatement& s, const MachineBatch& batch, std::size_t i) {
  const Places at;
  dynamics::UnevenWalker w = ideal(s.setting.walker);
  const double scale = s.setting.walker == Walker::simplest ? feet : 1;
  w.hip_damping = scale * batch.value(at.damping, i);
  w.hip_friction = scale * batch.value(at.torque, i);
  w.impact_loss = batch.value(at.loss, i);
  w.foot_slip = batch.value(at.slip, i);
  if (s.setting.walker == Walker::simplest || !s.legs) return w;
  dynamics::WalkerLeg& first = batch.value(at.stance_leg, i) < 1.5 ? w.stance : w.swing;
  first.mass *= batch.value(at.mass_ratio, i);
  first.foot_to_mass += batch.value(at.higher, i);
  first.mass_to_hip -= batch.value(at.higher, i);
  first.foot_to_mass += batch.value(at.longer, i);
  return w;
}

void step(const WalkerStatement& s, const MachineBatch& batch) {
  const bool compass = s.setting.walker == Walker::compass;
  const std::size_t n = batch.rows, dimension = compass ? 3 : 2;
  const Places at;
  std::vector<dynamics::UnevenWalker> walkers;
  std::vector<double> states(3 * n), slopes(n), next(3 * n);
  for (std::size_t i = 0; i < n; ++i) {
    walkers.push_back(walker_of(s, batch, i));
    const double* state = &batch.states[i * dimension];
    states[3 * i] = state[0];
    states[3 * i + 1] = state[1];
    states[3 * i + 2] = compass ? state[2] : std::cos(2 * state[0]) * state[1];
    slopes[i] = degree * (batch.value(at.slope, i) + batch.value(at.slope_sd, i) * batch.scores[i]);
  }
  dynamics::step_uneven(walkers, states, slopes, next, batch.failed);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t d = 0; d < dimension; ++d) batch.next[i * dimension + d] = next[3 * i + d];
}

}  // namespace

Machine walker_machine(const WalkerStatement& statement) {
  const WalkerSetting& setting = statement.setting;
  setting.map();  // throws for a setting out of range
  if (setting.terrain != dynamics::Terrain::fresh)
    throw std::invalid_argument("terrain: only a plane that tilts anew at every step is a machine's");
  const bool compass = setting.walker == Walker::compass;
  Machine machine;
  machine.name = walker_name(setting.walker);
  machine.states = {"half_angle_rad", "stance_rate_rad_s"};
  if (compass) machine.states.emplace_back("swing_rate_rad_s");
  machine.step = [statement](const MachineBatch& batch) { step(statement, batch); };
  const double roughness = setting.slope_sd_deg;
  machine.parameters = {
      {"slope_deg", setting.slope_deg, statement.slope_known_deg, 0, 45},
      {"slope_sd_deg", roughness, statement.roughness_known_deg.value_or(roughness), 1e-4 * roughness, 45}};
  machine.may_vary = {"slope_deg"};
  machine.whole_state = true;
  // Bounds of the compass in units of its own: 5 N m s/rad stops its swing leg within a step.
  machine.effects = {{"hip_damping", {{"damping", 0, 0, compass ? 5.0 : 2.0}}},
                     {"hip_dry_friction", {{"torque", 0, 0, compass ? 5.0 : 0.5}}},
                     {"impact_loss", {{"share", 0, -0.3, 0.3}}},
                     {"foot_slip", {{"slip", 0, 0, 0.2}}}};
  if (compass) {
    for (const MachineEffect& effect : machine.effects)
      for (const SuspectedParameter& p : effect.parameters)
        for (const dynamics::EffectParameter& known : dynamics::walker_effect_info(effect.id).parameters)
          if (known.name == p.name) machine.units[p.name] = known.unit;
  } else {  // Its lengths are in legs, its times in sqrt(l/g).
    machine.units = {
        {"stance_rate_rad_s", "rad sqrt(g/l)"}, {"damping", "sqrt(g/l)"}, {"torque", "g/l"}, {"slip", "leg lengths"}};
  }
  if (!compass || !statement.legs) return machine;
  machine.effects.push_back({"leg_mass", {{"mass_ratio", 1, 0.5, 2}, {"higher", 0, -0.2, 0.2}}});
  machine.effects.push_back({"leg_length", {{"longer", 0, -0.05, 0.05}}});
  machine.units["higher"] = machine.units["longer"] = "m";
  machine.inputs = {"stance_leg"};
  return machine;
}

}  // namespace metastable::analysis
