#include "analysis/fitting/effect_sets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/stepwise.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::Line;
using test::line;

// A line with six effects, waves of six frequencies, of which the first `at_work` are there with an amplitude of 0.2
// noises.
class Waves : public Line {
 public:
  Waves(const Line& from, std::size_t at_work) : Line(from) {
    const Candidate wave = candidates_[0];
    candidates_.assign(6, wave);
    for (std::size_t k = 0; k < candidates_.size(); ++k) {
      candidates_[k].id = "wave " + std::to_string(k);
      if (k < at_work)
        for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += 0.2 * at(k, i);
    }
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e = Line::evaluate(n, {});
    for (std::size_t i = 0; i < e.score.size(); ++i) {
      for (const EffectTerm& term : terms)
        e.score[i] -=
            term.values[0] / std::exp(n[1]) * at(static_cast<std::size_t>(term.candidate->id.back() - '0'), i);
      e.log_density[i] = -0.5 * e.score[i] * e.score[i] - 0.91893853320467274 - n[1];
    }
    return e;
  }

 private:
  static double at(std::size_t wave, std::size_t i) {
    return std::sin((1.3 + 0.7 * static_cast<double>(wave)) * static_cast<double>(i));
  }
};

CauseRanking ranked(const Waves& model) {
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : model.candidates()) candidates.push_back(&candidate);
  return rank_causes(model, fit(model, {0, 0}, {}), candidates,
                     {.threads = 1, .draws = 300, .seed = 1, .progress = {}});
}

std::set<std::string> best_of(const CauseRanking& ranking) {
  const RankedCause* best = &ranking.singles.front();
  for (const auto* all : {&ranking.singles, &ranking.pairs, &ranking.sets})
    for (const RankedCause& one : *all)
      if (one.evidence > best->evidence) best = &one;
  std::set<std::string> ids;
  for (const EffectTerm& term : best->terms) ids.insert(term.candidate->id);
  return ids;
}

// Returns the hypothesis of just these effects; nullptr, which is a failure, where it was not tried.
const RankedCause* find_set(const std::vector<RankedCause>& all, const std::set<std::string>& wanted) {
  for (const RankedCause& one : all) {
    std::set<std::string> ids;
    for (const EffectTerm& term : one.terms) ids.insert(term.candidate->id);
    if (ids == wanted) return &one;
  }
  ADD_FAILURE() << "a set was not tried";
  return nullptr;
}

TEST(EffectSets, NameAsManyEffectsAsAreThere) {
  const Line noise = line(0, 1, 2400);
  const std::set<std::string> two{"wave 0", "wave 1"}, three{"wave 0", "wave 1", "wave 2"},
      four{"wave 0", "wave 1", "wave 2", "wave 3"}, five{"wave 0", "wave 1", "wave 2", "wave 3", "wave 4"};
  EXPECT_EQ(best_of(ranked(Waves(noise, 2))), two);
  EXPECT_EQ(best_of(ranked(Waves(noise, 3))), three);
  EXPECT_EQ(best_of(ranked(Waves(noise, 4))), four);
  EXPECT_EQ(best_of(ranked(Waves(noise, 5))), five);
}

// Forward selection goes on from pairs to larger sets, as far as the ranking fitted them.
TEST(EffectSets, StepwiseSelectionGoesOnToThree) {
  const Waves model(line(0, 1, 2400), 3);
  for (const StepwiseChoice& choice : stepwise_selection(model, fit(model, {0, 0}, {}), ranked(model)))
    for (const char* wave : {"wave 0", "wave 1", "wave 2"})
      EXPECT_TRUE(std::ranges::find(choice.effects, wave) != choice.effects.end()) << choice.criterion << wave;
}

// The search also tries the sets of four that a set of five holds, whatever led it there.
TEST(EffectSets, HoldWhatStaysWithoutEachEffectOfALargerOne) {
  constexpr std::size_t at_work = 5;
  const Waves model(line(0, 1, 2400), at_work);
  const CauseRanking ranking = ranked(model);
  for (std::size_t without = 0; without < at_work; ++without) {
    std::set<std::string> part;
    for (std::size_t k = 0; k < at_work; ++k)
      if (k != without) part.insert("wave " + std::to_string(k));
    const RankedCause* found = find_set(ranking.sets, part);
    EXPECT_TRUE(found && std::isfinite(found->evidence)) << without;
  }
}

// Effects that are independent of one another gain together what they gain alone.
TEST(EffectSets, IndependentEffectsGainTogetherWhatTheyGainAlone) {
  const CauseRanking ranking = ranked(Waves(line(0, 1, 2400), 3));
  ASSERT_FALSE(ranking.sets.empty());
  for (const RankedCause& set : ranking.sets) EXPECT_NEAR(set.together, 1, 0.1) << set.terms.size();
}

// A line with the waves 0, 1 and 2, of which wave 5 is nearly wave 0.
class AlikeWaves : public Waves {
 public:
  using Waves::Waves;
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    std::vector<EffectTerm> seen(terms.begin(), terms.end());
    for (std::size_t k = 0; k < terms.size(); ++k)
      if (terms[k].candidate->id == "wave 5") {
        EffectTerm most = terms[k];
        most.candidate = &candidates_[0];
        most.values[0] *= 0.98;
        seen[k].values[0] *= 0.2;
        seen.push_back(std::move(most));
      }
    return Waves::evaluate(n, seen);
  }
};

// The two are told apart by a gain of four, so that both may be the one at work, whichever the search met first.
TEST(EffectSets, HoldWhatActsLikeOneOfThem) {
  const AlikeWaves model(line(0, 1, 2400), 3);
  const CauseRanking ranking = ranked(model);
  const RankedCause *first = find_set(ranking.sets, {"wave 0", "wave 1", "wave 2"}),
                    *other = find_set(ranking.sets, {"wave 5", "wave 1", "wave 2"});
  ASSERT_TRUE(first && other);
  EXPECT_NEAR(first->evidence, other->evidence, 6);
}

// Two waves are at work, of which wave 0 is large. Wave 5 has the shape of wave 0 at that size, and another shape where
// it is small.
class BentWaves : public Waves {
 public:
  explicit BentWaves(const Line& from) : Waves(from, 2) {
    for (std::size_t i = 0; i < y_.size(); ++i) y_[i] += 2.8 * std::sin(1.3 * static_cast<double>(i));
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    std::vector<EffectTerm> seen(terms.begin(), terms.end());
    for (std::size_t k = 0; k < terms.size(); ++k)
      if (terms[k].candidate->id == "wave 5") {
        EffectTerm aside = terms[k];
        seen[k].candidate = &candidates_[0], aside.candidate = &candidates_[4];
        aside.values[0] *= 0.15 * (3 - aside.values[0]);
        seen.push_back(std::move(aside));
      }
    return Waves::evaluate(n, seen);
  }
};

// The scores promise little of wave 5 beside wave 1. The pair is tried all the same, because wave 5 is as likely alone
// as wave 0.
TEST(EffectSets, PairsHoldWhatIsAsLikelyAlone) {
  const BentWaves model(line(0, 1, 2400));
  const CauseRanking ranking = ranked(model);
  const RankedCause *first = find_set(ranking.pairs, {"wave 0", "wave 1"}),
                    *other = find_set(ranking.pairs, {"wave 5", "wave 1"});
  ASSERT_TRUE(first && other);
  EXPECT_NEAR(first->gain, other->gain, 6);
}

// The order in which the search met two effects does not decide what the pair is worth: the stronger one comes first.
TEST(EffectSets, AreWorthWhatTheyEarnBeyondTheBestPart) {
  const AlikeWaves model(line(0, 1, 2400), 3);
  const CauseRanking ranking = ranked(model);
  ASSERT_FALSE(ranking.pairs.empty());
  const auto single = [&](const EffectTerm& term) -> const RankedCause& {
    return *std::ranges::find_if(ranking.singles,
                                 [&](const RankedCause& one) { return one.terms[0].candidate == term.candidate; });
  };
  for (const RankedCause& pair : ranking.pairs) {
    const RankedCause &one = single(pair.terms[0]), &other = single(pair.terms[1]),
                      &stronger = one.evidence > other.evidence ? one : other;
    if (!one.fitted() || !other.fitted()) continue;
    EXPECT_LE(pair.evidence, stronger.evidence + evidence_of_gain(pair.gain - stronger.gain, 1, Rules{}) +
                                 std::log(0.05 / 2.5) + 1e-9);
  }
}

// A fit of three effects that ended 100 below that of two of them does not inherit what these are worth, or a longer
// fit of it would be worth more than it gains.
TEST(EffectSets, AFitThatEndedBelowItsPartIsWorthLess) {
  const Waves model(line(0, 1, 2400), 2);
  const CauseRanking ranking = ranked(model);
  const auto part = std::ranges::max_element(ranking.pairs, {}, &RankedCause::evidence);
  ASSERT_NE(part, ranking.pairs.end());
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : model.candidates()) candidates.push_back(&candidate);
  const Fit recalibrated = fit(model, {0, 0}, {});
  const Rules rules;
  const RankingProblem problem{model, recalibrated, candidates, rules, 1, {}, [] {}};
  const SingleEffects singles{ranking.scan, ChanceGains(ranking.scan, 10, 1), ranking.singles, {}};
  std::vector<RankedCause> sets{*part};
  sets[0].terms.push_back(ranking.singles[5].terms[0]);
  sets[0].gain -= 100;
  bound_by_parts(problem, singles, ranking.pairs, sets);
  EXPECT_LT(sets[0].evidence, part->evidence - 50);
}

// One more effect is as likely as the rule says, whichever of the others it is.
TEST(EffectSets, TheOddsOfOneMoreAreSharedByTheOthers) {
  const Waves model(line(0, 1, 40), 0);
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : model.candidates()) candidates.push_back(&candidate);
  const Fit recalibrated;
  const Rules rules;
  const RankingProblem problem{model, recalibrated, candidates, rules, 1, {}, [] {}};
  // Six effects have 6 singles, 15 pairs and 20 sets of three: all pairs together 0.05 of all singles.
  EXPECT_NEAR(15 * std::exp(log_prior_of_one_more(problem, 2)), 0.05 * 6, 1e-12);
  EXPECT_NEAR(20 * std::exp(log_prior_of_one_more(problem, 3)), 0.05 * 15, 1e-12);
}

}  // namespace
}  // namespace metastable::analysis
