#pragma once
// Gives exact answers for small chains: rational and 100-digit arithmetic.

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/cpp_int.hpp>
#include <cstddef>
#include <vector>

#include "markov/chain/chain.h"

namespace metastable::markov::reference {

using Rational = boost::multiprecision::cpp_rational;
using Long = boost::multiprecision::cpp_bin_float_100;

/// Returns I - Q in the given arithmetic, the probability of staying taken exactly as implied by the stored numbers.
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

/// Returns mean first-passage times, rounded to double once, from the arithmetic Number.
template <typename Number>
std::vector<double> exact_means(const Chain& chain) {
  std::vector<double> means;
  for (const Number& mean : gauss(generator<Number>(chain), std::vector<Number>(chain.size(), Number(1)))) {
    means.push_back(mean.template convert_to<double>());
  }
  return means;
}

/// Returns 1 - lambda_1 by inverse iteration in 100 digits, stopped when 30 of them stand.
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

}  // namespace metastable::markov::reference
