#include "analysis/gap/facet_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/model_fit.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t events = 1200;

// Returns what a fitted line leaves of data with noise of 0.5 and another mean in every other trial.
std::vector<LeftInFacet> left_of_line(unsigned seed, double shift) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < events; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + 0.5 * normal(generator) + (i / 4 % 2 == 0 ? shift : -shift));
  }
  const test::Line model(y, w);
  return left_by_facet(model, fit(model, {3, -0.7}, {}), {}, Rules{});
}

// The quadratic form is noncentral chi-squared of one degree: n (shift / sd)^2 + 1 on average.
TEST(LeftOver, FindsTheFacetThatIsShifted) {
  const std::vector<LeftInFacet> left = left_of_line(31, 0.1);
  const LeftInFacet& most = *std::max_element(
      left.begin(), left.end(), [](const LeftInFacet& a, const LeftInFacet& b) { return a.evidence < b.evidence; });
  EXPECT_EQ(most.facet, "every other trial");
  EXPECT_EQ(most.degrees, 1);
  const double noncentral = events * 0.04;
  EXPECT_NEAR(most.quadratic, noncentral + 1, 3 * std::sqrt(2 + 4 * noncentral));
  EXPECT_LT(most.p_value, 1e-6);
  EXPECT_GT(evidence_of_more(left), 8);
}

// Without a gap p-values are uniform; and Bayes factors have mean one, so that one in twenty at most is above twenty.
TEST(LeftOver, LevelsAreHonest) {
  constexpr int sets = 100;
  int believed = 0;
  double below = 0, facets = 0;
  for (unsigned seed = 300; seed < 300 + sets; ++seed) {
    const std::vector<LeftInFacet> left = left_of_line(seed, 0);
    believed += evidence_of_more(left) > std::log(20);
    for (const LeftInFacet& facet : left) below += facet.p_value < 0.05;
    facets += static_cast<double>(left.size());
  }
  EXPECT_LE(believed, sets / 20);
  EXPECT_NEAR(below / facets, 0.05, 0.02);  // facets share events: some four standard deviations
}

// Where scores happen to lie closer together than the model says, their squares do so, too. By the model's scatter the
// statistic is n (1 - 0.75^2)^2 / 2 of 300 events, of which the fitted sd takes a part; by the events' own it is twice
// that.
TEST(LeftOver, EventsThatScatterLittleAreNoSurer) {
  std::mt19937_64 generator(77);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < events; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + (i % 4 == 1 ? 0.375 : 0.5) * normal(generator));
  }
  const test::Line model(y, w);
  const std::vector<LeftInFacet> left = left_by_facet(model, fit(model, {3, -0.7}, {}), {}, Rules{});
  const auto by_number =
      std::ranges::find_if(left, [](const LeftInFacet& one) { return one.facet == "step" && one.aspect == "spread"; });
  ASSERT_NE(by_number, left.end());
  EXPECT_GT(by_number->quadratic, 15);
  EXPECT_LT(by_number->quadratic, 32);
}

// A hypothesis that leaves nothing in a facet explains all of it, whatever the scores had promised.
TEST(LeftOver, AFacetExplainsNoMoreThanWhatRemovesIt) {
  const LeftInFacet leg{.facet = "leg", .aspect = "mean", .quadratic = 40, .degrees = 2, .evidence = 15};
  LeftInFacet stance = leg;
  stance.stance = true;
  LeftInFacet left = leg;
  left.quadratic = 3;
  std::vector<LeftInFacet> alone{leg, stance};
  bound_evidence(alone, 20, {left}, Rules{});
  EXPECT_EQ(alone[0].evidence, evidence_of_gain(20 + 3, 2, Rules{}));
  EXPECT_EQ(alone[1].evidence, 15);  // nobody judged it
  bound_evidence(alone, 1000, {left}, Rules{});
  EXPECT_EQ(alone[0].evidence, evidence_of_gain(20 + 3, 2, Rules{}));
}

// How many collisions are far ones is how their distribution is shaped; the spread of all of them is judged.
TEST(LeftOver, TheFormOfTheContactIsNoFacet) {
  int spreads = 0;
  for (const LeftInFacet& facet : left_of_line(31, 0))
    if (facet.facet == facet_of_all) {
      EXPECT_NE(facet.aspect, "tail");
      spreads += facet.aspect == "spread";
    }
  EXPECT_EQ(spreads, 1);
}

TEST(LeftOver, IsNotJudgedWhereTheFitDidNotSettle) {
  const test::Line model = test::line(0, 7);
  Fit plain = fit(model, {3, -0.7}, {});
  EXPECT_FALSE(left_by_facet(model, plain, {}, Rules{}).empty());
  plain.converged = false;
  plain.promised = 100;
  EXPECT_TRUE(left_by_facet(model, plain, {}, Rules{}).empty());
  EXPECT_EQ(evidence_of_more({}), -INFINITY);
}

}  // namespace
}  // namespace metastable::analysis
