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
  if (gains.empty() || !variations.trials_suffice) return 1;
  const ChanceGains chance(variations, draws, seed);
  double least = 1;
  for (std::size_t i = 0; i < gains.size(); ++i)
    least = std::min(least, chance.p_value(variations.effects[i].candidate, gains[i]));
  return chance.look_elsewhere(least);
}

std::vector<LeftInFacet> fitted_variations(const TransitionModel& model, const Fit& recalibrated,
                                           const EffectScan& scan, const Rules& rules, int threads,
                                           const std::function<void()>& heartbeat) {
  if (scan.effects.empty()) return {};
  std::vector<LeftInFacet> all;
  std::vector<double> promised;
  for (std::size_t i = 0; i < scan.effects.size(); ++i) {
    const ScannedEffect& scanned = scan.effects[i];
    all.push_back(as_left(model.variations()[i], scanned, scanned.gain[scanned.best], rules));
    promised.push_back(all[i].evidence);
  }
  const std::vector<std::size_t> order = falling_order(promised);
  const Effort effort = effort_for(model, recalibrated);
  const double least = std::max(0.0, all[order[0]].evidence - worth_fitting);
  std::size_t fitted = 0;
  while (fitted < std::min(effort.most_leaders, order.size()) && all[order[fitted]].evidence > least) ++fitted;
  const std::function<void()> beat = markov::one_at_a_time(heartbeat);
  model.side_by_side(fitted, threads, [&](std::size_t k) {
    beat();
    const ScannedEffect& scanned = scan.effects[order[k]];
    const Fit best = fit_one_more(model, effort, recalibrated, scanned, true);
    all[order[k]] = as_left(model.variations()[order[k]], scanned,
                            std::max(0.0, 2 * (best.penalised - recalibrated.penalised)), rules);
  });
  double most = 0, best = 0;
  for (std::size_t k = 0; k < fitted; ++k) {
    most = std::max(most, all[order[k]].quadratic);
    best = std::max(best, all[order[k]].evidence);
  }
  for (std::size_t k = fitted; k < order.size(); ++k) {
    LeftInFacet& left = all[order[k]];
    left = as_left(model.variations()[order[k]], scan.effects[order[k]], std::min(left.quadratic, most), rules);
    left.evidence = std::min(left.evidence, best);
  }
  return all;
}

}  // namespace metastable::analysis
