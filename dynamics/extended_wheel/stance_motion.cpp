#include "dynamics/extended_wheel/stance_motion.h"

#include <cmath>
#include <limits>

namespace metastable::dynamics {
namespace {

double longest_step(double pendulum) { return std::sqrt(2 / pendulum) / 64; }

StanceState runge_kutta(double pendulum, StanceState s, double h) {
  const auto acceleration = [pendulum](double angle) { return -0.5 * pendulum * std::cos(angle); };
  const double v1 = s.speed, a1 = acceleration(s.angle);
  const double v2 = s.speed + h / 2 * a1, a2 = acceleration(s.angle + h / 2 * v1);
  const double v3 = s.speed + h / 2 * a2, a3 = acceleration(s.angle + h / 2 * v2);
  const double v4 = s.speed + h * a3, a4 = acceleration(s.angle + h * v3);
  return {s.angle + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), s.speed + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)};
}

}  // namespace

StanceState stance_motion(double pendulum, StanceState start, double time) {
  const double steps = std::ceil(std::abs(time) / longest_step(pendulum));
  const double h = steps > 0 ? time / steps : 0;
  for (double i = 0; i < steps; ++i) start = runge_kutta(pendulum, start, h);
  return start;
}

std::pair<double, double> stance_passage(double pendulum, StanceState start, double angle) {
  const double h = longest_step(pendulum);
  double time = 0;
  for (StanceState now = start; now.speed > 0; time += h) {
    const StanceState next = runge_kutta(pendulum, now, h);
    if (next.angle < angle) {
      now = next;
      continue;
    }
    double low = 0, high = h;
    while (high - low > 1e-12) {
      const double middle = (low + high) / 2;
      (runge_kutta(pendulum, now, middle).angle < angle ? low : high) = middle;
    }
    return {time + high, runge_kutta(pendulum, now, high).speed};
  }
  return {std::numeric_limits<double>::infinity(), 0};
}

}  // namespace metastable::dynamics
