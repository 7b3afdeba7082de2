#include "analysis/study/consistency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "tests/analysis/settings.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

const Metastability& sound() {
  static const Metastability result = study(paper_setting(9.59, true).problem(), {.tolerance = 0.05, .brief = true});
  return result;
}

template <class Check>
void expect_contradiction(Check check, const std::string& part) {
  EXPECT_NE(message_of<Contradiction>(check).find(part), std::string::npos);
}

TEST(Consistency, ASoundStudyPassesAndEachFaultIsNamed) {
  EXPECT_NO_THROW(require_consistent(sound()));
  EXPECT_GE(sound().agreements.size(), 2u);
  Metastability rising = sound();
  rising.steps.survival[5] = rising.steps.survival[4] * 1.001;
  expect_contradiction([&] { require_consistent(rising); }, "survival of 5 steps");
  Metastability few = sound();
  few.steps.distribution.mean = 2;
  expect_contradiction([&] { require_consistent(few); }, "the expected steps are 2");
  Metastability outside = sound();
  outside.steps.from_start.upper = 0.9 * outside.steps.from_start.value;
  expect_contradiction([&] { require_consistent(outside); }, "expected steps are");
  Metastability rate = sound();
  rate.agreements.back().other *= 1.01;
  expect_contradiction([&] { require_consistent(rate); }, "by another");
}

// Interpolated rows know a probability to the error that the study found: a rise below it is no contradiction.
TEST(Consistency, IntegratedSurvivalMayRiseWithinItsErrorOnly) {
  Metastability study = sound();
  study.method = Method::integrated;
  study.steps.discretization_error = 1e-4;
  study.steps.survival[60] = study.steps.survival[59] * (1 + 0.5e-4);
  EXPECT_NO_THROW(require_consistent(study));
  study.steps.survival[60] = study.steps.survival[59] * (1 + 2e-4);
  expect_contradiction([&] { require_consistent(study); }, "survival of 60 steps");
}

TEST(Consistency, IntervalAndCertificateOverlap) {
  const Estimate& steps = sound().steps.from_start;
  CertifiedSteps certified;
  certified.exists = true;
  certified.lower = 0.9 * steps.lower;
  certified.upper = 1.1 * steps.upper;
  EXPECT_NO_THROW(require_consistent(sound(), certified));
  certified.lower = 1.05 * steps.upper;
  expect_contradiction([&] { require_consistent(sound(), certified); }, "certificate from");
  certified.exists = false;
  EXPECT_NO_THROW(require_consistent(sound(), certified));
}

// These are two ways that share the return map alone: draws in cells, and exact rows on nodes.
TEST(Consistency, SampledAndIntegratedOverlapAtEveryLaunchSpeed) {
  Setting setting = paper_setting(7.02, true);
  const auto of = [&](Method method) {
    return study(setting.problem(), {.method = method, .brief = true}).steps.from_start;
  };
  // Just too slow to vault, a fifth of the launches survive: replicates agree better there than they are right.
  setting.initial_speed = {3, 0.2};
  EXPECT_NEAR(of(Method::sampled).value / of(Method::integrated).value, 1, 0.01);
  for (const double speed : {4.2, 7.35, 30.0}) {
    setting.initial_speed = {speed, 0.2};
    EXPECT_NO_THROW(
        require_overlap("expected steps", "sampled", of(Method::sampled), "integrated", of(Method::integrated)))
        << speed;
  }
}

// Gains energy at almost every step, and fails once in twenty.
struct Accelerating {
  int phases() const { return 1; }
  int noise_dimension() const { return 2; }
  std::pair<double, double> state_interval(int) const { return {0, std::numeric_limits<double>::infinity()}; }
  std::optional<double> landing(double state, int, std::span<const double> score) const {
    if (score[1] > 1.645) return std::nullopt;
    return state * std::exp(0.3 + 0.1 * score[0]);
  }
  double duration(double, int) const { return 1; }
  double advance(int) const { return 1; }
};

TEST(Consistency, SurvivorsThatGainWithoutEndHaveNoAnswer) {
  Problem problem{Accelerating{}, {[](double) { return 1.0; }, 0}};
  EXPECT_NE(message_of<WithoutRegime>([&] {
              study(problem, {.tolerance = 0.05, .brief = true});
            }).find("survivors gain from step to step without end"),
            std::string::npos);
}

}  // namespace
}  // namespace metastable::analysis
