#include "dynamics/walkers/five_link_biped.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

using Five = std::array<double, 5>;
using Matrix = std::array<Five, 5>;

// Returns how the centre of each link follows from the links' directions (sin, cos): forward and up from the stance
// foot.
Matrix chain(const BipedOptions& o) {
  const double l = o.segment_length;
  Matrix reach{};
  reach[stance_shank][stance_shank] = l - o.shank.joint_to_mass;
  reach[stance_thigh] = {l, l - o.thigh.joint_to_mass, 0, 0, 0};
  reach[torso] = {l, l, o.torso.joint_to_mass, 0, 0};
  reach[swing_thigh] = {l, l, 0, -o.thigh.joint_to_mass, 0};
  reach[swing_shank] = {l, l, 0, -l, -o.shank.joint_to_mass};
  return reach;
}

std::array<BipedLink, 5> links(const BipedOptions& o) { return {o.shank, o.thigh, o.torso, o.thigh, o.shank}; }

constexpr std::size_t after(std::size_t link) { return 4 - link; }

// Returns the sum over links of mass times the products of two chains, with the links' own inertias.
Matrix products(const BipedOptions& o, const Matrix& one, const Matrix& other) {
  Matrix sum{};
  const auto link = links(o);
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < 5; ++j)
      for (std::size_t k = 0; k < 5; ++k) sum[j][k] += link[i].mass * one[i][j] * other[i][k];
    sum[i][i] += link[i].inertia;
  }
  return sum;
}

// Returns half the sum of a leg's angles: as its segments are equal, the angle of the line from foot to hip.
double leg(const Five& of, std::size_t shank, std::size_t thigh) { return 0.5 * (of[shank] + of[thigh]); }

BipedMotion standing(std::span<const double> s) {
  // The longer leg stands straighter: both feet are on the ground.
  const double stance = std::cos(0.5 * s[1]), swing = std::cos(0.5 * s[2]);
  const double lean = std::atan((swing - stance) / (swing + stance) / std::tan(s[0]));
  BipedMotion m;
  m.angles = {lean - s[0] + 0.5 * s[1], lean - s[0] - 0.5 * s[1], s[3], lean + s[0] - 0.5 * s[2],
              lean + s[0] + 0.5 * s[2]};
  std::copy_n(s.begin() + 4, 5, m.rates.begin());
  return m;
}

void require(bool holds, const char* what, double value, const char* range) {
  if (!holds) throw std::invalid_argument(fmt::format("biped: {}: {} is not {}", what, value, range));
}

void require_options(const BipedOptions& o) {
  for (const BipedLink& link : {o.shank, o.thigh, o.torso}) {
    require(link.mass > 0 && std::isfinite(link.mass), "mass", link.mass, "a positive number [kg]");
    require(link.inertia > 0 && std::isfinite(link.inertia), "inertia", link.inertia, "a positive number [kg m^2]");
    require(std::isfinite(link.joint_to_mass), "joint to mass", link.joint_to_mass, "a number [m]");
  }
  require(o.segment_length > 0 && std::isfinite(o.segment_length), "segment length", o.segment_length,
          "a positive number [m]");
  require(o.gravity > 0 && std::isfinite(o.gravity), "gravity", o.gravity, "a positive number [m/s^2]");
  require(o.posture.half_step_rad > 0 && o.posture.half_step_rad < 1, "half step", o.posture.half_step_rad,
          "in (0, 1) rad");
  require(o.posture.swing_share > 0 && o.posture.swing_share <= 1, "swing share", o.posture.swing_share, "in (0, 1]");
}

}  // namespace

FiveLinkBiped::FiveLinkBiped(const BipedOptions& options) : options_(options) {
  require_options(options);
  equations_.posture = options.posture;
  const Matrix reach = chain(options);
  equations_.inertia = products(options, reach, reach);
  // The old legs by their new names: what was reached from the old foot.
  Matrix old{};
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = 0; j < 5; ++j) old[after(i)][after(j)] = reach[i][j];
  strike_ = products(options, reach, old);
  const auto link = links(options);
  for (std::size_t j = 0; j < 5; ++j) {
    equations_.weight[j] = 0;
    for (std::size_t i = 0; i < 5; ++i) equations_.weight[j] += options.gravity * link[i].mass * reach[i][j];
  }
}

std::vector<std::string> FiveLinkBiped::names() {
  return {"half angle [rad]",   "stance knee [rad]",         "swing knee [rad]",
          "torso [rad]",        "stance shank rate [rad/s]", "stance thigh rate [rad/s]",
          "torso rate [rad/s]", "swing thigh rate [rad/s]",  "swing shank rate [rad/s]"};
}

bool FiveLinkBiped::inside(std::span<const double> s) {
  return std::all_of(s.begin(), s.end(), [](double x) { return std::isfinite(x); }) && s[0] > 0 && s[0] < 1 &&
         upright(standing(s));
}

std::array<double, 9> FiveLinkBiped::state(const BipedMotion& m) const {
  const Five &q = m.angles, &v = m.rates;
  return {0.5 * (leg(q, swing_shank, swing_thigh) - leg(q, stance_shank, stance_thigh)),
          q[stance_shank] - q[stance_thigh],
          q[swing_shank] - q[swing_thigh],
          q[torso],
          v[0],
          v[1],
          v[2],
          v[3],
          v[4]};
}

BipedMotion FiveLinkBiped::motion(std::span<const double> state) const { return standing(state); }

std::array<double, 2> FiveLinkBiped::swing_foot(const BipedMotion& m) const {
  const BipedFoot foot = dynamics::swing_foot(m);
  return {options_.segment_length * foot.ahead, options_.segment_length * foot.height};
}

BipedTorques FiveLinkBiped::torques(const BipedMotion& m, double slope) const {
  return motor_torques(options_.posture, m, slope);
}

BipedMotion FiveLinkBiped::moved(const BipedMotion& from, double slope, double time, double longest) const {
  return links_at(equations_, from, slope, time, longest);
}

std::optional<BipedMotion> FiveLinkBiped::before_strike(std::span<const double> state, double slope) const {
  std::optional<BipedMotion> struck;
  const BipedMotion from = motion(state);
  follow_links(equations_, {&from, 1}, {&slope, 1}, {&struck, 1});
  return struck;
}

BipedMotion FiveLinkBiped::strike(const BipedMotion& before) const {
  BipedMotion m;
  Five rates;
  for (std::size_t j = 0; j < 5; ++j) m.angles[after(j)] = before.angles[j], rates[after(j)] = before.rates[j];
  Eigen::Matrix<double, 5, 5> mass;
  Eigen::Matrix<double, 5, 1> momentum = Eigen::Matrix<double, 5, 1>::Zero();
  for (std::size_t j = 0; j < 5; ++j)
    for (std::size_t k = 0; k < 5; ++k) {
      const auto row = static_cast<Eigen::Index>(j), column = static_cast<Eigen::Index>(k);
      const double apart = std::cos(m.angles[j] - m.angles[k]);
      mass(row, column) = equations_.inertia[j][k] * apart;
      momentum[row] += strike_[j][k] * apart * rates[k];
    }
  const Eigen::Matrix<double, 5, 1> struck = mass.llt().solve(momentum);
  std::copy(struck.begin(), struck.end(), m.rates.begin());
  return m;
}

double FiveLinkBiped::energy(const BipedMotion& m, double slope) const {
  double sum = 0;
  for (std::size_t j = 0; j < 5; ++j) {
    sum += equations_.weight[j] * std::cos(m.angles[j] + slope);
    for (std::size_t k = 0; k < 5; ++k)
      sum += 0.5 * equations_.inertia[j][k] * std::cos(m.angles[j] - m.angles[k]) * m.rates[j] * m.rates[k];
  }
  return sum;
}

double FiveLinkBiped::power(const BipedMotion& m, const BipedTorques& t) const {
  const Five& v = m.rates;
  return t.stance_knee * (v[stance_shank] - v[stance_thigh]) + t.swing_knee * (v[swing_shank] - v[swing_thigh]) +
         t.stance_hip * (v[torso] - v[stance_thigh]) + t.swing_hip * (v[swing_thigh] - v[torso]);
}

void FiveLinkBiped::step(std::span<const double> states, std::span<const double> slopes, std::span<double> next,
                         std::span<std::uint8_t> fell) const {
  const std::size_t n = slopes.size();
  if (states.size() != 9 * n || next.size() != 9 * n || fell.size() != n)
    throw std::invalid_argument("bipeds: states, slopes and landings differ in number");
  std::vector<BipedMotion> from;
  for (std::size_t i = 0; i < n; ++i) {
    const auto start = states.subspan(9 * i, 9);
    if (!std::isfinite(slopes[i])) throw std::invalid_argument(fmt::format("biped: a slope of {} rad", slopes[i]));
    if (!inside(start))
      throw std::invalid_argument(fmt::format("biped: ({}) is no state of one that walks", fmt::join(start, ", ")));
    from.push_back(motion(start));
  }
  std::vector<std::optional<BipedMotion>> before(n);
  follow_links(equations_, from, slopes, before);
  for (std::size_t i = 0; i < n; ++i) {
    fell[i] = 1;
    if (!before[i]) continue;
    const BipedMotion struck = strike(*before[i]);
    const auto end = state(struck);
    if (!(dynamics::swing_foot(struck).sinking < 0 && inside(end))) continue;  // the foot that leaves goes up
    std::copy(end.begin(), end.end(), next.begin() + static_cast<std::ptrdiff_t>(9 * i));
    fell[i] = 0;
  }
}

std::vector<double> FiveLinkBiped::gait(double slope) const {
  // The iteration begins near the gait that the default posture has on a slope of 1 deg.
  std::array<double, 9> state{0.298, 0.054, 0.238, 0.146, 2.202, 0.128, 0.046, 1.266, 1.112}, next{};
  constexpr double known_slope = std::numbers::pi / 180, most_at_once = known_slope / 4, accuracy = 1e-11;
  const auto pieces = static_cast<int>(std::ceil(std::abs(slope - known_slope) / most_at_once));
  for (int piece = std::min(1, pieces); piece <= pieces; ++piece) {
    const double ground = pieces == 0 ? slope : known_slope + (slope - known_slope) * piece / pieces;
    const bool last = piece == pieces;
    for (int step_number = 0; step_number < (last ? 3000 : 10); ++step_number) {
      std::uint8_t fell = 0;
      step(state, {&ground, 1}, next, {&fell, 1});
      if (fell) break;
      double change = 0;
      for (std::size_t i = 0; i < 9; ++i) change = std::max(change, std::abs(next[i] - state[i]));
      state = next;
      if (last && change < accuracy) return {state.begin(), state.end()};
    }
  }
  throw std::domain_error(
      fmt::format("gait: the biped comes to none of one step on a slope of {:.4g} deg", slope / known_slope));
}

}  // namespace metastable::dynamics
