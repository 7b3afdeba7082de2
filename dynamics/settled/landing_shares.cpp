#include "dynamics/settled/landing_shares.h"

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

double LandingShares::settling_restitution(int leg, double omega) const {
  if (settling.empty()) return 1;
  const auto at = static_cast<std::size_t>(leg * speed.count + between_nodes(speed, omega).first);
  const double cell = (restitution.high - restitution.low) / (restitution.count - 1);
  return static_cast<double>(std::min(settling[at], settling[at + 1])) - cell;
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

LandingShares::SharesAtRestitution LandingShares::SharesAtSpeed::at_restitution(double eta) const {
  const auto [below, weight] = between_nodes(grid_->restitution, eta);
  const auto row = static_cast<std::size_t>(below);
  return {*grid_,
          *leg_,
          {slow_ + row, slow_ + row + 1, fast_ + row, fast_ + row + 1},
          {(1 - faster_) * (1 - weight), (1 - faster_) * weight, faster_ * (1 - weight), faster_ * weight}};
}

LandingShares::SharesAtRestitution::SharesAtRestitution(const LandingShares& grid, const Leg& leg,
                                                        std::array<std::size_t, 4> cells, std::array<double, 4> weights)
    : grid_(&grid), leg_(&leg), cells_(cells), weights_(weights), resting_(of(grid.resting, 1, 0)) {}

double LandingShares::SharesAtRestitution::of(const std::vector<float>& values, int stride, int place) const {
  double sum = 0;
  for (std::size_t k = 0; k < cells_.size(); ++k)
    sum += weights_[k] *
           static_cast<double>(values[cells_[k] * static_cast<std::size_t>(stride) + static_cast<std::size_t>(place)]);
  return sum;
}

LandingShares::Kept LandingShares::SharesAtRestitution::at_place(int place) const {
  return {of(grid_->kept, parts, place), of(grid_->displacement, parts, place)};
}

LandingShares::Kept LandingShares::SharesAtRestitution::at(double friction) const {
  const double part = std::min(1.0, (friction - resting_) / std::max(1e-6, leg_->sticking - resting_));
  if (!(part > 0)) {
    const Kept resting = at_place(0);
    return {resting.share + part / LandingShares::part(1) * (at_place(1).share - resting.share), resting.displacement};
  }
  // From mu_r on the share rises as a root and near mu_c evenly: in the root of the part both are smooth, and parabolas
  // through three places hold them.
  const double along = std::sqrt(part) * (parts - 1);
  const int first = std::max(0, std::min(static_cast<int>(along), parts - 2) - 1);
  const double t = along - first;
  const std::array<double, 3> weights{(t - 1) * (t - 2) / 2, t * (2 - t), t * (t - 1) / 2};
  Kept kept;
  for (int k = 0; k < 3; ++k) {
    const Kept one = at_place(first + k);
    kept.share += weights[static_cast<std::size_t>(k)] * one.share;
    kept.displacement += weights[static_cast<std::size_t>(k)] * one.displacement;
  }
  return kept;
}

}  // namespace metastable::dynamics
