#include "markov/mesh/coupled_passage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "markov/chain/solver.h"

namespace metastable::markov {
namespace {

constexpr int product_limit = 20000;        // of all rounds together
constexpr int smoothing = 20;               // products between two solutions of the small chain
constexpr double round_still = 1e-8;        // what a round may change of the expected steps
constexpr double balance_tolerance = 1e-6;  // and of any class's visits, beyond what leaves it,
constexpr int still_rounds = 3;             // so many rounds running
constexpr int inverse_rounds = 200;         // of the small chain's inverse iteration
constexpr double settled_rate = 1e-12;
constexpr double negligible_left = 1e-4;  // walkers on their way for each failure
constexpr double settled = 1e-9;  // of survivors in the first gait: what their failures change by in a revolution,
constexpr int head = 4000;        // followed for so many steps if they do not settle

/// Returns where each node's largest entry leads; itself where it has none.
std::vector<std::uint32_t> likeliest_steps(const Mesh& mesh) {
  std::vector<std::uint32_t> next(mesh.size());
  for (std::uint32_t i = 0; i < next.size(); ++i) {
    next[i] = i;
    const auto values = mesh.values(i);
    if (values.empty()) continue;
    next[i] =
        mesh.columns(i)[static_cast<std::size_t>(std::max_element(values.begin(), values.end()) - values.begin())];
  }
  return next;
}

/// Lumps visits by class, solves the small chain they make, and gives the classes their visits.
class Aggregation {
 public:
  Aggregation(const Mesh& mesh, const GaitClasses& classes)
      : mesh_(mesh),
        classes_(classes.gait.size() * static_cast<std::size_t>(mesh.phases())),
        kill_(classes_),
        leave_(classes_),
        flow_(classes_ * classes_),
        mass_(classes_) {
    for (std::size_t i = 0; i < mesh.size(); ++i)
      class_.push_back(classes.of_node[i] * static_cast<std::uint32_t>(mesh.phases()) +
                       static_cast<std::uint32_t>(mesh.phase(i)));
  }

  std::size_t size() const { return classes_; }
  std::uint32_t of(std::size_t node) const { return class_[node]; }

  /// Reads kills, leaks and flows between classes off the shape of the visits.
  void read(std::span<const double> visits) {
    for (auto* sums : {&kill_, &leave_, &flow_, &mass_}) std::fill(sums->begin(), sums->end(), 0.0);
    for (std::size_t i = 0; i < mesh_.size(); ++i) {
      if (!(visits[i] > 0)) continue;
      const std::size_t from = class_[i];
      mass_[from] += visits[i];
      kill_[from] += visits[i] * mesh_.kill()[i];
      leave_[from] += visits[i] * mesh_.leave()[i];
      const auto columns = mesh_.columns(i);
      const auto values = mesh_.values(i);
      for (std::size_t e = 0; e < columns.size(); ++e)
        if (class_[columns[e]] != from) flow_[from * classes_ + class_[columns[e]]] += visits[i] * values[e];
    }
  }

  /// Returns the visits of the classes from `start` (a sum by class), what leaves counting as failed or as going on.
  std::vector<double> solve(const std::vector<double>& start, bool leaving_fails) const {
    std::vector<std::uint32_t> met;
    for (std::uint32_t c = 0; c < classes_; ++c)
      if (mass_[c] > 0) met.push_back(c);
    std::vector<double> matrix(met.size() * met.size()), kill(met.size()), rhs(met.size());
    for (std::size_t a = 0; a < met.size(); ++a) {
      const std::size_t from = met[a];
      kill[a] = std::min(1.0, (kill_[from] + (leaving_fails ? leave_[from] : 0)) / mass_[from]);
      rhs[a] = start[from];
      for (std::size_t b = 0; b < met.size(); ++b)
        if (a != b) matrix[a * met.size() + b] = flow_[from * classes_ + met[b]] / mass_[from];
    }
    const std::vector<double> solved = ChainSolver(Chain::from_dense(met.size(), matrix, kill)).solve_left(rhs);
    std::vector<double> visits(classes_, 0.0);
    for (std::size_t a = 0; a < met.size(); ++a) visits[met[a]] = solved[a];
    return visits;
  }

  /// Returns whether solving would change no class: one that fills up by a factor in every round is not yet seen in the
  /// sum of them all.
  bool balanced(const std::vector<double>& visits) const {
    for (std::size_t c = 0; c < classes_; ++c)
      if (mass_[c] > 0 && std::abs(visits[c] / mass_[c] - 1) >
                              balance_tolerance + static_cast<double>(smoothing) * leave_[c] / mass_[c])
        return false;
    return true;
  }

  void scale(std::span<double> visits, const std::vector<double>& to) const {
    for (std::size_t i = 0; i < visits.size(); ++i)
      if (visits[i] > 0) visits[i] *= to[class_[i]] / mass_[class_[i]];
  }

  /// Returns the shares of the classes among those that have walked on for ever, by inverse iteration of the small
  /// chain.
  std::vector<double> last_shares() const {
    std::vector<double> x(classes_);
    const double all = std::accumulate(mass_.begin(), mass_.end(), 0.0);
    for (std::size_t c = 0; c < classes_; ++c) x[c] = mass_[c] / all;
    double rate = 0;
    for (int round = 0; round < inverse_rounds; ++round) {
      std::vector<double> y = solve(x, false);
      const double sum = std::accumulate(y.begin(), y.end(), 0.0);
      double fails = 0;
      for (std::size_t c = 0; c < classes_; ++c) {
        x[c] = y[c] / sum;
        if (mass_[c] > 0) fails += x[c] * kill_[c] / mass_[c];
      }
      if (std::abs(fails - rate) <= settled_rate * fails) break;
      rate = fails;
    }
    return x;
  }

  /// Returns the chance of failing in a step, of the shape that was read.
  double failure_rate() const {
    return std::accumulate(kill_.begin(), kill_.end(), 0.0) / std::accumulate(mass_.begin(), mass_.end(), 0.0);
  }

 private:
  const Mesh& mesh_;
  std::size_t classes_;
  std::vector<std::uint32_t> class_;
  std::vector<double> kill_, leave_, flow_, mass_;
};

/// Returns the chance of failing in a step of those that have walked on for ever. Their shape within the classes is
/// found by products, from `x` on, the classes' shares from the small chain that it makes.
double last_rate(const Mesh& mesh, Aggregation& aggregation, std::vector<double> x, int& products) {
  std::vector<double> led(x.size());
  double rate = 0, change = 0;
  const int most = products + product_limit;
  for (int still = 0; still < still_rounds;) {
    if (products >= most)
      throw ConvergenceError("mesh", change, "the failure rate of its gaits still changes after 20000 products");
    for (int k = 0; k < smoothing; ++k) {
      mesh.apply_left(x, led);
      double sum = 0;
      for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] = 0.5 * (x[i] + led[i]);
      for (double& one : x) one /= sum;
    }
    products += smoothing;
    aggregation.read(x);
    const double found = aggregation.failure_rate();
    aggregation.scale(x, aggregation.last_shares());
    change = std::abs(found - rate) / found;
    still = change <= round_still ? still + 1 : 0;
    rate = found;
  }
  return rate;
}

/// Does a damped step of y = b + y Q: half of it, so that what alternates dies out.
void smooth(const Mesh& mesh, std::span<const double> start, std::vector<double>& y, std::vector<double>& led) {
  mesh.apply_left(y, led);
  for (std::size_t i = 0; i < y.size(); ++i) y[i] = 0.5 * (y[i] + led[i] + start[i]);
}

double squared_distance(const NoiseFrame& frame, const std::vector<double>& a, const std::vector<double>& b) {
  const std::size_t d = a.size();
  double squared = 0;
  for (std::size_t k = 0; k < d; ++k) {
    double u = 0;
    for (std::size_t i = 0; i < d; ++i) u += frame.inverse[k * d + i] * (a[i] - b[i]);
    squared += u * u;
  }
  return squared;
}

/// Leads from every node along the likeliest steps.
class Likeliest {
 public:
  Likeliest(const Mesh& mesh, const std::vector<GaitOrbit>& gaits, const NoiseFrame& frame, GaitClasses& found)
      : mesh_(mesh), gaits_(gaits), frame_(frame), next_(likeliest_steps(mesh)), found_(found) {
    found.gaits = gaits.size();
    found.revolutions = static_cast<int>(gaits.front().size());
    found.of_node.assign(mesh.size(), unknown);
    for (std::uint32_t g = 0; g < gaits.size(); ++g) {
      first_.push_back(static_cast<std::uint32_t>(found.gait.size()));
      found.gait.insert(found.gait.end(), gaits[g].size(), g);
    }
  }

  void classify() {
    std::vector<std::uint32_t> path, walked(mesh_.size(), 0);
    for (std::uint32_t i = 0, walk = 1; i < mesh_.size(); ++i, ++walk) {
      path.clear();
      std::uint32_t at = i;
      for (; found_.of_node[at] == unknown && walked[at] != walk; at = next_[at]) {
        walked[at] = walk;
        path.push_back(at);
      }
      std::uint32_t led = found_.of_node[at];
      if (led == unknown) led = nearest_on_its_way(at);  // a new cycle, or a node that only fails
      for (; !path.empty(); path.pop_back()) {
        const std::uint32_t node = path.back();
        if (mesh_.phase(next_[node]) == 0 && next_[node] != node) led = one_before(led);
        found_.of_node[node] = led;
      }
    }
  }

 private:
  static constexpr std::uint32_t unknown = std::numeric_limits<std::uint32_t>::max();

  /// Returns the class in its turn before another.
  std::uint32_t one_before(std::uint32_t of) const {
    const std::uint32_t first = first_[found_.gait[of]];
    return of > first ? of - 1 : first + static_cast<std::uint32_t>(gaits_[found_.gait[of]].size()) - 1;
  }

  /// Returns the class of a node by the next state of phase 0 that it leads to.
  std::uint32_t nearest_on_its_way(std::uint32_t node) const {
    std::uint32_t seen = node;
    for (int phase = 0; phase < mesh_.phases() && mesh_.phase(seen) != 0; ++phase) seen = next_[seen];
    const std::uint32_t found = nearest(mesh_.state(seen));
    return seen == node ? found : one_before(found);
  }

  std::uint32_t nearest(const std::vector<double>& state) const {
    std::uint32_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t g = 0; g < gaits_.size(); ++g)
      for (std::uint32_t turn = 0; turn < gaits_[g].size(); ++turn) {
        const double squared = squared_distance(frame_, state, gaits_[g][turn]);
        if (squared >= least) continue;
        least = squared;
        best = first_[g] + turn;
      }
    return best;
  }

  const Mesh& mesh_;
  const std::vector<GaitOrbit>& gaits_;
  const NoiseFrame& frame_;
  std::vector<std::uint32_t> next_, first_;  ///< likeliest step of each node; first class of each gait
  GaitClasses& found_;
};

constexpr std::uint32_t nowhere = std::numeric_limits<std::uint32_t>::max();

/// Returns the gait that each node is near; nowhere for those that are near none.
std::vector<std::uint32_t> near_gaits(const Mesh& mesh, const std::vector<GaitOrbit>& gaits, const NoiseFrame& frame) {
  std::vector<std::uint32_t> near(mesh.size(), nowhere);
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    if (mesh.phase(i) != 0) continue;
    const std::vector<double> state = mesh.state(i);
    for (std::uint32_t g = 0; g < gaits.size(); ++g)
      for (const std::vector<double>& at : gaits[g])
        if (squared_distance(frame, state, at) <= 1) near[i] = g;
  }
  return near;
}

/// Returns the expected failures of walkers who leave `x` (of nodes near one gait, or of the start) before they are
/// near a gait again.
double failures_from(const Mesh& mesh, const std::vector<std::uint32_t>& near, std::vector<double> x) {
  std::vector<double> led(mesh.size());
  double failures = 0, left = std::numeric_limits<double>::infinity();
  for (int product = 0; product < product_limit && left > negligible_left * failures; ++product) {
    for (std::size_t i = 0; i < x.size(); ++i) failures += x[i] * mesh.kill()[i];
    mesh.apply_left(x, led);
    left = 0;
    for (std::size_t i = 0; i < x.size(); ++i) left += x[i] = near[i] == nowhere ? led[i] : 0;
  }
  return failures;
}

}  // namespace

GaitClasses gait_classes(const Mesh& mesh, const std::vector<GaitOrbit>& gaits, std::span<const NoiseFrame> frames) {
  GaitClasses found;
  Likeliest(mesh, gaits, frames.front(), found).classify();
  return found;
}

CoupledPassage coupled_passage(const Mesh& mesh, std::span<const double> start, const GaitClasses& classes) {
  CoupledPassage found{.passage = mesh_passage(mesh, start, settled, head, true, classes.revolutions)};
  MeshPassage& passage = found.passage;
  found.first_rate = passage.failure_rate;
  if (classes.gaits == 1 && passage.settled) return found;
  std::vector<double> b(mesh.size(), 0.0), led(mesh.size());
  const Mesh::Corners corners = mesh.corners(0, start);
  for (int c = 0; c < corners.count; ++c)
    b[corners.node[static_cast<std::size_t>(c)]] += corners.weight[static_cast<std::size_t>(c)];
  Aggregation aggregation(mesh, classes);
  std::vector<double> start_by_class(aggregation.size(), 0.0);
  for (std::size_t i = 0; i < b.size(); ++i) start_by_class[aggregation.of(i)] += b[i];
  std::vector<double> y = passage.visits;
  double last = 0, change = 0;
  for (int still = 0; still < still_rounds;) {
    if (passage.products >= product_limit)
      throw ConvergenceError("mesh", change, "visits of its gaits still change after 20000 products");
    for (int k = 0; k < smoothing; ++k) smooth(mesh, b, y, led);
    passage.products += smoothing;
    aggregation.read(y);
    const std::vector<double> visits = aggregation.solve(start_by_class, false);
    aggregation.scale(y, visits);
    const double steps = std::accumulate(visits.begin(), visits.end(), 0.0);
    change = std::abs(steps - last) / steps;
    still = change <= round_still && aggregation.balanced(visits) ? still + 1 : 0;
    last = steps;
  }
  const std::vector<double> lower = aggregation.solve(start_by_class, true);
  passage.steps = last;
  passage.steps_lower = std::accumulate(lower.begin(), lower.end(), 0.0);
  passage.failure_rate = last_rate(mesh, aggregation, y, passage.products);
  found.share.assign(classes.gaits, 0.0);
  for (std::size_t i = 0; i < y.size(); ++i) found.share[classes.gait[classes.of_node[i]]] += y[i] / last;
  passage.visits = std::move(y);
  return found;
}

std::vector<double> failures_by_gait(const Mesh& mesh, std::span<const double> start, std::span<const double> visits,
                                     const std::vector<GaitOrbit>& gaits, std::span<const NoiseFrame> frames) {
  const std::vector<std::uint32_t> near = near_gaits(mesh, gaits, frames.front());
  std::vector<double> failures;
  for (std::uint32_t g = 0; g < gaits.size(); ++g) {
    std::vector<double> begins(mesh.size(), 0.0);
    for (std::size_t i = 0; i < begins.size(); ++i)
      if (near[i] == g) begins[i] = visits[i];
    failures.push_back(failures_from(mesh, near, std::move(begins)));
  }
  std::vector<double> begins(mesh.size(), 0.0);
  const Mesh::Corners corners = mesh.corners(0, start);
  for (std::size_t c = 0; c < static_cast<std::size_t>(corners.count); ++c)
    if (near[corners.node[c]] == nowhere) begins[corners.node[c]] += corners.weight[c];
  failures.front() += failures_from(mesh, near, std::move(begins));
  const double all = std::accumulate(failures.begin(), failures.end(), 0.0);
  for (double& share : failures) share /= all;
  return failures;
}

CoupledPassage passage_with_gaits(const Mesh& mesh, std::span<const double> start, const std::vector<GaitOrbit>& gaits,
                                  std::span<const NoiseFrame> frames) {
  if (gaits.size() > 1 || gaits.front().size() > 1)
    return coupled_passage(mesh, start, gait_classes(mesh, gaits, frames));
  CoupledPassage found{.passage = mesh_passage(mesh, start)};
  found.first_rate = found.passage.failure_rate;
  return found;
}

}  // namespace metastable::markov
