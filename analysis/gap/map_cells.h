#pragma once
// Makes the cells of a gap map before anything is measured in them: it says which events each holds.

#include <cstddef>
#include <string>
#include <vector>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Counts the transitions that a cell of the map holds at least.
inline constexpr int least_cell_events = 20;

/// Says which events one cell holds. With weights it is a contrast of means: a trend, a swing.
struct MapCell {
  std::string facet = {}, at = {};       ///< as GapCell's
  std::vector<std::size_t> events = {};  ///< indices
  bool stance = false;                   ///< of stance events, where they are separate
  std::vector<double> weights = {};      ///< by event; empty: 1
  bool swing = false;                    ///< cosine or sine of the time since the previous collision
};

/// Events that are looked at together: collisions with what came of them, or stances, of one observed column.
struct EventPhase {
  bool stance = false;
  std::size_t column = 0;
  std::vector<std::size_t> members = {};  ///< events
  std::string where = {};                 ///< ", stance", where it has to be said; else empty
};
std::vector<EventPhase> event_phases(const TransitionModel& model);

/// Cuts the model's events by speed, leg, position, collision, trial, time and condition, each phase by itself; trends
/// over the trials; and swings where time_tells(). Phases, and cells of a facet, with too few events have none.
std::vector<MapCell> map_cells(const TransitionModel& model);

}  // namespace metastable::analysis
