#include "dynamics/laboratory/rod_walker.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include "dynamics/walkers/uneven_walker.h"

namespace metastable::dynamics::test {
namespace {

constexpr double slope = 0.0523;
constexpr RodStride gait{0.271028680, -1.09238359, -0.37737395};

// Draws states around the gait, on slopes around its own. There the model's Taylor series are good to 1e-8.
struct Drawn {
  RodStride state;
  double slope;
};
std::vector<Drawn> draws(int count) {
  std::mt19937_64 generator(5);
  const auto uniform = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(generator() >> 11) * 0x1p-53;
  };
  std::vector<Drawn> all;
  for (int i = 0; i < count; ++i)
    all.push_back({{uniform(0.2, 0.32), uniform(-1.35, -0.85), uniform(-0.9, 0.1)}, uniform(0.02, 0.09)});
  return all;
}

// Holds the worst difference of a step in the laboratory from the model's, over the states drawn in which both walk.
struct Agreement {
  int walked = 0, fell = 0, torn = 0;  // torn: one walks, with legs well apart, and the other falls
  double worst = 0;
};
Agreement agreement(const UnevenWalker& model, const RodWalkerOptions& real, int stance, int count = 100) {
  Agreement found;
  for (const Drawn& d : draws(count)) {
    const std::array<double, 3> state{d.state.half_angle, d.state.stance_rate, d.state.swing_rate};
    std::array<double, 3> next{};
    std::uint8_t fell = 0;
    step_uneven({&model, 1}, state, {&d.slope, 1}, next, {&fell, 1});
    RodWalker walker(real, stance, d.state);
    const bool walked = walker.step(d.slope);
    // A walker whose legs come together as it falls back takes one last step in one of the two.
    const double half = fell == 0 ? next[0] : walker.stride().half_angle;
    if (walked != (fell == 0) && half > 0.1) ++found.torn;
    if (!walked || fell != 0) {
      ++found.fell;
      continue;
    }
    ++found.walked;
    if (walker.time() > 1.5) continue;  // it nearly fell back: what rounding leaves has grown
    const RodStride to = walker.stride();
    found.worst = std::max({found.worst, std::abs(to.half_angle - next[0]), std::abs(to.stance_rate - next[1]),
                            std::abs(to.swing_rate - next[2])});
  }
  return found;
}

void expect_agreement(const UnevenWalker& model, const RodWalkerOptions& real, double tolerance, int stance = 0) {
  const Agreement found = agreement(model, real, stance);
  EXPECT_GT(found.walked, 25);
  EXPECT_EQ(found.torn, 0);
  EXPECT_LT(found.worst, tolerance);
}

TEST(RodWalker, WithoutEffectsStepsAsTheModelDoes) {
  expect_agreement({}, {}, 1e-8);
  EXPECT_GT(agreement({}, {}, 0).fell, 5) << "falls are among them";
}

TEST(RodWalker, StepsAsTheModelDoesWithEachEffect) {
  for (const auto& [of_model, of_reality, size] :
       {std::tuple{&UnevenWalker::hip_damping, &RodWalkerOptions::hip_damping, 0.4},
        {&UnevenWalker::hip_friction, &RodWalkerOptions::hip_friction, 0.8},
        {&UnevenWalker::impact_loss, &RodWalkerOptions::impact_loss, 0.07},
        {&UnevenWalker::foot_slip, &RodWalkerOptions::foot_slip, 0.02}}) {
    UnevenWalker model;
    RodWalkerOptions real;
    model.*of_model = size;
    real.*of_reality = size;
    expect_agreement(model, real, 1e-8);
  }
}

TEST(RodWalker, StepsAsTheModelDoesOnLegsThatDiffer) {
  RodWalkerOptions real;
  real.legs[0] = {6, 0.55, 0.45};
  const WalkerLeg heavy{6, 0.55, 0.45};
  UnevenWalker model;
  model.stance = heavy;
  expect_agreement(model, real, 1e-8, 0);
  std::swap(model.stance, model.swing);
  expect_agreement(model, real, 1e-8, 1);
}

TEST(RodWalker, StepsAsTheModelDoesOnLegsOfUnequalLength) {
  for (const double longer : {0.02, -0.03}) {
    RodWalkerOptions real;
    real.legs[0].foot_to_mass += longer;
    real.foot_slip = 0.01;
    UnevenWalker model;
    model.stance.foot_to_mass += longer;
    model.foot_slip = 0.01;
    expect_agreement(model, real, 3e-8, 0);
    std::swap(model.stance, model.swing);
    expect_agreement(model, real, 3e-8, 1);
  }
}

void expect_energy_kept(const RodWalkerOptions& options, double relative) {
  RodWalker walker(options, 0, gait);
  const double before = walker.energy(slope);
  walker.move(slope, 0.6);
  EXPECT_NEAR(walker.energy(slope), before, relative * std::abs(before));
}

TEST(RodWalker, KeepsTheEnergyBetweenStrikes) { expect_energy_kept({}, 1e-10); }

TEST(RodWalker, SpringAndLoadKeepTheEnergy) {
  RodWalkerOptions real;
  real.hip_spring = 4;
  real.load_mass = 1.5;
  real.foot_radius = 0.1;
  expect_energy_kept(real, 1e-9);
}

TEST(RodWalker, ADampedHipTakesEnergy) {
  RodWalkerOptions real;
  real.hip_damping = 0.4;
  RodWalker walker(real, 0, gait);
  const double before = walker.energy(slope);
  walker.move(slope, 0.6);
  EXPECT_LT(walker.energy(slope), before - 0.1);
}

double momentum(const std::vector<RodPoint>& points, double x, double y) {
  double sum = 0;
  for (const RodPoint& p : points) sum += p.mass * ((p.x - x) * p.vy - (p.y - y) * p.vx);
  return sum;
}

// The place of the foot that strikes next, and the points just before the strike and just after it.
struct Strike {
  double foot = 0;
  std::vector<RodPoint> before, after;
};

Strike struck(RodWalker& walker) {
  EXPECT_TRUE(walker.reach_strike(slope));
  Strike found{walker.swing_foot(), walker.points(), {}};
  walker.strike();
  found.after = walker.points();
  return found;
}

TEST(RodWalker, AStrikeKeepsTheMomentaAboutTheStruckFootAndOfTheNewSwingLegAboutTheHip) {
  RodWalkerOptions real;
  real.legs[1] = {4, 0.6, 0.4};
  RodWalker walker(real, 0, gait);
  const auto [foot, before, after] = struck(walker);
  EXPECT_NEAR(walker.position(), foot, 1e-12);
  EXPECT_NEAR(momentum(after, foot, 0), momentum(before, foot, 0), 1e-12 * std::abs(momentum(before, foot, 0)));
  const auto of_leg = [](const std::vector<RodPoint>& p) { return momentum({p[1]}, p[0].x, p[0].y); };
  EXPECT_NEAR(of_leg(after), of_leg(before), 1e-12);
}

TEST(RodWalker, TheLoadPullsAlongItsCordAtAStrike) {
  // The load's momentum across its cord stays: a cord has no other impulse.
  RodWalkerOptions real;
  real.load_mass = 2;
  RodWalker walker(real, 0, gait);
  ASSERT_TRUE(walker.reach_strike(slope));
  const RodPoint hip = walker.points()[0], before = walker.points()[3];
  walker.strike();
  const RodPoint after = walker.points()[3];
  const double dx = before.x - hip.x, dy = before.y - hip.y;
  EXPECT_NEAR(std::hypot(dx, dy), 0.25, 1e-12);
  EXPECT_NEAR(dx * after.vy - dy * after.vx, dx * before.vy - dy * before.vx, 1e-12);
  EXPECT_GT(std::hypot(after.vx - before.vx, after.vy - before.vy), 0.01);
}

TEST(RodWalker, RoundFeetRoll) {
  // A wheel's rim keeps the hip's speed: the rounder the feet, the less a strike takes.
  double last = 0;
  for (const double radius : {0.0, 0.2, 0.6}) {
    RodWalkerOptions real;
    real.foot_radius = radius;
    RodWalker walker(real, 0, gait);
    ASSERT_TRUE(walker.reach_strike(slope));
    const double before = walker.energy(slope);
    walker.strike();
    const double kept = walker.energy(slope) - before;
    EXPECT_LT(kept, 0);
    if (radius > 0) {
      EXPECT_GT(kept, last);
    }
    last = kept;
  }
}

TEST(RodWalker, OutsideEffectsChangeAStepAndVanishWithTheirSize) {
  RodWalker ideal({}, 0, gait);
  ASSERT_TRUE(ideal.step(slope));
  for (double RodWalkerOptions::*const size :
       {&RodWalkerOptions::foot_radius, &RodWalkerOptions::hip_spring, &RodWalkerOptions::drive_torque,
        &RodWalkerOptions::load_mass, &RodWalkerOptions::sway}) {
    double change[2];
    for (const int i : {0, 1}) {
      RodWalkerOptions real;
      real.*size = i == 0 ? 0.01 : 0.001;
      RodWalker walker(real, 0, gait);
      ASSERT_TRUE(walker.step(slope));
      change[i] = std::abs(walker.stride().stance_rate - ideal.stride().stance_rate);
    }
    EXPECT_GT(change[0], 1e-6);
    EXPECT_NEAR(change[0] / change[1], 10, 1.5);
  }
}

std::array<double, 3> after_steps(const RodWalkerOptions& options, int steps) {
  RodWalker walker(options, 0, gait);
  for (int i = 0; i < steps; ++i) EXPECT_TRUE(walker.step(slope + (i % 2 == 0 ? 0.004 : -0.003)));
  const RodStride s = walker.stride();
  return {s.half_angle, s.stance_rate, s.swing_rate};
}

// Holds rows against those of the rigid knee: with a tenth of the compliance a tenth of the difference stays.
void expect_knee_stiffens_to(const RodWalkerOptions& rigid, int steps) {
  const std::array<double, 3> ideal = after_steps(rigid, steps);
  RodWalkerOptions loose = rigid, stiff = rigid;
  loose.knee_compliance = 1e-4;
  stiff.knee_compliance = 1e-5;
  const std::array<double, 3> more = after_steps(loose, steps), less = after_steps(stiff, steps);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(more[i] - ideal[i]), 2e-3) << i;
    EXPECT_NEAR(less[i] - ideal[i], 0.1 * (more[i] - ideal[i]), 0.02 * std::abs(more[i] - ideal[i]) + 1e-7) << i;
  }
  EXPECT_GT(std::abs(more[2] - ideal[2]), 1e-4);
}

TEST(RodWalker, AKneeThatStiffensBecomesTheRigidLeg) {
  expect_knee_stiffens_to({}, 1);
  expect_knee_stiffens_to({}, 5);
}

TEST(RodWalker, AKneeThatStiffensBecomesTheRigidLegBesideAllOtherEffects) {
  RodWalkerOptions real;
  real.legs[0] = {5.2, 0.5, 0.498};
  real.hip_damping = 0.05;
  real.hip_friction = 0.05;
  real.impact_loss = 0.01;
  real.foot_slip = 0.005;
  real.hip_spring = 0.5;
  real.load_mass = 0.5;
  expect_knee_stiffens_to(real, 2);
}

TEST(RodWalker, AKneeBelowTheLeastComplianceIsRigid) {
  RodWalkerOptions real;
  real.knee_compliance = 0.9e-7;
  EXPECT_EQ(after_steps(real, 2), after_steps({}, 2));
}

TEST(RodWalker, IsPutDownOnAKneeWithTheRatesOfALockedOne) {
  RodWalkerOptions real;
  real.knee_compliance = 1e-3;
  const RodWalker walker(real, 1, gait);
  EXPECT_NEAR(walker.stride().half_angle, gait.half_angle, 1e-14);
  EXPECT_NEAR(walker.stride().stance_rate, gait.stance_rate, 1e-12);
  EXPECT_NEAR(walker.stride().swing_rate, gait.swing_rate, 1e-12);
}

TEST(RodWalker, AKneeTakesEnergyByItsDamperAlone) {
  RodWalkerOptions real;
  real.knee_compliance = 2e-3;
  RodWalker walker(real, 0, gait);
  ASSERT_TRUE(walker.step(slope));  // the knee bends fast after a strike
  const double damping = 2 * std::sqrt(5 / real.knee_compliance) * 0.25, time = 1e-4;
  const double before = walker.energy(slope);
  double last = before, taken = 0;
  for (int i = 0; i < 4000; ++i) {
    const double first = walker.knee()[1];
    walker.move(slope, time);
    const double end = walker.knee()[1];
    taken += 0.5 * time * damping * (first * first + end * end);
    EXPECT_LT(walker.energy(slope), last + 1e-10);
    last = walker.energy(slope);
  }
  EXPECT_GT(taken, 0.01);
  EXPECT_NEAR(before - last, taken, 1e-3 * taken);
}

// Hip and other leg keep their momentum about the knee, and the whole walker keeps its own about the struck foot.
TEST(RodWalker, AStrikeBearsNoMomentAtAKneeThatGives) {
  RodWalkerOptions real;
  real.knee_compliance = 1e-3;
  RodWalker walker(real, 0, gait);
  const auto [foot, before, after] = struck(walker);
  const auto above = [](const std::vector<RodPoint>& p) { return momentum({p[0], p[1]}, p[2].x, p[2].y); };
  EXPECT_NEAR(above(after), above(before), 1e-12 * std::abs(above(before)));
  EXPECT_NEAR(momentum(after, foot, 0), momentum(before, foot, 0), 1e-12 * std::abs(momentum(before, foot, 0)));
  EXPECT_NEAR(walker.knee()[0], 0, 1e-12);
  EXPECT_GT(std::abs(walker.knee()[1]), 0.1);
}

TEST(RodWalker, AKneeFarTooSoftFoldsAndTheWalkerFalls) {
  RodWalkerOptions real;
  real.knee_compliance = 0.1;  // the 196 N above it buckle a knee in the middle of 1 m from 0.02 rad/(N m) on
  RodWalker walker(real, 0, gait);
  int steps = 0;
  while (steps < 20 && walker.step(slope)) ++steps;
  EXPECT_LT(steps, 20);
}

}  // namespace
}  // namespace metastable::dynamics::test
