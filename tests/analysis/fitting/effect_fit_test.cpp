#include "analysis/fitting/effect_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "analysis/fitting/bayes_factor.h"
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

class OneTrial : public test::Line {
 public:
  explicit OneTrial(const Line& from) : Line(from) {}
  std::size_t trials() const override { return 1; }
};

TEST(EffectFit, RanksNoLargerSetsWhereTrialsAreTooFewToNameACause) {
  const auto model = line(0, 5, 300);
  const Fit recalibrated = fit(model, {0, 0}, {});
  EXPECT_EQ(effort_for(model, recalibrated).most_effects, Effort{}.most_effects);
  EXPECT_EQ(effort_for(OneTrial(model), recalibrated).most_effects, 2U);
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

// The data hold a wave of frequency 1.3417, and the catalogue lists 1.3 only.
class Tuned : public test::Line {
 public:
  explicit Tuned(const Line& from) : Line(from) {
    candidates_[0].id = "wave";
    candidates_[0].variants = {{1.3}};
    candidates_[0].refine = {0.2};
    for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += 50 * wave(i, 1.3417);
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e = Line::evaluate(n, {});
    for (std::size_t i = 0; i < e.score.size(); ++i) {
      for (const EffectTerm& t : terms) e.score[i] -= t.values[0] / std::exp(n[1]) * wave(i, t.variant[0]);
      e.log_density[i] = -0.5 * e.score[i] * e.score[i] - 0.91893853320467274 - n[1];
    }
    return e;
  }

 private:
  double wave(std::size_t i, double frequency) const {
    return std::sin(frequency * 0.01 * static_cast<double>(i % 300));
  }
};

// Three rounds of halved moves would end up to 0.0125 away from the frequency. The search must go on until the variant
// stands still.
TEST(EffectFit, RefinesAVariantUntilItMovesNoMore) {
  const Tuned model(line(0, 5, 600));
  const Candidate* candidate = &model.candidates()[0];
  Fit found = fit(model, {0, 0}, {{candidate, {1.3}, {40.0}}});
  const double before = found.penalised;
  refine_variant(model, {}, found);
  EXPECT_NEAR(found.terms.back().variant[0], 1.3417, 0.003);
  EXPECT_NEAR(found.terms.back().values[0], 50, 0.5);
  EXPECT_GT(found.penalised, before + 10);
}

// The evidence of a gain is half of that gain, less what the parameters cost, however large the gain is.
TEST(Evidence, OfALargeGainIsHalfOfIt) {
  const Rules rules;
  for (const double parameters : {1.0, 2.0, 8.0})
    EXPECT_NEAR(evidence_of_gain(1e8, parameters, rules), 0.5e8 - 0.5 * parameters * (1 + std::log(1e8 / parameters)),
                1e-3);
  // A gain no larger than the expected one has the evidence of a normal prior with that expected gain.
  EXPECT_NEAR(evidence_of_gain(20, 1, rules), 0.5 * 36.0 / 37 * 20 - 0.5 * std::log(37), 1e-12);
  // No prior that expects as much as the rule says, or more, gives a gain more evidence.
  for (const double gain : {40.0, 200.0, 5000.0})
    for (const double expected : {36.0, 60.0, 1000.0, 6000.0}) {
      Rules fixed;
      fixed.expected_gain = expected;
      const double g = expected / 2;
      EXPECT_GE(evidence_of_gain(gain, 2, rules) + 1e-9, 0.5 * g / (1 + g) * gain - std::log1p(g));
    }
}

}  // namespace
}  // namespace metastable::analysis
