#pragma once
// Says effect by effect what is at work, whatever else is.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "analysis/diagnosis/verdict.h"

namespace metastable::analysis {

class FitsWithout;

/// Lists the effects of the likeliest hypotheses by their probability of being at work, each over all hypotheses that
/// hold it, with or without something unnamed; where none of the effects that act alike is at work by itself they are
/// one group, and so are effects that stand in each other's place: those of one of `groups` and, where nothing else is
/// likely to stay, those of sets of several that differ in them alone and fit the data as well.
/// @param alike  Diagnosis::Causes::alike  @param groups  TransitionModel::groups()
std::vector<AtWork> list_at_work(const Probabilities& probabilities, const Odds& unnamed,
                                 const std::vector<std::string>& alike, const std::vector<EffectGroup>& groups,
                                 const Rules& rules);

/// Makes one group of the first effect and of those that hypotheses without it hold in its place, the likeliest first,
/// until something of it is at work; where all of them are not enough, `at_work` stays as it is.
/// @param at_work  list_at_work(), none at work  @param set  names of the hypotheses that explain the gap
void join_rivals(std::vector<AtWork>& at_work, const Probabilities& probabilities, const Odds& unnamed,
                 const std::vector<std::string>& set, const std::vector<EffectGroup>& groups, const Rules& rules);

/// Lists the facets in which something without a name would act: beside the likeliest hypothesis of those it was
/// supposed beside, or alone where that is likelier. They share `p_unnamed`.
std::vector<UnnamedFacet> facets_by_probability(const Chosen& chosen, double p_unnamed, const Rules& rules);

/// Fills in what the effects at work close of the gap as given, added first and last.
/// @param best  the first hypothesis  @param without  its fits without each effect  @param given  the model as given
/// @param left  HeldOutGap::left
void add_closed_shares(std::vector<AtWork>& at_work, const TransitionModel& model, const RankedCause& best,
                       FitsWithout& without, const Fit& given, const Fit& recalibrated, const std::vector<double>& left,
                       const DiagnosisOptions& options, const std::function<void()>& heartbeat);

/// Fills in Causes::stand_ins and Causes::unnamed_share of a gap that is partly explained.
/// @param d  with what is at work and its held-out measures  @param best, without, given, left  as add_closed_shares()
void add_unnamed_share(Diagnosis& d, const TransitionModel& model, const RankedCause& best, FitsWithout& without,
                       const Fit& given, const Fit& recalibrated, const std::vector<double>& left,
                       const DiagnosisOptions& options, const std::function<void()>& heartbeat);

}  // namespace metastable::analysis
