#include "analysis/gap/fitted_variations.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>

#include "analysis/fitting/bayes_factor.h"
#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"
#include "analysis/statistics/falling_order.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double worth_fitting = 10;  // evidence promised below the best

LeftInFacet as_left(const Variation& variation, const ScannedEffect& scanned, double gain, const Rules& rules) {
  LeftInFacet left{.facet = variation.facet, .aspect = variation.aspect};
  left.quadratic = gain;
  left.degrees = static_cast<double>(variation.candidate.parameters.size());
  const boost::math::chi_squared chance(left.degrees);
  left.p_value = std::min(1.0, static_cast<double>(variation.candidate.variants.size()) *
                                   boost::math::cdf(boost::math::complement(chance, gain)));
  left.evidence = evidence_of(scanned, gain, rules);
  return left;
}

// Fits those variations that promise most, and bounds the others by them, as fitted_variations() says.
// @param sought  the variations of the scan, in its order  @param forgiven  2 Delta log likelihood that counts as none
std::vector<LeftInFacet> fitted(const TransitionModel& model, const std::vector<const Variation*>& sought,
                                const Fit& base, const EffectScan& scan, double forgiven, const Rules& rules,
                                int threads, const std::function<void()>& heartbeat) {
  if (scan.effects.empty()) return {};
  const auto left = [&](std::size_t i, double gain) {
    return as_left(*sought[i], scan.effects[i], std::max(0.0, gain - forgiven), rules);
  };
  std::vector<LeftInFacet> all;
  std::vector<double> promised;
  for (std::size_t i = 0; i < scan.effects.size(); ++i) {
    all.push_back(left(i, scan.effects[i].gain[scan.effects[i].best]));
    promised.push_back(all[i].evidence);
  }
  const std::vector<std::size_t> order = falling_order(promised);
  const Effort effort = effort_for(model, base);
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  double most = 0, best = 0;
  std::size_t done = 0;
  // Variations that promised less are fitted as well if the fits of those before them keep little of their promise.
  for (double least = std::max(0.0, promised[order[0]] - worth_fitting);; least = std::max(0.0, best - worth_fitting)) {
    std::size_t end = done;
    while (end < std::min(effort.most_leaders, order.size()) && promised[order[end]] > least) ++end;
    if (end == done) break;
    model.side_by_side(end - done, threads, [&](std::size_t i) {
      beat();
      const std::size_t which = order[done + i];
      const Fit kept = fit_one_more(model, effort, base, scan.effects[which], true);
      all[which] = left(which, 2 * (kept.penalised - base.penalised));
    });
    for (; done < end; ++done) {
      most = std::max(most, all[order[done]].quadratic);
      best = std::max(best, all[order[done]].evidence);
    }
  }
  for (std::size_t k = done; k < order.size(); ++k) {
    LeftInFacet& one = all[order[k]];
    one = left(order[k], std::min(one.quadratic, most) + forgiven);
    one.evidence = std::min(one.evidence, best);
  }
  return all;
}

}  // namespace

EffectScan scan_variations(const TransitionModel& model, const Fit& recalibrated, int threads) {
  std::vector<const Candidate*> candidates;
  for (const Variation& variation : model.variations()) candidates.push_back(&variation.candidate);
  return scan_effects(model, recalibrated, candidates, threads);
}

std::vector<double> promised_gains(const EffectScan& variations) {
  std::vector<double> gains;
  for (const ScannedEffect& one : variations.effects) gains.push_back(one.gain[one.best]);
  return gains;
}

double variations_p_value(const EffectScan& variations, const std::vector<double>& gains, int draws,
                          std::uint64_t seed) {
  if (gains.empty() || !variations.steps_suffice) return 1;
  const ChanceGains chance(variations, draws, seed);
  double least = 1;
  for (std::size_t i = 0; i < gains.size(); ++i)
    least = std::min(least, chance.p_value(variations.effects[i].candidate, gains[i]));
  return chance.look_elsewhere(least);
}

std::vector<LeftInFacet> fitted_variations(const TransitionModel& model, const Fit& recalibrated,
                                           const EffectScan& scan, const Rules& rules, int threads,
                                           const std::function<void()>& heartbeat) {
  std::vector<const Variation*> all;
  for (const Variation& one : model.variations()) all.push_back(&one);
  return fitted(model, all, recalibrated, scan, 0, rules, threads, heartbeat);
}

std::vector<LeftInFacet> variations_beside(const TransitionModel& model, const Fit& fit, double forgiven,
                                           const Rules& rules, int threads, const std::function<void()>& heartbeat) {
  std::vector<const Variation*> sought;
  std::vector<const Candidate*> candidates;
  for (const Variation& one : model.variations())
    if (one.beside) {
      sought.push_back(&one);
      candidates.push_back(&one.candidate);
    }
  if (sought.empty()) return {};
  return fitted(model, sought, fit, scan_effects(model, fit, candidates, threads), forgiven, rules, threads, heartbeat);
}

}  // namespace metastable::analysis
