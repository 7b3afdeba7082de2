#include "analysis/machine_model/belief_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double half_log_two_pi = 0.91893853320467274178;
constexpr int rounds_of_bending = 3;
constexpr double unlikely = 25;  // nats by which a part lies below the likeliest
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

// The state is bent by 1/2 b0 u^2 + 1/2 b1 v^2 + b2 u v; by one number, v and its bends are zero.
template <int Most>
typename BeliefMixture<Most>::Part BeliefMixture<Most>::Part::straightened(const Place& place) const {
  Part out{log_weight, mean, covariance, width};
  if (bent == 0) return out;
  const Eigen::Index states = bends[0].size(), at = mean.size() - bent, size = mean.size();
  const auto& [around, left] = place;
  const double u = around[0], v = around[1], uu = left(0, 0), vv = left(1, 1), uv = left(0, 1);
  BeliefMatrix<Most> turn = BeliefMatrix<Most>::Identity(size, size);
  turn.col(at).head(states) = u * bends[0] + v * bends[2];
  out.mean.head(states) += mean[at] * turn.col(at).head(states);
  if (bent == 2) {
    turn.col(at + 1).head(states) = v * bends[1] + u * bends[2];
    out.mean.head(states) += mean[at + 1] * turn.col(at + 1).head(states);
  }
  out.mean.head(states) += 0.5 * (uu - u * u) * bends[0] + 0.5 * (vv - v * v) * bends[1] + (uv - u * v) * bends[2];
  out.covariance = turn * covariance * turn.transpose();
  // Half the trace of (bend i, covariance, bend j, covariance), for each two states.
  const std::array<BeliefVector<Most>, 4> ways = {uu * bends[0] + uv * bends[2], uv * bends[0] + vv * bends[2],
                                                  uu * bends[2] + uv * bends[1], uv * bends[2] + vv * bends[1]};
  out.covariance.topLeftCorner(states, states) += 0.5 * (ways[0] * ways[0].transpose() + ways[1] * ways[2].transpose() +
                                                         ways[2] * ways[1].transpose() + ways[3] * ways[3].transpose());
  return out;
}

template <int Most>
typename BeliefMixture<Most>::Part::Place BeliefMixture<Most>::Part::place() const {
  Place place{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero()};
  const Eigen::Index at = mean.size() - bent;
  for (Eigen::Index i = 0; i < bent; ++i) {
    place.around[i] = mean[at + i];
    for (Eigen::Index j = 0; j < bent; ++j) place.left(i, j) = covariance(at + i, at + j);
  }
  return place;
}

// Returns the log density of a row in a straight part, and updates the part.
template <int Most>
double BeliefMixture<Most>::updated(Part& part, std::span<const Look<Most>> looks, std::span<const double> values) {
  double log_density = part.log_weight;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    const BeliefVector<Most> gain = part.covariance * looks[i].weights;
    const double variance = looks[i].weights.dot(gain) + looks[i].variance;
    const double off = values[i] - looks[i].offset - looks[i].weights.dot(part.mean);
    log_density -= 0.5 * (off * off / variance + std::log(variance));
    part.mean += gain * (off / variance);
    part.covariance -= gain * (gain.transpose() / variance);
  }
  return log_density;
}

// A row that hardly errs tells where on its bend a part is: each part that the row leaves likely is made straight
// there.
template <int Most>
void BeliefMixture<Most>::straighten(std::span<const Look<Most>> looks, std::span<const double> values) {
  struct Told {
    typename Part::Place place;
    double log_density;
  };
  std::vector<Told> told;
  double most = nothing;
  const auto tell = [&](const Part& part, const typename Part::Place& from) {
    Part seen = part.straightened(from);
    const double log_density = updated(seen, looks, values);
    seen.bent = part.bent;
    return Told{seen.place(), log_density};
  };
  for (const Part& part : parts_) {
    told.push_back(part.bent > 0 ? tell(part, part.place()) : Told{{}, nothing});
    most = std::max(most, told.back().log_density);
  }
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    if (part.bent == 0) continue;
    if (told[i].log_density < most - unlikely) {
      part = part.straightened(part.place());
      continue;
    }
    for (int round = 1; round < rounds_of_bending; ++round) told[i] = tell(part, told[i].place);
    part = part.straightened(told[i].place);
  }
}

template <int Most>
double BeliefMixture<Most>::log_mass() const {
  std::vector<double> logs;
  for (const Part& part : parts_) logs.push_back(part.log_weight);
  return log_sum(logs);
}

template <int Most>
void BeliefMixture<Most>::add_wild(double share, std::span<const double> widths) {
  if (!(share > 0) || parts_.empty()) return;
  Part one = collapsed();
  one.log_weight = log_mass() + std::log(share / static_cast<double>(widths.size()));
  for (Part& part : parts_) part.log_weight += std::log1p(-share);
  for (const double width : widths) {
    one.width = width;
    parts_.push_back(one);
  }
}

template <int Most>
void BeliefMixture<Most>::add(BeliefMixture other, double share) {
  for (Part& part : parts_) part.log_weight += std::log1p(-share);
  for (Part& part : other.parts_) {
    part.log_weight += std::log(share);
    parts_.push_back(std::move(part));
  }
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
  const bool straight = std::ranges::all_of(parts_, [](const Part& part) { return part.bent == 0; });
  std::vector<Part> bent;
  for (const Part& part : parts_)
    if (!straight) bent.push_back(part.straightened(part.place()));
  const std::vector<Part>& parts = straight ? parts_ : bent;
  Part one{0, BeliefVector<Most>::Zero(parts.front().mean.size()), {}, 1};
  for (const Part& part : parts) one.mean += std::exp(part.log_weight - mass) * part.mean;
  one.covariance = BeliefMatrix<Most>::Zero(one.mean.size(), one.mean.size());
  for (const Part& part : parts) {
    const BeliefVector<Most> off = part.mean - one.mean;
    one.covariance += std::exp(part.log_weight - mass) * (part.covariance + off * off.transpose());
  }
  return one;
}

template class BeliefMixture<small_belief>;
template class BeliefMixture<Eigen::Dynamic>;

}  // namespace metastable::analysis
