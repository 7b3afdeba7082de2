#include "analysis/diagnosis/diagnosis.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "analysis/drum_model/coast_down_transitions.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/wheel_model/wheel_nuisances.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/line.h"
#include "tests/analysis/rotor.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

using test::decided;
using test::term;

DiagnosisOptions quick() {
  DiagnosisOptions options;
  options.draws = 500;
  return options;
}

std::unique_ptr<TransitionModel> data(
    const std::vector<std::pair<std::string, std::pair<std::vector<double>, std::vector<double>>>>& effects,
    std::uint64_t seed, std::vector<double> contact = {}) {
  const auto design = wheel_transitions(test::wheel_design(100, 14));
  std::vector<EffectTerm> terms;
  for (const auto& [id, sizes] : effects) terms.push_back(term(*design, id, sizes.first, sizes.second));
  if (contact.empty()) contact = nominal_values(*design);
  return design->simulate(contact, terms, seed);
}

// Where the verdict is a gap, a gap is the likelier; where it is none, none is.
void expect_probabilities_to_agree(const Diagnosis& d) {
  const double null = d.causes.p_no_gap + d.causes.p_recalibrate;
  const bool gap = is_gap(d.verdict);
  EXPECT_TRUE(gap ? null <= 0.5 + 1e-9 : null >= 0.5 - 1e-9) << verdict_name(d.verdict) << " " << null;
  double sum = null + d.causes.p_none;
  for (const Cause& cause : d.causes.ranked) sum += cause.probability;
  EXPECT_NEAR(sum, 1, 1e-9);
}

TEST(Diagnosis, FindsNoGapWhereThereIsNone) {
  const Diagnosis d = diagnose(*data({}, 21), quick());
  EXPECT_EQ(d.verdict, Verdict::no_gap);
  EXPECT_TRUE(d.causes.set.empty());
  EXPECT_FALSE(d.sentences.empty());
  expect_probabilities_to_agree(d);
}

// Small effects lie on the border, where tests and evidence may disagree.
TEST(Diagnosis, ItsProbabilitiesAgreeWithItsVerdict) {
  const auto design = wheel_transitions(test::wheel_design(40, 5));
  DiagnosisOptions options = quick();
  options.draws = 200;
  options.catalogue = {"leg_contact", "trial_drift", "air_drag", "sensor_bias", "inertia", "slope_offset"};
  for (const double torque : {0.0, 1e-4, 2e-4})
    for (std::uint64_t seed = 31; seed < 34; ++seed)
      expect_probabilities_to_agree(
          decided(*design->simulate(nominal_values(*design),
                                    std::vector{term(*design, "rolling_resistance", {}, {torque})}, seed),
                  options));
}

TEST(Diagnosis, CallsOtherContactParametersRecalibration) {
  const auto design = wheel_transitions(test::wheel_design(100, 14));
  std::vector<double> contact = nominal_values(*design);
  contact[WheelSlot::friction_mean] += 0.05;
  const Diagnosis d = diagnose(*data({}, 22, contact), quick());
  EXPECT_EQ(d.verdict, Verdict::recalibrate);
  EXPECT_LT(d.gap.p_recalibration, 1e-6);
  // The loss tells one number of the two means: recalibrated and true model agree on the steps.
  EXPECT_GT(d.shrinkage.measures[0].baseline, 10 * std::abs(d.shrinkage.measures[0].recalibrated));
}

void expect_named(const Diagnosis& d) {
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"leg_contact"});
  ASSERT_FALSE(d.causes.ranked.empty());
  const auto& parameters = d.causes.ranked[0].parameters[0];
  EXPECT_EQ(parameters[0].value, 3);
  const double half = (parameters[1].upper - parameters[1].lower) / 2;
  EXPECT_NEAR(parameters[1].value, 1.3, 2.5 * half);  // half: 1.64 standard errors
  EXPECT_LT(half, 0.1);
  EXPECT_LT(d.gap.p_value, 1e-6);
}

void expect_closed(const Diagnosis& d) {
  ASSERT_TRUE(d.shrinkage.measures[0].closed);
  EXPECT_GT(*d.shrinkage.measures[0].closed, 0.8);
}

void expect_leg_three_first(const GapMap& map) {
  const auto first = std::min_element(map.cells.begin(), map.cells.end(), [](const GapCell& a, const GapCell& b) {
    return std::abs(a.statistic) > std::abs(b.statistic);
  });
  EXPECT_EQ(first->facet, "leg");
  EXPECT_EQ(first->at.substr(0, 5), "leg 3");
}

// What the refitted contact takes up of a shift is given back in its size. A friction of 1.3 times 0.35 takes 0.79 to
// 0.95 rad/s from omega+ at 4.5 to 5.5 rad/s.
void expect_size_of_the_cause(const GapMap& map) {
  const auto cell = std::find_if(map.cells.begin(), map.cells.end(), [](const GapCell& one) {
    return one.facet == "leg" && one.aspect == "mean" && one.at.starts_with("leg 3");
  });
  ASSERT_NE(cell, map.cells.end());
  EXPECT_NEAR(cell->size, -0.87, 0.2);
}

// One diagnosis has (each test is a process of its own) name, size, what it closes, and the map's place and sizes.
TEST(Diagnosis, NamesTheCauseItsSizeItsPlaceAndWhatItCloses) {
  const Diagnosis d = diagnose(*data({{"leg_contact", {{3, 0}, {1.3}}}}, 23), quick());
  expect_named(d);
  expect_closed(d);
  expect_leg_three_first(d.gap.recalibrated);
  expect_size_of_the_cause(d.gap.as_given);
  expect_size_of_the_cause(d.gap.recalibrated);
}

TEST(Diagnosis, NamesBothOfTwoCauses) {
  const Diagnosis d =
      decided(*data({{"contact_memory", {{}, {0.4}}}, {"rolling_resistance", {{}, {0.003}}}}, 24), quick());
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_FALSE(d.causes.ranked.empty());
  const std::string name = d.causes.ranked[0].name();
  EXPECT_NE(name.find("contact_memory"), std::string::npos) << name;
  EXPECT_EQ(d.causes.ranked[0].effects.size(), 2u) << name;
  EXPECT_LT(d.causes.together, Rules{}.most_together);
}

// Without the true effect in the catalogue the answer is that nothing explains it.
TEST(Diagnosis, SaysUnexplainedWhenTheCatalogueLacksTheCause) {
  DiagnosisOptions options = quick();
  options.catalogue = {"initial_speed", "inertia", "trial_spread", "friction_patch", "air_drag"};
  const Diagnosis d = decided(*data({{"leg_contact", {{3, 0}, {1.5}}}}, 25), options);
  EXPECT_EQ(d.verdict, Verdict::unexplained);
  EXPECT_TRUE(d.causes.set.empty());
}

// A pair that nothing promises is tried where it is asked for; alone it extends the whole catalogue.
TEST(Diagnosis, TriesThePairsAskedFor) {
  const auto experiment = data({{"leg_contact", {{3, 0}, {1.5}}}}, 28);
  DiagnosisOptions options = quick();
  options.catalogue = {"leg_contact", "trial_drift", "trial_drift+leg_contact"};
  const Diagnosis d = decided(*experiment, options);
  const auto pair = std::find_if(d.causes.ranked.begin(), d.causes.ranked.end(),
                                 [](const Cause& c) { return c.effects.size() == 2; });
  ASSERT_NE(pair, d.causes.ranked.end());
  EXPECT_EQ(pair->name(), "trial_drift+leg_contact");
  EXPECT_GE(pair->gain, d.causes.ranked[0].gain - 1e-6);
  EXPECT_EQ(d.causes.ranked[0].name(), "leg_contact");
  options.catalogue = {"trial_drift+trial_drift"};
  EXPECT_THROW(diagnose(*experiment, options), std::invalid_argument);
}

// @param trials  of each condition; 0: as many as the paper's
Experiment in_laboratory(const LaboratoryOptions& reality, int trials = 0) {
  auto conditions = stand_in_conditions(stand_in_setting());
  for (LaboratoryCondition& one : conditions)
    if (trials > 0) one.trials = trials;
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, reality);
  const ExperimentFiles files = laboratory_files(conditions, setup, run_laboratory(setup, 0), {}).files;
  return parse_experiment({"lab", files.experiment_toml, files.collisions_csv, files.trials_csv, {}});
}

// Noise of the contact grows with speed here: two effects on its mean that cancel one another take its shape.
TEST(Diagnosis, APairThatGainsOnlyTogetherDoesNotExplain) {
  const Experiment experiment = in_laboratory({.outside = {{"speed_spread", 0.45}}, .sensor_noise = 0.008, .seed = 31});
  DiagnosisOptions options = quick();
  options.catalogue = {"speed_dependent_restitution", "speed_dependent_friction", "leg_contact"};
  const Diagnosis d = diagnose(*wheel_transitions(experiment), options);
  ASSERT_FALSE(d.causes.ranked.empty());
  EXPECT_EQ(d.causes.ranked[0].effects.size(), 2U) << d.causes.ranked[0].name();
  EXPECT_GT(d.causes.together, Rules{}.most_together);
  EXPECT_EQ(d.verdict, Verdict::unexplained);
  EXPECT_TRUE(d.causes.set.empty());
  ASSERT_GE(d.sentences.size(), 2U);
  EXPECT_NE(d.sentences[1].find("times as much as they do one by one"), std::string::npos) << d.sentences[1];
}

// The same beside a slope that is misread. In the place of one of the two effects such a scatter is hardly likelier
// than that effect, but beside it neither of them says anything.
TEST(Diagnosis, OneVariationStandsInThePlaceOfTwoEffects) {
  const Experiment experiment = in_laboratory({.effects = {dynamics::Effect{"slope_offset", {0.015}}},
                                               .outside = {{"speed_spread", 0.22}},
                                               .sensor_noise = 0.008,
                                               .seed = 38});
  DiagnosisOptions options = quick();
  options.catalogue = {"speed_dependent_restitution", "speed_dependent_friction", "slope_offset", "leg_contact"};
  const Diagnosis d = diagnose(*wheel_transitions(experiment), options);
  std::vector<std::string> names;
  for (const AtWork& one : d.causes.at_work)
    if (one.probability >= options.rules.least_at_work) names.push_back(one.name);
  EXPECT_EQ(names, std::vector<std::string>{"slope_offset"});
  EXPECT_EQ(d.verdict, Verdict::partly_explained);
  // The share without a name is that which the two close, and more than the best model leaves. With the slope's share
  // it is about the whole.
  EXPECT_EQ(d.causes.stand_ins.size(), 2U);
  ASSERT_TRUE(d.causes.unnamed_share && d.causes.at_work.front().closes_beside);
  EXPECT_GT(*d.causes.unnamed_share, 2 * (1 - *d.shrinkage.measures.front().closed));
  EXPECT_NEAR(*d.causes.unnamed_share + d.causes.at_work.front().closes_beside->value, 1, 0.3);
}

// Friction rises and falls over the trials, as no effect does: of all that it may vary by, the swing has most evidence.
TEST(Diagnosis, WhatVariesWithoutANameSaysByWhat) {
  const Experiment experiment = in_laboratory({.outside = {{"daily_cycle", 0.03}}, .sensor_noise = 0.008, .seed = 31});
  DiagnosisOptions options = quick();
  options.catalogue = {"trial_spread", "trial_drift", "leg_contact"};
  const Diagnosis d = decided(*wheel_transitions(experiment), options);
  EXPECT_EQ(d.verdict, Verdict::unexplained);
  ASSERT_FALSE(d.causes.unnamed.empty());
  const auto& facets = d.causes.unnamed.front().facets;
  const auto most = std::ranges::max_element(facets, {}, [](const LeftInFacet& left) {
    return left.aspect == "mean" ? 0 : left.evidence;  // the map's do not tell friction from restitution
  });
  EXPECT_EQ(most->facet, "order");
  EXPECT_EQ(most->aspect, "mean friction");
}

// Part of what one collision lost comes back at the next, which a memory of contacts, a friction that depends on the
// speed and a spread of the trials imitate together. What collisions before lost says more than they, and an odd leg is
// named beside it. A memory that is one keeps its name.
TEST(Diagnosis, AMemoryOfLossesIsNoMemoryOfContacts) {
  DiagnosisOptions options = quick();
  options.catalogue = {"contact_memory", "speed_dependent_friction", "trial_spread", "leg_contact"};
  const auto at_work = [&](const LaboratoryOptions& reality) {
    const Diagnosis d = decided(*wheel_transitions(in_laboratory(reality, 20)), options);
    std::vector<std::string> names;
    for (const AtWork& one : d.causes.at_work)
      if (one.probability >= Rules{}.least_at_work) names.push_back(one.name);
    return names;
  };
  LaboratoryOptions stored{.outside = {{"stored_energy", 0.4}}, .sensor_noise = 0.008, .seed = 31};
  EXPECT_EQ(at_work(stored), std::vector<std::string>{});
  stored.effects = {dynamics::Effect{"leg_contact", {3, 1.15, 1}}};
  EXPECT_EQ(at_work(stored), std::vector<std::string>{"leg_contact"});
  EXPECT_EQ(at_work({.effects = {dynamics::Effect{"contact_memory", {-0.4}}}, .sensor_noise = 0.008, .seed = 31}),
            std::vector<std::string>{"contact_memory"});
}

TEST(Diagnosis, IsTheSameOnAnyNumberOfThreads) {
  const auto experiment = data({{"trial_drift", {{}, {0.3}}}}, 26);
  DiagnosisOptions one = quick();
  one.catalogue = {"trial_drift", "trial_spread", "leg_contact", "air_drag"};
  one.threads = 1;
  DiagnosisOptions two = one;
  two.threads = 2;
  const Diagnosis a = diagnose(*experiment, one), b = diagnose(*experiment, two);
  ASSERT_EQ(a.causes.ranked.size(), b.causes.ranked.size());
  for (std::size_t i = 0; i < a.causes.ranked.size(); ++i) {
    EXPECT_EQ(a.causes.ranked[i].name(), b.causes.ranked[i].name());
    EXPECT_EQ(a.causes.ranked[i].probability, b.causes.ranked[i].probability);
  }
  EXPECT_EQ(a.gap.p_value, b.gap.p_value);
  EXPECT_EQ(a.shrinkage.measures[0].with_effect, b.shrinkage.measures[0].with_effect);
}

TEST(Diagnosis, RefusesOptionsOutOfRange) {
  const auto experiment = data({}, 27);
  DiagnosisOptions options;
  options.folds = 1;
  EXPECT_THROW(diagnose(*experiment, options), std::invalid_argument);
  options = {};
  options.catalogue = {"air_drag", "gravity_waves"};
  EXPECT_NE(message_of([&] { diagnose(*experiment, options); }).find("gravity_waves"), std::string::npos);
  options = {};
  options.level = 0;
  EXPECT_THROW(diagnose(*experiment, options), std::invalid_argument);
}

// Has a slope and a bend that its first nuisance makes, in two places: near 0 too little of them, near 5 what the data
// hold. Only the effect knows of that place.
class TwoOptima : public test::Line {
 public:
  using Line::Line;
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    const double near = std::exp(-n[0] * n[0]), far = std::exp(-(n[0] - 5) * (n[0] - 5));
    const double added = terms.empty() ? 0 : terms.front().values.front();
    Evaluation e;
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const double w = w_[i], mean = 3 + (0.2 * near + 0.8 * far + added) * w + 0.4 * far * w * w;
      const double z = (y_[i] - mean) / std::exp(n[1]);
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z - 0.91893853320467274 - n[1]);
      e.unit.push_back(std::exp(n[1]));
    }
    return e;
  }
  std::vector<FitStart> starts(std::span<const EffectTerm> terms) const override {
    if (terms.empty()) return {};
    return {{{5, -0.7}, {{0.0}}}};
  }
};

// What an effect gains by another optimum of the nuisances is not its own. (Two free runs of a drum differed by a
// sensor's bias for it.)
// An effect gains millions where the speeds are exact to their digits. Other leg lengths close the whole gap here, and
// a larger noise of the sensor closes 99.999 % of it: the legs must be named, and not the noise.
TEST(Diagnosis, NamesLegsWhereSpeedsAreExact) {
  const std::vector<double> lengths{0.1520, 0.1521, 0.1521, 0.1510, 0.1517, 0.1507, 0.1526, 0.1529};
  const Experiment experiment = in_laboratory({.effects = {{"leg_lengths", lengths}}, .seed = 7});
  DiagnosisOptions options = quick();
  options.catalogue = {"leg_lengths", "sensor_noise", "hub_eccentricity", "leg_contact"};
  const Diagnosis d = decided(*wheel_transitions(experiment), options);
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"leg_lengths"});
}

// Eight leg lengths can imitate an eccentric hub closely. The diagnosis must name the drag and the hub, which were
// added, and no leg.
TEST(Diagnosis, NamesADragBesideAnEccentricHub) {
  const Experiment experiment = in_laboratory(
      {.effects = {{"air_drag", {0.0012}}, {"hub_eccentricity", {0.002, 1.5}}}, .sensor_noise = 0.008, .seed = 9});
  DiagnosisOptions options = quick();
  options.catalogue = {"leg_lengths", "sensor_noise", "hub_eccentricity", "air_drag", "slope_offset", "leg_contact"};
  const Diagnosis d = decided(*wheel_transitions(experiment), options);
  EXPECT_EQ(d.verdict, Verdict::explained);
  EXPECT_EQ(d.causes.set, std::vector<std::string>{"air_drag+hub_eccentricity"});
}

// The catalogue lists some ends of a sag, and this sag ends between two of them. The diagnosis must find its end and
// its depth.
TEST(Diagnosis, FindsWhereASagEnds) {
  const Experiment experiment =
      in_laboratory({.effects = {{"slope_profile", {-0.0055, 0, 1.83}}}, .sensor_noise = 0.008, .seed = 7});
  DiagnosisOptions options = quick();
  options.catalogue = {"slope_profile", "leg_lengths", "air_drag", "sensor_noise"};
  const Diagnosis d = decided(*wheel_transitions(experiment), options);
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_EQ(d.causes.set, std::vector<std::string>{"slope_profile"});
  const auto& found = d.causes.ranked[0].parameters[0];
  ASSERT_EQ(found[2].name, "to_m");
  EXPECT_NEAR(found[0].value, -0.0055, 0.0001);
  EXPECT_NEAR(found[2].value, 1.83, 0.02);
}

TEST(Diagnosis, AnEffectGainsNothingByAnotherOptimum) {
  const test::Line straight = test::line(0.8, 5);
  const Evaluation here = straight.evaluate(std::vector<double>{0, 0}, {});
  std::vector<double> y, w;
  for (std::size_t i = 0; i < here.score.size(); ++i) {
    w.push_back(straight.events()[i].speed);
    y.push_back(here.score[i] + 0.4 * w.back() * w.back());
  }
  const Diagnosis d = decided(TwoOptima(y, w), quick());
  EXPECT_EQ(d.verdict, Verdict::recalibrate);
  EXPECT_GT(d.gap.p_value, 0.05);
  for (const Cause& cause : d.causes.ranked) EXPECT_LT(cause.gain, 8) << cause.name();
}

// The second system is a rotor with a torque that its nominal losses lack.
TEST(Diagnosis, NamesTheTorqueOnARotor) {
  const auto design = coast_down_transitions(test::coasting_rotor());
  const auto dragged =
      design->simulate(nominal_values(*design), std::vector{term(*design, "rolling_resistance", {}, {0.02})}, 5);
  const Diagnosis d = diagnose(*dragged, quick());
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_FALSE(d.causes.ranked.empty());
  EXPECT_EQ(d.causes.ranked[0].name(), "rolling_resistance");
  EXPECT_NEAR(d.causes.ranked[0].parameters[0][0].value, 0.02, 0.002);
  const Diagnosis none = decided(*design->simulate(nominal_values(*design), {}, 6), quick());
  EXPECT_EQ(none.verdict, Verdict::no_gap);
}

}  // namespace
}  // namespace metastable::analysis
