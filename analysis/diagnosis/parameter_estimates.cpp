#include "analysis/diagnosis/parameter_estimates.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "analysis/diagnosis/cause_ranking.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double score_90 = 1.6448536269514722;  // half-width of a two-sided interval

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

}  // namespace

Cause described_cause(const TransitionModel& model, const RankedCause& ranked) {
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

}  // namespace metastable::analysis
