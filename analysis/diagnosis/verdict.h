#pragma once
// Weighs the hypotheses, and that it is none of them, to a verdict.

#include <algorithm>
#include <cstddef>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {

struct Fit;

inline constexpr double certain_odds = 1e6;  ///< of none, where a test decides against all that were fitted

inline constexpr double even_odds = 1;  ///< of none, where too few trials cannot tell

/// Says how likely something without a name is at first: odds to one effect where it acts alone; beside a hypothesis,
/// to the hypothesis alone.
inline constexpr double unnamed_alone = 4, unnamed_beside = 0.03;

/// Lists all hypotheses by falling evidence; those that are not decided go to the diagnosis.
std::vector<const RankedCause*> hypotheses(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking);

/// Odds of something without a name to all hypotheses of the catalogue.
struct Odds {
  double alone = 0;   ///< and none of the catalogue is at work
  double beside = 0;  ///< beside what the hypotheses name, by its evidence
  double left = 0;    ///< beside it, as tests of what the best hypothesis leaves have it, whatever that is
  double none() const { return alone + std::max(beside, left); }
  /// Returns the probability that the catalogue is at work. What tests find left does not speak for what leaves it, nor
  /// does what stands beside it by more than even odds: scores bound what something unnamed gains alone from below.
  double of_catalogue() const {
    const double with = 1 + std::min(beside, 1.0);
    return with / (with + alone);
  }
  /// Returns the probability that something without a name is, alone or beside.
  double of_unnamed() const { return (left / (1 + left) + beside + alone) / (1 + beside + alone); }
};

/// Holds the best hypothesis and what speaks against it.
struct Chosen {
  const Fit* fit = nullptr;  ///< the recalibrated model where no hypothesis is worth having
  Odds unnamed;              ///< of something else, in its place or beside it
  double bent = 1;           ///< share of its gain that an error of form may bend
};

/// Chooses the first of the hypotheses. What it leaves on the map is judged beyond its own model error; that and the
/// hypotheses beside which something without a name was supposed go to the diagnosis.
/// @param ordered  not empty, with a fit of the first
Chosen choose(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
              const std::vector<const RankedCause*>& ordered, const Fit& recalibrated, const DiagnosisOptions& options);

/// Says whether trials that the cause was not fitted to still show a gap, beyond what its form may be off.
/// @param by_itself  gap_by_itself() [nats a collision]
bool leaves_gap_held_out(const Diagnosis& d, double bent, double by_itself);

/// Shares probabilities over everything; the prior gives a gap even odds, shared by the effects. Returns the share of
/// the effects together.
double share_probabilities(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
                           const std::vector<const RankedCause*>& ordered, std::size_t candidates, bool gap,
                           const Odds& unnamed);

/// Sets verdict, set, what of it acts alike, and what is at work but for the shares it closes. An effect or a group is
/// at work from a probability of 0.8 on: the gap is explained where something without a name is less likely than 0.2,
/// else partly explained. Of too few trials (trials_to_explain) neither an effect nor a recalibration is named: where
/// they have a gap it is unexplained.
void give_verdict(Diagnosis& d, bool gap, const Odds& unnamed, double share_of_effects);

}  // namespace metastable::analysis
