#pragma once
// Makes the wheel with its uneven legs as phases of a mesh.

#include <numbers>

#include "dynamics/return_map/wheel_map.h"
#include "markov/mesh/batch_map.h"

namespace metastable::analysis {

/// Has the paper's legs on 7.02 deg, eta ~ N(0.4, 0.1^2), mu ~ N(0.35, 0.1^2).
inline dynamics::WheelMap wheel_of_tests() {
  return {dynamics::Wheel{}, 7.02 * std::numbers::pi / 180, dynamics::Law::published,
          dynamics::ContactNoise::normal(0.4, 0.1, 0.35, 0.1)};
}

inline markov::BatchMap wheel_batch(const dynamics::WheelMap& wheel) {
  markov::BatchMap map;
  map.scores = wheel.noise_dimension();
  map.phases = wheel.phases();
  map.names = {"omega^2 [rad^2/s^2]"};
  map.step = [&wheel](int phase, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const auto landing = wheel.landing(states[i], phase, scores.subspan(2 * i, 2));
      failed[i] = !landing;
      next[i] = landing.value_or(0);
    }
  };
  map.inside = [](int, auto state) { return state[0] > 0; };
  return map;
}

}  // namespace metastable::analysis
