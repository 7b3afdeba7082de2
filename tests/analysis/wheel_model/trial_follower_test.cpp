#include "analysis/wheel_model/trial_follower.h"

#include <gtest/gtest.h>

#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include "analysis/wheel_model/wheel_likelihood.h"
#include "dynamics/numerics/truncated_normal.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

const dynamics::ContactSpread contact{0.54, 0.045, 0.352, 0.043};

WheelHypothesis hypothesis(double trial_friction_sd = 0) {
  WheelHypothesis h{.contact = contact, .tilt = ScoreTilt(0, 0), .extension = {}};
  h.extension.contact.trial_friction_sd = trial_friction_sd;
  return h;
}

// Makes one trial whose speeds are next to exact and whose stances are those of the stated wheel.
WheelRuns exact_runs(const std::vector<double>& after, double first = 5.4) {
  Experiment e = test::wheel_design(1, after.size());
  e.sensor.noise_sd = 1e-7;
  WheelRuns measured = wheel_runs(e);
  const dynamics::ExtendedWheel wheel = wheels_on_ramps(measured, contact, {}).front();
  double before = first;
  for (std::size_t k = 0; k < after.size(); ++k) {
    RunCollision& m = measured.runs[0].collisions[k];
    m.before = before;
    m.after = after[k];
    before = *wheel.next(m.context, after[k]);
  }
  return measured;
}

std::vector<Event> of_kind(const WheelRuns& measured, EventKind kind) {
  std::vector<Event> all = wheel_events(measured);
  std::erase_if(all, [kind](const Event& e) { return e.kind != kind; });
  return all;
}

TEST(TrialFollower, SeesExactSpeedsAsTheModelsOwnDensities) {
  const WheelRuns measured = exact_runs({3.6, 3.3, 3.5});
  const WheelHypothesis h = hypothesis();
  const dynamics::ExtendedWheel wheel = wheels_on_ramps(measured, contact, {}).front();
  TrialFollower follower(measured, measured.runs[0], wheel, h, TrialFollower::contacts_for(wheel, h));
  int collisions = 0;
  for (const Event& event : wheel_events(measured)) {
    const double chance = follower.chance_of_rest(event);
    const SpeedFilter::Out out = follower.see(event);
    const RunCollision& m = measured.runs[0].collisions[static_cast<std::size_t>(event.number) - 1];
    if (event.kind == EventKind::launch) {
      const double z = (m.before - 5.83) / 0.28;
      EXPECT_NEAR(out.score, z, 1e-6);
      EXPECT_NEAR(out.log_density, -0.5 * z * z - std::log(0.28 * std::sqrt(2 * std::acos(-1.0))), 1e-6);
    }
    if (event.kind == EventKind::collision) {
      const dynamics::SpeedDensity d = wheel.after_collision(m.context, m.before, *m.after);
      EXPECT_NEAR(out.log_density, std::log(d.density), 1e-5);
      EXPECT_NEAR(dynamics::normal_cdf(out.score), d.below, 1e-5);
      EXPECT_NEAR(chance, wheel.after_collision(m.context, m.before, wheel.barrier(m.context)).below, 1e-5);
      ++collisions;
    } else {
      EXPECT_EQ(chance, 0);
    }
    if (event.kind == EventKind::stance) {
      EXPECT_NEAR(out.score, 0, 1e-3);
    }
  }
  EXPECT_EQ(collisions, 3);
}

struct SpreadOfScores {
  double sd, odd;  // of the trial's friction; omega+ of one collision in the middle of its trial
  friend void PrintTo(const SpreadOfScores& s, std::ostream* out) {
    *out << "sd " << s.sd << ", odd speed " << s.odd << " rad/s";
  }
};
class OwnFriction : public testing::TestWithParam<SpreadOfScores> {};

// Takes the trial's own friction by a fine trapezoidal sum over all of its collisions at once, where the follower takes
// nodes and weighs them anew at each. Of twelve collisions and a wide spread the trial tells its friction to a fifth of
// an sd, between which five nodes see next to nothing: spreads of 0.035 were fitted as 0.027.
TEST_P(OwnFriction, IsIntegratedOver) {
  const auto [sd, odd] = GetParam();
  const WheelRuns measured = sd > 0.03 ? exact_runs({3.5, 3.2, 3.3, 3.1, 3.2, odd, 3.1, 3.3, 3.2, 3.5, 3.1, 3.3})
                                       : exact_runs({3.5, 3.2, 3.3, 3.1});
  const WheelHypothesis h = hypothesis(sd);
  const dynamics::ExtendedWheel wheel = wheels_on_ramps(measured, contact, {}).front();
  constexpr int points = 400;
  double sum = 0;
  for (int i = 0; i <= points; ++i) {
    const double score = -6 + 12.0 * i / points;
    double product = dynamics::normal_density(score) * 12 / points;
    for (const RunCollision& m : measured.runs[0].collisions) {
      dynamics::StepContext here = m.context;
      here.friction_shift = sd * score;
      product *= wheel.after_collision(here, m.before, *m.after).density;
    }
    sum += product;
  }
  TrialFollower follower(measured, measured.runs[0], wheel, h, TrialFollower::contacts_for(wheel, h));
  double followed = 0;
  for (const Event& event : wheel_events(measured)) {
    const double log_density = follower.see(event).log_density;
    if (event.kind == EventKind::collision) followed += log_density;
  }
  EXPECT_NEAR(followed, std::log(sum), 2e-3);
  // Without it the same collisions are much less likely.
  double without = 0;
  for (const RunCollision& m : measured.runs[0].collisions)
    without += std::log(wheel.after_collision(m.context, m.before, *m.after).density);
  if (sd > 0.01) {
    EXPECT_GT(std::abs(followed - without), 0.1);
  }
}
INSTANTIATE_TEST_SUITE_P(Spreads, OwnFriction,
                         testing::Values(SpreadOfScores{0.005, 0}, SpreadOfScores{0.02, 0}, SpreadOfScores{0.04, 3.4},
                                         SpreadOfScores{0.08, 3.4}, SpreadOfScores{0.08, 4.3},
                                         SpreadOfScores{0.08, 2.2}),
                         [](const auto& spread) {
                           return "SdThousandths" + std::to_string(std::lround(1000 * spread.param.sd)) +
                                  "OddSpeedTenths" + std::to_string(std::lround(10 * spread.param.odd));
                         });

// Stances that repeat the model say nothing and are left out: every collision then goes on from its own reported speed,
// and so does a first one without a stated launch.
TEST(TrialFollower, GoesOnFromTheReportedSpeedWhereNoEventLeadsUpToACollision) {
  WheelRuns measured = exact_runs({3.6, 3.3, 3.5});
  measured.noise = 0.05;  // so that where it goes on from would show
  measured.exact_stances = true;
  for (Condition& c : measured.conditions) c.initial_speed.reset();
  const WheelHypothesis h = hypothesis();
  const dynamics::ExtendedWheel wheel = wheels_on_ramps(measured, contact, {}).front();
  const std::vector<Event> events = wheel_events(measured);
  ASSERT_EQ(events.size(), 3U);
  TrialFollower whole(measured, measured.runs[0], wheel, h, TrialFollower::contacts_for(wheel, h));
  for (const Event& event : events) {
    TrialFollower only(measured, measured.runs[0], wheel, h, TrialFollower::contacts_for(wheel, h));
    EXPECT_EQ(whole.see(event).log_density, only.see(event).log_density) << event.number;
  }
}

TEST(TrialFollower, AskingForTheChanceOfRestChangesNothing) {
  const WheelRuns measured = exact_runs({3.6, 3.3, 3.5});
  const WheelHypothesis h = hypothesis(0.02);
  const dynamics::ExtendedWheel wheel = wheels_on_ramps(measured, contact, {}).front();
  const auto contacts = TrialFollower::contacts_for(wheel, h);
  TrialFollower asked(measured, measured.runs[0], wheel, h, contacts),
      not_asked(measured, measured.runs[0], wheel, h, contacts);
  for (const Event& event : wheel_events(measured)) {
    asked.chance_of_rest(event);
    EXPECT_EQ(asked.see(event).log_density, not_asked.see(event).log_density);
  }
}

// Whatever was measured: the list of events and what the likelihood says of them are one.
TEST(TrialFollower, EveryEventHasItsDensityWhateverWasMeasured) {
  for (const bool speeds_after : {false, true})
    for (const bool launches : {false, true})
      for (const bool outcomes : {false, true})
        for (const bool rests : {false, true}) {
          Experiment e = test::wheel_design(3, 3, speeds_after);
          for (Condition& c : e.conditions)
            if (!launches) c.initial_speed.reset();
          for (MeasuredTrial& trial : e.trials) {
            if (rests) trial.outcome = dynamics::Outcome::rest;
            if (rests) trial.collisions.back().omega_plus.reset();
            if (!outcomes) trial.outcome.reset();
          }
          const WheelRuns measured = wheel_runs(e);
          const std::vector<Event> events = wheel_events(measured);
          const Evaluation seen = wheel_likelihood(measured, events, hypothesis());
          const std::vector<double> chances = wheel_rest_chances(measured, events, hypothesis());
          ASSERT_EQ(seen.log_density.size(), events.size());
          ASSERT_EQ(chances.size(), events.size());
          std::size_t at_risk = 0;
          for (std::size_t i = 0; i < events.size(); ++i) {
            EXPECT_TRUE(std::isfinite(seen.log_density[i]));
            EXPECT_EQ(chances[i] > 0, is_contact(events[i].kind));
            at_risk += chances[i] > 0;
          }
          // There is one a collision, but for a last one of which nothing is known.
          const std::size_t unknown = !outcomes && (rests || !speeds_after) ? 3 : 0;
          EXPECT_EQ(at_risk, 9 - unknown);
          EXPECT_EQ(of_kind(measured, EventKind::launch).size(), launches ? 3U : 0U);
          EXPECT_EQ(of_kind(measured, EventKind::rest).size(), rests && outcomes ? 3U : 0U);
        }
}

}  // namespace
}  // namespace metastable::analysis
