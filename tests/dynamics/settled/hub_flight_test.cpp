#include "dynamics/settled/hub_flight.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace metastable::dynamics {
namespace {

SettledWheel wheel_of(double length) {
  SettledWheel wheel;
  wheel.leg_length.assign(8, length);
  wheel.tip_radius = 0;
  return wheel;
}

// Follows stretches of flight until a tip touches; the time that takes.
double flown(const SettledWheel& wheel, FlyingHub hub, int& leg) {
  double time = 0;
  for (int stretch = 0; stretch < 10000; ++stretch) {
    const Flight flight = next_flight(wheel, hub, {});
    EXPECT_FALSE(flight.lost);
    time += flight.lasts;
    if (flight.touches) {
      leg = *flight.touches;
      return time;
    }
    hub.angle += flight.lasts * (hub.spin + flight.slowing * flight.lasts / 2);
    hub.height += flight.lasts * (hub.out - hub.press * flight.lasts / 2);
    hub.out -= hub.press * flight.lasts;
    hub.spin += flight.slowing * flight.lasts;
  }
  ADD_FAILURE() << "no tip touches";
  return time;
}

// A hub without spin falls as a stone does: from d above the leg's length it takes sqrt(2 d / g), and v / g there and
// back where it is thrown up from a tip that hardly misses the plane.
TEST(HubFlight, WithoutSpinItIsThatOfAStone) {
  const SettledWheel wheel = wheel_of(0.15);
  for (const double above : {1e-6, 0.01, 2.0}) {
    int leg = -9;
    EXPECT_NEAR(flown(wheel, {4, 0, 0.15 + above, 0, 0, 9.7}, leg), std::sqrt(2 * above / 9.7), 1e-9) << above;
    EXPECT_EQ(leg, 4);
  }
  int leg = -9;
  EXPECT_NEAR(flown(wheel, {4, 0, 0.15 + 1e-12, 1.94, 0, 9.7}, leg), 2 * 1.94 / 9.7, 1e-9);
  EXPECT_EQ(leg, 4);
}

// A hub that neither rises nor falls for a moment lets the next leg come down: that leg's tip reaches the plane where
// cos(a - 2 pi / 8) is the height over the length.
TEST(HubFlight, AWheelThatTurnsFastLandsOnTheNextLeg) {
  const SettledWheel wheel = wheel_of(0.15);
  const double height = 0.1499, press = 1e-3, spin = 50;  // gravity moves the hub by next to nothing meanwhile
  const double touch = wheel.leg_angle() - std::acos(height / 0.15);
  int leg = -9;
  const double start = 0.1;
  EXPECT_NEAR(flown(wheel, {0, start, height, 0, spin, press}, leg), (touch - start) / spin, 1e-6);
  EXPECT_EQ(leg, 1);
}

// A tip that leaves the plane is at it exactly, and does not touch there.
TEST(HubFlight, TheFeetThatLiftDoNotTouchAtOnce) {
  const SettledWheel wheel = wheel_of(0.15);
  const std::array<int, 1> lifting{2};
  const Flight flight = next_flight(wheel, {2, 0, 0.15, 1, 0, 9.7}, lifting);
  EXPECT_EQ(flight.touches, 2);
  EXPECT_NEAR(flight.lasts, 2 / 9.7, 1e-9);
}

}  // namespace
}  // namespace metastable::dynamics
