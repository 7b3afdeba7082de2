#include "markov/mesh/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "markov/mesh/mesh_growth.h"

namespace metastable::markov {

NodeLattice mesh_lattice(const BatchMap& map, std::vector<NoiseFrame> frames, const MeshOptions& options) {
  if (!(options.spacing > 0 && options.spacing <= 2))
    throw std::invalid_argument(fmt::format("mesh: spacing {} is outside (0, 2]", options.spacing));
  if (!(options.score_spacing > 0 && options.score_spacing <= 1) || !(options.score_reach > 0))
    throw std::invalid_argument(fmt::format("mesh: scores' spacing {} outside (0, 1] or reach {} not positive",
                                            options.score_spacing, options.score_reach));
  if (frames.size() != static_cast<std::size_t>(map.phases) || frames.size() > 15)
    throw std::invalid_argument(fmt::format("mesh: {} phases, 1 to 15 with a frame each expected", map.phases));
  return {std::move(frames), options.spacing, uniforms(options.seed, 0, options.shift, 0)};
}

Mesh::Mesh(const BatchMap& map, std::vector<NoiseFrame> frames, std::span<const double> start,
           const MeshOptions& options) {
  require_start(map, start);
  lattice_ = mesh_lattice(map, std::move(frames), options);
  MeshGrowth growth(map, lattice_, options);
  growth.grow_from(start);
  cheapest_failure_ = growth.cheapest_failure();
  // Kept are the nodes that were landed, in the order in which they were met.
  std::vector<std::uint32_t> number(growth.nodes(), NodeTable::none);
  for (std::uint32_t node = 0; node < growth.nodes(); ++node) {
    if (growth.row(node) == MeshGrowth::no_row) continue;
    number[node] = static_cast<std::uint32_t>(key_.size());
    table_.insert(growth.key(node), number[node]);
    key_.push_back(growth.key(node));
  }
  column_.reserve(growth.entries());
  value_.reserve(growth.entries());
  for (std::uint32_t node = 0; node < growth.nodes(); ++node) {
    if (number[node] == NodeTable::none) continue;
    const std::size_t row = growth.row(node);
    double leave = growth.leave(row);
    for (std::size_t e = 0; e < growth.columns(row).size(); ++e) {
      const std::uint32_t to = number[growth.columns(row)[e]];
      if (to == NodeTable::none) {
        leave += growth.values(row)[e];
      } else {
        column_.push_back(to);
        value_.push_back(growth.values(row)[e]);
      }
    }
    row_start_.push_back(column_.size());
    kill_.push_back(growth.kill(row));
    leave_.push_back(leave);
  }
  bytes_ = growth.bytes() + column_.size() * MeshGrowth::entry_bytes;
}

Mesh::Corners Mesh::corners(int phase, std::span<const double> state) const {
  Corners corners;
  if (state.size() != lattice_.dimension())
    throw std::invalid_argument(fmt::format("mesh: a state of {} numbers expected", lattice_.dimension()));
  NodeLattice::Point point{};
  if (!lattice_.locate(phase, state.data(), point)) return corners;
  NodeSimplex simplex;
  lattice_.find_simplex(phase, point, 0, simplex);
  for (std::size_t i = 0; i <= state.size(); ++i) {
    const std::uint32_t node = table_.find(simplex.key[i]);
    if (node == NodeTable::none) continue;
    corners.node[static_cast<std::size_t>(corners.count)] = node;
    corners.weight[static_cast<std::size_t>(corners.count++)] = simplex.weight[i];
  }
  return corners;
}

void Mesh::apply_left(std::span<const double> x, std::span<double> y) const {
  std::fill(y.begin(), y.end(), 0.0);
  for (std::size_t i = 0; i < size(); ++i) {
    const double mass = x[i];
    if (mass == 0) continue;  // Survivors have not come everywhere yet.
    for (std::size_t e = row_start_[i]; e < row_start_[i + 1]; ++e) y[column_[e]] += mass * value_[e];
  }
}

void Mesh::apply(std::span<const double> x, std::span<double> y) const {
  for (std::size_t i = 0; i < size(); ++i) {
    double sum = 0;
    for (std::size_t e = row_start_[i]; e < row_start_[i + 1]; ++e) sum += value_[e] * x[column_[e]];
    y[i] = sum;
  }
}

Chain Mesh::chain() const {
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill;
  std::vector<std::pair<std::uint32_t, double>> row;
  for (std::size_t i = 0; i < size(); ++i) {
    row.clear();
    for (std::size_t e = row_start_[i]; e < row_start_[i + 1]; ++e)
      if (column_[e] != i) row.emplace_back(column_[e], value_[e]);
    std::sort(row.begin(), row.end());
    for (const auto& [to, probability] : row) {
      column.push_back(to);
      value.push_back(probability);
    }
    row_start.push_back(column.size());
    kill.push_back(kill_[i] + leave_[i]);
  }
  return {std::move(row_start), std::move(column), std::move(value), std::move(kill)};
}

}  // namespace metastable::markov
