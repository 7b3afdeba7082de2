#include "dynamics/wheel/contact_noise.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

TEST(ContactNoise, ScoresOfAnIndependentPairAreThoseOfTheMarginals) {
  const ContactNoise noise = ContactNoise::normal(0.4, 0.1, 0.3, 0.05);
  EXPECT_EQ(noise.dimension(), 2);
  const Contact c = noise.draw(std::array{-20.0, 1.5});
  EXPECT_EQ(c.restitution, noise.restitution().at_score(-20));
  EXPECT_EQ(c.friction, noise.friction().at_score(1.5));
  EXPECT_EQ(noise.support().restitution_upper, 1);
  EXPECT_EQ(noise.support().friction_upper, std::numeric_limits<double>::infinity());
}

TEST(ContactNoise, CopulaKeepsTheMarginalAndTheCorrelation) {
  const double rho = -0.6;
  const ContactNoise noise = ContactNoise::normal(0.4, 0.01, 0.3, 0.01, rho);
  // Far from the bounds scores are standardised values; a grid of scores gives the moments.
  double cross = 0, square = 0, weight = 0;
  for (double a = -6; a <= 6; a += 0.25)
    for (double b = -6; b <= 6; b += 0.25) {
      const Contact c = noise.draw(std::array{a, b});
      const double w = normal_density(a) * normal_density(b), mu = (c.friction - 0.3) / 0.01;
      cross += w * mu * (c.restitution - 0.4) / 0.01;
      square += w * mu * mu;
      weight += w;
    }
  EXPECT_NEAR(cross / weight, rho, 1e-6);
  EXPECT_NEAR(square / weight, 1, 1e-6);
}

TEST(ContactNoise, ListIsDrawnEvenlyAndBothTailsStayInside) {
  const ContactNoise noise = ContactNoise::empirical({{0.1, 0.1}, {0.2, 0.2}, {0.3, 0.3}, {0.4, 0.4}});
  EXPECT_EQ(noise.dimension(), 1);
  const auto drawn = [&](double score) { return noise.draw(std::array{score}).friction; };
  EXPECT_EQ(drawn(-37), 0.1);
  EXPECT_EQ(drawn(normal_quantile(0.26)), 0.2);
  EXPECT_EQ(drawn(normal_quantile(0.49)), 0.2);

  EXPECT_EQ(drawn(normal_quantile(0.74)), 0.3);
  EXPECT_EQ(drawn(37), 0.4);
  EXPECT_EQ(noise.support().restitution_lower, 0.1);
  EXPECT_EQ(noise.support().friction_upper, 0.4);
}

TEST(ContactNoise, IllegalInputIsNamed) {
  EXPECT_EQ(message_of([] { ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 1); }), "correlation: 1 is outside (-1, 1)");
  EXPECT_EQ(message_of([] { ContactNoise::normal(0.4, -0.1, 0.4, 0.1); }), "restitution: sd: -0.1 is outside [0, inf)");
  EXPECT_EQ(message_of([] { ContactNoise::normal(0.4, 0.1, -0.2, 0); }),
            "friction: mean: the constant -0.2 is outside [0, inf]");
  EXPECT_EQ(message_of([] { ContactNoise::empirical({}); }), "pairs: the list of contacts is empty");
  EXPECT_EQ(message_of([] {
              ContactNoise::empirical({{0.4, 0.4}, {1.2, 0.4}});
            }),
            "pairs[1]: restitution 1.2 is outside [0, 1]");
  EXPECT_EQ(message_of([] { ContactNoise::empirical({{0.4, -0.4}}); }), "pairs[0]: friction -0.4 is outside [0, inf)");
}

}  // namespace
}  // namespace metastable::dynamics::test
