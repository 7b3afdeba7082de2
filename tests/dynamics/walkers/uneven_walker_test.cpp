#include "dynamics/walkers/uneven_walker.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "dynamics/walkers/two_link_walker.h"

namespace metastable::dynamics::test {
namespace {

constexpr double slope = 0.0523;
constexpr std::array<double, 3> gait{0.271028680, -1.09238359, -0.37737395};

struct Step {
  bool fell;
  std::array<double, 3> next;
};
Step step(const UnevenWalker& walker, const std::array<double, 3>& state = gait) {
  Step out{};
  std::uint8_t fell = 0;
  step_uneven({&walker, 1}, state, {&slope, 1}, out.next, {&fell, 1});
  out.fell = fell != 0;
  return out;
}

// Judges by Lagrange's multipliers: both legs as bodies (x, y, angle) and the hip as a point, held together by forces,
// integrated by Runge and Kutta's method; strikes are impulses. Angles and axes as in LegMotion, x uphill.
class HeldBodies {
 public:
  using Vector = Eigen::VectorXd;
  explicit HeldBodies(const UnevenWalker& w) : w_(w) {
    mass_.resize(8);
    mass_ << w.stance.mass, w.stance.mass, 0, w.swing.mass, w.swing.mass, 0, w.hip_mass, w.hip_mass;
  }

  Step step(const std::array<double, 3>& state) const {
    Vector q = placed(state[0], -state[0]), v = moving(q, state[1], state[2]);
    const double h = 1e-3;
    double over = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vector q0 = q, v0 = v;
      advance(q, v, h);
      const double now = height(q);
      if (q[2] < 0 && q[5] > 0 && over > 0 && now <= 0) {
        double low = 0, high = h;
        for (int k = 0; k < 45; ++k) {
          const double middle = 0.5 * (low + high);
          q = q0;
          v = v0;
          advance(q, v, middle);
          (height(q) > 0 ? low : high) = middle;
        }
        return {false, struck(q, v)};
      }
      if (std::abs(q[2]) > 1.6) break;
      over = now;
    }
    return {true, {}};
  }

 private:
  static Eigen::Vector2d along(double angle) { return {std::sin(angle), std::cos(angle)}; }
  static Eigen::Vector2d across(double angle) { return {std::cos(angle), -std::sin(angle)}; }
  Vector placed(double stance, double swing) const {
    Vector q(8);
    const Eigen::Vector2d hip = w_.stance.length() * along(stance);
    q << w_.stance.foot_to_mass * along(stance), stance, hip - w_.swing.mass_to_hip * along(swing), swing, hip;
    return q;
  }
  Vector moving(const Vector& q, double stance, double swing) const {
    Vector v(8);
    const Eigen::Vector2d hip = w_.stance.length() * stance * across(q[2]);
    v << w_.stance.foot_to_mass * stance * across(q[2]), stance, hip - w_.swing.mass_to_hip * swing * across(q[5]),
        swing, hip;
    return v;
  }
  double height(const Vector& q) const { return q[7] - w_.swing.length() * std::cos(q[5]); }
  // Rates of: the standing foot, and the hip as the end of either leg.
  Eigen::MatrixXd jacobian(const Vector& q, bool on_first) const {
    Eigen::MatrixXd g = Eigen::MatrixXd::Zero(6, 8);
    const Eigen::Index at = on_first ? 0 : 3;
    const double foot = on_first ? w_.stance.foot_to_mass : w_.swing.foot_to_mass;
    g.block(0, at, 2, 2).setIdentity();
    g.block(0, at + 2, 2, 1) = -foot * across(q[at + 2]);
    for (const Eigen::Index leg : {0, 1}) {
      g.block(2 + 2 * leg, 3 * leg, 2, 2).setIdentity();
      g.block(2 + 2 * leg, 3 * leg + 2, 2, 1) =
          (leg == 0 ? w_.stance.mass_to_hip : w_.swing.mass_to_hip) * across(q[3 * leg + 2]);
      g.block(2 + 2 * leg, 6, 2, 2) = -Eigen::Matrix2d::Identity();
    }
    return g;
  }
  Vector solved(const Eigen::MatrixXd& g, const Vector& force, const Vector& wanted) const {
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(14, 14);
    all.topLeftCorner(8, 8) = mass_.asDiagonal();
    all.topRightCorner(8, 6) = g.transpose();
    all.bottomLeftCorner(6, 8) = g;
    Vector right(14);
    right << force, wanted;
    return all.partialPivLu().solve(right).head(8);
  }
  Vector acceleration(const Vector& q, const Vector& v) const {
    Vector force(8), turning(6);
    const double torque = w_.hip_damping * (v[2] - v[5]) + std::copysign(w_.hip_friction, v[2] - v[5]);
    for (const Eigen::Index at : {0, 3, 6})
      force.segment(at, 2) = -w_.gravity * mass_[at] * Eigen::Vector2d(std::sin(slope), std::cos(slope));
    force[2] = -torque;
    force[5] = torque;
    // The constraints want the centripetal accelerations of the legs' ends, with the sign changed.
    turning << -w_.stance.foot_to_mass * v[2] * v[2] * along(q[2]), w_.stance.mass_to_hip * v[2] * v[2] * along(q[2]),
        w_.swing.mass_to_hip * v[5] * v[5] * along(q[5]);
    return solved(jacobian(q, true), force, turning);
  }
  void advance(Vector& q, Vector& v, double h) const {
    const Vector a1 = acceleration(q, v), v2 = v + h / 2 * a1, a2 = acceleration(q + h / 2 * v, v2);
    const Vector v3 = v + h / 2 * a2, a3 = acceleration(q + h / 2 * v2, v3), v4 = v + h * a3;
    const Vector a4 = acceleration(q + h * v3, v4);
    q += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  std::array<double, 3> struck(const Vector& q, const Vector& v) const {
    const Vector after = solved(jacobian(q, false), mass_.cwiseProduct(v), Vector::Zero(6));
    return {0.5 * (q[5] - q[2]), after[5], after[2]};
  }

  UnevenWalker w_;
  Vector mass_;
};

void expect_as_held(const UnevenWalker& walker, double tolerance) {
  const Step told = step(walker), held = HeldBodies(walker).step(gait);
  ASSERT_FALSE(told.fell);
  ASSERT_FALSE(held.fell);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(told.next[i], held.next[i], tolerance) << i;
}

// As the legs pass each other, the foot of the shorter one comes down beside the other: that is no strike, and legs
// that differ by nothing to speak of walk as equal ones. One step in ten of these was another one, 1e-12 rad long, so
// that a length in a model cost it tens of nats.
TEST(UnevenWalker, NearlyEqualLegsWalkAsEqualOnes) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> normal;
  int others = 0;
  constexpr int steps = 4000;
  for (int i = 0; i < steps; ++i) {
    const std::array<double, 3> state{0.28 + 0.03 * normal(engine), -1.1 + 0.1 * normal(engine),
                                      -0.34 + 0.1 * normal(engine)};
    UnevenWalker walker;
    const Step equal = step(walker, state);
    (i % 2 == 0 ? walker.stance : walker.swing).foot_to_mass += i % 4 < 2 ? 1e-12 : -1e-12;
    const Step nearly = step(walker, state);
    bool same = equal.fell == nearly.fell;
    for (std::size_t k = 0; k < 3 && same && !equal.fell; ++k) same = std::abs(equal.next[k] - nearly.next[k]) < 1e-6;
    others += !same;
  }
  EXPECT_LE(others, steps / 1000) << "but for feet that graze the ground";
}

TEST(UnevenWalker, WithEqualLegsIsTheCompassGait) {
  const TwoLinkWalker compass = TwoLinkWalker::compass();
  const std::vector<double> states{0.27, -1.09, -0.38, 0.3, -1.3, -0.1, 0.2, -0.4, 0.1};
  const std::vector<Ground> grounds{{0.05, 0.05}, {0.08, 0.08}, {0.02, 0.02}};
  std::vector<double> expected(9), next(9);
  std::vector<std::uint8_t> expected_fell(3), fell(3);
  compass.step(states, grounds, expected, expected_fell);
  step_uneven(std::vector<UnevenWalker>(3), states, std::vector{0.05, 0.08, 0.02}, next, fell);
  EXPECT_EQ(fell, expected_fell);
  EXPECT_EQ(expected_fell.back(), 1) << "a slow one falls back";
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(next[i], expected[i], 1e-13);
}

TEST(UnevenWalker, IsWhatHeldBodiesDo) {
  UnevenWalker uneven;
  uneven.stance = {5.5, 0.47, 0.53};
  uneven.swing = {4.6, 0.52, 0.48};
  expect_as_held(uneven, 1e-8);
  std::swap(uneven.stance, uneven.swing);
  expect_as_held(uneven, 1e-8);
  UnevenWalker damped;
  damped.hip_damping = 0.4;
  expect_as_held(damped, 1e-8);
  uneven.hip_damping = 0.2;
  expect_as_held(uneven, 1e-8);
}

TEST(UnevenWalker, HasAHipWithDryFriction) {
  UnevenWalker dry;
  dry.hip_friction = 0.5;
  expect_as_held(dry, 1e-3);  // the judge steps across the turning back
  dry.hip_damping = 0.1;
  expect_as_held(dry, 1e-3);
  EXPECT_GT(std::abs(step(dry).next[0] - step(UnevenWalker{}).next[0]), 2e-3);
}

TEST(UnevenWalker, LosesAndSlipsAtTheStrike) {
  UnevenWalker walker;
  const Step plain = step(walker);
  walker.impact_loss = 0.19;
  const Step lost = step(walker);
  EXPECT_NEAR(lost.next[1], 0.9 * plain.next[1], 1e-14);
  EXPECT_NEAR(lost.next[2], 0.9 * plain.next[2], 1e-14);
  walker = {};
  walker.foot_slip = 0.01;
  EXPECT_NEAR(2 * (std::sin(step(walker).next[0]) - std::sin(plain.next[0])), 0.01, 1e-14);
}

TEST(UnevenWalker, FallsFromStatesThatAreNone) {
  for (const std::array<double, 3>& state : {std::array{-0.1, -1.0, 0.0}, {1.6, -1.0, 0.0}, {0.2, NAN, 0.0}})
    EXPECT_TRUE(step({}, state).fell);
}

TEST(UnevenWalker, DoesNotDependOnItsNeighbours) {
  UnevenWalker other;
  other.stance.mass_to_hip = other.swing.mass_to_hip = 0.3;
  other.hip_friction = 1;
  std::vector<UnevenWalker> many(20, other);  // These are more than go side by side.
  many.back() = UnevenWalker{};
  std::vector<double> states;
  for (std::size_t i = 0; i + 1 < many.size(); ++i)
    states.insert(states.end(), {0.2 + 0.003 * static_cast<double>(i), -1.2, 0.1});
  states.insert(states.end(), gait.begin(), gait.end());
  std::vector<double> next(states.size());
  std::vector<std::uint8_t> fell(many.size());
  step_uneven(many, states, std::vector(many.size(), slope), next, fell);
  const Step alone = step(UnevenWalker{});
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(next[next.size() - 3 + i], alone.next[i]);
}

}  // namespace
}  // namespace metastable::dynamics::test
