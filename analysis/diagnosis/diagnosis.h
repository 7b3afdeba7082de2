#pragma once
// Diagnoses one experiment's sim-to-real gap: is there one, where, which unmodelled effect causes it, how far it
// shrinks.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/fitting/rules.h"
#include "analysis/fitting/stepwise.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/gap/collision_profile.h"
#include "analysis/gap/facet_evidence.h"
#include "analysis/gap/gap_cell.h"
#include "analysis/gap/gap_shrinkage.h"
#include "analysis/statistics/estimate.h"

namespace metastable::analysis {

struct DiagnosisOptions {
  std::uint64_t seed = 1;
  int threads = 0;  ///< the same bits on any number
  /// Lists ids to consider; none: all. Those that the model knows and these data or its law cannot have are left out
  /// and listed in Diagnosis::Limits::not_possible. A pair, "trial_drift+bounce", is tried in any case, not only where
  /// the scores promise something.
  std::vector<std::string> catalogue = {};
  int draws = 2000;     ///< bootstrap draws of each chance level, >= 200; the map as given takes half
  double level = 0.02;  ///< of the tests for a gap, before and after recalibration, in (0, 0.5)
  int folds = 5;        ///< of the cross-validation by trial, >= 2
  Rules rules = {};     ///< that decide
  std::vector<NamedValue> elsewhere = {};  ///< place whose expected steps are asked, see TransitionModel::elsewhere()
  /// It is called now and then with the share done, 0..1, and what is being done, and may throw to stop.
  std::function<void(double, const std::string&)> progress = {};
};

enum class Verdict {
  no_gap,            ///< nothing beyond chance
  recalibrate,       ///< other parameters of the model as it is remove the gap
  explained,         ///< effects, or a group that these data cannot tell apart, and nothing else
  partly_explained,  ///< likewise, and something without a name beside them
  unexplained        ///< a gap, and no effect that is likely to be at work
};
/// Says whether it is a gap that no recalibration removes.
inline bool is_gap(Verdict verdict) { return verdict >= Verdict::explained; }
std::string verdict_name(Verdict verdict);
/// @throws std::invalid_argument for an unknown name
Verdict verdict_from_name(std::string_view name);

/// A number comes with its 90 % interval.
struct EstimatedParameter {
  std::string name;
  double value = 0, lower = 0, upper = 0;
  bool fitted = true;  ///< false: chosen from a list (a leg, an interval), without interval
};

/// A hypothesis about the cause names an effect, or several at once.
struct Cause {
  std::vector<std::string> effects;  ///< ids
  double probability = 0;            ///< over all causes, "no_gap", "recalibration" and "none_of_these"
  double gain = 0;                   ///< 2 Delta log likelihood over the recalibrated model
  double p_value = 1;                ///< of the gain by chance, for this effect alone (RankedCause::p_value)
  double evidence = 0;               ///< log Bayes factor against the recalibrated model
  std::vector<std::vector<EstimatedParameter>> parameters;  ///< by effect
  std::string not_decided;   ///< why, if the fit failed or the data cannot tell; empty otherwise
  std::string name() const;  ///< "a", "a+b" or "a+b+c"
};

/// A fitted value that stands at an end of its range.
struct AtBound {
  std::string of;         ///< the effect's id; empty: a parameter that a recalibration refits
  std::string parameter;  ///< as it is reported
  bool upper = false;     ///< the upper end, else the lower
  double value = 0;
};

/// One effect, or several that these data cannot tell apart, whatever else is at work.
struct AtWork {
  std::string name;                  ///< the effect's id, or what the group has in common
  std::vector<std::string> effects;  ///< ids
  double probability = 0;            ///< that it is, or that one of them is, given all hypotheses
  /// The likeliest effect's parameters, averaged over the hypotheses that hold it; intervals hold what these differ by.
  std::vector<EstimatedParameter> parameters;
  /// Shares of the gap as given that it closes, 90 %, without what fitting gains and costs (parts_closed()): added to
  /// the model as given, nothing else refitted; added last, to the recalibrated model with the others at work; and the
  /// mean of the two (of two effects Shapley's value).
  std::optional<Estimate> closes_alone, closes_beside, closes_mean;
};

/// A facet in which something without a name may act, beside what is at work or alone.
struct UnnamedFacet {
  std::string facet, aspect;
  bool stance = false;
  double probability = 0;
  std::optional<double> size;  ///< of the largest cell of the map there, as GapCell's; none: no cell shows it
  std::string unit;
};

/// Supposes something that has no name beside a hypothesis or alone.
struct Unnamed {
  std::vector<std::string> beside;  ///< ids; empty: the recalibrated model
  double evidence = 0;              ///< log Bayes factor against the recalibrated model, without its prior odds
  std::vector<LeftInFacet> facets;  ///< where it would act
};

/// Says what the data could have seen of one effect.
struct Detectability {
  std::string effect;
  std::string parameter;
  double smallest = 0;  ///< size seen with 2 Delta log likelihood 16 (found in most experiments like this one)
  std::vector<std::pair<std::string, double>>
      alike;  ///< other effects with the share of its information they imitate, > 0.5
  std::string undecidable;
  double times_more = 0;  ///< data needed to see the effect at the end of its range, as a multiple of these
};

/// A statement that these data do not allow.
struct NotPossible {
  std::string statement, because;
  std::optional<std::size_t>
      trials;               ///< like these that would do; nothing: no number worth naming, or not their number
  bool of_the_gap = false;  ///< one of the questions asked of the gap, not of one effect or of the rests
};

/// An effect that a missing column hides.
struct HiddenEffect {
  std::string effect, parameter;
  std::optional<double> smallest;          ///< visible size without the column; nothing: it cannot be told at all
  double smallest_with_it = 0;             ///< and with it
  std::vector<std::string> not_told_from;  ///< effects that look alike for lack of it
};
struct MissingColumn {
  std::string column;
  std::vector<HiddenEffect> effects;  ///< empty: next to nothing is lost
};

/// An experiment that would tell the remaining causes apart.
struct NextExperiment {
  std::string change;                                   ///< in words
  std::vector<std::pair<std::string, double>> changes;  ///< ChangedExperiment::kind and amount; none: the same
  /// 2 Delta log likelihood expected between the first cause, at the fitted size, and the others, on average; each
  /// counts up to Rules::seen_gain.
  double separation = 0;
};

/// Holds the answer for one experiment.
struct Diagnosis {
  std::shared_ptr<const TransitionModel> model;  ///< diagnosed; nothing where it was passed by reference
  Rules rules;                                   ///< DiagnosisOptions::rules
  Verdict verdict = Verdict::no_gap;
  std::vector<std::string> sentences;  ///< the verdict in plain words

  /// Says whether there is a gap, and where. Its p-values are by chance, none below 1e-12.
  struct Gap {
    double p_as_given = 1;       ///< of the model as given: twice the smaller of the next two
    double p_recalibration = 1;  ///< of as large a gain by recalibration
    double p_value = 1;          ///< of a gap after it: the smallest of the next four and one of pairs, shared out
    double p_effects = 1;        ///< of the best single effect, with the look elsewhere
    double p_where = 1;          ///< of the largest cell of the map
    double p_facets = 1;         ///< of the facet that has most left, its cells together, with the look elsewhere
    double p_variations = 1;     ///< of what varies most in a way that has no name, with the look elsewhere
    bool facets_tested = true, variations_tested = true;  ///< false: these runs are too few or too short for that
    GapMap as_given, recalibrated, left;      ///< maps under the nominal, the refitted, and the chosen model
    std::string refitted;                     ///< what a recalibration refits (TransitionModel::recalibrated)
    std::string recalibration_id;             ///< TransitionModel::recalibration_id()
    std::vector<EstimatedParameter> contact;  ///< recalibrated
  } gap;

  /// Says which unmodelled effect causes it.
  struct Causes {
    std::vector<Cause> ranked;  ///< by falling probability; single effects and sets of several that were tried
    std::vector<Cause> not_decided;
    std::vector<Unnamed> unnamed;  ///< supposed beside the likeliest hypotheses
    std::vector<std::string> set;  ///< names; empty if unexplained or no gap
    /// Lists those of the set that no data like these could tell from its first, that one included: the design's
    /// information leaves less than 2 Delta log likelihood 6 between them at the size found. Pairs are alike where they
    /// share one effect and the others are, at what the first's gains beside it. Empty where there is none.
    std::vector<std::string> alike;
    std::vector<StepwiseChoice> stepwise;    ///< what the field's usual selection names, for comparison
    std::vector<EstimatedParameter> beside;  ///< what a recalibration refits, beside the effects that are named
    std::string size;                        ///< TransitionModel::size_in_words() of the likeliest
    std::string even_push;  ///< a sentence that says that a push, or one by a facet, fits as well; or ""
    /// These are probabilities. A gap has at least even odds where the tests find one, else at most even ones.
    double p_no_gap = 0, p_recalibrate = 0, p_none = 0;
    double together = 1;          ///< of the best hypothesis, if of several effects: see Rules::most_together
    std::vector<AtWork> at_work;  ///< by falling probability
    std::vector<UnnamedFacet> unnamed_facets;  ///< likewise
    double p_unnamed = 0;                      ///< that something without a name is at work, alone or beside effects
    /// Effects of the best hypothesis that are not at work beside others that are: something without a name is likelier
    /// in their place.
    std::vector<std::string> stand_ins;
    /// Share of the held-out gap that has no name beside effects at work: what the best hypothesis leaves and what its
    /// `stand_ins` close.
    std::optional<double> unnamed_share;
  } causes;

  /// Says how far the gap shrinks.
  struct Shrinkages {
    std::vector<Shrinkage> measures;  ///< log score first, then CRPS; empty: too few trials
    StepsBeforeFailure steps;
    std::vector<ProfilePoint> profile;
    /// Holds an experiment drawn from the chosen model, of the size of the one measured; nullptr where there is no gap.
    std::shared_ptr<const TransitionModel> drawn_with_effect;
  } shrinkage;

  /// Says what these data could not tell, and an experiment that would.
  struct Limits {
    std::vector<Detectability> visible;
    std::vector<MissingColumn> missing;
    std::vector<NotPossible> not_possible;
    std::vector<NextExperiment> next;
    std::vector<AtBound> at_bound;  ///< of the likeliest hypothesis; of the recalibrated model where that is chosen
  } limits;

  /// Says what was diagnosed.
  struct Data {
    std::size_t trials = 0, collisions = 0, events = 0;
    std::vector<std::string> condition_names;
    std::string step_name = "step";   ///< TransitionModel::step_name()
    std::vector<EffectGroup> groups;  ///< TransitionModel::groups()
    std::vector<std::string> notes;   ///< what is not known, was assumed or is rough, a sentence each
    std::string accepted_defects;     ///< TransitionModel::accepted_defects(), which the verdict repeats
    /// Says whether it is a wheel: its trials end at rest, those of other machines in failure.
    bool collides() const { return step_name == "collision"; }
  } data;
};

/// Adds a question about the data, which ends in '?', to the notes of a diagnosis, and to its sentences behind the
/// verdict and the questions that are there.
void ask_first(Diagnosis& d, const std::string& question);

/// Compares the trials with their nominal model and with every effect that the model knows: fits, chance levels,
/// probabilities and a verdict. The same seed gives the same bits. Seconds to minutes: some hundred fits, each of many
/// evaluations of all events.
/// @throws std::invalid_argument for options out of range and unknown ids; what options.progress throws
/// @throws std::runtime_error as TransitionModel::require_own_draws()
Diagnosis diagnose(const TransitionModel& model, const DiagnosisOptions& options = {});

/// Does the same, with Diagnosis::model in the answer.
/// @throws std::invalid_argument also where there is no model
Diagnosis diagnose(std::shared_ptr<const TransitionModel> model, const DiagnosisOptions& options = {});

/// Decides under each of several sets of rules (DiagnosisOptions::rules does not count): data, gap, causes and verdict
/// are what diagnose() finds before sizes far from none are sought, and the rest of the answer is left out. What is
/// fitted alike is fitted once.
/// @throws as diagnose()
std::vector<Diagnosis> decide_each(const TransitionModel& model, const DiagnosisOptions& options,
                                   const std::vector<Rules>& rules);

}  // namespace metastable::analysis
