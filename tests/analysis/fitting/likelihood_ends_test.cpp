#include "analysis/fitting/likelihood_ends.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "markov/dense_matrix.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

Eigen::MatrixXd covariance_of(const Fit& fit) { return markov::floored_inverse(fit.information, resolved_share); }

// The likelihood of the logarithm l of a normal sd falls by n (d + (exp(-2 d) - 1) / 2) at l + d, so that its end above
// is farther from l than the one below.
TEST(LikelihoodEnds, OfTheNoiseOfFewRowsAreThoseOfItsLikelihood) {
  const double rows = 12;
  const test::Line model = test::line(0, 5, static_cast<std::size_t>(rows));
  const Fit found = fit(model, {3, -0.7}, {});
  const auto [low, high] = likelihood_ends(model, found, covariance_of(found), 1);
  const double top = found.nuisance[1];
  for (const double end : {low, high}) {
    const double d = end - top;
    EXPECT_NEAR(std::sqrt(2 * rows * (d + (std::exp(-2 * d) - 1) / 2)), 1.645, 0.05);
  }
  EXPECT_GT(high - top, 1.1 * (top - low));
}

TEST(LikelihoodEnds, OfANormalLikelihoodAreAsFarAsItsCurvatureSays) {
  const test::Line model = test::line(0.3, 6);
  const Fit found = fit(model, {3, -0.7}, {test::term(model, "slope", {}, {0.3})});
  const Eigen::MatrixXd covariance = covariance_of(found);
  const auto [low, high] = likelihood_ends(model, found, covariance, 2);
  const double half = 1.645 * std::sqrt(covariance(2, 2));
  EXPECT_NEAR((found.terms[0].values[0] - low) / half, 1, 0.03);
  EXPECT_NEAR((high - found.terms[0].values[0]) / half, 1, 0.03);
}

// The effect can only be positive, and lies within its error of nothing.
TEST(LikelihoodEnds, StopAtABoundThatTheLikelihoodHardlyKnows) {
  const test::Line with_slope = test::line(0.3, 7, 100);
  const double shift = fit(with_slope, {3, -0.7}, {test::term(with_slope, "slope", {}, {0.3})}).terms[0].values[0];
  const test::Line model = test::line(0.3 - shift + 0.04, 7, 100);
  const Fit found = fit(model, {3, -0.7}, {test::term(model, "upward", {}, {0.05})});
  ASSERT_NEAR(found.terms[0].values[0], 0.04, 0.005);  // its standard error is 0.05
  const auto [low, high] = likelihood_ends(model, found, covariance_of(found), 2);
  EXPECT_EQ(low, 0);
  EXPECT_NEAR(high, 0.04 + 1.645 * 0.05, 0.02);
}

}  // namespace
}  // namespace metastable::analysis
