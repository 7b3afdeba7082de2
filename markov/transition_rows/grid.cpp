#include "markov/transition_rows/grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace metastable::markov {
namespace {

constexpr std::size_t chunk = 256;

// Finds 1 + min(max((state - front) * scale, 0), most), cut to whole numbers; 0 for -infinity. Is every state a number?
METASTABLE_WIDE bool find_buckets(std::span<const double> state, double front, double scale, double most,
                                  std::int32_t* bucket) {
  std::int64_t numbers = 0;
  for (std::size_t k = 0; k < state.size(); ++k) {
    const double place = 1 + std::min(std::max((state[k] - front) * scale, 0.0), most);
    bucket[k] = static_cast<std::int32_t>(state[k] > -std::numeric_limits<double>::infinity() ? place : 0.0);
    numbers += state[k] == state[k] ? 1 : 0;
  }
  return numbers == static_cast<std::int64_t>(state.size());
}

[[noreturn]] void refuse() { throw std::domain_error("grid: a landing is not a number"); }

}  // namespace

Grid::Grid(std::vector<double> edges) : edges_(std::move(edges)) {
  if (edges_.size() < 2) throw std::invalid_argument("grid: fewer than two edges");
  for (std::size_t i = 0; i + 1 < edges_.size(); ++i)
    if (!(edges_[i] < edges_[i + 1]) || !std::isfinite(edges_[i + 1] - edges_[i]))
      throw std::invalid_argument("grid: edges must be finite and strictly ascending");
  upper_.assign(edges_.begin() + 1, edges_.end());
  upper_.back() = std::numeric_limits<double>::quiet_NaN();  // nothing lies beyond the last cell, not even infinity
  // Buckets are narrower than the narrowest cell, unless cells differ so much that these would be too many.
  double narrowest = width(0);
  for (std::size_t i = 1; i < cells(); ++i) narrowest = std::min(narrowest, width(i));
  const double fine = std::ceil(1.001 * (edges_.back() - edges_.front()) / narrowest);
  const bool one_edge = fine <= 32.0 * static_cast<double>(cells()) && fine < std::numeric_limits<std::int32_t>::max();
  const std::size_t buckets = one_edge ? static_cast<std::size_t>(fine) : 4 * cells();
  table_scale_ = static_cast<double>(buckets) / (edges_.back() - edges_.front());
  table_.resize(buckets + 1);
  std::uint32_t c = 0;
  for (std::size_t b = 0; b <= buckets; ++b) {
    // It lies a little below the bucket's start, so that rounding in cell() never begins beyond the right cell.
    const double start = edges_.front() + (static_cast<double>(b) - 1e-6) / table_scale_;
    while (c + 1 < cells() && start >= edges_[c + 1]) ++c;
    table_[b] = c;
  }
  if (!one_edge) return;
  start_.push_back(0);  // what rests
  edge_.push_back(std::numeric_limits<double>::quiet_NaN());
  for (const std::uint32_t cell : table_) {
    start_.push_back(static_cast<std::int32_t>(cell) + 1);
    edge_.push_back(upper_[cell]);
  }
}

Grid Grid::uniform(double lower, double upper, std::size_t cells) {
  if (cells < 1) throw std::invalid_argument("grid: no cells");
  std::vector<double> edges(cells + 1);
  for (std::size_t i = 0; i <= cells; ++i)
    edges[i] = lower + (upper - lower) * static_cast<double>(i) / static_cast<double>(cells);
  edges.back() = upper;
  return Grid(std::move(edges));
}

std::uint32_t Grid::cell(double state) const {
  const double place = (state - edges_.front()) * table_scale_;
  if (!(place > 0)) return 0;
  if (place >= static_cast<double>(table_.size() - 1)) return static_cast<std::uint32_t>(cells() - 1);
  std::uint32_t c = table_[static_cast<std::size_t>(place)];
  while (state >= upper_[c]) ++c;
  return c;
}

void Grid::tally(std::span<const double> state, std::span<const double> weight, std::span<double> sums) const {
  if (edge_.empty()) {
    for (std::size_t k = 0; k < state.size(); ++k) {
      if (std::isnan(state[k])) refuse();
      sums[state[k] == -std::numeric_limits<double>::infinity() ? 0 : 1 + cell(state[k])] += weight[k];
    }
    return;
  }
  // It does without branches: a landing that cannot be foreseen costs no more than one that can.
  std::array<std::int32_t, chunk> slot;
  const auto most = static_cast<double>(table_.size() - 1);
  const std::int32_t* const start = start_.data();
  const double* const edge = edge_.data();
  double* const sum = sums.data();
  for (std::size_t first = 0; first < state.size(); first += chunk) {
    const std::size_t count = std::min(chunk, state.size() - first);
    const double *const x = state.data() + first, *const w = weight.data() + first;
    if (!find_buckets({x, count}, edges_.front(), table_scale_, most, slot.data())) refuse();
    for (std::size_t k = 0; k < count; ++k) {
      const std::int32_t b = slot[k];
      slot[k] = start[b] + static_cast<std::int32_t>(x[k] >= edge[b]);
    }
    // Neighbours often land in one cell, where each must wait for the one before: take them from four places in turn.
    const std::size_t quarter = count / 4;
    for (std::size_t k = 0; k < quarter; ++k)
      for (std::size_t lane = 0; lane < 4; ++lane) sum[slot[lane * quarter + k]] += w[lane * quarter + k];
    for (std::size_t k = 4 * quarter; k < count; ++k) sum[slot[k]] += w[k];
  }
}

Grid Grid::halved() const {
  std::vector<double> edges;
  edges.reserve(2 * cells() + 1);
  for (std::size_t i = 0; i < cells(); ++i) {
    edges.push_back(edges_[i]);
    edges.push_back(midpoint(i));
  }
  edges.push_back(edges_.back());
  return Grid(std::move(edges));
}

}  // namespace metastable::markov
