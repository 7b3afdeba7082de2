#pragma once
// Sums the energy lost per collision in simulated trials (the paper's Fig. 8).

#include <cstdint>

#include "analysis/study/setting.h"

namespace metastable::analysis {

struct MeanSpread {
  double mean = 0;            ///< [J]
  double sd = 0;              ///< [J]
  double standard_error = 0;  ///< of the mean, between trials [J]
};

struct EnergyLosses {
  MeanSpread tangential_net;  ///< eps_t - eps_pot, friction loss less the potential energy gained by slipping downhill
  MeanSpread normal;          ///< eps_n; under `settled` what impacts take besides friction
  std::uint64_t collisions = 0;
};

struct EnergyLossOptions {
  int trials = 1000;       ///< >= 2
  int collisions = 16;     ///< per trial, >= 1
  bool rest_rule = false;  ///< false: as in Fig. 8, the wheel goes on whatever happens and x' < 0 is set to 0
  std::uint64_t seed = 1;
  int threads = 0;
};

/// Sums the losses of all collisions of all trials under `setting`. O(trials x collisions); the same bits on any number
/// of threads.
EnergyLosses energy_losses(const Setting& setting, const EnergyLossOptions& options);

}  // namespace metastable::analysis
