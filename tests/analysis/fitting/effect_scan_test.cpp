#include "analysis/fitting/effect_scan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <stdexcept>
#include <vector>

#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::Line;
using test::line;
using test::SlopeAmongWaves;

TEST(EffectScan, ScoresPromiseWhatTheFitGains) {
  const Line model = line(0.08, 4, 2000);
  const Fit plain = fit(model, {0, 0}, {});
  const EffectScan scan = scan_effects(model, plain, {&model.candidates()[0], &model.candidates()[1]}, 1);
  const Fit with = fit(model, plain.nuisance, {{&model.candidates()[0], {}, {0.0}}});
  EXPECT_NEAR(scan.effects[0].gain[0], 2 * (with.penalised - plain.penalised), 0.5);
  EXPECT_NEAR(scan.effects[0].start[0][0], with.terms[0].values[0], 2e-3);
  EXPECT_EQ(scan.effects[0].gain[0], scan.effects[1].gain[0]);
}

// Beside a fitted slope the first of eight waves, which is that slope, is singular up to rounding. It promises nothing,
// and the other seven promise what least squares gain by them: no last bit decides.
TEST(EffectScan, WhatAFittedEffectTakesUpPromisesNothing) {
  const SlopeAmongWaves model(line(0.5, 1, 1200));
  const Candidate &slope = model.candidates()[0], &waves = model.candidates()[1];
  const Fit with_slope = fit(model, {0, 0}, {{&slope, {}, {0.0}}});
  const EffectScan beside_slope = scan_effects(model, with_slope, {&slope, &waves}, 1);
  EXPECT_EQ(beside_slope.effects[0].gain[0], 0);
  EXPECT_EQ(beside_slope.effects[1].start[0].size(), 8);
  const Fit with_waves = fit(model, {0, 0}, {{&waves, {}, std::vector<double>(8, 0.0)}});
  // Of n events' variance they remove a share r: n r, over what the sd's own parameter leaves of their information.
  const double r = 1 - std::exp((with_slope.log_likelihood - with_waves.log_likelihood) / 600);
  EXPECT_NEAR(beside_slope.effects[1].gain[0], 1200 * r / (1 - r / 2), 1);
  const EffectScan beside_waves = scan_effects(model, with_waves, {&slope, &waves}, 1);
  EXPECT_EQ(beside_waves.effects[0].gain[0], 0);
  EXPECT_EQ(beside_waves.effects[1].gain[0], 0);
}

// Its slope moves the scores by some last bits at most.
class NextToNothing : public Line {
 public:
  using Line::Line;
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    std::vector<EffectTerm> small(terms.begin(), terms.end());
    for (EffectTerm& term : small) term.values[0] *= 1e-12;
    return Line::evaluate(n, small);
  }
};

// What a parameter moves by rounding alone is nothing: neither a gain nor a fit that does not settle.
TEST(EffectScan, AParameterThatMovesNothingPromisesNothing) {
  const Line plain = line(0.5, 1, 1200);
  std::vector<double> y, w;
  for (const Event& event : plain.events()) {
    w.push_back(event.speed);
    y.push_back(3 + 0.5 * event.speed + 0.5 * std::sin(static_cast<double>(y.size())));
  }
  const NextToNothing model(y, w);
  const Candidate& slope = model.candidates()[0];
  const EffectScan scan = scan_effects(model, fit(model, {0, 0}, {}), {&slope}, 1);
  EXPECT_EQ(scan.effects[0].gain[0], 0);
  EXPECT_EQ(scan.effects[0].start[0][0], 0);
  const Fit with = fit(model, {0, 0}, {{&slope, {}, {0.0}}});
  EXPECT_TRUE(with.converged) << with.reason;
  EXPECT_EQ(with.terms[0].values[0], 0);
}

// Under no effect the p-values of many data sets are uniform.
TEST(EffectScan, ChanceLevelsAreHonest) {
  int below_tenth = 0, below_hundredth = 0;
  constexpr int sets = 300;
  for (unsigned seed = 0; seed < sets; ++seed) {
    const Line model = line(0, 100 + seed, 240);
    const Fit plain = fit(model, {3, -0.7}, {});
    const EffectScan scan = scan_effects(model, plain, {&model.candidates()[0]}, 1);
    const double p = ChanceGains(scan, 400, 1).p_value(&model.candidates()[0], scan.effects[0].gain[0]);
    below_tenth += p < 0.1;
    below_hundredth += p < 0.01;
  }
  EXPECT_NEAR(below_tenth, 0.1 * sets, 4 * std::sqrt(0.09 * sets));
  EXPECT_LE(below_hundredth, 0.01 * sets + 4 * std::sqrt(0.0099 * sets));
}

TEST(EffectScan, ChanceNeedsADrawAndAScannedEffect) {
  const Line model = line(0, 5, 240);
  const EffectScan scan = scan_effects(model, fit(model, {3, -0.7}, {}), {&model.candidates()[0]}, 1);
  EXPECT_THROW(ChanceGains(scan, 0, 1), std::invalid_argument);
  const ChanceGains chance(scan, 1, 1);
  EXPECT_GT(chance.p_value(&model.candidates()[0], 1), 0);
  EXPECT_LE(chance.look_elsewhere(0.5), 1);
  EXPECT_THROW(chance.p_value(&model.candidates()[1], 1), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
