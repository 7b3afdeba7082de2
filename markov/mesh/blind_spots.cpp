#include "markov/mesh/blind_spots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "markov/mesh/mesh_growth.h"
#include "markov/mesh/score_curve.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::markov {
namespace {

constexpr std::uint64_t states_stream = 0x9000, scores_stream = 0xa000, places_stream = 0xb000;
constexpr std::size_t lines_probed = 3000, on_a_line = 16, probed_together = 64;
constexpr double least_reach = 6, reach_in_sds = 8.5;  // of a line [sds]: places of a curve hang on it
constexpr double others_heat = 2;                      // of the scores but the first
// A line of one score is a blind spot where it fails twice as often as any node around it.
constexpr double above_nodes = 2;
// A line of several scores is one where it fails in more than the first share and no node around it in more than the
// second, and where it does not fail like that under its other scores.
constexpr double line_fails = 0.3, nodes_fail_share = 0.03;
constexpr double tolerated_errors = 2;  // standard errors
constexpr double jump_worth = 0.01;     // of the rate: a difference of failing between neighbours that is looked into,
constexpr std::size_t jump_edges = 32;  // so many of them,
constexpr int jump_halvings = 7;        // so often
constexpr double jumps_matter = 0.05;   // of the rate, as a root of squares: jumps worth less show in the shifts alone
constexpr double jump_left = 0.3;       // of a difference: what is left of a jump, and 1/128 of what is smooth

/// Sums contributions of lines, each with its probability.
struct Sum {
  double sum = 0, squares = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
  }
  double bound() const {
    const auto n = static_cast<double>(lines_probed);
    const double mean = sum / n;
    return mean + tolerated_errors * std::sqrt(std::max(0.0, squares / n - mean * mean) / n);
  }
};

class Probing {
 public:
  Probing(const BatchMap& map, const std::vector<NoiseFrame>& frames, const Mesh& mesh, std::span<const double> visits,
          const MeshOptions& options)
      : map_(map),
        mesh_(mesh),
        options_(options),
        lattice_(mesh_lattice(map, frames, options)),
        d_(static_cast<std::size_t>(map.dimension)),
        s_(static_cast<std::size_t>(map.scores)),
        visits_(visits) {
    const double all = std::accumulate(visits.begin(), visits.end(), 0.0);
    double failing = 0;
    for (std::size_t i = 0; i < mesh.size(); ++i) failing += visits[i] * mesh.kill()[i];
    for (std::size_t i = 0; i < mesh.size(); ++i)
      share_.push_back(0.5 / static_cast<double>(mesh.size()) + 0.25 * visits[i] / all +
                       0.25 * visits[i] * mesh.kill()[i] / failing);
    std::partial_sum(share_.begin(), share_.end(), std::back_inserter(up_to_));
  }

  BlindSpots find() {
    std::vector<std::vector<Line>> of_phase(static_cast<std::size_t>(map_.phases));
    for (std::size_t n = 0; n < lines_probed; ++n) {
      Line line = draw(n);
      if (map_.inside && !map_.inside(line.phase, line.state)) continue;
      auto& waiting = of_phase[static_cast<std::size_t>(line.phase)];
      waiting.push_back(std::move(line));
      if (waiting.size() == (map_.dear ? lines_probed : probed_together)) probe(waiting);
    }
    for (auto& waiting : of_phase)
      if (!waiting.empty()) probe(waiting);
    found_.missed = missed_.bound();
    found_.imagined = imagined_.bound();
    return found_;
  }

 private:
  struct Line {
    std::size_t number = 0;
    int phase = 0;
    std::vector<double> state, others;
    double reach = 0;
    double weight = 0;  ///< expected visits over the density with which it is drawn
    double nodes_fail = 1;
  };

  std::vector<double> numbers(std::uint64_t stream, std::size_t number, std::size_t count) const {
    std::vector<double> all;
    for (std::size_t k = 0; k < count; k += 4) {
      const auto u = uniforms(options_.seed, stream + k / 4, number, 0);
      all.insert(all.end(), u.begin(), u.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(4, count - k)));
    }
    return all;
  }

  Line draw(std::size_t number) const {
    Line line;
    line.number = number;
    const std::vector<double> u = numbers(states_stream, number, 2 + 2 * d_);
    const auto place = std::upper_bound(up_to_.begin(), up_to_.end(), u[0] * up_to_.back()) - up_to_.begin();
    const std::size_t node = std::min(static_cast<std::size_t>(place), mesh_.size() - 1);
    line.phase = mesh_.phase(node);
    line.state = mesh_.state(node);
    const NoiseFrame& frame = lattice_.frame(line.phase);
    for (std::size_t k = 0; k < d_; ++k) {  // the sum of two evenly spread numbers: as the mesh interpolates
      const double by = options_.spacing * (u[2 + 2 * k] + u[3 + 2 * k] - 1);
      for (std::size_t i = 0; i < d_; ++i) line.state[i] += frame.axes[i * d_ + k] * by;
    }
    line.reach = least_reach + (reach_in_sds - least_reach) * u[1];
    line.weight = visits_[node] / share_[node];
    for (const double v : numbers(scores_stream, number, s_ - 1)) {
      const double z = others_heat * normal_score(v);
      line.others.push_back(z);
      line.weight *= others_heat * std::exp(-0.5 * z * z * (1 - 1 / (others_heat * others_heat)));
    }
    const Mesh::Corners corners = mesh_.corners(line.phase, line.state);
    if (static_cast<std::size_t>(corners.count) <= d_) return line;  // at the edge of the mesh
    line.nodes_fail = 0;
    for (int c = 0; c < corners.count; ++c)
      line.nodes_fail = std::max(line.nodes_fail, mesh_.kill()[corners.node[static_cast<std::size_t>(c)]]);
    return line;
  }

  void probe(std::vector<Line>& lines) {
    ScoreLines along;
    for (const Line& line : lines) {
      along.states.insert(along.states.end(), line.state.begin(), line.state.end());
      along.others.insert(along.others.end(), line.others.begin(), line.others.end());
      along.reach.push_back(line.reach);
    }
    const std::vector<ScoreCurve> curves =
        follow_curves(map_, lattice_, lines.front().phase, along, options_.score_spacing, options_.spacing);
    std::vector<double> states, scores;
    for (const Line& line : lines) {
      const std::vector<double> at = numbers(places_stream, line.number, on_a_line);
      for (std::size_t j = 0; j < on_a_line; ++j) {
        states.insert(states.end(), line.state.begin(), line.state.end());
        scores.push_back(line.reach * (2 * (static_cast<double>(j) + at[j]) / on_a_line - 1));
        scores.insert(scores.end(), line.others.begin(), line.others.end());
      }
    }
    std::vector<double> next(states.size());
    std::vector<std::uint8_t> failed(lines.size() * on_a_line, 0);
    checked_step(map_, lines.front().phase, states, scores, next, failed);
    for (std::size_t n = 0; n < lines.size(); ++n)
      judge(lines[n], curves[n], std::span(scores).subspan(n * on_a_line * s_, on_a_line * s_),
            std::span(failed).subspan(n * on_a_line, on_a_line));
    found_.probes += failed.size();
    lines.clear();
  }

  void judge(const Line& line, const ScoreCurve& curve, std::span<const double> scores,
             std::span<const std::uint8_t> failed) {
    double missed = 0, imagined = 0;
    for (std::size_t j = 0; j < on_a_line; ++j) {
      const double z = scores[j * s_];
      const auto fate = curve.fate(z);
      if (!fate || *fate == ScoreCurve::Fate::leaves || (*fate == ScoreCurve::Fate::fails) == (failed[j] != 0))
        continue;
      ++found_.hits;
      (failed[j] ? missed : imagined) +=
          2 * line.reach / on_a_line * std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
    }
    parts_.clear();
    const double fails = curve.share(lattice_, (line.phase + 1) % map_.phases, 1, parts_).fails;
    const bool alone = s_ == 1 ? fails > above_nodes * line.nodes_fail
                               : fails > line_fails && line.nodes_fail < nodes_fail_share && !fails_around(line);
    if (alone) {
      ++found_.hits;
      missed += fails;
    }
    missed_.add(line.weight * missed);
    imagined_.add(line.weight * imagined);
  }

  /// Returns whether the same other scores make one of the nodes around fail as often.
  bool fails_around(const Line& line) {
    const Mesh::Corners corners = mesh_.corners(line.phase, line.state);
    ScoreLines along;
    for (int c = 0; c < corners.count; ++c) {
      const std::vector<double> state = mesh_.state(corners.node[static_cast<std::size_t>(c)]);
      if (map_.inside && !map_.inside(line.phase, state)) return true;
      along.states.insert(along.states.end(), state.begin(), state.end());
      along.others.insert(along.others.end(), line.others.begin(), line.others.end());
      along.reach.push_back(line.reach);
    }
    const std::vector<ScoreCurve> curves =
        follow_curves(map_, lattice_, line.phase, along, options_.score_spacing, options_.spacing);
    return std::any_of(curves.begin(), curves.end(), [&](const ScoreCurve& curve) {
      parts_.clear();
      return curve.share(lattice_, (line.phase + 1) % map_.phases, 1, parts_).fails > line_fails;
    });
  }

  const BatchMap& map_;
  const Mesh& mesh_;
  const MeshOptions& options_;
  NodeLattice lattice_;
  std::size_t d_, s_;
  std::span<const double> visits_;
  std::vector<double> share_, up_to_;
  std::vector<std::pair<std::uint64_t, double>> parts_;
  Sum missed_, imagined_;
  BlindSpots found_;
};

}  // namespace

BlindSpots find_blind_spots(const BatchMap& map, const std::vector<NoiseFrame>& frames, const Mesh& mesh,
                            std::span<const double> visits, const MeshOptions& options) {
  return Probing(map, frames, mesh, visits, options).find();
}

namespace {

/// An edge between two nodes, with the chance of failing at both of its ends.
struct Edge {
  int phase = 0;
  std::vector<double> from, to;
  double fails_from = 0, fails_to = 0, worth = 0;
  double difference() const { return std::abs(fails_to - fails_from); }
};

/// Returns the edges whose difference is worth something, the largest ones.
std::vector<Edge> edges_worth_it(const Mesh& mesh, std::span<const double> visits, std::size_t dimension) {
  double failing = 0;
  for (std::size_t i = 0; i < mesh.size(); ++i) failing += visits[i] * mesh.kill()[i];
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < mesh.size(); ++i)
    for (std::size_t axis = 0; axis < dimension; ++axis) {
      const std::uint32_t j = mesh.neighbour(i, axis);
      if (j == NodeTable::none) continue;
      const double difference = std::abs(mesh.kill()[i] - mesh.kill()[j]);
      const double worth = difference * std::max(visits[i], visits[j]) / failing;
      if (worth < jump_worth) continue;
      edges.push_back({mesh.phase(i), mesh.state(i), mesh.state(j), mesh.kill()[i], mesh.kill()[j], worth});
    }
  std::stable_sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.worth > b.worth; });
  if (edges.size() > jump_edges) edges.resize(jump_edges);
  return edges;
}

/// Finds the chance of failing from states of one phase, all under the same lines of scores.
std::vector<double> fails_from(const BatchMap& map, const NodeLattice& lattice, int phase,
                               const std::vector<std::vector<double>>& states, const MeshOptions& options) {
  const std::size_t fixed = static_cast<std::size_t>(map.scores) - 1;
  std::vector<double> score, weight{1};
  if (fixed > 0) {
    const ScoreLattice others(map.scores - 1, options.score_spacing, options.score_reach);
    score.resize(others.size() * fixed);
    weight.resize(others.size());
    others.place(std::vector<double>(fixed, 0.5), score, weight);
  }
  ScoreLines lines;
  for (const std::vector<double>& state : states)
    for (std::size_t n = 0; n < weight.size(); ++n) {
      lines.states.insert(lines.states.end(), state.begin(), state.end());
      const auto at = std::span(score).subspan(n * fixed, fixed);
      lines.others.insert(lines.others.end(), at.begin(), at.end());
      lines.reach.push_back(options.score_reach);
    }
  const std::vector<ScoreCurve> curves =
      follow_curves(map, lattice, phase, lines, options.score_spacing, options.spacing);
  const double all = std::accumulate(weight.begin(), weight.end(), 0.0);
  std::vector<std::pair<std::uint64_t, double>> parts;
  std::vector<double> fails(states.size(), 0.0);
  for (std::size_t i = 0; i < curves.size(); ++i) {
    parts.clear();
    fails[i / weight.size()] +=
        weight[i % weight.size()] / all * curves[i].share(lattice, (phase + 1) % map.phases, 1, parts).fails;
  }
  return fails;
}

/// Halves edges of one phase, and keeps the half whose ends differ more. Middles outside the section fail.
void halve(const BatchMap& map, const NodeLattice& lattice, std::vector<Edge*>& edges, const MeshOptions& options) {
  std::vector<std::vector<double>> middles, inside;
  for (const Edge* edge : edges) {
    middles.push_back(edge->from);
    for (std::size_t k = 0; k < edge->from.size(); ++k) middles.back()[k] = 0.5 * (edge->from[k] + edge->to[k]);
    if (!map.inside || map.inside(edge->phase, middles.back())) inside.push_back(middles.back());
  }
  const std::vector<double> found =
      inside.empty() ? std::vector<double>{} : fails_from(map, lattice, edges.front()->phase, inside, options);
  std::size_t next = 0;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    Edge& edge = *edges[e];
    const double fails = map.inside && !map.inside(edge.phase, middles[e]) ? 1 : found[next++];
    if (std::abs(fails - edge.fails_from) > std::abs(edge.fails_to - fails)) {
      edge.to = std::move(middles[e]);
      edge.fails_to = fails;
    } else {
      edge.from = std::move(middles[e]);
      edge.fails_from = fails;
    }
  }
}

}  // namespace

bool failing_jumps(const BatchMap& map, const std::vector<NoiseFrame>& frames, const Mesh& mesh,
                   std::span<const double> visits, const MeshOptions& options) {
  std::vector<Edge> edges = edges_worth_it(mesh, visits, static_cast<std::size_t>(map.dimension));
  const NodeLattice lattice = mesh_lattice(map, frames, options);
  std::vector<std::vector<Edge*>> of_phase(static_cast<std::size_t>(map.phases));
  std::vector<double> before;
  for (Edge& edge : edges) {
    before.push_back(edge.difference());
    of_phase[static_cast<std::size_t>(edge.phase)].push_back(&edge);
  }
  for (std::vector<Edge*>& some : of_phase)
    for (int halving = 0; halving < jump_halvings && !some.empty(); ++halving) halve(map, lattice, some, options);
  double squares = 0;  // of what jumps are worth, each of them half a spacing off at random
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges[e].difference() > jump_left * before[e]) squares += edges[e].worth * edges[e].worth;
  return std::sqrt(squares) > jumps_matter;
}

}  // namespace metastable::markov
