// Checks guaranteed bounds around expected steps that other methods give.

#include "analysis/study/certify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

Setting with_friction(double slope_deg, bool equal, Spread friction) {
  Setting setting = paper_setting(slope_deg, equal);
  setting.friction = friction;
  return setting;
}

TEST(Certify, HoldsTheKnownAnswers) {
  // Comes from the integrated method, stable to the digits given.
  struct Known {
    double slope_deg;
    Spread friction;
    double steps;
  };
  for (const Known& known : {Known{7.02, {0.4, 0.1}, 4.2585}, Known{9.59, {0.4, 0.1}, 6.1746},
                             Known{7.02, {0.3, 0.05}, 1297.95}, Known{9.59, {0.3, 0.05}, 46577.7}}) {
    const CertifiedSteps c = certify(with_friction(known.slope_deg, true, known.friction));
    ASSERT_TRUE(c.exists) << c.reason;
    EXPECT_LT(c.lower, known.steps) << certificate_text(c);
    EXPECT_GT(c.upper, known.steps) << certificate_text(c);
    EXPECT_LT(c.width(), 0.004) << known.slope_deg;
    EXPECT_TRUE(c.reason.empty());
  }
}

TEST(Certify, HoldsThePapersLegs) {
  const CertifiedSteps c = certify(with_friction(9.59, false, {0.4, 0.1}), {.largest_cells = 80});
  ASSERT_TRUE(c.exists) << c.reason;
  EXPECT_EQ(c.from_state.nodes.size(), 8U);
  // 400 cells give 6.129061 to 6.139277.
  EXPECT_LT(c.lower, 6.1391);
  EXPECT_GT(c.upper, 6.1292);
  EXPECT_LT(c.width(), 0.05);
}

TEST(Certify, EveryStateHasItsBounds) {
  const CertifiedSteps c = certify(with_friction(9.59, true, {0.4, 0.1}), {.largest_cells = 100});
  ASSERT_TRUE(c.exists);
  const auto& lower = c.from_state.lower.front();
  const auto& upper = c.from_state.upper.front();
  ASSERT_EQ(lower.size(), upper.size());
  for (std::size_t i = 0; i < lower.size(); ++i) {
    EXPECT_GE(lower[i], 1 - 1e-9);
    EXPECT_LE(lower[i], upper[i]);
    if (i > 0) {
      EXPECT_GE(lower[i], lower[i - 1]);
    }
  }
}

TEST(Certify, AConstantLaunchIsThatState) {
  Setting setting = with_friction(9.59, true, {0.4, 0.1});
  setting.initial_speed = {5.83, 0};
  const CertifiedSteps c = certify(setting, {.largest_cells = 100});
  ASSERT_TRUE(c.exists);
  EXPECT_GT(c.lower, 5.9);
  EXPECT_LT(c.upper, 6.4);
}

// Nodes once had to begin above where they ended; where failures are rare, what a slow wheel may do is bounded loosely.
TEST(Certify, LaunchesTooSlowToVaultTakeOneStep) {
  for (const Spread friction : {Spread{0.4, 0.1}, Spread{0.3, 0.05}}) {
    Setting setting = with_friction(9.59, true, friction);
    setting.initial_speed = {1, 0.1};
    const CertifiedSteps c = certify(setting, {.largest_cells = 100});
    ASSERT_TRUE(c.exists) << c.reason;
    EXPECT_LE(c.lower, 1);
    EXPECT_GE(c.upper, 1);
    EXPECT_LT(c.width(), 0.01);
  }
}

TEST(Certify, ThreadsDoNotMatter) {
  const Setting setting = with_friction(9.59, true, {0.4, 0.1});
  const CertifiedSteps one = certify(setting, {.largest_cells = 60, .threads = 1});
  const CertifiedSteps two = certify(setting, {.largest_cells = 60, .threads = 2});
  EXPECT_EQ(one.lower, two.lower);
  EXPECT_EQ(one.upper, two.upper);
}

TEST(Certify, SaysWhyThereIsNoCertificate) {
  const CertifiedSteps coulomb = certify(gentle_coulomb());
  EXPECT_FALSE(coulomb.exists);
  EXPECT_NE(certificate_text(coulomb).find("no certificate: bounds exist for the law published only"),
            std::string::npos);

  Setting constant = with_friction(7.02, true, {0.4, 0});
  EXPECT_FALSE(certify(constant).exists);
}

TEST(Certify, EndlessWalksHaveNoFiniteBounds) {
  Setting endless = with_friction(9.59, true, {0.1, 0.001});
  endless.restitution = {0.8, 0.001};
  const CertifiedSteps c = certify(endless);
  EXPECT_TRUE(!c.exists || std::isinf(c.upper)) << certificate_text(c);
}

TEST(Certify, ToleranceIsChecked) {
  EXPECT_THROW(certify(paper_setting(9.59, true), {.tolerance = 0}), std::invalid_argument);
}

// The text must enclose what is enclosed: nearest digits would cut it.
TEST(Certify, TextRoundsOutward) {
  CertifiedSteps c;
  c.exists = true;
  c.lower = 4.25123456;
  c.upper = 4.26543212;
  EXPECT_NE(certificate_text(c).find("between 4.251234 and 4.265433 (width"), std::string::npos) << certificate_text(c);
  c.lower = 99999.999;
  c.upper = 99999.9999;
  EXPECT_NE(certificate_text(c).find("between 99999.9 and 100000 (width"), std::string::npos) << certificate_text(c);
  c.lower = 1.0;
  c.upper = 2.5e20;
  EXPECT_NE(certificate_text(c).find("between 1 and 2.5e+20 (width"), std::string::npos) << certificate_text(c);
}

}  // namespace
}  // namespace metastable::analysis
