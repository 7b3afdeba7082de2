#include "dynamics/walkers/two_link_walker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

constexpr int order = 16;
constexpr std::size_t width = 4;
/// Holds four walkers side by side.
using Lanes = double __attribute__((vector_size(width * sizeof(double))));

/// Holds a quantity's Taylor coefficients.
using Series = std::array<Lanes, order + 1>;

/// Holds angles, rates, and the sines and cosines that the equations need, of four walkers as series in time.
struct Motion {
  Series theta, psi, omega, nu;                   ///< stance and swing angle, their rates
  Series sin_theta, cos_theta;                    ///< of theta - gamma
  Series sin_psi, cos_psi;                        ///< of psi - gamma
  Series sin_between, cos_between, between;       ///< of theta - psi; omega - nu
  Series omega_squared, nu_squared, alpha, beta;  ///< beta, alpha: the angular accelerations
};

/// Fills the series from their first coefficients.
METASTABLE_WIDE void expand(Motion& m, double p, double q, double r, double w) {
  const Lanes c0 = m.cos_between[0];
  const Lanes inverse = 1 / (1 - p * r * c0 * c0);
  m.between[0] = m.omega[0] - m.nu[0];
  for (std::size_t k = 0; k < order; ++k) {
    Lanes omega2 = {}, nu2 = {};
    for (std::size_t j = 0; j <= k; ++j) {
      omega2 += m.omega[j] * m.omega[k - j];
      nu2 += m.nu[j] * m.nu[k - j];
    }
    m.omega_squared[k] = omega2;
    m.nu_squared[k] = nu2;
    Lanes by_nu = m.sin_between[0] * nu2, by_omega = m.sin_between[0] * omega2, by_beta = {}, by_alpha = {};
    for (std::size_t j = 1; j <= k; ++j) {
      by_nu += m.sin_between[j] * m.nu_squared[k - j];
      by_omega += m.sin_between[j] * m.omega_squared[k - j];
      by_beta += m.cos_between[j] * m.beta[k - j];
      by_alpha += m.cos_between[j] * m.alpha[k - j];
    }
    const Lanes stance = p * (by_nu + by_beta) + q * m.sin_theta[k];
    const Lanes swing = r * (by_alpha - by_omega) - w * m.sin_psi[k];
    m.alpha[k] = (stance + p * c0 * swing) * inverse;
    m.beta[k] = swing + r * c0 * m.alpha[k];

    Lanes s1 = {}, c1 = {}, s2 = {}, c2 = {}, s3 = {}, c3 = {};
    for (std::size_t j = 0; j <= k; ++j) {
      s1 += m.cos_theta[j] * m.omega[k - j];
      c1 -= m.sin_theta[j] * m.omega[k - j];
      s2 += m.cos_psi[j] * m.nu[k - j];
      c2 -= m.sin_psi[j] * m.nu[k - j];
      s3 += m.cos_between[j] * m.between[k - j];
      c3 -= m.sin_between[j] * m.between[k - j];
    }
    const double share = 1.0 / static_cast<double>(k + 1);
    m.sin_theta[k + 1] = share * s1;
    m.cos_theta[k + 1] = share * c1;
    m.sin_psi[k + 1] = share * s2;
    m.cos_psi[k + 1] = share * c2;
    m.sin_between[k + 1] = share * s3;
    m.cos_between[k + 1] = share * c3;
    m.theta[k + 1] = share * m.omega[k];
    m.psi[k + 1] = share * m.nu[k];
    m.omega[k + 1] = share * m.alpha[k];
    m.nu[k + 1] = share * m.beta[k];
    m.between[k + 1] = m.omega[k + 1] - m.nu[k + 1];
  }
}

/// Sets the first coefficients of `end` to the motion `time` later.
METASTABLE_WIDE void advance(const Motion& m, double time, Motion& end) {
  for (Series Motion::*const series :
       {&Motion::theta, &Motion::psi, &Motion::omega, &Motion::nu, &Motion::sin_theta, &Motion::cos_theta,
        &Motion::sin_psi, &Motion::cos_psi, &Motion::sin_between, &Motion::cos_between}) {
    Lanes value = (m.*series)[order];
    for (std::size_t k = order; k-- > 0;) value = value * time + (m.*series)[k];
    (end.*series)[0] = value;
  }
}

void start(Motion& m, std::size_t lane, const Stride& stride, const Ground& ground) {
  const double slope = ground.slope_rad, turn = ground.slope_rad - ground.last_slope_rad;
  const double theta = stride.half_angle_rad + turn, psi = -stride.half_angle_rad + turn;
  m.theta[0][lane] = theta;
  m.psi[0][lane] = psi;
  m.omega[0][lane] = stride.stance_rate;
  m.nu[0][lane] = stride.swing_rate;
  m.sin_theta[0][lane] = std::sin(theta - slope);
  m.cos_theta[0][lane] = std::cos(theta - slope);
  m.sin_psi[0][lane] = std::sin(psi - slope);
  m.cos_psi[0][lane] = std::cos(psi - slope);
  m.sin_between[0][lane] = std::sin(theta - psi);
  m.cos_between[0][lane] = std::cos(theta - psi);
}

double at(const Series& series, std::size_t lane, double time) {
  double value = series[order][lane];
  for (std::size_t k = order; k-- > 0;) value = value * time + series[k][lane];
  return value;
}

/// Finds where `value` goes from positive at `low` to not positive at `high`: Newton's steps with `rate`, halved
/// intervals where those leave the bracket.
template <class Value, class Rate>
double falling_root(double low, double high, const Value& value, const Rate& rate) {
  double time = high;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double now = value(time);
    (now > 0 ? low : high) = time;
    double next = time - now / rate(time);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double moved = std::abs(next - time);
    time = next;
    if (moved <= 1e-8 * (high + moved)) break;  // the step just taken left an error of the square of that
  }
  return time;
}

/// The swing foot is over the ground before the stance foot where theta + psi > 0 and theta < 0, and strikes as that
/// sum falls to zero. Returns the time of the strike within the step of the series, or nothing. `end` is the motion at
/// the end of the step.
std::optional<double> strike_time(const Motion& m, std::size_t lane, double step, const Motion& end) {
  if (end.theta[0][lane] + end.psi[0][lane] > 0 || !(end.theta[0][lane] < 0)) return std::nullopt;
  const auto gap = [&](double t) { return at(m.theta, lane, t) + at(m.psi, lane, t); };
  const auto rate = [&](double t) { return at(m.omega, lane, t) + at(m.nu, lane, t); };
  double low = 0;
  if (!(m.theta[0][lane] + m.psi[0][lane] > 0)) {
    // The foot may have risen and come down within the step.
    if (!(m.omega[0][lane] + m.nu[0][lane] > 0 && end.omega[0][lane] + end.nu[0][lane] < 0)) return std::nullopt;
    low = falling_root(0, step, rate, [&](double t) {
      double slope = 0;
      for (std::size_t k = order; k >= 1; --k)
        slope = slope * t + static_cast<double>(k) * (m.omega[k][lane] + m.nu[k][lane]);
      return slope;
    });
    if (!(gap(low) > 0)) return std::nullopt;
  }
  const double time = falling_root(low, step, gap, rate);
  if (!(at(m.theta, lane, time) < 0)) return std::nullopt;
  return time;
}

LegMotion read(const Motion& m, std::size_t lane, double before, double time) {
  return {before + time, at(m.theta, lane, time), at(m.psi, lane, time), at(m.omega, lane, time), at(m.nu, lane, time)};
}

void require_positive(double value, const char* name, const char* unit) {
  if (!(value > 0 && std::isfinite(value)))
    throw std::invalid_argument(fmt::format("{}: {} is not a positive number [{}]", name, value, unit));
}

void require_ground(const Ground& ground) {
  if (!(std::isfinite(ground.slope_rad) && std::isfinite(ground.last_slope_rad)))
    throw std::invalid_argument(
        fmt::format("walker: slopes of {} and {} rad are not finite", ground.slope_rad, ground.last_slope_rad));
}

void require_walkable(const Stride& s) {
  if (!(s.half_angle_rad > 0 && s.half_angle_rad < std::numbers::pi / 2 && std::isfinite(s.stance_rate) &&
        std::isfinite(s.swing_rate)))
    throw std::invalid_argument(
        fmt::format("walker: the state (half angle {} rad, stance rate {}, swing rate {}) is not finite with a half "
                    "angle between 0 and pi/2",
                    s.half_angle_rad, s.stance_rate, s.swing_rate));
}

}  // namespace

TwoLinkWalker::TwoLinkWalker(const CompassOptions& masses, const std::array<double, 4>& equations, int dimension)
    : masses_(masses), equations_(equations), dimension_(dimension) {
  const double length = masses.foot_to_mass + masses.mass_to_hip;
  taylor_step_ = (dimension == 2 ? 0.5 : 0.4) * std::sqrt(std::min(length, masses.mass_to_hip) / masses.gravity);
}

TwoLinkWalker TwoLinkWalker::simplest() {
  return {{.leg_mass = 0, .hip_mass = 1, .foot_to_mass = 0, .mass_to_hip = 1, .gravity = 1}, {0, 1, 1, 1}, 2};
}

TwoLinkWalker TwoLinkWalker::compass(const CompassOptions& o) {
  require_positive(o.leg_mass, "leg mass", "kg");
  require_positive(o.foot_to_mass, "foot to mass", "m");
  require_positive(o.mass_to_hip, "mass to hip", "m");
  require_positive(o.gravity, "gravity", "m/s^2");
  if (!(o.hip_mass >= 0 && std::isfinite(o.hip_mass)))
    throw std::invalid_argument(fmt::format("hip mass: {} is not a number >= 0 [kg]", o.hip_mass));
  const double m = o.leg_mass, a = o.foot_to_mass, b = o.mass_to_hip, l = a + b;
  const double stance_inertia = (o.hip_mass + m) * l * l + m * a * a;
  return {
      o,
      {m * l * b / stance_inertia, o.gravity * (o.hip_mass * l + m * (a + l)) / stance_inertia, l / b, o.gravity / b},
      3};
}

Stride TwoLinkWalker::stride(std::span<const double> state) const {
  if (dimension_ == 3) return {state[0], state[1], state[2]};
  return {state[0], state[1], std::cos(2 * state[0]) * state[1]};
}

Stride TwoLinkWalker::strike(const LegMotion& before) const {
  const double m = masses_.leg_mass, hip = masses_.hip_mass, a = masses_.foot_to_mass, b = masses_.mass_to_hip;
  const double l = a + b, apart = std::cos(2 * before.swing_angle);
  const double stance = before.stance_rate, swing = before.swing_rate;
  // About the struck foot it is, before, that of the hip, the old swing leg and the old stance leg.
  const double momentum =
      hip * l * l * apart * stance + m * a * (l * apart * stance - b * swing) + m * a * stance * (l * apart - b);
  // The new swing leg keeps its own about the hip: b swing' = l cos(2 alpha) stance' - a stance.
  const double carried = (l * apart - b) * a * stance;
  const double inertia = hip * l * l + m * a * a + m * l * (l - b * apart) - m * (l * apart - b) * l * apart;
  Stride after;
  after.half_angle_rad = before.swing_angle;
  after.stance_rate = (momentum - m * carried) / inertia;
  after.swing_rate = (l * apart * after.stance_rate - a * stance) / b;
  return after;
}

double TwoLinkWalker::energy(const LegMotion& s, double slope) const {
  const double m = masses_.leg_mass, hip = masses_.hip_mass, a = masses_.foot_to_mass, b = masses_.mass_to_hip;
  const double l = a + b, g = masses_.gravity;
  const double kinetic = 0.5 * ((hip + m) * l * l + m * a * a) * s.stance_rate * s.stance_rate +
                         0.5 * m * b * b * s.swing_rate * s.swing_rate -
                         m * l * b * std::cos(s.stance_angle - s.swing_angle) * s.stance_rate * s.swing_rate;
  const double height =
      (hip * l + m * (a + l)) * std::cos(s.stance_angle - slope) - m * b * std::cos(s.swing_angle - slope);
  return kinetic + g * height;
}

namespace {

/// Steps four walkers until each of the first `lanes` has struck the ground or fallen; struck[k] is how lane k struck.
void follow(Motion& m, std::size_t lanes, double step, double longest, const std::array<double, 4>& equations,
            std::array<std::optional<LegMotion>, width>& struck) {
  Motion other;
  Motion *now = &m, *next = &other;
  std::array<bool, width> done{};
  std::size_t left = lanes;
  for (double passed = 0; left > 0; passed += step, std::swap(now, next)) {
    expand(*now, equations[0], equations[1], equations[2], equations[3]);
    advance(*now, step, *next);
    for (std::size_t k = 0; k < lanes; ++k) {
      if (done[k]) continue;
      if (const auto time = strike_time(*now, k, step, *next)) {
        struck[k] = read(*now, k, passed, *time);
      } else if (std::abs(next->theta[0][k]) < std::numbers::pi / 2 && passed + step <= longest) {
        continue;
      }
      done[k] = true;
      --left;
    }
  }
}

}  // namespace

LegMotion TwoLinkWalker::at(const Stride& begin, const Ground& ground, double time) const {
  require_walkable(begin);
  Motion m{}, end{};
  for (std::size_t k = 0; k < width; ++k) start(m, k, begin, ground);
  double passed = 0;
  for (; time - passed > taylor_step_; passed += taylor_step_) {
    expand(m, equations_[0], equations_[1], equations_[2], equations_[3]);
    advance(m, taylor_step_, end);
    std::swap(m, end);
  }
  expand(m, equations_[0], equations_[1], equations_[2], equations_[3]);
  return read(m, 0, passed, time - passed);
}

void TwoLinkWalker::step(std::span<const double> states, std::span<const Ground> grounds, std::span<double> next,
                         std::span<std::uint8_t> fell) const {
  const auto dimension = static_cast<std::size_t>(dimension_);
  const std::size_t n = grounds.size();
  if (states.size() != n * dimension || next.size() != states.size() || fell.size() != n)
    throw std::invalid_argument("walkers: states, slopes and landings differ in number");
  for (std::size_t first = 0; first < n; first += width) {
    const std::size_t lanes = std::min(width, n - first);
    Motion m;
    for (std::size_t k = 0; k < width; ++k) {  // a lane without a walker repeats the last one
      const std::size_t i = first + std::min(k, lanes - 1);
      const Stride begin = stride(states.subspan(i * dimension, dimension));
      require_walkable(begin);
      require_ground(grounds[i]);
      start(m, k, begin, grounds[i]);
    }
    std::array<std::optional<LegMotion>, width> struck;
    follow(m, lanes, taylor_step_, longest_step(), equations_, struck);
    for (std::size_t k = 0; k < lanes; ++k) {
      const std::size_t i = first + k;
      fell[i] = struck[k] ? 0 : 1;
      if (!struck[k]) continue;
      const Stride after = strike(*struck[k]);
      const std::array<double, 3> all{after.half_angle_rad, after.stance_rate, after.swing_rate};
      std::copy_n(all.begin(), dimension, next.begin() + static_cast<std::ptrdiff_t>(i * dimension));
    }
  }
}

std::optional<LegMotion> TwoLinkWalker::before_strike(const Stride& begin, const Ground& ground) const {
  require_walkable(begin);
  require_ground(ground);
  Motion m;
  for (std::size_t k = 0; k < width; ++k) start(m, k, begin, ground);
  std::array<std::optional<LegMotion>, width> struck;
  follow(m, 1, taylor_step_, longest_step(), equations_, struck);
  return struck[0];
}

double TwoLinkWalker::longest_step() const {
  return 30 * std::sqrt((masses_.foot_to_mass + masses_.mass_to_hip) / masses_.gravity);
}

}  // namespace metastable::dynamics
