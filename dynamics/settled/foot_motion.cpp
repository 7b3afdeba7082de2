#include "dynamics/settled/foot_motion.h"

#include <algorithm>
#include <cmath>

namespace metastable::dynamics {
namespace {

constexpr int order = TimeSeries::order;
using Terms = std::array<double, order + 1>;

double product(const Terms& a, const Terms& b, int k) {
  double sum = 0;
  for (int j = 0; j <= k; ++j) sum += a[static_cast<std::size_t>(j)] * b[static_cast<std::size_t>(k - j)];
  return sum;
}

}  // namespace

double TimeSeries::at(double time) const {
  double sum = term[order];
  for (std::size_t k = order; k-- > 0;) sum = sum * time + term[k];
  return sum;
}

double TimeSeries::rate(double time) const {
  double sum = order * term[order];
  for (std::size_t k = order; k-- > 1;) sum = sum * time + static_cast<double>(k) * term[k];
  return sum;
}

double TimeSeries::falls_below_zero(double end) const {
  constexpr int parts = 4;
  double low = 0, high = end;
  bool found = false;
  for (int i = 1; i <= parts && !found; ++i) {
    const double t = end * i / parts;
    if (at(t) < 0)
      high = t, found = true;
    else
      low = t;
  }
  if (!found) return end + 1;
  if (low == 0 && term[0] <= 0) {
    // It starts at 0, and is positive for a while or falls at once.
    double t = high;
    for (int halvings = 0; at(t) <= 0; ++halvings) {
      if (halvings == 40) return 0;
      high = t;
      t /= 2;
    }
    low = t;
  }
  // Newton's steps are kept inside the bracket.
  double t = (low + high) / 2;
  for (int i = 0; i < 100 && high - low > 1e-16 * end; ++i) {
    const double value = at(t);
    (value < 0 ? high : low) = t;
    const double slope = rate(t), next = t - value / slope;
    const bool inside = next > low && next < high;
    const double moved = std::abs(next - t);
    t = inside ? next : (low + high) / 2;
    if (inside && moved <= 1e-16 * end) break;
  }
  return t;
}

FootState FootMotion::at(double time) const { return {angle.at(time), spin.at(time), slip.at(time), along.at(time)}; }

FootForces foot_forces(const Footing& footing, double angle, double spin) {
  const SettledWheel& wheel = *footing.wheel;
  const double ahead = footing.length * std::sin(angle), upright = footing.length * std::cos(angle);
  const double height = upright + wheel.tip_radius, brake = wheel.drags() ? wheel.drag(spin) : 0;
  FootForces f;
  double rate = 0;
  if (footing.way == 0) {
    f.stiffness = wheel.gyration_sq() + height * height + ahead * ahead;
    rate =
        (wheel.tip_radius * ahead * spin * spin + height * footing.pull + ahead * footing.press - brake) / f.stiffness;
  } else {
    const double arm = ahead + footing.way * footing.friction * height;
    f.stiffness = wheel.gyration_sq() + ahead * arm;
    rate = (arm * (footing.press - upright * spin * spin) - brake) / f.stiffness;
  }
  f.normal = footing.press - ahead * rate - upright * spin * spin;
  f.tangential = footing.way == 0 ? height * rate - ahead * spin * spin - footing.pull
                                  : -footing.way * footing.friction * f.normal;
  return f;
}

FootMotion Footing::from(const FootState& state) const {
  FootMotion m;
  const double radius = wheel->tip_radius, k2 = wheel->gyration_sq();
  const bool drags = wheel->drags();
  const double side = state.spin < 0 ? -1 : 1;
  Terms &a = m.angle.term, &w = m.spin.term, &u = m.slip.term, &x = m.along.term;
  Terms &normal = m.normal.term, &tangential = m.tangential.term, &stiffness = m.stiffness.term;
  Terms sine{}, cosine{}, ahead{}, upright{}, height{}, square{}, centrifugal{}, arm{}, thrust{}, rate{}, turn{};
  a[0] = state.angle, w[0] = state.spin, u[0] = way == 0 ? 0 : state.slip, x[0] = state.along;
  for (int n = 0; n <= order; ++n) {
    const auto k = static_cast<std::size_t>(n);
    const double unit = n == 0 ? 1 : 0;
    if (n == 0) {
      sine[0] = std::sin(a[0]), cosine[0] = std::cos(a[0]);
    } else {
      turn[k - 1] = n * a[k];
      sine[k] = product(turn, cosine, n - 1) / n;
      cosine[k] = -product(turn, sine, n - 1) / n;
    }
    ahead[k] = length * sine[k], upright[k] = length * cosine[k], height[k] = upright[k] + unit * radius;
    square[k] = product(w, w, n);
    centrifugal[k] = product(upright, square, n);
    const double outward = product(ahead, square, n);
    double moment = 0;
    if (way == 0) {
      stiffness[k] = unit * (k2 + length * length + radius * radius) + 2 * radius * upright[k];
      moment = radius * outward + height[k] * pull + ahead[k] * press;
    } else {
      arm[k] = ahead[k] + way * friction * height[k];
      thrust[k] = unit * press - centrifugal[k];
      stiffness[k] = unit * k2 + product(ahead, arm, n);
      moment = product(arm, thrust, n);
    }
    if (drags)
      moment -=
          (unit * side * wheel->constant_drag + wheel->linear_drag * w[k] + side * wheel->quadratic_drag * square[k]) /
          wheel->mass;
    rate[k] = 0;
    rate[k] = (moment - product(stiffness, rate, n)) / stiffness[0];
    normal[k] = unit * press - product(ahead, rate, n) - centrifugal[k];
    const double hub = product(height, rate, n) - outward;
    tangential[k] = way == 0 ? hub - unit * pull : -way * friction * normal[k];
    if (n == order) break;
    a[k + 1] = w[k] / (n + 1);
    w[k + 1] = rate[k] / (n + 1);
    u[k + 1] = way == 0 ? 0 : (tangential[k] + unit * pull - hub) / (n + 1);
    x[k + 1] = (u[k] + radius * w[k]) / (n + 1);
  }
  // The last two terms tell how far the series reach (Jorba and Zou, Experimental Mathematics 14, 2005).
  double reach = 1;
  for (const TimeSeries* s : {&m.angle, &m.spin, &m.slip})
    for (int n : {order - 1, order}) {
      const double last = std::abs(s->term[static_cast<std::size_t>(n)]);
      if (last > 0) reach = std::min(reach, std::pow(wheel->tolerance / last, 1.0 / n));
    }
  m.horizon = reach;
  return m;
}

}  // namespace metastable::dynamics
