#include "analysis/statistics/profile_interval.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "analysis/statistics/interval_95.h"
#include "markov/dense_matrix.h"

namespace metastable::analysis {
namespace {

constexpr double level = normal_95;    // sqrt(2 (cost - least)) at the ends
constexpr double close_enough = 0.02;  // of it
constexpr double lower_by = 0.01;      // a better minimum, not rounding

// Finds the others at their best for given values of one variable.
class Profile {
 public:
  /// @param visited  points at which all but one variable are at their best; grows
  Profile(const SmoothFunction& cost, double least, const Mode& mode, std::size_t variable,
          std::vector<Eigen::VectorXd>& visited)
      : cost_(cost), least_(least), variable_(static_cast<Eigen::Index>(variable)), visited_(visited) {
    const Eigen::MatrixXd& hessian = mode.hessian;
    const Eigen::Index n = hessian.rows();
    const Eigen::VectorXd at = Eigen::Map<const Eigen::VectorXd>(mode.minimum.at.data(), n);
    Eigen::MatrixXd others(n - 1, n - 1);
    Eigen::VectorXd mixed(n - 1);
    for (Eigen::Index i = 0; i < n - 1; ++i) {
      mixed[i] = hessian(full(i), variable_);
      for (Eigen::Index j = 0; j < n - 1; ++j) others(i, j) = hessian(full(i), full(j));
    }
    const Eigen::MatrixXd axes = contour_axes(others);
    const Eigen::VectorXd slope = -(axes * (axes.transpose() * mixed));
    curvature_ = hessian(variable_, variable_) + mixed.dot(slope);
    axes_ = Eigen::MatrixXd::Zero(n, n - 1);
    Eigen::VectorXd direction = Eigen::VectorXd::Unit(n, variable_);
    for (Eigen::Index i = 0; i < n - 1; ++i) {
      axes_.row(full(i)) = axes.row(i);
      direction[full(i)] = slope[i];
    }
    path_ = {at, at + 1e-3 * direction};  // the second as the quadratic has it
  }

  /// Returns the half-width of the interval were the cost quadratic.
  double first_guess() const { return level / std::sqrt(std::max(curvature_, 16.0)); }

  /// Returns sqrt(2 (profile - least)) at a value of the variable.
  double operator()(double value) {
    const Eigen::VectorXd start = along(path_, value);
    std::optional<Minimum> best = descend(start);
    // Another branch may start from the points of other profiles on either side, unless it begins in the same valley.
    const Eigen::VectorXd *below = nullptr, *above = nullptr;
    for (const Eigen::VectorXd& x : visited_) {
      const double here = x[variable_];
      if (here <= value && (!below || here > (*below)[variable_])) below = &x;
      if (here > value && (!above || here < (*above)[variable_])) above = &x;
    }
    if (below && above) {
      const Eigen::VectorXd from = along({*below, *above}, value);
      std::optional<Minimum> other;
      if (!best || contours_between(start, from) > off_the_guess) other = descend(from);
      if (other && (!best || other->value < best->value - lower_by)) best = std::move(other);
    }
    if (!best) return std::numeric_limits<double>::infinity();
    path_.push_back(Eigen::Map<const Eigen::VectorXd>(best->at.data(), axes_.rows()));
    if (best->value < least_ - lower_by) {
      better_ = std::move(best);
      return 0;
    }
    return std::sqrt(2 * std::max(best->value - least_, 0.0));
  }

  void leave() { visited_.insert(visited_.end(), path_.begin() + 2, path_.end()); }
  const std::optional<Minimum>& better() const { return better_; }

 private:
  Eigen::Index full(Eigen::Index other) const { return other + (other >= variable_); }

  // Starts on the line through the two points nearest to the value.
  Eigen::VectorXd along(const std::vector<Eigen::VectorXd>& points, double value) const {
    std::size_t a = 0, b = 1;
    const auto distance = [&](std::size_t i) { return std::abs(points[i][variable_] - value); };
    if (distance(b) < distance(a)) std::swap(a, b);
    for (std::size_t i = 2; i < points.size(); ++i)
      if (distance(i) < distance(a))
        b = std::exchange(a, i);
      else if (distance(i) < distance(b))
        b = i;
    const double apart = points[b][variable_] - points[a][variable_];
    Eigen::VectorXd x = points[a];
    if (apart != 0) x += (value - points[a][variable_]) / apart * (points[b] - points[a]);
    x[variable_] = value;
    return x;
  }

  // Returns the distance of two points in lengths of the axes.
  double contours_between(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
    return (axes_.transpose() * (b - a)).cwiseQuotient(axes_.colwise().squaredNorm().transpose()).norm();
  }

  // Returns nothing where the cost is infinite.
  std::optional<Minimum> descend(const Eigen::VectorXd& start) const {
    const auto point = [&](const std::vector<double>& z) {
      const Eigen::VectorXd x = start + axes_ * Eigen::Map<const Eigen::VectorXd>(z.data(), axes_.cols());
      return std::vector<double>(x.data(), x.data() + x.size());
    };
    const auto along_axes = [&](const std::vector<double>& z, std::vector<double>& gradient) {
      Eigen::VectorXd slope(axes_.rows());
      std::vector<double> full_gradient(static_cast<std::size_t>(axes_.rows()));
      const double cost = cost_(point(z), full_gradient);
      slope = Eigen::Map<const Eigen::VectorXd>(full_gradient.data(), axes_.rows());
      Eigen::Map<Eigen::VectorXd>(gradient.data(), axes_.cols()) = axes_.transpose() * slope;
      return cost;
    };
    const auto count = static_cast<std::size_t>(axes_.cols());
    Minimum best = quasi_newton(along_axes, std::vector<double>(count, off_the_guess), 1e-3, 200);
    if (!std::isfinite(best.value)) best = quasi_newton(along_axes, std::vector<double>(count, 0.0), 1e-3, 200);
    if (!std::isfinite(best.value)) return std::nullopt;
    best.at = point(best.at);
    return best;
  }

  const SmoothFunction& cost_;
  double least_;
  Eigen::Index variable_;
  Eigen::MatrixXd axes_;  // of the others, as columns
  double curvature_ = 0;  // of the profile
  std::vector<Eigen::VectorXd> path_;
  std::vector<Eigen::VectorXd>& visited_;
  std::optional<Minimum> better_;
};

// Finds the end on one side and whether it is bounded.
std::pair<double, bool> end(Profile& profile, double from, double from_root, double limit) {
  if (std::abs(limit - from) < 1e-9) return {limit, false};
  double inner = from, inner_root = from_root, outer = limit, outer_root = -1;  // -1: not known
  double value = from + std::copysign(std::min(profile.first_guess(), std::abs(limit - from)), limit - from);
  for (int i = 0; i < 40; ++i) {
    if (std::abs(limit - value) < 1e-9 && outer_root < 0) value = limit;
    const double root = profile(value);
    if (profile.better()) return {value, false};
    if (std::abs(root - level) < close_enough)
      return {value + (level - root) / (root - from_root) * (value - from), true};
    if (root < level) {
      if (value == limit) return {limit, false};
      inner = value, inner_root = root;
    } else {
      outer = value, outer_root = root;
    }
    if (outer_root < 0) {
      const double factor = std::clamp(inner_root > 0 ? level / inner_root : 3.0, 1.1, 3.0);
      const double next = from + (inner - from) * factor;
      value = std::abs(next - from) < std::abs(limit - from) ? next : limit;
    } else {
      // The next value lies between them along the chord, but does not hug either.
      const double share = std::isfinite(outer_root) ? (level - inner_root) / (outer_root - inner_root) : 0.5;
      value = inner + std::clamp(share, 0.1, 0.9) * (outer - inner);
      if (std::abs(outer - inner) < 1e-6) return {value, std::isfinite(outer_root)};
    }
  }
  return {value, outer_root > 0};
}

}  // namespace

Eigen::MatrixXd contour_axes(const Eigen::MatrixXd& hessian) {
  constexpr double flattest = 400;  // 1 / 0.05^2
  const markov::SymmetricEigen eigen = markov::symmetric_eigen(hessian);
  return eigen.vectors * eigen.values.cwiseMax(flattest).cwiseSqrt().cwiseInverse().asDiagonal();
}

std::vector<ProfileInterval> profile_intervals(const SmoothFunction& cost, const std::vector<Mode>& modes,
                                               const std::vector<double>& low, const std::vector<double>& high) {
  std::vector<ProfileInterval> intervals(low.size());
  const double least = modes.front().minimum.value;
  std::vector<Eigen::VectorXd> visited;
  for (const Mode& mode : modes) {
    const double from_root = std::sqrt(2 * std::max(mode.minimum.value - least, 0.0));
    if (from_root > level - close_enough) continue;
    for (std::size_t i = 0; i < intervals.size(); ++i)
      for (const bool up : {false, true}) {
        Profile profile(cost, least, mode, i, visited);
        const auto [at, bounded] = end(profile, mode.minimum.at[i], from_root, up ? high[i] : low[i]);
        ProfileInterval& interval = intervals[i];
        const bool first = &mode == &modes.front();
        if (up && (first || at > interval.upper)) interval.upper = at, interval.bounded_above = bounded;
        if (!up && (first || at < interval.lower)) interval.lower = at, interval.bounded_below = bounded;
        if (profile.better()) {
          interval.better = profile.better();
          return intervals;
        }
        profile.leave();
      }
  }
  return intervals;
}

}  // namespace metastable::analysis
