#include "dynamics/laboratory/laboratory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "dynamics/return_map/trials.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

LaboratorySetup paper_setup(Law law = Law::published) {
  LaboratorySetup setup;
  setup.law = law;
  setup.restitution_mean = 0.54, setup.restitution_sd = 0.045;
  setup.friction_mean = 0.352, setup.friction_sd = 0.043;
  setup.flight = false;
  setup.max_collisions = 16;
  setup.conditions = {{9.59 * degree, 3.66, 5.83, 0.28, 6}, {7.02 * degree, 3.66, 7.35, 0.19, 1}};
  for (std::size_t t = 0; t < 24; ++t) setup.order.push_back(t % 2);
  return setup;
}

std::vector<LaboratoryTrial> run_all(const LaboratorySetup& setup) {
  const Laboratory lab(setup);
  std::vector<LaboratoryTrial> trials;
  for (std::size_t t = 0; t < setup.order.size(); ++t) trials.push_back(lab.run(t));
  return trials;
}

Effect effect(const std::string& text) {
  const LaboratorySetup s = paper_setup();
  return effect_from_text(text,
                          {s.restitution_mean, s.restitution_sd, s.friction_mean, s.friction_sd, s.wheel.leg_length});
}

// Compares, without effects and collision by collision, two ways that share no formula.
void compare_with_return_map(const LaboratorySetup& setup) {
  int compared = 0, rests = 0;
  for (const LaboratoryTrial& trial : run_all(setup)) {
    const LaboratoryCondition& condition = setup.conditions[trial.condition];
    const WheelMap map(setup.wheel, condition.slope_rad, setup.law, ContactNoise::normal(0.54, 0.045, 0.352, 0.043));
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      const LaboratoryCollision& c = trial.collisions[k];
      const int phase = c.leg % map.phases();
      const double after = map.after_collision(c.omega_minus * c.omega_minus, phase, c.contact);
      EXPECT_NEAR(c.omega_plus, std::sqrt(std::max(0.0, after)), 1e-9 * c.omega_minus);
      const bool rests_here = after < map.stance(phase).barrier;
      const bool last = k + 1 == trial.collisions.size();
      EXPECT_EQ(rests_here, last && trial.outcome == Outcome::rest);
      rests += rests_here;
      if (last) continue;
      const LaboratoryCollision& next = trial.collisions[k + 1];
      const double landing = after + map.stance(phase).gain;
      EXPECT_NEAR(next.omega_minus / std::sqrt(landing), 1, 1e-9);
      EXPECT_NEAR(next.time - c.time, map.duration(landing, phase), 1e-8);
      EXPECT_NEAR(next.position - c.position, map.advance(phase), 1e-9);
      EXPECT_EQ(next.leg, (c.leg + 1) % 8);
      ++compared;
    }
    EXPECT_EQ(trial.collisions.front().leg, condition.first_landing_leg);
    if (trial.outcome == Outcome::end_of_ramp) {
      EXPECT_EQ(static_cast<int>(trial.collisions.size()),
                last_collision_on_ramp(map, condition.first_landing_leg, condition.ramp_length));
    }
  }
  EXPECT_GT(compared, 100) << rests << " rests";
}

TEST(Laboratory, AgreesWithTheReturnMapWithoutEffects) {
  for (const Law law : {Law::published, Law::coulomb, Law::plastic}) {
    LaboratorySetup setup = paper_setup(law);
    compare_with_return_map(setup);
    setup.max_collisions = 60;  // to the end of the ramp
    setup.wheel.inertia = 0.034;
    compare_with_return_map(setup);
  }
}

TEST(Laboratory, SlipReversalIsTheCoulombWheel) {
  LaboratorySetup reversed = paper_setup(), coulomb = paper_setup(Law::coulomb);
  reversed.wheel.radius_of_gyration = coulomb.wheel.radius_of_gyration = 0.05;
  reversed.effects = {effect("slip_reversal")};
  const auto a = run_all(reversed), b = run_all(coulomb);
  for (std::size_t t = 0; t < a.size(); ++t) {
    ASSERT_EQ(a[t].collisions.size(), b[t].collisions.size());
    EXPECT_EQ(a[t].collisions.back().omega_plus, b[t].collisions.back().omega_plus);
  }
}

// Takes omega+^2 - omega-^2 of the next collision, plus what gravity gave: the work of the drag over the stance.
double drag_work(const std::string& text) {
  LaboratorySetup setup = paper_setup(Law::plastic);
  setup.wheel.leg_length.assign(8, 0.1519);
  setup.effects = {effect(text)};
  const Laboratory lab(setup);
  const LaboratoryTrial trial = lab.run(0);
  const LaboratoryCollision &a = trial.collisions.at(0), &b = trial.collisions.at(1);
  const double inertia = 1.39 * 0.1519 * 0.1519, chord = 2 * 0.1519 * std::sin(22.5 * degree);
  const double gravity = 1.39 * 9.81 * chord * std::sin(setup.conditions[0].slope_rad);
  return gravity - inertia / 2 * (b.omega_minus * b.omega_minus - a.omega_plus * a.omega_plus);
}

// Returns the inertia about a foot that the laboratory's motion shows: what the hub's fall gave, turned into rotation.
double shown_inertia(const LaboratorySetup& setup, const LaboratoryTrial& trial, std::size_t k) {
  const Wheel& wheel = setup.wheel;
  const auto leg = static_cast<std::size_t>(trial.collisions[k].leg);
  const double slope = setup.conditions[trial.condition].slope_rad, own = wheel.leg_length[leg];
  // Returns the height of the hub over the foot it stands on when another foot touches behind (1) or ahead (-1).
  const auto height = [&](double other, double side) {
    const double chord = std::sqrt(own * own + other * other - 2 * own * other * std::cos(std::numbers::pi / 4));
    const double to_ramp = std::acos((own * own + chord * chord - other * other) / (2 * own * chord));
    return own * std::sin(to_ramp + side * slope);
  };
  const double fall = height(wheel.leg_length[(leg + 7) % 8], 1) - height(wheel.leg_length[(leg + 1) % 8], -1);
  const double before = trial.collisions[k].omega_plus, after = trial.collisions[k + 1].omega_minus;
  return 2 * wheel.hub_mass * wheel.gravity * fall / (after * after - before * before);
}

// A ring of points about the hub has the inertia of a wheel with that radius of gyration.
double ring_inertia(double mass, double radius, double length) {
  constexpr int points = 720;
  double sum = 0;
  for (int i = 0; i < points; ++i) {
    const double phi = 2 * std::numbers::pi * i / points;
    const double x = radius * std::cos(phi), z = length + radius * std::sin(phi);
    sum += mass / points * (x * x + z * z);
  }
  return sum;
}

// It is written twice, in the laboratory and for the contact laws: neither asks the other.
TEST(Laboratory, ItsInertiaIsThatOfTheLaws) {
  for (const Law law : {Law::published, Law::coulomb})
    for (const bool stated : {false, true}) {
      LaboratorySetup setup = paper_setup(law);
      setup.wheel.radius_of_gyration = 0.06;
      if (stated) setup.wheel.inertia = 0.04;
      const Laboratory lab(setup);
      int compared = 0;
      for (std::size_t t = 0; t < 4; ++t) {
        const LaboratoryTrial trial = lab.run(t);
        for (std::size_t k = 0; k + 1 < trial.collisions.size(); ++k, ++compared) {
          const double length = setup.wheel.leg_length[static_cast<std::size_t>(trial.collisions[k].leg)];
          const double shown = shown_inertia(setup, trial, k);
          EXPECT_NEAR(shown / stance_inertia(setup.wheel, law, length), 1, 1e-8) << law_name(law) << ' ' << length;
          if (law == Law::coulomb && !stated) {
            EXPECT_NEAR(shown / ring_inertia(setup.wheel.hub_mass, 0.06, length), 1, 1e-8);
          }
        }
      }
      EXPECT_GT(compared, 20) << law_name(law) << ' ' << stated;
    }
}

TEST(Laboratory, ResistingTorquesDoTheirWork) {
  const double turn = 45 * degree;
  EXPECT_NEAR(drag_work("rolling_resistance:torque_n_m=0.02"), 0.02 * turn, 1e-10);
  // b omega and c omega^2 lie between the work at the lowest and at the highest speed of the stance.
  const double viscous = drag_work("axle_drag_viscous:n_m_s=0.004"), air = drag_work("air_drag:n_m_s2=0.001");
  EXPECT_GT(viscous, 0.004 * turn * 3.0);
  EXPECT_LT(viscous, 0.004 * turn * 6.5);
  EXPECT_GT(air, 0.001 * turn * 9);
  EXPECT_LT(air, 0.001 * turn * 42);
  EXPECT_NEAR(drag_work("rolling_resistance:torque_n_m=0"), 0, 1e-11);
}

// A parabola of sag f over a length l has the slope of the plane plus 4 f/l at its start and minus at its end, and the
// wheel that rolls over all of it has gained what the plane gives.
TEST(Laboratory, SagSteepensTheStartAndReturnsItAll) {
  LaboratorySetup setup = paper_setup(Law::plastic);
  setup.conditions[0].launch_sd = 0;
  setup.max_collisions = 40;
  setup.order = {0};
  const auto plane = run_all(setup).front();
  setup.effects = {effect("slope_profile:sag_m=0.02,from_m=0.6,to_m=2.4")};
  const auto sagging = run_all(setup).front();
  double steeper = 0, flatter = 0;
  for (std::size_t k = 0; k < plane.collisions.size(); ++k) {
    const double difference = sagging.collisions[k].omega_minus - plane.collisions[k].omega_minus;
    const double at = plane.collisions[k].position;
    if (at < 0.6) {
      EXPECT_NEAR(difference, 0, 1e-9);
    }
    if (at > 0.9 && at < 1.5) steeper = std::max(steeper, difference);
    if (at > 1.7 && at < 2.4) flatter = std::min(flatter, difference);
    if (at > 3.4) {
      EXPECT_NEAR(difference, 0, 0.05);
    }
  }
  EXPECT_GT(steeper, 0.1);
  EXPECT_LT(flatter, -0.1);
}

// The centre of mass goes round with the wheel: gravity's part averages out over a revolution and shows its phase.
TEST(Laboratory, EccentricHubSpeedsUpHalfTheLegs) {
  LaboratorySetup setup = paper_setup(Law::plastic);
  setup.wheel.leg_length.assign(8, 0.1519);
  setup.conditions[0].launch_sd = 0;
  setup.max_collisions = 31;
  setup.order = {0};
  setup.effects = {effect("hub_eccentricity:offset_m=0.002,phase_rad=0")};
  const auto base = run_all(setup).front();
  setup.effects = {effect("hub_eccentricity:offset_m=0.002,phase_rad=1.5707963267948966")};
  setup.conditions[0].first_landing_leg = 0;  // two legs on from leg 6
  const auto turned = run_all(setup).front();
  ASSERT_EQ(base.collisions.size(), turned.collisions.size());
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (std::size_t k = 0; k < base.collisions.size(); ++k) {
    EXPECT_NEAR(base.collisions[k].omega_minus, turned.collisions[k].omega_minus, 1e-9)
        << "the same wheel, two legs on";
    if (k < 16) continue;
    low = std::min(low, base.collisions[k].omega_minus);
    high = std::max(high, base.collisions[k].omega_minus);
  }
  EXPECT_GT(high - low, 0.05);
}

TEST(Laboratory, ContactEffectsChangeWhatIsDrawn) {
  LaboratorySetup setup = paper_setup();
  const auto plain = run_all(setup);
  const auto first = [&](const std::string& text) {
    setup.effects = {effect(text)};
    return run_all(setup);
  };
  const auto leg = first("leg_contact:leg=1,friction_ratio=1.4,restitution_ratio=0.8");
  EXPECT_NEAR(leg[1].collisions[0].contact.friction / plain[1].collisions[0].contact.friction, 1.4, 1e-12);
  EXPECT_NEAR(leg[1].collisions[0].contact.restitution / plain[1].collisions[0].contact.restitution, 0.8, 1e-12);
  EXPECT_EQ(leg[1].collisions[1].contact.friction, plain[1].collisions[1].contact.friction);
  const auto drift = first("trial_drift:relative_change=0.2");
  EXPECT_EQ(drift[0].collisions[0].contact.friction, plain[0].collisions[0].contact.friction);
  EXPECT_NEAR(drift[23].collisions[0].contact.friction / plain[23].collisions[0].contact.friction, 1.2, 1e-12);
  const auto patch = first("friction_patch:from_m=0.1,to_m=0.2,friction_ratio=0.5");
  EXPECT_EQ(patch[1].collisions[0].contact.friction, plain[1].collisions[0].contact.friction);
  EXPECT_NEAR(patch[1].collisions[1].contact.friction / plain[1].collisions[1].contact.friction, 0.5, 1e-12);
  const auto fast = first("speed_dependent_restitution:exponent=0.5");
  const double omega = plain[0].collisions[0].omega_minus;
  EXPECT_NEAR(fast[0].collisions[0].contact.restitution / plain[0].collisions[0].contact.restitution,
              std::sqrt(5 / omega), 1e-12);
  const auto bias = first("sensor_bias:bias_rad_s=0.1");
  EXPECT_NEAR(bias[3].collisions[1].reported_minus - plain[3].collisions[1].omega_minus, 0.1, 1e-12);
}

// First-order autoregression of the scores keeps the distribution and correlates neighbours.
TEST(Laboratory, ContactMemoryCorrelatesNeighbours) {
  LaboratorySetup setup = paper_setup(Law::plastic);
  setup.order.assign(150, 0);
  setup.effects = {effect("contact_memory:correlation=0.6")};
  double product = 0, square = 0;
  int pairs = 0;
  for (const LaboratoryTrial& trial : run_all(setup))
    for (std::size_t k = 1; k < trial.collisions.size(); ++k) {
      const double a = (trial.collisions[k - 1].contact.friction - 0.352) / 0.043;
      const double b = (trial.collisions[k].contact.friction - 0.352) / 0.043;
      product += a * b;
      square += b * b;
      ++pairs;
    }
  ASSERT_GT(pairs, 2000);
  EXPECT_NEAR(product / pairs, 0.6, 0.06);  // s.e. 0.02
  EXPECT_NEAR(square / pairs, 1, 0.1);
}

TEST(Laboratory, SkewedRestitutionKeepsMeanAndSpread) {
  LaboratorySetup setup = paper_setup(Law::plastic);
  setup.order.assign(150, 0);
  setup.restitution_skewness = -1;
  double sum = 0, square = 0, cube = 0;
  int count = 0;
  for (const LaboratoryTrial& trial : run_all(setup))
    for (const LaboratoryCollision& c : trial.collisions) {
      const double z = (c.contact.restitution - 0.54) / 0.045;
      sum += z, square += z * z, cube += z * z * z;
      ++count;
    }
  EXPECT_NEAR(sum / count, 0, 0.08);
  EXPECT_NEAR(square / count, 1, 0.12);
  EXPECT_NEAR(cube / count, -1, 0.35);
}

TEST(Laboratory, FlightLetsFastWheelsLift) {
  LaboratorySetup setup = paper_setup(Law::coulomb);
  setup.conditions[0].launch_mean = 9;
  setup.order = {0, 0, 0, 0};
  setup.flight = true;
  int flown = 0;
  for (const LaboratoryTrial& trial : run_all(setup))
    for (const LaboratoryCollision& c : trial.collisions) {
      flown += c.flew;
      EXPECT_LE(c.omega_plus, c.omega_minus * 1.05);
    }
  EXPECT_GT(flown, 0);
  // Slow wheels do not.
  setup.conditions[0].launch_mean = 5;
  setup.conditions[0].launch_sd = 0;
  for (const LaboratoryTrial& trial : run_all(setup)) EXPECT_FALSE(trial.collisions.front().flew);
}

TEST(Laboratory, FeetHopFromTheirOnsetOn) {
  const auto after = [](double onset) {
    LaboratorySetup setup = paper_setup();
    setup.effects = {{"bounce", {0.8, onset}}};
    return run_all(setup).front().collisions.front();
  };
  const LaboratoryCollision none = run_all(paper_setup()).front().collisions.front(), all = after(0);
  EXPECT_LT(all.omega_plus, none.omega_plus);
  EXPECT_EQ(after(none.omega_minus - 0.01).omega_plus, all.omega_plus);
  EXPECT_EQ(after(none.omega_minus + 0.01).omega_plus, none.omega_plus);
}

// The mean speed over a window before a collision is below the speed there while the wheel speeds up.
TEST(Laboratory, SmoothingReportsMeansOverTheWindow) {
  LaboratorySetup setup = paper_setup();
  setup.smoothing = 0.02;
  for (const LaboratoryTrial& trial : run_all(setup))
    for (const LaboratoryCollision& c : trial.collisions) {
      EXPECT_LT(c.reported_minus, c.omega_minus);
      EXPECT_NEAR(c.reported_minus, c.omega_minus, 0.02 * 60);
    }
}

TEST(Laboratory, EveryOutsideEffectChangesTheMotionAndIsNotInTheCatalogue) {
  const auto plain = run_all(paper_setup());
  EXPECT_EQ(outside_effects().size(), 18U);
  for (const OutsideInfo& info : outside_effects()) {
    EXPECT_NE(message_of([&] { effect_info(info.id); }).find("is none of"), std::string::npos);
    LaboratorySetup setup = paper_setup();
    setup.outside = {{info.id, 0}};
    const auto neutral = run_all(setup);
    setup.outside = {{info.id, info.upper / 2}};
    const auto changed = run_all(setup);
    bool differs = false;
    for (std::size_t t = 0; t < plain.size(); ++t) {
      ASSERT_EQ(neutral[t].collisions.size(), plain[t].collisions.size()) << info.id;
      EXPECT_NEAR(neutral[t].collisions.back().omega_plus, plain[t].collisions.back().omega_plus, 1e-12) << info.id;
      differs |= changed[t].collisions.size() != plain[t].collisions.size() ||
                 std::abs(changed[t].collisions.back().omega_minus - plain[t].collisions.back().omega_minus) > 1e-3 ||
                 std::abs(changed[t].collisions.front().omega_plus - plain[t].collisions.front().omega_plus) > 1e-3;
    }
    EXPECT_TRUE(differs) << info.id;
  }
}

TEST(Laboratory, RefusesWhatItCannotBuild) {
  const auto message = [](auto change) {
    LaboratorySetup setup = paper_setup();
    change(setup);
    return message_of([&] { const Laboratory lab(setup); });
  };
  EXPECT_EQ(message([](LaboratorySetup& s) { s.conditions[1].slope_rad = 0.5; }),
            "condition 1: slope: 28.6479 deg is outside (0, 22.5) deg");
  EXPECT_EQ(message([](LaboratorySetup& s) { s.order.push_back(2); }), "order: condition 2 is outside [0, 2)");
  EXPECT_EQ(message([](LaboratorySetup& s) {
              s.outside = {{"ghosts", 1}};
            }),
            "outside effect: \"ghosts\" is none of sloshing_fluid, planks, frame_resonance, stored_energy, "
            "speed_spread, double_plate, warming_feet, two_crews, loose_feet, second_memory, crosswind, wet_day, "
            "daily_cycle, hysteresis, wearing_leg, rough_stretch, sticky_start, swaying_floor");
  EXPECT_EQ(message([](LaboratorySetup& s) {
              s.effects = {{"inertia", {3}}};
            }),
            "effect inertia: ratio: 3 is outside [0.5, 2]");
  EXPECT_EQ(message([](LaboratorySetup& s) {
              s.effects = {effect("bounce:rebound_lost=0.1"), effect("bounce:rebound_lost=0.1")};
            }),
            "effect bounce: given twice");
}

}  // namespace
}  // namespace metastable::dynamics::test
