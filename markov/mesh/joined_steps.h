#pragma once
// Brings together the steps that several pieces of work ask of one map, where a call costs more than its rows.

#include <cstddef>
#include <functional>

#include "markov/mesh/batch_map.h"

namespace metastable::markov {

/// Calls work(i, joined) once for every i in [0, count), `together` of them side by side. Each steps the map through
/// `joined`, which waits until all others of the side by side wait as well; what they ask for is then stepped at once,
/// phase by phase and in the order of i, in calls of rows_of_a_dear_call rows at most. So which rows share a call does
/// not depend on `threads`, the number that computes at the same time (0: all cores); each is a Fiber.
/// @throws what the work of the least i threw, once all of it has ended
void joined_for(const BatchMap& map, std::size_t count, std::size_t together, int threads,
                const std::function<void(std::size_t i, const BatchMap& joined)>& work);

/// Returns the map that was handed to the work of joined_for() that runs here; nullptr outside of such work.
const BatchMap* joined_map();

}  // namespace metastable::markov
