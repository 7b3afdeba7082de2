#pragma once
// Gives the normal distribution to many digits. (Boost's erfc would do so, too, but for a type of many digits it fills
// tables of zeta whenever a program begins: an eighth of a second for each test.)

#include <boost/math/constants/constants.hpp>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <limits>

namespace metastable::dynamics::test {

/// Returns the density of a standard normal variable.
/// @tparam Real  a type of boost::multiprecision
template <class Real>
Real normal_density_digits(const Real& z) {
  return Real(exp(-z * z / 2) / sqrt(2 * boost::math::constants::pi<Real>()));
}

/// Returns P(Z > z) of a standard normal variable to the relative digits of `Real` but for ten: by the series in
/// z^(2k+1) / (2k+1)!!, beyond 6 by the continued fraction z + 1/(z + 2/(z + 3/...)) (Abramowitz and Stegun 26.2.11
/// and 26.2.14).
template <class Real>
Real normal_tail_digits(const Real& z) {
  if (z < 0) return 1 - normal_tail_digits(Real(-z));
  if (z > 6) {
    constexpr int digits = std::numeric_limits<Real>::digits10;
    Real fraction = z;
    for (int k = 12 + digits * digits / 20; k > 0; --k) fraction = z + k / fraction;
    return normal_density_digits(z) / fraction;
  }
  Real sum = z, power = z;
  for (int k = 3; power > sum * std::numeric_limits<Real>::epsilon(); k += 2) {
    power *= z * z / k;
    sum += power;
  }
  return Real(0.5) - normal_density_digits(z) * sum;
}

}  // namespace metastable::dynamics::test
