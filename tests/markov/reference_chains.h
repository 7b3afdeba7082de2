#pragma once
// Makes chains to test with; exact answers for them are in exact_answers.h.

#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov::reference {

/// Makes birth and death on 0 .. n-1: `up` and `down` with probability of staying left over; down from 0 is rest, and
/// up from n-1 is rest too when `both_ends`, otherwise not taken.
inline Chain birth_death(std::size_t n, double up, double down, bool both_ends) {
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(n, 0.0);
  kill[0] += down;
  if (both_ends) kill[n - 1] += up;
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0) {
      column.push_back(static_cast<std::uint32_t>(i - 1));
      value.push_back(down);
    }
    if (i + 1 < n) {
      column.push_back(static_cast<std::uint32_t>(i + 1));
      value.push_back(up);
    }
    start.push_back(column.size());
  }
  return Chain(std::move(start), std::move(column), std::move(value), std::move(kill));
}

/// Makes a full chain with random entries, staying included, whose kill rates are of the order of `kill_scale`.
inline Chain random_chain(std::size_t n, unsigned seed, double kill_scale) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(0.01, 1);
  std::vector<double> matrix(n * n), kill(n);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = 0;
    for (std::size_t j = 0; j < n; ++j) sum += matrix[i * n + j] = uniform(engine);
    kill[i] = kill_scale * uniform(engine);
    for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] *= (1 - kill[i]) / sum;
  }
  return Chain::from_dense(n, matrix, kill);
}

/// Makes a chain of `period` classes of `states` each, full from class to class; state s of class c has the number
/// s * period + c, so that classes are not contiguous.
inline Chain cyclic_chain(std::size_t period, std::size_t states, unsigned seed, double kill_scale) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(0.01, 1);
  const std::size_t n = period * states;
  std::vector<double> matrix(n * n, 0.0), kill(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t next = (i % period + 1) % period;
    double sum = 0;
    for (std::size_t s = 0; s < states; ++s) sum += matrix[i * n + s * period + next] = uniform(engine);
    kill[i] = kill_scale * uniform(engine);
    for (std::size_t s = 0; s < states; ++s) matrix[i * n + s * period + next] *= (1 - kill[i]) / sum;
  }
  return Chain::from_dense(n, matrix, kill);
}

}  // namespace metastable::markov::reference
