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
  Aggregation(const Mesh& mesh, const std::vector<std::uint32_t>& gait, std::size_t gaits)
      : mesh_(mesh),
        classes_(gaits * static_cast<std::size_t>(mesh.phases())),
        kill_(classes_),
        leave_(classes_),
        flow_(classes_ * classes_),
        mass_(classes_) {
    for (std::size_t i = 0; i < mesh.size(); ++i)
      class_.push_back(gait[i] * static_cast<std::uint32_t>(mesh.phases()) + static_cast<std::uint32_t>(mesh.phase(i)));
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

}  // namespace

std::vector<std::uint32_t> gait_classes(const Mesh& mesh, const std::vector<std::vector<double>>& gaits,
                                        std::span<const NoiseFrame> frames) {
  const std::vector<std::uint32_t> next = likeliest_steps(mesh);
  const std::size_t d = gaits.front().size();
  const NoiseFrame& frame = frames.front();
  const auto nearest = [&](std::uint32_t node) {
    const std::vector<double> state = mesh.state(node);
    std::uint32_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t g = 0; g < gaits.size(); ++g) {
      double squared = 0;
      for (std::size_t k = 0; k < d; ++k) {
        double u = 0;
        for (std::size_t i = 0; i < d; ++i) u += frame.inverse[k * d + i] * (state[i] - gaits[g][i]);
        squared += u * u;
      }
      if (squared < least) {
        least = squared;
        best = g;
      }
    }
    return best;
  };
  constexpr std::uint32_t unknown = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> gait(mesh.size(), unknown), path;
  std::vector<std::uint32_t> walked(mesh.size(), 0);
  std::uint32_t walk = 0;
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    path.clear();
    ++walk;
    std::uint32_t at = i;
    for (; gait[at] == unknown && walked[at] != walk; at = next[at]) {
      walked[at] = walk;
      path.push_back(at);
    }
    std::uint32_t found = gait[at];
    if (found == unknown) {  // a new cycle, or a node that only fails: its state at phase 0, if it has one
      std::uint32_t seen = at;
      for (int phase = 0; phase < mesh.phases() && mesh.phase(seen) != 0; ++phase) seen = next[seen];
      found = nearest(seen);
    }
    for (const std::uint32_t node : path) gait[node] = found;
  }
  return gait;
}

CoupledPassage coupled_passage(const Mesh& mesh, std::span<const double> start, const std::vector<std::uint32_t>& gait,
                               std::size_t gaits) {
  CoupledPassage found{.passage = mesh_passage(mesh, start, settled, head, true)};
  MeshPassage& passage = found.passage;
  found.first_rate = passage.failure_rate;
  std::vector<double> b(mesh.size(), 0.0), led(mesh.size());
  const Mesh::Corners corners = mesh.corners(0, start);
  for (int c = 0; c < corners.count; ++c)
    b[corners.node[static_cast<std::size_t>(c)]] += corners.weight[static_cast<std::size_t>(c)];
  Aggregation aggregation(mesh, gait, gaits);
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
  passage.steps_upper = last;
  passage.steps_lower = std::accumulate(lower.begin(), lower.end(), 0.0);
  passage.steps = std::sqrt(passage.steps_upper * passage.steps_lower);
  passage.failure_rate = last_rate(mesh, aggregation, y, passage.products);
  found.share.assign(gaits, 0.0);
  for (std::size_t i = 0; i < y.size(); ++i) found.share[gait[i]] += y[i] / last;
  passage.visits = std::move(y);
  return found;
}

}  // namespace metastable::markov
