#include "dynamics/walkers/leg_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "dynamics/walkers/side_by_side.h"

namespace metastable::dynamics {
namespace {

constexpr int order = 12;
constexpr std::size_t vectors = 2;
/// Holds a quantity's Taylor coefficients.
template <class Lanes>
using Series = std::array<Lanes, order + 1>;

/// Holds 1 / k.
constexpr std::array<double, order + 1> shares = [] {
  std::array<double, order + 1> list{};
  for (std::size_t k = 1; k <= order; ++k) list[k] = 1 / static_cast<double>(k);
  return list;
}();

/// Holds angles, rates, and the sines and cosines that the equations need, of walkers side by side as series in time.
template <class Lanes>
struct Motion {
  Series<Lanes> theta, psi, omega, nu;     ///< stance and swing angle, their rates
  Series<Lanes> sin_theta, cos_theta;      ///< of theta - gamma
  Series<Lanes> sin_psi, cos_psi;          ///< of psi - gamma
  Series<Lanes> sin_between, cos_between;  ///< of theta - psi
  Series<Lanes> between, product;          ///< omega - nu; omega nu
  Lanes turning, inverse;                  ///< of the series' recurrence
};

/// Holds the equations of walkers side by side; `torque` is that of a hip that resists turning with a constant size,
/// with its sign.
template <class Lanes>
struct Equations {
  Lanes p, q, r, w, stance_damping, swing_damping, stance_torque, swing_torque;
};

/// Prepares the series from their first coefficients.
template <class Lanes>
inline __attribute__((always_inline)) void begin(Motion<Lanes>& m, const Equations<Lanes>& e) {
  const Lanes c0 = m.cos_between[0];
  m.between[0] = m.omega[0] - m.nu[0];
  m.product[0] = m.omega[0] * m.nu[0];
  m.turning = c0 * m.between[0];
  m.inverse = 1 / (1 - e.p * e.r * c0 * c0);
}

/// Adds the coefficient k + 1 to the series. Their recurrence is that of the momenta: with x = theta - psi,
///   (omega - p cos x nu)' = q sin(theta - gamma) - T / A + p sin x omega nu,
///   (nu - r cos x omega)' = -w sin(psi - gamma) + T / C - r sin x omega nu,
/// nine products of series, of which those of cos x with both rates serve (sin x)' too.
template <bool with_hip, class Lanes>
inline __attribute__((always_inline)) void extend(Motion<Lanes>& m, const Equations<Lanes>& e, std::size_t k) {
  const Lanes c0 = m.cos_between[0], sb0 = m.sin_between[0], omega0 = m.omega[0], nu0 = m.nu[0];
  Lanes s1 = m.cos_theta[0] * m.omega[k], c1 = m.sin_theta[0] * m.omega[k], s2 = m.cos_psi[0] * m.nu[k],
        c2 = m.sin_psi[0] * m.nu[k], c3 = sb0 * m.between[k], force = sb0 * m.product[k], by_nu = {}, by_omega = {},
        rates = {};
  for (std::size_t j = 1; j <= k; ++j) {
    const Lanes omega = m.omega[k - j], nu = m.nu[k - j], sb = m.sin_between[j], cb = m.cos_between[j];
    s1 += m.cos_theta[j] * omega;
    c1 += m.sin_theta[j] * omega;
    s2 += m.cos_psi[j] * nu;
    c2 += m.sin_psi[j] * nu;
    c3 += sb * m.between[k - j];
    force += sb * m.product[k - j];
    by_nu += cb * m.nu[k + 1 - j];
    by_omega += cb * m.omega[k + 1 - j];
    rates += m.omega[j] * m.nu[k + 1 - j];
  }
  const double share = shares[k + 1];
  Lanes stance = e.q * m.sin_theta[k] + e.p * force, swing = e.w * m.sin_psi[k] + e.r * force;
  if constexpr (with_hip) {
    stance -= e.stance_damping * m.between[k];
    swing -= e.swing_damping * m.between[k];
    if (k == 0) {
      stance -= e.stance_torque;
      swing -= e.swing_torque;
    }
  }
  m.sin_theta[k + 1] = share * s1;
  m.cos_theta[k + 1] = -share * c1;
  m.sin_psi[k + 1] = share * s2;
  m.cos_psi[k + 1] = -share * c2;
  m.sin_between[k + 1] = share * m.turning;
  m.cos_between[k + 1] = -share * c3;
  m.theta[k + 1] = share * m.omega[k];
  m.psi[k + 1] = share * m.nu[k];
  by_nu += m.cos_between[k + 1] * nu0;
  by_omega += m.cos_between[k + 1] * omega0;
  const Lanes rest = e.r * by_omega - share * swing;
  m.omega[k + 1] = (share * stance + e.p * (by_nu + c0 * rest)) * m.inverse;
  m.nu[k + 1] = rest + e.r * c0 * m.omega[k + 1];
  m.between[k + 1] = m.omega[k + 1] - m.nu[k + 1];
  m.product[k + 1] = rates + omega0 * m.nu[k + 1] + m.omega[k + 1] * nu0;
  m.turning = c0 * m.between[k + 1] + (by_omega - by_nu);
}

/// Fills the series from their first coefficients: while the results of one vector of walkers are waited for, those of
/// the other are at work.
template <bool with_hip, class Lanes>
inline __attribute__((always_inline)) void fill(std::array<Motion<Lanes>, vectors>& m,
                                                const std::array<Equations<Lanes>, vectors>& e) {
  for (std::size_t v = 0; v < vectors; ++v) begin(m[v], e[v]);
  for (std::size_t k = 0; k < order; ++k)
    for (std::size_t v = 0; v < vectors; ++v) extend<with_hip>(m[v], e[v], k);
}

template <bool with_hip>
METASTABLE_WIDE void expand(std::array<Motion<Four>, vectors>& m, const std::array<Equations<Four>, vectors>& e) {
  fill<with_hip>(m, e);
}

template <bool with_hip>
METASTABLE_EIGHT_LANES void expand(std::array<Motion<Eight>, vectors>& m,
                                   const std::array<Equations<Eight>, vectors>& e) {
  fill<with_hip>(m, e);
}

/// Sets the first coefficients of `end` to the motion `time` later.
template <class Lanes>
inline __attribute__((always_inline)) void sum_up(const Motion<Lanes>& m, const Lanes& time, Motion<Lanes>& end) {
  Lanes theta = m.theta[order], psi = m.psi[order], omega = m.omega[order], nu = m.nu[order],
        sin_theta = m.sin_theta[order], cos_theta = m.cos_theta[order], sin_psi = m.sin_psi[order],
        cos_psi = m.cos_psi[order];
  for (std::size_t k = order; k-- > 0;) {
    theta = theta * time + m.theta[k];
    psi = psi * time + m.psi[k];
    omega = omega * time + m.omega[k];
    nu = nu * time + m.nu[k];
    sin_theta = sin_theta * time + m.sin_theta[k];
    cos_theta = cos_theta * time + m.cos_theta[k];
    sin_psi = sin_psi * time + m.sin_psi[k];
    cos_psi = cos_psi * time + m.cos_psi[k];
  }
  end.theta[0] = theta;
  end.psi[0] = psi;
  end.omega[0] = omega;
  end.nu[0] = nu;
  end.sin_theta[0] = sin_theta;
  end.cos_theta[0] = cos_theta;
  end.sin_psi[0] = sin_psi;
  end.cos_psi[0] = cos_psi;
  end.sin_between[0] = sin_theta * cos_psi - cos_theta * sin_psi;
  end.cos_between[0] = cos_theta * cos_psi + sin_theta * sin_psi;
}

METASTABLE_WIDE void advance(const Motion<Four>& m, const Four& time, Motion<Four>& end) { sum_up(m, time, end); }
METASTABLE_EIGHT_LANES void advance(const Motion<Eight>& m, const Eight& time, Motion<Eight>& end) {
  sum_up(m, time, end);
}

template <class Lanes>
void start(Motion<Lanes>& m, std::size_t lane, const LegMotion& from, double slope) {
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

template <class Lanes>
double at(const Series<Lanes>& series, std::size_t lane, double time) {
  double value = series[order][lane];
  for (std::size_t k = order; k-- > 0;) value = value * time + series[k][lane];
  return value;
}

/// Holds one walker's Taylor coefficients of a quantity within a step.
class Course {
 public:
  /// Sums or subtracts two quantities.
  template <class Lanes>
  Course(const Series<Lanes>& a, const Series<Lanes>& b, double factor, std::size_t lane) {
    for (std::size_t k = 0; k <= order; ++k) coefficient_[k] = a[k][lane] + factor * b[k][lane];
  }
  /// Returns the value and its derivative.
  std::pair<double, double> with_rate(double time) const {
    double value = coefficient_[order], rate = 0;
    for (std::size_t k = order; k-- > 0;) {
      rate = rate * time + value;
      value = value * time + coefficient_[k];
    }
    return {value, rate};
  }

 private:
  std::array<double, order + 1> coefficient_;
};

/// Finds where `sign` times a quantity goes from positive at `low` to not positive at `high`: Newton's steps from where
/// the chord does, halved intervals where those leave the bracket.
/// @param course  has with_rate(): the quantity and its rate at a time
template <class AnyCourse>
double falling_root(double low, double high, double at_low, double at_high, const AnyCourse& course, double sign = 1) {
  double time = sign * at_low > 0 && sign * at_high < 0 ? low + (high - low) * at_low / (at_low - at_high) : high;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const auto [now, rate] = course.with_rate(time);
    (sign * now > 0 ? low : high) = time;
    const double step = now / rate;
    // A step as small as this one leaves an error of its square; it may leave the bracket by as little.
    if (std::abs(step) <= 1e-8 * time) return time - step;
    time = time - step > low && time - step < high ? time - step : 0.5 * (low + high);
  }
  return time;
}

/// The swing foot is over the ground before the stance foot where theta + psi > 0 and theta < 0, and strikes as that
/// sum falls to zero. Returns the time of the strike within the step of the series, or nothing. `end` is the motion at
/// the end of the step.
template <class Lanes>
std::optional<double> strike_time(const Motion<Lanes>& m, std::size_t lane, double step, const Motion<Lanes>& end) {
  const double begins = m.theta[0][lane] + m.psi[0][lane], ends = end.theta[0][lane] + end.psi[0][lane];
  if (ends > 0 || !(end.theta[0][lane] < 0)) return std::nullopt;
  // The foot may have risen and come down within the step.
  const double rises = m.omega[0][lane] + m.nu[0][lane], falls = end.omega[0][lane] + end.nu[0][lane];
  if (!(begins > 0) && !(rises > 0 && falls < 0)) return std::nullopt;
  const Course gap(m.theta, m.psi, 1, lane);
  double low = 0, highest = begins;
  if (!(begins > 0)) {
    low = falling_root(0, step, rises, falls, Course(m.omega, m.nu, 1, lane));
    highest = gap.with_rate(low).first;
    if (!(highest > 0)) return std::nullopt;
  }
  const double time = falling_root(low, step, highest, ends, gap);
  if (!(at(m.theta, lane, time) < 0)) return std::nullopt;
  return time;
}

/// The height of a swing foot over the ground, cos theta - ratio cos psi stance legs; over the sine of half the angle
/// between the legs, where these are apart: what is left for equal ones is their sum theta + psi, more or less.
template <class Lanes>
struct FootHeight {
  const Motion<Lanes>& m;
  std::size_t lane;
  double ratio;  ///< length of the swing leg over that of the stance leg
  bool divided = false;

  std::pair<double, double> with_rate(double t) const {
    const double theta = at(m.theta, lane, t), psi = at(m.psi, lane, t);
    const double omega = at(m.omega, lane, t), nu = at(m.nu, lane, t);
    const double height = std::cos(theta) - ratio * std::cos(psi);
    const double rate = ratio * std::sin(psi) * nu - std::sin(theta) * omega;
    if (!divided) return {height, rate};
    const double half = 0.5 * (psi - theta), apart = std::sin(half), value = height / apart;
    return {value, (rate - value * 0.5 * std::cos(half) * (nu - omega)) / apart};
  }
};

/// The same where the legs differ. The foot is before the stance foot by ratio sin psi - sin theta. It strikes while it
/// is before the hip: as the legs pass each other, which equal ones do with both feet at one place, a shorter one may
/// come down, too. Of a longer swing leg the stance leg may still lean back then.
template <class Lanes>
std::optional<double> strike_time(const Motion<Lanes>& m, std::size_t lane, double step, const Motion<Lanes>& end,
                                  double ratio) {
  const double swings = m.psi[0][lane], swung = end.psi[0][lane];
  if (!(swings > 0 || swung > 0)) return std::nullopt;
  const Course swing(m.psi, m.psi, 0, lane);
  double low = swings > 0 ? 0 : falling_root(0, step, swings, swung, swing, -1);
  const double until = swung > 0 ? step : falling_root(0, step, swings, swung, swing);
  FootHeight<Lanes> height{m, lane, ratio};
  if (height.with_rate(until).first > 0) return std::nullopt;
  height.divided = at(m.psi, lane, low) > at(m.theta, lane, low);
  const auto over = [&](double t) { return height.with_rate(t).first; };
  const auto rate = [&](double t) { return height.with_rate(t).second; };
  if (!(over(low) > 0)) {
    // The foot may have risen and come down within the step; it is highest where halved intervals of the rate lead.
    if (!(rate(low) > 0 && rate(until) < 0)) return std::nullopt;
    double high = until;
    for (int halving = 0; halving < 50; ++halving) {
      const double middle = 0.5 * (low + high);
      (rate(middle) > 0 ? low : high) = middle;
    }
    if (!(over(low) > 0)) return std::nullopt;
  }
  const double time = falling_root(low, until, over(low), over(until), height);
  const double theta = at(m.theta, lane, time);
  if (!(ratio * std::sin(at(m.psi, lane, time)) > std::sin(theta) && std::cos(theta) > 0)) return std::nullopt;
  return time;
}

/// Returns when within the step the legs' turning against each other changes its sign; nothing if it does not.
template <class Lanes>
std::optional<double> turning_back(const Motion<Lanes>& m, std::size_t lane, double step, const Motion<Lanes>& end) {
  const double before = m.omega[0][lane] - m.nu[0][lane], after = end.omega[0][lane] - end.nu[0][lane];
  if (!(before * after < 0)) return std::nullopt;
  return falling_root(0, step, before, after, Course(m.omega, m.nu, -1, lane), before > 0 ? 1 : -1);
}

/// Holds two vectors of walkers on their way; one that arrives makes room for the next. A lane without a walker goes on
/// with the last one that it had, or with the first of all.
template <class Lanes>
class Way {
  static constexpr std::size_t vector_width = sizeof(Lanes) / sizeof(double);

 public:
  static constexpr std::size_t width = vectors * vector_width;

  Way(const LegMotion& from, double slope, const LegEquations& equations, const LegCourse& course) {
    for (std::size_t k = 0; k < width; ++k) set_out(k, from, slope, equations, course);
  }

  void set_out(std::size_t k, const LegMotion& from, double slope, const LegEquations& e, const LegCourse& course) {
    equations_[k / vector_width].p[k % vector_width] = e.p;
    equations_[k / vector_width].q[k % vector_width] = e.q;
    equations_[k / vector_width].r[k % vector_width] = e.r;
    equations_[k / vector_width].w[k % vector_width] = e.w;
    equations_[k / vector_width].stance_damping[k % vector_width] = e.stance_damping;
    equations_[k / vector_width].swing_damping[k % vector_width] = e.swing_damping;
    friction_[k] = {e.stance_friction, e.swing_friction};
    hip_ = hip_ || e.stance_damping != 0 || e.swing_damping != 0 || e.stance_friction != 0;
    taylor_step_[k / vector_width][k % vector_width] = course.taylor_step;
    swing_ratio_[k] = course.swing_ratio;
    passed_[k] = 0;
    turns_back_[k] = false;
    start(now(k), k % vector_width, from, slope);
  }

  /// Expands the motion, with the hip's friction against the turning, and moves on by a Taylor step, or up to where a
  /// hip with friction turns back.
  void go_on() {
    if (hip_) return go_on_against_friction();
    expand<false>(motions_[at_], equations_);
    steps_ = taylor_step_;
    move_on();
  }
  void arrive() {
    for (std::size_t k = 0; k < width; ++k) passed_[k] += step_of(k);
    at_ = 1 - at_;
  }
  std::optional<LegMotion> struck(std::size_t lane) const {
    const std::size_t in = lane % vector_width;
    const auto time = swing_ratio_[lane] == 1
                          ? strike_time(now(lane), in, step_of(lane), next(lane))
                          : strike_time(now(lane), in, step_of(lane), next(lane), swing_ratio_[lane]);
    if (!time) return std::nullopt;
    return after(lane, *time);
  }
  LegMotion after(std::size_t k, double time) const {
    const Motion<Lanes>& m = now(k);
    const std::size_t lane = k % vector_width;
    return {passed_[k] + time, at(m.theta, lane, time), at(m.psi, lane, time), at(m.omega, lane, time),
            at(m.nu, lane, time)};
  }
  bool lies_down(std::size_t lane) const {
    return !(std::abs(next(lane).theta[0][lane % vector_width]) < std::numbers::pi / 2);
  }
  double arrival(std::size_t lane) const { return passed_[lane] + step_of(lane); }
  double passed(std::size_t lane) const { return passed_[lane]; }

 private:
  Motion<Lanes>& now(std::size_t lane) { return motions_[at_][lane / vector_width]; }
  const Motion<Lanes>& now(std::size_t lane) const { return motions_[at_][lane / vector_width]; }
  const Motion<Lanes>& next(std::size_t lane) const { return motions_[1 - at_][lane / vector_width]; }
  double step_of(std::size_t lane) const { return steps_[lane / vector_width][lane % vector_width]; }
  void move_on() {
    for (std::size_t v = 0; v < vectors; ++v) advance(motions_[at_][v], steps_[v], motions_[1 - at_][v]);
  }
  /// Returns a coefficient of omega - nu.
  double rate_between(std::size_t lane, std::size_t k) const {
    return now(lane).omega[k][lane % vector_width] - now(lane).nu[k][lane % vector_width];
  }
  void set_torque(std::size_t lane, double sign) {
    equations_[lane / vector_width].stance_torque[lane % vector_width] = sign * friction_[lane].first;
    equations_[lane / vector_width].swing_torque[lane % vector_width] = sign * friction_[lane].second;
  }

  void go_on_against_friction() {
    std::array<double, width> sign{};
    for (std::size_t k = 0; k < width; ++k) {
      const double turning = rate_between(k, 0);
      sign[k] = turns_back_[k] ? -sign_[k] : turning > 0 ? 1 : turning < 0 ? -1 : 0;
      set_torque(k, sign[k]);
    }
    expand<true>(motions_[at_], equations_);
    bool held = false;  // a friction that would turn the legs back at once lets them pass this moment
    for (std::size_t k = 0; k < width; ++k)
      if (turns_back_[k] && sign[k] * (rate_between(k, 1)) < 0) {
        set_torque(k, 0);
        held = true;
      }
    if (held) expand<true>(motions_[at_], equations_);
    steps_ = taylor_step_;
    move_on();
    bool cut = false;
    for (std::size_t k = 0; k < width; ++k) {
      const auto time = friction_[k].first != 0 && !turns_back_[k]
                            ? turning_back(now(k), k % vector_width, step_of(k), next(k))
                            : std::optional<double>();
      turns_back_[k] = time.has_value();
      sign_[k] = sign[k];
      if (time) steps_[k / vector_width][k % vector_width] = *time;
      cut = cut || time;
    }
    if (cut) move_on();
  }

  std::array<std::array<Motion<Lanes>, vectors>, 2> motions_;  // start() and advance() set what expand() takes
  std::size_t at_ = 0;                                         // which of them are now
  std::array<Equations<Lanes>, vectors> equations_{};
  std::array<std::pair<double, double>, width> friction_{};
  std::array<double, width> sign_{};
  std::array<double, width> swing_ratio_{};
  std::array<bool, width> turns_back_{};  // at the moment that the series start from
  std::array<Lanes, vectors> steps_{}, taylor_step_{};
  std::array<double, width> passed_{};
  bool hip_ = false;
};

template <class Lanes>
StruckLegs follow_side_by_side(std::span<const LegMotion> from, std::span<const double> slopes,
                               std::span<const LegEquations> equations, std::span<const LegCourse> courses) {
  constexpr std::size_t nobody = legs_at_once, width = Way<Lanes>::width;
  StruckLegs struck;
  Way<Lanes> way(from[0], slopes[0], equations[0], courses[0]);
  std::array<std::size_t, width> walker{};  // of each lane
  std::size_t next = 0;
  const auto set_out = [&](std::size_t lane) {
    walker[lane] = next < from.size() ? next++ : nobody;
    const std::size_t i = walker[lane];
    if (i != nobody) way.set_out(lane, from[i], slopes[i], equations[i], courses[i]);
  };
  for (std::size_t lane = 0; lane < width; ++lane) set_out(lane);
  for (std::size_t left = from.size(); left > 0;) {
    way.go_on();
    std::array<bool, width> done{};
    for (std::size_t lane = 0; lane < width; ++lane) {
      const std::size_t i = walker[lane];
      if (i == nobody) continue;
      struck[i] = way.struck(lane);
      done[lane] = struck[i] || way.lies_down(lane) || !(way.arrival(lane) <= courses[i].longest);
    }
    way.arrive();
    for (std::size_t lane = 0; lane < width; ++lane) {
      if (!done[lane]) continue;
      --left;
      set_out(lane);
    }
  }
  return struck;
}

}  // namespace

StruckLegs follow_legs(std::span<const LegMotion> from, std::span<const double> slopes,
                       std::span<const LegEquations> equations, std::span<const LegCourse> courses) {
  if (from.empty()) return {};
  return from.size() > Way<Four>::width && has_eight_lanes()
             ? follow_side_by_side<Eight>(from, slopes, equations, courses)
             : follow_side_by_side<Four>(from, slopes, equations, courses);
}

LegMotion legs_at(const LegMotion& from, double slope, const LegEquations& equations, double taylor_step, double time) {
  Way<Four> way(from, slope, equations, {taylor_step, time});
  for (way.go_on(); way.arrival(0) < time; way.go_on()) way.arrive();
  return way.after(0, time - way.passed(0));
}

}  // namespace metastable::dynamics
