#include "analysis/fitting/cause_ranking.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include "analysis/fitting/evidence.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// These numbers are the prior of pairs.
constexpr double pair_prior = 0.05;  // odds of two effects to one
constexpr double most_hidden = 0.3;  // logarithm of what one effect of a pair may hide of the other's gain

// They say which hypotheses are fitted; the others are weighed by what their scores promise. These save time, and
// decide only where scores promise far too little. Gains are 2 Delta log likelihood, evidence is a log Bayes factor.
constexpr double promise_share = 0.2;       // of the largest promised gain, less
constexpr double promise_margin = 40;       //   this much
constexpr double overlooked_margin = 12;    // evidence by the scores below the best fitted one, for a fit after all
constexpr double leader_evidence = 2;       // of an effect that is refined, and that pairs are built on
constexpr double refined_share = 0.7;       // of the best evidence, less
constexpr double refined_margin = 10;       //   this much, for an effect worth refining and another start
constexpr double refit_margin = 60;         // evidence below the best, for a fit that did not settle to be tried again
constexpr double pair_share = 2.8;          // of the gain of its stronger effect, most that a pair gains, more or less,
constexpr double pair_margin = 12;          //   this much: below the best gain, none is built on it
constexpr double least_pair_evidence = -4;  // promised beyond the first effect's, for a pair worth fitting
constexpr double alike_margin = 4;          // evidence promised below the best second effect's, for one worth fitting

// These numbers say how fits are run.
constexpr int law_steps = 12;          // of another law's fit, from either start
constexpr int more_law_steps = 60;     // where it may still come near
constexpr int more_steps = 4;          // times as many, where a fit near the top did not settle
constexpr double law_hopeless = -100;  // log likelihood below the recalibrated model's that no more steps make good

constexpr double strained = 2;  // cost of its priors [log likelihood], for a fit to be tried from what is stated

// These numbers say when an effect is fitted again from where a pair has it.
constexpr double gained_beside = 9;  // by the pair, beyond the effect's own gain
constexpr double lost_alone = 30;    // most that it is short of its own fit there, without the other [log likelihood]
constexpr std::size_t most_other_ways = 3;

// These numbers say when a fit that did not settle is decided all the same.
constexpr double law_refuted = -30;     // gain of another law: so far below that what it could still rise is nothing
constexpr double small_gain = 10;       // by fit and by scores: at the optimum up to what differences resolve
constexpr double rise_weight = 3;       // of the rise that the slope still promises, as evidence, and
constexpr double far_behind = 12;       //   evidence below the best that it leaves
constexpr double next_to_nothing = 2;   // promised rise of the log likelihood, plus
constexpr double share_of_gain = 1e-3;  //   this share of the gain

RankedCause as_cause(Fit fit) {
  RankedCause cause;
  cause.terms = fit.terms;
  if (!fit.converged) cause.not_decided = fit.reason;
  cause.fit = std::move(fit);
  return cause;
}

// Gives up a hypothesis whose likelihood is not finite anywhere the fit began.
void give_up(RankedCause& cause) {
  cause.not_decided = cause.fit.reason.empty() ? "its likelihood is not finite" : cause.fit.reason;
  cause.gain = 0;
  cause.evidence = -std::numeric_limits<double>::infinity();
}

bool fitted(const RankedCause& cause) { return !cause.fit.nuisance.empty(); }

// Ranks in steps, in the order in which they are taken.
class Ranker {
 public:
  Ranker(const TransitionModel& model, const Fit& recalibrated, const std::vector<const Candidate*>& candidates,
         const RankingOptions& options)
      : model_(model),
        recalibrated_(recalibrated),
        candidates_(candidates),
        options_(options),
        threads_(options.threads),
        effort_(effort_for(model, recalibrated)),
        scan_(scan_effects(model, recalibrated, candidates, options.threads)),
        chance_(scan_, options.draws, options.seed),
        singles_(candidates.size()),
        refined_(candidates.size()) {}

  void fit_singles();
  void fit_overlooked();
  void refit_from_stated();
  void refine_leaders();
  void refit_unsettled();
  void decide_unsettled();
  void scan_pairs();
  void scan_asked_pairs();
  void fit_pairs();
  void refit_from_pairs();
  void refine_paired();
  void complete_pairs();
  void bound_pairs();
  void reach(double share) {
    share_ = share;
    heartbeat();
  }
  CauseRanking result() {
    return {std::move(scan_), std::move(singles_), std::move(pairs_), chance_.look_elsewhere(least_p_)};
  }

 private:
  struct Try {
    std::size_t leader;
    ScannedEffect second;
  };

  // Beats before every fit, so that who waits can stop.
  void heartbeat() const {
    const std::lock_guard lock(speaking_);
    if (options_.progress) options_.progress(share_);
  }
  const EffectScan& scan_beside(std::size_t leader);
  void try_beside(std::size_t leader);
  std::size_t index_of(const Candidate* candidate) const;
  void refine_single(std::size_t i);
  void fit_law(RankedCause& cause) const;
  void fit_effect(RankedCause& cause, const ScannedEffect& scanned) const;
  void take(RankedCause& cause, Fit better) const;
  void take_again(std::size_t i, Fit better);
  bool near_the_top(const RankedCause& cause) const;
  double gain_apart(const RankedCause& pair) const;
  double measure_second(RankedCause& pair) const;
  double gain(const Fit& fit) const { return 2 * (fit.penalised - recalibrated_.penalised); }
  double p_value(const Candidate* candidate, double gain) const;
  std::vector<std::size_t> leaders(bool to_refine) const;

  const TransitionModel& model_;
  const Fit& recalibrated_;
  const std::vector<const Candidate*>& candidates_;
  const RankingOptions& options_;
  int threads_;
  Effort effort_;
  EffectScan scan_;
  ChanceGains chance_;
  std::vector<RankedCause> singles_, pairs_;
  std::vector<char> refined_;                 // by single effect: its variant, between the listed ones
  std::map<std::size_t, EffectScan> beside_;  // by leader: of all others beside its fit
  std::vector<Try> tries_;
  double least_p_ = 1;  // of the single effects as listed: chance is drawn for those
  double share_ = 0;
  mutable std::mutex speaking_;
  double top_ = 0;  // evidence of the best of them
};

// Says how likely one effect alone gains as much by chance.
double Ranker::p_value(const Candidate* candidate, double gain) const {
  if (candidate->parameters.empty()) return 2 * dynamics::normal_cdf(-std::sqrt(std::max(0.0, gain)));
  return chance_.p_value(candidate, gain);
}

// Another law has nothing to scan. Contact parameters that suit one law mislead under the other: the nominal ones are a
// start, too.
void Ranker::fit_law(RankedCause& cause) const {
  const auto from = [&](const std::vector<double>& nuisance, int iterations) {
    return fit(model_, nuisance, cause.terms, {.count = {}, .refit_nuisances = true, .most_iterations = iterations});
  };
  cause.fit = from(nominal_values(model_), law_steps);
  Fit other = from(recalibrated_.nuisance, law_steps);
  if (other.penalised > cause.fit.penalised) cause.fit = std::move(other);
  if (!cause.fit.converged && cause.fit.penalised - recalibrated_.penalised > law_hopeless)
    cause.fit = from(cause.fit.nuisance, std::min(more_law_steps, 4 * effort_.most_iterations));
  cause.gain = gain(cause.fit);
  // What is far below and hardly rises any more is decided against.
  if (!cause.fit.converged && cause.gain > law_refuted) cause.not_decided = cause.fit.reason;
  cause.p_value = p_value(cause.terms[0].candidate, cause.gain);
  cause.evidence = 0.5 * cause.gain;
}

void Ranker::fit_effect(RankedCause& cause, const ScannedEffect& scanned) const {
  cause = as_cause(fit_one_more(model_, effort_, recalibrated_, scanned));
  cause.gain = gain(cause.fit);
  if (!std::isfinite(cause.gain)) return give_up(cause);
  // These are at the optimum up to what the differences resolve: small gains that the scores confirm are decided.
  if (cause.gain < small_gain && scanned.gain[scanned.best] < small_gain) cause.not_decided.clear();
  cause.p_value = p_value(scanned.candidate, cause.gain);
  cause.evidence = evidence_of(scanned, std::max(0.0, cause.gain));
}

void Ranker::fit_singles() {
  double largest = 0;
  for (const ScannedEffect& effect : scan_.effects) largest = std::max(largest, effect.gain[effect.best]);
  markov::parallel_for(candidates_.size(), threads_, [&](std::size_t i) {
    heartbeat();
    const Candidate* candidate = candidates_[i];
    RankedCause& cause = singles_[i];
    cause.terms = {EffectTerm{candidate, candidate->variants[0], {}}};
    if (!candidate->undecidable.empty()) {
      cause.not_decided = candidate->undecidable;
      cause.evidence = -std::numeric_limits<double>::infinity();
      return;
    }
    if (candidate->parameters.empty()) return fit_law(cause);
    const ScannedEffect& scanned = *scan_.find(candidate);
    const double promised = scanned.gain[scanned.best];
    // Where the model knows better starts than the scores, the scores do not decide.
    if (!model_.starts(std::vector{term_at(scanned, scanned.best)}).empty() ||
        (promised >= effort_.least_promise && promised >= promise_share * largest - promise_margin))
      return fit_effect(cause, scanned);
    cause.gain = promised;
    cause.evidence = evidence_of(scanned, promised);
    cause.terms = {term_at(scanned, scanned.best)};
    cause.p_value = p_value(candidate, promised);
  });
}

// Scores promise too much now and then: whoever would come near the fitted ones is fitted after all.
void Ranker::fit_overlooked() {
  double best = 0;
  for (const RankedCause& cause : singles_)
    if (fitted(cause)) best = std::max(best, cause.evidence);
  markov::parallel_for(singles_.size(), threads_, [&](std::size_t i) {
    heartbeat();
    RankedCause& cause = singles_[i];
    if (cause.candidate_undecided() || fitted(cause) || cause.evidence < std::max(0.0, best - overlooked_margin))
      return;
    fit_effect(cause, *scan_.find(candidates_[i]));
  });
  for (const RankedCause& cause : singles_)
    if (!cause.candidate_undecided()) {
      least_p_ = std::min(least_p_, cause.p_value);
      top_ = std::max(top_, cause.evidence);
    }
}

// Lists the strongest fitted effects by falling evidence. `to_refine`: of those with variants between the listed ones.
std::vector<std::size_t> Ranker::leaders(bool to_refine) const {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < singles_.size(); ++i)
    if (singles_[i].evidence > leader_evidence && fitted(singles_[i]) &&
        (!to_refine || !singles_[i].terms[0].candidate->refine.empty()))
      all.push_back(i);
  std::sort(all.begin(), all.end(),
            [&](std::size_t a, std::size_t b) { return singles_[a].evidence > singles_[b].evidence; });
  if (all.size() > effort_.most_leaders) all.resize(effort_.most_leaders);
  if (to_refine || all.empty()) return all;
  double best = 0;
  for (const std::size_t i : all)
    if (singles_[i].not_decided.empty()) best = std::max(best, singles_[i].gain);
  std::erase_if(all, [&](std::size_t i) { return pair_share * singles_[i].gain + pair_margin < best; });
  return all;
}

// Takes a better fit of the same effect: the likelihoods of its other variants, and so its prior, stay what they were.
void Ranker::take(RankedCause& cause, Fit better) const {
  const double now = gain(better);
  cause.evidence += 0.5 * (now - cause.gain);
  cause.gain = now;
  cause.fit = std::move(better);
  cause.terms = cause.fit.terms;
}

// Takes a better fit of a single effect. Where its variant is refined the p-value stays that of the listed ones: chance
// has not been drawn between them.
void Ranker::take_again(std::size_t i, Fit better) {
  RankedCause& cause = singles_[i];
  cause.not_decided = better.converged ? "" : better.reason;
  take(cause, std::move(better));
  if (!refined_[i]) cause.p_value = p_value(cause.terms[0].candidate, cause.gain);
}

bool Ranker::near_the_top(const RankedCause& cause) const {
  return cause.evidence >= refined_share * top_ - refined_margin;
}

// What a recalibration did to take a large effect up may hold the effect's fit off its optimum, which then strains the
// nuisances: the stated ones are a start, too.
void Ranker::refit_from_stated() {
  const std::vector<double> stated = nominal_values(model_);
  markov::parallel_for(singles_.size(), threads_, [&](std::size_t i) {
    heartbeat();
    RankedCause& cause = singles_[i];
    if (!fitted(cause) || cause.terms[0].candidate->parameters.empty() || !near_the_top(cause) ||
        cause.fit.log_likelihood - cause.fit.penalised < strained)
      return;
    Fit other = fit(model_, stated, cause.terms,
                    {.count = {}, .refit_nuisances = true, .most_iterations = effort_.most_iterations});
    if (other.penalised > cause.fit.penalised) take_again(i, std::move(other));
  });
  for (const RankedCause& cause : singles_)
    if (!cause.candidate_undecided()) top_ = std::max(top_, cause.evidence);
}

void Ranker::refine_leaders() {
  const std::vector<std::size_t> strongest = leaders(true);
  markov::parallel_for(strongest.size(), threads_, [&](std::size_t k) {
    heartbeat();
    if (near_the_top(singles_[strongest[k]])) refine_single(strongest[k]);
  });
}

void Ranker::refine_single(std::size_t i) {
  Fit refined = singles_[i].fit;
  refine_variant(model_, effort_, refined);
  take(singles_[i], std::move(refined));
  refined_[i] = true;
}

// Fits once more where a fit did not settle near the top: further along its own way, and from the nuisances that suit
// the leader.
void Ranker::refit_unsettled() {
  if (singles_.empty()) return;
  const auto best = std::max_element(singles_.begin(), singles_.end(), [](const RankedCause& a, const RankedCause& b) {
    return a.evidence < b.evidence;
  });
  const std::vector<double> leaders_nuisance = best->fit.nuisance;
  markov::parallel_for(singles_.size(), threads_, [&](std::size_t i) {
    heartbeat();
    RankedCause& cause = singles_[i];
    if (cause.fit.converged || !fitted(cause) || leaders_nuisance.empty() || cause.evidence < top_ - refit_margin)
      return;
    const auto fit_from = [&](const std::vector<double>& nuisance, int times) {
      return fit(model_, nuisance, cause.terms,
                 {.count = {}, .refit_nuisances = true, .most_iterations = times * effort_.most_iterations});
    };
    Fit again = fit_from(cause.fit.nuisance, more_steps);
    if (!again.converged && &cause != &*best)
      if (Fit other = fit_from(leaders_nuisance, 1); other.penalised > again.penalised) again = std::move(other);
    if (again.penalised > cause.fit.penalised) take_again(i, std::move(again));
  });
  for (const RankedCause& cause : singles_)
    if (!cause.candidate_undecided()) top_ = std::max(top_, cause.evidence);
}

// A fit that did not settle is decided where all it could still rise leaves it far behind, or is next to nothing.
void Ranker::decide_unsettled() {
  for (RankedCause& cause : singles_)
    if (!cause.candidate_undecided() && fitted(cause) && std::isfinite(cause.evidence) &&
        (cause.evidence + rise_weight * cause.fit.promised < top_ - far_behind ||
         cause.fit.promised < next_to_nothing + share_of_gain * cause.gain))
      cause.not_decided.clear();
}

double pair_log_prior(std::size_t candidates) {
  return std::log(pair_prior / std::max(1.0, 0.5 * static_cast<double>(candidates - 1)));
}

// Says whether the model itself tells where the last term starts beside the others.
bool knows_start(const TransitionModel& model, const std::vector<EffectTerm>& terms) {
  const std::vector<FitStart> starts = model.starts(terms);
  return std::any_of(starts.begin(), starts.end(),
                     [&](const FitStart& start) { return start.values.back() != terms.back().values; });
}

// Scans again what a leader leaves.
const EffectScan& Ranker::scan_beside(std::size_t leader) {
  if (const auto known = beside_.find(leader); known != beside_.end()) return known->second;
  const RankedCause& first = singles_[leader];
  std::vector<const Candidate*> others;
  for (const Candidate* other : candidates_)
    if (other != first.terms[0].candidate) others.push_back(other);
  return beside_.emplace(leader, scan_effects(model_, first.fit, others, threads_, {&scan_, first.terms[0].candidate}))
      .first->second;
}

// Where the model knows better starts than the scores, the scores do not decide.
void Ranker::try_beside(std::size_t leader) {
  const double prior = pair_log_prior(candidates_.size());
  const RankedCause& first = singles_[leader];
  const EffectScan& scan = scan_beside(leader);
  std::vector<std::pair<double, const ScannedEffect*>> promising;
  for (const ScannedEffect& effect : scan.effects) {
    const double promised = evidence_of(effect, effect.gain[effect.best]);
    std::vector<EffectTerm> both = first.terms;
    both.push_back(term_at(effect, effect.best));
    if (knows_start(model_, both))
      tries_.push_back({leader, effect});
    else if (promised + prior > least_pair_evidence)
      promising.emplace_back(promised, &effect);
  }
  std::sort(promising.begin(), promising.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (std::size_t k = 0; k < std::min(effort_.most_partners, promising.size()); ++k)
    tries_.push_back({leader, *promising[k].second});
}

void Ranker::scan_pairs() {
  for (const std::size_t leader : leaders(false)) try_beside(leader);
}

// Scans the pairs asked for, whatever the scores promise.
void Ranker::scan_asked_pairs() {
  for (auto [one, other] : options_.pairs) {
    if (other->parameters.empty()) std::swap(one, other);  // another law has nothing to scan
    const std::size_t leader = index_of(one);
    RankedCause& first = singles_[leader];
    if (first.candidate_undecided() || !other->undecidable.empty() || other->parameters.empty()) continue;
    const bool tried = std::any_of(tries_.begin(), tries_.end(),
                                   [&](const Try& t) { return t.leader == leader && t.second.candidate == other; });
    if (tried) continue;
    if (!fitted(first)) fit_effect(first, *scan_.find(one));
    tries_.push_back({leader, scan_effects(model_, first.fit, {other}, threads_, {&scan_, one}).effects.front()});
  }
}

std::size_t Ranker::index_of(const Candidate* candidate) const {
  return static_cast<std::size_t>(std::find(candidates_.begin(), candidates_.end(), candidate) - candidates_.begin());
}

// Sums what the two effects of a pair gain each by itself. What one scatters hides part of the other: of n normal
// errors a gain of g says that their variance falls by exp(-g / n), by which the other's gain rises.
double Ranker::gain_apart(const RankedCause& pair) const {
  const auto gain_of = [&](const EffectTerm& term) { return std::max(0.0, singles_[index_of(term.candidate)].gain); };
  const auto collisions = static_cast<double>(std::ranges::count_if(model_.events(), [](const Event& event) {
    return event.kind == EventKind::collision || event.kind == EventKind::step;
  }));
  const auto beside = [&](double one, double other) {
    return one + other * std::exp(std::min(most_hidden, one / std::max(1.0, collisions)));
  };
  const double one = gain_of(pair.terms[0]), other = gain_of(pair.terms[1]);
  return std::max(beside(one, other), beside(other, one));
}

// Sets what a pair says of its second effect, and returns what that earned.
double Ranker::measure_second(RankedCause& pair) const {
  const RankedCause& first = singles_[index_of(pair.terms[0].candidate)];
  const double second = earned(model_, pair.fit, first.fit, exact_part(singles_, first.terms, recalibrated_));
  pair.p_value = 2 * dynamics::normal_cdf(-std::sqrt(second));
  pair.together = pair.gain / std::max(1.0, gain_apart(pair));
  return second;
}

void Ranker::fit_pairs() {
  const double prior = pair_log_prior(candidates_.size());
  std::vector<RankedCause> tried(tries_.size());
  markov::parallel_for(tries_.size(), threads_, [&](std::size_t i) {
    heartbeat();
    const RankedCause& first = singles_[tries_[i].leader];
    RankedCause& pair = tried[i];
    pair = as_cause(fit_one_more(model_, effort_, first.fit, tries_[i].second));
    pair.gain = gain(pair.fit);
    if (!std::isfinite(pair.gain)) return give_up(pair);
    const double second = measure_second(pair);
    pair.evidence = first.evidence + evidence_of(tries_[i].second, second) + prior;
  });
  // The same pair, from either side or once more, counts once, the better fit.
  for (RankedCause& pair : tried) {
    const auto same = std::find_if(pairs_.begin(), pairs_.end(), [&](const RankedCause& other) {
      const Candidate *a = other.terms[0].candidate, *b = other.terms[1].candidate;
      const Candidate *one = pair.terms[0].candidate, *two = pair.terms[1].candidate;
      return (a == one && b == two) || (a == two && b == one);
    });
    if (same == pairs_.end())
      pairs_.push_back(std::move(pair));
    else if (pair.evidence > same->evidence)
      *same = std::move(pair);
  }
}

// What a pair gains beyond its first effect may be a better optimum of that effect, which the pair's fit came upon.
void Ranker::refit_from_pairs() {
  std::vector<const RankedCause*> gaining;
  for (const RankedCause& pair : pairs_) {
    const RankedCause& first = singles_[index_of(pair.terms[0].candidate)];
    if (std::isfinite(pair.evidence) && !pair.terms[0].candidate->parameters.empty() &&
        pair.gain > first.gain + gained_beside &&
        model_.evaluate(pair.fit.nuisance, std::vector{pair.terms[0]}).total() > first.fit.log_likelihood - lost_alone)
      gaining.push_back(&pair);
  }
  std::sort(gaining.begin(), gaining.end(),
            [](const RankedCause* a, const RankedCause* b) { return a->gain > b->gain; });
  gaining.resize(std::min(gaining.size(), most_other_ways));
  std::vector<Fit> again(gaining.size());
  markov::parallel_for(gaining.size(), threads_, [&](std::size_t k) {
    heartbeat();
    again[k] = fit(model_, gaining[k]->fit.nuisance, {gaining[k]->terms[0]},
                   {.count = {}, .refit_nuisances = true, .most_iterations = effort_.most_iterations});
  });
  bool any = false;
  for (std::size_t k = 0; k < again.size(); ++k) {
    const std::size_t i = index_of(gaining[k]->terms[0].candidate);
    if (!(gain(again[k]) > singles_[i].gain + 1)) continue;
    take_again(i, std::move(again[k]));
    beside_.erase(i);
    top_ = std::max(top_, singles_[i].evidence);
    any = true;
  }
  if (!any) return;
  for (RankedCause& pair : pairs_)
    if (std::isfinite(pair.evidence)) measure_second(pair);
}

// An effect of the best pair that was not worth refining by itself is refined now, and paired anew.
void Ranker::refine_paired() {
  const auto best = std::max_element(
      pairs_.begin(), pairs_.end(), [](const RankedCause& a, const RankedCause& b) { return a.evidence < b.evidence; });
  if (best == pairs_.end() || best->evidence < top_ - alike_margin) return;
  tries_.clear();
  for (const EffectTerm& term : best->terms) {
    const std::size_t i = index_of(term.candidate);
    if (refined_[i] || term.candidate->refine.empty() || !fitted(singles_[i])) continue;
    const Candidate* partner = best->terms[&term == &best->terms[0] ? 1 : 0].candidate;
    heartbeat();
    refine_single(i);
    beside_.erase(i);
    try_beside(i);
    // Another law has nothing to scan.
    const ScannedEffect* second = scan_beside(i).find(partner);
    if (second &&
        std::ranges::none_of(tries_, [&](const Try& t) { return t.leader == i && t.second.candidate == partner; }))
      tries_.push_back({i, *second});
  }
  if (tries_.empty()) return;
  for (RankedCause& pair : pairs_) pair.together = pair.gain / std::max(1.0, gain_apart(pair));
  fit_pairs();
}

// Beside one effect of the best pair others may act like its second one, as torques do: all that promise about as much
// are fitted, so that a set names them.
void Ranker::complete_pairs() {
  const auto best = std::max_element(
      pairs_.begin(), pairs_.end(), [](const RankedCause& a, const RankedCause& b) { return a.evidence < b.evidence; });
  if (best == pairs_.end() || best->evidence < top_ - alike_margin) return;
  const auto known = [&](const Candidate* one, const Candidate* other) {
    return std::any_of(pairs_.begin(), pairs_.end(), [&](const RankedCause& pair) {
      const Candidate *a = pair.terms[0].candidate, *b = pair.terms[1].candidate;
      return (a == one && b == other) || (a == other && b == one);
    });
  };
  tries_.clear();
  for (const EffectTerm& term : best->terms) {
    const std::size_t leader = index_of(term.candidate);
    if (!fitted(singles_[leader])) continue;
    const EffectScan& scan = scan_beside(leader);
    std::vector<double> promised;
    for (const ScannedEffect& effect : scan.effects) promised.push_back(evidence_of(effect, effect.gain[effect.best]));
    if (promised.empty()) continue;
    const double most = *std::max_element(promised.begin(), promised.end());
    for (std::size_t k = 0; k < promised.size(); ++k)
      if (promised[k] > most - alike_margin && !known(term.candidate, scan.effects[k].candidate))
        tries_.push_back({leader, scan.effects[k]});
  }
  fit_pairs();
}

// Evidence shrinks gains by the number of parameters: eight leg lengths, which take in an eccentric hub, would count
// for less than the hub with them beside it. A pair that gains nothing beyond one of its effects is that effect.
void Ranker::bound_pairs() {
  for (RankedCause& pair : pairs_)
    for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
      const RankedCause& one = singles_[index_of(pair.terms[k].candidate)];
      const double beyond = pair.gain - one.gain;
      if (!fitted(one) || !std::isfinite(one.evidence) || beyond > gained_beside) continue;
      const auto parameters = static_cast<double>(pair.terms[1 - k].candidate->parameters.size());
      pair.evidence = std::min(pair.evidence, one.evidence + evidence_of_gain(std::max(0.0, beyond), parameters) +
                                                  pair_log_prior(candidates_.size()));
    }
}

}  // namespace

const Fit& exact_part(const std::vector<RankedCause>& singles, const std::vector<EffectTerm>& terms,
                      const Fit& recalibrated) {
  for (const EffectTerm& term : terms)
    for (const RankedCause& cause : singles)
      if (term.candidate->exact && cause.terms[0].candidate == term.candidate && !cause.fit.nuisance.empty())
        return cause.fit;
  return recalibrated;
}

CauseRanking rank_causes(const TransitionModel& model, const Fit& recalibrated,
                         const std::vector<const Candidate*>& candidates, const RankingOptions& options) {
  Ranker ranker(model, recalibrated, candidates, options);
  ranker.reach(0.15);
  ranker.fit_singles();
  ranker.fit_overlooked();
  ranker.reach(0.5);
  ranker.refit_from_stated();
  ranker.refine_leaders();
  ranker.refit_unsettled();
  ranker.decide_unsettled();
  ranker.reach(0.6);
  ranker.scan_pairs();
  ranker.scan_asked_pairs();
  ranker.reach(0.8);
  ranker.fit_pairs();
  ranker.refit_from_pairs();
  ranker.refine_paired();
  ranker.complete_pairs();
  ranker.bound_pairs();
  ranker.reach(1);
  return ranker.result();
}

}  // namespace metastable::analysis
