#include "analysis/diagnosis/fitted_variations.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <mutex>

#include "analysis/diagnosis/effect_fit.h"
#include "analysis/diagnosis/effect_scan.h"
#include "analysis/diagnosis/evidence.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double worth_fitting = 10;  // evidence promised below the best

LeftInFacet as_left(const Variation& variation, const ScannedEffect& scanned, double gain) {
  LeftInFacet left{.facet = variation.facet, .aspect = variation.aspect};
  left.quadratic = gain;
  left.degrees = static_cast<double>(variation.candidate.parameters.size());
  const boost::math::chi_squared chance(left.degrees);
  left.p_value = std::min(1.0, static_cast<double>(variation.candidate.variants.size()) *
                                   boost::math::cdf(boost::math::complement(chance, gain)));
  left.evidence = evidence_of(scanned, gain);
  return left;
}

}  // namespace

std::vector<LeftInFacet> fitted_variations(const TransitionModel& model, const Fit& recalibrated, int threads,
                                           const std::function<void()>& heartbeat) {
  std::vector<const Candidate*> candidates;
  for (const Variation& variation : model.variations()) candidates.push_back(&variation.candidate);
  if (candidates.empty()) return {};
  const EffectScan scan = scan_effects(model, recalibrated, candidates, threads);
  std::vector<LeftInFacet> all;
  double most = 0;  // evidence promised
  for (std::size_t i = 0; i < scan.effects.size(); ++i) {
    const ScannedEffect& scanned = scan.effects[i];
    all.push_back(as_left(model.variations()[i], scanned, scanned.gain[scanned.best]));
    most = std::max(most, all.back().evidence);
  }
  std::vector<std::size_t> promising;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].evidence > std::max(0.0, most - worth_fitting)) promising.push_back(i);
  std::sort(promising.begin(), promising.end(),
            [&](std::size_t a, std::size_t b) { return all[a].evidence > all[b].evidence; });
  const Effort effort = effort_for(model, recalibrated);
  if (promising.size() > effort.most_leaders) promising.resize(effort.most_leaders);
  std::mutex one_at_a_time;
  double best = 0;  // evidence of those fitted
  markov::parallel_for(promising.size(), threads, [&](std::size_t k) {
    {
      const std::lock_guard lock(one_at_a_time);
      heartbeat();
    }
    const ScannedEffect& scanned = scan.effects[promising[k]];
    const Fit fitted = fit_one_more(model, effort, recalibrated, scanned);
    const double gain = std::max(0.0, 2 * (fitted.penalised - recalibrated.penalised));
    all[promising[k]] = as_left(model.variations()[promising[k]], scanned, gain);
  });
  for (const std::size_t i : promising) best = std::max(best, all[i].evidence);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (std::find(promising.begin(), promising.end(), i) == promising.end())
      all[i].evidence = std::min(all[i].evidence, best);
  return all;
}

}  // namespace metastable::analysis
