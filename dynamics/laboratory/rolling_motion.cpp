#include "dynamics/laboratory/rolling_motion.h"

#include <algorithm>
#include <array>
#include <boost/math/tools/toms748_solve.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {
namespace {

namespace odeint = boost::numeric::odeint;
using RollingState = std::array<double, 3>;  // angle, speed, fluid's speed
using Stepper = odeint::runge_kutta_fehlberg78<RollingState>;

constexpr double patience = 60;  // [s]: a wheel balancing this long on one leg is at rest

double root(const auto& value, double at_zero, double step, double at_step) {
  if (at_zero == 0) return 0;
  std::uintmax_t iterations = 80;
  const auto [low, high] = boost::math::tools::toms748_solve(value, 0.0, step, at_zero, at_step,
                                                             boost::math::tools::eps_tolerance<double>(48), iterations);
  return (low + high) / 2;
}

Point toward(double angle, double length) { return {-length * std::sin(angle), -length * std::cos(angle)}; }

class Stance {
 public:
  Stance(const RollingBody& body, const RampSurface& surface, const Pose& start, double inertia)
      : body_(body), surface_(surface), start_(start), inertia_(inertia_about_foot(body, start, inertia)) {}

  void operator()(const RollingState& s, RollingState& rate, double) const {
    const Point arm = arm_at(s[0]);
    const double coupling = body_.fluid_coupling * (s[1] - s[2]);
    const double drag = body_.constant_drag + body_.linear_drag * s[1] + body_.quadratic_drag * s[1] * s[1];
    // Gravity is (sin, -cos) of the slope in these axes, about the foot; turning down the ramp counts positive.
    const double weight =
        body_.mass * body_.gravity * (arm.x * std::cos(body_.slope_rad) + arm.z * std::sin(body_.slope_rad));
    rate = {s[1], (weight - drag - coupling) / inertia_, body_.fluid_inertia > 0 ? coupling / body_.fluid_inertia : 0};
  }

  // Returns the state some time later, by one step of the method.
  RollingState after(const RollingState& from, double began, double time) const {
    if (!(time > 0)) return from;
    RollingState s{};
    Stepper().do_step(std::cref(*this), from, began, s, time);
    return s;
  }
  Pose pose(const RollingState& s) const { return {start_.foot, start_.leg, s[0], s[1], s[2]}; }
  // Says how high the next leg's tip is over the surface.
  double clearance(const RollingState& s) const {
    const Point at = tip(body_, pose(s), (start_.leg + 1) % body_.legs());
    return at.z - surface_.height(at.x);
  }
  // Returns what the ground's reaction normal to the surface is, over the mass [m/s^2].
  double reaction(const RollingState& s) const {
    RollingState rate{};
    (*this)(s, rate, 0);
    const Point arm = arm_at(s[0]);
    // The centre of mass accelerates as it turns at speed s[1] down the ramp about the foot.
    const Point acceleration{rate[1] * arm.z - s[1] * s[1] * arm.x, -rate[1] * arm.x - s[1] * s[1] * arm.z};
    const double rise = surface_.rise(start_.foot.x);
    return (acceleration.z + body_.gravity * std::cos(body_.slope_rad)) * std::cos(rise) -
           (acceleration.x - body_.gravity * std::sin(body_.slope_rad)) * std::sin(rise);
  }
  double inertia() const { return inertia_; }

 private:
  Point arm_at(double angle) const {
    const Point c = centre_of_mass(body_, {start_.foot, start_.leg, angle});
    return {c.x - start_.foot.x, c.z - start_.foot.z};
  }

  const RollingBody& body_;
  const RampSurface& surface_;
  Pose start_;
  double inertia_;
};

enum class StepEnd { none, turns_back, touches, lifts };

// Finds what happens first in a step of the stance from one state to another: it turns back, the next foot touches, or,
// where wheels fly, the old one lifts; and the time until then [s].
std::pair<StepEnd, double> end_of_step(const Stance& stance, const RollingState& from, const RollingState& to,
                                       double began, double step, bool flight) {
  std::pair<StepEnd, double> end{StepEnd::none, step};
  const auto look = [&](StepEnd kind, const auto& value) {
    if (value(from) <= 0 || value(to) > 0) return;
    const auto later = [&](double time) { return value(stance.after(from, began, time)); };
    const double when = root(later, value(from), step, value(to));
    if (end.first == StepEnd::none || when < end.second) end = {kind, when};
  };
  look(StepEnd::turns_back, [](const RollingState& s) { return s[1]; });
  look(StepEnd::touches, [&](const RollingState& s) { return stance.clearance(s); });
  if (!flight) return end;
  look(StepEnd::lifts, [&](const RollingState& s) { return stance.reaction(s); });
  return began == 0 && stance.reaction(from) <= 0 ? std::pair(StepEnd::lifts, 0.0) : end;
}

// From the pose at which the foot lifts the centre of mass follows its parabola and the wheel turns evenly.
Touch fly(const RollingBody& body, const RampSurface& surface, const Pose& lift, double energy, const auto& note) {
  const Point c = centre_of_mass(body, lift);
  const Point arm{c.x - lift.foot.x, c.z - lift.foot.z};
  const Point velocity{lift.speed * arm.z, -lift.speed * arm.x};
  const Point pull{body.gravity * std::sin(body.slope_rad), -body.gravity * std::cos(body.slope_rad)};
  // Returns the pose at time t: the old foot moves with the body.
  const auto at = [&](double t) {
    Pose pose = lift;
    pose.angle_rad += lift.speed * t;
    pose.foot = {0, 0};
    const Point free = centre_of_mass(body, pose);
    pose.foot = {c.x + velocity.x * t + pull.x * t * t / 2 - free.x,
                 c.z + velocity.z * t + pull.z * t * t / 2 - free.z};
    return pose;
  };
  const int next = (lift.leg + 1) % body.legs();
  const auto clearance = [&](double t, int leg) {
    const Point p = tip(body, at(t), leg);
    return p.z - surface.height(p.x);
  };
  constexpr double step = 5e-4;
  double old_foot = 0;  // it starts on the surface: it counts once it has left
  for (double t = 0; t < patience; t += step) {
    for (const int leg : {next, lift.leg}) {
      const double from = leg == lift.leg ? old_foot : clearance(t, leg);
      const double to = clearance(t + step, leg);
      if (from > 0 && to <= 0) {
        const double passage = root([&](double s) { return clearance(t + s, leg); }, clearance(t, leg), step, to);
        Touch touch;
        touch.end = RollEnd::touch;
        touch.time = t + passage;
        touch.leg = leg;
        touch.before = at(touch.time);
        touch.turn_rad = lift.speed * touch.time;
        touch.flew = true;
        const Point now{velocity.x + pull.x * touch.time, velocity.z + pull.z * touch.time};
        const Point foot = tip(body, touch.before, leg), mass = centre_of_mass(body, touch.before);
        const Point lever{foot.x - mass.x, foot.z - mass.z};
        touch.tip_velocity = {now.x + lift.speed * lever.z, now.z - lift.speed * lever.x};
        touch.energy = energy + body.mass / 2 *
                                    (now.x * now.x + now.z * now.z - velocity.x * velocity.x - velocity.z * velocity.z);
        return touch;
      }
    }
    old_foot = clearance(t + step, lift.leg);
    note(t + step, lift.speed * (t + step), lift.speed);
  }
  throw std::runtime_error("roll_on: a flying wheel does not come down");
}

}  // namespace

double RollingBody::leg_angle() const { return 2 * std::numbers::pi / legs(); }

Point hub(const RollingBody& body, const Pose& pose) {
  const Point leg = toward(pose.angle_rad, body.leg_length[static_cast<std::size_t>(pose.leg)]);
  return {pose.foot.x - leg.x, pose.foot.z - leg.z};
}

Point tip(const RollingBody& body, const Pose& pose, int leg) {
  if (leg == pose.leg) return pose.foot;
  const Point centre = hub(body, pose);
  const Point along =
      toward(pose.angle_rad - (leg - pose.leg) * body.leg_angle(), body.leg_length[static_cast<std::size_t>(leg)]);
  return {centre.x + along.x, centre.z + along.z};
}

Point centre_of_mass(const RollingBody& body, const Pose& pose) {
  const Point centre = hub(body, pose);
  if (body.offset == 0) return centre;
  const Point off = toward(pose.angle_rad + pose.leg * body.leg_angle() - body.offset_angle_rad, body.offset);
  return {centre.x + off.x, centre.z + off.z};
}

double inertia_about_foot(const RollingBody& body, const Pose& pose, double inertia) {
  const double length = body.leg_length[static_cast<std::size_t>(pose.leg)];
  const Point c = centre_of_mass(body, pose);
  const double x = c.x - pose.foot.x, z = c.z - pose.foot.z;
  return inertia + body.mass * (x * x + z * z - length * length);
}

Touch touch_standing(const RollingBody& body, const Pose& pose, double inertia) {
  Touch touch;
  touch.end = RollEnd::touch;
  touch.leg = (pose.leg + 1) % body.legs();
  touch.before = pose;
  const Point at = tip(body, pose, touch.leg);
  touch.tip_velocity = {pose.speed * (at.z - pose.foot.z), -pose.speed * (at.x - pose.foot.x)};
  touch.energy = inertia_about_foot(body, pose, inertia) * pose.speed * pose.speed / 2;
  return touch;
}

Touch roll_on(const RollingBody& body, const RampSurface& surface, const Pose& start, double inertia,
              std::vector<Moment>* moments) {
  const auto note = [moments](double time, double turn, double speed) {
    if (moments) moments->push_back({time, turn, speed});
  };
  const Stance stance(body, surface, start, inertia);
  RollingState state{start.angle_rad, start.speed, start.fluid_speed};
  double time = 0;
  // Steps are small against the pendulum's time and against a radian: the method is of order 8.
  const double length = body.leg_length[static_cast<std::size_t>(start.leg)];
  const double pendulum_time = std::sqrt(stance.inertia() / (body.mass * body.gravity * length));
  note(0, 0, start.speed);
  const auto rest_at = [](const Pose& pose, double when) {
    Touch touch;
    touch.time = when;
    touch.leg = pose.leg;
    touch.before = pose;
    return touch;
  };
  if (!(start.speed > 0)) return rest_at(start, 0);
  while (time < patience) {
    const RollingState from = state;
    const double began = time;
    const double step = std::min(0.08 * pendulum_time, 0.1 / std::max(1e-3, std::abs(from[1])));
    state = stance.after(from, began, step);
    time = began + step;
    const auto [end, after] = end_of_step(stance, from, state, began, step, body.flight);
    if (end == StepEnd::none) {
      note(time, state[0] - start.angle_rad, state[1]);
      continue;
    }
    const RollingState at = stance.after(from, began, after);
    const double when = began + after, turn = at[0] - start.angle_rad;
    note(when, turn, at[1]);
    if (end == StepEnd::turns_back) return rest_at(stance.pose(at), when);
    Touch touch = end == StepEnd::touches
                      ? touch_standing(body, stance.pose(at), inertia)
                      : fly(body, surface, stance.pose(at), stance.inertia() * at[1] * at[1] / 2,
                            [&](double t, double turned_on, double speed) { note(when + t, turn + turned_on, speed); });
    touch.time += when;
    touch.turn_rad += turn;
    return touch;
  }
  return rest_at(stance.pose(state), time);
}

std::vector<Moment> run_up(const RollingBody& body, const RampSurface& surface, const Pose& end, double inertia,
                           double seconds) {
  const Stance stance(body, surface, end, inertia);
  std::vector<Moment> moments{{0, 0, end.speed}};
  RollingState state{end.angle_rad, end.speed, end.fluid_speed};
  constexpr double step = 0.005;
  for (double time = 0; time > -seconds;) {
    const double length = std::min(step, seconds + time);
    RollingState earlier{};
    Stepper().do_step(std::cref(stance), state, time, earlier, -length);
    time -= length;
    if (earlier[1] <= 0 || earlier[0] < end.angle_rad - body.leg_angle()) break;
    state = earlier;
    moments.push_back({time, state[0] - end.angle_rad, state[1]});
  }
  std::reverse(moments.begin(), moments.end());
  return moments;
}

Pose landing_pose(const RollingBody& body, const RampSurface& surface, int leg, double along, double speed) {
  Pose pose;
  pose.leg = (leg + body.legs() - 1) % body.legs();
  pose.speed = pose.fluid_speed = speed;
  // The stance foot stands uphill; the angle puts the landing tip onto the surface: it is found with the foot at the
  // origin, where the chord must point along the line between both feet.
  const auto chord = [&](double angle) {
    Pose trial;
    trial.leg = pose.leg;
    trial.angle_rad = angle;
    return tip(body, trial, leg);
  };
  const auto value = [&](double angle) {
    const Point c = chord(angle);
    return c.z - (surface.height(along) - surface.height(along - c.x));
  };
  const double low = 0, high = body.leg_angle();
  pose.angle_rad = low + root([&](double part) { return value(low + part); }, value(low), high - low, value(high));
  const Point c = chord(pose.angle_rad);
  pose.foot = {along - c.x, surface.height(along - c.x)};
  return pose;
}

}  // namespace metastable::dynamics
