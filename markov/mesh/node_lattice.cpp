#include "markov/mesh/node_lattice.h"

#include <algorithm>
#include <cmath>

namespace metastable::markov {
namespace {

// Keys have 15 bits an axis, phases above.
constexpr int bits_of_an_axis = 15;
constexpr std::int32_t half = 1 << (bits_of_an_axis - 1);
constexpr int block_bits = 3;

using Place = std::array<std::int32_t, 4>;

std::uint64_t pack(int phase, const Place& place) {
  std::uint64_t key = static_cast<std::uint64_t>(phase);
  for (const std::int32_t k : place) key = (key << bits_of_an_axis) | static_cast<std::uint64_t>(k + half);
  return key;
}

}  // namespace

std::uint32_t NodeTable::find(std::uint64_t key) const {
  if (slot_.empty()) return none;
  const std::size_t mask = slot_.size() - 1;
  for (std::size_t i = first_slot(key, slot_.size());; ++i) {
    const auto& slot = slot_[i & mask];
    if (slot.second == none) return none;
    if (slot.first == key) return slot.second;
  }
}

void NodeTable::insert(std::uint64_t key, std::uint32_t node) {
  if (2 * (used_ + 1) > slot_.size()) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> old(std::max<std::size_t>(1024, 2 * slot_.size()), {0, none});
    old.swap(slot_);
    used_ = 0;
    for (const auto& [k, n] : old)
      if (n != none) insert(k, n);
  }
  const std::size_t mask = slot_.size() - 1;
  std::size_t i = first_slot(key, slot_.size());
  while (slot_[i & mask].second != none) ++i;
  slot_[i & mask] = {key, node};
  ++used_;
}

NodeLattice::NodeLattice(std::vector<NoiseFrame> frames, double spacing, const Point& shift)
    : frames_(std::move(frames)), spacing_(spacing), shift_(shift) {}

int NodeLattice::phase(std::uint64_t key) { return static_cast<int>(key >> (4 * bits_of_an_axis)); }

std::uint64_t NodeLattice::block(std::uint64_t key) {
  constexpr std::uint64_t axis = (1U << block_bits) - 1;
  constexpr std::uint64_t within =
      axis | axis << bits_of_an_axis | axis << (2 * bits_of_an_axis) | axis << (3 * bits_of_an_axis);
  return key & ~within;
}

std::vector<double> NodeLattice::state(std::uint64_t key) const {
  const NoiseFrame& of_phase = frame(phase(key));
  std::array<double, 4> at{};
  for (std::size_t k = 4; k-- > 0; key >>= bits_of_an_axis)
    at[k] = static_cast<std::int32_t>(key & ((1U << bits_of_an_axis) - 1)) - half + shift_[k];
  const std::size_t d = dimension();
  std::vector<double> state = of_phase.centre;
  for (std::size_t i = 0; i < d; ++i)
    for (std::size_t k = 0; k < d; ++k) state[i] += of_phase.axes[i * d + k] * spacing_ * at[k];
  return state;
}

bool NodeLattice::locate(int phase, const double* state, Point& point) const {
  const NoiseFrame& of_phase = frame(phase);
  const std::size_t d = dimension();
  bool reachable = true;
  for (std::size_t k = 0; k < d; ++k) {
    double u = 0;
    for (std::size_t i = 0; i < d; ++i) u += of_phase.inverse[k * d + i] * (state[i] - of_phase.centre[i]);
    point[k] = u / spacing_ - shift_[k];
    reachable = reachable && std::abs(point[k]) < half - 2;
  }
  return reachable;
}

std::uint64_t NodeLattice::axis_key(std::size_t k) { return std::uint64_t{1} << (bits_of_an_axis * (3 - k)); }

std::uint64_t NodeLattice::find_cell(int phase, const Point& point, Point& fraction) const {
  Place at{};
  for (std::size_t k = 0; k < dimension(); ++k) {
    // The floor of a number that nodes reach: a processor of the baseline has no instruction for it.
    at[k] = static_cast<std::int32_t>(point[k]);
    at[k] -= point[k] < at[k];
    fraction[k] = point[k] - at[k];
  }
  return pack(phase, at);
}

void NodeLattice::find_simplex(int phase, const Point& point, unsigned flips, NodeSimplex& out) const {
  const std::size_t d = dimension();
  std::array<double, 4> fraction{};
  std::array<std::size_t, 4> order{};
  Place at{};
  for (std::size_t k = 0; k < d; ++k) {
    const bool flipped = (flips >> k) & 1U;
    const double below = flipped ? std::ceil(point[k]) : std::floor(point[k]);
    fraction[k] = std::abs(point[k] - below);
    at[k] = static_cast<std::int32_t>(below);
    std::size_t i = k;
    for (; i > 0 && fraction[order[i - 1]] < fraction[k]; --i) order[i] = order[i - 1];
    order[i] = k;
  }
  out.key[0] = pack(phase, at);
  out.weight[0] = 1 - fraction[order[0]];
  for (std::size_t i = 0; i < d; ++i) {
    const std::size_t k = order[i];
    at[k] += ((flips >> k) & 1U) ? -1 : 1;
    out.key[i + 1] = pack(phase, at);
    out.weight[i + 1] = fraction[k] - (i + 1 < d ? fraction[order[i + 1]] : 0);
  }
}

}  // namespace metastable::markov
