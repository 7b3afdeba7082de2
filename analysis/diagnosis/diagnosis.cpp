#include "analysis/diagnosis/diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "analysis/diagnosis/cause_ranking.h"
#include "analysis/diagnosis/collision_profile.h"
#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/diagnosis/gap_map.h"
#include "analysis/diagnosis/gap_shrinkage.h"
#include "analysis/diagnosis/left_over.h"
#include "analysis/diagnosis/missing_columns.h"
#include "analysis/diagnosis/too_few.h"
#include "analysis/diagnosis/visibility.h"
#include "analysis/statistics/interval_95.h"
#include "dynamics/wheel/effect_catalogue.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

// These levels decide whether there is a gap.
constexpr double share_for_effects = 0.85;  // of the level; the rest is for gaps that no effect describes:
constexpr double share_for_facets = 0.05;   //   in all cells of a facet together, the others in one cell
constexpr double share_for_pairs = 0.1;     // on top: pairs whose effects hide one another; hardly ever used up
constexpr double recalibration_level = 0.02;
constexpr double least_p_value = 1e-12;  // smaller ones are beyond what chance levels can say

// These levels say what the best hypothesis may leave before none of all is believed.
constexpr double left_over_level = 0.003;  // of the map's p-value
constexpr double left_over_square = 15;    // of a cell's statistic, beyond the model error
constexpr double least_left_over = 0.05;   // held-out gap that counts as one [nats a collision]
constexpr double least_left_in_all = 6;    //   or that no draw of the trials takes away [nats, all collisions]
constexpr double left_over_errors = 6;     // squared model errors of the gap as given that count as none, held out
constexpr double facet_errors = 3;         // squared model errors that may be spread over the cells of a facet
constexpr double largest_log_odds = 300;   // of none: their exponential stays finite
// Prior odds of something without a name: to one effect of the catalogue; beside a hypothesis to the hypothesis alone.
constexpr double unnamed_alone = 4, unnamed_beside = 0.03;
constexpr std::size_t most_beside = 3;  // hypotheses beside which it is supposed, the recalibrated model not counted,
constexpr double beside_margin = 12;    //   whose evidence is no further behind the best
constexpr double certain = 1e6;         // odds of none where a test decides against all that were fitted

// These numbers are of odds and sets.
constexpr double none_prior = 0.01;      // odds of none to a gap where nothing is left over
constexpr double set_share = 0.95;       // of what the effects share that the set holds
constexpr double least_of_first = 0.05;  // one less likely than this share of the first is not named for completeness

constexpr std::size_t most_rivals = 3;  // hypotheses that compete in each fold of the cross-validation:
constexpr double rival_evidence = 4;    //   those no further behind the best. Saves time
// A recalibration that did not settle is mentioned beyond this rise that its slope still promises.
constexpr double told_apart = 6;                             // 2 Delta log likelihood that makes odds of 20 to 1
constexpr double settled_rise = 0.5, settled_share = 0.005;  // of the log likelihood; of the largest gain found

constexpr double score_90 = 1.6448536269514722;  // half-width of a two-sided interval

// Says how likely a quadratic form of the nuisances' scores is as large by chance: the prior shrinks each direction of
// the information.
double recalibration_p_value(const TransitionModel& model, const Fit& as_given, double gain) {
  const Eigen::Index size = as_given.information.rows();
  Eigen::MatrixXd root_prior = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index p = 0; p < size; ++p) root_prior(p, p) = model.nuisances()[static_cast<std::size_t>(p)].prior_sd;
  // In units of the prior the information has eigenvalues l; a direction's share of chance gain is l/(1+l) chi^2_1.
  const Eigen::VectorXd eigenvalues = markov::symmetric_eigen(root_prior * as_given.information * root_prior).values;
  double mean = 0, variance = 0;
  for (const double one : eigenvalues) {
    const double l = std::max(0.0, one - 1);  // the prior is part of the information
    const double weight = l / (1 + l);
    mean += weight;
    variance += 2 * weight * weight;
  }
  if (!(mean > 0)) return 1;
  // By Satterthwaite it is a chi-squared of the same mean and variance.
  const double scale = variance / (2 * mean), degrees = mean / scale;
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees), std::max(0.0, gain) / scale));
}

// Two effects may hide one another from the scores of each alone: judges the best pair's gain, for all pairs there are.
double pairs_p_value(const CauseRanking& ranking, std::size_t effects, const Fit& recalibrated) {
  double least = 1;
  if (!ranking.scan.trials_suffice) return least;
  const double pairs = 0.5 * static_cast<double>(effects) * (static_cast<double>(effects) - 1);
  for (const RankedCause& pair : ranking.pairs) {
    if (!pair.fit.converged) continue;
    double parameters = 0, looks = pairs;  // variants among them
    for (const EffectTerm& term : pair.terms) {
      parameters += static_cast<double>(term.values.size());
      looks *= static_cast<double>(term.candidate->variants.size());
    }
    const double gain = std::max(0.0, pair.gain - 2 * recalibrated.promised);
    least =
        std::min(least, looks * boost::math::cdf(boost::math::complement(boost::math::chi_squared(parameters), gain)));
  }
  return least;
}

// Takes the facet with the least p-value, for as many facets.
double facets_p_value(const CauseRanking& ranking, const std::vector<LeftInFacet>& facets) {
  double least = 1;
  if (!ranking.scan.trials_suffice) return least;
  for (const LeftInFacet& facet : facets) least = std::min(least, facet.p_value);
  return std::min(1.0, least * static_cast<double>(facets.size()));
}

std::vector<EstimatedParameter> estimates(const EffectTerm& term, const Eigen::MatrixXd& covariance,
                                          Eigen::Index first) {
  const std::vector<double>& variant = term.variant;
  const std::vector<NamedValue> here = term.candidate->report(variant, term.values);
  std::vector<EstimatedParameter> all;
  for (const NamedValue& one : here) all.push_back({one.first, one.second, one.second, one.second, false});
  const auto count = term.values.size();
  if (count == 1) {  // reported numbers are monotone in the one value: its ends are theirs
    const FreeParameter& p = term.candidate->parameters[0];
    const double half = score_90 * std::sqrt(std::max(0.0, covariance(first, first)));
    for (const double end : {-half, half}) {
      const auto there = term.candidate->report(variant, {std::clamp(term.values[0] + end, p.lower, p.upper)});
      for (std::size_t k = 0; k < all.size(); ++k) {
        all[k].lower = std::min(all[k].lower, there[k].second);
        all[k].upper = std::max(all[k].upper, there[k].second);
        all[k].fitted = all[k].fitted || there[k].second != here[k].second;
      }
    }
    return all;
  }
  // The slopes of the reported numbers carry the covariance over.
  for (std::size_t k = 0; k < all.size(); ++k) {
    Eigen::VectorXd slope(static_cast<Eigen::Index>(count));
    for (std::size_t p = 0; p < count; ++p) {
      std::vector<double> moved = term.values;
      const double step = term.candidate->parameters[p].step;
      moved[p] += step;
      slope[static_cast<Eigen::Index>(p)] = (term.candidate->report(variant, moved)[k].second - here[k].second) / step;
    }
    const auto block = covariance.block(first, first, slope.size(), slope.size());
    const double half = score_90 * std::sqrt(std::max(0.0, slope.dot(block * slope)));
    all[k].lower -= half;
    all[k].upper += half;
    all[k].fitted = half > 0;
  }
  return all;
}

Cause describe(const TransitionModel& model, const RankedCause& ranked) {
  Cause cause;
  for (const EffectTerm& term : ranked.terms) cause.effects.push_back(term.candidate->id);
  cause.gain = ranked.gain;
  cause.p_value = ranked.p_value;
  cause.evidence = ranked.evidence;
  cause.not_decided = ranked.not_decided;
  if (ranked.fit.information.rows() == 0) {
    cause.parameters.resize(ranked.terms.size());
    return cause;
  }
  Eigen::MatrixXd steadied = ranked.fit.information;
  steadied.diagonal().array() += 1e-12;
  const Eigen::MatrixXd covariance =
      markov::solve_columns(steadied, Eigen::MatrixXd::Identity(steadied.rows(), steadied.cols()));
  auto first = static_cast<Eigen::Index>(model.nuisances().size());
  for (const EffectTerm& term : ranked.terms) {
    cause.parameters.push_back(estimates(term, covariance, first));
    first += static_cast<Eigen::Index>(term.values.size());
  }
  return cause;
}

// A number that one nuisance alone moves lies between its values at that one's ends, inside its bounds.
void keep_positive(const TransitionModel& model, const Fit& fit, const Eigen::MatrixXd& covariance,
                   const Eigen::VectorXd& slope, std::size_t number, EstimatedParameter& estimate) {
  if ((slope.array() != 0).count() != 1) return;
  Eigen::Index p = 0;
  slope.cwiseAbs().maxCoeff(&p);
  const Nuisance& n = model.nuisances()[static_cast<std::size_t>(p)];
  const double half = score_90 * std::sqrt(std::max(0.0, covariance(p, p)));
  const auto at = [&](double value) {
    std::vector<double> moved = fit.nuisance;
    moved[static_cast<std::size_t>(p)] = std::clamp(value, n.lower, n.upper);
    return model.report_nuisances(moved)[number].second;
  };
  const double here = fit.nuisance[static_cast<std::size_t>(p)];
  std::tie(estimate.lower, estimate.upper) = std::minmax({at(here - half), at(here + half)});
}

// Intervals follow the slopes of the reported numbers, unless those take a positive one below zero.
std::vector<EstimatedParameter> contact_estimates(const TransitionModel& model, const Fit& fit) {
  const Eigen::MatrixXd covariance =
      markov::solve_columns(fit.information, Eigen::MatrixXd::Identity(fit.information.rows(), fit.information.cols()));
  std::vector<EstimatedParameter> all;
  const std::vector<NamedValue> here = model.report_nuisances(fit.nuisance);
  for (std::size_t k = 0; k < here.size(); ++k) {
    Eigen::VectorXd slope(covariance.rows());
    for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
      std::vector<double> moved = fit.nuisance;
      moved[p] += model.nuisances()[p].step;
      slope[static_cast<Eigen::Index>(p)] =
          (model.report_nuisances(moved)[k].second - here[k].second) / model.nuisances()[p].step;
    }
    const double half = score_90 * std::sqrt(std::max(0.0, slope.dot(covariance * slope)));
    all.push_back({here[k].first, here[k].second, here[k].second - half, here[k].second + half, true});
    if (here[k].second > 0 && all.back().lower < 0) keep_positive(model, fit, covariance, slope, k, all.back());
  }
  return all;
}

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

// Returns the one or two effects that an entry of the catalogue names. It throws for unknown ones.
std::vector<std::string> effects_of(const std::string& entry) {
  const auto plus = entry.find('+');
  std::vector<std::string> ids{entry.substr(0, plus)};
  if (plus != std::string::npos) ids.push_back(entry.substr(plus + 1));
  for (const std::string& id : ids) dynamics::effect_info(id);
  if (ids.front() == ids.back() && ids.size() == 2)
    throw std::invalid_argument(fmt::format("effect: \"{}\" is not a pair of two effects", entry));
  return ids;
}

void check(const DiagnosisOptions& options) {
  if (options.draws < 200) throw std::invalid_argument(fmt::format("draws: {} is below 200", options.draws));
  if (options.folds < 2) throw std::invalid_argument(fmt::format("folds: {} is below 2", options.folds));
  if (!(options.level > 0 && options.level < 0.5))
    throw std::invalid_argument(fmt::format("level: {} is outside (0, 0.5)", options.level));
  for (const std::string& entry : options.catalogue) effects_of(entry);
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
  given.log_likelihood = given.evaluation.total();
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
  d.gap.refitted = model.recalibrated();
}

// What the data hold no information on is not decided, whatever its evidence.
void leave_undecided(Diagnosis& d, CauseRanking& ranking, const std::vector<const Candidate*>& candidates) {
  d.limits.visible = visibility(ranking.scan, candidates);
  for (std::size_t i = 0; i < ranking.singles.size(); ++i)
    if (ranking.singles[i].not_decided.empty() && !candidates[i]->parameters.empty() &&
        d.limits.visible[i].smallest == 0)
      ranking.singles[i].not_decided = d.limits.visible[i].undecidable;
}

// Puts the tests for a gap together.
void test_for_gap(Diagnosis& d, const CauseRanking& ranking, std::size_t candidates, const Fit& recalibrated) {
  d.gap.p_effects = std::max(least_p_value, ranking.p_value);
  d.gap.p_where = std::max(least_p_value, d.gap.recalibrated.p_value);
  d.gap.p_facets = std::max(least_p_value, facets_p_value(ranking, d.causes.unnamed.front().facets));
  d.gap.p_recalibration = std::max(least_p_value, d.gap.p_recalibration);
  const double pairs = std::max(least_p_value, pairs_p_value(ranking, candidates, recalibrated));
  d.gap.p_value =
      std::min({1.0, d.gap.p_effects / share_for_effects, d.gap.p_where / (1 - share_for_effects - share_for_facets),
                d.gap.p_facets / share_for_facets, pairs / share_for_pairs});
  d.gap.p_as_given = std::min(1.0, 2 * std::min(d.gap.p_recalibration, d.gap.p_value));
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

// Lists all hypotheses by falling evidence; those that are not decided go to the diagnosis.
std::vector<const RankedCause*> hypotheses(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking) {
  std::vector<const RankedCause*> ordered;
  for (const RankedCause& cause : ranking.singles) {
    if (cause.not_decided.empty())
      ordered.push_back(&cause);
    else
      d.causes.not_decided.push_back(describe(model, cause));
  }
  for (const RankedCause& pair : ranking.pairs) {
    if (std::isfinite(pair.evidence))
      ordered.push_back(&pair);
    else
      d.causes.not_decided.push_back(describe(model, pair));
  }
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const RankedCause* a, const RankedCause* b) { return a->evidence > b->evidence; });
  return ordered;
}

// Holds the best hypothesis and what speaks against it.
struct Chosen {
  const Fit* fit = nullptr;  // the recalibrated model where no hypothesis is worth having
  double none = 0;           // odds that it is none of the catalogue
  double bent = 1;           // share of its gain that an error of form may bend
};

// Says whether a hypothesis adds an effect to a likelier one: what it leaves is then the likelier one's to leave.
bool extends_likelier(const RankedCause& cause, const std::vector<const RankedCause*>& ordered) {
  const auto holds = [&](const EffectTerm& wanted) {
    return std::any_of(cause.terms.begin(), cause.terms.end(),
                       [&](const EffectTerm& term) { return term.candidate == wanted.candidate; });
  };
  for (const RankedCause* likelier : ordered) {
    if (likelier == &cause) return false;
    if (std::all_of(likelier->terms.begin(), likelier->terms.end(), holds)) return true;
  }
  return false;
}

// Supposes something without a name alone and beside the likeliest hypotheses. Returns its odds to all hypotheses; few
// trials cannot show that events scatter as they would by themselves, and facets are then not judged.
double odds_of_unnamed(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
                       const std::vector<const RankedCause*>& ordered, const Fit& recalibrated) {
  if (!ranking.scan.trials_suffice) return 0;
  const double top = ordered.front()->evidence;
  double all = 0, joined = 0, beside = 0;  // hypotheses, those of them that are joined, and those joined
  for (const RankedCause* cause : ordered) {
    all += std::exp(cause->evidence - top);
    if (d.causes.unnamed.size() > most_beside || cause->evidence < top - beside_margin) continue;
    if (cause->fit.nuisance.empty() || extends_likelier(*cause, ordered)) continue;
    const PhaseGain gained = phase_gain(model, cause->fit, exact_part(ranking.singles, cause->terms, recalibrated));
    constexpr double tolerated = facet_errors * model_error * model_error;
    Unnamed one{{},
                cause->evidence,
                left_by_facet(model, cause->fit, tolerated * gained.collisions, tolerated * gained.stances)};
    for (const EffectTerm& term : cause->terms) one.beside.push_back(term.candidate->id);
    one.evidence += evidence_of_more(one.facets);
    joined += std::exp(cause->evidence - top);
    beside += std::exp(std::min(largest_log_odds, one.evidence - top));
    d.causes.unnamed.push_back(std::move(one));
  }
  Unnamed& alone = d.causes.unnamed.front();
  alone.evidence = evidence_of_more(alone.facets);
  return unnamed_alone * std::exp(std::min(largest_log_odds, alone.evidence - top)) / all +
         (joined > 0 ? unnamed_beside * beside / joined : 0);
}

// What the best hypothesis leaves on the map is judged beyond its own model error.
Chosen choose(Diagnosis& d, const TransitionModel& model, const CauseRanking& ranking,
              const std::vector<const RankedCause*>& ordered, const Fit& recalibrated,
              const DiagnosisOptions& options) {
  const RankedCause& best = *ordered.front();
  Chosen chosen{&best.fit};
  d.gap.left = gap_map(model, best.fit, options.draws, options.seed + 1);
  const Fit& exact = exact_part(ranking.singles, best.terms, recalibrated);
  PhaseGain gained = phase_gain(model, best.fit, exact);
  if (model.refits_noise()) {  // how large the effect is beside the noise that it leaves, not beside what swallowed it
    Fit without;
    without.evaluation = model.evaluate(best.fit.nuisance, {});
    gained = phase_gain(model, best.fit, without);
  }
  const double all = best.fit.log_likelihood - recalibrated.log_likelihood;
  if (all > 0) chosen.bent = std::clamp((best.fit.log_likelihood - exact.log_likelihood) / all, 0.0, 1.0);
  const double tolerated = model_error * model_error;
  const double beyond = d.gap.left.largest_beyond(tolerated * gained.collisions, tolerated * gained.stances);
  if (d.gap.left.p_value < left_over_level && beyond > left_over_square)
    chosen.none = std::exp(std::min(largest_log_odds, 0.5 * (beyond - left_over_square)));
  chosen.none = std::max(chosen.none, odds_of_unnamed(d, model, ranking, ordered, recalibrated));
  d.causes.together = best.together;
  if (d.causes.together > most_together) chosen.none = std::max(chosen.none, certain);
  return chosen;
}

// Says whether trials that the cause was not fitted to still show a gap, beyond what its form may be off.
bool leaves_gap_held_out(const Diagnosis& d, double bent) {
  const Shrinkage& log_score = d.shrinkage.measures.front();
  const double tolerated = model_error * model_error * left_over_errors * bent * log_score.baseline;
  if (log_score.with_effect > least_left_over + tolerated) return true;
  return d.data.trials >= enough_trials && log_score.with_effect_least > tolerated &&
         log_score.with_effect * static_cast<double>(d.data.collisions) > least_left_in_all;
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

// Shares probabilities over everything; the prior gives a gap even odds, shared by the effects. Returns the share of
// the effects together.
double share_probabilities(Diagnosis& d, const TransitionModel& model, const std::vector<const RankedCause*>& ordered,
                           std::size_t candidates, bool gap, double none) {
  const double top = ordered.empty() ? 0 : std::max(0.0, ordered.front()->evidence);
  const double effects = std::max<double>(1, static_cast<double>(candidates));
  const double weight_null = std::exp(-top);
  double given_gap = 0;
  for (const RankedCause* cause : ordered) given_gap += std::exp(cause->evidence - top) / effects;
  // The tests decide whether there is a gap, because their levels are calibrated and the evidence's are not: where both
  // disagree, the odds of a gap go no further than even.
  none = std::max(none, none_prior);
  const double even = weight_null / (1 + none);
  double share = 1;
  if (given_gap > 0 && (gap ? given_gap < even : given_gap > even)) share = even / given_gap;
  const double weight_none = none * (given_gap > 0 ? share * given_gap : even);
  const double sum = weight_null + share * given_gap + weight_none;
  d.causes.p_none = weight_none / sum;
  (d.gap.p_recalibration < recalibration_level ? d.causes.p_recalibrate : d.causes.p_no_gap) = weight_null / sum;
  for (const RankedCause* cause : ordered) {
    Cause one = describe(model, *cause);
    one.probability = share * std::exp(cause->evidence - top) / effects / sum;
    d.causes.ranked.push_back(std::move(one));
  }
  return share * given_gap / sum;
}

// Lists what the design itself cannot tell from the first of the set.
void list_alike(Diagnosis& d) {
  const Cause& first = d.causes.ranked.front();
  const auto seen = std::ranges::find(d.limits.visible, first.name(), &Visibility::effect);
  if (seen == d.limits.visible.end()) return;  // a pair
  std::vector<std::string> alike;
  for (const std::string& name : d.causes.set) {
    const auto share = std::ranges::find(seen->alike, name, &std::pair<std::string, double>::first);
    if (name == first.name() || (share != seen->alike.end() && (1 - share->second) * first.gain < told_apart))
      alike.push_back(name);
  }
  if (alike.size() > 1) d.causes.alike = std::move(alike);
}

void give_verdict(Diagnosis& d, bool gap, double none, double share_of_effects) {
  if (!gap) {
    d.verdict = d.gap.p_recalibration < recalibration_level ? Verdict::recalibrate : Verdict::no_gap;
    if (d.verdict == Verdict::recalibrate) d.causes.set = {std::string(dynamics::contact_distribution_id)};
    return;
  }
  if (none >= 1) {
    d.verdict = Verdict::unexplained;
    return;
  }
  d.verdict = Verdict::explained;
  double covered = 0;
  for (const Cause& cause : d.causes.ranked) {
    if (covered >= set_share * share_of_effects ||
        cause.probability < least_of_first * d.causes.ranked.front().probability)
      break;
    d.causes.set.push_back(cause.name());
    covered += cause.probability;
  }
  list_alike(d);
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
    case Verdict::unexplained:
      return "unexplained";
  }
  throw std::logic_error("verdict_name: unknown verdict");
}

Verdict verdict_from_name(std::string_view name) {
  for (const Verdict verdict : {Verdict::no_gap, Verdict::recalibrate, Verdict::explained, Verdict::unexplained})
    if (verdict_name(verdict) == name) return verdict;
  throw std::invalid_argument(
      fmt::format("verdict: \"{}\" is none of no_gap, recalibrate, explained, unexplained", name));
}

std::string Cause::name() const { return fmt::format("{}", fmt::join(effects, "+")); }

Diagnosis diagnose(const TransitionModel& model, const DiagnosisOptions& options) {
  check(options);
  const std::vector<const Candidate*> candidates = wanted(model, options.catalogue);
  const auto progress = [&](double share, const char* doing) {
    if (options.progress) options.progress(share, doing);
  };

  Diagnosis d;
  describe_data(d, model);

  progress(0, "the model as given");
  const std::vector<double> nominal = nominal_values(model);
  const Fit as_given = fit(model, nominal, {}, {.count = {}, .refit_nuisances = true, .most_iterations = 1});
  const Fit given = unfitted(model, nominal);
  d.gap.as_given = gap_map(model, given, options.draws / 2, options.seed);
  const Fit recalibrated = best_fit(model, nominal, {});
  d.gap.contact = contact_estimates(model, recalibrated);
  const double recalibration_gain = 2 * (recalibrated.penalised - given.log_likelihood);
  d.gap.p_recalibration = recalibration_p_value(model, as_given, recalibration_gain);

  progress(0.1, "where the gap lies");
  d.gap.recalibrated = gap_map(model, recalibrated, options.draws, options.seed);

  CauseRanking ranking = rank_causes(model, recalibrated, candidates,
                                     {.threads = options.threads,
                                      .draws = options.draws,
                                      .seed = options.seed,
                                      .pairs = wanted_pairs(candidates, options.catalogue),
                                      .progress = [&](double share) { progress(0.15 + 0.5 * share, "which effect"); }});
  d.causes.stepwise = stepwise_selection(model, recalibrated, ranking);
  d.causes.unnamed.push_back({{}, 0, left_by_facet(model, recalibrated, 0, 0)});
  test_for_gap(d, ranking, candidates.size(), recalibrated);
  note_what_is_rough(d, ranking, recalibrated, recalibration_gain);
  leave_undecided(d, ranking, candidates);
  const std::vector<const RankedCause*> ordered = hypotheses(d, model, ranking);
  const bool gap = d.gap.p_value < options.level;

  Chosen chosen{&recalibrated};
  if (gap && !ordered.empty() && ordered.front()->evidence > 0 && !ordered.front()->fit.nuisance.empty()) {
    progress(0.68, "what is left");
    chosen = choose(d, model, ranking, ordered, recalibrated, options);
  } else {
    d.gap.left = d.gap.recalibrated;
    if (gap) chosen.none = certain;  // cells of the map stand out, and no effect does
  }
  progress(0.7, "how far it shrinks");
  const bool named = chosen.fit != &recalibrated;
  if (named) d.causes.size = model.size_in_words(chosen.fit->terms);
  if (d.data.trials >= trials_for_folds(options.folds))
    d.shrinkage.measures =
        gap_shrinkage(model, recalibrated, named ? rivals(ordered) : std::vector<const Fit*>{}, options.folds,
                      options.threads, options.seed, [&] { progress(0.7, "how far it shrinks"); });
  // Even a cause that closes nearly all of a huge gap may leave a large one.
  if (named && !d.shrinkage.measures.empty() && leaves_gap_held_out(d, chosen.bent))
    chosen.none = std::max(chosen.none, certain);
  const double share_of_effects = share_probabilities(d, model, ordered, candidates.size(), gap, chosen.none);
  give_verdict(d, gap, chosen.none, share_of_effects);

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
