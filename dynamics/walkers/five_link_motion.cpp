#include "dynamics/walkers/five_link_motion.h"

#include <algorithm>
#include <cmath>

#include "dynamics/walkers/side_by_side.h"

namespace metastable::dynamics {
namespace {

using Five = std::array<double, 5>;

constexpr double longest_step_s = 3, piece_s = 1.0 / 128;
constexpr double lying_rad = 1.2, straight_beyond_rad = -0.5, bent_beyond_rad = 2.5;

#define METASTABLE_INLINE inline __attribute__((always_inline))

/// Holds five numbers, of one walker or of several.
template <class N>
using FiveOf = std::array<N, 5>;

/// Holds a motion with the sines and cosines of its angles.
template <class N>
struct Moving {
  FiveOf<N> angles, rates, sine, cosine;
};

template <class N>
struct Tilt {
  N slope, sine, cosine;
};

template <class N>
struct Torques {
  N stance_knee, swing_knee, stance_hip, swing_hip;
};

// Solves a x = b for a symmetric positive matrix, of which the lower half is read; b becomes x.
template <class N>
METASTABLE_INLINE void solve(std::array<FiveOf<N>, 5>& a, FiveOf<N>& b) {
  FiveOf<N> inverse;
  for (std::size_t j = 0; j < 5; ++j) {
    inverse[j] = 1.0 / a[j][j];
    for (std::size_t i = j + 1; i < 5; ++i) {
      const N factor = a[i][j] * inverse[j];
      for (std::size_t k = j + 1; k <= i; ++k) a[i][k] -= factor * a[k][j];
      b[i] -= factor * b[j];
    }
  }
  for (std::size_t j = 5; j-- > 0;) {
    for (std::size_t i = j + 1; i < 5; ++i) b[j] -= a[i][j] * b[i];
    b[j] *= inverse[j];
  }
}

template <class N>
METASTABLE_INLINE void hold_within_0_1(N& x) {
  const N zero{}, one = zero + 1.0;
  x = x < zero ? zero : x;
  x = x > one ? one : x;
}

template <class N>
METASTABLE_INLINE void drive(const BipedPosture& p, const FiveOf<N>& q, const FiveOf<N>& v, const N& slope,
                             Torques<N>& t) {
  const N stance = 0.5 * (q[stance_shank] + q[stance_thigh]) + slope,
          stance_rate = 0.5 * (v[stance_shank] + v[stance_thigh]);
  const N swing = 0.5 * (q[swing_shank] + q[swing_thigh]) + slope, swing_rate = 0.5 * (v[swing_shank] + v[swing_thigh]);
  const double onward = 0.5 / p.half_step_rad, sooner = 1 / p.swing_share;
  const N way = 0.5 + onward * stance;
  // The knee bends and stretches again, the leg swings across; both twice differentiable.
  N part = way, swung = sooner * way;
  hold_within_0_1<N>(part);
  hold_within_0_1<N>(swung);
  const N both = 4.0 * part * (1.0 - part);
  const N bend = p.lift_rad * both * both * both,
          bending = p.lift_rad * 12.0 * onward * both * both * (1.0 - 2.0 * part) * stance_rate;
  const N rest = swung * (1.0 - swung);
  const N wanted = p.half_step_rad * (1.0 - 2.0 * swung * swung * swung * (10.0 + swung * (6.0 * swung - 15.0))),
          turning = -60.0 * p.half_step_rad * sooner * onward * rest * rest * stance_rate;
  t.stance_knee = p.stance_knee.stiffness * (p.knee_rad - (q[stance_shank] - q[stance_thigh])) -
                  p.stance_knee.damping * (v[stance_shank] - v[stance_thigh]);
  t.swing_knee = p.swing_knee.stiffness * (p.knee_rad + bend - (q[swing_shank] - q[swing_thigh])) +
                 p.swing_knee.damping * (bending - (v[swing_shank] - v[swing_thigh]));
  t.swing_hip = p.swing_leg.stiffness * (wanted - swing) + p.swing_leg.damping * (turning - swing_rate);
  t.stance_hip = p.torso.stiffness * (p.lean_rad - (q[torso] + slope)) - p.torso.damping * v[torso] + t.swing_hip;
}

// Finds accelerations by Lagrange's equations of the chain that stands on one foot.
template <class N>
METASTABLE_INLINE void accelerate(const BipedEquations& e, const Tilt<N>& tilt, const Moving<N>& m, FiveOf<N>& force) {
  Torques<N> t;
  drive<N>(e.posture, m.angles, m.rates, tilt.slope, t);
  force = {t.stance_knee, -t.stance_knee - t.stance_hip, t.stance_hip - t.swing_hip, t.swing_hip - t.swing_knee,
           t.swing_knee};
  std::array<FiveOf<N>, 5> mass;
  for (std::size_t j = 0; j < 5; ++j) {
    force[j] += e.weight[j] * (m.sine[j] * tilt.cosine + m.cosine[j] * tilt.sine);
    mass[j][j] = e.inertia[j][j] + N{};
    for (std::size_t k = 0; k < j; ++k) {
      mass[j][k] = e.inertia[j][k] * (m.cosine[j] * m.cosine[k] + m.sine[j] * m.sine[k]);
      const N turning = e.inertia[j][k] * (m.sine[j] * m.cosine[k] - m.cosine[j] * m.sine[k]);
      force[j] -= turning * m.rates[k] * m.rates[k];
      force[k] += turning * m.rates[j] * m.rates[j];
    }
  }
  solve<N>(mass, force);
}

// Turns angles by what they do in a piece, some 0.1 rad: sines and cosines follow by Taylor's series.
template <class N>
METASTABLE_INLINE void turn(const Moving<N>& from, const FiveOf<N>& by, Moving<N>& to) {
  for (std::size_t j = 0; j < 5; ++j) {
    const N x = by[j], y = x * x;
    const N s = x * (1.0 - y * (1.0 / 6) * (1.0 - y * (1.0 / 20) * (1.0 - y * (1.0 / 42) * (1.0 - y * (1.0 / 72)))));
    const N c =
        1.0 -
        0.5 * y * (1.0 - y * (1.0 / 12) * (1.0 - y * (1.0 / 30) * (1.0 - y * (1.0 / 56) * (1.0 - y * (1.0 / 90)))));
    const N sine = from.sine[j], cosine = from.cosine[j];
    to.angles[j] = from.angles[j] + x;
    to.sine[j] = sine * c + cosine * s;
    to.cosine[j] = cosine * c - sine * s;
  }
}

// Takes one step of Runge and Kutta's method.
template <class N>
METASTABLE_INLINE void run(const BipedEquations& e, const Tilt<N>& tilt, double h, Moving<N>& m) {
  FiveOf<N> by, a, rates = m.rates, turned, gained;
  Moving<N> at = m;
  for (std::size_t j = 0; j < 5; ++j) turned[j] = gained[j] = N{};
  for (int stage = 0; stage < 4; ++stage) {
    accelerate<N>(e, tilt, at, a);
    const double share = stage == 0 || stage == 3 ? h / 6 : h / 3, ahead = stage == 2 ? h : h / 2;
    for (std::size_t j = 0; j < 5; ++j) {
      turned[j] += share * at.rates[j];
      gained[j] += share * a[j];
      by[j] = ahead * at.rates[j];
    }
    if (stage == 3) break;
    turn<N>(m, by, at);
    for (std::size_t j = 0; j < 5; ++j) at.rates[j] = rates[j] + ahead * a[j];
  }
  at = m;
  turn<N>(at, turned, m);
  for (std::size_t j = 0; j < 5; ++j) m.rates[j] = rates[j] + gained[j];
}

METASTABLE_WIDE void run_on(const BipedEquations& e, const Tilt<Four>& tilt, double h, Moving<Four>& m) {
  run<Four>(e, tilt, h, m);
}

METASTABLE_EIGHT_LANES void run_on(const BipedEquations& e, const Tilt<Eight>& tilt, double h, Moving<Eight>& m) {
  run<Eight>(e, tilt, h, m);
}

void run_on(const BipedEquations& e, const Tilt<double>& tilt, double h, Moving<double>& m) {
  run<double>(e, tilt, h, m);
}

Tilt<double> tilt_of(double slope) { return {slope, std::sin(slope), std::cos(slope)}; }

Moving<double> moving(const BipedMotion& m) {
  Moving<double> told{m.angles, m.rates, {}, {}};
  for (std::size_t j = 0; j < 5; ++j) told.sine[j] = std::sin(m.angles[j]), told.cosine[j] = std::cos(m.angles[j]);
  return told;
}

BipedFoot foot_of(const Moving<double>& m) {
  const auto part = [](const auto& of) {
    return of(stance_shank) + of(stance_thigh) - of(swing_thigh) - of(swing_shank);
  };
  return {part([&](std::size_t link) { return m.sine[link]; }), part([&](std::size_t link) { return m.cosine[link]; }),
          part([&](std::size_t link) { return m.rates[link] * m.sine[link]; })};
}

/// Holds one walker under way.
struct Walk {
  std::size_t who = 0;
  int pieces = 0;
  double height = 0;  ///< of the swing foot
  bool done = true;
};

// Finds where in the last piece the foot came down, by Newton's steps from where the chord does, or halved intervals
// where those leave the bracket.
BipedMotion landing(const BipedEquations& e, const Tilt<double>& tilt, const Moving<double>& last, int pieces,
                    double above, double below) {
  double low = 0, high = piece_s, time = piece_s * above / (above - below);
  Moving<double> m;
  for (int i = 0; i < 60; ++i) {
    m = last;
    run_on(e, tilt, time, m);
    const BipedFoot foot = foot_of(m);
    const double there = foot.height;
    if (std::abs(there) < 1e-14 || high - low < 1e-15) break;
    (there > 0 ? low : high) = time;
    const double next = time + there / foot.sinking;
    time = next > low && next < high ? next : 0.5 * (low + high);
  }
  return {pieces * piece_s + time, m.angles, m.rates};
}

template <class Part>
auto lane_of(const Part& part, std::size_t lane) {
  Five five;
  for (std::size_t j = 0; j < 5; ++j) five[j] = part[j][lane];
  return five;
}

template <class Lanes>
Moving<double> lane_of(const Moving<Lanes>& m, std::size_t lane) {
  return {lane_of(m.angles, lane), lane_of(m.rates, lane), lane_of(m.sine, lane), lane_of(m.cosine, lane)};
}

template <class Lanes>
void set_lane(Moving<Lanes>& m, std::size_t lane, const Moving<double>& to) {
  for (std::size_t j = 0; j < 5; ++j) {
    m.angles[j][lane] = to.angles[j];
    m.rates[j][lane] = to.rates[j];
    m.sine[j][lane] = to.sine[j];
    m.cosine[j][lane] = to.cosine[j];
  }
}

// Looks at a walker after a piece: it goes on (and is not done), or has come to the strike that is returned, or fell.
std::optional<BipedMotion> look(const BipedEquations& e, double slope, const Moving<double>& last,
                                const Moving<double>& now, Walk& walk) {
  const auto [ahead, height, sinking] = foot_of(now);
  const BipedMotion motion{0, now.angles, now.rates};
  if (height > 0) {
    walk.height = height;
    walk.done = ++walk.pieces * piece_s >= longest_step_s || !upright(motion);
    return std::nullopt;
  }
  walk.done = true;
  if (!(ahead > 0 && walk.height > 0)) return std::nullopt;
  const BipedMotion struck = landing(e, tilt_of(slope), last, walk.pieces, walk.height, height);
  if (!upright(struck)) return std::nullopt;
  return struck;
}

template <class Lanes>
void follow_side_by_side(const BipedEquations& equations, std::span<const BipedMotion> from,
                         std::span<const double> slopes, std::span<std::optional<BipedMotion>> struck) {
  constexpr std::size_t lanes = sizeof(Lanes) / sizeof(double);
  // As one walker is done, the next takes its lane.
  std::array<Walk, lanes> walks;
  Moving<Lanes> m;
  Tilt<Lanes> tilt;
  for (std::size_t lane = 0; lane < lanes; ++lane) {  // idle lanes stand still, nearly
    set_lane(m, lane, moving({}));
    tilt.slope[lane] = tilt.sine[lane] = 0;
    tilt.cosine[lane] = 1;
  }
  std::size_t begun = 0, done = 0;
  while (true) {
    for (std::size_t lane = 0; lane < lanes && begun < slopes.size(); ++lane) {
      if (!walks[lane].done) continue;
      walks[lane] = {begun, 0, 0, false};
      set_lane(m, lane, moving(from[begun]));
      const Tilt<double> ground = tilt_of(slopes[begun++]);
      tilt.slope[lane] = ground.slope;
      tilt.sine[lane] = ground.sine;
      tilt.cosine[lane] = ground.cosine;
    }
    if (done == slopes.size()) return;
    const Moving<Lanes> last = m;
    run_on(equations, tilt, piece_s, m);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      Walk& walk = walks[lane];
      if (walk.done) continue;
      struck[walk.who] = look(equations, slopes[walk.who], lane_of(last, lane), lane_of(m, lane), walk);
      if (!walk.done) continue;
      ++done;
      set_lane(m, lane, moving({}));
    }
  }
}

}  // namespace

BipedTorques motor_torques(const BipedPosture& posture, const BipedMotion& m, double slope) {
  Torques<double> t;
  drive<double>(posture, m.angles, m.rates, slope, t);
  return {t.stance_knee, t.swing_knee, t.stance_hip, t.swing_hip};
}

bool upright(const BipedMotion& m) {
  const Five& q = m.angles;
  const auto sound = [](double bend) { return bend > straight_beyond_rad && bend < bent_beyond_rad; };
  return std::abs(0.5 * (q[stance_shank] + q[stance_thigh])) < lying_rad && std::abs(q[torso]) < lying_rad &&
         sound(q[stance_shank] - q[stance_thigh]) && sound(q[swing_shank] - q[swing_thigh]);
}

BipedFoot swing_foot(const BipedMotion& motion) { return foot_of(moving(motion)); }

void follow_links(const BipedEquations& equations, std::span<const BipedMotion> from, std::span<const double> slopes,
                  std::span<std::optional<BipedMotion>> struck) {
  if (slopes.size() > 4 && has_eight_lanes())
    follow_side_by_side<Eight>(equations, from, slopes, struck);
  else
    follow_side_by_side<Four>(equations, from, slopes, struck);
}

BipedMotion links_at(const BipedEquations& equations, const BipedMotion& from, double slope, double time,
                     double longest) {
  Moving<double> m = moving(from);
  const Tilt<double> tilt = tilt_of(slope);
  const auto pieces = static_cast<int>(std::ceil(time / std::min(longest, piece_s)));
  for (int i = 0; i < pieces; ++i) run_on(equations, tilt, time / pieces, m);
  return {from.time + time, m.angles, m.rates};
}

}  // namespace metastable::dynamics
