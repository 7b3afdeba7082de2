#pragma once
// A blind case draws its random numbers from here.

#include <Random123/philox.h>

#include <algorithm>
#include <cstdint>

#include "analysis/statistics/random.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {

/// Gives random numbers in the order they are asked for, from Philox4x64 at counter (number, n) with key (seed). A
/// run's cases are numbered from 1; 0 is its plan.
class BlindDice {
 public:
  BlindDice(std::uint64_t seed, std::uint64_t number) : seed_(seed), number_(number) {}
  std::uint64_t word() {
    const r123::Philox4x64::ctr_type counter{{number_, asked_++, 300, 0}};
    return r123::Philox4x64()(counter, r123::Philox4x64::key_type{{seed_, 0}})[0];
  }
  /// Returns a number that lies in the open interval (from, to).
  double uniform(double from = 0, double to = 1) { return from + (to - from) * unit_interval(word()); }
  /// Draws from .. to, both included.
  int whole(int from, int to) { return std::min(to, from + static_cast<int>(uniform(0, to - from + 1))); }
  bool chance(double probability) { return uniform() < probability; }
  double sign() { return chance(0.5) ? 1 : -1; }
  double normal() { return dynamics::normal_quantile(uniform()); }

 private:
  std::uint64_t seed_, number_, asked_ = 0;
};

}  // namespace metastable::analysis
