#pragma once
// Finds the period of a chain and its cyclic classes.

#include <cstdint>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov {

/// Holds the cyclic structure: every transition leads from class c to class (c + 1) % period.
struct Period {
  int period = 1;
  std::vector<int> state_class;                     ///< class of each state, 0 .. period-1; state 0 is in class 0
  std::vector<std::vector<std::uint32_t>> classes;  ///< the states of each class, ascending
};

/// Finds the largest d for which states can be labelled so that every transition leads to the next class: the greatest
/// common divisor of all closed walks, backward steps counting -1, found from breadth-first levels over every
/// weakly connected part. For an irreducible chain that is the usual period; a part without any closed walk does not
/// lower it, and without any at all it is 1. A state that may stay where it is (stay(i) > 1e-12) makes the period 1.
/// O(entries).
Period find_period(const Chain& chain);

}  // namespace metastable::markov
