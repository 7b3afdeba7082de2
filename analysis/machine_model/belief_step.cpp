#include "analysis/machine_model/belief_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace metastable::analysis {
namespace {

constexpr double reach = 1.7320508075688772;  // points at sqrt 3 sds have the normal's fourth moment
constexpr double bend_share = 1.0 / 18;       // (h^2 - 1) / (4 h^4) with h^2 = 3
constexpr double rounding = 1e-14;            // of a variance
constexpr double almost_sure = 1 - 1e-12;     // a chance of failure
constexpr double least_weight = 1e-10;        // of a cell that counts
constexpr double small_move = 0.05;           // sds by which an offset and a score are compared
constexpr double unlike_share = 1e-3;         // of an offset's square, that may be unlike the score it is merged with

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
BeliefStep<Most>::BeliefStep(MachineStepper& stepper, const ScorePlan& plan, std::size_t shared, bool bent,
                             double outliers)
    : stepper_(stepper),
      lattice_{plan.lattice, {}},
      fails_(plan.failing.has_value()),
      shared_(shared),
      bent_(bent),
      outliers_(outliers) {
  std::vector<std::size_t>& scores = lattice_.scores;
  if (!scores.empty()) lattice_.axis = lattice_axis(static_cast<int>(scores.size()), bent);
  // Where trials may fail, the map is asked at every point of the lattice: a band of scores at which the machine fails
  // could lie between two of the points that a polynomial needs, and would not be seen.
  if (scores.size() == 1 && !fails_) axis_.emplace(lattice_.axis);
  if (plan.failing && scores.front() != *plan.failing) std::swap(scores.front(), scores.back());
  for (std::size_t m = 0; m < stepper_.scores(); ++m)
    if (std::ranges::find(lattice_.scores, m) == lattice_.scores.end()) straight_.push_back(m);
}

// Adds the centre, unless the lattice holds it; pairs of points along the columns of the root and the straight scores;
// the lattice; and for each of its scores the same pairs, the upper point with this score above zero, the lower below.
template <int Most>
void BeliefStep<Most>::add_points(const TransitionPlace& place, const Part& belief, const Matrix& root) {
  const Vector mean = belief.mean.head(size());
  const Vector still = Vector::Zero(static_cast<Eigen::Index>(stepper_.scores()));
  if (lattice_.scores.empty()) stepper_.add(place, mean, still);
  add_pairs(stepper_, place, mean, root, still, still);
  for (std::size_t p = 0; p < lattice_.points(); ++p)
    stepper_.add(place, mean, lattice_.template at<Vector>(p, stepper_.scores()));
  for (const std::size_t score : lattice_.scores) {
    const Vector above = beside() * Vector::Unit(still.size(), static_cast<Eigen::Index>(score));
    add_pairs(stepper_, place, mean, root, above, -above);
  }
}

// Adds two points for each column of the root and each straight score: the upper has `scores`, the lower `mirrored`.
template <int Most>
void BeliefStep<Most>::add_pairs(MachineStepper& stepper, const TransitionPlace& place, const Vector& mean,
                                 const Matrix& root, const Vector& scores, const Vector& mirrored) const {
  for (const Eigen::Index i : used_) {
    stepper.add(place, mean + reach * root.col(i).head(size()), scores);
    stepper.add(place, mean - reach * root.col(i).head(size()), mirrored);
  }
  for (const std::size_t s : straight_) {
    const Vector away = reach * Vector::Unit(scores.size(), static_cast<Eigen::Index>(s));
    stepper.add(place, mean, scores + away);
    stepper.add(place, mean, mirrored - away);
  }
}

// Returns how many spacings of the lattice lie between zero and the score at which slopes are taken a second time. That
// score is the point of the lattice next to sqrt 3.
template <int Most>
std::size_t BeliefStep<Most>::spacings_beside() const {
  return static_cast<std::size_t>(std::lround(reach / lattice_.axis.spacing));
}
template <int Most>
double BeliefStep<Most>::beside() const {
  return static_cast<double>(spacings_beside()) * lattice_.axis.spacing;
}

// Returns the number of the point at which all scores are zero. Where there is a lattice it is its middle point.
template <int Most>
std::size_t BeliefStep<Most>::centre_of(std::size_t trial) const {
  return lattice_.scores.empty() ? trial * points_ : lattice_start(trial) + lattice_.points() / 2;
}

// Says whether the map is not asked at this point at first, because a polynomial may tell it.
template <int Most>
bool BeliefStep<Most>::not_asked(std::size_t point) const {
  const std::size_t at = point % points_, first = lattice_start(0);
  return at >= first && at < first + lattice_.points() && !std::ranges::binary_search(axis_->asked(), at - first);
}

// Fills in the points of a trial's lattice at which the map was not asked, by a polynomial through the others. Returns
// false, and fills in nothing, where one of those failed or the polynomial does not hold.
template <int Most>
bool BeliefStep<Most>::told(std::size_t trial) {
  const std::vector<std::size_t>& asked = axis_->asked();
  const std::size_t start = lattice_start(trial);
  for (std::size_t point = trial * points_; point < (trial + 1) * points_; ++point)
    if (!not_asked(point) && stepper_.failed(point)) return false;
  Eigen::MatrixXd at_asked(static_cast<Eigen::Index>(asked.size()), states());
  for (std::size_t k = 0; k < asked.size(); ++k)
    at_asked.row(static_cast<Eigen::Index>(k)) = stepper_.next(start + asked[k]).transpose();
  if (!axis_->holds(at_asked)) return false;
  const Eigen::MatrixXd all = axis_->told(at_asked);
  for (std::size_t p = 0; p < lattice_.points(); ++p)
    if (not_asked(start + p)) stepper_.tell(start + p, all.row(static_cast<Eigen::Index>(p)).transpose());
  return true;
}

// Steps all points. Where a polynomial may tell points of the lattice, the map is asked at the others first, and at
// these only where the polynomial does not hold.
template <int Most>
void BeliefStep<Most>::run_points(std::size_t trials) {
  if (!axis_) return stepper_.run();
  std::vector<std::size_t> asked, others;
  for (std::size_t point = 0; point < trials * points_; ++point)
    if (!not_asked(point)) asked.push_back(point);
  stepper_.run(asked);
  for (std::size_t t = 0; t < trials; ++t)
    for (std::size_t p = told(t) ? points_ : 0; p < points_; ++p)
      if (not_asked(t * points_ + p)) others.push_back(t * points_ + p);
  if (!others.empty()) stepper_.run(others);
}

// A slope is the central difference of a pair of points. If one of the two failed, the one-sided difference to the
// centre replaces it.
template <int Most>
BeliefMatrix<Most> BeliefStep<Most>::first_differences(const MachineStepper& stepper, std::size_t at,
                                                       const Vector* centre, Matrix& bend) const {
  Matrix slope = Matrix::Zero(states(), static_cast<Eigen::Index>(pairs()));
  bend = slope;
  for (std::size_t i = 0; i < pairs(); ++i) {
    const bool lost_up = stepper.failed(at + 2 * i), lost_down = stepper.failed(at + 2 * i + 1);
    const auto column = static_cast<Eigen::Index>(i);
    if (!lost_up && !lost_down) {
      const Vector up = stepper.next(at + 2 * i), down = stepper.next(at + 2 * i + 1);
      slope.col(column) = (up - down) / (2 * reach);
      if (centre) bend.col(column) = up + down - 2 * *centre;
    } else if (centre && lost_up != lost_down) {
      const Vector one = stepper.next(at + 2 * i + (lost_up ? 1 : 0));
      slope.col(column) = (lost_up ? Vector(*centre - one) : Vector(one - *centre)) / reach;
    }
  }
  return slope;
}

// Returns how slopes change with a score of the lattice [states x pairs]. The change is a mixed difference over the
// corners of a rectangle, whose sides are the pair's direction and the score. It is the mean of one rectangle above
// zero and one below; where the machine fails at a corner of one of them, the other one stands alone.
template <int Most>
BeliefMatrix<Most> BeliefStep<Most>::mixed_differences(std::size_t trial, std::size_t axis) const {
  Matrix change = Matrix::Zero(states(), static_cast<Eigen::Index>(pairs()));
  const std::size_t pair = pair_start(trial), centre = centre_of(trial),
                    corner = lattice_start(trial) + lattice_.points() + 2 * pairs() * axis,
                    away = spacings_beside() * (axis > 0 ? lattice_.axis.points.size() : 1);
  for (std::size_t i = 0; i < pairs(); ++i) {
    int known = 0;
    for (const bool up : {true, false}) {
      const std::array<std::size_t, 4> at{corner + 2 * i + (up ? 0 : 1), pair + 2 * i + (up ? 0 : 1),
                                          up ? centre + away : centre - away, centre};
      if (std::ranges::any_of(at, [&](std::size_t point) { return stepper_.failed(point); })) continue;
      ++known;
      change.col(static_cast<Eigen::Index>(i)) +=
          stepper_.next(at[0]) - stepper_.next(at[1]) - stepper_.next(at[2]) + stepper_.next(at[3]);
    }
    change.col(static_cast<Eigen::Index>(i)) /= std::max(1, known) * reach * beside();
  }
  return change;
}

// Returns the point of the lattice nearest to scores of zero that goes on. Points whose neighbours along the failing
// score go on as well come first.
template <int Most>
std::optional<std::size_t> BeliefStep<Most>::point_that_goes_on(std::size_t trial) const {
  const std::size_t n = lattice_.axis.points.size(), start = lattice_start(trial);
  std::optional<std::size_t> found;
  std::pair<bool, double> least;
  for (std::size_t p = 0; p < lattice_.points(); ++p) {
    if (stepper_.failed(start + p)) continue;
    const bool edge =
        (p % n > 0 && stepper_.failed(start + p - 1)) || (p % n + 1 < n && stepper_.failed(start + p + 1));
    const std::pair away{edge, lattice_.template at<Vector>(p, stepper_.scores()).squaredNorm()};
    if (!found || away < least) least = away, found = p;
  }
  return found;
}

// A mean that fails with all scores at zero has no slopes about it. They are taken about a point of the lattice that
// goes on, for all such beliefs together.
template <int Most>
void BeliefStep<Most>::take_slopes_aside(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                                         std::span<const Matrix> roots) {
  aside_.clear();
  if (!fails_ || pairs() == 0) return;
  MachineStepper stepper = stepper_.another();
  for (std::size_t t = 0; t < places.size(); ++t) {
    if (!stepper_.failed(centre_of(t))) continue;
    const auto point = point_that_goes_on(t);
    if (!point) continue;
    const Vector scores = lattice_.template at<Vector>(*point, stepper_.scores());
    add_pairs(stepper, places[t], beliefs[t].mean.head(size()), roots[t], scores, scores);
    aside_[t].point = *point;
  }
  if (aside_.empty()) return;
  stepper.run();
  for (std::size_t first = 0; auto& [trial, aside] : aside_) {
    const Vector centre = stepper_.next(lattice_start(trial) + aside.point);
    aside.first = first_differences(stepper, first, &centre, aside.bend);
    first += 2 * pairs();
  }
}

// Slopes taken aside are supposed not to change with the scores of the lattice.
template <int Most>
typename BeliefStep<Most>::Slopes BeliefStep<Most>::slopes(std::size_t trial) const {
  Slopes s;
  if (const auto found = aside_.find(trial); found != aside_.end()) {
    const auto& [point, first, bend] = found->second;
    s = {stepper_.next(lattice_start(trial) + point), first, bend, {}};
    s.by_score.assign(lattice_.scores.size(), Matrix::Zero(states(), static_cast<Eigen::Index>(pairs())));
    return s;
  }
  s.centre = stepper_.next(centre_of(trial));
  const bool lost = stepper_.failed(centre_of(trial));
  if (lost) s.centre.setZero();  // a failed state is none
  s.first = first_differences(stepper_, pair_start(trial), lost ? nullptr : &s.centre, s.bend);
  for (std::size_t b = 0; b < lattice_.scores.size(); ++b) s.by_score.push_back(mixed_differences(trial, b));
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

// A cell is cut where its line fails; where its own point failed it takes the next state of the nearest that did not.
// @param wide  whether the cell is one of an outlier's scores; the outermost points have such cells, too
template <int Most>
typename BeliefStep<Most>::Cell BeliefStep<Most>::cell(std::size_t trial, std::size_t point,
                                                       std::span<const FailureLine<Most>> lines, bool wide) const {
  const LatticeAxis& axis = lattice_.axis;
  const std::size_t n = axis.points.size(), start = lattice_start(trial), at = point % n;
  const auto everywhere = FailureLine<Most>{}.alive();
  Cell cell{.weight = 1, .anchor = point, .by_score = {}};
  for (std::size_t b = 0, rest = point; b < lattice_.scores.size(); ++b, rest /= n) {
    const std::size_t place = rest % n;
    cell.weight *= (wide ? axis.wide_weights : axis.weights)[place];
    cell.by_score.push_back(wide && axis.in_tail(place) ? axis.tail(place, everywhere)
                                                        : CellPart{1, axis.points[place], axis.spread * axis.spread});
  }
  if (lines.empty() || cell.weight < least_weight) return cell;
  const auto alive = lines[point / n].alive();
  cell.by_score[0] = wide && axis.in_tail(at) ? axis.tail(at, alive) : cell_part(axis.points[at], axis.spread, alive);
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
  const std::size_t n = lattice_.axis.points.size(), here = lattice_start(trial) + cell.anchor;
  const Vector centre = stepper_.next(here), none = Vector::Zero(states());
  Bend bend{{none, none}, {none, none, none}};
  std::array<bool, 2> inside{};
  std::size_t stride = 1, rest = cell.anchor;
  for (std::size_t b = 0; b < lattice_.scores.size(); ++b, stride *= n, rest /= n) {
    const std::size_t at = rest % n;
    inside[b] = at > 0 && at + 1 < n;
    const bool up = at + 1 < n && !stepper_.failed(here + stride), down = at > 0 && !stepper_.failed(here - stride);
    const Vector above = up ? Vector(stepper_.next(here + stride)) : centre;
    const Vector below = down ? Vector(stepper_.next(here - stride)) : centre;
    if (up || down)
      bend.first[b] = (above - below) / ((up ? lattice_.axis.spacing : 0) + (down ? lattice_.axis.spacing : 0));
    if (up && down) bend.second[b] = (above + below - 2 * centre) / (lattice_.axis.spacing * lattice_.axis.spacing);
  }
  if (!(inside[0] && inside[1])) return bend;
  const std::array<std::size_t, 4> corners{here + 1 + n, here + 1 - n, here - 1 + n, here - 1 - n};
  if (std::ranges::any_of(corners, [&](std::size_t corner) { return stepper_.failed(corner); })) return bend;
  bend.second[2] = (Vector(stepper_.next(corners[0])) - stepper_.next(corners[1]) - stepper_.next(corners[2]) +
                    stepper_.next(corners[3])) /
                   (4 * lattice_.axis.spacing * lattice_.axis.spacing);
  return bend;
}

// Seeks a value's offset and a score of the lattice that move the state alike in all trials. Where they act through one
// value, the map bends in their sum: an offset as wide as the noise is no normal belief to it.
template <int Most>
void BeliefStep<Most>::seek_merged(std::span<const TransitionPlace> places, std::span<const Part> beliefs) {
  sought_ = true;
  const std::size_t axes = lattice_.scores.size(), offsets = stepper_.value_offsets(), each = 2 * (axes + offsets);
  if (axes == 0 || offsets == 0 || stepper_.remembers()) return;
  const Vector still = Vector::Zero(static_cast<Eigen::Index>(stepper_.scores()));
  const auto sd = [&](std::size_t offset) {
    const auto at = states() + static_cast<Eigen::Index>(offset);
    return std::sqrt(beliefs.front().covariance(at, at));
  };
  stepper_.clear();
  for (std::size_t t = 0; t < places.size(); ++t) {
    const Vector mean = beliefs[t].mean.head(size());
    for (const double sign : {small_move, -small_move}) {
      for (const std::size_t score : lattice_.scores)
        stepper_.add(places[t], mean, sign * Vector::Unit(still.size(), static_cast<Eigen::Index>(score)));
      for (std::size_t i = 0; i < offsets; ++i)
        stepper_.add(places[t], mean + sign * sd(i) * Vector::Unit(size(), states() + static_cast<Eigen::Index>(i)),
                     still);
    }
  }
  stepper_.run();
  Eigen::MatrixXd moves =
      Eigen::MatrixXd::Zero(states() * static_cast<Eigen::Index>(places.size()), static_cast<Eigen::Index>(each / 2));
  for (std::size_t t = 0; t < places.size(); ++t)
    for (std::size_t i = 0; i < each / 2; ++i)
      if (const std::size_t up = t * each + i, down = up + each / 2; !stepper_.failed(up) && !stepper_.failed(down))
        moves.block(static_cast<Eigen::Index>(t) * states(), static_cast<Eigen::Index>(i), states(), 1) =
            stepper_.next(up) - stepper_.next(down);
  for (std::size_t i = 0; i < offsets && !merged_; ++i)
    for (std::size_t b = 0; b < axes && !merged_; ++b) {
      const auto offset = moves.col(static_cast<Eigen::Index>(axes + i)),
                 score = moves.col(static_cast<Eigen::Index>(b));
      const double alike = offset.dot(score), square = score.squaredNorm();
      if (alike * alike > (1 - unlike_share) * square * offset.squaredNorm())
        merged_ = Merged{states() + static_cast<Eigen::Index>(i), b, alike / square / sd(i)};
    }
}

// Turns the coordinates of a belief's points so that the merged offset's share of the sum is on the lattice; returns
// the root of what is left of the belief.
template <int Most>
BeliefMatrix<Most> BeliefStep<Most>::turned(const TransitionPlace& place, const Part& belief, Matrix root) {
  Vector& carried = carried_.emplace_back();
  if (!merged_) return root;
  ScoreTurn turn{lattice_.scores[merged_->axis], merged_->offset,
                 merged_->ratio * root(merged_->offset, merged_->offset), belief.mean.head(size()),
                 root.topLeftCorner(size(), size())};
  const auto shared = static_cast<Eigen::Index>(shared_);
  carried = Vector::Zero(size() + 2 * shared + bent());
  carried.segment(states(), size() - states()) = root.col(merged_->offset).segment(states(), size() - states());
  carried.segment(size() + shared, shared) = root.col(merged_->offset).tail(shared);
  carried *= turn.ratio / turn.length();
  root.col(merged_->offset) /= turn.length();
  stepper_.turn(place.trial, std::move(turn));
  return root;
}

// Moves a part from scores of zero to a cell.
template <int Most>
void BeliefStep<Most>::take_cell(Part& part, std::size_t trial, const Cell& cell) const {
  const Eigen::Index before = states() + static_cast<Eigen::Index>(stepper_.offsets());
  const std::size_t axes = lattice_.scores.size(), n = lattice_.axis.points.size();
  const Bend bend = bend_at(trial, cell);
  std::array<double, 2> off{}, variance{};
  for (std::size_t b = 0, rest = cell.anchor; b < axes; ++b, rest /= n) {
    off[b] = cell.by_score[b].mean - lattice_.axis.points[rest % n];
    variance[b] = cell.by_score[b].variance;
  }
  for (std::size_t b = 0; b < axes; ++b) {
    const double sd = std::sqrt(variance[b]);
    part.mean.head(states()) += (bend.first[b] + 0.5 * off[b] * bend.second[b]) * off[b];
    Vector column = Vector::Zero(part.mean.size());
    column.head(states()) = (bend.first[b] + off[b] * bend.second[b] + off[1 - b] * bend.second[2]) * sd;
    if (stepper_.remembers()) {
      const double fresh = std::sqrt(1 - std::pow(stepper_.memory(lattice_.scores[b]), 2));
      part.mean[before + static_cast<Eigen::Index>(lattice_.scores[b])] += fresh * cell.by_score[b].mean;
      column[before + static_cast<Eigen::Index>(lattice_.scores[b])] = fresh * sd;
    }
    if (merged_ && merged_->axis == b) {
      part.mean += cell.by_score[b].mean * carried_[trial];
      column += sd * carried_[trial];
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

// Makes the straight scores those of an outlier, in a part with all scores of the lattice at zero and in its columns.
// The bends that the straight scores cause stay those of a usual step: a score that bends the map visibly is on the
// lattice. If an offset between trials is merged with a score of the lattice, an outlier's cells widen both together.
template <int Most>
void BeliefStep<Most>::widen(Part& part, Matrix& columns) const {
  const Eigen::Index scores = static_cast<Eigen::Index>(straight_.size()),
                     first = columns.cols() - static_cast<Eigen::Index>(shared_) - scores;
  auto own = columns.middleCols(first, scores);
  part.covariance += (outlier_width * outlier_width - 1) * own * own.transpose();
  own *= outlier_width;
}

// Adds a part for every cell that goes on, with its weight, and returns the chance of failing.
// @param common    the step with the scores of the lattice at zero  @param straight  its columns
// @param wide      whether the cells are those of an outlier's scores
template <int Most>
double BeliefStep<Most>::add_cells(BeliefMixture<Most>& belief, std::size_t trial, const Slopes& slope,
                                   const Part& common, const Matrix& straight, std::span<const FailureLine<Most>> lines,
                                   bool wide) const {
  const Vector bent = common.mean.head(states()) - slope.centre;
  double failed = 0;
  for (std::size_t p = 0; p < lattice_.points(); ++p) {
    const Cell here = cell(trial, p, lines, wide);
    failed += here.dead;
    if (here.weight < least_weight) continue;
    Part one = common;
    one.log_weight = std::log(here.weight);
    one.mean.head(states()) = Vector(stepper_.next(lattice_start(trial) + here.anchor)) + bent;
    if (pairs() > 0) {
      Matrix there = straight;
      for (std::size_t i = 0; i < pairs(); ++i) {
        const bool of_score = i >= used_.size();
        const Eigen::Index column =
            of_score ? straight.cols() - static_cast<Eigen::Index>(shared_ + pairs() - i) : used_[i];
        for (std::size_t b = 0; b < lattice_.scores.size(); ++b)
          there.col(column).head(states()) += (of_score && wide ? outlier_width : 1) * here.by_score[b].mean *
                                              slope.by_score[b].col(static_cast<Eigen::Index>(i));
      }
      one.covariance += there * there.transpose() - straight * straight.transpose();
    }
    take_cell(one, trial, here);
    belief.parts().push_back(std::move(one));
  }
  return failed;
}

// Steps a belief of a machine without a lattice: all scores are straight.
template <int Most>
void BeliefStep<Most>::off_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief,
                                   const Matrix& root) const {
  const Slopes slope = slopes(trial);
  Part& usual = after.belief.parts().emplace_back(part(slope, belief, root));
  if (!(outliers_ > 0)) return;
  usual.log_weight = std::log1p(-outliers_);
  Part wide = usual;
  Matrix straight = columns(slope.first, root);
  widen(wide, straight);
  wide.log_weight = std::log(outliers_);
  after.belief.parts().push_back(std::move(wide));
}

template <int Most>
void BeliefStep<Most>::on_lattice(AfterStep<Most>& after, std::size_t trial, const Part& belief, const Matrix& root,
                                  std::span<const FailureLine<Most>> lines, const FailureEdges<Most>& edges) const {
  const Slopes slope = slopes(trial);
  Part common = part(slope, belief, root);
  Matrix straight = columns(slope.first, root);
  std::vector<Part>& parts = after.belief.parts();
  // The cells are those from the mean state; what they leave to failure is that from all states.
  const auto weigh = [&](std::size_t first, double share, double by_cells, double failed) {
    const double ratio = std::log1p(-std::min(failed, almost_sure)) - std::log1p(-std::min(by_cells, almost_sure));
    for (std::size_t i = first; i < parts.size(); ++i) parts[i].log_weight += share + ratio;
  };
  const double by_cells = add_cells(after.belief, trial, slope, common, straight, lines, false);
  if (!lines.empty()) {
    after.failed = edges.chance_of_failure(lines);
    const FailureLine<Most>& middle =
        lines[lattice_.scores.size() > 1 ? lattice_.axis.points.size() / 2 : 0];  // the other score at zero
    after.failed_wide = 1 - cell_part(0, outlier_width, middle.alive()).mass;
  }
  weigh(0, std::log1p(-outliers_), by_cells, after.failed);
  if (!(outliers_ > 0)) return;
  const std::size_t usual = parts.size();
  widen(common, straight);
  const double by_wide_cells = add_cells(after.belief, trial, slope, common, straight, lines, true);
  weigh(usual, std::log(outliers_), by_wide_cells, after.failed_wide);
}

template <int Most>
void BeliefStep<Most>::step(std::span<const TransitionPlace> places, std::span<const Part> beliefs,
                            const std::function<void(std::size_t, AfterStep<Most>&)>& take) {
  seek(places, beliefs);
  std::vector<Matrix> roots, left;
  carried_.clear();
  for (std::size_t t = 0; t < places.size(); ++t) {
    roots.push_back(root_of(beliefs[t].covariance));
    left.push_back(turned(places[t], beliefs[t], roots[t]));
  }
  used_.clear();
  for (Eigen::Index i = 0; !roots.empty() && i < roots.front().cols(); ++i)
    if (std::ranges::any_of(roots, [&](const Matrix& root) { return root.col(i).head(size()).any(); }))
      used_.push_back(i);
  points_ = pair_start(0) + 2 * pairs() + lattice_.points() + 2 * pairs() * lattice_.scores.size();
  stepper_.clear();
  for (std::size_t t = 0; t < places.size(); ++t) add_points(places[t], beliefs[t], roots[t]);
  run_points(places.size());
  take_slopes_aside(places, beliefs, roots);
  std::vector<FailureLine<Most>> lines;
  const FailureEdges<Most> edges(stepper_, lattice_, points_, lattice_start(0));
  if (fails_) lines = edges.lines(places, beliefs, roots, used_);
  AfterStep<Most> after;
  std::size_t line = 0;
  for (std::size_t t = 0; t < places.size(); ++t) {
    after.belief.parts().clear();
    after.failed = after.failed_wide = 0;
    if (!lattice_.scores.empty()) {
      const std::size_t first = line;
      while (line < lines.size() && lines[line].trial == t) ++line;
      on_lattice(after, t, beliefs[t], left[t], std::span(lines).subspan(first, line - first), edges);
    } else {
      off_lattice(after, t, beliefs[t], left[t]);
    }
    take(t, after);
  }
}

template class BeliefStep<small_belief>;
template class BeliefStep<Eigen::Dynamic>;

}  // namespace metastable::analysis
