#include "markov/mesh/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include "markov/mesh/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr double kFarthest = 60;      // action beyond which failures are not looked for
constexpr double kBucket = 1;         // of actions, expanded together
constexpr double kWorthAgain = 0.05;  // an expanded node is looked at again if its action falls by this
constexpr int kHalvings = 9;          // of a gap between scores, to find where failures begin
constexpr std::size_t kBatch = 32;    // nodes whose landings are asked for at once
constexpr std::size_t kEntryBytes = sizeof(std::uint32_t) + sizeof(double);
constexpr double infinity = std::numeric_limits<double>::infinity();

// Keys: 15 bits an axis, phases above.
constexpr int kBits = 15;
constexpr std::int32_t kHalf = 1 << (kBits - 1);

std::uint64_t pack(int phase, const std::array<std::int32_t, 4>& place) {
  std::uint64_t key = static_cast<std::uint64_t>(phase);
  for (const std::int32_t k : place) key = (key << kBits) | static_cast<std::uint64_t>(k + kHalf);
  return key;
}

bool packable(double coordinate) { return std::abs(coordinate) < kHalf - 2; }

}  // namespace

std::uint32_t Mesh::Table::find(std::uint64_t key) const {
  if (slot_.empty()) return none;
  const std::size_t mask = slot_.size() - 1;
  for (std::size_t i = (key * 0x9e3779b97f4a7c15ULL) >> 20;; ++i) {
    const auto& slot = slot_[i & mask];
    if (slot.second == none) return none;
    if (slot.first == key) return slot.second;
  }
}

void Mesh::Table::insert(std::uint64_t key, std::uint32_t node) {
  if (2 * (used_ + 1) > slot_.size()) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> old(std::max<std::size_t>(1024, 2 * slot_.size()), {0, none});
    old.swap(slot_);
    used_ = 0;
    for (const auto& [k, n] : old)
      if (n != none) insert(k, n);
  }
  const std::size_t mask = slot_.size() - 1;
  std::size_t i = (key * 0x9e3779b97f4a7c15ULL) >> 20;
  while (slot_[i & mask].second != none) ++i;
  slot_[i & mask] = {key, node};
  ++used_;
}

std::pair<int, Mesh::Place> Mesh::place(std::size_t node) const {
  std::uint64_t key = key_[node];
  Place at{};
  for (std::size_t k = 4; k-- > 0; key >>= kBits) at[k] = static_cast<std::int32_t>(key & ((1U << kBits) - 1)) - kHalf;
  return {static_cast<int>(key), at};
}

int Mesh::phase(std::size_t node) const { return place(node).first; }

std::vector<double> Mesh::state(std::size_t node) const {
  const auto [phase, at] = place(node);
  const NoiseFrame& frame = frames_[static_cast<std::size_t>(phase)];
  const std::size_t d = frame.centre.size();
  std::vector<double> state = frame.centre;
  for (std::size_t i = 0; i < d; ++i)
    for (std::size_t k = 0; k < d; ++k) state[i] += frame.axes[i * d + k] * spacing_ * (at[k] + shift_[k]);
  return state;
}

namespace {

/// The corners of Kuhn's simplex around a point given in units of the spacing; bit k of `flips` turns axis k around.
struct Simplex {
  std::array<std::array<std::int32_t, 4>, 5> place{};
  std::array<double, 5> weight{};
};

void find_simplex(const double* point, std::size_t d, unsigned flips, Simplex& out) {
  std::array<double, 4> fraction{};
  std::array<std::size_t, 4> order{};
  std::array<std::int32_t, 4> at{};
  for (std::size_t k = 0; k < d; ++k) {
    const bool flipped = (flips >> k) & 1U;
    const double below = flipped ? std::ceil(point[k]) : std::floor(point[k]);
    fraction[k] = std::abs(point[k] - below);
    at[k] = static_cast<std::int32_t>(below);
    std::size_t i = k;
    for (; i > 0 && fraction[order[i - 1]] < fraction[k]; --i) order[i] = order[i - 1];
    order[i] = k;
  }
  out.place[0] = at;
  out.weight[0] = 1 - fraction[order[0]];
  for (std::size_t i = 0; i < d; ++i) {
    const std::size_t k = order[i];
    at[k] += ((flips >> k) & 1U) ? -1 : 1;
    out.place[i + 1] = at;
    out.weight[i + 1] = fraction[k] - (i + 1 < d ? fraction[order[i + 1]] : 0);
  }
}

/// A state in units of the spacing.
bool to_lattice(const NoiseFrame& frame, double spacing, const std::array<double, 4>& shift, const double* state,
                double* point) {
  const std::size_t d = frame.centre.size();
  bool reachable = true;
  for (std::size_t k = 0; k < d; ++k) {
    double u = 0;
    for (std::size_t i = 0; i < d; ++i) u += frame.inverse[k * d + i] * (state[i] - frame.centre[i]);
    point[k] = u / spacing - shift[k];
    reachable = reachable && packable(point[k]);
  }
  return reachable;
}

}  // namespace

Mesh::Corners Mesh::corners(int phase, std::span<const double> state) const {
  Corners corners;
  std::array<double, 4> point{};
  const NoiseFrame& frame = frames_.at(static_cast<std::size_t>(phase));
  if (state.size() != frame.centre.size())
    throw std::invalid_argument(fmt::format("mesh: a state of {} numbers expected", frame.centre.size()));
  if (!to_lattice(frame, spacing_, shift_, state.data(), point.data())) return corners;
  Simplex simplex;
  find_simplex(point.data(), state.size(), 0, simplex);
  for (std::size_t i = 0; i <= state.size(); ++i) {
    const std::uint32_t node = table_.find(pack(phase, simplex.place[i]));
    if (node == Table::none) continue;
    corners.node[static_cast<std::size_t>(corners.count)] = node;
    corners.weight[static_cast<std::size_t>(corners.count++)] = simplex.weight[i];
  }
  return corners;
}

/// What is known of nodes while the mesh grows.
struct Mesh::Growth {
  Growth(Mesh& m, const BatchMap& the_map, const MeshOptions& o)
      : mesh(m), map(the_map), options(o), lattice(the_map.scores, o.score_spacing, o.score_reach) {}

  void start_from(int phase, std::span<const double> state);
  void grow();
  void finish();

 private:
  struct Row {
    std::size_t first = 0, last = 0;
    double largest = 0;
  };
  std::uint32_t node_at(std::uint64_t key);
  double limit() const { return std::min(kFarthest, mesh.cheapest_failure_ + options.margin); }
  void expand(std::span<const std::uint32_t> nodes);
  void store(std::uint32_t node, std::vector<std::pair<std::uint64_t, double>>& parts, double killed);
  void relax(std::uint32_t node);
  void lower(std::uint32_t node, double to);
  std::size_t bytes() const;
  void require_memory() const;

  Mesh& mesh;
  const BatchMap& map;
  const MeshOptions& options;
  ScoreLattice lattice;
  std::vector<double> action;
  std::vector<Row> row;  ///< of expanded nodes
  std::vector<std::uint8_t> expanded;
  std::vector<double> killed, left;
  std::vector<std::vector<std::uint32_t>> bucket;
  std::vector<std::uint32_t> again;
  std::size_t current = 0;
};

std::uint32_t Mesh::Growth::node_at(std::uint64_t key) {
  std::uint32_t node = mesh.table_.find(key);
  if (node != Table::none) return node;
  node = static_cast<std::uint32_t>(mesh.key_.size());
  mesh.table_.insert(key, node);
  mesh.key_.push_back(key);
  action.push_back(infinity);
  row.push_back({});
  expanded.push_back(0);
  killed.push_back(0);
  left.push_back(0);
  return node;
}

void Mesh::Growth::lower(std::uint32_t node, double to) {
  const double from = action[node];
  if (!(to < from)) return;
  action[node] = to;
  if (expanded[node]) {
    if (to < from - kWorthAgain) again.push_back(node);
    return;
  }
  const auto place = std::max(current, static_cast<std::size_t>(to / kBucket));
  if (place >= bucket.size()) bucket.resize(place + 1);
  bucket[place].push_back(node);
}

void Mesh::Growth::start_from(int phase, std::span<const double> state) {
  std::array<double, 4> point{};
  if (!to_lattice(mesh.frames_[static_cast<std::size_t>(phase)], mesh.spacing_, mesh.shift_, state.data(),
                  point.data()))
    throw MapError(fmt::format("mesh: the start {} is too far from the noise-free orbit", describe_state(map, state)));
  Simplex simplex;
  find_simplex(point.data(), state.size(), 0, simplex);
  for (std::size_t i = 0; i <= state.size(); ++i) lower(node_at(pack(phase, simplex.place[i])), 0);
}

void Mesh::Growth::relax(std::uint32_t node) {
  const Row& r = row[node];
  const double scale = action[node] + std::log(r.largest);
  if (killed[node] > 0) mesh.cheapest_failure_ = std::min(mesh.cheapest_failure_, scale - std::log(killed[node]));
  for (std::size_t e = r.first; e < r.last; ++e) {
    const std::uint32_t to = mesh.column_[e];
    if (action[to] > action[node]) lower(to, scale - std::log(mesh.value_[e]));
  }
}

void Mesh::Growth::store(std::uint32_t node, std::vector<std::pair<std::uint64_t, double>>& parts, double failed) {
  std::sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::size_t used = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (used > 0 && parts[used - 1].first == parts[i].first)
      parts[used - 1].second += parts[i].second;
    else
      parts[used++] = parts[i];
  }
  parts.resize(used);
  Row& r = row[node];
  r.largest = failed;
  for (const auto& part : parts) r.largest = std::max(r.largest, part.second);
  killed[node] = failed;
  const double least = r.largest * std::exp(action[node] - limit());
  const std::size_t first = mesh.column_.size();
  for (const auto& [key, value] : parts) {
    if (value >= least) {
      const std::uint32_t to = node_at(key);  // may move the rows
      mesh.column_.push_back(to);
      mesh.value_.push_back(value);
    } else {
      left[node] += value;
    }
  }
  row[node].first = first;
  row[node].last = mesh.column_.size();
}

namespace {

/// Probability that a normal score lies in (low, high), with relative accuracy in both tails.
double normal_mass(double low, double high) {
  const auto tail = [](double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); };
  return low > 0 ? tail(low) - tail(high) : tail(-high) - tail(-low);
}

/// One score: the probabilities of failing, from where between neighbouring scores failures begin and end. Bisects all
/// edges of a batch together. `failed` and `score` hold m entries a node, ascending.
std::vector<double> masses_of_failure(const BatchMap& map, int phase, std::span<const double> states,
                                      std::span<const double> score, std::span<const std::uint8_t> failed,
                                      std::size_t m) {
  struct Edge {
    std::size_t node;
    double low, high;
    bool failed_below;
  };
  const std::size_t nodes = failed.size() / m, d = states.size() / failed.size();
  std::vector<Edge> edges;
  for (std::size_t n = 0; n < nodes; ++n)
    for (std::size_t i = n * m; i + 1 < (n + 1) * m; ++i)
      if (failed[i] != failed[i + 1]) edges.push_back({n, score[i], score[i + 1], failed[i] != 0});
  std::vector<double> from(edges.size() * d), at(edges.size()), to(from.size());
  std::vector<std::uint8_t> fails(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e)
    std::copy_n(states.begin() + static_cast<std::ptrdiff_t>(edges[e].node * m * d), d,
                from.begin() + static_cast<std::ptrdiff_t>(e * d));
  for (int halving = 0; halving < kHalvings && !edges.empty(); ++halving) {
    for (std::size_t e = 0; e < edges.size(); ++e) at[e] = 0.5 * (edges[e].low + edges[e].high);
    std::fill(fails.begin(), fails.end(), 0);
    checked_step(map, phase, from, at, to, fails);
    for (std::size_t e = 0; e < edges.size(); ++e)
      ((fails[e] != 0) == edges[e].failed_below ? edges[e].low : edges[e].high) = at[e];
  }
  std::vector<double> mass(nodes, 0.0);
  std::size_t e = 0;
  for (std::size_t n = 0; n < nodes; ++n) {
    double begin = -infinity;
    bool failing = failed[n * m] != 0;
    for (; e < edges.size() && edges[e].node == n; ++e, failing = !failing) {
      const double edge = 0.5 * (edges[e].low + edges[e].high);
      if (failing) mass[n] += normal_mass(begin, edge);
      begin = edge;
    }
    if (failing) mass[n] += normal_mass(begin, infinity);
  }
  return mass;
}

}  // namespace

void Mesh::Growth::expand(std::span<const std::uint32_t> nodes) {
  const auto d = static_cast<std::size_t>(map.dimension), s = static_cast<std::size_t>(map.scores);
  const std::size_t m = lattice.size();
  std::vector<double> states, scores(m * s * nodes.size()), weights(m * nodes.size()), next;
  std::vector<std::uint32_t> inside;
  const int phase = mesh.phase(nodes.front());
  std::vector<std::pair<std::uint64_t, double>> parts;
  std::size_t place = 0;
  for (const std::uint32_t node : nodes) {
    const std::vector<double> state = mesh.state(node);
    if (map.inside && !map.inside(phase, state)) {
      parts.clear();
      store(node, parts, 1);
      continue;
    }
    inside.push_back(node);
    std::vector<double> offset;
    for (std::size_t k = 0; k < s; k += 4) {
      const auto u = uniforms(options.seed, 1 + k / 4, mesh.key_[node], options.shift);
      offset.insert(offset.end(), u.begin(), u.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, s - k)));
    }
    lattice.place(offset, std::span(scores).subspan(place * m * s, m * s), std::span(weights).subspan(place * m, m));
    for (std::size_t i = 0; i < m; ++i) states.insert(states.end(), state.begin(), state.end());
    ++place;
  }
  if (inside.empty()) return;
  next.resize(states.size());
  std::vector<std::uint8_t> failed(place * m, 0);
  const std::span<const double> used_scores = std::span<const double>(scores).first(place * m * s);
  checked_step(map, phase, states, used_scores, next, failed);
  const std::vector<double> masses =
      s == 1 ? masses_of_failure(map, phase, states, used_scores, failed, m) : std::vector<double>();
  const int to_phase = (phase + 1) % map.phases;
  const NoiseFrame& frame = mesh.frames_[static_cast<std::size_t>(to_phase)];
  std::array<double, 4> point{};
  Simplex simplex;
  for (std::size_t n = 0; n < inside.size(); ++n) {
    const auto turn = random_words(options.seed, 0x1000, mesh.key_[inside[n]], options.shift);
    auto orientation = static_cast<unsigned>(turn[0]);
    double sum = 0, survive = 0, failing = 0;
    for (std::size_t i = n * m; i < (n + 1) * m; ++i) {
      sum += weights[i];
      (failed[i] ? failing : survive) += weights[i];
    }
    const double fails = s == 1 ? masses[n] : failing / sum;
    double away = 0;
    parts.clear();
    for (std::size_t i = n * m; i < (n + 1) * m; ++i) {
      orientation = orientation * 5 + 3;  // another one for every score
      if (failed[i]) continue;
      const double weight = weights[i] / survive * (1 - fails);
      if (!to_lattice(frame, mesh.spacing_, mesh.shift_, &next[i * d], point.data())) {
        away += weight;
        continue;
      }
      find_simplex(point.data(), d, orientation >> 4, simplex);
      for (std::size_t c = 0; c <= d; ++c)
        if (weight * simplex.weight[c] > 0)
          parts.emplace_back(pack(to_phase, simplex.place[c]), weight * simplex.weight[c]);
    }
    left[inside[n]] = away;
    store(inside[n], parts, survive > 0 ? fails : 1);
  }
}

std::size_t Mesh::Growth::bytes() const {
  return mesh.column_.size() * kEntryBytes + mesh.table_.bytes() +
         mesh.key_.size() * (sizeof(std::uint64_t) + sizeof(Row) + 6 * sizeof(double));
}

void Mesh::Growth::require_memory() const {
  if (bytes() > options.most_bytes)
    throw std::length_error(
        fmt::format("mesh: spacing {:.3g} takes more than {:.1f} GB, {} nodes and {} entries so far", options.spacing,
                    static_cast<double>(options.most_bytes) / 0x1p30, mesh.key_.size(), mesh.column_.size()));
}

void Mesh::Growth::grow() {
  for (current = 0; current < bucket.size() && static_cast<double>(current) * kBucket <= limit();) {
    std::vector<std::uint32_t> wave;
    wave.swap(bucket[current]);
    std::erase_if(wave, [&](std::uint32_t node) {
      if (expanded[node]) return true;
      expanded[node] = 1;
      return false;
    });
    if (wave.empty()) {
      ++current;
      continue;
    }
    std::stable_sort(wave.begin(), wave.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return mesh.phase(a) < mesh.phase(b); });
    for (std::size_t first = 0; first < wave.size();) {
      std::size_t last = first + 1;
      while (last < wave.size() && last - first < kBatch && mesh.phase(wave[last]) == mesh.phase(wave[first])) ++last;
      expand(std::span(wave).subspan(first, last - first));
      first = last;
    }
    require_memory();
    for (const std::uint32_t node : wave) relax(node);
    while (!again.empty()) {
      const std::uint32_t node = again.back();
      again.pop_back();
      relax(node);
    }
  }
  if (!(mesh.cheapest_failure_ < kFarthest))
    throw MapError(
        fmt::format("return map: it never fails within reach of its noise (none of {} nodes around {} leads to a "
                    "failure within an action of {})",
                    mesh.key_.size(), describe_state(map, mesh.frames_[0].centre), kFarthest));
}

/// Keeps the expanded nodes, in the order of their actions.
void Mesh::Growth::finish() {
  std::vector<std::uint32_t> kept;
  for (std::uint32_t node = 0; node < expanded.size(); ++node)
    if (expanded[node]) kept.push_back(node);
  std::vector<std::uint32_t> number(expanded.size(), Table::none);
  for (std::size_t i = 0; i < kept.size(); ++i) number[kept[i]] = static_cast<std::uint32_t>(i);
  std::vector<std::uint32_t> column;
  std::vector<double> value;
  column.reserve(mesh.column_.size());
  value.reserve(mesh.column_.size());
  Table table;
  std::vector<std::uint64_t> keys;
  mesh.row_start_.assign(1, 0);
  for (const std::uint32_t node : kept) {
    for (std::size_t e = row[node].first; e < row[node].last; ++e) {
      const std::uint32_t to = number[mesh.column_[e]];
      if (to == Table::none) {
        left[node] += mesh.value_[e];
      } else {
        column.push_back(to);
        value.push_back(mesh.value_[e]);
      }
    }
    mesh.row_start_.push_back(column.size());
    mesh.kill_.push_back(killed[node]);
    mesh.leave_.push_back(left[node]);
    table.insert(mesh.key_[node], static_cast<std::uint32_t>(keys.size()));
    keys.push_back(mesh.key_[node]);
  }
  mesh.bytes_ = bytes() + column.size() * kEntryBytes;
  mesh.column_ = std::move(column);
  mesh.value_ = std::move(value);
  mesh.table_ = std::move(table);
  mesh.key_ = std::move(keys);
}

Mesh::Mesh(const BatchMap& map, std::vector<NoiseFrame> frames, std::span<const double> start,
           const MeshOptions& options)
    : frames_(std::move(frames)), spacing_(options.spacing), cheapest_failure_(infinity) {
  require_start(map, start);
  if (!(options.spacing > 0 && options.spacing <= 2))
    throw std::invalid_argument(fmt::format("mesh: spacing {} is outside (0, 2]", options.spacing));
  if (frames_.size() != static_cast<std::size_t>(map.phases) || frames_.size() > 15)
    throw std::invalid_argument(fmt::format("mesh: {} phases, 1 to 15 with a frame each expected", map.phases));
  shift_ = uniforms(options.seed, 0, options.shift, 0);
  Growth growth(*this, map, options);
  growth.start_from(0, start);
  for (int phase = 0; phase < map.phases; ++phase)
    growth.start_from(phase, frames_[static_cast<std::size_t>(phase)].centre);
  growth.grow();
  growth.finish();
}

void Mesh::apply_left(std::span<const double> x, std::span<double> y) const {
  std::fill(y.begin(), y.end(), 0.0);
  for (std::size_t i = 0; i < size(); ++i)
    for (std::size_t e = row_start_[i]; e < row_start_[i + 1]; ++e) y[column_[e]] += x[i] * value_[e];
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
