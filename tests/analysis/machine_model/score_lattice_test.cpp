#include "analysis/machine_model/score_lattice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace metastable::analysis {
namespace {

Eigen::MatrixXd at_asked(const LatticeAxis& axis, const AxisPolynomial& polynomial,
                         const std::function<double(double)>& of) {
  Eigen::MatrixXd values(static_cast<Eigen::Index>(polynomial.asked().size()), 1);
  for (std::size_t k = 0; k < polynomial.asked().size(); ++k)
    values(static_cast<Eigen::Index>(k), 0) = of(axis.points[polynomial.asked()[k]]);
  return values;
}

double largest_error(const LatticeAxis& axis, const Eigen::MatrixXd& told, const std::function<double(double)>& of) {
  double most = 0;
  for (std::size_t p = 0; p < axis.points.size(); ++p)
    most = std::max(most, std::abs(told(static_cast<Eigen::Index>(p), 0) - of(axis.points[p])));
  return most;
}

TEST(AxisPolynomial, TellsAPolynomialOfLowDegreeExactly) {
  const LatticeAxis axis = lattice_axis(1, true);
  const AxisPolynomial polynomial(axis);
  EXPECT_LT(polynomial.asked().size(), 0.6 * static_cast<double>(axis.points.size()));
  EXPECT_EQ(polynomial.asked()[polynomial.asked().size() / 2], axis.points.size() / 2);  // the score of zero
  const auto cubic = [](double z) { return 2 + z + 0.1 * z * z - 0.02 * z * z * z; };
  const Eigen::MatrixXd values = at_asked(axis, polynomial, cubic);
  EXPECT_TRUE(polynomial.holds(values));
  EXPECT_LT(largest_error(axis, polynomial.told(values), cubic), 1e-11);
}

TEST(AxisPolynomial, TellsABentMapWithinAThousandthOfAnSd) {
  const LatticeAxis axis = lattice_axis(1, true);
  const AxisPolynomial polynomial(axis);
  const auto bent = [](double z) { return std::sqrt(1 + 0.08 * z); };
  const Eigen::MatrixXd values = at_asked(axis, polynomial, bent);
  EXPECT_TRUE(polynomial.holds(values));
  EXPECT_LT(largest_error(axis, polynomial.told(values), bent), 1e-3 * 0.04);
}

TEST(AxisPolynomial, HoldsAtNoKinkWhereverItIs) {
  const LatticeAxis axis = lattice_axis(1, true);
  const AxisPolynomial polynomial(axis);
  for (double kink = -2.5; kink <= 2.5; kink += 0.1) {
    const auto broken = [kink](double z) { return z + 0.3 * std::max(0.0, z - kink); };
    EXPECT_FALSE(polynomial.holds(at_asked(axis, polynomial, broken))) << kink;
  }
}

TEST(AxisPolynomial, HoldsAtNoBumpInTheMiddle) {
  const LatticeAxis axis = lattice_axis(1, true);
  const AxisPolynomial polynomial(axis);
  for (double from = -2; from <= 1; from += 0.1) {
    const auto bump = [from](double z) { return z + (z > from && z < from + 1 ? 0.3 : 0.0); };
    EXPECT_FALSE(polynomial.holds(at_asked(axis, polynomial, bump))) << from;
  }
}

TEST(AxisPolynomial, HoldsWhereTheScoreMovesNothing) {
  const LatticeAxis axis = lattice_axis(1, true);
  const AxisPolynomial polynomial(axis);
  EXPECT_TRUE(polynomial.holds(at_asked(axis, polynomial, [](double) { return 0.27; })));
}

}  // namespace
}  // namespace metastable::analysis
