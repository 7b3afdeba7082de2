// Fitted values at an end of their range are said.

#include "analysis/diagnosis/at_bound.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/study/setting.h"
#include "analysis/wheel_model/wheel_transitions.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

Diagnosis diagnosed_with(const Machine& machine, double bend, double b, unsigned seed) {
  const auto next = [&](double x, double z, std::size_t) { return 0.8 * x + b + 0.2 * z + bend * x * x; };
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"bend", "b_drift"};
  return diagnose(
      machine_transitions(std::make_shared<const Machine>(machine), scalar_runs(60, 14, 1.5, 0.05, seed, next)),
      options);
}

std::string all_of(const Diagnosis& d) {
  std::string all;
  for (const std::string& sentence : d.sentences) all += sentence + "\n";
  return all;
}

TEST(AtBound, AnEffectThatIsLargerThanItMayBeIsSaid) {
  Machine machine = linear_machine(0.05);
  machine.parameters[0].sd = machine.parameters[1].sd = 0;  // One that is known less well than stated would do as much.
  machine.effects = {{"bend", {{"c", 0, -0.05, 0.05}}}};
  for (const unsigned seed : {1U, 2U}) {
    const Diagnosis d = diagnosed_with(machine, -0.1, 0.3, seed);
    ASSERT_EQ(d.limits.at_bound.size(), 1u) << all_of(d);
    const AtBound& one = d.limits.at_bound.front();
    EXPECT_EQ(one.of, "bend");
    EXPECT_EQ(one.parameter, "c");
    EXPECT_FALSE(one.upper);
    EXPECT_NEAR(one.value, -0.05, 1e-6);
    EXPECT_NE(all_of(d).find("The c of bend stands at the lower bound of its range, -0.05: its interval has one side "
                             "only"),
              std::string::npos)
        << all_of(d);
  }
}

TEST(AtBound, ARecalibratedParameterIsSaidAndOneInsideIsNot) {
  Machine machine = linear_machine(0.05);
  machine.parameters[1] = {"b", 0.3, 0.1, 0.1, 0.4};
  const Diagnosis beyond = diagnosed_with(machine, 0, 0.5, 3);
  ASSERT_EQ(beyond.limits.at_bound.size(), 1u) << all_of(beyond);
  EXPECT_EQ(beyond.limits.at_bound.front().of, "");
  EXPECT_NE(all_of(beyond).find("The fitted b stands at the upper bound of its range, 0.4"), std::string::npos)
      << all_of(beyond);
  EXPECT_TRUE(diagnosed_with(linear_machine(0.05), -0.05, 0.3, 3).limits.at_bound.empty());
  EXPECT_TRUE(diagnosed_with(linear_machine(0.05), 0, 0.3, 3).limits.at_bound.empty());
}

// Lists what is said where one nuisance stands at an end of its range, and the others where they are stated.
std::vector<AtBound> with_one_at(const TransitionModel& model, const std::string& name, bool upper) {
  Fit fit;
  fit.nuisance = nominal_values(model);
  const auto at = std::ranges::find(model.nuisances(), name, &Nuisance::name);
  EXPECT_NE(at, model.nuisances().end()) << name;
  if (at == model.nuisances().end()) return {};
  fit.nuisance[static_cast<std::size_t>(at - model.nuisances().begin())] = upper ? at->upper : at->lower;
  return values_at_bound(model, fit);
}

void expect_one(const std::vector<AtBound>& found, const std::string& parameter, bool upper, double value) {
  ASSERT_EQ(found.size(), 1u) << parameter;
  EXPECT_EQ(found.front().of, "");
  EXPECT_EQ(found.front().parameter, parameter);
  EXPECT_EQ(found.front().upper, upper) << parameter;
  EXPECT_NEAR(found.front().value, value, 1e-9 * std::abs(value)) << parameter;
}

// A machine's own names begin and end as they like; the lower end of a fitted error or share is next to nothing.
TEST(AtBound, OnlyAnErrorOrAShareOfNothingIsNotSaid) {
  Machine machine = linear_machine(0.05);
  machine.parameters = {{"log_a", 0.8, 0.05, 0.7, 0.9}, {"push_sd", 0.3, 0.1, 0.2, 0.5}, {"s", 0.2, 0.05, 0.01, 2}};
  machine.may_vary.clear();
  machine.observe[0].sd.reset();
  machine.most_wild = 0.01;
  const auto next = [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; };
  const auto model =
      machine_transitions(std::make_shared<const Machine>(machine), scalar_runs(6, 10, 1.5, 0.05, 3, next));
  expect_one(with_one_at(*model, "log_a", false), "log_a", false, 0.7);
  expect_one(with_one_at(*model, "push_sd", false), "push_sd", false, 0.2);
  EXPECT_TRUE(with_one_at(*model, "log sensor sd of x", false).empty());
  EXPECT_TRUE(with_one_at(*model, "logit wild_share", false).empty());
  EXPECT_EQ(with_one_at(*model, "log sensor sd of x", true).front().parameter, "sensor_sd_x");
  expect_one(with_one_at(*model, "logit wild_share", true), "wild_share", true, 0.01);
  EXPECT_NE(at_bound_in_words(with_one_at(*model, "logit wild_share", true).front())
                .find("The fitted wild_share stands at the largest that most_wild allows, 0.01: more rows may be wild"),
            std::string::npos);
}

// The report holds the hub's inertia and not the law's error, whose ratio is said by its own name.
TEST(AtBound, RatiosOfAWheelAreSaidAtEitherEnd) {
  Setting setting;
  setting.law = dynamics::Law::settled;
  setting.slope_deg = 7.02;
  setting.wheel.leg_length.assign(8, 0.152);
  setting.wheel.radius_of_gyration = 0.0424;
  setting.wheel.tip_radius = 0.0005;
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.4, 0.03};
  setting.initial_speed = {4.9, 0.2};
  const auto rolled = simulate_trials(setting, {.trials = 3, .collisions = 6, .seed = 3});
  const auto model = wheel_transitions(
      parse_experiment(source_of(experiment_files({{"ramp", setting, rolled}}, "rolled", {}), "rolled")));
  for (const bool upper : {false, true}) {
    const std::vector<AtBound> hub = with_one_at(*model, "log hub_inertia_ratio", upper);
    ASSERT_EQ(hub.size(), 1u);
    EXPECT_EQ(hub.front().parameter, "hub_inertia_kg_m2");
    EXPECT_EQ(hub.front().upper, upper);
    expect_one(with_one_at(*model, "log sticking_ratio", upper), "sticking_ratio", upper,
               std::exp(upper ? 0.03 : -0.03));
  }
  EXPECT_TRUE(with_one_at(*model, "log friction_sd", false).empty());
  expect_one(with_one_at(*model, "log friction_sd", true), "friction_sd", true, 0.5);
}

}  // namespace
}  // namespace metastable::analysis::test
