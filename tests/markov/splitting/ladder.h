#pragma once
// Makes a finite chain a return map in batches: rungs of a ladder that is climbed against the odds.

#include <cmath>
#include <vector>

#include "markov/mesh/batch_map.h"

namespace metastable::markov::testing {

/// Climbs a rung with probability `up`, else falls to half the rung, and fails on the top one.
struct Ladder {
  int top = 8;
  double up = 0.2;

  double next(double rung, bool climbs) const { return climbs ? rung + 1 : std::floor(rung / 2); }
  BatchMap batch() const {
    BatchMap map;
    map.step = [*this](int, auto states, auto scores, auto next_states, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) {
        next_states[i] = next(states[i], 0.5 * std::erfc(scores[i] / std::sqrt(2.0)) < up);
        failed[i] = next_states[i] >= top;
      }
    };
    return map;
  }
  /// Does the same and draws for itself.
  BatchMap drawing() const {
    BatchMap map;
    map.scores = 0;
    map.draw = [*this](int, auto states, auto words, auto next_states, auto failed) {
      for (std::size_t i = 0; i < failed.size(); ++i) {
        next_states[i] = next(states[i], static_cast<double>(words[i] >> 11) * 0x1p-53 < up);
        failed[i] = next_states[i] >= top;
      }
    };
    return map;
  }
  /// Returns the shares that have not failed after 0, 1, ... steps from rung 0.
  std::vector<double> survival(std::size_t steps) const {
    std::vector<double> share(static_cast<std::size_t>(top), 0.0), all{1};
    share[0] = 1;
    double alive = 1;
    for (std::size_t n = 0; n < steps; ++n) {
      std::vector<double> after(share.size(), 0.0);
      for (std::size_t rung = 0; rung < share.size(); ++rung) {
        if (rung + 1 < share.size())
          after[rung + 1] += up * share[rung];
        else
          alive -= up * share[rung];
        after[rung / 2] += (1 - up) * share[rung];
      }
      share = after;
      all.push_back(alive);
    }
    return all;
  }
  /// Returns the expected steps from rung 0, by T(r) = 1 + up T(r + 1) + (1 - up) T(r / 2) as T(r) = a_r + b_r T(0).
  double steps() const {
    // T(r + 1) = (T(r) - 1 - (1 - up) T(r / 2)) / up, each a_r + b_r T(0).
    std::vector<double> a{0}, b{1};
    for (int rung = 0; rung < top; ++rung) {
      const auto r = static_cast<std::size_t>(rung);
      a.push_back((a[r] - 1 - (1 - up) * a[r / 2]) / up);
      b.push_back((b[r] - (1 - up) * b[r / 2]) / up);
    }
    return -a.back() / b.back();
  }
};

}  // namespace metastable::markov::testing
