#pragma once
// Foretells what eliminating a chain takes, in the order in which its states are numbered.

#include <cstddef>
#include <cstdint>
#include <span>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// The cost of an elimination from the last state to the first.
struct Envelope {
  double entries = 0;        ///< of the rows, what fills in included
  double multiply_adds = 0;  ///< of the elimination
};

/// Finds it for a pattern of compressed rows, columns ascending. O(entries + n log n).
Envelope envelope_of(std::span<const std::size_t> row_start, std::span<const std::uint32_t> column);
Envelope envelope_of(const Chain& chain);

/// Returns what iteration holds at its peak [byte].
double iterated_memory(std::size_t states, std::size_t entries);

/// How a chain is solved: ChainSolver eliminates it, GeneratorSolver iterates.
enum class Way { eliminated, iterated };

/// Chooses elimination where it takes no more than 1e10 multiply-adds (a second or two) and the memory, otherwise
/// iteration, where it takes less work than that and the memory, otherwise elimination.
/// @param memory  [byte]
/// @throws MemoryExceeded saying how much would do
Way way_of(const Chain& chain, double memory);

/// Says that a chain takes more memory than it is given.
class MemoryExceeded : public ConvergenceError {
 public:
  MemoryExceeded(const Chain& chain, double memory, double iterated, double eliminated);
};

}  // namespace metastable::markov
