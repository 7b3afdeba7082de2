#include "analysis/machine_model/score_lattice.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "analysis/machine_model/machine_stepper.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

// Cells of sd s at distances of 0.92 s add up to a normal density within 2 exp(-2 pi^2 / 0.92^2) = 2e-10 of it.
constexpr double spacing_share = 0.92;
// Sds of cells, and how far out the outermost are, in sds of the cells' centres. Of walks of the compass gait, whose
// map bends, cells of 0.5 sd leave an error of a sixteenth of its standard error in the sd of the slopes, cells of 0.7
// three times as much.
struct CellSize {
  double spread, reach;
};
constexpr CellSize fine{0.4, 5.6}, for_bent{0.5, 4.7}, on_two_axes{0.7, 4.7};
constexpr int most_nodes = 9;        // A polynomial goes through so many points of an axis.
constexpr std::size_t wide_gap = 4;  // The map is asked in the middle of gaps of so many spacings between them, too.
constexpr double told_share = 1e-4;  // A polynomial may be off by this share of the move in a unit of the score,
constexpr double told_width = 8;     //   weighed by exp(-z^2 / told_width) at the score z,
constexpr double told_rounding = 1e-12;  //   or by this share of the largest value.

// Returns where the upper tail of an outlier's score begins.
double tail_begin(const LatticeAxis& axis) { return axis.points.back() - 0.5 * axis.spacing; }

std::vector<double> wide_weights(const LatticeAxis& axis) {
  const double sd = std::sqrt(outlier_width * outlier_width - axis.spread * axis.spread);
  std::vector<double> weights;
  double sum = 0;
  for (std::size_t i = 0; i < axis.points.size(); ++i) {
    weights.push_back(axis.in_tail(i) ? dynamics::normal_cdf(-tail_begin(axis) / outlier_width)
                                      : axis.spacing / sd * dynamics::normal_density(axis.points[i] / sd));
    sum += weights.back();
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace

LatticeAxis lattice_axis(int axes, bool bent) {
  LatticeAxis axis;
  const CellSize& size = axes > 1 ? on_two_axes : bent ? for_bent : fine;
  axis.spread = size.spread;
  axis.spacing = spacing_share * axis.spread;
  const double variance = 1 - axis.spread * axis.spread;
  const int half = static_cast<int>(std::ceil(size.reach * std::sqrt(variance) / axis.spacing)) + 1;
  double sum = 0, whole = 0;
  for (int i = -half; i <= half; ++i) {
    axis.points.push_back(i * axis.spacing);
    const double weight = std::abs(i) == half ? 0 : std::exp(-0.5 * axis.points.back() * axis.points.back() / variance);
    axis.weights.push_back(weight);
    sum += weight;
    axis.shares.push_back(dynamics::normal_density(axis.points.back()));
    whole += axis.shares.back();
  }
  for (double& weight : axis.weights) weight /= sum;
  for (double& share : axis.shares) share /= whole;
  axis.wide_weights = wide_weights(axis);
  return axis;
}

CellPart LatticeAxis::tail(std::size_t point, std::span<const std::pair<double, double>> inside) const {
  const double begin = tail_begin(*this);
  std::vector<std::pair<double, double>> clipped;
  for (auto [from, to] : inside) {
    (point == 0 ? to : from) = point == 0 ? std::min(to, -begin) : std::max(from, begin);
    if (from < to) clipped.emplace_back(from, to);
  }
  CellPart part = cell_part(0, outlier_width, clipped);
  part.mass /= dynamics::normal_cdf(-begin / outlier_width);
  return part;
}

// The basis of Chebyshev's polynomials on the axis keeps the equations for the nodes well conditioned.
AxisPolynomial::AxisPolynomial(const LatticeAxis& axis) {
  const std::size_t n = axis.points.size();
  const auto last = static_cast<double>(n - 1);
  std::vector<std::size_t> nodes, gaps;
  for (int k = 0; k < most_nodes; ++k) {
    const double share = 0.5 - 0.5 * std::cos(std::numbers::pi * k / (most_nodes - 1));
    const auto node = static_cast<std::size_t>(std::lround(share * last));
    if (!nodes.empty() && nodes.back() == node) continue;
    if (!nodes.empty() && node - nodes.back() >= wide_gap) gaps.push_back((nodes.back() + node) / 2);
    nodes.push_back(node);
  }
  std::ranges::merge(nodes, gaps, std::back_inserter(asked_));
  const auto place = [&](std::size_t point) { return std::ranges::lower_bound(asked_, point) - asked_.begin(); };
  length_ = axis.points.back() - axis.points.front();
  const auto count = static_cast<Eigen::Index>(nodes.size()), points = static_cast<Eigen::Index>(n);
  const auto basis = [&](std::size_t point) {
    Eigen::RowVectorXd row(count);
    const double angle = std::acos(std::clamp(2 * (axis.points[point] - axis.points.front()) / length_ - 1, -1.0, 1.0));
    for (Eigen::Index power = 0; power < count; ++power) row[power] = std::cos(static_cast<double>(power) * angle);
    return row;
  };
  const auto weight = [&](std::size_t point) {
    return std::exp(-axis.points[point] * axis.points[point] / told_width);
  };
  Eigen::MatrixXd at_nodes(count, count), at_points(points, count),
      chosen = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(asked_.size()));
  for (Eigen::Index k = 0; k < count; ++k) {
    at_nodes.row(k) = basis(nodes[static_cast<std::size_t>(k)]);
    chosen(k, place(nodes[static_cast<std::size_t>(k)])) = 1;
  }
  for (Eigen::Index p = 0; p < points; ++p) at_points.row(p) = basis(static_cast<std::size_t>(p));
  const Eigen::MatrixXd coefficients = at_nodes.partialPivLu().solve(chosen);  // [powers x asked]
  told_ = at_points * coefficients;
  off_.resize(2 * points + static_cast<Eigen::Index>(gaps.size()), chosen.cols());
  for (Eigen::Index p = 0; p < points; ++p)
    for (Eigen::Index power = 0; power < 2; ++power)
      off_.row(2 * p + power) =
          weight(static_cast<std::size_t>(p)) * at_points(p, count - 1 - power) * coefficients.row(count - 1 - power);
  for (std::size_t g = 0; g < gaps.size(); ++g) {
    auto row = off_.row(2 * points + static_cast<Eigen::Index>(g));
    row = told_.row(static_cast<Eigen::Index>(gaps[g]));
    row[place(gaps[g])] -= 1;
    row *= weight(gaps[g]);
  }
}

bool AxisPolynomial::holds(const Eigen::MatrixXd& at_asked) const {
  const Eigen::RowVectorXd most = (off_ * at_asked).cwiseAbs().colwise().maxCoeff();
  const Eigen::RowVectorXd moves = (at_asked.bottomRows<1>() - at_asked.topRows<1>()).cwiseAbs() / length_;
  const Eigen::RowVectorXd rounding = told_rounding * at_asked.cwiseAbs().colwise().maxCoeff();
  return (most.array() <= told_share * moves.array() + rounding.array()).all();
}

CellPart cell_part(double centre, double spread, std::span<const std::pair<double, double>> inside) {
  CellPart part{0, centre, spread * spread};
  double first = 0, second = 0;  // moments of the standardised part, times its mass
  for (const auto& [from, to] : inside) {
    const double a = (from - centre) / spread, b = (to - centre) / spread;
    const double mass =
        a > 0 ? dynamics::normal_cdf(-a) - dynamics::normal_cdf(-b) : dynamics::normal_cdf(b) - dynamics::normal_cdf(a);
    const double at_a = std::isfinite(a) ? dynamics::normal_density(a) : 0;
    const double at_b = std::isfinite(b) ? dynamics::normal_density(b) : 0;
    part.mass += mass;
    first += at_a - at_b;
    second += mass + (std::isfinite(a) ? a * at_a : 0) - (std::isfinite(b) ? b * at_b : 0);
  }
  if (!(part.mass > 1e-12)) return {0, centre, spread * spread};
  const double mean = first / part.mass;
  part.mean = centre + spread * mean;
  part.variance = spread * spread * std::max(0.0, second / part.mass - mean * mean);
  return part;
}

namespace {

constexpr double straight_share = 1e-3;  // of a slope, by which the map of a straight score may bend
constexpr double tried_score = 1.7320508075688772;
constexpr double far_score = 4.5;  // beyond it no failure is sought
constexpr std::size_t on_a_lattice = 2;

// The findings about each score: the largest second difference as a share of the slope, and how often it leads to
// failure.
struct Told {
  std::vector<double> bends, fails;
  bool ever = false;      // A point with one score failed,
  bool together = false;  // or one with two.
};

// The measured states, those that were not measured at their launch's mean, or else at the mean of their column.
std::vector<Eigen::VectorXd> measured_states(const Machine& machine, const MachineRuns& runs,
                                             std::vector<TransitionPlace>& places) {
  std::vector<Eigen::VectorXd> all;
  Eigen::VectorXd usual = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(machine.states.size()));
  for (std::size_t j = 0; j < machine.observe.size(); ++j)
    usual[static_cast<Eigen::Index>(machine.state_index(machine.observe[j].state))] = column_spread(runs, j).mean;
  for (const MachineLaunch& launch : machine.launches)
    usual[static_cast<Eigen::Index>(machine.state_index(launch.state))] = launch.mean;
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (std::size_t k = 0; k < runs.trials[t].rows.size(); ++k) {
      if (k + 1 == runs.trials[t].rows.size() && runs.trials[t].outcome != MachineOutcome::failed) continue;
      Eigen::VectorXd state = usual;
      for (std::size_t j = 0; j < machine.observe.size(); ++j)
        if (const double seen = runs.trials[t].rows[k].seen[j]; !std::isnan(seen))
          state[static_cast<Eigen::Index>(machine.state_index(machine.observe[j].state))] = seen;
      all.push_back(std::move(state));
      places.push_back({t, k, 0});
    }
  return all;
}

// Points of one row: the middle, pairs at sqrt 3, pairs far out, and for each two scores together one above, then three
// others.
std::vector<Eigen::VectorXd> tried_scores(Eigen::Index scores) {
  std::vector<Eigen::VectorXd> all{Eigen::VectorXd::Zero(scores)};
  for (Eigen::Index m = 0; m < scores; ++m)
    for (const double z : {tried_score, -tried_score, far_score, -far_score})
      all.push_back(z * Eigen::VectorXd::Unit(scores, m));
  for (Eigen::Index m = 0; m < scores; ++m)
    for (Eigen::Index o = 0; o < m; ++o)
      all.push_back(tried_score * (Eigen::VectorXd::Unit(scores, m) + Eigen::VectorXd::Unit(scores, o)));
  for (Eigen::Index m = 0; m < scores; ++m)
    for (Eigen::Index o = 0; o < m; ++o)
      for (const auto& [up, along] : {std::pair{1, -1}, std::pair{-1, 1}, std::pair{-1, -1}})
        all.push_back(tried_score * (up * Eigen::VectorXd::Unit(scores, m) + along * Eigen::VectorXd::Unit(scores, o)));
  return all;
}

void look(Told& told, const MachineStepper& stepper, std::size_t first, const std::vector<double>& scale) {
  const std::size_t scores = told.bends.size(), cross = first + 1 + 4 * scores;
  const auto at = [&](std::size_t point, std::size_t state) {
    return stepper.next(point)[static_cast<Eigen::Index>(state)];
  };
  const auto lives = [&](std::size_t point) { return !stepper.failed(point); };
  for (std::size_t s = 0; s < scale.size() && lives(first); ++s) {
    const double centre = at(first, s);
    double slope = 0;
    for (std::size_t m = 0; m < scores; ++m) {
      const std::size_t pair = first + 1 + 4 * m;
      if (lives(pair) && lives(pair + 1))  // Both sides move alike where the map folds in a score.
        slope += std::abs(at(pair, s) - centre) + std::abs(at(pair + 1, s) - centre);
    }
    if (!(slope > 1e-9 * scale[s])) continue;
    std::size_t point = cross;
    for (std::size_t m = 0; m < scores; ++m) {
      const std::size_t pair = first + 1 + 4 * m;
      if (lives(pair) && lives(pair + 1))
        told.bends[m] = std::max(told.bends[m], std::abs(at(pair, s) + at(pair + 1, s) - 2 * centre) / slope);
      for (std::size_t o = 0; o < m; ++o, ++point) {
        if (!lives(point) || !lives(pair) || !lives(first + 1 + 4 * o)) continue;
        const double mixed = std::abs(at(point, s) - at(pair, s) - at(first + 1 + 4 * o, s) + centre) / slope;
        told.bends[m] = std::max(told.bends[m], mixed);
        told.bends[o] = std::max(told.bends[o], mixed);
      }
    }
  }
  for (std::size_t m = 0; m < scores; ++m)
    for (std::size_t z = 0; z < 4; ++z) {
      told.fails[m] += stepper.failed(first + 1 + 4 * m + z) != stepper.failed(first);
      told.ever = told.ever || stepper.failed(first + 1 + 4 * m + z);
    }
  for (std::size_t point = cross; point < cross + 2 * scores * (scores - 1); ++point)
    told.together = told.together || stepper.failed(point);
}

// Scores that fail come first, then those that bend most.
// @param failed  trials that did
ScorePlan planned(const Told& told, std::size_t failed) {
  ScorePlan plan;
  const auto most = std::ranges::max_element(told.fails);
  const bool fails = told.ever || *most > 0;
  if (told.together && !fails)
    throw std::runtime_error(
        "step: it fails only where two noises are large together; the likelihood follows failures along one noise");
  if (failed > 0 && !fails)
    plan.notes.push_back(fmt::format(
        "{} said to have failed, but the step fails from no measured row within {:g} sds of its noise: the model of "
        "the machine hardly fails there",
        failed == 1 ? "one trial is" : fmt::format("{} trials are", failed), far_score));
  if (failed > 0 || fails) {
    plan.failing = static_cast<std::size_t>(most - told.fails.begin());
    plan.lattice.push_back(*plan.failing);
  }
  std::vector<std::size_t> order(told.bends.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return std::pair(told.fails[a], told.bends[a]) > std::pair(told.fails[b], told.bends[b]);
  });
  bool others_fail = false;
  for (const std::size_t m : order) {
    if (plan.failing == m || !(told.fails[m] > 0 || told.bends[m] > straight_share)) continue;
    if (plan.lattice.size() < on_a_lattice)
      plan.lattice.push_back(m);
    else
      others_fail = others_fail || told.fails[m] > 0;
  }
  if (others_fail)
    plan.notes.push_back("more than two noises lead to failure: its chance leaves out all but two of them");
  return plan;
}

}  // namespace

ScorePlan score_plan(const Machine& machine, const MachineRuns& runs, const MachineHypothesis& nominal) {
  MachineStepper stepper(machine, runs, nominal);
  if (stepper.size() != stepper.states())
    throw std::invalid_argument("score_plan: a hypothesis without spreads and memory is expected");
  const auto scores = static_cast<std::size_t>(machine.scores);
  std::vector<TransitionPlace> places;
  const std::vector<Eigen::VectorXd> states = measured_states(machine, runs, places);
  const std::vector<Eigen::VectorXd> tried = tried_scores(machine.scores);
  for (std::size_t i = 0; i < states.size(); ++i)
    for (const Eigen::VectorXd& fresh : tried) stepper.add(places[i], states[i], fresh);
  stepper.run();
  std::vector<double> scale(machine.states.size(), 0.0);
  for (std::size_t i = 0; i < states.size(); ++i)
    for (std::size_t s = 0; s < scale.size(); ++s)
      scale[s] = std::max(scale[s], std::abs(states[i][static_cast<Eigen::Index>(s)]));
  Told told{std::vector<double>(scores), std::vector<double>(scores), false};
  std::size_t went_on = 0, lost = 0, last_lost = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (stepper.lost(i * tried.size()))
      throw std::invalid_argument(fmt::format("step: no finite state comes of trial {}, row {}",
                                              runs.name_of(places[i].trial), places[i].row + 1));
    look(told, stepper, i * tried.size(), scale);
    if (places[i].row + 1 == runs.trials[places[i].trial].rows.size()) continue;
    ++went_on;
    if (!stepper.failed(i * tried.size())) continue;
    ++lost;
    last_lost = i;
  }
  if (2 * lost > went_on)
    throw FailsFromMostRows(fmt::format(
        "step: without noise the machine fails from {} of {} measured rows after which it went on (trial {}, "
        "row {} is one): check the units, signs and order of the columns",
        lost, went_on, runs.name_of(places[last_lost].trial), places[last_lost].row + 1));
  return planned(
      told, static_cast<std::size_t>(std::ranges::count(runs.trials, MachineOutcome::failed, &MachineTrial::outcome)));
}

}  // namespace metastable::analysis
