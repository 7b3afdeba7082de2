#pragma once
// Weighs the hypotheses, and that it is none of them, to a verdict.

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

/// Holds the best hypothesis and what speaks against it.
struct Chosen {
  const Fit* fit = nullptr;  ///< the recalibrated model where no hypothesis is worth having
  double none = 0;           ///< odds that it is none of the catalogue
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
                           double none);

/// Sets verdict, set, and what of it acts alike. A name is given only where the effects together are four times as
/// likely as none of them; of too few trials (trials_to_explain) neither an effect nor a recalibration is named: where
/// they have a gap it is unexplained. @param none  odds of none of the effects to all of them
void give_verdict(Diagnosis& d, bool gap, double none, double share_of_effects);

}  // namespace metastable::analysis
