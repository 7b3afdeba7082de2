#include "markov/splitting/pooled_rounds.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace metastable::markov {
namespace {

constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

/// Returns the sd over rounds of the jackknife's pseudo-values of a number.
double scatter_of_rounds(double value, std::span<const double> without) {
  const double n = static_cast<double>(without.size());
  std::vector<double> own;
  double mean = 0, squares = 0;
  for (const double one : without) own.push_back(n * value - (n - 1) * one);
  for (const double one : own) mean += one / n;
  for (const double one : own) squares += (one - mean) * (one - mean);
  return std::sqrt(squares / (n - 1));
}

/// Returns half the width of the 95 % interval of a number, from the jackknife's values of it.
/// @param rounds  that Student's quantile counts
double jackknife_half_width(double value, std::span<const double> without, double rounds) {
  const double quantile = boost::math::quantile(boost::math::students_t(std::max(1.0, rounds - 1)), 0.975);
  return quantile * scatter_of_rounds(value, without) / std::sqrt(static_cast<double>(without.size()));
}

double log_odds(double share) { return std::log(share) - std::log1p(-share); }

double share_of(double odds) { return 1 / (1 + std::exp(-odds)); }

}  // namespace

PooledRounds::PooledRounds(std::vector<RoundShares> rounds) : rounds_(std::move(rounds)) {
  for (const RoundShares& round : rounds_) {
    std::vector<double>& alive = alive_.emplace_back(1, 1.0);
    for (const double share : round.early) alive.push_back(alive.back() * (1 - share));
  }
}

double PooledRounds::mean_alive(std::size_t step, std::size_t left_out) const {
  const double count = static_cast<double>(rounds_.size()) - (left_out < rounds_.size() ? 1 : 0);
  double mean = 0;
  for (std::size_t r = 0; r < rounds_.size(); ++r)
    if (r != left_out) mean += alive_[r][step] / count;
  return mean;
}

std::vector<double> PooledRounds::mean_late(std::size_t left_out) const {
  const double count = static_cast<double>(rounds_.size()) - (left_out < rounds_.size() ? 1 : 0);
  std::vector<double> share(rounds_.front().late.size(), 0);
  for (std::size_t r = 0; r < rounds_.size(); ++r)
    for (std::size_t p = 0; r != left_out && p < share.size(); ++p) share[p] += rounds_[r].late[p] / count;
  return share;
}

PooledRounds::Pooled PooledRounds::pooled(std::size_t left_out) const {
  Pooled all;
  for (std::size_t n = 0; n < burn_in(); ++n) all.steps += mean_alive(n, left_out);
  const std::vector<double> share = mean_late(left_out);
  if (share.empty()) return {all.steps, not_known};
  double now = 1, walked = 0, failed = 0;
  for (const double one : share) {
    walked += now;
    failed += now * one;
    now *= 1 - one;
  }
  all.steps += mean_alive(burn_in(), left_out) * walked / failed;
  const double phases = static_cast<double>(share.size());
  all.rate = share.size() == 1 ? share[0] : -std::expm1(std::log1p(-failed) / phases);
  return all;
}

double PooledRounds::share_after(std::uint64_t steps, std::size_t left_out) const {
  if (steps <= burn_in()) return mean_alive(static_cast<std::size_t>(steps), left_out);
  const std::vector<double> share = mean_late(left_out);
  if (share.empty()) return not_known;
  const std::uint64_t beyond = steps - burn_in(), phases = share.size();
  double logarithm = std::log(mean_alive(burn_in(), left_out));
  for (std::uint64_t p = 0; p < phases; ++p)
    logarithm += static_cast<double>(beyond / phases + (p < beyond % phases ? 1 : 0)) * std::log1p(-share[p]);
  return std::exp(logarithm);
}

MeshEstimate PooledRounds::steps() const {
  std::vector<double> without;
  for (std::size_t r = 0; r < rounds_.size(); ++r) without.push_back(pooled(r).steps);
  return log_interval(pooled(rounds_.size()).steps, without);
}

MeshEstimate PooledRounds::failure_rate() const {
  std::vector<double> without;
  for (std::size_t r = 0; r < rounds_.size(); ++r) without.push_back(pooled(r).rate);
  return log_interval(pooled(rounds_.size()).rate, without);
}

MeshEstimate PooledRounds::survival_after(std::uint64_t steps, double widened) const {
  std::vector<double> without;
  for (std::size_t r = 0; r < rounds_.size(); ++r) without.push_back(share_after(steps, r));
  return odds_interval(share_after(steps, rounds_.size()), without, widened);
}

MeshEstimate log_interval(double value, std::span<const double> without) {
  std::vector<double> logarithms;
  for (const double one : without) logarithms.push_back(std::log(one));
  const double half = jackknife_half_width(std::log(value), logarithms, static_cast<double>(without.size()));
  return {value, value * std::exp(-half), value * std::exp(half)};
}

MeshEstimate odds_interval(double share, std::span<const double> without, double widened) {
  const MeshEstimate untold{share, not_known, not_known};
  const auto between = [](double one) { return one > 0 && one < 1; };
  if (!between(share) || !std::ranges::all_of(without, between)) return untold;
  const double scatter = scatter_of_rounds(share, without) / std::min(share, 1 - share);
  const double rounds = static_cast<double>(without.size()) / (1 + scatter * scatter);
  std::vector<double> odds;
  for (const double one : without) odds.push_back(log_odds(one));
  const double half = widened * jackknife_half_width(log_odds(share), odds, rounds);
  const MeshEstimate found{share, share_of(log_odds(share) - half), share_of(log_odds(share) + half)};
  const double factor = share < 0.5 ? found.upper / found.lower : (1 - found.lower) / (1 - found.upper);
  return factor <= widest_interval ? found : untold;
}

RatioOfSums ratio_of_sums(std::span<const double> over, std::span<const double> under) {
  const double a = std::accumulate(over.begin(), over.end(), 0.0), b = std::accumulate(under.begin(), under.end(), 0.0);
  RatioOfSums ratio{a / b, {}};
  for (std::size_t r = 0; r < over.size(); ++r) ratio.without.push_back((a - over[r]) / (b - under[r]));
  return ratio;
}

double standard_error(const RatioOfSums& ratio) {
  const double n = static_cast<double>(ratio.without.size());
  double mean = 0, squares = 0;
  for (const double one : ratio.without) mean += one / n;
  for (const double one : ratio.without) squares += (one - mean) * (one - mean);
  return std::sqrt((n - 1) / n * squares);
}

}  // namespace metastable::markov
