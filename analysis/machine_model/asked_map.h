#pragma once
// Asks the map of a machine about measured rows, before anything is fitted: in several ways that must not matter, and
// what it makes of them beside what was measured.

#include <numbers>
#include <string>
#include <vector>

#include "analysis/machine_model/machine.h"
#include "analysis/machine_model/machine_runs.h"

namespace metastable::analysis {

/// A column whose values are this many times what the map makes of them is in another unit; the factor is met within a
/// share.
struct UnitFactor {
  double factor;
  bool of_angles;
  const char* words;       ///< of what is compared with the machine
  const char* words_here;  ///< of trials that are compared with the others
};
inline constexpr UnitFactor unit_factors[]{
    {180 / std::numbers::pi, true, "degrees where the machine has radians", "degrees where the others are in radians"},
    {std::numbers::pi / 180, true, "radians where the machine has degrees", "radians where the others are in degrees"},
    {1000, false, "thousandths of the machine's unit", "thousandths of the others' unit"},
    {0.001, false, "thousands of the machine's unit", "thousands of the others' unit"}};

/// The findings about a map that a user is told, sentence by sentence.
struct MapAsked {
  std::vector<std::string> idle_noise;   ///< numbers of the noise that change nothing
  std::vector<std::string> other_units;  ///< columns that may be in another unit than the machine's
};

/// @throws std::invalid_argument where an answer hangs on more than the arguments of its row
MapAsked ask_map(const Machine& machine, const MachineRuns& runs);

}  // namespace metastable::analysis
