#include "dynamics/walkers/leg_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

namespace metastable::dynamics {
namespace {

constexpr int order = 16;
constexpr std::size_t width = legs_at_once;
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

/// Holds the equations of four walkers; `torque` is that of a hip that resists turning with a constant size, with its
/// sign.
struct Equations {
  Lanes p, q, r, w, stance_damping, swing_damping, stance_torque, swing_torque;
};

/// Fills the series from their first coefficients.
template <bool with_hip>
METASTABLE_WIDE void expand(Motion& m, const Equations& e) {
  const Lanes p = e.p, q = e.q, r = e.r, w = e.w;
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
    Lanes stance = p * (by_nu + by_beta) + q * m.sin_theta[k];
    Lanes swing = r * (by_alpha - by_omega) - w * m.sin_psi[k];
    if constexpr (with_hip) {
      stance -= e.stance_damping * m.between[k];
      swing += e.swing_damping * m.between[k];
      if (k == 0) {
        stance -= e.stance_torque;
        swing += e.swing_torque;
      }
    }
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
METASTABLE_WIDE void advance(const Motion& m, const Lanes& time, Motion& end) {
  for (Series Motion::*const series :
       {&Motion::theta, &Motion::psi, &Motion::omega, &Motion::nu, &Motion::sin_theta, &Motion::cos_theta,
        &Motion::sin_psi, &Motion::cos_psi, &Motion::sin_between, &Motion::cos_between}) {
    Lanes value = (m.*series)[order];
    for (std::size_t k = order; k-- > 0;) value = value * time + (m.*series)[k];
    (end.*series)[0] = value;
  }
}

void start(Motion& m, std::size_t lane, const LegMotion& from, double slope) {
  const double theta = from.stance_angle, psi = from.swing_angle;
  m.theta[0][lane] = theta;
  m.psi[0][lane] = psi;
  m.omega[0][lane] = from.stance_rate;
  m.nu[0][lane] = from.swing_rate;
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

/// Returns when within the step the legs' turning against each other changes its sign; nothing if it does not.
std::optional<double> turning_back(const Motion& m, std::size_t lane, double step, const Motion& end) {
  const double before = m.omega[0][lane] - m.nu[0][lane], after = end.omega[0][lane] - end.nu[0][lane];
  if (!(before * after < 0)) return std::nullopt;
  const double sign = before > 0 ? 1 : -1;
  const auto turning = [&](double t) { return sign * (at(m.omega, lane, t) - at(m.nu, lane, t)); };
  const auto faster = [&](double t) {
    double slope = 0;
    for (std::size_t k = order; k >= 1; --k)
      slope = slope * t + static_cast<double>(k) * (m.omega[k][lane] - m.nu[k][lane]);
    return sign * slope;
  };
  return falling_root(0, step, turning, faster);
}

/// Holds four walkers on their way: a lane without a walker repeats the last one.
class Way {
 public:
  Way(std::span<const LegMotion> from, std::span<const double> slopes, std::span<const LegEquations> equations,
      std::span<const LegCourse> courses) {
    for (std::size_t k = 0; k < width; ++k) {
      const std::size_t i = std::min(k, from.size() - 1);
      const LegEquations& e = equations[i];
      equations_.p[k] = e.p;
      equations_.q[k] = e.q;
      equations_.r[k] = e.r;
      equations_.w[k] = e.w;
      equations_.stance_damping[k] = e.stance_damping;
      equations_.swing_damping[k] = e.swing_damping;
      friction_[k] = {e.stance_friction, e.swing_friction};
      hip_ = hip_ || e.stance_damping != 0 || e.swing_damping != 0 || e.stance_friction != 0;
      taylor_step_[k] = courses[i].taylor_step;
      start(now(), k, from[i], slopes[i]);
    }
  }

  /// Expands the motion, with the hip's friction against the turning, and moves on by a Taylor step, or up to where a
  /// hip with friction turns back.
  void go_on() {
    std::array<double, width> sign{};
    for (std::size_t k = 0; k < width; ++k) {
      const double turning = now().omega[0][k] - now().nu[0][k];
      sign[k] = turns_back_[k] ? -sign_[k] : turning > 0 ? 1 : turning < 0 ? -1 : 0;
      set_torque(k, sign[k]);
    }
    expand_now();
    bool held = false;  // a friction that would turn the legs back at once lets them pass this moment
    for (std::size_t k = 0; k < width; ++k)
      if (turns_back_[k] && sign[k] * (now().alpha[0][k] - now().beta[0][k]) < 0) {
        set_torque(k, 0);
        held = true;
      }
    if (held) expand_now();
    steps_ = taylor_step_;
    advance(now(), steps_, next());
    bool cut = false;
    for (std::size_t k = 0; k < width; ++k) {
      const auto time = friction_[k].first != 0 && !turns_back_[k] ? turning_back(now(), k, taylor_step_[k], next())
                                                                   : std::optional<double>();
      turns_back_[k] = time.has_value();
      sign_[k] = sign[k];
      if (time) steps_[k] = *time;
      cut = cut || time;
    }
    if (cut) advance(now(), steps_, next());
  }
  void arrive() {
    passed_ += steps_;
    at_ = 1 - at_;
  }
  std::optional<LegMotion> struck(std::size_t lane) const {
    const auto time = strike_time(now(), lane, steps_[lane], next());
    if (!time) return std::nullopt;
    return after(lane, *time);
  }
  LegMotion after(std::size_t k, double time) const {
    return {passed_[k] + time, at(now().theta, k, time), at(now().psi, k, time), at(now().omega, k, time),
            at(now().nu, k, time)};
  }
  bool lies_down(std::size_t lane) const { return !(std::abs(next().theta[0][lane]) < std::numbers::pi / 2); }
  double arrival(std::size_t lane) const { return passed_[lane] + steps_[lane]; }
  double passed(std::size_t lane) const { return passed_[lane]; }

 private:
  Motion& now() { return motions_[at_]; }
  Motion& next() { return motions_[1 - at_]; }
  const Motion& now() const { return motions_[at_]; }
  const Motion& next() const { return motions_[1 - at_]; }
  void expand_now() { hip_ ? expand<true>(now(), equations_) : expand<false>(now(), equations_); }
  void set_torque(std::size_t lane, double sign) {
    equations_.stance_torque[lane] = sign * friction_[lane].first;
    equations_.swing_torque[lane] = sign * friction_[lane].second;
  }

  std::array<Motion, 2> motions_;  // start() and advance() set what expand() takes
  std::size_t at_ = 0;             // which of them is now
  Equations equations_{};
  std::array<std::pair<double, double>, width> friction_{};
  std::array<double, width> sign_{};
  std::array<bool, width> turns_back_{};  // at the moment that the series start from
  Lanes steps_{}, passed_{}, taylor_step_{};
  bool hip_ = false;
};

}  // namespace

StruckLegs follow_legs(std::span<const LegMotion> from, std::span<const double> slopes,
                       std::span<const LegEquations> equations, std::span<const LegCourse> courses) {
  StruckLegs struck;
  Way way(from, slopes, equations, courses);
  std::array<bool, width> done{};
  for (std::size_t left = from.size(); left > 0; way.arrive()) {
    way.go_on();
    for (std::size_t k = 0; k < from.size(); ++k) {
      if (done[k]) continue;
      struck[k] = way.struck(k);
      if (!struck[k] && !way.lies_down(k) && way.arrival(k) <= courses[k].longest) continue;
      done[k] = true;
      --left;
    }
  }
  return struck;
}

LegMotion legs_at(const LegMotion& from, double slope, const LegEquations& equations, double taylor_step, double time) {
  const LegCourse course{taylor_step, time};
  Way way({&from, 1}, {&slope, 1}, {&equations, 1}, {&course, 1});
  for (way.go_on(); way.arrival(0) < time; way.go_on()) way.arrive();
  return way.after(0, time - way.passed(0));
}

}  // namespace metastable::dynamics
