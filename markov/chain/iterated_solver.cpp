#include "markov/chain/iterated_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;

constexpr Extended rounding = std::numeric_limits<Extended>::epsilon();
constexpr std::size_t most_directions = 30;
constexpr int most_rounds = 30;              // of directions
constexpr Extended round_gain = 1e-10L;      // after which a residual is taken anew
constexpr Extended round_needs = 0.5L;       // a round that leaves more than this of the residual has stopped
constexpr Extended round_helps = 1e-3L;      // a way that left less than this once, and has stopped, is at the rounding
constexpr Extended exact = 1e-17L;           // residual, of the right side
constexpr Extended rounded = 16 * rounding;  // residual, of the solution: rounding
constexpr int first_sweeps = 20;             // of visits, from an even start
constexpr int most_balances = 60;
constexpr Extended rough_balance = 1e-3L,
                   fine_balance = 1e-9L;      // wanted of one correction, before and after a per cent
constexpr Extended balanced = 20 * rounding;  // difference between what enters and leaves a state, of the latter
constexpr Extended nearly_balanced = 1e-15L;  // which must be reached
constexpr Extended least_factor = 0.05L;      // by which visits change at once
constexpr int stands_before_next = 3;         // balances that are no better, after which the next way is taken
constexpr Extended least_flow = 1e-200L;      // out of a state, of double precision

template <typename Real>
Real all_of(const std::vector<Real>& v) {
  return std::accumulate(v.begin(), v.end(), Real{0});
}

/// Sums eight partial sums, always the same ones.
template <typename Real>
Real dot(std::span<const Real> a, std::span<const Real> b) {
  Real part[8] = {};
  std::size_t i = 0;
  for (; i + 8 <= a.size(); i += 8)
    for (std::size_t k = 0; k < 8; ++k) part[k] += a[i + k] * b[i + k];
  for (; i < a.size(); ++i) part[0] += a[i] * b[i];
  return ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
}

template <typename Real>
Real dot(const std::vector<Real>& a, const std::vector<Real>& b) {
  return dot(std::span<const Real>(a), std::span<const Real>(b));
}

template <typename Real>
void add(std::vector<Real>& to, Real weight, std::span<const Real> what) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += weight * what[i];
}

/// Takes the mean off, each state counted by what leaves it.
template <typename Real>
void center(std::vector<Real>& x, std::span<const Real> total) {
  const Real mean = dot(std::span<const Real>(x), total) / std::accumulate(total.begin(), total.end(), Real{0});
  for (Real& entry : x) entry -= mean;
}

/// Residuals are measured by what leaves the state.
template <typename Real>
std::vector<Real> scaled(std::vector<Real> residual, std::span<const Real> total) {
  for (std::size_t i = 0; i < residual.size(); ++i) residual[i] /= total[i];
  return residual;
}

Extended norm(const Row& residual, std::span<const Extended> total) {
  const Row relative = scaled(residual, total);
  return std::sqrt(dot(relative, relative));
}

/// Lowers a residual by `gain`, in up to most_directions directions. Returns what to add to the solution.
template <typename Real, typename Apply, typename Correct>
std::vector<Real> descended(std::vector<Real> residual, std::span<const Real> total, Real gain, const Apply& apply,
                            const Correct& correct, const Heard& heard) {
  using Vector = std::vector<Real>;
  Vector step(residual.size(), 0);
  std::vector<Vector> directions, images;  // images are orthonormal once scaled, and kept so
  Vector rest = scaled(residual, total);
  const Real first = std::sqrt(dot(rest, rest));
  while (directions.size() < most_directions) {
    if (heard) heard();
    Vector direction = correct(residual);
    center(direction, total);
    Vector image = scaled(apply(direction), total);
    for (std::size_t k = 0; k < images.size(); ++k) {
      const Real share = dot(image, images[k]);
      add<Real>(image, -share, images[k]);
      add<Real>(direction, -share, directions[k]);
    }
    const Real length = std::sqrt(dot(image, image));
    if (!(length > 0) || !std::isfinite(length)) break;
    for (Real& entry : image) entry /= length;
    for (Real& entry : direction) entry /= length;
    const Real along = dot(rest, image);
    add<Real>(step, along, direction);
    add<Real>(rest, -along, image);
    for (std::size_t i = 0; i < rest.size(); ++i) residual[i] = rest[i] * total[i];
    directions.push_back(std::move(direction));
    images.push_back(std::move(image));
    if (std::sqrt(dot(rest, rest)) <= gain * first) break;
  }
  return step;
}

/// The equations of FlowNetwork in extended precision, on the states themselves.
class Flows {
 public:
  Flows(const Generator& generator, std::span<const Extended> visits, bool lossless)
      : generator_(generator), visits_(visits), loss_(generator.size(), 0), total_(generator.size()) {
    for (std::size_t i = 0; i < total_.size(); ++i) {
      if (!lossless) loss_[i] = visits[i] * generator.kill[i];
      total_[i] = loss_[i];
      for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e) total_[i] += flow(i, e);
    }
  }
  const Row& loss() const { return loss_; }
  const Row& total() const { return total_; }
  /// Returns what flows into each state, less what leaves it.
  Row surplus() const {
    Row surplus(total_.size(), 0);
    for (std::size_t i = 0; i < total_.size(); ++i)
      for (std::size_t e = generator_.start[i]; e < generator_.start[i + 1]; ++e)
        surplus[generator_.column[e]] += flow(i, e);
    for (std::size_t i = 0; i < total_.size(); ++i) surplus[i] -= total_[i];
    return surplus;
  }
  /// Returns A x by differences, of the transpose as if as much arrived in each state as leaves it.
  Row apply(const Row& x, FlowSide side) const {
    Row y(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) y[i] = loss_[i] * x[i];
    for (std::size_t i = 0; i < x.size(); ++i)
      for (std::size_t e = generator_.start[i]; e < generator_.start[i + 1]; ++e) {
        const std::size_t j = generator_.column[e];
        (side == FlowSide::from ? y[i] : y[j]) += flow(i, e) * (side == FlowSide::from ? x[i] - x[j] : x[j] - x[i]);
      }
    return y;
  }

 private:
  Extended flow(std::size_t i, std::size_t e) const { return visits_[i] * generator_.rate[e]; }
  const Generator& generator_;
  std::span<const Extended> visits_;
  Row loss_, total_;
};

}  // namespace

/// Lowers residuals of Flows: in double precision, and where that does not help with other groups and in extended one.
class FlowCorrection {
 public:
  enum class Equation { visits, from, into };  ///< A^T x whatever arrives; A x and A^T x on what sums to zero

  FlowCorrection(const Generator& generator, std::span<const Extended> visits, const Flows& flows, bool lossless,
                 int way)
      : generator_(generator), visits_(visits), lossless_(lossless), way_(way) {
    if (*std::min_element(flows.total().begin(), flows.total().end()) < least_flow) way_ = std::max(way_, in_extended);
    make();
  }
  /// Takes the next way; false where there is none.
  bool harder() {
    if (way_ == last_way) return false;
    ++way_;
    make();
    return true;
  }
  int way() const { return way_; }
  /// Returns what to add to a solution so that its residual is lowered by `gain`.
  Row lowered(const Row& residual, Extended gain, Equation equation, const Heard& heard) const {
    return fast_ ? lowered(*fast_, residual, gain, equation, heard)
                 : lowered(*careful_, residual, gain, equation, heard);
  }

 private:
  static constexpr int in_extended = 2, last_way = 3;  // even ways group by a threshold, odd ones by strongest flows

  void make() {
    fast_.reset();
    careful_.reset();
    const Grouping grouping = way_ % 2 == 0 ? Grouping::threshold : Grouping::strongest;
    if (way_ < in_extended)
      fast_ = std::make_unique<FlowNetwork<double>>(generator_, visits_, lossless_, grouping);
    else
      careful_ = std::make_unique<FlowNetwork<Extended>>(generator_, visits_, lossless_, grouping);
  }
  template <typename Real>
  Row lowered(const FlowNetwork<Real>& network, const Row& residual, Extended gain, Equation equation,
              const Heard& heard) const {
    using Vector = std::vector<Real>;
    const std::span<const Real> loss = network.loss(), total = network.total();
    const Real lost = std::accumulate(loss.begin(), loss.end(), Real{0});
    const FlowSide side = equation == Equation::from ? FlowSide::from : FlowSide::into;
    const auto apply = [&](const Vector& x) {
      if (equation == Equation::visits) return network.apply_unbalanced(x);
      Vector image = network.apply(x, side);
      if (lost > 0) add<Real>(image, -dot<Real>(loss, x) / lost, loss);
      return image;
    };
    const auto correct = [&](const Vector& left) { return network.corrected(left, side); };
    const Extended unit = norm(residual, Row(total.begin(), total.end()));
    Vector start(residual.size());
    for (std::size_t i = 0; i < start.size(); ++i) start[i] = static_cast<Real>(residual[i] / unit);
    const Vector step = descended<Real>(std::move(start), total, static_cast<Real>(gain), apply, correct, heard);
    Row change(step.begin(), step.end());
    for (Extended& entry : change) entry *= unit;
    return change;
  }

  const Generator& generator_;
  std::span<const Extended> visits_;
  bool lossless_;
  int way_;
  std::unique_ptr<FlowNetwork<double>> fast_;
  std::unique_ptr<FlowNetwork<Extended>> careful_;
};

namespace {

/// Visits after some sweeps from those given.
Row swept(const Generator& generator, std::span<const Extended> start) {
  const std::size_t n = generator.size();
  Row leaving(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e) leaving[i] += generator.rate[e];
  Row visits(start.begin(), start.end());
  if (!visits.empty()) return visits;
  visits.resize(n);
  for (std::size_t i = 0; i < n; ++i) visits[i] = 1 / leaving[i];
  for (int sweep = 0; sweep < first_sweeps; ++sweep) {
    Row next(n, 0);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e)
        next[generator.column[e]] += visits[i] * generator.rate[e];
    // The mean with what there was: a chain that goes round in circles settles as well.
    for (std::size_t i = 0; i < n; ++i) visits[i] = (visits[i] + next[i] / leaving[i]) / 2;
  }
  return visits;
}

/// Finds the visits of an irreducible generator, its kill rates left out. Each correction solves A^T (1 + d) = 0, in
/// which all columns of A sum to zero whatever the visits are.
/// @param way  of FlowCorrection to begin with; set to the last one
Row balanced_visits(const Generator& generator, std::span<const Extended> start, int& way, const Heard& heard) {
  Row visits = swept(generator, start), best;
  Extended least = std::numeric_limits<Extended>::infinity();
  int stood = 0;
  for (int balance = 0; balance < most_balances; ++balance) {
    if (heard) heard();
    const Flows flows(generator, visits, true);
    const Row surplus = flows.surplus();
    Extended largest = 0;
    for (std::size_t i = 0; i < surplus.size(); ++i)
      largest = std::max(largest, std::abs(surplus[i]) / flows.total()[i]);
    const bool stands = !(largest < least / 2);
    if (largest < least) {
      least = largest;
      best = visits;
    }
    if (least <= balanced || (stands && least <= nearly_balanced)) break;
    FlowCorrection correction(generator, visits, flows, true, way);
    if (stands && ++stood % stands_before_next == 0) correction.harder();
    way = correction.way();
    const Row change = correction.lowered(surplus, largest > 0.01L ? rough_balance : fine_balance,
                                          FlowCorrection::Equation::visits, heard);
    for (std::size_t i = 0; i < visits.size(); ++i)
      visits[i] *= std::clamp(1 + change[i], least_factor, 1 / least_factor);
    const Extended all = all_of(visits);
    for (Extended& entry : visits) entry /= all;
  }
  if (!(least <= nearly_balanced))
    throw ConvergenceError("balance of visits", static_cast<double>(least),
                           "states of this chain change places too slowly for iteration");
  const Extended all = all_of(best);
  for (Extended& entry : best) entry /= all;
  return best;
}

}  // namespace

IteratedSolver::IteratedSolver(Generator generator, std::span<const Extended> start, Heard heard)
    : generator_(std::move(generator)), heard_(std::move(heard)) {
  visits_ = balanced_visits(generator_, start, way_, heard_);
}

IteratedSolver::~IteratedSolver() = default;

/// Iterates on A u - l (l u) / sum l = g - l (sum g) / sum l, both sides of which sum to zero; constants solve it with
/// 0.
IteratedSolver::Solution IteratedSolver::solved(Row right, FlowSide side) {
  const Flows flows(generator_, visits_, false);
  const Row& loss = flows.loss();
  const Extended lost = all_of(loss);
  if (!(lost > 0)) throw std::domain_error("iterated solver: a chain that is never left");
  if (!correction_) correction_ = std::make_unique<FlowCorrection>(generator_, visits_, flows, false, way_);
  const Extended given = all_of(right);
  add<Extended>(right, -given / lost, loss);
  const auto left_by = [&](const Row& x) {
    Row left = right, image = flows.apply(x, side);
    add<Extended>(image, -dot(loss, x) / lost, loss);
    add<Extended>(left, -1, image);
    return left;
  };
  Row rest(right.size(), 0), residual = right;
  const Extended first = norm(residual, flows.total());
  Extended now = first;
  const auto done = [&] { return now <= exact * first + rounded * std::sqrt(dot(rest, rest)); };
  const auto equation = side == FlowSide::from ? FlowCorrection::Equation::from : FlowCorrection::Equation::into;
  bool helped = false;
  for (int round = 0; round < most_rounds && !done(); ++round) {
    Row tried = rest;
    add<Extended>(tried, 1, correction_->lowered(residual, round_gain, equation, heard_));
    Row left = left_by(tried);
    const Extended before = now, after = norm(left, flows.total());
    if (after < now) {
      rest = std::move(tried);
      residual = std::move(left);
      now = after;
    }
    helped = helped || after < round_helps * before;
    if (after < round_needs * before) continue;
    if (helped || !correction_->harder()) break;
  }
  return {(given - dot(loss, rest)) / lost, std::move(rest)};
}

IteratedSolver::Solution IteratedSolver::solve(std::span<const Extended> rhs) {
  Row right(rhs.begin(), rhs.end());
  for (std::size_t i = 0; i < right.size(); ++i) right[i] *= visits_[i];
  return solved(std::move(right), FlowSide::from);
}

Row IteratedSolver::solve_left(std::span<const Extended> rhs) {
  Solution solution = solved(Row(rhs.begin(), rhs.end()), FlowSide::into);
  for (std::size_t i = 0; i < solution.rest.size(); ++i)
    solution.rest[i] = visits_[i] * (solution.base + solution.rest[i]);
  return std::move(solution.rest);
}

}  // namespace metastable::markov
