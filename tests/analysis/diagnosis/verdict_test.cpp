#include "analysis/diagnosis/verdict.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/diagnosis/not_possible.h"

namespace metastable::analysis {
namespace {

Diagnosis::Data enough_data() {
  Diagnosis::Data data;
  data.trials = 50;
  data.collisions = 500;
  return data;
}

// Gives the verdict on causes with their probabilities; the rest is recalibration's.
Diagnosis judged(std::vector<Cause> ranked, const Odds& unnamed, const Tested& tested, const Diagnosis::Data& data,
                 const std::vector<Detectability>& visible = {}) {
  Diagnosis d;
  d.data = data;
  Probabilities probabilities;
  probabilities.none = unnamed.alone * ranked.front().probability;
  probabilities.ranked = std::move(ranked);
  Named named = give_verdict(probabilities, unnamed, tested, visible, data, "contact_distribution", d.rules);
  d.verdict = named.verdict;
  d.causes.ranked = std::move(probabilities.ranked);
  d.causes.p_none = probabilities.none;
  d.causes.set = std::move(named.set);
  d.causes.alike = std::move(named.alike);
  d.causes.at_work = std::move(named.at_work);
  d.causes.p_unnamed = named.p_unnamed;
  return d;
}

Cause patch_with(double probability) {
  Cause cause;
  cause.effects = {"friction_patch"};
  cause.parameters.emplace_back();
  cause.probability = probability;
  return cause;
}

constexpr Tested a_gap{true, false};

// One effect, and something without a name.
Diagnosis with_odds_of_none(double none) {
  return judged({patch_with(0.9 / (1 + none))}, {none, 0, 0}, a_gap, enough_data());
}

TEST(Verdict, ANameIsGivenWhereItIsFourTimesAsLikelyAsNone) {
  EXPECT_EQ(with_odds_of_none(0.2).verdict, Verdict::explained);
  EXPECT_EQ(with_odds_of_none(0.2).causes.set, std::vector<std::string>{"friction_patch"});
  EXPECT_EQ(with_odds_of_none(0.3).verdict, Verdict::unexplained);
  EXPECT_TRUE(with_odds_of_none(0.3).causes.set.empty());
}

// What has no name beside an effect takes nothing from it: both are said. In its place it takes the name.
TEST(Verdict, AnEffectBesideSomethingUnnamedExplainsAPart) {
  const auto with = [](Odds unnamed) { return judged({patch_with(0.9)}, unnamed, a_gap, enough_data()); };
  const Diagnosis beside = with({0.01, 5, 0});
  EXPECT_EQ(beside.verdict, Verdict::partly_explained);
  ASSERT_EQ(beside.causes.at_work.size(), 1u);
  EXPECT_EQ(beside.causes.at_work[0].effects, std::vector<std::string>{"friction_patch"});
  EXPECT_NEAR(beside.causes.at_work[0].probability, 2 / 2.01, 1e-12);
  EXPECT_NEAR(beside.causes.p_unnamed, 5.01 / 6.01, 1e-12);
  EXPECT_EQ(sentences(beside)[0], "There is a gap that recalibration does not remove, and part of it has a name.");
  // A test that finds something left speaks for something beside, and not for what leaves it.
  EXPECT_EQ(with({0.01, 0, 1e6}).verdict, Verdict::partly_explained);
  EXPECT_NEAR(with({0.01, 0, 1e6}).causes.at_work[0].probability, 1 / 1.01, 1e-12);
  EXPECT_EQ(with({5, 0, 1e6}).verdict, Verdict::unexplained);
  EXPECT_EQ(with({5, 0.01, 0}).verdict, Verdict::unexplained);
  EXPECT_TRUE(with({5, 0.01, 0}).causes.set.empty());
  EXPECT_EQ(with({0.01, 0.01, 0}).verdict, Verdict::explained);
}

// Below so many trials, or transitions in all, neither an effect nor other contact parameters are named, and the answer
// says how many would do.
TEST(Verdict, TooFewTrialsAreNotExplained) {
  for (const auto& [trials, collisions, would_do] :
       {std::tuple<std::size_t, std::size_t, std::size_t>{2, 2, Rules::least_transitions_to_explain},
        {Rules::least_trials_to_explain - 1, 500, Rules::least_trials_to_explain},
        {10, Rules::least_transitions_to_explain - 1, 11}}) {
    SCOPED_TRACE(trials);
    for (const bool gap : {true, false}) {
      Diagnosis::Data few;
      few.trials = trials;
      few.collisions = collisions;
      const Diagnosis d = judged({patch_with(0.9)}, {0.01, 0, 0}, {gap, true}, few);
      EXPECT_EQ(d.verdict, Verdict::unexplained);
      EXPECT_TRUE(d.causes.set.empty());
      ASSERT_TRUE(trials_to_explain(few));
      EXPECT_EQ(*trials_to_explain(few), would_do);
      EXPECT_NE(sentences(d)[0].find("too few to say what causes it: " + std::to_string(would_do) + " trials"),
                std::string::npos)
          << sentences(d)[0];
    }
  }
  EXPECT_FALSE(trials_to_explain(enough_data()));
}

// What a likelihood leaves of data of its own is no gap.
TEST(Verdict, HeldOutACauseIsJudgedBesideWhatItsOwnModelLeaves) {
  Diagnosis::Data data;
  data.trials = 100;
  data.collisions = 4000;
  Shrinkage log_score;
  log_score.with_effect = 0.003;  // 12 nats
  log_score.with_effect_least = 0.001;
  EXPECT_TRUE(leaves_gap_held_out(log_score, data, 1, 0, Rules{}));
  EXPECT_FALSE(leaves_gap_held_out(log_score, data, 1, 0.002, Rules{}));
  EXPECT_TRUE(leaves_gap_held_out(log_score, data, 1, 0.0009, Rules{}));
}

// Something alone is likelier at first than something beside an effect: a little more evidence does not make up for it.
TEST(Verdict, SaysWhereTheLikelierOfTheUnnamedActs) {
  const auto said = [](double beside) {
    Diagnosis d = with_odds_of_none(2);
    LeftInFacet clock{.facet = "clock", .aspect = "mean friction"},
        stances{.facet = "successive stances", .aspect = "memory"};
    clock.evidence = stances.evidence = 20;
    d.causes.unnamed = {{{}, 20, {clock}}, {{"friction_patch"}, beside, {stances}}};
    return sentences(d).at(1);
  };
  EXPECT_EQ(said(21), "By itself it acts by clock, on the mean friction of steps.");
  EXPECT_EQ(said(26).substr(0, 21), "Beside friction_patch");
}

TEST(Verdict, SaysThatTheNearestIsTooUnsureForAName) {
  const auto first_sentence = [](double none) { return sentences(with_odds_of_none(none)).front(); };
  EXPECT_EQ(
      first_sentence(0.5),
      "There is a gap that recalibration does not remove. The nearest of the catalogue is friction_patch; that it "
      "is none of the catalogue has probability 0.30, too much for a name.");
  EXPECT_EQ(first_sentence(4),
            "There is a gap that no effect of the catalogue, nor several, removes: something else is at work.");
}

// A drift beside one of three, two of which the design hardly tells apart.
Diagnosis with_pairs(double share) {
  std::vector<Cause> ranked;
  for (const auto& [effects, gain, probability] :
       {std::tuple{std::vector<std::string>{"trial_drift", "inertia"}, 100.0, 0.5},
        {std::vector<std::string>{"slope_offset", "trial_drift"}, 99.0, 0.3},
        {std::vector<std::string>{"trial_drift", "bounce"}, 97.0, 0.15},
        {std::vector<std::string>{"trial_drift"}, 60.0, 0.0}}) {
    Cause cause;
    cause.effects = effects;
    cause.parameters.resize(effects.size());
    cause.gain = gain;
    cause.probability = probability;
    ranked.push_back(cause);
  }
  Detectability seen;
  seen.effect = "inertia";
  seen.alike = {{"slope_offset", share}, {"bounce", 0.6}};
  return judged(std::move(ranked), {}, a_gap, enough_data(), {seen});
}

TEST(Verdict, PairsAreAlikeWhereWhatTheyDoNotShareIs) {
  // What inertia gains beside the drift is 40: a hundredth of it tells nothing apart, four tenths of it do.
  EXPECT_EQ(with_pairs(0.99).causes.alike,
            (std::vector<std::string>{"trial_drift+inertia", "slope_offset+trial_drift"}));
  EXPECT_TRUE(with_pairs(0.8).causes.alike.empty());
  EXPECT_EQ(sentences(with_pairs(0.99)).front(),
            "There is a gap that recalibration does not remove. These data cannot tell 3 causes apart: inertia or "
            "slope_offset (alike in these trials) beside trial_drift, trial_drift+bounce.");
}

// Where something without a name stays only effects that the field calls by one name stand together: a torque is at
// work, whichever it is, but not one of two rivals that have nothing in common. Where nothing stays one of those is.
TEST(AtWork, OfOneNameAreOneGroup) {
  const auto with = [](const std::string& rival, double unnamed = 1e6) {
    std::vector<Cause> ranked(2);
    ranked[0].effects = {"bounce", "slope_offset"};
    ranked[1].effects = {"bounce", rival};
    for (Cause& cause : ranked) {
      cause.probability = &cause == ranked.data() ? 0.6 : 0.39;
      cause.parameters.resize(2);
    }
    Diagnosis::Data data = enough_data();
    data.groups = {{"a constant torque", {"slope_offset", "rolling_resistance"}}};
    return judged(ranked, {0, 0, unnamed}, a_gap, data).causes.at_work;
  };
  const std::vector<AtWork> torque = with("rolling_resistance");
  ASSERT_EQ(torque.size(), 2u);
  EXPECT_EQ(torque[1].name, "a constant torque");
  EXPECT_GT(torque[1].probability, 0.9);
  EXPECT_LT(with("trial_drift")[1].probability, 0.7);
  EXPECT_EQ(with("trial_drift", 0)[1].effects, (std::vector<std::string>{"slope_offset", "trial_drift"}));
}

// Rivals of which none is likely enough by itself, and which a design would tell apart, are at work as a group: the gap
// is explained by one of them. Where a gap itself is too unsure for that it is not explained.
TEST(AtWork, RivalsAreAGroupWhereNoneIsLikelyByItself) {
  const auto cause = [](const std::string& effect, double probability) {
    Cause one;
    one.effects = {effect};
    one.probability = probability;
    one.parameters.resize(1);
    return one;
  };
  const Diagnosis d =
      judged({cause("inertia", 0.5), cause("bounce", 0.35), cause("trial_drift", 0.14)}, {}, a_gap, enough_data());
  EXPECT_EQ(d.verdict, Verdict::explained);
  ASSERT_EQ(d.causes.at_work.size(), 2u);
  EXPECT_EQ(d.causes.at_work[0].effects, (std::vector<std::string>{"inertia", "bounce"}));
  EXPECT_NEAR(d.causes.at_work[0].probability, 0.85 / 0.99, 1e-12);
  EXPECT_EQ(d.causes.at_work[1].effects, std::vector<std::string>{"trial_drift"});

  Probabilities unsure;
  unsure.ranked = {cause("inertia", 0.4), cause("bounce", 0.3)};
  unsure.recalibrate = 0.3;
  const Named named = give_verdict(unsure, {}, a_gap, {}, enough_data(), "contact_distribution", Rules{});
  EXPECT_EQ(named.verdict, Verdict::unexplained);
  EXPECT_TRUE(named.set.empty());
}

// An interval that reaches further up than down stays so, alone and averaged over hypotheses that say the same; where
// they differ, their mean is between them and its interval holds both, and ends where the farthest of them does.
TEST(AtWork, IntervalsAreAsWideOnEitherSideAsTheirHypothesesSay) {
  const auto cause = [](std::vector<std::string> effects, double probability, double value) {
    Cause one;
    one.effects = std::move(effects);
    one.probability = probability;
    one.parameters.resize(one.effects.size());
    one.parameters[0] = {{"friction_ratio", value, value - 0.1, value + 0.4}};
    return one;
  };
  const auto said = [](const std::vector<Cause>& causes) {
    return judged(causes, {0, 0, 0}, a_gap, enough_data()).causes.at_work.at(0).parameters.at(0);
  };
  for (const EstimatedParameter& same :
       {said({cause({"friction_patch"}, 0.98, 1.3)}),
        said({cause({"friction_patch"}, 0.7, 1.3), cause({"friction_patch", "bounce"}, 0.28, 1.3)})}) {
    EXPECT_NEAR(same.value, 1.3, 1e-12);
    EXPECT_NEAR(same.lower, 1.2, 1e-9);
    EXPECT_NEAR(same.upper, 1.7, 1e-9);
  }
  const EstimatedParameter apart =
      said({cause({"friction_patch"}, 0.49, 1.3), cause({"friction_patch", "bounce"}, 0.49, 2.3)});
  EXPECT_NEAR(apart.value, 1.8, 1e-12);
  EXPECT_NEAR(apart.lower, 1.2, 1e-9);
  EXPECT_GT(apart.upper, 2.5);
  EXPECT_LE(apart.upper, 2.7 + 1e-9);
}

AtWork closing(std::vector<std::string> effects, const Estimate& beside) {
  AtWork one;
  one.effects = std::move(effects);
  one.closes_beside = beside;
  return one;
}

// An effect that closes 1 to 3 % beside the others is doubted where 12 % of the gap stays at least; one that closes 7
// to 17 % is not.
TEST(DoubtedEffects, CloseClearlyLessThanWhatStays) {
  AtWork unknown;
  unknown.effects = {"bounce"};
  const std::map<std::string, double> doubted =
      doubted_effects({closing({"slope_profile", "hub_eccentricity"}, {0.02, 0.01, 0.03}),
                       closing({"leg_contact"}, {0.12, 0.07, 0.17}), unknown},
                      {0.12, 0}, {});
  EXPECT_EQ(doubted, (std::map<std::string, double>{{"slope_profile", 0.5}, {"hub_eccentricity", 0.5}}));
}

// A noise without another form is doubted where something surely stays, and only there.
TEST(DoubtedEffects, HaveNoOtherForm) {
  const std::vector<AtWork> at_work = {closing({"sensor_noise"}, {0.7, 0.66, 0.74})};
  EXPECT_TRUE(doubted_effects(at_work, {0, -0.01}, {"sensor_noise"}).empty());
  EXPECT_TRUE(doubted_effects(at_work, {0, 0.01}, {"slope_offset"}).empty());
  EXPECT_EQ(doubted_effects(at_work, {0, 0.01}, {"sensor_noise"}).at("sensor_noise"), 0.5);
}

}  // namespace
}  // namespace metastable::analysis
