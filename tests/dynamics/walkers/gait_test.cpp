#include "dynamics/walkers/gait.h"

#include <gtest/gtest.h>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

// The reference values are an independent integration by Runge-Kutta-Fehlberg 7(8) with events.
TEST(Gait, OfTheSimplestWalker) {
  const Gait gait = find_gait(TwoLinkWalker::simplest(), 0.009);
  EXPECT_NEAR(gait.state[0], 0.200310900544, 1e-11);
  EXPECT_NEAR(gait.state[1], -0.199832473005, 1e-11);
  EXPECT_NEAR(gait.eigenvalues[0].real(), -0.19010, 1e-5);
  EXPECT_NEAR(gait.eigenvalues[0].imag(), 0.55760, 1e-5);
}

TEST(Gait, OfTheCompass) {
  const Gait gait = find_gait(TwoLinkWalker::compass(), 3 * degree);
  EXPECT_NEAR(gait.state[0], 0.271028680, 2e-9);
  EXPECT_NEAR(gait.state[1], -1.09238359, 1e-8);
  EXPECT_NEAR(gait.state[2], -0.37737395, 2e-8);
  EXPECT_NEAR(gait.eigenvalues[0].real(), -0.19973, 1e-5);
  EXPECT_NEAR(gait.eigenvalues[0].imag(), 0.54448, 1e-5);
  EXPECT_NEAR(gait.eigenvalues[2].real(), 0.1316, 1e-4);
  EXPECT_TRUE(gait.stable());
}

// By Garcia et al. (1998) the long-period gait is stable up to 0.0151 rad, where it doubles its period.
TEST(Gait, OfTheSimplestWalkerLosesStabilityWherePublished) {
  EXPECT_TRUE(find_gait(TwoLinkWalker::simplest(), 0.0150).stable());
  const Gait steep = find_gait(TwoLinkWalker::simplest(), 0.0153);
  EXPECT_FALSE(steep.stable());
  EXPECT_LT(steep.eigenvalues[0].real(), -1);
}

TEST(Gait, SaysWhereThereIsNone) {
  EXPECT_THROW(find_gait(TwoLinkWalker::compass(), -3 * degree), std::domain_error);
  EXPECT_THROW(find_gait(TwoLinkWalker::compass(), 3 * degree, {0.27, -0.1, 0}), std::domain_error);
}

}  // namespace
}  // namespace metastable::dynamics::test
