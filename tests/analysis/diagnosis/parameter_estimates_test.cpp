#include "analysis/diagnosis/parameter_estimates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/model_fit.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

// Two variants say 2 and 3, each with a standard error of 0.1: half of what lies above 3.128 is a tenth of the second.
TEST(ParameterEstimates, CoverVariantsThatTheDataHardlyTellApart) {
  const test::Line model = test::line(0, 1);
  Candidate sag;
  sag.id = "sag";
  sag.parameters = {{0, -100, 100, 1e-4}};
  sag.variants = {{1}, {2}};
  sag.report = [](const std::vector<double>& variant, const std::vector<double>& values) {
    return std::vector<NamedValue>{{"size", values[0]}, {"end", variant[0]}};
  };
  RankedCause ranked;
  ranked.terms = {{&sag, {1}, {2}}};
  ranked.fit.information = 100 * Eigen::MatrixXd::Identity(3, 3);
  for (const auto& [gain, upper] : std::vector<std::pair<double, double>>{{10, 3.128}, {-30, 2.164}}) {
    EffectScan scan;
    scan.effects = {{&sag, {10, gain}, {Eigen::VectorXd::Constant(1, 2), Eigen::VectorXd::Constant(1, 3)}, {0, 1}, 0}};
    scan.information = 100 * Eigen::MatrixXd::Identity(2, 2);
    scan.whole = scan.information.diagonal();
    const std::vector<EstimatedParameter> told = described_cause(model, ranked, scan, false).parameters[0];
    EXPECT_NEAR(told[0].lower, 1.836, 1e-3);
    EXPECT_NEAR(told[0].upper, upper, 1e-3);
    EXPECT_FALSE(told[1].fitted);
  }
}

// Acts by no more than 1, however large it is.
class Saturating : public test::Line {
 public:
  using Line::Line;
  Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override {
    std::vector<EffectTerm> bounded(terms.begin(), terms.end());
    for (EffectTerm& term : bounded) term.values[0] = std::tanh(term.values[0]);
    return Line::evaluate(nuisance, bounded);
  }
};

// Its curvature says nothing at 8, but none of it is excluded: the likelihood falls by 1.35 on the way there.
TEST(ParameterEstimates, OfALargeEffectDoNotHoldNoneOfIt) {
  std::mt19937_64 generator(4);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (int i = 0; i < 400; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + w.back() + 0.5 * normal(generator));
  }
  const Saturating model(y, w);
  RankedCause ranked;
  ranked.terms = {test::term(model, "slope", {}, {8})};
  const Fit without = fit(model, {3, -0.7}, {});
  ranked.fit = fit(model, {3, -0.7}, ranked.terms, {.count = {}, .refit_nuisances = true, .most_iterations = 1});
  ranked.terms = ranked.fit.terms;
  ranked.gain = 2 * (ranked.fit.penalised - without.penalised);
  ASSERT_GT(ranked.gain, 100);
  const EstimatedParameter told = described_cause(model, ranked, {}, true).parameters[0][0];
  EXPECT_GT(told.lower, 1);
  EXPECT_GT(told.upper, 8);
  const std::vector<EffectTerm> end{test::term(model, "slope", {}, {told.lower})};
  EXPECT_NEAR(ranked.fit.log_likelihood - model.evaluate(ranked.fit.nuisance, end).total(), 1.353, 0.1);
}

// What errors of form move is added to what chance does.
TEST(ParameterEstimates, KnowWhatTheFormOfTheModelMoves) {
  class Rough : public test::Line {
   public:
    explicit Rough(double form_sd) : Line(test::line(0, 3)) { nuisances_[0].form_sd = form_sd; }
  };
  const auto half = [](const Rough& model) {
    const EstimatedParameter mean = contact_estimates(model, fit(model, {3, -0.7}, {})).at(0);
    return (mean.upper - mean.lower) / 2;
  };
  EXPECT_NEAR(half(Rough(0.1)), std::hypot(half(Rough(0)), 1.6449 * 0.1), 1e-3);
}

}  // namespace
}  // namespace metastable::analysis
