#pragma once
// Chains with exact answers, and exact answers for small chains: rational and 100-digit arithmetic.

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/cpp_int.hpp>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov::reference {

using Rational = boost::multiprecision::cpp_rational;
using Long = boost::multiprecision::cpp_bin_float_100;

/// I - Q in the given arithmetic, the probability of staying taken exactly as implied by the stored numbers.
template <typename Number>
std::vector<std::vector<Number>> generator(const Chain& chain) {
  const std::size_t n = chain.size();
  std::vector<std::vector<Number>> matrix(n, std::vector<Number>(n, Number(0)));
  for (std::size_t i = 0; i < n; ++i) {
    matrix[i][i] = Number(chain.kill(i));
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e) {
      matrix[i][i] += Number(chain.values(i)[e]);
      matrix[i][chain.columns(i)[e]] = -Number(chain.values(i)[e]);
    }
  }
  return matrix;
}

/// Solves matrix x = rhs by Gaussian elimination without pivoting (the matrices here are M-matrices).
template <typename Number>
std::vector<Number> gauss(std::vector<std::vector<Number>> matrix, std::vector<Number> rhs) {
  const std::size_t n = rhs.size();
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = k + 1; i < n; ++i) {
      if (matrix[i][k] == 0) continue;
      const Number factor = matrix[i][k] / matrix[k][k];
      for (std::size_t j = k; j < n; ++j) matrix[i][j] -= factor * matrix[k][j];
      rhs[i] -= factor * rhs[k];
    }
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t j = i + 1; j < n; ++j) rhs[i] -= matrix[i][j] * rhs[j];
    rhs[i] /= matrix[i][i];
  }
  return rhs;
}

/// Mean first-passage times, rounded to double once, from the arithmetic Number.
template <typename Number>
std::vector<double> exact_means(const Chain& chain) {
  std::vector<double> means;
  for (const Number& mean : gauss(generator<Number>(chain), std::vector<Number>(chain.size(), Number(1)))) {
    means.push_back(mean.template convert_to<double>());
  }
  return means;
}

/// 1 - lambda_1 by inverse iteration in 100 digits, stopped when 30 of them stand.
inline double exact_failure_rate(const Chain& chain) {
  const auto matrix = generator<Long>(chain);
  std::vector<Long> x(chain.size(), Long(1));
  Long rate = 0;
  for (int iteration = 0; iteration < 20000; ++iteration) {
    x = gauss(matrix, x);
    Long largest = 0;
    for (const Long& entry : x) largest = entry > largest ? entry : largest;
    for (Long& entry : x) entry /= largest;
    const Long next = 1 / largest;
    const Long change = abs(next - rate);
    rate = next;
    if (change < Long(1e-30) * rate) break;
  }
  return rate.convert_to<double>();
}

/// Birth and death on 0 .. n-1: `up` and `down` with probability of staying left over; down from 0 is rest, and
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

/// A full chain with random entries, staying included, whose kill rates are of the order of `kill_scale`.
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

/// A chain of `period` classes of `states` each, full from class to class; state s of class c has the number
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
