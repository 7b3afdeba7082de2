#include "analysis/gap/gap_shrinkage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "analysis/drum_model/coast_down_transitions.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/gap/held_out.h"
#include "analysis/statistics/random.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"
#include "tests/analysis/rotor.h"

namespace metastable::analysis {
namespace {

Fit as_given(const TransitionModel& model) {
  Fit given;
  given.evaluation = model.evaluate(nominal_values(model), {});
  return given;
}

// There is a torque that the nominal losses lack: held out, its fit closes the gap; recalibration alone does not.
TEST(GapShrinkage, TheTrueEffectClosesTheGap) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const EffectTerm truth = test::term(*design, "rolling_resistance", {}, {0.02});
  const auto data = design->simulate(nominal_values(*design), std::vector{truth}, 5);
  const Fit recalibrated = fit(*data, nominal_values(*data), {});
  const Fit with = fit(*data, recalibrated.nuisance, {test::term(*data, "rolling_resistance", {}, {0.01})});
  const auto shrinkage = gap_shrinkage(*data, as_given(*data), recalibrated, {&with}, 4, 1, 1).measures;
  ASSERT_EQ(shrinkage.size(), 2U);
  for (const Shrinkage& one : shrinkage) {
    EXPECT_LT(one.with_effect, one.recalibrated) << one.measure;
    ASSERT_TRUE(one.closed) << one.measure;
    EXPECT_NEAR(*one.closed, 1, 0.1) << one.measure;
    EXPECT_LE(*one.closed_lower, *one.closed_upper);
    EXPECT_LE(one.baseline_lower, one.baseline_upper);
  }
}

// The part between two of the measure's models is about the difference of the measure between them. The effect in the
// model as given closes something, and less than with the losses refitted. What is left counts where it is more than
// nothing.
TEST(HeldOut, PartsAreThoseOfTheMeasure) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const EffectTerm truth = test::term(*design, "rolling_resistance", {}, {0.02});
  const auto data = design->simulate(nominal_values(*design), std::vector{truth}, 5);
  const Fit recalibrated = fit(*data, nominal_values(*data), {});
  const Fit with = fit(*data, recalibrated.nuisance, {test::term(*data, "rolling_resistance", {}, {0.01})});
  Fit given = as_given(*data);
  given.nuisance = nominal_values(*data);
  const Fit alone = fit(*data, given.nuisance, with.terms, {.count = {}, .refit_nuisances = false});
  const HeldOutGap held = gap_shrinkage(*data, given, recalibrated, {&with}, 4, 1, 1);
  const Shrinkage& s = held.measures.front();
  const auto parts_of = [&](const std::vector<double>& left) {
    return parts_closed(*data, recalibrated, {&with, &given, left},
                        {{&with, &recalibrated, true}, {&alone, &given, false}}, 4, 1, 1);
  };
  const std::vector<ClosedShare> parts = parts_of(held.left);
  EXPECT_NEAR(parts[0].value, (s.recalibrated - s.with_effect) / s.baseline, 0.05);
  EXPECT_GT(parts[1].estimate().lower, 0.5);
  EXPECT_LT(parts[1].value, 1.02);
  for (const ClosedShare& part : parts) {
    EXPECT_LE(part.estimate().lower, part.value);
    EXPECT_GE(part.estimate().upper, part.value);
  }
  const std::vector<double> less(data->trials(), -1), nothing(data->trials(), 0), more(data->trials(), 1);
  EXPECT_EQ(parts_of(less)[0].value, parts_of(nothing)[0].value);
  EXPECT_LT(parts_of(more)[0].value, parts_of(nothing)[0].value);
  // A share has errors that a mean with itself keeps, and with its opposite cancels.
  ClosedShare opposite = parts[0];
  opposite.value = 2 - opposite.value;
  for (double& one : opposite.drawn) one = 2 - one;
  EXPECT_EQ(mean_of(parts[0], parts[0]).estimate().lower, parts[0].estimate().lower);
  EXPECT_NEAR(mean_of(parts[0], opposite).estimate().lower, 1, 1e-12);
  EXPECT_NEAR(mean_of(parts[0], opposite).estimate().upper, 1, 1e-12);
}

// An effect that is not there gains on the trials it is fitted to, and loses on others. In the mean over experiments
// its part of a gap of 48 nats is nothing: fitted it is 0.5 nats, and held out -0.8.
TEST(HeldOut, FittingAnEffectThatIsNotThereClosesNothing) {
  constexpr int seeds = 60;
  double sum = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> y(96), w(96);
    for (std::size_t i = 0; i < y.size(); ++i) w[i] = normal(generator), y[i] = 1 + normal(generator);
    const test::Line line(y, w);
    const Fit recalibrated = fit(line, nominal_values(line), {});
    const Fit with = fit(line, recalibrated.nuisance, {test::term(line, "slope", {}, {0})});
    Fit given = as_given(line);
    given.nuisance = nominal_values(line);
    const std::vector<double> left(line.trials());
    sum +=
        48 * parts_closed(line, recalibrated, {&with, &given, left}, {{&with, &recalibrated, true}}, 4, 1, 1)[0].value;
  }
  EXPECT_NEAR(sum / seeds, 0, 0.3);
}

TEST(GapShrinkage, WithoutRivalsTheLastModelIsTheRecalibratedOne) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const auto data = design->simulate(nominal_values(*design), {}, 6);
  const Fit recalibrated = fit(*data, nominal_values(*data), {});
  for (const Shrinkage& one : gap_shrinkage(*data, as_given(*data), recalibrated, {}, 4, 1, 1).measures)
    EXPECT_EQ(one.with_effect, one.recalibrated) << one.measure;
}

// 40 rests come in 10,000 collisions; 20 expected as given, 39 with the effect. Poisson limits of 40: 30.2 and 52.07.
TEST(RestShrinkage, SharesAreThoseOfCounts) {
  StepsBeforeFailure steps;
  steps.observed_lower = 10000 / 52.07;
  steps.observed_upper = 10000 / 30.2;
  steps.baseline = 500;
  steps.recalibrated = 400;
  steps.with_effect = 10000.0 / 39;
  const Shrinkage s = rest_shrinkage(10000, 40, steps, "share that fails");
  EXPECT_NEAR(s.baseline, 0.002, 1e-12);
  EXPECT_NEAR(s.baseline_lower, 0.00102, 1e-9);
  EXPECT_NEAR(s.baseline_upper, 0.003207, 1e-9);
  EXPECT_NEAR(s.recalibrated, 0.0015, 1e-12);
  EXPECT_NEAR(s.with_effect, 0.0001, 1e-12);
  EXPECT_NEAR(s.floor * 10000, 4.972152, 1e-5);  // sum over k of |k - 39| Poisson(k; 39)
  ASSERT_TRUE(s.closed);
  EXPECT_EQ(*s.closed, 1);  // 19 / (20 - 4.97) is more than all
  EXPECT_NEAR(*s.closed_lower, (10.2 - 8.8) / (10.2 - s.floor * 10000), 1e-3);
  EXPECT_EQ(*s.closed_upper, 1);
}

// Where the observed share agrees with the model as given there is nothing to close.
TEST(RestShrinkage, SaysNoShareWhereTheGapMayBeNone) {
  StepsBeforeFailure steps;
  steps.observed_lower = 10000 / 52.07;
  steps.observed_upper = std::numeric_limits<double>::infinity();
  steps.baseline = 10000.0 / 35;
  steps.recalibrated = steps.with_effect = std::numeric_limits<double>::infinity();
  const Shrinkage s = rest_shrinkage(10000, 40, steps, "share that fails");
  EXPECT_EQ(s.baseline_lower, 0);
  EXPECT_EQ(s.floor, 0);
  EXPECT_NEAR(s.with_effect, 0.004, 1e-12);
  EXPECT_FALSE(s.closed);
}

// Says the model which error was added to each value.
class Blurred : public test::Line {
 public:
  Blurred(std::vector<double> y, std::vector<double> w, const std::vector<double>& added)
      : Line(std::move(y), std::move(w)) {
    for (std::size_t i = 0; i < added.size(); ++i) events_[i].added = added[i];
  }
};

// Errors that are drawn evenly hardly move the sum of a cell: taken for chance they were a gap below none, of -.003.
TEST(GapShrinkage, ErrorsThatWereAddedAreNoChance) {
  constexpr std::size_t trials = 100;
  constexpr int seeds = 40;
  double sum = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> y(4 * trials), w(4 * trials), added(4 * trials);
    for (std::size_t number = 0; number < 4; ++number) {
      const std::vector<double> even = even_normals(seed, number, trials);
      for (std::size_t t = 0; t < trials; ++t) {
        const std::size_t i = 4 * t + number;
        w[i] = normal(generator);
        added[i] = 0.5 * even[t];
        y[i] = 3 + added[i] + 0.2 * normal(generator);
      }
    }
    const Blurred model(y, w, added);
    sum += gap_shrinkage(model, as_given(model), fit(model, {3, 0}, {}), {}, 4, 1, seed).measures[0].with_effect;
  }
  EXPECT_NEAR(sum / seeds, 0, 0.0007);
}

TEST(GapShrinkage, NeedsTwoFolds) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  for (const int folds : {-1, 0, 1})
    EXPECT_THROW(gap_shrinkage(*design, {}, {}, {}, folds, 1, 1), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
