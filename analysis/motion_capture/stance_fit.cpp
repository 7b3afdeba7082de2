#include "analysis/motion_capture/stance_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/extended_wheel/stance_motion.h"

namespace metastable::analysis {
namespace {

using Parameters = Eigen::Vector4d;  // time, angle, omega_minus, omega_plus

class Residuals {
 public:
  Residuals(std::span<const double> time, std::span<const double> angle, const dynamics::Stance& before,
            const dynamics::Stance& after, AfterCollision then, std::optional<KnownAngle> known)
      : time_(time), angle_(angle), before_(before), after_(after), then_(then), known_(known) {}

  Eigen::VectorXd operator()(const Parameters& p) const {
    Eigen::VectorXd residual(static_cast<Eigen::Index>(time_.size() + (known_ ? 1 : 0)));
    if (known_) residual(residual.size() - 1) = known_->weight * (p(1) - known_->angle_rad);
    // It goes outwards from the collision, each sample from its neighbour, so that every stretch is integrated once.
    const auto first_after =
        static_cast<std::size_t>(std::upper_bound(time_.begin(), time_.end(), p(0)) - time_.begin());
    dynamics::StanceState state{before_.end_angle_rad, p(2)};
    double now = p(0);
    for (std::size_t i = first_after; i-- > 0; now = time_[i]) {
      state = dynamics::stance_motion(before_.pendulum, state, time_[i] - now);
      residual(static_cast<Eigen::Index>(i)) = p(1) + state.angle - before_.end_angle_rad - angle_[i];
    }
    if (then_ == AfterCollision::flies) {
      for (std::size_t i = first_after; i < time_.size(); ++i)
        residual(static_cast<Eigen::Index>(i)) = p(1) + p(3) * (time_[i] - p(0)) - angle_[i];
      return residual;
    }
    state = {after_.start_angle_rad, p(3)};
    now = p(0);
    for (std::size_t i = first_after; i < time_.size(); now = time_[i], ++i) {
      state = dynamics::stance_motion(after_.pendulum, state, time_[i] - now);
      if (state.angle < after_.start_angle_rad) state = {after_.start_angle_rad, 0};  // fallen back onto both feet
      residual(static_cast<Eigen::Index>(i)) = p(1) + state.angle - after_.start_angle_rad - angle_[i];
    }
    return residual;
  }

 private:
  std::span<const double> time_, angle_;
  const dynamics::Stance &before_, &after_;
  AfterCollision then_;
  std::optional<KnownAngle> known_;
};

// Fits from one guess; the second number is the sum of squares.
std::optional<std::pair<StanceFit, double>> descend(const Residuals& residuals, StanceFit guess, double earliest,
                                                    double latest) {
  constexpr std::array<double, 4> increment{1e-6, 1e-6, 1e-5, 1e-5};
  Parameters p(guess.time, guess.angle_rad, guess.omega_minus, guess.omega_plus);
  Eigen::VectorXd r = residuals(p);
  double damping = 1e-3;
  for (int step = 0; step < 50; ++step) {
    Eigen::MatrixXd jacobian(r.size(), 4);
    for (int k = 0; k < 4; ++k) {
      Parameters up = p, down = p;
      up(k) += increment[static_cast<std::size_t>(k)];
      down(k) -= increment[static_cast<std::size_t>(k)];
      jacobian.col(k) = (residuals(up) - residuals(down)) / (2 * increment[static_cast<std::size_t>(k)]);
    }
    const Eigen::Matrix4d normal = jacobian.transpose() * jacobian;
    const Eigen::Vector4d gradient = jacobian.transpose() * r;
    Parameters change = Parameters::Zero();
    bool better = false;
    for (; !better && damping < 1e9; damping *= better ? 0.1 : 10) {
      Eigen::Matrix4d damped = normal;
      damped.diagonal() = (1 + damping) * normal.diagonal().array() + 1e-12 * normal.diagonal().maxCoeff();
      change = -damped.ldlt().solve(gradient);
      const Parameters candidate = p + change;
      if (!candidate.allFinite() || !(candidate(0) >= earliest && candidate(0) <= latest)) continue;
      const Eigen::VectorXd next = residuals(candidate);
      if (!(next.squaredNorm() <= r.squaredNorm())) continue;
      better = true;
      p = candidate;
      r = next;
    }
    const bool settled = std::abs(change(0)) < 1e-8 && std::abs(change(2)) < 1e-7 && std::abs(change(3)) < 1e-7;
    if (better && !settled) continue;
    if (!better && !(gradient.norm() <= 1e-6 * (1 + normal.diagonal().norm()))) return std::nullopt;
    const double freedom = std::max<double>(1, static_cast<double>(r.size()) - 4);
    const double sd = std::sqrt(r.squaredNorm() / freedom);
    const double variance = normal.ldlt().solve(Eigen::Vector4d::Unit(2))(2);  // of omega_minus, for samples of sd 1
    return std::pair(StanceFit{p(0), p(1), p(2), std::max(0.0, p(3)), sd, sd * std::sqrt(std::max(0.0, variance))},
                     r.squaredNorm());
  }
  return std::nullopt;
}

}  // namespace

std::vector<double> fit_residuals(std::span<const double> time, std::span<const double> angle,
                                  const dynamics::Stance& before, const dynamics::Stance& after, const StanceFit& fit,
                                  AfterCollision then) {
  const Eigen::VectorXd model_less_samples = Residuals(time, angle, before, after, then, std::nullopt)(
      Parameters(fit.time, fit.angle_rad, fit.omega_minus, fit.omega_plus));
  std::vector<double> residuals;
  for (const double one : model_less_samples) residuals.push_back(-one);
  return residuals;
}

std::optional<StanceFit> fit_collision(std::span<const double> time, std::span<const double> angle,
                                       const dynamics::Stance& before, const dynamics::Stance& after, StanceFit guess,
                                       AfterCollision then, std::optional<KnownAngle> known) {
  constexpr std::size_t least = 3;
  if (time.size() < 2 * least) return std::nullopt;
  const double earliest = time[least - 1], latest = time[time.size() - least];
  if (!(guess.time >= earliest && guess.time <= latest)) return std::nullopt;
  const Residuals residuals(time, angle, before, after, then, known);
  // A wheel that falls back has minima of its own: one for stopping dead, one for a small hop.
  std::optional<std::pair<StanceFit, double>> best;
  for (const double omega_plus : {guess.omega_plus, 0.6, 0.1}) {
    if (best && then == AfterCollision::flies) break;  // that wheel does not fall back
    guess.omega_plus = omega_plus;
    const auto fit = descend(residuals, guess, earliest, latest);
    if (fit && (!best || fit->second < best->second)) best = fit;
  }
  if (!best) return std::nullopt;
  return best->first;
}

}  // namespace metastable::analysis
