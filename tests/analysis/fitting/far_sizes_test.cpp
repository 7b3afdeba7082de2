#include "analysis/fitting/far_sizes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

constexpr double tread = 0.4;

// Its slope goes up in treads, so that the likelihood has no slope at none.
class Stairs : public test::Line {
 public:
  explicit Stairs(const test::Line& from) : Line(from) {
    candidates_.resize(1);
    candidates_[0].parameters[0] = {.neutral = 0, .lower = -8, .upper = 8, .step = 1e-4};
    candidates_[0].seek_far = true;
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    std::vector<EffectTerm> on_treads(terms.begin(), terms.end());
    for (EffectTerm& term : on_treads) term.values[0] = tread * std::round(term.values[0] / tread);
    return Line::evaluate(n, on_treads);
  }
};

TEST(FarSizes, OfStairsAreOnTheTreadThatIsLikeliest) {
  const Stairs model(test::line(3 * tread, 8));
  const Fit recalibrated = fit(model, {3, 0}, {});
  const std::vector<const Candidate*> candidates{&model.candidates()[0]};
  const std::vector<Candidate> far =
      with_far_sizes(model, recalibrated, candidates, std::vector<RankedCause>(1), Rules{}, 1, {});
  ASSERT_EQ(far.size(), 1U);
  const FreeParameter& p = far[0].parameters[0];
  EXPECT_NEAR(p.likely, 3 * tread, 0.6 * tread);
  EXPECT_GT(p.blur, 0);
  EXPECT_LT(p.blur, tread);
}

TEST(FarSizes, AreNoneWhereAFitHasReachedAsMuch) {
  const Stairs model(test::line(3 * tread, 9));
  const Fit recalibrated = fit(model, {3, 0}, {});
  const std::vector<const Candidate*> candidates{&model.candidates()[0]};
  std::vector<RankedCause> singles(1);
  singles[0].fit = fit(model, {3, 0}, {{candidates[0], {}, {3 * tread}}});
  EXPECT_TRUE(with_far_sizes(model, recalibrated, candidates, singles, Rules{}, 1, {}).empty());
}

TEST(FarSizes, AreNotSoughtWhereNoneIsAsLikely) {
  const Stairs model(test::line(0, 10));
  const Fit recalibrated = fit(model, {3, 0}, {});
  const std::vector<const Candidate*> candidates{&model.candidates()[0]};
  EXPECT_TRUE(with_far_sizes(model, recalibrated, candidates, std::vector<RankedCause>(1), Rules{}, 1, {}).empty());
}

}  // namespace
}  // namespace metastable::analysis
