#include "dynamics/laboratory/impulse_collision.h"

#include <algorithm>
#include <array>
#include <boost/math/tools/toms748_solve.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace metastable::dynamics {
namespace {

namespace odeint = boost::numeric::odeint;

// Holds speed out of the surface, speed down the ramp, normal work absorbed and given back, friction's charge.
using State = std::array<double, 5>;

// Holds friction's impulse per normal impulse (down the ramp) and its charge per impulse and sliding speed.
struct Mode {
  double ratio = 0, charged = 0;
};

// Says how the contact point answers an impulse: force through the centre of mass plus the turn it gives the body.
class Body {
 public:
  explicit Body(const Impact& impact)
      : mass_(impact.mass),
        spin_(impact.mass * impact.gyration * impact.gyration),
        arm_x_(impact.behind),
        arm_y_(-impact.above) {}
  // Returns {up, along} per unit of normal impulse with `ratio` of it along.
  std::pair<double, double> response(double ratio) const {
    const double turn = (arm_x_ * 1 - arm_y_ * ratio) / spin_;  // arm x impulse
    return {1 / mass_ + turn * arm_x_, ratio / mass_ - turn * arm_y_};
  }
  // Returns the ratio that keeps the point from sliding.
  double holding() const {
    const double driven = response(0).second;
    return -driven / (response(1).second - driven);
  }

 private:
  double mass_, spin_, arm_x_, arm_y_;
};

// Follows the collision as it unfolds.
class March {
 public:
  March(const Impact& impact, const Body& body)
      : impact_(impact), body_(body), state_{-impact.approach, impact.along, 0, 0, 0} {}

  // Goes on until sliding stops (if it is watched for) or the collision is over.
  void run(const Mode& mode, bool until_sliding_stops) {
    const auto [rise, drift] = body_.response(mode.ratio);
    const double sense = state_[1];
    const bool stops = until_sliding_stops && sense * drift < 0;
    if (!(rise > 0) && !stops) {
      jammed = over = true;
      return;
    }
    const double size = std::abs(impact_.approach) + std::abs(impact_.along) + std::abs(state_[0]);
    const double step = size / (std::abs(rise) + std::abs(drift)) / 8;
    while (!over) {
      const bool opening = state_[0] >= 0;
      const State next = advanced(mode, step);
      // Each of these rises through zero once within a step.
      const auto stopped = [sense](const State& s) { return sense > 0 ? -s[1] : s[1]; };
      const auto turned = [](const State& s) { return s[0]; };
      const auto given_back = [this](const State& s) { return balance(s); };
      double length = step;
      enum { none, stop, turn, end } event = none;
      const auto look = [&](const auto& watch, auto kind) {
        if (!(watch(next) >= 0)) return;
        const double at = passage(mode, step, watch);
        if (event == none || at < length) length = at, event = kind;
      };
      if (stops) look(stopped, stop);
      if (!opening)
        look(turned, turn);
      else
        look(given_back, end);
      state_ = event == none ? next : advanced(mode, length);
      impulse += length;
      if (event == turn) state_[0] = 0;
      over = event == end || (event == turn && balance(state_) >= 0);
      if (event == stop) {
        state_[1] = 0;
        return;
      }
    }
  }

  double absorbed() const { return state_[2]; }
  double released() const { return state_[3]; }
  double charge() const { return state_[4]; }
  double up() const { return state_[0]; }

  double impulse = 0;
  bool over = false, jammed = false;

 private:
  double balance(const State& s) const { return s[3] - impact_.restitution * impact_.restitution * s[2]; }

  State advanced(const Mode& mode, double length) const {
    const auto [rise, drift] = body_.response(mode.ratio);
    const bool opening = state_[0] >= 0;
    const auto equations = [&, rise = rise, drift = drift](const State& s, State& rate, double) {
      rate = {rise, drift, opening ? 0 : -s[0], opening ? s[0] : 0, mode.charged * s[1]};
    };
    odeint::runge_kutta4<State> stepper;
    State out = state_;
    stepper.do_step(equations, out, 0.0, length);
    return out;
  }

  template <class Watch>
  double passage(const Mode& mode, double step, const Watch& watch) const {
    const auto value = [&](double length) { return watch(length > 0 ? advanced(mode, length) : state_); };
    const double at_start = value(0);
    if (at_start >= 0) return 0;
    std::uintmax_t iterations = 60;
    const auto [low, high] = boost::math::tools::toms748_solve(
        value, 0.0, step, at_start, value(step), boost::math::tools::eps_tolerance<double>(50), iterations);
    return (low + high) / 2;
  }

  const Impact& impact_;
  const Body& body_;
  State state_;
};

}  // namespace

ImpactWork integrate_impact(const Impact& impact) {
  const Body body(impact);
  March march(impact, body);
  const double mu = impact.friction;
  if (impact.along != 0) {
    const double ratio = impact.along > 0 ? -mu : mu;
    march.run({ratio, -ratio}, true);
  }
  const double before_charge = march.charge(), before_impulse = march.impulse, up = march.up();
  const bool stopped = !march.over;
  if (stopped) {
    const double holding = body.holding();
    if (impact.law == Law::published) {
      // A foot that did not slide before counts as one that slid uphill.
      const double ratio = impact.along > 0 ? mu : -mu;
      march.run({ratio, ratio}, false);
    } else if (std::abs(holding) <= mu) {
      march.run({holding, 0}, false);
    } else {
      const double ratio = holding > 0 ? mu : -mu;
      march.run({ratio, -ratio}, false);
    }
  }
  ImpactWork work;
  work.normal = march.absorbed() - march.released();
  work.released = march.released();
  work.friction = march.charge();
  work.jammed = march.jammed;
  if (impact.law != Law::published || march.jammed) return work;

  // Compression takes half of the time, evenly in impulse; so does restitution.
  const double whole = closed_time(impact.stiffness, impact.contact_mass, impact.restitution);
  double before = stopped ? 0 : whole;
  if (stopped && impact.along != 0) before = whole / 2 * (1 + up / impact.approach / (up > 0 ? impact.restitution : 1));
  double uphill = 0;
  if (before_impulse > 0) uphill += before_charge / before_impulse * before;
  if (march.impulse > before_impulse)
    uphill -= (march.charge() - before_charge) / (march.impulse - before_impulse) * (whole - before);
  if (impact.along > 0) uphill = -uphill;
  work.potential = impact.mass * impact.gravity * uphill * std::sin(impact.slope_rad);
  return work;
}

double closed_time(double stiffness, double mass, double restitution) {
  // Finds the damping ratio whose rebound is `restitution` of the approach; time in units of sqrt(mass / stiffness).
  const double log_rebound = -std::log(std::max(restitution, std::numeric_limits<double>::min()));
  const double damping = log_rebound / std::hypot(std::numbers::pi, log_rebound);
  using Oscillator = std::array<double, 2>;
  const auto equations = [damping](const Oscillator& s, Oscillator& rate, double) {
    rate = {s[1], -s[0] - 2 * damping * s[1]};
  };
  odeint::runge_kutta_fehlberg78<Oscillator> stepper;
  Oscillator state{0, 1};
  // It is linear: the state may be scaled after every step, so that strong damping does not fade it out.
  constexpr double step = 0.125;
  for (double time = 0;; time += step) {
    Oscillator next{};
    stepper.do_step(equations, state, 0.0, next, step);
    if (next[0] <= 0 && state[0] > 0) {
      const auto value = [&](double length) {
        Oscillator at{};
        stepper.do_step(equations, state, 0.0, at, length);
        return at[0];
      };
      std::uintmax_t iterations = 60;
      const auto [low, high] = boost::math::tools::toms748_solve(
          value, 0.0, step, state[0], next[0], boost::math::tools::eps_tolerance<double>(50), iterations);
      return (time + (low + high) / 2) * std::sqrt(mass / stiffness);
    }
    const double size = std::hypot(next[0], next[1]);
    state = {next[0] / size, next[1] / size};
  }
}

}  // namespace metastable::dynamics
