#include "markov/mesh/mesh_growth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace metastable::markov {
namespace {

constexpr double bucket = 1;                             // of actions, expanded together
constexpr double worth_again = 0.05;                     // a row speaks again if its node's action falls by this
constexpr double farther = 0.5;                          // scores looked at, beyond what the action allows
constexpr std::size_t batch_size = 32;                   // nodes whose landings are asked for at once,
constexpr std::size_t line_limit = 1024;                 // fewer where that makes more curves;
constexpr std::size_t dear_lines = 1024;                 // and curves at once where calls are dear: some 20 rows each
constexpr std::uint32_t taken = MeshGrowth::no_row - 1;  // not a row yet
constexpr std::uint64_t states_of_rows = 0xd000;
constexpr double irrational[] = {0.7548776662466927, 0.5698402909980532, 0.4301597090019468};  // of a row's states
constexpr std::size_t probe_stride = 31;  // a prime: lines of scores whose states follow one another
constexpr std::size_t fewest_in_chunk = std::size_t{1} << 16, most_in_chunk = std::size_t{1} << 23;
constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

MeshGrowth::MeshGrowth(const BatchMap& map, const NodeLattice& lattice, const MeshOptions& options, Exchange* exchange)
    : map_(map), lattice_(lattice), options_(options), exchange_(exchange) {
  if (map.scores > 1) others_.emplace(map.scores - 1, options.score_spacing, options.score_reach);
}

double MeshGrowth::limit() const {
  if (options_.limit > 0) return options_.limit;
  if (target_.empty()) return std::min(farthest, cheapest_failure_ + options_.margin);
  const std::vector<double> actions = target_actions();
  return std::min(farthest, std::max(cheapest_failure_, *std::max_element(actions.begin(), actions.end())));
}

void MeshGrowth::mark_targets() {
  for (const std::vector<double>& state : options_.targets) {
    target_.emplace_back();
    NodeLattice::Point point{};
    if (!lattice_.locate(0, state.data(), point)) continue;
    NodeSimplex simplex;
    lattice_.find_simplex(0, point, 0, simplex);
    for (std::size_t i = 0; i <= state.size(); ++i) target_.back().push_back(node_at(simplex.key[i]));
  }
}

std::vector<double> MeshGrowth::target_actions() const {
  std::vector<double> actions;
  for (const auto& nodes : target_) {
    actions.push_back(infinity);
    for (const std::uint32_t node : nodes) actions.back() = std::min(actions.back(), action_[node]);
  }
  return actions;
}

int MeshGrowth::owner(std::uint64_t key) const {
  if (!exchange_) return 0;
  std::uint64_t hash = NodeLattice::block(key);  // mixed as by splitmix64 (Steele, Lea, Flood 2014)
  hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9ULL;
  hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<int>((hash >> 33) % static_cast<std::uint64_t>(exchange_->ranks()));
}

std::uint32_t MeshGrowth::node_at(std::uint64_t key) {
  std::uint32_t node = table_.find(key);
  if (node != NodeTable::none) return node;
  node = static_cast<std::uint32_t>(key_.size());
  table_.insert(key, node);
  key_.push_back(key);
  action_.push_back(infinity);
  row_of_.push_back(no_row);
  own_.push_back(!exchange_ || owner(key) == exchange_->rank());
  return node;
}

void MeshGrowth::start_from(int phase, std::span<const double> state, double action) {
  NodeLattice::Point point{};
  if (!lattice_.locate(phase, state.data(), point))
    throw MapError(fmt::format("mesh: the start {} is too far from the noise-free orbit", describe_state(map_, state)));
  NodeSimplex simplex;
  lattice_.find_simplex(phase, point, 0, simplex);
  for (std::size_t i = 0; i <= state.size(); ++i) {
    const std::uint32_t node = node_at(simplex.key[i]);
    if (own_[node]) lower(node, action);
  }
}

void MeshGrowth::grow_from(std::span<const double> start) {
  start_from(0, start, options_.start_action);
  for (int phase = 0; phase < map_.phases; ++phase)
    start_from(phase, lattice_.frame(phase).centre, options_.start_action);
  for (const MeshSource& source : options_.sources) start_from(0, source.state, source.action);
  grow();
}

void MeshGrowth::grow_from_state(std::span<const double> state) {
  start_from(0, state, 0);
  mark_targets();
  grow();
}

void MeshGrowth::lower(std::uint32_t node, double to) {
  if (!(to < action_[node])) return;
  if (!own_[node]) {
    // `row_of_` of such a node says whether it waits to be told.
    if (row_of_[node] == no_row) {
      to_others_.push_back(node);
      row_of_[node] = 0;
    }
    action_[node] = to;
    return;
  }
  action_[node] = to;
  if (row_of_[node] != no_row) {
    Row& row = row_[row_of_[node]];
    if (row.again || !(to < row.said - worth_again)) return;
    row.again = true;
    again_.push_back(row_of_[node]);
    return;
  }
  const auto place = std::max(current_, static_cast<std::size_t>(to / bucket));
  if (place >= bucket_.size()) bucket_.resize(place + 1);
  bucket_[place].push_back(node);
}

void MeshGrowth::relax(const Row& row) {
  const double scale = row.said + std::log(row.largest);
  if (row.kill > 0) cheapest_failure_ = std::min(cheapest_failure_, scale - std::log(row.kill));
  const Chunk& chunk = chunk_[row.chunk];
  for (std::size_t e = row.first; e < row.last; ++e) {
    const std::uint32_t to = chunk.column[e];
    if (action_[to] > row.said) lower(to, scale - std::log(chunk.value[e]));
  }
}

/// Tells the owners of nodes how far their actions fell, and hears of one's own.
void MeshGrowth::tell() {
  if (!exchange_) return;
  std::vector<std::vector<Exchange::Note>> notes(static_cast<std::size_t>(exchange_->ranks()));
  for (const std::uint32_t node : to_others_) {
    notes[static_cast<std::size_t>(owner(key_[node]))].push_back({key_[node], action_[node]});
    row_of_[node] = no_row;
  }
  to_others_.clear();
  for (const auto& from_rank : exchange_->swap(notes))
    for (const Exchange::Note& note : from_rank) lower(node_at(note.key), note.value);
}

void MeshGrowth::follow(std::vector<std::uint32_t> rows) {
  while (sum(static_cast<double>(rows.size())) > 0) {
    for (const std::uint32_t r : rows) {
      row_[r].said = action_[row_[r].node];
      row_[r].again = false;
    }
    for (const std::uint32_t r : rows) relax(row_[r]);
    tell();
    rows.clear();
    rows.swap(again_);
  }
  cheapest_failure_ = -largest(-cheapest_failure_);
}

/// Adds up the parts of each key, in the order in which keys come first.
void MeshGrowth::add_up(Parts& parts) {
  while (place_of_.size() < 2 * parts.size()) {
    place_of_.assign(std::max<std::size_t>(1024, 2 * place_of_.size()), {0, 0});
    added_up_ = 0;
  }
  if (++added_up_ == 0) {  // it has come round
    std::fill(place_of_.begin(), place_of_.end(), std::pair<std::uint32_t, std::uint32_t>{0, 0});
    added_up_ = 1;
  }
  const std::size_t mask = place_of_.size() - 1;
  std::uint32_t used = 0;
  for (std::size_t next = 0; next < parts.size(); ++next) {
    const Parts::value_type part = parts[next];
    std::size_t i = NodeTable::first_slot(part.first, place_of_.size());
    while (place_of_[i & mask].first == added_up_ && parts[place_of_[i & mask].second].first != part.first) ++i;
    auto& [stamp, place] = place_of_[i & mask];
    if (stamp == added_up_) {
      parts[place].second += part.second;
    } else {
      stamp = added_up_;
      place = used;
      parts[used++] = part;
    }
  }
  parts.resize(used);
}

void MeshGrowth::store(std::uint32_t node, Parts& parts, double failed, double away) {
  add_up(parts);
  const std::size_t used = parts.size();
  if (chunk_.empty() || chunk_.back().column.size() + used > chunk_.back().column.capacity()) {
    const std::size_t size = std::max(used, std::clamp(entries_, fewest_in_chunk, most_in_chunk));
    chunk_.emplace_back();
    chunk_.back().column.reserve(size);
    chunk_.back().value.reserve(size);
  }
  Chunk& chunk = chunk_.back();
  Row row{.node = node, .chunk = static_cast<std::uint32_t>(chunk_.size() - 1), .largest = failed, .kill = failed};
  row.leave = away;
  for (const auto& part : parts) {
    row.largest = std::max(row.largest, part.second);
    table_.fetch(part.first);
  }
  const double least = row.largest * std::exp(action_[node] - limit());
  row.first = static_cast<std::uint32_t>(chunk.column.size());
  for (const auto& [key, value] : parts) {
    if (value >= least) {
      chunk.column.push_back(node_at(key));
      chunk.value.push_back(value);
    } else {
      row.leave += value;
    }
  }
  row.last = static_cast<std::uint32_t>(chunk.column.size());
  entries_ += row.last - row.first;
  row_of_[node] = static_cast<std::uint32_t>(row_.size());
  row_.push_back(row);
}

/// Returns states in rows that stand for a node: its own, or so many spread as the sum of two numbers even over half a
/// spacing to either side, which is how far landings are shared. They lie on a lattice of rank one, moved by an offset
/// of the node's own.
std::vector<double> MeshGrowth::row_states(std::uint32_t node, std::size_t count) const {
  std::vector<double> states = lattice_.state(key_[node]);
  if (options_.row_states == 1) {
    const std::vector<double> own = states;
    for (std::size_t q = 1; q < count; ++q) states.insert(states.end(), own.begin(), own.end());
    return states;
  }
  const std::vector<double> centre = std::move(states);
  states.clear();
  const std::size_t d = centre.size();
  const NoiseFrame& frame = lattice_.frame(NodeLattice::phase(key_[node]));
  const auto offset = uniforms(options_.seed, states_of_rows, key_[node], options_.shift);
  for (std::size_t q = 0; q < count; ++q) {
    states.insert(states.end(), centre.begin(), centre.end());
    for (std::size_t k = 0; k < d; ++k) {
      const double step = k == 0 ? 1 / static_cast<double>(count) : irrational[k - 1];
      double u = offset[k] + static_cast<double>(q) * step;
      u -= std::floor(u);
      const double by = options_.spacing * (u < 0.5 ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 * (1 - u)));
      for (std::size_t i = 0; i < d; ++i) states[q * d + i] += frame.axes[i * d + k] * by;
    }
  }
  return states;
}

/// Puts lines through the scores that a node is landed from, along the first: of one score there is one from each of
/// its states, of several a lattice of the others, moved by an offset of the node's own. As far as the action allows.
/// Returns the weight of the lines from states outside the section, which are left out: they count as failed.
double MeshGrowth::add_lines(std::uint32_t node, Lines& lines) const {
  const double far = std::min(options_.score_reach, farther + std::sqrt(2 * std::max(0.0, limit() - action_[node])));
  const auto d = static_cast<std::size_t>(map_.dimension);
  const int phase = NodeLattice::phase(key_[node]);
  double outside = 0;
  const auto add = [&](std::span<const double> state, std::span<const double> others, double weight, double reach) {
    const double others_action = 0.5 * std::inner_product(others.begin(), others.end(), others.begin(), 0.0);
    if (map_.inside && !map_.inside(phase, state)) {
      outside += weight;
      return;
    }
    lines.along.states.insert(lines.along.states.end(), state.begin(), state.end());
    lines.along.others.insert(lines.along.others.end(), others.begin(), others.end());
    lines.along.reach.push_back(reach);
    lines.along.beyond.push_back(action_[node] + others_action - cheapest_failure_);
    lines.weight.push_back(weight);
  };
  lines.first.push_back(lines.weight.size());
  if (!others_) {
    const auto count = static_cast<std::size_t>(options_.row_states);
    const std::vector<double> states = row_states(node, count);
    for (std::size_t q = 0; q < count; ++q)
      add(std::span(states).subspan(q * d, d), {}, 1 / static_cast<double>(count), far);
    return outside;
  }
  const std::size_t fixed = static_cast<std::size_t>(map_.scores) - 1, m = others_->size();
  std::vector<double> offset, score(m * fixed), weight(m);
  for (std::size_t k = 0; k < fixed; k += 4) {
    const auto u = uniforms(options_.seed, 1 + k / 4, key_[node], options_.shift);
    offset.insert(offset.end(), u.begin(), u.end());
  }
  others_->place(offset, score, weight);
  const double sum = std::accumulate(weight.begin(), weight.end(), 0.0);
  const std::vector<double> states = row_states(node, m);
  // Neighbours on the lattice of scores come one after another, and so would their states.
  const std::size_t apart = probe_stride % m == 0 ? 1 : probe_stride;
  for (std::size_t i = 0; i < m; ++i) {
    const auto others = std::span(score).subspan(i * fixed, fixed);
    const double left = far * far - std::inner_product(others.begin(), others.end(), others.begin(), 0.0);
    if (left > 0)
      add(std::span(states).subspan(i * apart % m * d, d), others, weight[i] / sum, std::max(farther, std::sqrt(left)));
  }
  return outside;
}

void MeshGrowth::land(std::span<const std::uint32_t> nodes) {
  const int phase = NodeLattice::phase(key_[nodes.front()]), to_phase = (phase + 1) % map_.phases;
  Lines lines;
  std::vector<double> outside;
  for (const std::uint32_t node : nodes) outside.push_back(add_lines(node, lines));
  lines.first.push_back(lines.weight.size());
  const std::vector<ScoreCurve> curves =
      follow_curves(map_, lattice_, phase, lines.along, options_.score_spacing, options_.spacing);
  Parts parts;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    parts.clear();
    double fails = outside[n], looked_at = outside[n], away = 0;
    for (std::size_t line = lines.first[n]; line < lines.first[n + 1]; ++line) {
      const double weight = lines.weight[line];
      const ScoreCurve::Shares shares = curves[line].share(lattice_, to_phase, weight, parts);
      fails += weight * shares.fails;
      away += weight * shares.leaves;
      looked_at += weight;
    }
    store(nodes[n], parts, fails, away + std::max(0.0, 1 - looked_at));
  }
}

std::size_t MeshGrowth::bytes() const {
  return entries_ * entry_bytes + table_.bytes() + row_.size() * sizeof(Row) +
         key_.size() * (sizeof(std::uint64_t) + sizeof(double) + sizeof(std::uint32_t) + sizeof(std::uint8_t));
}

void MeshGrowth::require_memory() {
  if (largest(static_cast<double>(bytes())) > static_cast<double>(options_.most_bytes))
    throw std::length_error(
        fmt::format("mesh: spacing {:.3g} takes more than {:.2g} GB, {} nodes and {} entries so far", options_.spacing,
                    static_cast<double>(options_.most_bytes) / 0x1p30, sum(static_cast<double>(rows())),
                    sum(static_cast<double>(entries_))));
}

std::vector<std::uint32_t> MeshGrowth::take_wave() {
  std::vector<std::uint32_t> wave;
  if (current_ >= bucket_.size()) return wave;
  wave.swap(bucket_[current_]);
  std::erase_if(wave, [&](std::uint32_t node) {  // it may have been landed, or come twice
    const bool fresh = row_of_[node] == no_row;
    if (fresh) row_of_[node] = taken;
    return !fresh;
  });
  return wave;
}

void MeshGrowth::expand_wave(std::vector<std::uint32_t>& wave) {
  std::stable_sort(wave.begin(), wave.end(), [&](std::uint32_t a, std::uint32_t b) {
    return NodeLattice::phase(key_[a]) < NodeLattice::phase(key_[b]);
  });
  const std::size_t lines = map_.dear ? dear_lines : line_limit, batch = map_.dear ? dear_lines : batch_size;
  const std::size_t each = others_ ? others_->size() : static_cast<std::size_t>(options_.row_states);
  const std::size_t together = each > 1 ? std::clamp<std::size_t>(lines / each, 1, batch) : batch;
  std::string broken;
  try {
    for (std::size_t first = 0; first < wave.size();) {
      std::size_t last = first + 1;
      const int phase = NodeLattice::phase(key_[wave[first]]);
      while (last < wave.size() && last - first < together && NodeLattice::phase(key_[wave[last]]) == phase) ++last;
      land(std::span(wave).subspan(first, last - first));
      if (options_.on_batch) options_.on_batch();
      first = last;
    }
  } catch (const MapError& error) {
    if (!exchange_) throw;
    broken = error.what();
  }
  if (exchange_) broken = exchange_->first_text(broken);
  if (!broken.empty()) throw MapError(broken);
}

void MeshGrowth::grow() {
  while (static_cast<double>(current_) < largest(static_cast<double>(bucket_.size())) &&
         static_cast<double>(current_) * bucket <= limit()) {
    std::vector<std::uint32_t> wave = take_wave();
    if (sum(static_cast<double>(wave.size())) == 0) {
      ++current_;
      continue;
    }
    expand_wave(wave);
    require_memory();
    std::vector<std::uint32_t> spoken;
    for (const std::uint32_t node : wave) spoken.push_back(row_of_[node]);
    follow(std::move(spoken));
  }
  if (!(cheapest_failure_ < std::max(farthest, options_.limit)) && target_.empty())
    throw NoFailureFound(fmt::format(
        "return map: no failure is found within an action of {} (half the sum of squares of the scores that "
        "lead to it) from {}, on a mesh of {} nodes",
        farthest, describe_state(map_, lattice_.frame(0).centre), sum(static_cast<double>(nodes()))));
}

std::span<const std::uint32_t> MeshGrowth::columns(std::size_t row) const {
  const Row& r = row_[row];
  return std::span(chunk_[r.chunk].column).subspan(r.first, r.last - r.first);
}

std::span<const double> MeshGrowth::values(std::size_t row) const {
  const Row& r = row_[row];
  return std::span(chunk_[r.chunk].value).subspan(r.first, r.last - r.first);
}

void MeshGrowth::forget_entries_before(std::size_t row) {
  const std::size_t chunk = row < row_.size() ? row_[row].chunk : chunk_.size();
  for (; forgotten_ < chunk; ++forgotten_) chunk_[forgotten_] = {};
}

}  // namespace metastable::markov
