#pragma once
// Averages several sampled chains.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "markov/transition_rows/discretization.h"

namespace metastable::markov {

/// Averages chains over the same states, given one by one, row by row: the result is the chain of all their draws.
class ChainPool {
 public:
  /// @throws std::invalid_argument if the number of states differs from that of earlier chains
  void add(const SampledChain& sampled);
  /// @throws std::logic_error if nothing was added
  SampledChain mean() const;

 private:
  std::size_t count_ = 0;
  SampledChain first_;
  std::vector<std::vector<double>> rows_;  // dense over [first column, last column] of each row
  std::vector<std::uint32_t> first_column_;
  std::vector<double> kill_;
};

}  // namespace metastable::markov
