#include "markov/grid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace metastable::markov {

Grid::Grid(std::vector<double> edges) : edges_(std::move(edges)) {
  if (edges_.size() < 2) throw std::invalid_argument("grid: fewer than two edges");
  for (std::size_t i = 0; i + 1 < edges_.size(); ++i)
    if (!(edges_[i] < edges_[i + 1]) || !std::isfinite(edges_[i + 1] - edges_[i]))
      throw std::invalid_argument("grid: edges must be finite and strictly ascending");
  const std::size_t buckets = 4 * cells();
  table_scale_ = static_cast<double>(buckets) / (edges_.back() - edges_.front());
  table_.resize(buckets + 1);
  std::uint32_t c = 0;
  for (std::size_t b = 0; b <= buckets; ++b) {
    // A little below the bucket's start, so that rounding in cell() never begins beyond the right cell.
    const double start = edges_.front() + (static_cast<double>(b) - 1e-6) / table_scale_;
    while (c + 1 < cells() && start >= edges_[c + 1]) ++c;
    table_[b] = c;
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
  const auto last = static_cast<std::uint32_t>(cells() - 1);
  if (place >= static_cast<double>(table_.size() - 1)) return last;
  std::uint32_t c = table_[static_cast<std::size_t>(place)];
  while (c < last && state >= edges_[c + 1]) ++c;
  return c;
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
