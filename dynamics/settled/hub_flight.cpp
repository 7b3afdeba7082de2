#include "dynamics/settled/hub_flight.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace metastable::dynamics {
namespace {

// The time for which a foot that lifts without speed is let go [s]; how far the wheel turns between two looks at
// where its tips are [rad].
constexpr double lift_off = 1e-6, steady_turn = 0.1;

// The looks at one tip in one flight. 10 to 20 find where it touches; more than this many say that numbers do not
// resolve it.
constexpr int most_looks = 10000;

// Returns sine and cosine, without the library's where the angle is small: hops ask for many.
std::pair<double, double> sine_cosine(double angle) {
  if (std::abs(angle) > 0.06) return {std::sin(angle), std::cos(angle)};
  const double q = angle * angle;
  return {angle * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72)))),
          1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56 * (1 - q / 90))))};
}

// Returns a stretch of flight in which no legs but those looked at may touch: while the wheel turns by one leg none of
// the others does, and none at all before a hub that is higher than legs are long is down again.
Flight stretch(const SettledWheel& wheel, const FlyingHub& hub) {
  const double spin = hub.spin, out = hub.out;
  const double longest_leg = *std::ranges::max_element(wheel.leg_length);
  Flight flight;
  flight.lasts = wheel.leg_angle() / std::max(1e-3, std::abs(spin));
  flight.high = hub.height > longest_leg * (1 + 1e-9);
  if (flight.high) {
    const double above = hub.height - longest_leg, root = std::sqrt(out * out + 2 * hub.press * above);
    flight.lasts = out > 0 ? (out + root) / hub.press : 2 * above / (root - out);
  }
  if (wheel.drags()) {
    flight.lasts = std::min(flight.lasts, 1e-3);
    flight.slowing =
        -wheel.drag(spin - wheel.drag(spin) / wheel.gyration_sq() * flight.lasts / 2) / wheel.gyration_sq();
  }
  return flight;
}

// Finds when the tip of a leg touches; a time that is not before flight.lasts if it does not, and nothing where too
// many looks do not find it. The tip can fall no faster than at `fall` for a while; advancing by the time that takes
// never misses a touch.
// @param lifts  the tip is leaving the plane, where it is exactly
std::optional<double> touch_in(const SettledWheel& wheel, const FlyingHub& hub, const Flight& flight, int leg,
                               bool lifts) {
  const double spin = hub.spin, out = hub.out, press = hub.press;
  const double slowing = flight.slowing, lasts = flight.lasts;
  const double length = wheel.length(leg), angle = hub.angle - (leg - hub.leg) * wheel.leg_angle();
  const double sine = std::sin(angle), cosine = std::cos(angle);
  const double gap0 = lifts ? 0 : std::max(0.0, hub.height - length * cosine - wheel.tip_radius);
  double t = 0;
  for (int looks = 0; t < lasts; ++looks) {
    if (looks == most_looks) return std::nullopt;
    const double by = t * (spin + slowing * t / 2);
    const auto [half_sine, half_cosine] = sine_cosine(by / 2);
    const double gap =
        gap0 + t * (out - press * t / 2) + 2 * length * (sine * half_cosine + cosine * half_sine) * half_sine;
    const double turned = sine + 2 * half_sine * (cosine * half_cosine - sine * half_sine);
    const double speed = out - press * t + (spin + slowing * t) * length * turned;
    if (gap <= 0 && speed < 0) break;
    if (lifts && t == 0 && speed < wheel.rest_speed) {
      t = lift_off;
      continue;
    }
    if (lifts && gap <= 0 && t == lift_off) break;
    const double lean = std::abs(angle + by) + steady_turn;
    const double fall =
        std::max(0.05 * press, press - length * spin * spin * (1 - lean * lean / 2) + length * std::abs(slowing));
    const double above = std::max(gap, 0.0), rate = std::sqrt(speed * speed + 2 * fall * above);
    const double safe = speed > 0 ? (speed + rate) / fall : 2 * above / (rate - speed);
    if (speed < 0 && safe <= 1e-15 * t) break;
    t += std::min(safe, steady_turn / std::max(1e-3, std::abs(spin)));
  }
  return t;
}

}  // namespace

Flight next_flight(const SettledWheel& wheel, const FlyingHub& hub, std::span<const int> lifting) {
  const int reach = wheel.legs() < 5 ? 1 : 2;
  Flight flight = stretch(wheel, hub);
  const auto look = [&](int leg, bool lifts) {
    const std::optional<double> when = touch_in(wheel, hub, flight, leg, lifts);
    if (!when)
      flight.lost = true;
    else if (*when < flight.lasts)
      flight.lasts = *when, flight.touches = leg;
  };
  for (const int leg : lifting) look(leg, true);
  const int lowest = hub.leg + static_cast<int>(std::lround(hub.angle / wheel.leg_angle()));
  for (int leg = lowest - reach; leg <= lowest + reach && !flight.high; ++leg)
    if (std::ranges::find(lifting, leg) == lifting.end()) look(leg, false);
  return flight;
}

}  // namespace metastable::dynamics
