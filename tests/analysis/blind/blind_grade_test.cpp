#include "analysis/blind/blind_grade.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>

namespace metastable::analysis::test {
namespace {

// These are by Brown, Cai and DasGupta (2001), Statist. Sci. 16, eq. (4), computed by hand for 0 and 8 of 10.
TEST(BlindGrade, WilsonIntervals) {
  const auto [a, b] = wilson({0, 10});
  EXPECT_NEAR(a, 0, 1e-12);
  EXPECT_NEAR(b, 0.27753, 1e-5);
  const auto [c, d] = wilson({8, 10});
  EXPECT_NEAR(c, 0.49016, 1e-5);
  EXPECT_NEAR(d, 0.94332, 1e-5);
  EXPECT_EQ(wilson({0, 0}), std::pair(0.0, 1.0));
}

BlindTruth truth(BlindKind kind, const std::vector<std::string>& ids, int strength) {
  const dynamics::NominalValues stated{0.5, 0.05, 0.35, 0.04, dynamics::paper_leg_lengths()};
  BlindTruth t;
  t.kind = kind;
  t.strength = strength;
  t.power = t.left = 64;
  for (const std::string& id : ids) t.effects.push_back(dynamics::effect_from_values(id, {}, stated));
  if (kind == BlindKind::outside) t.outside = {"planks", 0.3};
  return t;
}

BlindAnswer said(Verdict verdict, const std::vector<std::string>& set = {}, double probability = 0.95) {
  BlindAnswer a;
  a.verdict = verdict;
  a.cause_set = set;
  for (const std::string& name : set) a.causes.emplace_back(name, probability);
  return a;
}

Proportion of(const BlindGrades& grades, const std::string& measure) {
  for (const Grade& grade : grades.grades)
    if (grade.measure == measure) return grade.proportion;
  ADD_FAILURE() << measure;
  return {};
}

void expect(const BlindGrades& grades, const std::string& measure, int right, int all) {
  EXPECT_EQ(of(grades, measure).right, right) << measure;
  EXPECT_EQ(of(grades, measure).of, all) << measure;
}

TEST(BlindGrade, FalseAlarms) {
  BlindTruth exact = truth(BlindKind::none, {}, 0), unlike = exact;
  unlike.nominal_is_true = false;
  BlindAnswer placed = said(Verdict::no_gap);
  placed.where.push_back({"leg", "mean", 0.01});
  const BlindGrades g = grade({exact, exact, exact, unlike, unlike, unlike},
                              {placed, said(Verdict::recalibrate), std::nullopt, said(Verdict::recalibrate),
                               said(Verdict::no_gap), said(Verdict::explained, {"bounce"})});
  expect(g, "false alarms where there is no gap", 3, 6);
  expect(g, "  nominal contact true", 2, 3);
  expect(g, "  nominal contact not true", 1, 3);
  expect(g, "where: claims in cases without a gap", 2, 6);
}

TEST(BlindGrade, EffectsFoundAndNamed) {
  BlindTruth leg = truth(BlindKind::effect, {"leg_contact"}, 2), absorbed = truth(BlindKind::effect, {"bounce"}, 2);
  absorbed.left = 1;
  BlindAnswer right = said(Verdict::explained, {"leg_contact"});
  right.where.push_back({"leg", "mean", 0.001});
  right.parameters.push_back({"leg_contact", "friction_ratio", 1.01, 0.98, 1.04});
  right.closed_lower = 0.9, right.closed_upper = 1.0;
  const BlindGrades g =
      grade({leg, leg, leg, leg, absorbed, absorbed},
            {right, said(Verdict::explained, {"leg_lengths", "leg_contact"}), said(Verdict::explained, {"inertia"}),
             said(Verdict::no_gap), said(Verdict::recalibrate), said(Verdict::explained, {"inertia"})});
  expect(g, "effect found, 2x", 5, 6);
  expect(g, "effect with power left found after recalibration, 2x", 3, 4);
  expect(g, "cause right up to stated ambiguity, 2x", 2, 3);
  expect(g, "95 % set holds the truth, 2x", 2, 4);
  expect(g, "where: right facet, 2x", 1, 4);
  expect(g, "effect absorbed by recalibration not blamed on another", 1, 2);
  expect(g, "90 % intervals of effect size hold the truth", 1, 1);
  expect(g, "90 % intervals of shrinkage hold the truth", 1, 1);
  EXPECT_EQ(g.mean_set_size_2x, 1.25);
  // Of four explained answers the first cause has probability 0.95 and is right once.
  EXPECT_EQ(g.calibration.back().right.of, 4);
  EXPECT_EQ(g.calibration.back().right.right, 1);
  EXPECT_NEAR(g.calibration.back().mean_probability, 0.95, 1e-12);
  EXPECT_EQ(g.confusion.at("leg_contact").at("no_gap"), 1);
  EXPECT_EQ(g.alike.at("leg_contact"), (std::vector<std::string>{"inertia", "leg_lengths"}));
}

TEST(BlindGrade, PairsOutsideAndLeftOut) {
  BlindTruth pair = truth(BlindKind::pair, {"inertia", "trial_drift"}, 2), hidden = pair;
  pair.left_by_effect = {30, 40};
  hidden.left_by_effect = {1, 60};  // recalibration takes up the first
  const BlindTruth outside = truth(BlindKind::outside, {}, 2), left = truth(BlindKind::left_out, {"leg_contact"}, 2);
  BlindTruth nothing_left = outside;
  nothing_left.left = 8;
  const BlindTruth full = truth(BlindKind::effect, {"leg_contact"}, 2);
  const BlindGrades g =
      grade({pair, pair, hidden, pair, outside, nothing_left, outside, left, left, left, full},
            {said(Verdict::explained, {"trial_drift+inertia"}), said(Verdict::explained, {"inertia"}),
             said(Verdict::explained, {"inertia+bounce"}),
             said(Verdict::explained, {"bounce+inertia", "inertia+trial_drift"}), said(Verdict::unexplained),
             said(Verdict::explained, {"bounce"}), said(Verdict::explained, {"bounce", "inertia"}),
             said(Verdict::unexplained), said(Verdict::explained, {"leg_lengths"}),
             said(Verdict::explained, {"bounce"}), said(Verdict::explained, {"leg_contact", "leg_lengths"})});
  expect(g, "two effects: both named", 2, 4);
  expect(g, "  each with power left beside the other", 2, 3);
  expect(g, "two effects: no false third, up to stated ambiguity", 3, 4);
  expect(g, "  in the first of the set", 2, 4);
  expect(g, "  in the first of the set, or what is alike to it", 2, 4);
  expect(g, "effect outside the catalogue confidently misnamed", 1, 3);
  expect(g, "effect outside the catalogue called unexplained", 1, 3);
  expect(g, "  with power left for who knows it", 1, 2);
  // leg_lengths shares the sets of leg_contact in this run: it is its own ambiguity group.
  expect(g, "left-out effect confidently misnamed", 1, 3);
  expect(g, "left-out effect unexplained, or of its ambiguity group", 2, 3);
}

TEST(BlindGrade, WhatIsAlikeToTheFirstIsNoFalseThird) {
  const BlindTruth pair = truth(BlindKind::pair, {"inertia", "trial_drift"}, 2);
  BlindAnswer grouped = said(Verdict::explained, {"slope_offset+trial_drift", "inertia+trial_drift"});
  const BlindAnswer plain = grouped;
  grouped.alike = grouped.cause_set;
  const BlindGrades g = grade({pair, pair}, {grouped, plain});
  expect(g, "  in the first of the set", 0, 2);
  expect(g, "  in the first of the set, or what is alike to it", 1, 2);
}

TEST(BlindGrade, StepwiseSelectionIsSetBesideTheDiagnosis) {
  const auto with = [](BlindAnswer a, std::vector<std::string> aicc, std::vector<std::string> bic) {
    a.stepwise = {{"AICc", std::move(aicc)}, {"BIC", std::move(bic)}};
    return a;
  };
  const BlindGrades g =
      grade({truth(BlindKind::none, {}, 0), truth(BlindKind::effect, {"bounce"}, 2),
             truth(BlindKind::pair, {"bounce", "inertia"}, 2), truth(BlindKind::outside, {}, 2)},
            {with(said(Verdict::no_gap), {"air_drag"}, {}),
             with(said(Verdict::explained, {"inertia", "bounce"}), {"bounce", "air_drag"}, {"bounce"}),
             with(said(Verdict::explained, {"bounce+inertia"}), {"air_drag", "inertia"}, {"inertia"}),
             with(said(Verdict::unexplained), {"bounce"}, {"bounce"})});
  ASSERT_EQ(g.ways.size(), 3U);
  const WayGrade &own = g.ways[0], &aicc = g.ways[1], &bic = g.ways[2];
  EXPECT_EQ(aicc.way + bic.way, "AICcBIC");
  const auto counts = [](const WayGrade& w) {
    return std::vector<int>{w.alarms.right, w.exact.right, w.in.right,     w.wrong.right,
                            w.both.right,   w.third.right, w.outside.right};
  };
  EXPECT_EQ(counts(own), (std::vector<int>{0, 0, 0, 1, 1, 0, 0}));
  EXPECT_EQ(counts(aicc), (std::vector<int>{1, 0, 1, 1, 0, 1, 1}));
  EXPECT_EQ(counts(bic), (std::vector<int>{0, 1, 1, 0, 0, 0, 1}));
}

TEST(BlindGrade, ACriterionThatAnAnswerDoesNotTellOfNamesNothingThere) {
  BlindAnswer tells = said(Verdict::explained, {"bounce"});
  tells.stepwise = {{"Gauss-Newton BIC", {"bounce"}}};
  const BlindTruth one = truth(BlindKind::effect, {"bounce"}, 2);
  const BlindGrades g = grade({one, one}, {tells, said(Verdict::explained, {"bounce"})});
  ASSERT_EQ(g.ways.size(), 2U);
  EXPECT_EQ(g.ways[0].in.right, 2);
  EXPECT_EQ(g.ways[1].way, "Gauss-Newton BIC");
  EXPECT_EQ(g.ways[1].in.right, 1);
  EXPECT_EQ(g.ways[1].in.of, 2);
}

TEST(BlindGrade, ThreeEffectsAreCountedAsThree) {
  const BlindTruth three = truth(BlindKind::many, {"bounce", "inertia", "trial_drift"}, 2);
  const BlindGrades g = grade({three, three}, {said(Verdict::explained, {"inertia+bounce+trial_drift"}),
                                               said(Verdict::explained, {"inertia+bounce"})});
  EXPECT_EQ(g.ways[0].three.right, 1);
  EXPECT_EQ(g.ways[0].two_of_three.right, 2);
}

TEST(BlindGrade, AnswersMustBeAsManyAsTruths) { EXPECT_THROW(grade({BlindTruth{}}, {}), std::invalid_argument); }

// Counts of 300 rests in 30,000 collisions are 100 expected steps, 91 to 110 of them by chance (90 %); intervals are as
// wide as their ends' ratio.
TEST(BlindGrade, ExpectedSteps) {
  BlindTruth known = truth(BlindKind::none, {}, 0), unknown = known;
  known.collisions_counted = 30000;
  known.rests_counted = 300;
  unknown.collisions_counted = 20000;
  unknown.rests_counted = 3;
  BlindAnswer holds = said(Verdict::no_gap), misses = holds, open = holds, silent = holds;
  holds.steps = {80, 130};
  holds.steps_counted = {60, 150};
  misses.steps = {107, 130};
  misses.steps_counted = {95, 120};
  BlindAnswer beside = holds;
  beside.steps = {101, 130};  // It lies as far beside the count as this errs.
  beside.steps_counted.reset();
  open.steps = {90, std::numeric_limits<double>::infinity()};
  const BlindGrades g =
      grade({known, known, known, known, known, unknown}, {holds, misses, beside, open, silent, holds});
  expect(g, "expected steps of the machine: 90 % intervals hold", 3, 4);
  expect(g, "  as narrow as twice the trials would count them, nothing outside the catalogue", 1, 2);
}

// A pair of which one closes a third alone and a sixth beside the other; one is told by a group, which has no share of
// its own.
TEST(BlindGrade, SharesThatEffectsClose) {
  BlindTruth pair = truth(BlindKind::pair, {"bounce", "inertia"}, 2);
  pair.gap_as_given = GapAsGiven{300, {100, 250}, {50, 200}};
  BlindAnswer one = said(Verdict::explained, {"bounce+inertia"}), group = one, doubted = one;
  one.at_work = {{{"bounce"}, 0.9, std::pair{0.3, 0.35}, std::pair{0.2, 0.3}},
                 {{"inertia"}, 1, std::pair{0.8, 0.9}, std::nullopt},
                 {{"air_drag"}, 1, std::pair{0.0, 1.0}, std::pair{0.0, 1.0}}};
  group.at_work = {{{"bounce", "air_drag"}, 1, std::pair{0.0, 1.0}, std::pair{0.0, 1.0}}};
  doubted.at_work = {{{"bounce"}, 0.7, std::pair{0.0, 1.0}, std::pair{0.0, 1.0}}};
  const BlindGrades g = grade({pair, pair, pair, truth(BlindKind::none, {}, 0)}, {one, group, doubted, one});
  expect(g, "shares of the gap that effects close alone: 90 % intervals hold", 2, 2);
  expect(g, "  beside the others", 0, 1);
}

}  // namespace
}  // namespace metastable::analysis::test
