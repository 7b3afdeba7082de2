#include "analysis/diagnosis/at_work.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "analysis/diagnosis/diagnosis_sentences.h"
#include "analysis/diagnosis/fits_without.h"
#include "analysis/fitting/cause_ranking.h"
#include "analysis/gap/held_out.h"
#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

bool holds(const Cause& cause, const std::string& effect) {
  return std::ranges::find(cause.effects, effect) != cause.effects.end();
}

// Averages an effect's parameters over the hypotheses that hold it: their intervals are those of a mixture of normals,
// each as wide on either side of its middle as its own interval. No quantile of a mixture lies beyond all of its
// parts'.
std::vector<EstimatedParameter> averaged(const std::vector<Cause>& ranked, const std::string& effect) {
  std::vector<EstimatedParameter> mean;
  std::vector<double> below, above;      // means of squares
  std::vector<EstimatedParameter> ends;  // the farthest
  double weights = 0;
  for (const Cause& cause : ranked) {
    const auto at = std::ranges::find(cause.effects, effect);
    if (at == cause.effects.end()) continue;
    const std::vector<EstimatedParameter>& own = cause.parameters[static_cast<std::size_t>(at - cause.effects.begin())];
    if (mean.empty()) {
      mean = own;
      for (EstimatedParameter& p : mean) p.value = 0;
      below.assign(own.size(), 0);
      above = below;
      ends = own;
    }
    const auto same_variant = [&] {
      if (own.size() != mean.size()) return false;
      for (std::size_t k = 0; k < own.size(); ++k)
        if (own[k].name != mean[k].name || (!mean[k].fitted && own[k].lower != mean[k].lower)) return false;
      return true;
    };
    if (own.empty() || !same_variant()) continue;
    weights += cause.probability;
    for (std::size_t k = 0; k < own.size(); ++k) {
      const double value = own[k].value, down = (value - own[k].lower) / normal_90,
                   up = (own[k].upper - value) / normal_90;
      mean[k].value += cause.probability * value;
      below[k] += cause.probability * (down * down + value * value);
      above[k] += cause.probability * (up * up + value * value);
      ends[k].lower = std::min(ends[k].lower, own[k].lower);
      ends[k].upper = std::max(ends[k].upper, own[k].upper);
    }
  }
  for (std::size_t k = 0; k < mean.size(); ++k) {
    EstimatedParameter& p = mean[k];
    if (weights > 0) p.value /= weights;
    if (!p.fitted) continue;
    const auto half = [&](double squares) {
      return normal_90 * std::sqrt(std::max(0.0, squares / weights - p.value * p.value));
    };
    p.lower = std::max(ends[k].lower, p.value - half(below[k]));
    p.upper = std::min(ends[k].upper, p.value + half(above[k]));
  }
  return mean;
}

bool of_one_group(const std::vector<EffectGroup>& groups, const std::string& effect, const std::string& other) {
  return std::ranges::any_of(groups, [&](const EffectGroup& group) {
    return std::ranges::find(group.members, effect) != group.members.end() &&
           std::ranges::find(group.members, other) != group.members.end();
  });
}

// Says whether a hypothesis has another effect in the place of one of several, beside the same others, and fits the
// data as well.
bool stands_in(const Cause& cause, const std::string& effect, const Cause& first, const Rules& rules) {
  return first.effects.size() > 1 && cause.effects.size() == first.effects.size() && !holds(cause, effect) &&
         first.gain - cause.gain < rules.told_apart &&
         std::ranges::all_of(first.effects, [&](const std::string& one) { return one == effect || holds(cause, one); });
}

// Returns the probability that one of these effects is at work.
double probability_of(const std::vector<std::string>& effects, const Probabilities& probabilities,
                      const Odds& unnamed) {
  double share = 0;
  for (const Cause& cause : probabilities.ranked)
    if (std::ranges::any_of(effects, [&](const std::string& id) { return holds(cause, id); }))
      share += cause.probability / probabilities.of_effects();
  return probabilities.of_gap() * share * unnamed.of_catalogue();
}

}  // namespace

std::vector<AtWork> list_at_work(const Probabilities& probabilities, const Odds& unnamed,
                                 const std::vector<std::string>& alike, const std::vector<EffectGroup>& groups,
                                 const Rules& rules) {
  const std::vector<Cause>& ranked = probabilities.ranked;
  std::vector<AtWork> all;
  if (!(probabilities.of_effects() > 0)) return all;
  const auto probability = [&](const std::vector<std::string>& effects) {
    return probability_of(effects, probabilities, unnamed);
  };
  const bool whole = unnamed.none() < rules.most_odds_of_none();
  // Effects of the first hypothesis, each with what stands in its place in those that are alike to it.
  std::vector<std::string> listed;
  for (const std::string& effect : ranked.front().effects) {
    AtWork one{effect, {effect}, probability({effect}), averaged(ranked, effect), {}, {}, {}};
    if (one.probability < rules.least_at_work) {
      for (const Cause& cause : ranked) {
        if (holds(cause, effect)) continue;
        const bool acts_alike = std::ranges::find(alike, cause.name()) != alike.end(),
                   in_its_place = whole && stands_in(cause, effect, ranked.front(), rules);
        if (!acts_alike && probability(one.effects) >= rules.least_at_work) continue;
        for (const std::string& other : cause.effects)
          if (!holds(ranked.front(), other) && (acts_alike || in_its_place || of_one_group(groups, effect, other)) &&
              std::ranges::find(one.effects, other) == one.effects.end())
            one.effects.push_back(other);
      }
      if (one.effects.size() > 1) {
        one.probability = probability(one.effects);
        one.name = common_name(groups, one.effects);
      }
    }
    listed.insert(listed.end(), one.effects.begin(), one.effects.end());
    all.push_back(std::move(one));
  }
  for (const Cause& cause : ranked)
    for (const std::string& effect : cause.effects) {
      if (std::ranges::find(listed, effect) != listed.end()) continue;
      listed.push_back(effect);
      if (const double p = probability({effect}); p >= rules.least_listed)
        all.push_back({effect, {effect}, p, averaged(ranked, effect), {}, {}, {}});
    }
  std::ranges::stable_sort(all, std::ranges::greater{}, &AtWork::probability);
  return all;
}

void join_rivals(std::vector<AtWork>& at_work, const Probabilities& probabilities, const Odds& unnamed,
                 const std::vector<std::string>& set, const std::vector<EffectGroup>& groups, const Rules& rules) {
  if (at_work.empty()) return;
  AtWork group = at_work.front();
  for (const Cause& cause : probabilities.ranked) {
    if (group.probability >= rules.least_at_work) break;
    if (std::ranges::find(set, cause.name()) == set.end() || cause.effects.empty() ||
        std::ranges::any_of(group.effects, [&](const std::string& effect) { return holds(cause, effect); }))
      continue;
    group.effects.push_back(*std::ranges::max_element(cause.effects, {}, [&](const std::string& effect) {
      return probability_of({effect}, probabilities, unnamed);
    }));
    group.probability = probability_of(group.effects, probabilities, unnamed);
  }
  if (group.probability < rules.least_at_work) return;
  group.name = common_name(groups, group.effects);
  std::erase_if(at_work, [&](const AtWork& one) {  // what is in the group as a whole
    return std::ranges::all_of(one.effects, [&](const std::string& effect) {
      return std::ranges::find(group.effects, effect) != group.effects.end();
    });
  });
  at_work.insert(at_work.begin(), std::move(group));
}

std::vector<UnnamedFacet> facets_by_probability(const Chosen& chosen, double p_unnamed, const Rules& rules) {
  const Odds& odds = chosen.unnamed;
  const Unnamed* supposed = nullptr;
  for (const Unnamed& one : chosen.supposed)
    if (one.beside.empty() == (odds.alone > odds.beside + odds.left) &&
        (!supposed || one.evidence > supposed->evidence))
      supposed = &one;
  std::vector<UnnamedFacet> all;
  if (!supposed) return all;
  double most = 0, sum = 0;
  for (const LeftInFacet& facet : supposed->facets) most = std::max(most, facet.evidence);
  for (const LeftInFacet& facet : supposed->facets) sum += std::exp(facet.evidence - most);
  for (const LeftInFacet& facet : supposed->facets) {
    UnnamedFacet one{facet.facet, facet.aspect, facet.stance, p_unnamed * std::exp(facet.evidence - most) / sum, {},
                     ""};
    if (one.probability < rules.least_listed) continue;
    for (const GapCell& cell : chosen.left.cells)
      if (cell.facet == facet.facet && cell.aspect == facet.aspect &&
          (!one.size || std::abs(cell.size) > std::abs(*one.size)))
        one.size = cell.size, one.unit = cell.unit;
    all.push_back(std::move(one));
  }
  std::ranges::stable_sort(all, std::ranges::greater{}, &UnnamedFacet::probability);
  return all;
}

void add_closed_shares(std::vector<AtWork>& at_work, const TransitionModel& model, const RankedCause& best,
                       FitsWithout& without, const Fit& given, const Fit& recalibrated, const std::vector<double>& left,
                       const DiagnosisOptions& options, const std::function<void()>& heartbeat) {
  struct Asked {
    AtWork* whose;
    std::size_t alone;
    std::size_t beside;
  };
  std::vector<GapPart> parts;
  std::vector<Asked> asked;
  std::deque<Fit> alone;  // the effect in the model as given
  for (AtWork& one : at_work) {
    const auto own = std::ranges::find_if(best.fit.terms, [&](const EffectTerm& term) {
      return std::ranges::find(one.effects, term.candidate->id) != one.effects.end();
    });
    if (own == best.fit.terms.end() || one.probability < options.rules.least_at_work) continue;
    if (heartbeat) heartbeat();
    alone.push_back(fit(model, given.nuisance, {*own}, {.count = {}, .refit_nuisances = false}));
    asked.push_back({&one, parts.size(), parts.size() + 1});
    parts.push_back({&alone.back(), &given, false});
    const auto place = static_cast<std::size_t>(own - best.fit.terms.begin());
    parts.push_back({&best.fit, &without.term(place, heartbeat), true});
  }
  if (parts.empty()) return;
  const std::vector<ClosedShare> closed = parts_closed(model, recalibrated, {&best.fit, &given, left}, parts,
                                                       options.folds, options.threads, options.seed, heartbeat);
  for (const Asked& one : asked) {
    one.whose->closes_alone = closed[one.alone].estimate();
    one.whose->closes_beside = closed[one.beside].estimate();
    one.whose->closes_mean = mean_of(closed[one.alone], closed[one.beside]).estimate();
  }
}

void add_unnamed_share(Diagnosis& d, const TransitionModel& model, const RankedCause& best, FitsWithout& without,
                       const Fit& given, const Fit& recalibrated, const std::vector<double>& left,
                       const DiagnosisOptions& options, const std::function<void()>& heartbeat) {
  const auto named = [&](const EffectTerm& term) {
    return std::ranges::any_of(d.causes.at_work, [&](const AtWork& one) {
      return one.probability >= options.rules.least_at_work &&
             std::ranges::find(one.effects, term.candidate->id) != one.effects.end();
    });
  };
  std::vector<EffectTerm> kept;
  std::size_t place = 0;
  for (std::size_t k = 0; k < best.fit.terms.size(); ++k)
    if (named(best.fit.terms[k])) {
      kept.push_back(best.fit.terms[k]);
    } else {
      d.causes.stand_ins.push_back(best.fit.terms[k].candidate->id);
      place = k;
    }
  d.causes.unnamed_share = std::max(0.0, 1 - *d.shrinkage.measures.front().closed);
  if (kept.empty()) d.causes.stand_ins.clear();
  if (d.causes.stand_ins.empty()) return;
  heartbeat();
  Fit others;
  if (d.causes.stand_ins.size() > 1) others = fit(model, best.fit.nuisance, kept);
  const Fit& rest = d.causes.stand_ins.size() > 1 ? others : without.term(place, heartbeat);
  const std::vector<ClosedShare> closed =
      parts_closed(model, recalibrated, {&best.fit, &given, left}, {{&best.fit, &rest, true}}, options.folds,
                   options.threads, options.seed, heartbeat);
  d.causes.unnamed_share = std::min(1.0, *d.causes.unnamed_share + std::max(0.0, closed.front().value));
}

}  // namespace metastable::analysis
