#include "dynamics/walkers/five_link_biped.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

constexpr double usual_slope = 1 * degree;

// Shifts the gait's state by as much as slopes of some degrees do.
std::vector<double> shifted(std::vector<double> state, double by) {
  constexpr std::array<double, 9> direction{0.2, -0.3, 0.2, 0.3, -1, 1.5, 0.8, -1, 1.2};
  for (std::size_t i = 0; i < 9; ++i) state[i] += by * direction[i];
  return state;
}

struct Landing {
  bool fell;
  std::vector<double> next;
};
Landing stepped(const FiveLinkBiped& biped, const std::vector<double>& state, double ground = usual_slope) {
  Landing landing{false, std::vector<double>(9)};
  std::uint8_t fell = 0;
  biped.step(state, {&ground, 1}, landing.next, {&fell, 1});
  landing.fell = fell != 0;
  return landing;
}

/// A body of the chain: its centre and joint, forward and up from the stance foot, and velocities.
struct Body {
  double mass, inertia, rate, x, y, vx, vy;
};

/// Walks along the chain from foot to hip and down the other leg, as one would with a ruler.
class Ruler {
 public:
  Ruler(const FiveLinkBiped& biped, const BipedMotion& m) : o_(biped.options()), m_(m) {
    const double l = o_.segment_length;
    body(stance_shank, o_.shank, l - o_.shank.joint_to_mass);
    go(stance_shank, l);
    knee = here_;
    body(stance_thigh, o_.thigh, l - o_.thigh.joint_to_mass);
    go(stance_thigh, l);
    hip = here_;
    body(torso, o_.torso, o_.torso.joint_to_mass);
    body(swing_thigh, o_.thigh, -o_.thigh.joint_to_mass);
    go(swing_thigh, -l);
    swing_knee = here_;
    body(swing_shank, o_.shank, -o_.shank.joint_to_mass);
    go(swing_shank, -l);
    foot = here_;
  }
  double kinetic() const {
    double sum = 0;
    for (const Body& b : bodies_) sum += 0.5 * b.mass * (b.vx * b.vx + b.vy * b.vy) + 0.5 * b.inertia * b.rate * b.rate;
    return sum;
  }
  double potential() const {
    double sum = 0;
    for (const Body& b : bodies_)
      sum += o_.gravity * b.mass * (b.y * std::cos(usual_slope) - b.x * std::sin(usual_slope));
    return sum;
  }
  /// Returns the angular momentum, turning forward, of some links about a point.
  double momentum(const std::vector<std::size_t>& links, const std::array<double, 4>& about) const {
    double sum = 0;
    for (const std::size_t i : links) {
      const Body& b = bodies_[i];
      sum += b.inertia * b.rate + b.mass * ((b.y - about[1]) * b.vx - (b.x - about[0]) * b.vy);
    }
    return sum;
  }
  std::array<double, 4> knee{}, hip{}, swing_knee{}, foot{};  ///< x, y, and their rates

 private:
  std::array<double, 4> ahead(std::size_t link, double by) const {
    const double s = std::sin(m_.angles[link]), c = std::cos(m_.angles[link]), v = m_.rates[link];
    return {here_[0] + by * s, here_[1] + by * c, here_[2] + by * c * v, here_[3] - by * s * v};
  }
  void go(std::size_t link, double by) { here_ = ahead(link, by); }
  void body(std::size_t link, const BipedLink& of, double by) {
    const auto [x, y, vx, vy] = ahead(link, by);
    bodies_[link] = {of.mass, of.inertia, m_.rates[link], x, y, vx, vy};
  }
  BipedOptions o_;
  BipedMotion m_;
  std::array<double, 4> here_{};
  std::array<Body, 5> bodies_{};
};

TEST(FiveLinkBiped, MotorsDoWhatTheEnergyGains) {
  const FiveLinkBiped biped;
  for (const double by : {0.0, 0.1, -0.15}) {
    const auto state = shifted(biped.gait(usual_slope), by);
    const auto before = biped.before_strike(state, usual_slope);
    ASSERT_TRUE(before) << by;
    BipedMotion m = biped.motion(state);
    const double start = biped.energy(m, usual_slope);
    constexpr int pieces = 2000;
    const double h = before->time / pieces;
    double work = 0;
    for (int i = 0; i <= pieces; ++i) {  // by Simpson's rule
      const double power = biped.power(m, biped.torques(m, usual_slope));
      work += h / 3 * (i == 0 || i == pieces ? 1 : i % 2 == 1 ? 4 : 2) * power;
      if (i < pieces) m = biped.moved(m, usual_slope, h, h);
    }
    EXPECT_GT(std::abs(work), 1);
    EXPECT_NEAR(biped.energy(m, usual_slope) - start, work, 1e-6) << by;
    const Ruler ruler(biped, m);
    EXPECT_NEAR(biped.energy(m, usual_slope), ruler.kinetic() + ruler.potential(), 1e-10);
  }
}

TEST(FiveLinkBiped, StrikesKeepMomentaAboutEveryJoint) {
  const FiveLinkBiped biped;
  for (const double by : {0.0, 0.1, -0.15}) {
    const auto before = biped.before_strike(shifted(biped.gait(usual_slope), by), usual_slope);
    ASSERT_TRUE(before) << by;
    const BipedMotion struck = biped.strike(*before);
    const Ruler old(biped, *before), now(biped, struck);
    EXPECT_NEAR(old.foot[1], 0, 1e-12);
    EXPECT_NEAR(now.foot[0], -old.foot[0], 1e-12) << "the legs have changed their parts";
    EXPECT_GT(now.foot[3], 0) << "the foot that leaves goes up";
    EXPECT_LT(now.kinetic(), old.kinetic());
    const auto same = [&](const std::vector<std::size_t>& before_links, const std::array<double, 4>& before_point,
                          const std::vector<std::size_t>& links, const std::array<double, 4>& point) {
      EXPECT_NEAR(now.momentum(links, point), old.momentum(before_links, before_point), 1e-10);
    };
    same({0, 1, 2, 3, 4}, old.foot, {0, 1, 2, 3, 4}, {});
    same({0, 1, 2, 3}, old.swing_knee, {1, 2, 3, 4}, now.knee);
    same({0, 1}, old.hip, {3, 4}, now.hip);
    same({torso}, old.hip, {torso}, now.hip);
    same({stance_shank}, old.knee, {swing_shank}, now.swing_knee);
  }
}

TEST(FiveLinkBiped, ComesBackToItsGait) {
  const FiveLinkBiped biped;
  for (const double ground : {0.5 * degree, usual_slope, 3 * degree}) {
    const std::vector<double> gait = biped.gait(ground);
    std::vector<double> state = shifted(gait, 0.1);
    for (int i = 0; i < 70; ++i) {
      const Landing landing = stepped(biped, state, ground);
      ASSERT_FALSE(landing.fell);
      state = landing.next;
    }
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(state[i], gait[i], 1e-8) << i;
  }
  EXPECT_THROW(biped.gait(-4 * degree), std::domain_error) << "uphill";
}

TEST(FiveLinkBiped, StatesAreMotions) {
  const FiveLinkBiped biped;
  const auto state = shifted(biped.gait(usual_slope), 0.4);
  const BipedMotion m = biped.motion(state);
  EXPECT_NEAR(biped.swing_foot(m)[1], 0, 1e-15);
  EXPECT_LT(biped.swing_foot(m)[0], -0.2);
  const auto told = biped.state(m);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(told[i], state[i], 1e-15) << i;
  EXPECT_EQ(FiveLinkBiped::names().size(), 9u);
}

TEST(FiveLinkBiped, PiecesOfTheMapAreShortEnough) {
  const FiveLinkBiped biped;
  for (const double by : {0.0, 0.15, -0.15}) {
    const auto state = shifted(biped.gait(usual_slope), by);
    const auto before = biped.before_strike(state, usual_slope);
    ASSERT_TRUE(before) << by;
    const BipedMotion fine = biped.moved(biped.motion(state), usual_slope, before->time, 1e-3);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_NEAR(before->angles[i], fine.angles[i], 2e-5);
      EXPECT_NEAR(before->rates[i], fine.rates[i], 5e-4);
    }
  }
}

TEST(FiveLinkBiped, FallsWhereItCannotWalk) {
  const FiveLinkBiped biped;
  const std::vector<double> gait = biped.gait(usual_slope);
  EXPECT_TRUE(stepped(biped, gait, -12 * degree).fell) << "it falls back";
  std::vector<double> slow = gait;
  for (std::size_t i = 4; i < 9; ++i) slow[i] *= 0.3;
  EXPECT_TRUE(stepped(biped, slow).fell);
  BipedOptions stiff;
  stiff.posture.lift_rad = -0.2;
  EXPECT_TRUE(stepped(FiveLinkBiped(stiff), gait).fell) << "it scuffs";
}

TEST(FiveLinkBiped, DoesNotDependOnItsNeighbours) {
  const FiveLinkBiped biped;
  const std::vector<double> gait = biped.gait(usual_slope), other = shifted(gait, 0.1);
  std::vector<double> both(other), next(18);
  both.insert(both.end(), gait.begin(), gait.end());
  std::vector<std::uint8_t> fell(2);
  biped.step(both, std::vector{2 * degree, usual_slope}, next, fell);
  const Landing alone = stepped(biped, gait);
  EXPECT_EQ(fell, std::vector<std::uint8_t>(2));
  EXPECT_TRUE(std::ranges::equal(std::span(next).last(9), alone.next));
}

TEST(FiveLinkBiped, NamesWhatIsOutOfRange) {
  BipedOptions options;
  options.thigh.mass = 0;
  EXPECT_THROW(FiveLinkBiped{options}, std::invalid_argument);
  options = {};
  options.posture.swing_share = 1.1;
  EXPECT_THROW(FiveLinkBiped{options}, std::invalid_argument);
  const FiveLinkBiped biped;
  std::vector<double> state = biped.gait(usual_slope);
  EXPECT_THROW(stepped(biped, state, std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
  state[0] = -0.1;
  EXPECT_THROW(stepped(biped, state), std::invalid_argument);
  std::vector<double> next(9);
  std::vector<std::uint8_t> fell(2);
  EXPECT_THROW(biped.step(state, std::vector{usual_slope}, next, fell), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::dynamics::test
