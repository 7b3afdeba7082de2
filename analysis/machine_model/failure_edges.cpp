#include "analysis/machine_model/failure_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace metastable::analysis {
namespace {

// An edge of failure lies between two points of the lattice; each round halves what it lies in.
constexpr int halvings = 16;
// Points to either side of an edge from the mean, among which other states have theirs.
constexpr std::size_t about_an_edge = 2;
constexpr double next_to_nothing = 1e-5;  // a chance of failure, or a weight of cells
constexpr double near_the_middle = 2.1;   // sds of the other score within which lines are sought that tell of the rest
constexpr std::ptrdiff_t worth_telling = 4;  // such lines, from which on three tell of them all
constexpr double beside_its_place = 0.1;     // in spacings, by which an edge that others tell may leave its two points
// A chance of failure at the mean state from which on states about it are asked, too, and one at which these count in
// full.
constexpr double worth_states = 1e-4, all_states = 2e-3;
constexpr double infinite = std::numeric_limits<double>::infinity();

}  // namespace

template <int Most>
std::vector<typename FailureLine<Most>::Interval> FailureLine<Most>::alive() const {
  std::vector<Interval> all;
  bool on = begins_alive;
  double from = -infinite;
  for (const double edge : edges) {
    if (on) all.emplace_back(from, edge);
    from = edge;
    on = !on;
  }
  if (on) all.emplace_back(from, infinite);
  return all;
}

// An interval of scores on a line that holds an edge of failure: the machine goes on at one end and fails at the other.
template <int Most>
struct FailureEdges<Most>::Edge {
  Line* line;
  double low, high;
  bool low_alive, counts;
};

// Neighbouring lines on which failing looks alike: the edges of three of them tell those of all.
template <int Most>
struct FailureEdges<Most>::Alike {
  std::size_t first, last;
  std::array<std::size_t, 3> nodes;
};

// Lines from the mean of one trial's belief, as the lattice has them: edges are in the middle between two points.
template <int Most>
std::vector<typename FailureEdges<Most>::Line> FailureEdges<Most>::rough_lines(std::size_t trial,
                                                                               const Vector& mean) const {
  std::vector<Line> all;
  const std::size_t n = lattice_.axis.points.size();
  for (std::size_t p = 0; p < lattice_.points(); p += n) {
    const std::size_t first = start_of(trial) + p;
    Line& line = all.emplace_back(Line{trial, p, 1, false, mean, !stepper_.failed(first), {}});
    for (std::size_t i = 0; i + 1 < n; ++i)
      if (stepper_.failed(first + i) != stepper_.failed(first + i + 1))
        line.edges.push_back(0.5 * (lattice_.axis.points[i] + lattice_.axis.points[i + 1]));
  }
  return all;
}

// Lines along the failing score, trial by trial, of the trials that may fail: first those from the mean, then those
// from states about it, by which the chance of failure knows that the state is not known exactly. Where less
// fails the mean will do, and where next to nothing does the lattice itself.
template <int Most>
std::vector<typename FailureEdges<Most>::Line> FailureEdges<Most>::lines(std::span<const TransitionPlace> places,
                                                                         std::span<const Part> beliefs,
                                                                         std::span<const Matrix> roots,
                                                                         std::span<const Eigen::Index> used) const {
  const auto columns = static_cast<double>(used.size());
  const double spread = std::max(3.0, columns);  // points at the root of it have the normal's second moment
  std::vector<Line> all, fine;
  std::vector<std::vector<Line>> roughly;  // of the trials of the fine lines
  for (std::size_t t = 0; t < places.size(); ++t) {
    const Vector mean = beliefs[t].mean.head(static_cast<Eigen::Index>(stepper_.size()));
    std::vector<Line> rough = rough_lines(t, mean);
    const double chance = chance_of_failure(rough);
    if (chance > next_to_nothing) {
      const bool about = chance > 0.5 * worth_states;  // roughly known
      const auto add = [&](double weight, bool aside, const Vector& from) {
        for (std::size_t p = 0; p < lattice_.points(); p += lattice_.axis.points.size())
          fine.push_back({t, p, weight, aside, from});
      };
      add(about ? 1 - columns / spread : 1, false, mean);
      for (const Eigen::Index i : used)
        for (const double sign : {1.0, -1.0})
          if (about)
            add(0.5 / spread, true,
                mean + sign * std::sqrt(spread) * roots[t].col(i).head(static_cast<Eigen::Index>(stepper_.size())));
      roughly.push_back(std::move(rough));
    } else {
      std::ranges::move(rough, std::back_inserter(all));
    }
  }
  find_few(fine, roughly, places);
  std::ranges::move(fine, std::back_inserter(all));
  std::ranges::stable_sort(all, {}, &Line::trial);
  return all;
}

template <int Most>
std::vector<typename FailureEdges<Most>::Alike> FailureEdges<Most>::alike(std::span<const Line> rough) const {
  std::vector<Alike> all;
  for (std::size_t first = 0, last = 0; first < rough.size(); first = last + 1) {
    last = first;
    while (last + 1 < rough.size() && rough[last + 1].like(rough[first])) ++last;
    const auto near = [&](std::size_t l) { return std::abs(lattice_.axis.points[l]) <= near_the_middle; };
    std::size_t from = first, to = last;
    while (from < last && !near(from)) ++from;
    while (to > from && !near(to)) --to;
    if (rough[first].edges.empty() || std::ssize(rough.subspan(from, to + 1 - from)) < worth_telling) continue;
    all.push_back({first, last, {from, std::midpoint(from, to), to}});
  }
  return all;
}

// Interpolates the edges of a line between those of the nodes. Returns whether they lie where the lattice has them.
template <int Most>
bool FailureEdges<Most>::foretell(Line& line, const Alike& group, std::span<const Line> from_mean) const {
  const double x = lattice_.axis.points[line.first / lattice_.axis.points.size()];
  std::array<double, 3> at, share = {1, 1, 1};
  for (std::size_t i = 0; i < 3; ++i) at[i] = lattice_.axis.points[group.nodes[i]];
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (j != i) share[i] *= (x - at[j]) / (at[i] - at[j]);
  for (std::size_t e = 0; e < line.edges.size(); ++e) {
    double told = 0;
    for (std::size_t i = 0; i < 3; ++i) told += share[i] * from_mean[group.nodes[i]].edges[e];
    const double off = told - line.edges[e], half = 0.5 * lattice_.axis.spacing;
    if (std::abs(off) > half + beside_its_place * lattice_.axis.spacing) return false;
    line.edges[e] += std::clamp(off, -half, half);
  }
  return true;
}

// The lines from a state about the mean have the mean's edges, moved as that of its one known line.
template <int Most>
void FailureEdges<Most>::move_edges(std::span<Line> about, std::span<const Line> from_mean, std::size_t telling) const {
  for (std::size_t l = 0; l < about.size(); ++l) {
    if (about[l].known) continue;
    about[l].begins_alive = from_mean[l].begins_alive;
    about[l].edges = from_mean[l].edges;
    for (std::size_t e = 0; e < about[l].edges.size() && from_mean[l].like(from_mean[telling]); ++e)
      about[l].edges[e] += about[telling].edges[e] - from_mean[telling].edges[e];
  }
}

// Edges vary smoothly with the other score and with the state. They are sought on three lines from the mean and on one
// from each state about it, and on all others only where these do not tell them.
// @param lines  trial by trial: those from the mean, then those from each state about it
// @param rough  of the same trials, from the mean
template <int Most>
void FailureEdges<Most>::find_few(std::vector<Line>& lines, const std::vector<std::vector<Line>>& rough,
                                  std::span<const TransitionPlace> places) const {
  const std::size_t each = lattice_.points() / lattice_.axis.points.size();
  std::vector<std::vector<Alike>> groups;
  std::vector<std::size_t> telling, starts;
  std::vector<Line*> sought;
  const auto seek = [&](Line& line) {
    if (!std::exchange(line.known, true)) sought.push_back(&line);
  };
  const auto from = [&](std::size_t line) { return std::span(lines).subspan(line, each); };
  std::size_t end = 0;
  for (const std::vector<Line>& lattice : rough) {
    starts.push_back(end);
    groups.push_back(alike(lattice));
    const auto chance = [&](const Line& line) { return chance_on(line); };
    telling.push_back(static_cast<std::size_t>(std::ranges::max_element(lattice, {}, chance) - lattice.begin()));
    const std::span<Line> mean = from(end);
    std::vector<char> told(each);
    for (const Alike& group : groups.back()) {
      std::fill(told.begin() + static_cast<std::ptrdiff_t>(group.first),
                told.begin() + static_cast<std::ptrdiff_t>(group.last) + 1, char{1});
      for (const std::size_t node : group.nodes) seek(mean[node]);
    }
    for (std::size_t l = 0; l < each; ++l)
      if (!told[l]) seek(mean[l]);
    for (end += each; end < lines.size() && lines[end].about; end += each) seek(lines[end + telling.back()]);
  }
  starts.push_back(end);
  find_edges(sought, places);
  sought.clear();
  for (std::size_t t = 0; t < rough.size(); ++t) {
    const std::span<Line> mean = from(starts[t]);
    for (const Alike& group : groups[t])
      for (std::size_t l = group.first; l <= group.last; ++l) {
        if (mean[l].known) continue;
        Line told = rough[t][l];
        if (foretell(told, group, mean)) {
          mean[l].begins_alive = told.begins_alive;
          mean[l].edges = told.edges;
          mean[l].known = true;
        } else {
          seek(mean[l]);
        }
      }
    for (std::size_t about = starts[t] + each; about < starts[t + 1]; about += each)
      if (!lines[about + telling[t]].like(rough[t][telling[t]]))
        for (Line& line : from(about)) seek(line);
  }
  find_edges(sought, places);
  for (std::size_t t = 0; t < rough.size(); ++t)
    for (std::size_t about = starts[t] + each; about < starts[t + 1]; about += each)
      move_edges(from(about), from(starts[t]), telling[t]);
}

// Says of every point of the lines whether the machine goes on: of those from the mean as the lattice has it; of others
// the points about the mean's edges are stepped.
template <int Most>
std::vector<char> FailureEdges<Most>::goes_on(std::span<Line* const> lines, std::span<const TransitionPlace> places,
                                              MachineStepper& stepper) const {
  const std::size_t n = lattice_.axis.points.size();
  std::vector<char> alive(lines.size() * n);
  std::vector<std::size_t> asked;
  stepper.clear();
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const Line& line = *lines[l];
    char* here = alive.data() + l * n;
    for (std::size_t i = 0; i < n; ++i) here[i] = !stepper_.failed(start_of(line.trial) + line.first + i);
    std::vector<char> near(n);
    for (std::size_t i = 0; i + 1 < n && line.about; ++i)
      if (here[i] != here[i + 1])
        for (std::size_t k = i - std::min(i, about_an_edge); k < std::min(n, i + 2 + about_an_edge); ++k) near[k] = 1;
    for (std::size_t i = 0; i < n; ++i)
      if (near[i]) {
        stepper.add(places[line.trial], line.from, scores_at(line.first + i));
        asked.push_back(l * n + i);
      }
  }
  if (!asked.empty()) stepper.run();
  for (std::size_t i = 0; i < asked.size(); ++i) alive[asked[i]] = !stepper.failed(i);
  return alive;
}

// Seeks the edges of failure on all lines together; those that hardly weigh are left between two points.
template <int Most>
void FailureEdges<Most>::find_edges(std::span<Line* const> lines, std::span<const TransitionPlace> places) const {
  if (lines.empty()) return;
  const std::size_t n = lattice_.axis.points.size();
  MachineStepper stepper = stepper_.another();
  const std::vector<char> alive = goes_on(lines, places, stepper);
  std::vector<Edge> edges;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const char* here = alive.data() + l * n;
    lines[l]->begins_alive = here[0] != 0;
    const double share = lattice_.scores.size() > 1 ? lattice_.axis.shares[lines[l]->first / n] : 1;
    for (std::size_t i = 0; i + 1 < n; ++i)
      if (here[i] != here[i + 1]) {
        const bool counts = share * std::max(lattice_.axis.shares[i], lattice_.axis.shares[i + 1]) > next_to_nothing;
        edges.push_back({lines[l], lattice_.axis.points[i], lattice_.axis.points[i + 1], here[i] != 0, counts});
      }
  }
  for (int round = 0; round < halvings; ++round) halve(edges, places, stepper);
  for (const Edge& edge : edges) edge.line->edges.push_back(0.5 * (edge.low + edge.high));
}

// Halves what each edge lies in.
template <int Most>
void FailureEdges<Most>::halve(std::vector<Edge>& edges, std::span<const TransitionPlace> places,
                               MachineStepper& stepper) const {
  if (std::ranges::none_of(edges, &Edge::counts)) return;
  stepper.clear();
  for (const Edge& edge : edges) {
    if (!edge.counts) continue;
    Vector fresh = scores_at(edge.line->first);
    fresh[static_cast<Eigen::Index>(lattice_.scores.front())] = 0.5 * (edge.low + edge.high);
    stepper.add(places[edge.line->trial], edge.line->from, fresh);
  }
  stepper.run();
  std::size_t point = 0;
  for (Edge& edge : edges)
    if (edge.counts) (stepper.failed(point++) != edge.low_alive ? edge.low : edge.high) = 0.5 * (edge.low + edge.high);
}

// The chance of failure on a line, times the share of the line among those of its state.
template <int Most>
double FailureEdges<Most>::chance_on(const Line& line) const {
  if (line.edges.empty() && line.begins_alive) return 0;
  const double failed = std::max(0.0, 1 - cell_part(0, 1, line.alive()).mass);
  return lattice_.scores.size() > 1 ? failed * lattice_.axis.shares[line.first / lattice_.axis.points.size()] : failed;
}

// Goes over from the chance at the mean state to that over all states, so that no value jumps where these are asked.
// @param lines  of one trial
template <int Most>
double FailureEdges<Most>::chance_of_failure(std::span<const Line> lines) const {
  double at_mean = 0, over_states = 0;
  bool about = false;
  for (const Line& line : lines) {
    const double chance = chance_on(line);
    if (!line.about) at_mean += chance;
    over_states += line.weight * chance;
    about = about || line.about;
  }
  if (!about || !(at_mean > worth_states)) return std::clamp(at_mean, 0.0, 1.0);
  const double share = std::clamp(std::log(at_mean / worth_states) / std::log(all_states / worth_states), 0.0, 1.0);
  return std::clamp((1 - share) * at_mean + share * over_states, 0.0, 1.0);
}

template struct FailureLine<small_belief>;
template struct FailureLine<Eigen::Dynamic>;
template class FailureEdges<small_belief>;
template class FailureEdges<Eigen::Dynamic>;

}  // namespace metastable::analysis
