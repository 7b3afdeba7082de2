#pragma once
// Weighs the hypotheses, and that it is none of them, to a verdict.

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/fitting/cause_ranking.h"

namespace metastable::analysis {

/// All hypotheses by falling evidence, and those that are not decided.
struct Hypotheses {
  std::vector<const RankedCause*> ordered;
  std::vector<Cause> not_decided;
  const RankedCause* best() const { return ordered.empty() ? nullptr : ordered.front(); }
};
/// @param ranking  it outlives the answer
Hypotheses hypotheses(const TransitionModel& model, const CauseRanking& ranking);

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
  /// Returns the probability that something without a name stands beside the catalogue where that is at work.
  double of_beside() const { return (left / (1 + left) + beside) / (1 + beside); }
  /// Returns the probability that something without a name is, alone or beside.
  double of_unnamed() const { return (left / (1 + left) + beside + alone) / (1 + beside + alone); }
};

/// The best hypothesis and what speaks against it.
struct Chosen {
  const Fit* fit = nullptr;            ///< the recalibrated model where no hypothesis is worth having
  GapMap left = {};                    ///< the map of the gap under `fit`
  std::vector<Unnamed> supposed = {};  ///< something without a name: alone, then beside the likeliest hypotheses
  Odds unnamed = {};                   ///< of something else, in its place or beside it
  double bent = 1;                     ///< share of its gain that an error of form may bend
  double together = 1;                 ///< RankedCause::together
  const Variation* same = nullptr;     ///< varies as the one effect does that is named, see same_variation()
};

/// Chooses the first of the hypotheses. What it leaves on the map is judged beyond its own model error.
/// @param ordered  not empty, with a fit of the first
/// @param alone  what the recalibrated model leaves
Chosen choose(const TransitionModel& model, const CauseRanking& ranking, const std::vector<const RankedCause*>& ordered,
              const Fit& recalibrated, Unnamed alone, const DiagnosisOptions& options);

/// Says whether trials that the cause was not fitted to still show a gap, beyond what its form may be off.
/// @param log_score  the first of the held-out measures
/// @param bent  Chosen::bent
/// @param by_itself  gap_by_itself() [nats a collision]
bool leaves_gap_held_out(const Shrinkage& log_score, const Diagnosis::Data& data, double bent, double by_itself,
                         const Rules& rules);

/// The outcome of the tests for a gap.
struct Tested {
  bool gap = false;           ///< after recalibration
  bool recalibrates = false;  ///< by a recalibration that gains more than chance
};

/// Probabilities of everything; they add up to one.
struct Probabilities {
  std::vector<Cause> ranked;  ///< the hypotheses with theirs, in their order
  double no_gap = 0, recalibrate = 0, none = 0;
  double of_effects() const;
  double of_gap() const { return 1 - no_gap - recalibrate; }
};
/// Shares probabilities over everything; the prior gives a gap even odds, shared by the effects.
/// @param candidates  how many effects were considered
Probabilities share_probabilities(const TransitionModel& model, const CauseRanking& ranking,
                                  const std::vector<const RankedCause*>& ordered, std::size_t candidates,
                                  const Tested& tested, const Odds& unnamed, const Rules& rules);

/// The verdict with what it names.
struct Named {
  Verdict verdict = Verdict::no_gap;
  std::vector<std::string> set, alike;  ///< as Diagnosis::Causes
  std::vector<AtWork> at_work;          ///< but for the shares they close
  double p_unnamed = 0;
};
/// Gives a verdict. An effect or a group is at work from Rules::least_at_work on: the gap is explained where something
/// without a name is less likely than its complement, else partly explained. Of too few trials (trials_to_explain)
/// neither an effect nor a recalibration is named: where they have a gap it is unexplained.
/// @param visible  Diagnosis::Limits::visible
Named give_verdict(const Probabilities& probabilities, const Odds& unnamed, const Tested& tested,
                   const std::vector<Detectability>& visible, const Diagnosis::Data& data,
                   const std::string& recalibration_id, const Rules& rules);

/// Holds how much of the gap stays beside the effects at work: the lower ends of 90 % intervals.
struct Stays {
  double share = 0;  ///< of the held-out gap as given
  double nats = 0;   ///< a collision, held out
};

/// Lists effects that may only take the shape of what stays without a name, with even odds of being at work: those
/// that, added last, clearly close less than what stays; and, where something surely stays (nats > 0), those that have
/// no other form (Candidate::exact), since no misfit in form is forgiven them.
/// @param exact  ids
std::map<std::string, double> doubted_effects(const std::vector<AtWork>& at_work, const Stays& stays,
                                              const std::set<std::string>& exact);

/// Corrects the probabilities of a partly explained gap by what each effect gains beside the unnamed: an effect that
/// only takes its shape is not at work, and where none is left the gap is unexplained.
/// @param beside  probabilities_beside_unnamed(); effects that it lacks stay as they are
/// @param unnamed  Odds::of_beside()  @param ranked  Probabilities::ranked
Named corrected(Named named, const std::map<std::string, double>& beside, double unnamed,
                const std::vector<Cause>& ranked, const Rules& rules);

}  // namespace metastable::analysis
