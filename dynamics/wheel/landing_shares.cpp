#include "dynamics/wheel/landing_shares.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace metastable::dynamics {
namespace {

constexpr double farthest = 4;  // ratio of two J that straight lines in ln J are followed to

// Returns the index of the node below a value and the weight of the one above.
std::pair<int, double> between_nodes(const LandingShares::GridAxis& axis, double value) {
  const double at = std::clamp((value - axis.low) / (axis.high - axis.low), 0.0, 1.0) * (axis.count - 1);
  const int below = std::min(static_cast<int>(at), axis.count - 2);
  return {below, at - below};
}

}  // namespace

struct LandingShares::SharesAtSpeed::Corners {
  std::array<std::size_t, 4> cell;
  std::array<double, 4> weight;
  double of(const std::vector<float>& values, std::size_t stride, std::size_t place) const {
    double sum = 0;
    for (std::size_t k = 0; k < cell.size(); ++k)
      sum += weight[k] * static_cast<double>(values[cell[k] * stride + place]);
    return sum;
  }
};

double plastic_share(double chord, double ahead, double height, double gyration_sq) {
  const double kept = 1 - chord * ahead / (gyration_sq + ahead * ahead + height * height);
  return kept * kept;
}

double sticking_friction(double ahead, double height, double gyration_sq) {
  return ahead * height / (gyration_sq + height * height);
}

void LandingShares::resize() {
  resting.resize(legs.size() * static_cast<std::size_t>(speed.count * restitution.count));
  kept.resize(resting.size() * static_cast<std::size_t>(parts));
  displacement.resize(kept.size());
}

std::size_t LandingShares::cell(int leg, int at_speed, int at_restitution) const {
  return static_cast<std::size_t>((leg * speed.count + at_speed) * restitution.count + at_restitution);
}

LandingShares LandingShares::of_gyration(const std::vector<double>& gyration_sq) const {
  LandingShares other = *this;
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    Leg& one = other.legs[leg];
    const double change = std::log(std::clamp(gyration_sq[leg] / one.gyration_sq, 1 / farthest, farthest));
    one.gyration_sq = gyration_sq[leg];
    one.sticking = sticking_friction(one.ahead, one.height, one.gyration_sq);
    one.plastic = plastic_share(one.chord, one.ahead, one.height, one.gyration_sq);
    const auto move = [&](std::vector<float>& values, const std::vector<float>& rate) {
      const std::size_t count = values.size() / legs.size();
      for (std::size_t i = leg * count; i < (leg + 1) * count; ++i) values[i] += static_cast<float>(change) * rate[i];
    };
    move(other.resting, resting_rate);
    move(other.kept, kept_rate);
    move(other.displacement, displacement_rate);
  }
  return other;
}

LandingShares::SharesAtSpeed::SharesAtSpeed(const LandingShares& grid, int leg, double omega)
    : grid_(&grid), leg_(&grid.legs[static_cast<std::size_t>(leg)]) {
  const auto [below, weight] = between_nodes(grid.speed, omega);
  slow_ = grid.cell(leg, below, 0);
  fast_ = grid.cell(leg, below + 1, 0);
  faster_ = weight;
}

LandingShares::SharesAtSpeed::Corners LandingShares::SharesAtSpeed::around(double eta) const {
  const auto [below, weight] = between_nodes(grid_->restitution, eta);
  const auto row = static_cast<std::size_t>(below);
  return {{slow_ + row, slow_ + row + 1, fast_ + row, fast_ + row + 1},
          {(1 - faster_) * (1 - weight), (1 - faster_) * weight, faster_ * (1 - weight), faster_ * weight}};
}

double LandingShares::SharesAtSpeed::resting_friction(double eta) const { return around(eta).of(grid_->resting, 1, 0); }

LandingShares::Kept LandingShares::SharesAtSpeed::at(double eta, double friction) const {
  const Corners corners = around(eta);
  const double resting = corners.of(grid_->resting, 1, 0);
  const double part = std::min(1.0, (friction - resting) / std::max(1e-6, leg_->sticking - resting));
  const auto stride = static_cast<std::size_t>(grid_->parts);
  // From mu_r on the share rises as a root and near mu_c evenly: in the root of the part both are smooth, and parabolas
  // through three places hold them. Below mu_r it falls on by a straight line.
  const double along = part > 0 ? std::sqrt(part) * (grid_->parts - 1) : 0;
  const std::size_t below = std::min(static_cast<std::size_t>(along), stride - 2), first = below > 0 ? below - 1 : 0;
  const double t = along - static_cast<double>(first);
  const std::array<double, 3> weights = part > 0 ? std::array{(t - 1) * (t - 2) / 2, t * (2 - t), t * (t - 1) / 2}
                                                 : std::array{1 - part / grid_->part(1), part / grid_->part(1), 0.0};
  const auto read = [&](const std::vector<float>& values) {
    double sum = 0;
    for (std::size_t k = 0; k < weights.size(); ++k) sum += weights[k] * corners.of(values, stride, first + k);
    return sum;
  };
  return {read(grid_->kept), part > 0 ? read(grid_->displacement) : corners.of(grid_->displacement, stride, 0)};
}

}  // namespace metastable::dynamics
