#include "dynamics/return_map/launch_speed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {
namespace {

TruncatedNormal forwards(const TruncatedNormal& normal) {
  return normal.lower() >= 0 ? normal : TruncatedNormal(normal.mean(), normal.sd(), 0, normal.upper());
}

// A piece of the curve at a share t of its width: the cubic with these values and slopes at its ends.
struct Piece {
  double width, from, to, slope_from, slope_to;
  double value(double t) const {
    const double u = 1 - t;
    const double cubic =
        from * (1 + 2 * t) * u * u + to * t * t * (3 - 2 * t) + width * t * u * (slope_from * u - slope_to * t);
    return std::clamp(cubic, from, to);  // but for rounding it is within
  }
  double slope(double t) const {
    const double secant = (to - from) / width;
    return 6 * t * (1 - t) * secant + slope_from * (1 - t) * (1 - 3 * t) + slope_to * t * (3 * t - 2);
  }
};

}  // namespace

LaunchSpeed::LaunchSpeed(const TruncatedNormal& normal) : normal_(forwards(normal)) {}

LaunchSpeed::LaunchSpeed(std::vector<double> score, std::vector<double> speed)
    : score_(std::move(score)), speed_(std::move(speed)) {
  if (score_.empty() || score_.size() != speed_.size())
    throw std::invalid_argument(
        fmt::format("launch speed: {} scores and {} speeds, as many of both expected", score_.size(), speed_.size()));
  if (!(speed_.front() >= 0))
    throw std::invalid_argument(fmt::format("launch speed: {} rad/s is below 0", speed_.front()));
  std::vector<double> secant;
  for (std::size_t i = 1; i < score_.size(); ++i) {
    if (!(score_[i] > score_[i - 1]) || !(speed_[i] >= speed_[i - 1]))
      throw std::invalid_argument(fmt::format("launch speed: {} rad/s at score {} after {} rad/s at score {}",
                                              speed_[i], score_[i], speed_[i - 1], score_[i - 1]));
    secant.push_back((speed_[i] - speed_[i - 1]) / (score_[i] - score_[i - 1]));
  }
  slope_.assign(score_.size(), 0.0);
  for (std::size_t i = 0; i < score_.size() && !secant.empty(); ++i) {
    const double before = secant[i == 0 ? 0 : i - 1], after = secant[std::min(i, secant.size() - 1)];
    // The harmonic mean is within three times the flatter secant, which keeps each piece monotone.
    slope_[i] = before > 0 && after > 0 ? 2 * before * after / (before + after) : 0;
  }
}

double LaunchSpeed::at_score(double score) const {
  if (normal_) return normal_->at_score(score);
  if (score <= score_.front()) return speed_.front();
  if (score >= score_.back()) return speed_.back();
  const auto i = static_cast<std::size_t>(std::ranges::upper_bound(score_, score) - score_.begin());
  const Piece piece{score_[i] - score_[i - 1], speed_[i - 1], speed_[i], slope_[i - 1], slope_[i]};
  return piece.value((score - score_[i - 1]) / piece.width);
}

double LaunchSpeed::density(double speed) const {
  if (normal_) return normal_->density(speed);
  if (constant()) throw std::logic_error("launch speed: a constant has no density");
  if (!(speed > speed_.front() && speed < speed_.back())) return 0;
  const auto i = static_cast<std::size_t>(std::ranges::upper_bound(speed_, speed) - speed_.begin());
  const Piece piece{score_[i] - score_[i - 1], speed_[i - 1], speed_[i], slope_[i - 1], slope_[i]};
  double low = 0, high = 1;
  for (int halvings = 0; halvings < 60; ++halvings) {
    const double middle = 0.5 * (low + high);
    (piece.value(middle) < speed ? low : high) = middle;
  }
  const double rise = piece.slope(low);
  return rise > 0 ? normal_density(score_[i - 1] + low * piece.width) / rise : 0;
}

bool LaunchSpeed::constant() const { return normal_ ? normal_->constant() : speed_.front() == speed_.back(); }

double LaunchSpeed::expect(int power, double about) const {
  // The trapezoidal rule over the scores.
  constexpr double step = 1.0 / 64;
  constexpr int reach = 10 * 64;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) sum += normal_density(i * step) * std::pow(at_score(i * step) - about, power);
  return sum * step;
}

double LaunchSpeed::mean() const {
  if (normal_) return normal_->truncated_mean();
  return constant() ? speed_.front() : expect(1, 0);
}

double LaunchSpeed::sd() const {
  if (normal_) return normal_->truncated_sd();
  return constant() ? 0 : std::sqrt(expect(2, mean()));
}

}  // namespace metastable::dynamics
