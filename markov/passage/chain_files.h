#pragma once
// Writes a chain as text that other programs read.

#include <string>

#include "markov/chain/chain.h"
#include "markov/passage/first_passage.h"

namespace metastable::markov {

/// Holds the whole chain as one stochastic matrix of size() + 2 states: 0 is the launch, 1 .. size() are the chain's
/// states, size() + 1 is rest (absorbing). Probabilities have 17 digits. The diagonal is 1 minus the rest of its row,
/// so a reader who wants rare failures right computes it anew from the off-diagonal entries.
struct ChainFiles {
  std::string transitions;    ///< PRISM explicit .tra: "states transitions", then "from to probability"
  std::string labels;         ///< PRISM .lab: "init" (the launch) and "rest"
  std::string rewards;        ///< PRISM .srew: 1 in every state but rest: R=? [ F "rest" ] is the expected steps
  std::string matrix_market;  ///< the matrix in coordinate form, counted from 1
};

/// Takes O(entries). @throws std::invalid_argument when the launch does not have one entry per state
ChainFiles chain_files(const Chain& chain, const Launch& launch);

}  // namespace metastable::markov
