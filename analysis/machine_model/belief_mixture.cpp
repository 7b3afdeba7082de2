#include "analysis/machine_model/belief_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double half_log_two_pi = 0.91893853320467274178;
constexpr double nothing = -std::numeric_limits<double>::infinity();

double log_sum(const std::vector<double>& logs) {
  const double most = logs.empty() ? nothing : *std::ranges::max_element(logs);
  if (!(most > nothing)) return nothing;
  double sum = 0;
  for (const double x : logs) sum += std::exp(x - most);
  return most + std::log(sum);
}

double score_of(double below, double above) {
  const double p = std::min(below, above);
  const double z = p > 1e-300 ? dynamics::normal_quantile(std::min(p, 0.5)) : -farthest_score;
  return below < above ? z : -z;
}

}  // namespace

template <int Most>
double BeliefMixture<Most>::log_mass() const {
  std::vector<double> logs;
  for (const Part& part : parts_) logs.push_back(part.log_weight);
  return log_sum(logs);
}

// Adds the mixture's own mean and covariance as one more part, and scales the weights of the others down.
template <int Most>
typename BeliefMixture<Most>::Part& BeliefMixture<Most>::give_way(double share) {
  Part one = collapsed();
  one.log_weight = log_mass() + std::log(share);
  for (Part& part : parts_) part.log_weight += std::log1p(-share);
  return parts_.emplace_back(std::move(one));
}

template <int Most>
void BeliefMixture<Most>::add_wild(double share, double width) {
  if (share > 0 && !parts_.empty()) give_way(share).width = width;
}

template <int Most>
void BeliefMixture<Most>::add_outlier(double share, double width, Eigen::Index states) {
  if (!(share > 0) || parts_.empty()) return;
  BeliefMatrix<Most>& covariance = give_way(share).covariance;
  covariance.topRows(states) *= width;
  covariance.leftCols(states) *= width;
}

template <int Most>
SeenValue BeliefMixture<Most>::see(const Look<Most>& look, double value, double failed) {
  std::vector<double> logs;
  logs.reserve(parts_.size());
  const double mass = log_mass();
  double below = failed, above = 0, lone = 0, widest = 0;
  for (Part& part : parts_) {
    const BeliefVector<Most> gain = part.covariance * look.weights;
    double variance = look.weights.dot(gain) + look.variance;
    variance *= part.width * part.width;
    const double off = value - look.offset - look.weights.dot(part.mean);
    const double sd = std::sqrt(variance), z = off / sd;
    const double weight = std::exp(part.log_weight - mass) * (1 - failed);
    below += weight * dynamics::normal_cdf(z);
    above += weight * dynamics::normal_cdf(-z);
    lone = z;
    widest = std::max(widest, sd);
    logs.push_back(part.log_weight - 0.5 * z * z - half_log_two_pi - std::log(sd));
    part.log_weight = logs.back();
    if (part.width > 1) continue;
    part.mean += gain * (off / variance);
    part.covariance -= gain * (gain.transpose() / variance);
  }
  const double all = log_sum(logs);
  SeenValue seen;
  seen.log_density = all - mass + std::log1p(-std::min(failed, 1 - 1e-12));
  seen.score =
      parts_.size() == 1 && failed == 0 ? std::clamp(lone, -farthest_score, farthest_score) : score_of(below, above);
  if (!(seen.log_density > least_log_density)) {
    seen.log_density = least_log_density;
    seen.score = below < above ? -farthest_score : farthest_score;
    seen.unit = widest;
    for (Part& part : parts_) part.log_weight = -std::log(static_cast<double>(parts_.size()));
    return seen;
  }
  for (Part& part : parts_) part.log_weight -= all;
  seen.unit = std::exp(std::clamp(-0.5 * seen.score * seen.score - half_log_two_pi - seen.log_density, -50.0, 50.0));
  return seen;
}

template <int Most>
typename BeliefMixture<Most>::Part BeliefMixture<Most>::collapsed() const {
  const double mass = log_mass();
  Part one{0, BeliefVector<Most>::Zero(parts_.front().mean.size()), {}, 1};
  for (const Part& part : parts_) one.mean += std::exp(part.log_weight - mass) * part.mean;
  one.covariance = BeliefMatrix<Most>::Zero(one.mean.size(), one.mean.size());
  for (const Part& part : parts_) {
    const BeliefVector<Most> off = part.mean - one.mean;
    one.covariance += std::exp(part.log_weight - mass) * (part.covariance + off * off.transpose());
  }
  return one;
}

template class BeliefMixture<small_belief>;
template class BeliefMixture<Eigen::Dynamic>;

}  // namespace metastable::analysis
