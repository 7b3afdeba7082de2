#include "analysis/diagnosis/diagnosis.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <tuple>
#include <utility>

#include "analysis/diagnosis/at_bound.h"
#include "analysis/diagnosis/at_work.h"
#include "analysis/diagnosis/beside_unnamed.h"
#include "analysis/diagnosis/detectability.h"
#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/diagnosis/even_push.h"
#include "analysis/diagnosis/fits_without.h"
#include "analysis/diagnosis/gap_tests.h"
#include "analysis/diagnosis/machine_steps.h"
#include "analysis/diagnosis/missing_columns.h"
#include "analysis/diagnosis/not_possible.h"
#include "analysis/diagnosis/parameter_estimates.h"
#include "analysis/diagnosis/verdict.h"
#include "analysis/diagnosis/wanted_effects.h"
#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/far_sizes.h"
#include "analysis/gap/collision_profile.h"
#include "analysis/gap/facet_evidence.h"
#include "analysis/gap/fitted_variations.h"
#include "analysis/gap/gap_map.h"
#include "analysis/gap/gap_shrinkage.h"
#include "analysis/gap/trial_groups.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_rivals = 3;   // hypotheses that compete in each fold of the cross-validation:
constexpr double rival_evidence = 4;     //   those no further behind the best. Saves time
constexpr std::size_t most_telling = 6;  // hypotheses that say what steps are expected. Saves time
// Beyond this rise another optimum of the recalibration is taken for one, and a recalibration that did not converge is
// mentioned if its slope still promises it.
constexpr double converged_rise = 0.5, converged_share = 0.005;  // of the log likelihood; of the largest gain found

using Progress = std::function<void(double, const char*)>;

StepsBeforeFailure steps_before_failure(const TransitionModel& model, const std::vector<double>& nominal,
                                        const Fit& recalibrated, const Fit& chosen, std::uint64_t seed) {
  StepsBeforeFailure steps;
  set_observed(steps, model.rests());
  steps.baseline = model.expected_steps(nominal, {}, seed);
  steps.recalibrated = model.expected_steps(recalibrated.nuisance, {}, seed);
  steps.with_effect = model.expected_steps(chosen.nuisance, chosen.terms, seed);
  return steps;
}

// Lists the hypotheses that say what the machine's expected steps are, by probability: the likeliest with its rivals,
// and without a gap the recalibrated model before them. The list is empty where the recalibrated model stands alone.
std::vector<WeighedFit> telling(const std::vector<const RankedCause*>& ordered, const Fit& recalibrated,
                                const Fit& cause, const Diagnosis& d) {
  std::vector<WeighedFit> fits;
  if (is_gap(d.verdict) && &cause == &recalibrated) return fits;
  if (!is_gap(d.verdict)) fits.push_back({&recalibrated, d.causes.p_no_gap + d.causes.p_recalibrate});
  for (std::size_t i = 0; i < ordered.size() && fits.size() < most_telling; ++i) {
    const double first = fits.empty() ? d.causes.ranked.front().probability : fits.front().weight;
    if (ordered[i]->fitted() && d.causes.ranked[i].probability >= d.rules.least_of_first * first)
      fits.push_back({&ordered[i]->fit, d.causes.ranked[i].probability});
  }
  if (fits.size() == 1 && fits.front().fit == &recalibrated) fits.clear();
  return fits;
}

// Lists the effects of the hypotheses of the set beside the first.
std::vector<std::vector<EffectTerm>> rivals(const std::vector<const RankedCause*>& ordered, const Diagnosis& d) {
  std::vector<std::vector<EffectTerm>> all;
  for (std::size_t i = 1; i < ordered.size(); ++i)
    if (ordered[i]->fitted() && std::ranges::find(d.causes.set, d.causes.ranked[i].name()) != d.causes.set.end())
      all.push_back(ordered[i]->terms);
  return all;
}

// Returns the place that was asked about, if one was.
Elsewhere asked_elsewhere(const TransitionModel& model, const DiagnosisOptions& options) {
  return options.elsewhere.empty() ? Elsewhere{} : model.elsewhere(options.elsewhere);
}

void check(const TransitionModel& model, const DiagnosisOptions& options) {
  if (options.draws < 200) throw std::invalid_argument(fmt::format("draws: {} is below 200", options.draws));
  if (options.folds < 2) throw std::invalid_argument(fmt::format("folds: {} is below 2", options.folds));
  if (!(options.level > 0 && options.level < 0.5))
    throw std::invalid_argument(fmt::format("level: {} is outside (0, 0.5)", options.level));
  require_known_effects(model, options.catalogue);
}

// Evaluates the model without anything fitted: nothing to project out.
Fit unfitted(const TransitionModel& model, const std::vector<double>& nominal) {
  Fit given;
  given.nuisance = nominal;
  given.evaluation = model.evaluate(nominal, {});
  given.log_likelihood = given.penalised = given.evaluation.total();
  for (std::size_t p = 0; p < nominal.size(); ++p) given.penalised -= model.nuisances()[p].cost(nominal[p]);
  return given;
}

Diagnosis::Data described_data(const TransitionModel& model) {
  Diagnosis::Data data;
  data.trials = model.trials();
  data.events = model.events().size();
  for (std::size_t i = 0; i < model.events().size(); ++i) data.collisions += begins_step(model.events(), i);
  for (std::size_t c = 0; c < model.conditions(); ++c) data.condition_names.push_back(model.condition_name(c));
  data.notes = model.notes();
  data.accepted_defects = model.accepted_defects();
  data.step_name = model.step_name();
  data.groups = model.groups();
  return data;
}

Progress told_to(const DiagnosisOptions& options) {
  return [&options](double share, const char* doing) {
    if (options.progress) options.progress(share, doing);
  };
}

// The model as given and recalibrated with what it leaves, and every hypothesis.
struct Fitted {
  Fit given;         // the model as given
  Fit given_slopes;  // likewise, with the information on its parameters
  Fit recalibrated;
  CauseRanking ranking;  // at the recalibrated model
  GapMap given_map, recalibrated_map;
  EffectScan variations;               // of the recalibrated model; empty where trials are too few for chance levels
  std::vector<Detectability> visible;  // by candidate
  double gain() const { return 2 * (recalibrated.penalised - given.penalised); }
};

// Notes where the model is far off, so that its likelihood is rough; what a fit missed is said where it is not next to
// nothing.
std::vector<std::string> notes_on_roughness(const Fitted& fitted, const Diagnosis::Data& data) {
  std::vector<std::string> notes;
  const Fit& recalibrated = fitted.recalibrated;
  double largest_gain = fitted.gain();
  for (const RankedCause& cause : fitted.ranking.singles) largest_gain = std::max(largest_gain, cause.gain);
  if (!recalibrated.converged && recalibrated.promised > converged_rise + converged_share * largest_gain)
    notes.push_back(fmt::format(
        "the recalibrated parameters did not converge ({}): by its slope the likelihood could rise by {:.2g} "
        "more, and gains over them (2 Δ ln L) may be {:.2g} too large",
        recalibrated.reason, recalibrated.promised, 2 * recalibrated.promised));
  if (!fitted.ranking.scan.trials_suffice)
    notes.push_back(fmt::format(
        "{} trial{} of {} {}s on average: the model alone tells what chance does; from {} trials of a few {}s "
        "on, it is told by how trials scatter, which is surer",
        data.trials, data.trials == 1 ? "" : "s", data.collisions / std::max<std::size_t>(1, data.trials),
        data.step_name, Rules::enough_trials, data.step_name));
  return notes;
}

// Returns the fit without effects from the nuisances of the effect that gains most, where that is another optimum.
std::optional<Fit> other_recalibration(const TransitionModel& model, const Fit& recalibrated,
                                       const CauseRanking& ranking) {
  const RankedCause* leader = nullptr;
  for (const RankedCause& cause : ranking.singles)
    if (cause.fitted() && (!leader || cause.gain > leader->gain)) leader = &cause;
  if (!leader) return {};
  FitOptions options;
  options.to_beat = recalibrated.penalised;
  Fit other = fit(model, leader->fit.nuisance, {}, options);
  if (other.penalised > recalibrated.penalised + converged_rise + converged_share * std::max(0.0, leader->gain))
    return other;
  return {};
}

// Lists those that compete on the trials held out.
std::vector<const Fit*> rivals(const std::vector<const RankedCause*>& ordered) {
  std::vector<const Fit*> all;
  for (const RankedCause* cause : ordered) {
    if (all.size() == most_rivals || cause->evidence < ordered.front()->evidence - rival_evidence) break;
    if (cause->fitted()) all.push_back(&cause->fit);
  }
  return all;
}

// Ranks what causes the gap beside the recalibrated model. What an effect seems to gain may be a better optimum of the
// recalibration that its fit came upon.
Fitted fit_models(const TransitionModel& model, const std::vector<const Candidate*>& candidates,
                  const DiagnosisOptions& options, const Progress& progress) {
  Fitted fitted;
  const std::vector<double> nominal = given_values(model);
  fitted.given_slopes = fit(model, nominal, {}, {.count = {}, .refit_nuisances = true, .most_iterations = 1});
  fitted.given = unfitted(model, nominal);
  fitted.recalibrated = best_fit(model, nominal, {});
  model.require_own_draws(fitted.recalibrated);
  const auto rank = [&] {
    return rank_causes(model, fitted.recalibrated, candidates,
                       {.threads = options.threads,
                        .draws = options.draws,
                        .seed = options.seed,
                        .rules = options.rules,
                        .pairs = wanted_pairs(candidates, options.catalogue),
                        .progress = [&](double share) { progress(0.1 + 0.5 * share, "which effect"); }});
  };
  fitted.ranking = rank();
  if (std::optional<Fit> other = other_recalibration(model, fitted.recalibrated, fitted.ranking)) {
    fitted.recalibrated = *std::move(other);
    fitted.ranking = rank();
  }
  // An effect on which the data hold no information is not decided, whatever its evidence.
  fitted.visible = detectability(fitted.ranking.scan, candidates, options.rules);
  std::vector<RankedCause>& singles = fitted.ranking.singles;
  for (std::size_t i = 0; i < singles.size(); ++i)
    if (singles[i].not_decided.empty() && !candidates[i]->parameters.empty() && fitted.visible[i].smallest == 0 &&
        candidates[i]->parameters[0].likely == 0)
      singles[i].not_decided = fitted.visible[i].undecidable;
  fitted.given_map = gap_map(model, fitted.given, options.draws / 2, options.seed);
  progress(0.6, "where the gap lies");
  fitted.recalibrated_map = gap_map(model, fitted.recalibrated, options.draws, options.seed);
  if (fitted.ranking.scan.steps_suffice)
    fitted.variations = scan_variations(model, fitted.recalibrated, options.threads);
  return fitted;
}

// Says what gap there is, and what of it has no name.
struct FoundGap {
  Diagnosis::Gap gap;
  Unnamed alone;  // what the recalibrated model leaves
};
FoundGap find_gap(const TransitionModel& model, const Fitted& fitted, std::size_t candidates,
                  const DiagnosisOptions& options, const Progress& progress) {
  const Fit& recalibrated = fitted.recalibrated;
  const bool suffice = fitted.ranking.scan.steps_suffice;
  FoundGap found;
  Diagnosis::Gap& gap = found.gap;
  gap.refitted = model.recalibrated();
  gap.recalibration_id = model.recalibration_id();
  gap.contact = contact_estimates(model, recalibrated);
  gap.as_given = fitted.given_map;
  gap.recalibrated = fitted.recalibrated_map;
  gap.facets_tested = fitted.ranking.scan.trials_suffice;
  gap.variations_tested = suffice && !fitted.variations.effects.empty();
  std::vector<LeftInFacet>& facets = found.alone.facets;
  if (gap.facets_tested || !suffice) facets = left_by_facet(model, recalibrated, {}, options.rules);
  GapPValues p{.recalibration = recalibration_p_value(model, fitted.given_slopes, fitted.gain()),
               .effects = fitted.ranking.p_value,
               .where = gap.recalibrated.p_value,
               .facets = facets_p_value(fitted.ranking, facets),
               .pairs = pairs_p_value(fitted.ranking, candidates, recalibrated)};
  const EffectScan& variations = fitted.variations;
  const auto fit_variations = [&] {
    const auto beat = [&] { progress(0.66, "what has no name"); };
    beat();
    return fitted_variations(model, recalibrated, variations, options.rules, options.threads, beat);
  };
  std::vector<LeftInFacet> varied;
  p.variations = variations_p_value(variations, promised_gains(variations), options.draws, options.seed);
  if (p.variations < options.level) {  // what scores promise, fits must keep
    varied = fit_variations();
    std::vector<double> gains;
    for (const LeftInFacet& one : varied) gains.push_back(std::max(0.0, one.quadratic - 2 * recalibrated.promised));
    p.variations = std::max(p.variations, variations_p_value(variations, gains, options.draws, options.seed));
  }
  put_together(gap, p, options.rules);
  if (gap.p_value < options.level && suffice) {
    if (varied.empty()) varied = fit_variations();
    std::ranges::move(varied, std::back_inserter(facets));
  }
  found.alone.evidence = evidence_of_more(facets);
  return found;
}

// Returns the best hypothesis of a gap, or the recalibrated model where none is worth having.
Chosen best_hypothesis(const TransitionModel& model, const Fitted& fitted, const Hypotheses& hypotheses, FoundGap found,
                       bool gap, const DiagnosisOptions& options) {
  const RankedCause* best = hypotheses.best();
  if (gap && best && best->evidence > 0 && best->fitted())
    return choose(model, fitted.ranking, hypotheses.ordered, fitted.recalibrated, std::move(found.alone), options);
  Chosen chosen{.fit = &fitted.recalibrated, .left = std::move(found.gap.recalibrated)};
  chosen.supposed.push_back(std::move(found.alone));
  if (gap) chosen.unnamed.alone = options.rules.certain_odds;  // something stands out, and no effect does
  return chosen;
}

// Measures the gap on trials held out. Even a cause that closes nearly all of a huge gap may leave a large one, which
// is put down to something unnamed.
HeldOutGap hold_out(const TransitionModel& model, const Fitted& fitted, const Hypotheses& hypotheses,
                    const Diagnosis::Data& data, Chosen& chosen, const DiagnosisOptions& options,
                    const Progress& progress) {
  if (data.trials < trials_for_folds(options.folds)) return {};
  const auto beat_at = [&](double share) { return [&progress, share] { progress(share, "how far it shrinks"); }; };
  const bool named = chosen.fit != &fitted.recalibrated;
  HeldOutGap held_out = gap_shrinkage(model, fitted.given, fitted.recalibrated,
                                      named ? rivals(hypotheses.ordered) : std::vector<const Fit*>{}, options.folds,
                                      options.threads, options.seed, beat_at(0.7));
  const auto leaves = [&](double by_itself) {
    return leaves_gap_held_out(held_out.measures.front(), data, chosen.bent, by_itself, options.rules);
  };
  if (named && !held_out.measures.empty() && leaves(0)) {
    const double by_itself =
        gap_by_itself(model, *chosen.fit, options.folds, options.threads, options.seed, beat_at(0.85));
    if (leaves(std::max(0.0, by_itself))) chosen.unnamed.left = options.rules.certain_odds;
  }
  return held_out;
}

// Gives the verdict. Where a variation without a name says more than all that the catalogue names, or stands in the
// place of an effect, names are asked beside it.
Named name_beside_unnamed(const TransitionModel& model, const Fitted& fitted, const Hypotheses& hypotheses,
                          const Chosen& chosen, const Probabilities& probabilities, std::size_t candidates,
                          const Diagnosis& d, const Tested& tested, std::optional<FitsWithout>& without,
                          const DiagnosisOptions& options, const std::function<void()>& beat) {
  const std::vector<LeftInFacet>& alone = chosen.supposed.front().facets;
  Odds asked = chosen.unnamed;
  std::optional<InPlace> there;
  if (const RankedCause* best = hypotheses.best();
      without && !chosen.same &&
      chosen.supposed.front().evidence - best->evidence > std::log(d.rules.most_odds_of_none() / d.rules.unnamed_alone))
    there = varies_without_name(model, alone);
  if (there) asked = {.alone = 0, .beside = asked.beside, .left = d.rules.certain_odds};
  Named named = give_verdict(probabilities, asked, tested, d.limits.visible, d.data, d.gap.recalibration_id, d.rules);
  if (named.at_work.empty() || !without) return named;
  double unnamed = named.verdict == Verdict::partly_explained ? asked.of_beside() : 0;
  if (!there)
    if (const auto found = in_place_of_effects(model, fitted.ranking, *hypotheses.best(), fitted.recalibrated, *without,
                                               alone.size(), options, beat);
        found) {
      there = found;
      unnamed = std::max(unnamed, found->odds / (1 + found->odds));
    }
  if (named.verdict != Verdict::partly_explained && !there) return named;
  named = corrected(std::move(named),
                    probabilities_beside_unnamed(model, fitted.ranking, *hypotheses.best(), fitted.recalibrated, alone,
                                                 there, candidates, options, beat),
                    unnamed, probabilities.ranked, d.rules);
  if (named.verdict == Verdict::unexplained) asked = chosen.unnamed;
  named.p_unnamed = probabilities.of_gap() * std::max(asked.of_unnamed(), unnamed);
  if (named.verdict == Verdict::explained && named.p_unnamed >= 1 - d.rules.least_at_work)
    named.verdict = Verdict::partly_explained;
  return named;
}

// Says which effects cause the gap, with what probability.
std::pair<Verdict, Diagnosis::Causes> name_causes(const TransitionModel& model, const Fitted& fitted,
                                                  const Hypotheses& hypotheses, Chosen chosen, std::size_t candidates,
                                                  const Diagnosis& d, const Tested& tested,
                                                  std::optional<FitsWithout>& without, const DiagnosisOptions& options,
                                                  const Progress& progress) {
  Diagnosis::Causes causes;
  Probabilities probabilities =
      share_probabilities(model, fitted.ranking, hypotheses.ordered, candidates, tested, chosen.unnamed, d.rules);
  Named named = name_beside_unnamed(model, fitted, hypotheses, chosen, probabilities, candidates, d, tested, without,
                                    options, [&] { progress(0.86, "what stands beside the unnamed"); });
  if (!named.at_work.empty()) causes.unnamed_facets = facets_by_probability(chosen, named.p_unnamed, d.rules);
  causes.ranked = std::move(probabilities.ranked);
  causes.not_decided = hypotheses.not_decided;
  causes.unnamed = std::move(chosen.supposed);
  causes.set = std::move(named.set);
  causes.alike = std::move(named.alike);
  causes.stepwise = stepwise_selection(model, fitted.recalibrated, fitted.ranking);
  if (chosen.fit != &fitted.recalibrated) causes.size = model.size_in_words(chosen.fit->terms);
  causes.p_no_gap = probabilities.no_gap;
  causes.p_recalibrate = probabilities.recalibrate;
  causes.p_none = probabilities.none;
  causes.together = chosen.together;
  causes.at_work = std::move(named.at_work);
  causes.p_unnamed = named.p_unnamed;
  return {named.verdict, std::move(causes)};
}

// The part of an answer that depends on the rules, with the fits from which the rest of the answer is made.
struct Decided {
  Diagnosis d;  // data, gap, causes, verdict; visible effects and measures of the shrinkage
  Hypotheses ranked;
  const Fit* cause;  // of the best hypothesis, or the recalibrated model
  HeldOutGap held_out;
  const Variation* same = nullptr;     // Chosen::same
  std::optional<EvenPush> push = {};   // It is held against the best hypothesis.
  std::optional<FitsWithout> without;  // of the best hypothesis; nothing where it is the recalibrated model
};
Decided decide(const TransitionModel& model, const Fitted& fitted, const std::vector<const Candidate*>& candidates,
               const DiagnosisOptions& options, const Progress& progress) {
  Decided decided;
  Diagnosis& d = decided.d;
  d.rules = options.rules;
  d.data = described_data(model);
  d.limits.visible = fitted.visible;
  FoundGap found = find_gap(model, fitted, candidates.size(), options, progress);
  std::ranges::move(notes_on_roughness(fitted, d.data), std::back_inserter(d.data.notes));
  d.gap = found.gap;
  const Tested tested{d.gap.p_value < options.level, d.gap.p_recalibration < options.level};

  progress(0.68, "what is left");
  decided.ranked = hypotheses(model, fitted.ranking);
  Chosen chosen = best_hypothesis(model, fitted, decided.ranked, std::move(found), tested.gap, options);
  decided.cause = chosen.fit;
  if (chosen.fit != &fitted.recalibrated) {
    chosen.same = same_variation(model, *decided.ranked.best(), chosen.supposed.front().facets, options.rules);
    if (chosen.same) chosen.unnamed.alone = 0;  // What varies so has the name.
    decided.same = chosen.same;
    // An effect outside the catalogue that pushes all steps alike may pass for a name that can do less of it.
    decided.push = fitted_even_push(model, fitted.recalibrated, *decided.ranked.best(), options.rules, options.threads);
    if (!chosen.same && decided.push && decided.push->instead(options.rules))
      chosen.unnamed.alone = std::max(chosen.unnamed.alone, options.rules.certain_odds);
    decided.without.emplace(model, fitted.ranking, *decided.ranked.best(), fitted.recalibrated);
  }
  if (const std::optional<TrialGroups> two =
          trial_groups(model, fitted.ranking.scan, fitted.recalibrated, *chosen.fit, options.seed))
    d.data.notes.push_back(trial_groups_in_words(model, *two));
  d.gap.left = chosen.left;
  progress(0.7, "how far it shrinks");
  decided.held_out = hold_out(model, fitted, decided.ranked, d.data, chosen, options, progress);
  d.shrinkage.measures = decided.held_out.measures;
  if (tested.gap && trials_to_explain(d.data)) chosen.unnamed.alone = std::max(chosen.unnamed.alone, d.rules.even_odds);
  std::tie(d.verdict, d.causes) = name_causes(model, fitted, decided.ranked, std::move(chosen), candidates.size(), d,
                                              tested, decided.without, options, progress);
  return decided;
}

// Doubts effects that may only take the shape of what stays without a name.
void doubt_effects(Diagnosis& d, const std::vector<const Candidate*>& candidates) {
  const Shrinkage& shrinkage = d.shrinkage.measures.front();
  if (!shrinkage.closed_upper) return;
  std::set<std::string> exact;
  for (const Candidate* candidate : candidates)
    if (candidate->exact) exact.insert(candidate->id);
  const std::map<std::string, double> doubted =
      doubted_effects(d.causes.at_work, {1 - *shrinkage.closed_upper, shrinkage.with_effect_lower}, exact);
  if (doubted.empty()) return;
  Named named = corrected({d.verdict, d.causes.set, d.causes.alike, d.causes.at_work, d.causes.p_unnamed}, doubted,
                          d.causes.p_unnamed, d.causes.ranked, d.rules);
  d.verdict = named.verdict;
  d.causes.set = std::move(named.set);
  d.causes.alike = std::move(named.alike);
  d.causes.at_work = std::move(named.at_work);
}

// Puts a question about the data themselves, as of their unit, behind what is made of them, and behind other questions.
void say_question(Diagnosis& d, const std::string& question) {
  constexpr std::string_view opening = "But a question comes first: ";
  const bool named = d.verdict == Verdict::explained || d.verdict == Verdict::partly_explained;
  auto behind = std::min(d.sentences.size(), std::size_t{named ? 2U : 1U});
  while (behind < d.sentences.size() && d.sentences[behind].starts_with(opening)) ++behind;
  d.sentences.insert(d.sentences.begin() + static_cast<std::ptrdiff_t>(behind), std::string(opening) + question);
}

// Says behind the verdict which parameters lie far from what is stated of them; of a gap without a name, that alone.
void say_misstated(Diagnosis& d, const TransitionModel& model, const Fit& fit) {
  if (d.verdict == Verdict::no_gap) return;
  std::vector<std::string> said = model.misstated(fit);
  if (d.verdict == Verdict::unexplained)
    std::erase_if(said, [](const std::string& one) { return one.find("of its stated sds") == one.npos; });
  std::ranges::move(said, std::inserter(d.sentences, std::next(d.sentences.begin())));
}

// Says what steps the machine and its models take; those that were counted alone, where the models have none to tell.
void add_steps(Diagnosis& d, const TransitionModel& model, const Fitted& fitted, const Fit& cause,
               const std::vector<const RankedCause*>& ordered, const Elsewhere& elsewhere,
               const DiagnosisOptions& options, const Progress& progress) {
  if (const std::string why = model.steps_not_told(); !why.empty()) {
    d.data.notes.push_back(why);
    add_counted_steps(d.shrinkage.steps, model.rests());
    return;
  }
  d.shrinkage.steps = steps_before_failure(model, fitted.given.nuisance, fitted.recalibrated, cause, options.seed);
  set_later_steps(d.shrinkage.steps, model, cause);
  if (const auto [at_risk, rests] = model.rests(); at_risk > 0 && !d.shrinkage.measures.empty())
    d.shrinkage.measures.push_back(rest_shrinkage(
        at_risk, rests, d.shrinkage.steps,
        fmt::format("share of {}s that {}, all trials", d.data.step_name, d.data.collides() ? "rest" : "fail")));
  add_machine_steps(d, model, {&fitted.recalibrated, 1}, telling(ordered, fitted.recalibrated, cause, d), elsewhere,
                    options, [&] { progress(0.9, "steps before failure"); });
}

// Puts the answer together from what each stage says.
Diagnosis answer(const TransitionModel& model, const Fitted& fitted, Decided decided,
                 const std::vector<const Candidate*>& candidates, const Elsewhere& elsewhere,
                 const DiagnosisOptions& options, const Progress& progress) {
  Diagnosis& d = decided.d;
  const std::vector<const RankedCause*>& ordered = decided.ranked.ordered;
  const RankedCause* best = decided.ranked.best();
  const Fit& cause = *decided.cause;
  if (decided.without && !d.shrinkage.measures.empty() && d.shrinkage.measures.front().closed) {
    add_closed_shares(d.causes.at_work, model, *best, *decided.without, fitted.given, fitted.recalibrated,
                      decided.held_out.left, options, [&] { progress(0.86, "what each effect closes"); });
    if (d.verdict == Verdict::partly_explained) doubt_effects(d, candidates);
    if (d.verdict == Verdict::partly_explained)
      add_unnamed_share(d, model, *best, *decided.without, fitted.given, fitted.recalibrated, decided.held_out.left,
                        options, [&] { progress(0.86, "what has no name"); });
  }

  const bool named = d.verdict == Verdict::explained || d.verdict == Verdict::partly_explained;
  if (named && decided.same)
    d.causes.even_push = same_push_in_words(*decided.same);
  else if (decided.push && (named || (d.verdict == Verdict::unexplained && decided.push->instead(d.rules))))
    d.causes.even_push = even_push_in_words(model, *decided.push, d.rules);
  progress(0.88, "steps before failure");
  add_steps(d, model, fitted, cause, ordered, elsewhere, options, progress);
  d.shrinkage.profile = collision_profile(model, fitted.given.nuisance, cause, options.seed);
  if (is_gap(d.verdict)) d.shrinkage.drawn_with_effect = model.simulate(cause.nuisance, cause.terms, options.seed);
  progress(0.93, "what could not be seen");
  d.limits.missing = missing_columns(model, fitted.recalibrated, candidates, d.rules, options.threads, options.seed);
  d.limits.not_possible = not_possible(model, d, options);
  if (d.causes.set.size() > 1 && best)
    d.limits.next = next_experiments(model, best->fit, rivals(ordered, d), d.rules, options.threads, options.seed);
  progress(1, "done");
  d.limits.at_bound = values_at_bound(model, cause);
  if (named) d.causes.beside = contact_estimates(model, cause);
  d.sentences = sentences(d);
  say_misstated(d, model, named ? cause : fitted.recalibrated);
  for (const std::string& note : d.data.notes)
    if (note.ends_with('?')) say_question(d, note);
  for (const AtBound& one : d.limits.at_bound) d.sentences.push_back(at_bound_in_words(one, cause.terms));
  return std::move(d);
}

}  // namespace

void ask_first(Diagnosis& d, const std::string& question) {
  d.data.notes.push_back(question);
  say_question(d, question);
}

std::string Cause::name() const { return fmt::format("{}", fmt::join(effects, "+")); }

Diagnosis diagnose(const TransitionModel& model, const DiagnosisOptions& options) {
  check(model, options);
  const std::vector<const Candidate*> candidates = wanted(model, options.catalogue);
  const Progress progress = told_to(options);
  progress(0, "the model as given");
  const Elsewhere elsewhere = asked_elsewhere(model, options);
  const Fitted fitted = fit_models(model, candidates, options, progress);
  Decided decided = decide(model, fitted, candidates, options, progress);
  // A gap without a name may come of an effect that fits missed, because no slope leads to its likely size.
  // Another gap may, where the data hold nothing of an effect at none.
  if (decided.d.verdict == Verdict::unexplained || decided.d.verdict == Verdict::partly_explained ||
      (decided.d.verdict != Verdict::no_gap && any_flat(candidates, fitted.ranking.singles))) {
    const std::vector<Candidate> far =
        with_far_sizes(model, fitted.recalibrated, candidates, fitted.ranking.singles, options.rules, options.threads,
                       [&] { progress(0.86, "what may lie far from none"); });
    if (!far.empty()) {
      std::vector<const Candidate*> again;
      for (const Candidate& candidate : far) again.push_back(&candidate);
      const Progress rest = [&](double share, const char* doing) { progress(0.86 + 0.14 * share, doing); };
      const Fitted fitted_again = fit_models(model, again, options, rest);
      return answer(model, fitted_again, decide(model, fitted_again, again, options, rest), again, elsewhere, options,
                    rest);
    }
  }
  return answer(model, fitted, std::move(decided), candidates, elsewhere, options, progress);
}

std::vector<Diagnosis> decide_each(const TransitionModel& model, const DiagnosisOptions& options,
                                   const std::vector<Rules>& rules) {
  check(model, options);
  const std::vector<const Candidate*> candidates = wanted(model, options.catalogue);
  const Progress progress = told_to(options);
  std::vector<std::pair<Rules, Fitted>> known;
  std::vector<Diagnosis> all;
  for (const Rules& these : rules) {
    DiagnosisOptions with = options;
    with.rules = these;
    auto same = std::ranges::find_if(known, [&](const auto& one) { return one.first.fits_as(these); });
    if (same == known.end()) same = known.insert(same, {these, fit_models(model, candidates, with, progress)});
    all.push_back(decide(model, same->second, candidates, with, progress).d);
  }
  return all;
}

Diagnosis diagnose(std::shared_ptr<const TransitionModel> model, const DiagnosisOptions& options) {
  if (!model) throw std::invalid_argument("diagnose: there is no model");
  Diagnosis answer = diagnose(*model, options);
  answer.model = std::move(model);
  return answer;
}

}  // namespace metastable::analysis
