#include "analysis/statistics/last_moments.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr double equal_values = 1e-9;  // of the range of all
constexpr std::array<double, 3> levels{0.5, 0.05, 0.95};

struct Share {
  double value = 0, weight = 0, width = 0;
};

/// Puts shares of the same value together, ascending.
std::vector<Share> merged(std::vector<Share> shares) {
  std::sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) { return a.value < b.value; });
  const double same = equal_values * (shares.back().value - shares.front().value);
  std::vector<Share> different;
  for (const Share& share : shares) {
    if (!different.empty() && share.value - different.back().value <= same)
      different.back().weight += share.weight;
    else
      different.push_back(share);
  }
  return different;
}

double whole_of(const std::vector<Share>& shares) {
  double all = 0;
  for (const Share& share : shares) all += share.weight;
  return all;
}

/// Interpolates between the middles of the weights.
double between_middles(const std::vector<Share>& shares, double wanted) {
  double below = 0, last_at = 0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double at = below + 0.5 * shares[i].weight;
    if (at >= wanted) {
      if (i == 0) return shares[i].value;
      const double last = shares[i - 1].value;
      return last + (shares[i].value - last) * (wanted - last_at) / (at - last_at);
    }
    below += shares[i].weight;
    last_at = at;
  }
  return shares.back().value;
}

/// Inverts the sum of even distributions, a straight line between their ends.
double of_even_shares(const std::vector<Share>& shares, double wanted) {
  std::vector<std::pair<double, double>> bends;  // where the density changes, and by how much
  for (const Share& share : shares)
    for (const int end : {-1, 1})
      bends.emplace_back(share.value + 0.5 * end * share.width, -end * share.weight / share.width);
  std::sort(bends.begin(), bends.end());
  double below = 0, density = 0;
  for (std::size_t i = 0; i + 1 < bends.size(); ++i) {
    density += bends[i].second;
    const double more = density * (bends[i + 1].first - bends[i].first);
    if (more > 0 && below + more >= wanted) return bends[i].first + (wanted - below) / density;
    below += more;
  }
  return bends.back().first;
}

}  // namespace

Estimate middle_90(std::span<const double> values, std::span<const double> weights, std::span<const double> widths) {
  if (values.size() != weights.size() || (!widths.empty() && widths.size() != values.size()))
    throw std::invalid_argument("quantiles: a weight for each value expected, and a width for each or none");
  std::vector<Share> shares;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (weights[i] > 0) shares.push_back({values[i], weights[i], widths.empty() ? 0 : widths[i]});
  if (shares.empty()) throw std::invalid_argument("quantiles: no value has a weight");
  const bool even = std::all_of(shares.begin(), shares.end(), [](const Share& share) { return share.width > 0; });
  if (!even) shares = merged(std::move(shares));
  const double all = whole_of(shares);
  std::array<double, 3> found{};
  for (std::size_t q = 0; q < levels.size(); ++q)
    found[q] = even ? of_even_shares(shares, levels[q] * all) : between_middles(shares, levels[q] * all);
  return {found[0], found[1], found[2]};
}

double weighted_quantile(std::span<const double> values, std::span<const double> weights, double level) {
  if (values.size() != weights.size()) throw std::invalid_argument("quantiles: a weight for each value expected");
  std::vector<Share> shares;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (weights[i] > 0) shares.push_back({values[i], weights[i], 0});
  if (shares.empty()) throw std::invalid_argument("quantiles: no value has a weight");
  shares = merged(std::move(shares));
  return between_middles(shares, level * whole_of(shares));
}

}  // namespace metastable::analysis
