#include "analysis/fitting/effect_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::line;

TEST(EffectFit, TakesLessEffortWhereScoresScatterFarMoreThanTheyShould) {
  const auto model = line(0, 5, 2000);
  Fit recalibrated = fit(model, {0, 0}, {});
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
  for (double& score : recalibrated.evaluation.score) score *= 1.05;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
  for (double& score : recalibrated.evaluation.score) score *= 1.3;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, 1U);
}

TEST(EffectFit, TakesAllItsTimeOverFewEvents) {
  const auto model = line(0, 5, 300);
  Fit recalibrated = fit(model, {0, 0}, {});
  for (double& score : recalibrated.evaluation.score) score *= 2;
  EXPECT_EQ(effort_for(model, recalibrated).most_leaders, Effort{}.most_leaders);
}

// An effect of two kinds at each of three places. At 1 the second kind is what the data have, but where it is small it
// does half of that only, so that the first kind, which does nearly all of it at any size, promises more.
class TwoKinds : public test::Line {
 public:
  explicit TwoKinds(const Line& from) : Line(from) {
    Candidate kinds = candidates_[0];
    kinds.id = "kinds";
    kinds.variants = {{0, 0}, {1, 0}, {2, 0}, {0, 1}, {1, 1}, {2, 1}};
    candidates_ = {kinds};
    for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += at(i, {1, 1}, 1);
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e = Line::evaluate(n, {});
    for (const EffectTerm& t : terms)
      for (std::size_t i = 0; i < y_.size(); ++i) {
        const double before = e.score[i];
        e.score[i] -= at(i, t.variant, t.values[0]) / std::exp(n[1]);
        e.log_density[i] += 0.5 * (before * before - e.score[i] * e.score[i]);
      }
    return e;
  }

 private:
  static double at(std::size_t i, const std::vector<double>& variant, double v) {
    if (static_cast<double>(i % 3) != variant[0]) return 0;
    const double a = std::sin(1.3 * static_cast<double>(i)), b = std::cos(0.7 * static_cast<double>(i));
    return variant[1] == 0 ? v * (a + 0.8 * b) : v * a + v * v * b;
  }
};

TEST(EffectFit, TriesTheOtherKindOfALargeEffectWhateverItsScorePromises) {
  const TwoKinds model(line(0, 5, 600));
  const Fit nothing = fit(model, {0, 0}, {});
  const EffectScan scan = scan_effects(model, nothing, {&model.candidates()[0]}, 1);
  const ScannedEffect& scanned = scan.effects.front();
  ASSERT_EQ(scanned.best, 1U);
  ASSERT_LT(scanned.gain[4], 0.8 * scanned.gain[1]);
  const Fit found = fit_one_more(model, {}, nothing, scanned);
  EXPECT_EQ(found.terms.back().variant, (std::vector<double>{1, 1}));
  EXPECT_NEAR(found.terms.back().values[0], 1, 0.1);
}

}  // namespace
}  // namespace metastable::analysis
