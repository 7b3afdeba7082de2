#include "analysis/machine_model/belief_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr double reach = 1.7320508075688772;  // points at sqrt 3 sds have the normal's fourth moment
constexpr double bend_share = 1.0 / 18;       // (h^2 - 1) / (4 h^4) with h^2 = 3
constexpr double rounding = 1e-14;            // of a variance
// An edge of failure lies between two points of the lattice; each round divides what it lies in.
constexpr int divisions = 8, parts_of_edge = 4;
constexpr std::size_t about_an_edge =
    3;  // points to either side of an edge from the mean, where other states have theirs
constexpr double next_to_nothing = 1e-5;  // a chance of failure, or a weight of cells
constexpr double near_the_middle = 2.1;   // sds of the other score within which lines are sought that tell of the rest
constexpr std::ptrdiff_t worth_telling = 4;  // such lines, from which on three tell of them all
constexpr double beside_its_place = 0.1;     // in spacings, by which an edge that others tell may leave its two points
// A chance of failure at the mean state from which on states about it are asked, too, and one at which these count in
// full.
constexpr double worth_states = 1e-4, all_states = 2e-3;
constexpr double almost_sure = 1 - 1e-12;  // a chance of failure
constexpr double least_weight = 1e-10;     // of a cell that counts
constexpr double infinite = std::numeric_limits<double>::infinity();

// Returns the lower root L of L L^T = covariance, with zero columns where there is no variance of its own.
template <class Matrix>
Matrix root_of(const Matrix& covariance) {
  const Eigen::Index n = covariance.rows();
  Matrix root = Matrix::Zero(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double pivot = covariance(j, j) - root.row(j).head(j).squaredNorm();
    if (!(pivot > rounding * covariance(j, j))) continue;
    root(j, j) = std::sqrt(pivot);
    for (Eigen::Index i = j + 1; i < n; ++i)
      root(i, j) = (covariance(i, j) - root.row(i).head(j).dot(root.row(j).head(j))) / root(j, j);
  }
  return root;
}

}  // namespace

// First and second differences of the next state, in one trial.
template <int Most>
struct BeliefStep<Most>::Slopes {
  Vector centre;                 // next state of the mean, scores at zero
  Matrix first, bend;            // [states x (used columns, straight scores)]: slope, f+ - 2 f0 + f-
  std::vector<Matrix> by_score;  // by lattice score: change of `first` a unit of it
};

// One cell of the lattice, in one trial.
template <int Most>
struct BeliefStep<Most>::Cell {
  double weight = 0, dead = 0;     // of the part that goes on, and of the one that fails
  std::size_t anchor = 0;          // the point of the lattice from which its next state is taken
  std::vector<CellPart> by_score;  // mean and variance, by lattice score
};

template <int Most>
BeliefStep<Most>::BeliefStep(MachineStepper& stepper, const ScorePlan& plan, std::size_t shared, bool bent)
    : stepper_(stepper), plan_(plan), shared_(shared), bent_(bent) {
  if (!plan_.lattice.empty()) axis_ = lattice_axis(static_cast<int>(plan_.lattice.size()));
  if (plan_.failing && plan_.lattice.front() != *plan_.failing) std::swap(plan_.lattice.front(), plan_.lattice.back());
  for (std::size_t m = 0; m < stepper_.scores(); ++m)
    if (std::ranges::find(plan_.lattice, m) == plan_.lattice.end()) straight_.push_back(m);
}

template <int Most>
std::size_t BeliefStep<Most>::lattice_points() const {
  std::size_t count = plan_.lattice.empty() ? 0 : 1;
  for (std::size_t b = 0; b < plan_.lattice.size(); ++b) count *= axis_.points.size();
  return count;
}

// The first score of the lattice runs fastest.
template <int Most>
BeliefVector<Most> BeliefStep<Most>::lattice_scores(std::size_t point) const {
  Vector fresh = Vector::Zero(static_cast<Eigen::Index>(stepper_.scores()));
  for (const std::size_t score : plan_.lattice) {
    fresh[static_cast<Eigen::Index>(score)] = axis_.points[point % axis_.points.size()];
    point /= axis_.points.size();
  }
  return fresh;
}

// The centre, pairs along the root and the straight scores, the lattice, and pairs at both ends of each of its scores.
template <int Most>
void BeliefStep<Most>::add_points(const TransitionPlace& place, const Part& belief, const Matrix& root) {
  const Vector mean = belief.mean.head(size());
  const Vector still = Vector::Zero(static_cast<Eigen::Index>(stepper_.scores()));
  const auto unit = [&](std::size_t score) {
    return Vector(Vector::Unit(still.size(), static_cast<Eigen::Index>(score)));
  };
  stepper_.add(place, mean, still);
  const auto add_pairs = [&](const Vector& fresh) {
    for (const Eigen::Index i : used_)
      for (const double sign : {reach, -reach}) stepper_.add(place, mean + sign * root.col(i).head(size()), fresh);
    for (const std::size_t s : straight_)
      for (const double sign : {reach, -reach}) stepper_.add(place, mean, fresh + sign * unit(s));
  };
  add_pairs(still);
  for (std::size_t p = 0; p < lattice_points(); ++p) stepper_.add(place, mean, lattice_scores(p));
  for (const std::size_t score : plan_.lattice)
    for (const double sign : {reach, -reach}) add_pairs(sign * unit(score));
}

// A slope is the central difference of a pair of points. If one of the two failed, the one-sided difference to the
// centre replaces it; `known` marks the pairs of which neither failed.
template <int Most>
BeliefMatrix<Most> BeliefStep<Most>::first_differences(std::size_t at, const Vector* centre, Matrix* bend,
                                                       std::vector<char>* known) const {
  Matrix slope = Matrix::Zero(states(), static_cast<Eigen::Index>(pairs()));
  if (bend) *bend = slope;
  if (known) known->assign(pairs(), 0);
  for (std::size_t i = 0; i < pairs(); ++i) {
    const bool lost_up = stepper_.failed(at + 2 * i), lost_down = stepper_.failed(at + 2 * i + 1);
    const auto column = static_cast<Eigen::Index>(i);
    if (!lost_up && !lost_down) {
      const Vector up = stepper_.next(at + 2 * i), down = stepper_.next(at + 2 * i + 1);
      slope.col(column) = (up - down) / (2 * reach);
      if (bend && centre) bend->col(column) = up + down - 2 * *centre;
      if (known) (*known)[i] = 1;
    } else if (centre && lost_up != lost_down) {
      const Vector one = stepper_.next(at + 2 * i + (lost_up ? 1 : 0));
      slope.col(column) = (lost_up ? Vector(*centre - one) : Vector(one - *centre)) / reach;
    }
  }
  return slope;
}

template <int Most>
typename BeliefStep<Most>::Slopes BeliefStep<Most>::slopes(std::size_t trial) const {
  const std::size_t first = trial * points_;
  Slopes s;
  s.centre = stepper_.next(first);
  const bool lost = stepper_.failed(first);
  if (lost) s.centre.setZero();  // a failed state is none
  s.first = first_differences(first + 1, lost ? nullptr : &s.centre, &s.bend, nullptr);
  std::size_t at = lattice_start(trial) + lattice_points();
  for (std::size_t b = 0; b < plan_.lattice.size(); ++b, at += 4 * pairs()) {
    std::vector<char> above, below;
    const Matrix up = first_differences(at, nullptr, nullptr, &above);
    const Matrix down = first_differences(at + 2 * pairs(), nullptr, nullptr, &below);
    Matrix& change = s.by_score.emplace_back(Matrix::Zero(states(), static_cast<Eigen::Index>(pairs())));
    for (std::size_t i = 0; i < pairs(); ++i) {
      const auto c = static_cast<Eigen::Index>(i);
      if (above[i] && below[i])
        change.col(c) = (up.col(c) - down.col(c)) / (2 * reach);
      else if (above[i] || below[i])
        change.col(c) = (above[i] ? Vector(up.col(c) - s.first.col(c)) : Vector(s.first.col(c) - down.col(c))) / reach;
    }
  }
  return s;
}

// Columns whose outer product is the covariance after the step: of the belief's root, of the straight scores, and of
// this row's own errors.
template <int Most>
BeliefMatrix<Most> BeliefStep<Most>::columns(const Matrix& slope, const Matrix& root) const {
  const auto shared = static_cast<Eigen::Index>(shared_), offsets = static_cast<Eigen::Index>(stepper_.offsets());
  const Eigen::Index before = states() + offsets, old = root.cols(),
                     scores = static_cast<Eigen::Index>(straight_.size());
  Matrix all = Matrix::Zero(size() + 2 * shared + bent(), old + scores + shared);
  for (std::size_t i = 0; i < used_.size(); ++i)
    all.col(used_[i]).head(states()) = slope.col(static_cast<Eigen::Index>(i));
  all.block(states(), 0, offsets, old) = root.block(states(), 0, offsets, old);
  for (Eigen::Index m = before; m < size(); ++m)
    all.row(m).head(old) = stepper_.memory(static_cast<std::size_t>(m - before)) * root.row(m);
  all.block(size() + shared, 0, shared, old) = root.bottomRows(shared);
  for (Eigen::Index s = 0; s < scores; ++s) {
    all.col(old + s).head(states()) = slope.col(static_cast<Eigen::Index>(used_.size()) + s);
    const std::size_t score = straight_[static_cast<std::size_t>(s)];
    if (stepper_.remembers())
      all(before + static_cast<Eigen::Index>(score), old + s) = std::sqrt(1 - std::pow(stepper_.memory(score), 2));
  }
  for (Eigen::Index c = 0; c < shared; ++c) all(size() + c, old + scores + c) = 1;
  return all;
}

// The step of a normal belief with the scores of the lattice at zero.
template <int Most>
typename BeliefStep<Most>::Part BeliefStep<Most>::part(const Slopes& slopes, const Part& belief,
                                                       const Matrix& root) const {
  const auto shared = static_cast<Eigen::Index>(shared_), offsets = static_cast<Eigen::Index>(stepper_.offsets());
  const Matrix all = columns(slopes.first, root);
  Part out;
  out.mean = Vector::Zero(all.rows());
  out.mean.head(states()) = slopes.centre + slopes.bend.rowwise().sum() / (2 * reach * reach);
  out.mean.segment(states(), offsets) = belief.mean.segment(states(), offsets);
  for (Eigen::Index m = states() + offsets; m < size(); ++m)
    out.mean[m] = stepper_.memory(static_cast<std::size_t>(m - states() - offsets)) * belief.mean[m];
  out.mean.segment(size() + shared, shared) = belief.mean.tail(shared);
  out.covariance = all * all.transpose();
  out.covariance.topLeftCorner(states(), states()) += bend_share * slopes.bend * slopes.bend.transpose();
  return out;
}

template <int Most>
std::vector<typename BeliefStep<Most>::Interval> BeliefStep<Most>::Line::alive() const {
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
struct BeliefStep<Most>::Edge {
  Line* line;
  double low, high;
  bool low_alive, counts;
};

// Neighbouring lines on which failing looks alike: the edges of three of them tell those of all.
template <int Most>
struct BeliefStep<Most>::Alike {
  std::size_t first, last;
  std::array<std::size_t, 3> nodes;
};

// Lines from the mean of one trial's belief, as the lattice has them: edges are in the middle between two points.
template <int Most>
std::vector<typename BeliefStep<Most>::Line> BeliefStep<Most>::rough_lines(std::size_t trial,
                                                                           const Vector& mean) const {
  std::vector<Line> all;
  const std::size_t n = axis_.points.size();
  for (std::size_t p = 0; p < lattice_points(); p += n) {
    const std::size_t first = lattice_start(trial) + p;
    Line& line = all.emplace_back(Line{trial, p, 1, false, mean, !stepper_.failed(first), {}});
    for (std::size_t i = 0; i + 1 < n; ++i)
      if (stepper_.failed(first + i) != stepper_.failed(first + i + 1))
        line.edges.push_back(0.5 * (axis_.points[i] + axis_.points[i + 1]));
  }
  return all;
}

// Lines along the failing score, trial by trial, of the trials that may fail: first those from the mean, then those
// from states about it, by which the chance of failure knows that the state is not known exactly. Where less
// fails the mean will do, and where next to nothing does the lattice itself.
template <int Most>
std::vector<typename BeliefStep<Most>::Line> BeliefStep<Most>::lines(std::span<const TransitionPlace> places,
                                                                     std::span<const Part> beliefs,
                                                                     std::span<const Matrix> roots) const {
  const auto columns = static_cast<double>(used_.size());
  const double spread = std::max(3.0, columns);  // points at the root of it have the normal's second moment
  std::vector<Line> all, fine;
  std::vector<std::vector<Line>> roughly;  // of the trials of the fine lines
  for (std::size_t t = 0; t < places.size(); ++t) {
    const Vector mean = beliefs[t].mean.head(size());
    std::vector<Line> rough = rough_lines(t, mean);
    const double chance = chance_of_failure(rough);
    if (chance > next_to_nothing) {
      const bool about = chance > 0.5 * worth_states;  // roughly known
      const auto add = [&](double weight, bool aside, const Vector& from) {
        for (std::size_t p = 0; p < lattice_points(); p += axis_.points.size())
          fine.push_back({t, p, weight, aside, from});
      };
      add(about ? 1 - columns / spread : 1, false, mean);
      for (const Eigen::Index i : used_)
        for (const double sign : {1.0, -1.0})
          if (about) add(0.5 / spread, true, mean + sign * std::sqrt(spread) * roots[t].col(i).head(size()));
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
std::vector<typename BeliefStep<Most>::Alike> BeliefStep<Most>::alike(std::span<const Line> rough) const {
  std::vector<Alike> all;
  for (std::size_t first = 0, last = 0; first < rough.size(); first = last + 1) {
    last = first;
    while (last + 1 < rough.size() && rough[last + 1].like(rough[first])) ++last;
    const auto near = [&](std::size_t l) { return std::abs(axis_.points[l]) <= near_the_middle; };
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
bool BeliefStep<Most>::foretell(Line& line, const Alike& group, std::span<const Line> from_mean) const {
  const double x = axis_.points[line.first / axis_.points.size()];
  std::array<double, 3> at, share = {1, 1, 1};
  for (std::size_t i = 0; i < 3; ++i) at[i] = axis_.points[group.nodes[i]];
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (j != i) share[i] *= (x - at[j]) / (at[i] - at[j]);
  for (std::size_t e = 0; e < line.edges.size(); ++e) {
    double told = 0;
    for (std::size_t i = 0; i < 3; ++i) told += share[i] * from_mean[group.nodes[i]].edges[e];
    const double off = told - line.edges[e], half = 0.5 * axis_.spacing;
    if (std::abs(off) > half + beside_its_place * axis_.spacing) return false;
    line.edges[e] += std::clamp(off, -half, half);
  }
  return true;
}

// The lines from a state about the mean have the mean's edges, moved as that of its one known line.
template <int Most>
void BeliefStep<Most>::move_edges(std::span<Line> about, std::span<const Line> from_mean, std::size_t telling) const {
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
void BeliefStep<Most>::find_few(std::vector<Line>& lines, const std::vector<std::vector<Line>>& rough,
                                std::span<const TransitionPlace> places) const {
  const std::size_t each = lattice_points() / axis_.points.size();
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
std::vector<char> BeliefStep<Most>::goes_on(std::span<Line* const> lines, std::span<const TransitionPlace> places,
                                            MachineStepper& stepper) const {
  const std::size_t n = axis_.points.size();
  std::vector<char> alive(lines.size() * n);
  std::vector<std::size_t> asked;
  stepper.clear();
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const Line& line = *lines[l];
    char* here = alive.data() + l * n;
    for (std::size_t i = 0; i < n; ++i) here[i] = !stepper_.failed(lattice_start(line.trial) + line.first + i);
    std::vector<char> near(n);
    for (std::size_t i = 0; i + 1 < n && line.about; ++i)
      if (here[i] != here[i + 1])
        for (std::size_t k = i - std::min(i, about_an_edge); k < std::min(n, i + 2 + about_an_edge); ++k) near[k] = 1;
    for (std::size_t i = 0; i < n; ++i)
      if (near[i]) {
        stepper.add(places[line.trial], line.from, lattice_scores(line.first + i));
        asked.push_back(l * n + i);
      }
  }
  if (!asked.empty()) stepper.run();
  for (std::size_t i = 0; i < asked.size(); ++i) alive[asked[i]] = !stepper.failed(i);
  return alive;
}

// Seeks the edges of failure on all lines together; those that hardly weigh are left between two points.
template <int Most>
void BeliefStep<Most>::find_edges(std::span<Line* const> lines, std::span<const TransitionPlace> places) const {
  if (lines.empty()) return;
  const std::size_t n = axis_.points.size();
  MachineStepper stepper = stepper_.another();
  const std::vector<char> alive = goes_on(lines, places, stepper);
  std::vector<Edge> edges;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    const char* here = alive.data() + l * n;
    lines[l]->begins_alive = here[0] != 0;
    const double share = plan_.lattice.size() > 1 ? axis_.shares[lines[l]->first / n] : 1;
    for (std::size_t i = 0; i + 1 < n; ++i)
      if (here[i] != here[i + 1]) {
        const bool counts = share * std::max(axis_.shares[i], axis_.shares[i + 1]) > next_to_nothing;
        edges.push_back({lines[l], axis_.points[i], axis_.points[i + 1], here[i] != 0, counts});
      }
  }
  for (int round = 0; round < divisions; ++round) divide(edges, places, stepper);
  for (const Edge& edge : edges) edge.line->edges.push_back(0.5 * (edge.low + edge.high));
}

// Divides what each edge lies in, and keeps the part that holds it.
template <int Most>
void BeliefStep<Most>::divide(std::vector<Edge>& edges, std::span<const TransitionPlace> places,
                              MachineStepper& stepper) const {
  stepper.clear();
  for (const Edge& edge : edges) {
    const Line& line = *edge.line;
    Vector fresh = lattice_scores(line.first);
    for (int i = 1; i < parts_of_edge && edge.counts; ++i) {
      fresh[static_cast<Eigen::Index>(*plan_.failing)] = edge.low + i * (edge.high - edge.low) / parts_of_edge;
      stepper.add(places[line.trial], line.from, fresh);
    }
  }
  if (std::ranges::any_of(edges, &Edge::counts)) stepper.run();
  std::size_t first = 0;
  for (Edge& edge : edges) {
    if (!edge.counts) continue;
    std::size_t last = 0;  // points that are as the lower end
    while (last + 1 < parts_of_edge && stepper.failed(first + last) != edge.low_alive) ++last;
    const double width = (edge.high - edge.low) / parts_of_edge;
    edge.low += static_cast<double>(last) * width;
    edge.high = edge.low + width;
    first += parts_of_edge - 1;
  }
}

// The chance of failure on a line, times the share of the line among those of its state.
template <int Most>
double BeliefStep<Most>::chance_on(const Line& line) const {
  if (line.edges.empty() && line.begins_alive) return 0;
  const double failed = std::max(0.0, 1 - cell_part(0, 1, line.alive()).mass);
  return plan_.lattice.size() > 1 ? failed * axis_.shares[line.first / axis_.points.size()] : failed;
}

// Goes over from the chance at the mean state to that over all states, so that no value jumps where these are asked.
// @param lines  of one trial
template <int Most>
double BeliefStep<Most>::chance_of_failure(std::span<const Line> lines) const {
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

// A cell is cut where its line fails; where its own point failed it takes the next state of the nearest that did not.
template <int Most>
typename BeliefStep<Most>::Cell BeliefStep<Most>::cell(std::size_t trial, std::size_t point,
                                                       std::span<const Line> lines) const {
  const std::size_t n = axis_.points.size(), start = lattice_start(trial), at = point % n;
  Cell cell{.weight = 1, .anchor = point, .by_score = {}};
  for (std::size_t b = 0, rest = point; b < plan_.lattice.size(); ++b, rest /= n) {
    cell.weight *= axis_.weights[rest % n];
    cell.by_score.push_back({1, axis_.points[rest % n], axis_.spread * axis_.spread});
  }
  if (lines.empty() || cell.weight < least_weight) return cell;
  cell.by_score[0] = cell_part(axis_.points[at], axis_.spread, lines[point / n].alive());
  for (std::size_t away = 1; stepper_.failed(start + cell.anchor) && away < n; ++away) {
    if (at >= away && !stepper_.failed(start + point - away)) cell.anchor = point - away;
    if (at + away < n && !stepper_.failed(start + point + away)) cell.anchor = point + away;
  }
  const double goes_on = stepper_.failed(start + cell.anchor) ? 0 : cell.by_score[0].mass;
  cell.dead = cell.weight * (1 - goes_on);
  cell.weight *= goes_on;
  return cell;
}

// First and second differences over the lattice, by its scores, about a cell's anchor.
template <int Most>
struct BeliefStep<Most>::Bend {
  std::array<Vector, 2> first;
  std::array<Vector, 3> second;  // along the first score, along the second, and along both
};

template <int Most>
typename BeliefStep<Most>::Bend BeliefStep<Most>::bend_at(std::size_t trial, const Cell& cell) const {
  const std::size_t n = axis_.points.size(), here = lattice_start(trial) + cell.anchor;
  const Vector centre = stepper_.next(here), none = Vector::Zero(states());
  Bend bend{{none, none}, {none, none, none}};
  std::array<bool, 2> inside{};
  std::size_t stride = 1, rest = cell.anchor;
  for (std::size_t b = 0; b < plan_.lattice.size(); ++b, stride *= n, rest /= n) {
    const std::size_t at = rest % n;
    inside[b] = at > 0 && at + 1 < n;
    const bool up = at + 1 < n && !stepper_.failed(here + stride), down = at > 0 && !stepper_.failed(here - stride);
    const Vector above = up ? Vector(stepper_.next(here + stride)) : centre;
    const Vector below = down ? Vector(stepper_.next(here - stride)) : centre;
    if (up || down) bend.first[b] = (above - below) / ((up ? axis_.spacing : 0) + (down ? axis_.spacing : 0));
    if (up && down) bend.second[b] = (above + below - 2 * centre) / (axis_.spacing * axis_.spacing);
  }
  if (!(inside[0] && inside[1])) return bend;
  const std::array<std::size_t, 4> corners{here + 1 + n, here + 1 - n, here - 1 + n, here - 1 - n};
  if (std::ranges::any_of(corners, [&](std::size_t corner) { return stepper_.failed(corner); })) return bend;
  bend.second[2] = (Vector(stepper_.next(corners[0])) - stepper_.next(corners[1]) - stepper_.next(corners[2]) +
                    stepper_.next(corners[3])) /
                   (4 * axis_.spacing * axis_.spacing);
  return bend;
}

// Moves a part from scores of zero to a cell.
template <int Most>
void BeliefStep<Most>::take_cell(Part& part, std::size_t trial, const Cell& cell) const {
  const Eigen::Index before = states() + static_cast<Eigen::Index>(stepper_.offsets());
  const std::size_t axes = plan_.lattice.size(), n = axis_.points.size();
  const Bend bend = bend_at(trial, cell);
  std::array<double, 2> off{}, variance{};
  for (std::size_t b = 0, rest = cell.anchor; b < axes; ++b, rest /= n) {
    off[b] = cell.by_score[b].mean - axis_.points[rest % n];
    variance[b] = cell.by_score[b].variance;
  }
  for (std::size_t b = 0; b < axes; ++b) {
    const double sd = std::sqrt(variance[b]);
    part.mean.head(states()) += (bend.first[b] + 0.5 * off[b] * bend.second[b]) * off[b];
    Vector column = Vector::Zero(part.mean.size());
    column.head(states()) = (bend.first[b] + off[b] * bend.second[b] + off[1 - b] * bend.second[2]) * sd;
    if (stepper_.remembers()) {
      const double fresh = std::sqrt(1 - std::pow(stepper_.memory(plan_.lattice[b]), 2));
      part.mean[before + static_cast<Eigen::Index>(plan_.lattice[b])] += fresh * cell.by_score[b].mean;
      column[before + static_cast<Eigen::Index>(plan_.lattice[b])] = fresh * sd;
    }
    if (bent_) column[part.mean.size() - bent() + static_cast<Eigen::Index>(b)] = sd;
    part.covariance += column * column.transpose();
  }
  part.mean.head(states()) += off[0] * off[1] * bend.second[2];
  if (bent_) {
    part.bent = static_cast<int>(axes);
    part.bends = bend.second;
    return;
  }
  for (std::size_t b = 0; b < axes; ++b) {
    part.mean.head(states()) += 0.5 * variance[b] * bend.second[b];
    part.covariance.topLeftCorner(states(), states()) +=
        0.5 * variance[b] * variance[b] * bend.second[b] * bend.second[b].transpose();
  }
  part.covariance.topLeftCorner(states(), states()) +=
      variance[0] * variance[1] * bend.second[2] * bend.second[2].transpose();
}

template <int Most>
void BeliefStep<Most>::on_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief, const Matrix& root,
                                  std::span<const Line> lines) const {
  const Slopes slope = slopes(trial);
  const Part common = part(slope, belief, root);
  const Vector bent = common.mean.head(states()) - slope.centre;
  const Matrix straight = columns(slope.first, root);
  for (std::size_t p = 0; p < lattice_points(); ++p) {
    const Cell here = cell(trial, p, lines);
    after.failed += here.dead;
    if (here.weight < least_weight) continue;
    Part one = common;
    one.log_weight = std::log(here.weight);
    one.mean.head(states()) = Vector(stepper_.next(lattice_start(trial) + here.anchor)) + bent;
    if (pairs() > 0) {
      Matrix there = straight;
      for (std::size_t i = 0; i < pairs(); ++i) {
        const Eigen::Index column =
            i < used_.size() ? used_[i] : root.cols() + static_cast<Eigen::Index>(i - used_.size());
        for (std::size_t b = 0; b < plan_.lattice.size(); ++b)
          there.col(column).head(states()) +=
              here.by_score[b].mean * slope.by_score[b].col(static_cast<Eigen::Index>(i));
      }
      one.covariance += there * there.transpose() - straight * straight.transpose();
    }
    take_cell(one, trial, here);
    after.belief.parts().push_back(std::move(one));
  }
  if (lines.empty()) return;
  // The cells are those from the mean state; what they leave to failure is that from all states.
  const double failed = chance_of_failure(lines), goes_on = std::log1p(-std::min(failed, almost_sure));
  const double ratio = goes_on - std::log1p(-std::min(after.failed, almost_sure));
  for (Part& one : after.belief.parts()) one.log_weight += ratio;
  after.failed = failed;
  const Line& middle = lines[plan_.lattice.size() > 1 ? axis_.points.size() / 2 : 0];  // the other score at zero
  after.failed_wide = 1 - cell_part(0, outlier_width, middle.alive()).mass;
}

template <int Most>
void BeliefStep<Most>::step(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                            const std::function<void(std::size_t, AfterStep<Most>&)>& take) {
  std::vector<Matrix> roots;
  for (const Part& belief : beliefs) roots.push_back(root_of(belief.covariance));
  used_.clear();
  for (Eigen::Index i = 0; !roots.empty() && i < roots.front().cols(); ++i)
    if (std::ranges::any_of(roots, [&](const Matrix& root) { return root.col(i).head(size()).any(); }))
      used_.push_back(i);
  points_ = 1 + 2 * pairs() + lattice_points() + 4 * pairs() * plan_.lattice.size();
  stepper_.clear();
  for (std::size_t t = 0; t < places.size(); ++t) add_points(places[t], beliefs[t], roots[t]);
  stepper_.run();
  std::vector<Line> edges;
  if (plan_.failing) edges = lines(places, beliefs, roots);
  AfterStep<Most> after;
  std::size_t line = 0;
  for (std::size_t t = 0; t < places.size(); ++t) {
    after.belief.parts().clear();
    after.failed = after.failed_wide = 0;
    if (!plan_.lattice.empty()) {
      const std::size_t first = line;
      while (line < edges.size() && edges[line].trial == t) ++line;
      on_lattice(after, t, beliefs[t], roots[t], std::span(edges).subspan(first, line - first));
    } else {
      after.belief.parts().push_back(part(slopes(t), beliefs[t], roots[t]));
    }
    take(t, after);
  }
}

template class BeliefStep<small_belief>;
template class BeliefStep<Eigen::Dynamic>;

}  // namespace metastable::analysis
