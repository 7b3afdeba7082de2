#include "dynamics/walkers/gait.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::optional<VectorXd> step(const TwoLinkWalker& walker, double slope, const VectorXd& state) {
  if (!(state[0] > 0 && state[0] < std::numbers::pi / 2 && state.allFinite())) return std::nullopt;
  VectorXd next(state.size());
  const Ground ground{slope, slope};
  std::uint8_t fell = 0;
  const auto size = static_cast<std::size_t>(state.size());
  walker.step({state.data(), size}, {&ground, 1}, {next.data(), size}, {&fell, 1});
  if (fell) return std::nullopt;
  return next;
}

std::optional<MatrixXd> derivative(const TwoLinkWalker& walker, double slope, const VectorXd& state) {
  MatrixXd d(state.size(), state.size());
  for (Index k = 0; k < state.size(); ++k) {
    const double h = 1e-5 * std::max(0.1, std::abs(state[k]));
    VectorXd low = state, high = state;
    low[k] -= h;
    high[k] += h;
    const auto below = step(walker, slope, low), above = step(walker, slope, high);
    if (!below || !above) return std::nullopt;
    d.col(k) = (*above - *below) / (2 * h);
  }
  return d;
}

std::optional<Gait> newton(const TwoLinkWalker& walker, double slope, VectorXd state) {
  constexpr int iterations = 30;
  constexpr double accuracy = 1e-11;
  for (int i = 0; i < iterations; ++i) {
    const auto next = step(walker, slope, state);
    if (!next) return std::nullopt;
    const VectorXd miss = *next - state;
    const auto d = derivative(walker, slope, state);
    if (!d) return std::nullopt;
    if (miss.cwiseAbs().maxCoeff() <= accuracy) {
      Gait gait;
      gait.state.assign(state.begin(), state.end());
      gait.residual = miss.cwiseAbs().maxCoeff();
      const Eigen::VectorXcd values = d->eigenvalues();
      gait.eigenvalues.assign(values.begin(), values.end());
      std::sort(gait.eigenvalues.begin(), gait.eigenvalues.end(), [](const auto& a, const auto& b) {
        return std::abs(a) != std::abs(b) ? std::abs(a) > std::abs(b) : a.imag() > b.imag();
      });
      return gait;
    }
    state += (MatrixXd::Identity(state.size(), state.size()) - *d).partialPivLu().solve(miss);
  }
  return std::nullopt;
}

[[noreturn]] void no_gait(double slope) {
  throw std::domain_error(
      fmt::format("gait: none found at a slope of {} rad ({} deg)", slope, slope * 180 / std::numbers::pi));
}

}  // namespace

Gait find_gait(const TwoLinkWalker& walker, double slope_rad, const std::vector<double>& guess) {
  if (guess.size() != static_cast<std::size_t>(walker.dimension()))
    throw std::invalid_argument(fmt::format("gait: a guess of {} numbers expected", walker.dimension()));
  const auto gait = newton(walker, slope_rad, Eigen::Map<const VectorXd>(guess.data(), walker.dimension()));
  if (!gait) no_gait(slope_rad);
  return *gait;
}

Gait find_gait(const TwoLinkWalker& walker, double slope_rad) {
  // It starts from the published gaits: Garcia et al. at 0.009 rad, Goswami et al. at 3 deg.
  const bool compass = walker.dimension() == 3;
  const double published = compass ? std::numbers::pi / 60 : 0.009;
  const std::vector<double> known =
      compass ? std::vector{0.271028680, -1.09238359, -0.37737395} : std::vector{0.200310900544, -0.199832473005};
  std::optional<Gait> gait = newton(walker, published, Eigen::Map<const VectorXd>(known.data(), walker.dimension()));
  if (!gait) no_gait(slope_rad);      // legs far from the published ones
  double gone = 0, stride = 1.0 / 8;  // shares of the way from the published slope
  while (gone < 1) {
    const double ahead = std::min(1.0, gone + stride);
    const double slope = ahead < 1 ? published + ahead * (slope_rad - published) : slope_rad;
    auto there = newton(walker, slope, Eigen::Map<const VectorXd>(gait->state.data(), walker.dimension()));
    if (there) {
      gait = std::move(there);
      gone = ahead;
    } else {
      stride /= 2;
      if (stride < 1e-3) no_gait(slope_rad);
    }
  }
  return *gait;
}

}  // namespace metastable::dynamics
