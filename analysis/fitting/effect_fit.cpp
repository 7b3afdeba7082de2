#include "analysis/fitting/effect_fit.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "analysis/fitting/rules.h"
#include "analysis/statistics/falling_order.h"

namespace metastable::analysis {
namespace {

constexpr double variant_gain = 8;     // promised by one more variant of an effect that is fitted,
constexpr double variant_share = 0.8;  //   and this share of the best variant's gain
constexpr double far_gain = 100;       // promised by the best variant, beyond which the scores do not tell kinds apart
constexpr double furthest_start = 0.25;  // share of a parameter's range
constexpr double small_start = 0.1;      // share of a size worth starting from, where the scores' start was a bad one
constexpr double worth_moving = 0.2;     // rise of the log likelihood
constexpr int most_refinements = 10;     // rounds of moves, each half as long, while a variant still moves
constexpr int most_kinds = 3;            // kinds of a variant that are refined one after the other

// Says whether two variants are two kinds of one thing, as a leg's friction and its restitution: they differ in one
// entry only, of which the list has no third value.
bool of_two_kinds(const Candidate& candidate, std::size_t one, std::size_t other) {
  const std::vector<double>&a = candidate.variants[one], &b = candidate.variants[other];
  std::size_t differing = 0, at = 0;
  for (std::size_t entry = 0; entry < a.size(); ++entry)
    if (a[entry] != b[entry]) ++differing, at = entry;
  return differing == 1 && std::ranges::all_of(candidate.variants, [&](const std::vector<double>& v) {
           return v[at] == a[at] || v[at] == b[at];
         });
}

// These variants are worth a full fit.
std::vector<std::size_t> leading_variants(const ScannedEffect& scanned, std::size_t most) {
  const std::vector<std::size_t> order = falling_order(scanned.gain);
  std::vector<std::size_t> leading;
  for (const std::size_t v : order)
    if (leading.empty() || (leading.size() < most && scanned.gain[v] > variant_gain &&
                            scanned.gain[v] > variant_share * scanned.gain[order[0]]))
      leading.push_back(v);
  if (scanned.gain[order[0]] > far_gain)
    for (const std::size_t v : order)
      if (of_two_kinds(*scanned.candidate, order[0], v) && std::ranges::find(leading, v) == leading.end())
        leading.push_back(v);
  return leading;
}

// Says whether scores scatter more than effects of the catalogue leave them once the model is recalibrated, however
// large these are: 1.04 at most of the engines' wheels, at a gain of 1 nat a collision, where another law leaves 1.5
// to 4.
bool is_far_off(const std::vector<double>& scores) {
  constexpr double widest = 1.3, sds = 4;
  double sum = 0;
  for (const double score : scores) sum += score * score;
  const auto count = static_cast<double>(scores.size());
  return sum > count * widest + sds * std::sqrt(2 * count);
}

// Fits the best variant from its neutral values, and from the model's own starts. The scan took its slopes at the
// neutral values, which the first step from there then uses.
Fit fit_from_neutral(const TransitionModel& model, const Fit& base, const ScannedEffect& scanned, FitOptions options) {
  std::vector<EffectTerm> terms = base.terms;
  terms.push_back({scanned.candidate, scanned.candidate->variants[scanned.best], {}});
  for (const FreeParameter& p : scanned.candidate->parameters) terms.back().values.push_back(p.neutral);
  Derivatives joined = base.derivatives;
  const Eigen::Index held = joined.slope.cols(), more = scanned.columns.slope.cols();
  joined.slope.conservativeResize(Eigen::NoChange, held + more);
  joined.change.conservativeResize(Eigen::NoChange, held + more);
  joined.slope.rightCols(more) = scanned.columns.slope;
  joined.change.rightCols(more) = scanned.columns.change;
  joined.steps.insert(joined.steps.end(), scanned.columns.steps.begin(), scanned.columns.steps.end());
  options.evaluation = &base.evaluation;
  options.derivatives = &joined;
  return best_fit(model, base.nuisance, terms, options);
}

// Searches for the best variant of the last term, between the variants that the catalogue lists.
class VariantSearch {
 public:
  VariantSearch(const TransitionModel& model, const Effort& effort, Fit& best)
      : model_(model), effort_(effort), best_(best), candidate_(*best.terms.back().candidate) {}

  // Moves one entry after the other as long as the likelihood rises. Each round's moves are half as long as those of
  // the round before. Where neither direction rises, the top of the parabola through the three likelihoods is tried.
  bool halve_moves() {
    bool moved = false, moving = true;
    double share = 0.5;
    for (int round = 0; round < effort_.refinements || (moving && round < most_refinements); ++round, share /= 2) {
      moving = false;
      for (std::size_t entry = 0; entry < candidate_.refine.size(); ++entry)
        if (candidate_.refine[entry] != 0) moving = move(entry, share * candidate_.refine[entry]) || moving;
      moved = moved || moving;
    }
    return moved;
  }

  // Fits all entries together with the parameters.
  bool move_together() { return take(fitted(best_.terms)); }

  // Tries the other kinds of the effect (entries whose values are not refined, as the shape of a sag), each with its
  // other entries fitted.
  bool change_kind() {
    bool changed = false;
    for (std::size_t entry = 0; entry < candidate_.refine.size(); ++entry) {
      if (candidate_.refine[entry] != 0) continue;
      std::set<double> kinds;
      for (const std::vector<double>& listed : candidate_.variants) kinds.insert(listed[entry]);
      for (const double kind : kinds)
        if (kind != best_.terms.back().variant[entry]) changed = take(fitted(terms_at(entry, kind))) || changed;
    }
    return changed;
  }

 private:
  std::vector<EffectTerm> terms_at(std::size_t entry, double value) const {
    std::vector<EffectTerm> terms = best_.terms;
    terms.back().variant[entry] = value;
    return terms;
  }
  Fit at(std::size_t entry, double value) const { return stepped(model_, best_, terms_at(entry, value)); }
  Fit fitted(const std::vector<EffectTerm>& terms) const {
    FitOptions options{.count = {}, .refit_nuisances = true, .most_iterations = effort_.most_iterations};
    options.last_variant_too = true;
    return fit(model_, best_.nuisance, terms, options);
  }

  bool take(Fit tried) {
    if (!(tried.penalised > best_.penalised + worth_moving)) return false;
    best_ = std::move(tried);
    return true;
  }

  bool move(std::size_t entry, double step) {
    const double here = best_.terms.back().variant[entry];
    Fit tried = at(entry, here + step);
    const double after = tried.penalised;
    if (take(std::move(tried))) return true;
    tried = at(entry, here - step);
    const double before = tried.penalised;
    if (take(std::move(tried))) return true;
    const double bend = after - 2 * best_.penalised + before, slope = 0.5 * (after - before);
    return bend < 0 && -0.5 * slope * slope / bend > worth_moving && take(at(entry, here - step * slope / bend));
  }

  const TransitionModel& model_;
  const Effort& effort_;
  Fit& best_;
  const Candidate& candidate_;
};

}  // namespace

Effort effort_for(const TransitionModel& model, const Fit& recalibrated) {
  // Few events are fitted soon at any effort.
  constexpr std::size_t many_events = 6000, few_events = 1000;
  constexpr double far_off = 50;  // rise of the log likelihood that a recalibration has left
  if ((!recalibrated.converged && recalibrated.promised > far_off) ||
      (model.events().size() > few_events && is_far_off(recalibrated.evaluation.score)))
    return {20, 1, 1, 1, 1, 6, 2};
  if (model.events().size() > many_events) return {6, 1, 1, 2, 2, 12, 3};
  Effort full;
  // No cause is named from so few trials, one of which may be long: hardly more than single effects is worth the time.
  if (model.trials() < Rules::least_trials_to_explain)
    full.most_leaders = full.most_partners = 1, full.most_effects = 2;
  return full;
}

EffectTerm term_at(const ScannedEffect& scanned, std::size_t variant) {
  EffectTerm term{scanned.candidate, scanned.candidate->variants[variant], {}};
  for (std::size_t p = 0; p < scanned.candidate->parameters.size(); ++p) {
    const FreeParameter& parameter = scanned.candidate->parameters[p];
    // Far from the neutral value the scores say little.
    const double reach = furthest_start * (parameter.upper - parameter.lower);
    const double step = std::clamp(scanned.start[variant][static_cast<Eigen::Index>(p)], -reach, reach);
    term.values.push_back(std::clamp(parameter.neutral + step, parameter.lower, parameter.upper));
  }
  return term;
}

Fit fit_one_more(const TransitionModel& model, const Effort& effort, const Fit& base, const ScannedEffect& scanned,
                 bool gain_alone) {
  FitOptions options{.count = {}, .refit_nuisances = true, .most_iterations = effort.most_iterations};
  options.ends_as_foretold = gain_alone;
  const bool moderate = base.converged && scanned.gain[scanned.best] < far_gain;
  Fit best;
  bool first = true;
  for (const std::size_t variant : leading_variants(scanned, effort.most_variants)) {
    std::vector<EffectTerm> terms = base.terms;
    terms.push_back(term_at(scanned, variant));
    Fit tried = moderate && variant == scanned.best ? fit_from_neutral(model, base, scanned, options)
                                                    : best_fit(model, base.nuisance, terms, options);
    const auto try_from = [&](auto value_of) {
      for (std::size_t p = 0; p < terms.back().values.size(); ++p)
        terms.back().values[p] = value_of(scanned.candidate->parameters[p]);
      FitOptions from_there = options;
      from_there.to_beat = tried.penalised;
      Fit again = fit(model, base.nuisance, terms, from_there);
      if (again.penalised > tried.penalised) tried = std::move(again);
    };
    if (tried.penalised < base.penalised)  // a bad start: from nothing instead
      try_from([](const FreeParameter& p) { return p.try_at != 0 ? p.try_at * small_start : p.neutral; });
    if (tried.penalised < base.penalised)  // At no size it is the base.
      try_from([](const FreeParameter& p) { return p.neutral; });
    if (scanned.candidate->parameters.size() == 1 && scanned.candidate->parameters[0].likely != 0)
      try_from([](const FreeParameter& p) { return p.likely; });
    if (first || tried.penalised > best.penalised) best = std::move(tried);
    first = false;
  }
  return best;
}

void refine_variant(const TransitionModel& model, const Effort& effort, Fit& best) {
  VariantSearch search(model, effort, best);
  bool moved = false, changed = true;
  for (int pass = 0; changed && pass < most_kinds; ++pass) {
    const bool halved = search.halve_moves(), together = search.move_together();
    changed = search.change_kind();
    moved = moved || halved || together || changed;
  }
  if (moved)
    best = fit(model, best.nuisance, best.terms,
               {.count = {}, .refit_nuisances = true, .most_iterations = effort.most_iterations});
}

}  // namespace metastable::analysis
