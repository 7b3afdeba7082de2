#pragma once
// Makes large sparse chains whose elimination fills in.

#include <algorithm>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov::reference {

struct SparseChain {
  std::size_t states = 0;
  std::size_t blocks = 1;  ///< of states, state i in block i % blocks
  double coupling = 0;     ///< probability of leaving the block
  std::size_t period = 1;  ///< class of state i: i % period (blocks or period, not both)
  double kill = 0;         ///< scale of the kill rates
  int only_one = 0;        ///< 1: state 5 alone fails
};

/// Makes a chain with ten entries a row and an eleventh that leaves the block.
inline Chain sparse_chain(const SparseChain& kind) {
  std::mt19937_64 engine(7);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  for (std::size_t i = 0; i < kind.states; ++i) {
    kill.push_back(kind.only_one && i != 5 ? 0 : kind.kill * (0.1 + uniform()));
    const std::size_t step = std::max(kind.blocks, kind.period), rest = (i + (kind.period > 1 ? 1 : 0)) % step;
    const std::size_t places = (kind.states - rest + step - 1) / step;
    std::map<std::uint32_t, double> row;
    double sum = 0;
    for (int k = 0; k < 10; ++k) {
      const double weight = 0.05 + uniform();
      row[static_cast<std::uint32_t>(rest + step * (engine() % places))] += weight;
      sum += weight;
    }
    for (auto& [to, weight] : row) weight *= (1 - kill[i] - kind.coupling) / sum;
    if (kind.coupling > 0) row[static_cast<std::uint32_t>(engine() % kind.states)] += kind.coupling;
    for (const auto& [to, weight] : row) {
      if (to == i) continue;
      column.push_back(to);
      value.push_back(weight);
    }
    start.push_back(column.size());
  }
  return Chain(std::move(start), std::move(column), std::move(value), std::move(kill));
}

}  // namespace metastable::markov::reference
