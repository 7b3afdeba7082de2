#include "analysis/diagnosis/gap_tests.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <vector>

#include "analysis/fitting/cause_ranking.h"
#include "analysis/gap/facet_evidence.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double least_p_value = 1e-12;  // smaller ones are beyond what chance levels can say

}  // namespace

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

double facets_p_value(const CauseRanking& ranking, const std::vector<LeftInFacet>& facets) {
  double least = 1;
  if (!ranking.scan.trials_suffice || facets.empty()) return least;
  for (const LeftInFacet& facet : facets) least = std::min(least, facet.p_value);
  return std::min(1.0, least * static_cast<double>(facets.size()));
}

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
  // By Satterthwaite it is a chi-squared of the same mean and variance. Where the model as given is so far off that its
  // likelihood has no slope, no direction counts for more than one.
  const double scale = mean > 0 ? variance / (2 * mean) : 1,
               degrees = mean > 0 ? mean / scale : static_cast<double>(std::max<Eigen::Index>(1, size));
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees), std::max(0.0, gain) / scale));
}

void put_together(Diagnosis::Gap& gap, const GapPValues& p, const Rules& rules) {
  const auto bounded = [](double one) { return std::max(least_p_value, one); };
  gap.p_recalibration = bounded(p.recalibration);
  gap.p_effects = bounded(p.effects);
  gap.p_where = bounded(p.where);
  gap.p_facets = bounded(p.facets);
  gap.p_variations = bounded(p.variations);
  gap.p_value = std::min({1.0, gap.p_effects / rules.share_for_effects,
                          std::min({gap.p_where, gap.p_facets, gap.p_variations}) / rules.share_for_unnamed(),
                          bounded(p.pairs) / rules.share_for_pairs});
  gap.p_as_given = std::min(1.0, 2 * std::min(gap.p_recalibration, gap.p_value));
}

}  // namespace metastable::analysis
