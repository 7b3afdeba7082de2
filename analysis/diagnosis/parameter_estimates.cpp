#include "analysis/diagnosis/parameter_estimates.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/likelihood_ends.h"
#include "analysis/statistics/interval_95.h"
#include "dynamics/numerics/truncated_normal.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double surely_there = 6;     // gain of an effect whose interval does not hold none of it
constexpr double least_weight = 1e-3;  // of a variant, to widen an interval

std::vector<EstimatedParameter> as_reported(const EffectTerm& term) {
  std::vector<EstimatedParameter> all;
  for (const NamedValue& one : term.candidate->report(term.variant, term.values))
    all.push_back({one.first, one.second, one.second, one.second, false});
  return all;
}

// Of an effect of one value reported numbers are monotone in it: its ends are theirs.
std::vector<EstimatedParameter> between(const EffectTerm& term, double low, double high) {
  std::vector<EstimatedParameter> all = as_reported(term);
  const FreeParameter& p = term.candidate->parameters[0];
  for (const double end : {low, high}) {
    const auto there = term.candidate->report(term.variant, {std::clamp(end, p.lower, p.upper)});
    for (std::size_t k = 0; k < all.size(); ++k) {
      all[k].fitted = all[k].fitted || there[k].second != all[k].value;
      all[k].lower = std::min(all[k].lower, there[k].second);
      all[k].upper = std::max(all[k].upper, there[k].second);
    }
  }
  return all;
}

std::vector<EstimatedParameter> estimates(const EffectTerm& term, const Eigen::MatrixXd& covariance,
                                          Eigen::Index first = 0) {
  const auto count = term.values.size();
  if (count == 1) {
    const double half = normal_90 * std::sqrt(std::max(0.0, covariance(first, first)));
    return between(term, term.values[0] - half, term.values[0] + half);
  }
  const std::vector<NamedValue> here = term.candidate->report(term.variant, term.values);
  std::vector<EstimatedParameter> all = as_reported(term);
  // The slopes of the reported numbers carry the covariance over.
  for (std::size_t k = 0; k < all.size(); ++k) {
    Eigen::VectorXd slope(static_cast<Eigen::Index>(count));
    for (std::size_t p = 0; p < count; ++p) {
      std::vector<double> moved = term.values;
      const double step = term.candidate->parameters[p].step;
      moved[p] += step;
      slope[static_cast<Eigen::Index>(p)] =
          (term.candidate->report(term.variant, moved)[k].second - here[k].second) / step;
    }
    const auto block = covariance.block(first, first, slope.size(), slope.size());
    const double half = normal_90 * std::sqrt(std::max(0.0, slope.dot(block * slope)));
    all[k].lower -= half;
    all[k].upper += half;
    all[k].fitted = half > 0;
  }
  return all;
}

// Returns the interval of an effect of one value, as far as its curvature or its likelihood reaches, whichever is
// farther: at a jump of the map the curvature is too large. Towards none of the effect the likelihood alone counts
// where nothing lies on the other side, as of a spread, and where the curvature says nothing (of a foot that always
// sticks) and would let the interval hold the neutral value, which the gain excludes.
std::pair<double, double> effect_ends(const TransitionModel& model, const RankedCause& ranked, const EffectTerm& term,
                                      const Eigen::MatrixXd& covariance, Eigen::Index slot) {
  const FreeParameter& p = term.candidate->parameters[0];
  const double value = term.values[0], half = normal_90 * std::sqrt(std::max(0.0, covariance(slot, slot)));
  const auto [low, high] = likelihood_ends(model, ranked.fit, covariance, slot);
  const bool there = ranked.terms.size() == 1 && ranked.gain > surely_there && std::abs(value - p.neutral) < half;
  const bool alone_below = p.neutral <= p.lower || (there && p.neutral < value),
             alone_above = p.neutral >= p.upper || (there && p.neutral > value);
  return {std::max(p.lower, std::min(alone_below ? low : std::min(low, value - half), value - p.blur)),
          std::min(p.upper, std::max(alone_above ? high : std::max(high, value + half), value + p.blur))};
}

// Holds what one of an effect's variants says of its numbers.
struct VariantSays {
  std::vector<EstimatedParameter> numbers;
  double weight = 1;
};

// Returns the value below which the variants put this share of a number.
double quantile(const std::vector<VariantSays>& all, std::size_t number, double share) {
  double low = all[0].numbers[number].lower, high = all[0].numbers[number].upper, weights = 0;
  for (const VariantSays& one : all) {
    const EstimatedParameter& e = one.numbers[number];
    low = std::min(low, e.lower);
    high = std::max(high, e.upper);
    weights += one.weight;
  }
  const auto below = [&](double x) {
    double sum = 0;
    for (const VariantSays& one : all) {
      const EstimatedParameter& e = one.numbers[number];
      const double half = x < e.value ? e.value - e.lower : e.upper - e.value;
      sum += one.weight * (half > 0 ? dynamics::normal_cdf(normal_90 * (x - e.value) / half) : x >= e.value);
    }
    return sum / weights;
  };
  for (int halving = 0; halving < 60; ++halving) (below((low + high) / 2) < share ? low : high) = (low + high) / 2;
  return high;
}

// Widens the intervals of an effect of one value by what its other variants say, as the scores at the recalibrated
// model have them, scaled to what the fit made of its own.
void cover_variants(const RankedCause& ranked, const EffectScan& scan, std::vector<EstimatedParameter>& fitted) {
  const EffectTerm& term = ranked.terms[0];
  const ScannedEffect* scanned = scan.find(term.candidate);
  if (!scanned || term.values.size() != 1) return;
  const std::vector<std::vector<double>>& variants = term.candidate->variants;
  const auto listed = std::ranges::find(variants, term.variant);
  const std::size_t own =
      listed == variants.end() ? scanned->best : static_cast<std::size_t>(listed - variants.begin());
  const FreeParameter& p = term.candidate->parameters[0];
  const double promised = scanned->start[own][0];
  const double factor = promised != 0 ? std::clamp((term.values[0] - p.neutral) / promised, 0.5, 2.0) : 1;
  std::vector<VariantSays> all{{fitted}};
  for (std::size_t v = 0; v < variants.size(); ++v) {
    const double weight = std::exp(std::min(0.0, scanned->gain[v] - scanned->gain[own]) / 2);
    const double information = scan.information(scanned->first[v], scanned->first[v]);
    if (v == own || weight < least_weight || !(information > resolved_share * scan.whole[scanned->first[v]])) continue;
    const EffectTerm other{
        term.candidate, variants[v], {std::clamp(p.neutral + factor * scanned->start[v][0], p.lower, p.upper)}};
    all.push_back({estimates(other, Eigen::MatrixXd::Constant(1, 1, factor * factor / information)), weight});
  }
  if (all.size() == 1) return;
  for (std::size_t k = 0; k < fitted.size(); ++k)
    if (fitted[k].fitted) {
      fitted[k].lower = std::min(fitted[k].lower, quantile(all, k, 0.05));
      fitted[k].upper = std::max(fitted[k].upper, quantile(all, k, 0.95));
    }
}

// Returns the 90 % interval of a nuisance. It holds what chance leaves open, as far as the curvature or the likelihood
// reaches, and what errors of the model's form move the nuisance by.
std::pair<double, double> nuisance_ends(const TransitionModel& model, const Fit& fit, const Eigen::MatrixXd& covariance,
                                        Eigen::Index slot) {
  const Nuisance& n = model.nuisances()[static_cast<std::size_t>(slot)];
  const double here = fit.nuisance[static_cast<std::size_t>(slot)], form = normal_90 * n.form_sd,
               half = normal_90 * std::sqrt(std::max(0.0, covariance(slot, slot)));
  const auto [low, high] = likelihood_ends(model, fit, covariance, slot);
  return {std::clamp(here - std::hypot(std::max(half, here - low), form), n.lower, n.upper),
          std::clamp(here + std::hypot(std::max(half, high - here), form), n.lower, n.upper)};
}

}  // namespace

Cause described_cause(const TransitionModel& model, const RankedCause& ranked, const EffectScan& scan, bool likely) {
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
  const Eigen::MatrixXd covariance = markov::floored_inverse(ranked.fit.information, resolved_share);
  auto first = static_cast<Eigen::Index>(model.nuisances().size());
  for (const EffectTerm& term : ranked.terms) {
    if (likely && term.values.size() == 1) {
      const auto [low, high] = effect_ends(model, ranked, term, covariance, first);
      cause.parameters.push_back(between(term, low, high));
    } else {
      cause.parameters.push_back(estimates(term, covariance, first));
    }
    first += static_cast<Eigen::Index>(term.values.size());
  }
  if (ranked.terms.size() == 1) cover_variants(ranked, scan, cause.parameters[0]);
  return cause;
}

std::vector<EstimatedParameter> contact_estimates(const TransitionModel& model, const Fit& fit) {
  const Eigen::MatrixXd by_chance = markov::floored_inverse(fit.information, resolved_share);
  Eigen::MatrixXd covariance = by_chance;
  for (std::size_t p = 0; p < fit.nuisance.size(); ++p) {
    const auto at = static_cast<Eigen::Index>(p);
    covariance(at, at) += model.nuisances()[p].form_sd * model.nuisances()[p].form_sd;
  }
  std::vector<EstimatedParameter> all;
  const std::vector<NamedValue> here = model.report_nuisances(fit.nuisance);
  const auto with = [&](Eigen::Index slot, double value, std::size_t number) {
    std::vector<double> moved = fit.nuisance;
    moved[static_cast<std::size_t>(slot)] = value;
    return model.report_nuisances(moved)[number].second;
  };
  for (std::size_t k = 0; k < here.size(); ++k) {
    Eigen::VectorXd slope = Eigen::VectorXd::Zero(covariance.rows());  // none by sizes of effects
    for (std::size_t slot = 0; slot < fit.nuisance.size(); ++slot) {
      const auto p = static_cast<Eigen::Index>(slot);
      const double step = model.nuisances()[slot].step;
      slope[p] = (with(p, fit.nuisance[slot] + step, k) - here[k].second) / step;
    }
    const double half = normal_90 * std::sqrt(std::max(0.0, slope.dot(covariance * slope)));
    all.push_back({here[k].first, here[k].second, here[k].second - half, here[k].second + half, true});
    if ((slope.array() != 0).count() == 1) {
      Eigen::Index alone = 0;
      slope.cwiseAbs().maxCoeff(&alone);
      const auto [low, high] = nuisance_ends(model, fit, by_chance, alone);
      std::tie(all.back().lower, all.back().upper) = std::minmax({with(alone, low, k), with(alone, high, k)});
    }
  }
  return all;
}

}  // namespace metastable::analysis
