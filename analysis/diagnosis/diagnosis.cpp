#include "analysis/diagnosis/diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/diagnosis/at_work.h"
#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/diagnosis/gap_tests.h"
#include "analysis/diagnosis/missing_columns.h"
#include "analysis/diagnosis/parameter_estimates.h"
#include "analysis/diagnosis/too_few.h"
#include "analysis/diagnosis/verdict.h"
#include "analysis/diagnosis/visibility.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/gap/collision_profile.h"
#include "analysis/gap/fitted_variations.h"
#include "analysis/gap/gap_map.h"
#include "analysis/gap/gap_shrinkage.h"
#include "analysis/gap/left_over.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_rivals = 3;  // hypotheses that compete in each fold of the cross-validation:
constexpr double rival_evidence = 4;    //   those no further behind the best. Saves time
// Beyond this rise another optimum of the recalibration is taken for one, and a recalibration that did not settle is
// mentioned if its slope still promises it.
constexpr double settled_rise = 0.5, settled_share = 0.005;  // of the log likelihood; of the largest gain found

StepsBeforeFailure steps_before_failure(const TransitionModel& model, const std::vector<double>& nominal,
                                        const Fit& recalibrated, const Fit& chosen, std::uint64_t seed) {
  StepsBeforeFailure steps;
  const auto [at_risk, rests] = model.rests();
  if (at_risk > 0) {
    // Rests are counts: these are exact limits of a Poisson mean.
    const auto limit = [](double degrees, double p) {
      return degrees > 0 ? boost::math::quantile(boost::math::chi_squared(degrees), p) / 2 : 0.0;
    };
    const double most = limit(2 * rests + 2, 0.95), least = limit(2 * rests, 0.05);
    const double infinity = std::numeric_limits<double>::infinity();
    steps.observed = rests > 0 ? at_risk / rests : infinity;
    steps.observed_lower = at_risk / most;
    steps.observed_upper = least > 0 ? at_risk / least : infinity;
  }
  steps.baseline = model.expected_steps(nominal, {}, seed);
  steps.recalibrated = model.expected_steps(recalibrated.nuisance, {}, seed);
  steps.with_effect = model.expected_steps(chosen.nuisance, chosen.terms, seed);
  return steps;
}

// Returns the one or two effects that an entry of the options names.
std::vector<std::string> effects_of(const std::string& entry) {
  const auto plus = entry.find('+');
  std::vector<std::string> ids{entry.substr(0, plus)};
  if (plus != std::string::npos) ids.push_back(entry.substr(plus + 1));
  if (ids.front() == ids.back() && ids.size() == 2)
    throw std::invalid_argument(fmt::format("effect: \"{}\" is not a pair of two effects", entry));
  return ids;
}

void check(const TransitionModel& model, const DiagnosisOptions& options) {
  if (options.draws < 200) throw std::invalid_argument(fmt::format("draws: {} is below 200", options.draws));
  if (options.folds < 2) throw std::invalid_argument(fmt::format("folds: {} is below 2", options.folds));
  if (!(options.level > 0 && options.level < 0.5))
    throw std::invalid_argument(fmt::format("level: {} is outside (0, 0.5)", options.level));
  const std::vector<std::string> known = model.effect_ids();
  for (const std::string& entry : options.catalogue)
    for (const std::string& id : effects_of(entry))
      if (std::ranges::find(known, id) == known.end())
        throw std::invalid_argument(fmt::format("effect: \"{}\" is none of {}", id, fmt::join(known, ", ")));
}

// Pairs alone extend the whole catalogue; beside single effects they add theirs.
std::vector<const Candidate*> wanted(const TransitionModel& model, const std::vector<std::string>& catalogue) {
  std::vector<std::string> ids;
  bool restricted = false;
  for (const std::string& entry : catalogue) {
    const std::vector<std::string> named = effects_of(entry);
    restricted = restricted || named.size() == 1;
    ids.insert(ids.end(), named.begin(), named.end());
  }
  std::vector<const Candidate*> candidates;
  for (const Candidate& candidate : model.candidates())
    if (!restricted || std::find(ids.begin(), ids.end(), candidate.id) != ids.end()) candidates.push_back(&candidate);
  return candidates;
}

std::vector<std::pair<const Candidate*, const Candidate*>> wanted_pairs(const std::vector<const Candidate*>& candidates,
                                                                        const std::vector<std::string>& catalogue) {
  const auto find = [&](const std::string& id) {
    const auto found =
        std::find_if(candidates.begin(), candidates.end(), [&](const Candidate* c) { return c->id == id; });
    return found == candidates.end() ? nullptr : *found;
  };
  std::vector<std::pair<const Candidate*, const Candidate*>> pairs;
  for (const std::string& entry : catalogue) {
    const std::vector<std::string> named = effects_of(entry);
    const Candidate *one = find(named.front()), *other = find(named.back());
    if (one && other && one != other) pairs.emplace_back(one, other);
  }
  return pairs;
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

void describe_data(Diagnosis& d, const TransitionModel& model) {
  d.data.trials = model.trials();
  d.data.events = model.events().size();
  for (const Event& e : model.events())
    d.data.collisions += e.kind == EventKind::collision || e.kind == EventKind::step;
  for (std::size_t c = 0; c < model.conditions(); ++c) d.data.condition_names.push_back(model.condition_name(c));
  d.data.notes = model.notes();
  d.data.accepted_defects = model.accepted_defects();
  d.data.step_name = model.step_name();
  d.data.groups = model.groups();
  d.gap.refitted = model.recalibrated();
  d.gap.recalibration_id = model.recalibration_id();
}

// What the data hold no information on is not decided, whatever its evidence.
void leave_undecided(Diagnosis& d, CauseRanking& ranking, const std::vector<const Candidate*>& candidates) {
  d.limits.visible = visibility(ranking.scan, candidates);
  for (std::size_t i = 0; i < ranking.singles.size(); ++i)
    if (ranking.singles[i].not_decided.empty() && !candidates[i]->parameters.empty() &&
        d.limits.visible[i].smallest == 0)
      ranking.singles[i].not_decided = d.limits.visible[i].undecidable;
}

void note_what_is_rough(Diagnosis& d, const CauseRanking& ranking, const Fit& recalibrated, double largest_gain) {
  // Where the model is far off its likelihood is rough; what the fit missed is said where it is not next to nothing.
  for (const RankedCause& cause : ranking.singles) largest_gain = std::max(largest_gain, cause.gain);
  if (!recalibrated.converged && recalibrated.promised > settled_rise + settled_share * largest_gain)
    d.data.notes.push_back(
        fmt::format("the recalibrated parameters did not settle ({}): by its slope the likelihood could rise by {:.2g} "
                    "more, and gains over them (2 Δ ln L) may be {:.2g} too large",
                    recalibrated.reason, recalibrated.promised, 2 * recalibrated.promised));
  if (!ranking.scan.trials_suffice)
    d.data.notes.push_back(fmt::format(
        "{} {} of {:.2g} transitions: chance levels come from the model's information alone; from {} trials "
        "of {} transitions on, from the trials' own scatter",
        d.data.trials, d.data.trials == 1 ? "trial" : "trials",
        static_cast<double>(d.data.events) / static_cast<double>(std::max<std::size_t>(1, d.data.trials)),
        enough_trials, enough_transitions));
}

// Returns the fit without effects from the nuisances of the effect that gains most, where that is another optimum.
std::optional<Fit> other_recalibration(const TransitionModel& model, const Fit& recalibrated,
                                       const CauseRanking& ranking) {
  const RankedCause* leader = nullptr;
  for (const RankedCause& cause : ranking.singles)
    if (!cause.fit.nuisance.empty() && (!leader || cause.gain > leader->gain)) leader = &cause;
  if (!leader) return {};
  Fit other = fit(model, leader->fit.nuisance, {});
  if (other.penalised > recalibrated.penalised + settled_rise + settled_share * std::max(0.0, leader->gain))
    return other;
  return {};
}

// Lists those that compete on the trials held out.
std::vector<const Fit*> rivals(const std::vector<const RankedCause*>& ordered) {
  std::vector<const Fit*> all;
  for (const RankedCause* cause : ordered) {
    if (all.size() == most_rivals || cause->evidence < ordered.front()->evidence - rival_evidence) break;
    if (!cause->fit.nuisance.empty()) all.push_back(&cause->fit);
  }
  return all;
}

}  // namespace

std::string verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_gap:
      return "no_gap";
    case Verdict::recalibrate:
      return "recalibrate";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::unexplained:
      return "unexplained";
  }
  throw std::logic_error("verdict_name: unknown verdict");
}

Verdict verdict_from_name(std::string_view name) {
  for (const Verdict verdict :
       {Verdict::no_gap, Verdict::recalibrate, Verdict::explained, Verdict::partly_explained, Verdict::unexplained})
    if (verdict_name(verdict) == name) return verdict;
  throw std::invalid_argument(
      fmt::format("verdict: \"{}\" is none of no_gap, recalibrate, explained, partly_explained, unexplained", name));
}

std::string Cause::name() const { return fmt::format("{}", fmt::join(effects, "+")); }

Diagnosis diagnose(const TransitionModel& model, const DiagnosisOptions& options) {
  check(model, options);
  const std::vector<const Candidate*> candidates = wanted(model, options.catalogue);
  const auto progress = [&](double share, const char* doing) {
    if (options.progress) options.progress(share, doing);
  };

  Diagnosis d;
  describe_data(d, model);

  progress(0, "the model as given");
  const std::vector<double> nominal = given_values(model);
  const Fit as_given = fit(model, nominal, {}, {.count = {}, .refit_nuisances = true, .most_iterations = 1});
  const Fit given = unfitted(model, nominal);
  d.gap.as_given = gap_map(model, given, options.draws / 2, options.seed);
  Fit recalibrated = best_fit(model, nominal, {});
  const auto rank = [&] {
    return rank_causes(model, recalibrated, candidates,
                       {.threads = options.threads,
                        .draws = options.draws,
                        .seed = options.seed,
                        .pairs = wanted_pairs(candidates, options.catalogue),
                        .progress = [&](double share) { progress(0.1 + 0.5 * share, "which effect"); }});
  };
  CauseRanking ranking = rank();
  // What an effect seems to gain may be a better optimum that its fit came upon.
  if (std::optional<Fit> other = other_recalibration(model, recalibrated, ranking)) {
    recalibrated = *std::move(other);
    ranking = rank();
  }
  d.gap.contact = contact_estimates(model, recalibrated);
  const double recalibration_gain = 2 * (recalibrated.penalised - given.penalised);
  d.gap.p_recalibration = recalibration_p_value(model, as_given, recalibration_gain);

  progress(0.6, "where the gap lies");
  d.gap.recalibrated = gap_map(model, recalibrated, options.draws, options.seed);

  d.causes.stepwise = stepwise_selection(model, recalibrated, ranking);
  std::vector<LeftInFacet> left = left_by_facet(model, recalibrated, 0, 0);
  const double of_left = evidence_of_more(left);
  d.causes.unnamed.push_back({{}, of_left, std::move(left)});
  EffectScan variations;
  if (ranking.scan.trials_suffice) variations = scan_variations(model, recalibrated, options.threads);
  d.gap.p_variations = variations_p_value(variations, promised_gains(variations), options.draws, options.seed);
  std::vector<LeftInFacet> varied;
  const auto fit_variations = [&] {
    progress(0.66, "what has no name");
    varied = fitted_variations(model, recalibrated, variations, options.threads,
                               [&] { progress(0.66, "what has no name"); });
  };
  if (d.gap.p_variations < options.level) {  // what scores promise, fits must keep
    fit_variations();
    std::vector<double> gains;
    for (const LeftInFacet& one : varied) gains.push_back(std::max(0.0, one.quadratic - 2 * recalibrated.promised));
    d.gap.p_variations =
        std::max(d.gap.p_variations, variations_p_value(variations, gains, options.draws, options.seed));
  }
  test_for_gap(d, ranking, candidates.size(), recalibrated);
  note_what_is_rough(d, ranking, recalibrated, recalibration_gain);
  leave_undecided(d, ranking, candidates);
  const std::vector<const RankedCause*> ordered = hypotheses(d, model, ranking);
  const bool gap = d.gap.p_value < options.level;

  if (gap && ranking.scan.trials_suffice) {
    if (varied.empty()) fit_variations();
    Unnamed& alone = d.causes.unnamed.front();
    std::ranges::move(varied, std::back_inserter(alone.facets));
    alone.evidence = evidence_of_more(alone.facets);
  }
  Chosen chosen{&recalibrated, {}};
  if (gap && !ordered.empty() && ordered.front()->evidence > 0 && !ordered.front()->fit.nuisance.empty()) {
    progress(0.68, "what is left");
    chosen = choose(d, model, ranking, ordered, recalibrated, options);
  } else {
    d.gap.left = d.gap.recalibrated;
    if (gap) chosen.unnamed.alone = certain_odds;  // something stands out, and no effect does
  }
  progress(0.7, "how far it shrinks");
  const bool named = chosen.fit != &recalibrated;
  if (named) d.causes.size = model.size_in_words(chosen.fit->terms);
  HeldOutGap held_out;
  if (d.data.trials >= trials_for_folds(options.folds))
    held_out =
        gap_shrinkage(model, given, recalibrated, named ? rivals(ordered) : std::vector<const Fit*>{}, options.folds,
                      options.threads, options.seed, [&] { progress(0.7, "how far it shrinks"); });
  d.shrinkage.measures = held_out.measures;
  // Even a cause that closes nearly all of a huge gap may leave a large one.
  if (named && !d.shrinkage.measures.empty() && leaves_gap_held_out(d, chosen.bent, 0)) {
    const double by_itself = gap_by_itself(model, *chosen.fit, options.folds, options.threads, options.seed,
                                           [&] { progress(0.85, "how far it shrinks"); });
    if (leaves_gap_held_out(d, chosen.bent, std::max(0.0, by_itself))) chosen.unnamed.left = certain_odds;
  }
  if (gap && trials_to_explain(d)) chosen.unnamed.alone = std::max(chosen.unnamed.alone, even_odds);
  const double share_of_effects =
      share_probabilities(d, model, ranking, ordered, candidates.size(), gap, chosen.unnamed);
  give_verdict(d, gap, chosen.unnamed, share_of_effects);
  if (!d.causes.at_work.empty() && !d.shrinkage.measures.empty() && d.shrinkage.measures.front().closed)
    add_closed_shares(d, model, ranking, given, recalibrated, held_out.gap, options,
                      [&] { progress(0.86, "what each effect closes"); });

  progress(0.88, "steps before failure");
  d.shrinkage.steps = steps_before_failure(model, nominal, recalibrated, *chosen.fit, options.seed);
  if (const auto [at_risk, rests] = model.rests(); at_risk > 0 && !d.shrinkage.measures.empty())
    d.shrinkage.measures.push_back(rest_shrinkage(at_risk, rests, d.shrinkage.steps));
  d.shrinkage.profile = collision_profile(model, nominal, *chosen.fit, options.seed);
  progress(0.93, "what could not be seen");
  d.limits.missing = missing_columns(model, recalibrated, candidates, options.threads, options.seed);
  d.limits.not_possible = too_few(model, d, options);
  if (d.verdict == Verdict::explained && d.causes.set.size() > 1 && ordered.size() > 1)
    d.limits.next = next_experiments(model, ordered[0]->fit, ordered[1]->terms, options.threads, options.seed);
  progress(1, "done");
  d.sentences = sentences(d);
  return d;
}

Diagnosis diagnose(std::shared_ptr<const TransitionModel> model, const DiagnosisOptions& options) {
  if (!model) throw std::invalid_argument("diagnose: there is no model");
  Diagnosis answer = diagnose(*model, options);
  answer.model = std::move(model);
  return answer;
}

}  // namespace metastable::analysis
