#include "analysis/description/description.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "analysis/description/law_comparison.h"
#include "analysis/experiment/experiment.h"
#include "analysis/experiment/experiment_folder.h"
#include "tests/analysis/folders.h"

namespace metastable::analysis {
namespace {

TEST(Description, OfTheStandIn) {
  const Description description = describe(stand_in_folder(), {.fit = false});
  ASSERT_EQ(description.conditions.size(), 3u);
  ASSERT_EQ(description.comparisons.size(), 3u);
  // Fast and slow start end in one steady state; the other slope's is another one.
  const ConditionComparison& starts = description.comparisons[0];
  EXPECT_GT(starts.trial_means->welch.p, 0.05);
  EXPECT_LT(*starts.p_by_collision[0], 1e-6);
  ASSERT_TRUE(starts.meet);
  EXPECT_LE(*starts.meet, 13);
  EXPECT_LT(description.comparisons[1].trial_means->welch.p, 1e-6);
  EXPECT_EQ(starts.trial_means->count_a, 51u);
  EXPECT_EQ(starts.all_collisions->count_a, 204u);
  EXPECT_EQ(description.conditions[2].survival->rests, 3u);
  EXPECT_TRUE(std::isinf(description.conditions[0].survival->expected.from_start.value));
  // There are 194.95 expected steps: see kaplan_meier_test.
  EXPECT_LT(description.conditions[2].survival->expected.from_start.lower, 194.95);
  EXPECT_GT(description.conditions[2].survival->expected.from_start.upper, 194.95);
}

TEST(Description, SaysWhatIsMissing) {
  Experiment experiment = stand_in_folder();
  experiment.columns = {};
  for (MeasuredTrial& trial : experiment.trials) {
    trial.outcome.reset();
    for (MeasuredCollision& c : trial.collisions) c.leg.reset(), c.omega_plus.reset();
  }
  const Description description = describe(experiment, {.fit = false});
  EXPECT_FALSE(description.conditions[0].survival);
  EXPECT_FALSE(description.conditions[0].legs);
  std::string notes;
  for (const std::string& note : description.notes) notes += note;
  for (const char* text : {"no speeds per leg", "mean length", "no survival"})
    EXPECT_NE(notes.find(text), std::string::npos) << text;
  Experiment coast;
  coast.system = System::coast_down;
  EXPECT_THROW(describe(coast, {}), std::invalid_argument);
}

TEST(Description, ATestWithoutTrialsIsNoMeeting) {
  const TrialSpeeds a = {{5, 4, 3}, {5.1, 4.1}, {5.2, 4.2}}, b = {{7, 6, 3}, {7.1, 6.1}, {7.2, 6.2}};
  const ConditionComparison c = compare_conditions(a, b);
  EXPECT_FALSE(c.p_by_collision[2]);  // one trial each
  EXPECT_FALSE(c.meet);
}

// The law and the contact that made the trials predict them; another law does not.
TEST(LawComparison, KnowsTheLawThatMadeTheTrials) {
  Experiment experiment = stand_in_folder();
  std::erase_if(experiment.trials, [](const MeasuredTrial& t) { return t.condition != 2; });
  const LawComparison comparison =
      compare_laws(experiment, {dynamics::Law::published, dynamics::Law::coulomb, dynamics::Law::plastic}, 400, 2, 0);
  ASSERT_EQ(comparison.rows.size(), 6u);
  for (const LawRow& row : comparison.rows) {
    if (row.source == "published, as given" || row.source == "published, fitted") {
      EXPECT_GT(*row.p_speed, 0.01) << row.condition << row.source;
    } else if (row.source == "coulomb, fitted") {
      EXPECT_EQ(row.trials, 0u);
      EXPECT_NE(row.message.find("outside what coulomb can do"), std::string::npos);
    } else if (row.source != "measured") {
      EXPECT_LT(*row.p_speed, 1e-6) << row.condition << row.source;
    }
    // It is 1 - P(steps > 16) of `metastable steps --restitution 0.54,0.045 --friction 0.352,0.043 --json -`.
    if (row.source == "published, as given") {
      EXPECT_NEAR(row.rest_share.value, 0.06348, 4 * std::sqrt(0.06348 * 0.93652 / 400));
    }
  }
}

// Puts trials of `settled` leg by leg beside the same law and beside one with less friction.
TEST(LawComparison, LandingsLegByLegTellFriction) {
  Setting setting;
  setting.law = dynamics::Law::settled;
  setting.restitution = {0.4, 0.05};
  setting.friction = {0.4, 0.03};
  const std::vector<dynamics::Trial> trials = simulate_trials(setting, {.trials = 60, .collisions = 30, .seed = 5});
  const Experiment experiment =
      parse_experiment(source_of(experiment_files({{"only", setting, trials}}, "made", {}), "made"));
  const auto told_apart = [&](double friction) {
    Setting other = setting;
    other.friction.mean = friction;
    const dynamics::SettledMotion wheel = other.motion();
    const auto data = leg_landings(experiment, 0, wheel),
               legs = leg_landings(simulate_trials(other, {.trials = 200, .collisions = 30, .seed = 6}), wheel);
    int count = 0;
    for (std::size_t leg = 0; leg < legs.size(); ++leg) {
      const LegRow row = compare_landings(data[leg], legs[leg]);
      count += (*row.p_kept < 0.01) + (*row.p_slide < 0.01);
    }
    return count;
  };
  EXPECT_LE(told_apart(0.4), 1);
  EXPECT_GE(told_apart(0.36), 6);
}

}  // namespace
}  // namespace metastable::analysis
