// Rows of walks that were lost, behind which steps and legs were counted anew.

#include "analysis/walker_model/leg_turns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "analysis/walker_model/walk_folder.h"

namespace metastable::analysis::test {
namespace {

using Effects = std::vector<std::pair<std::string, double>>;

Walks walked(const Effects& effects, std::uint64_t seed, double slope_sd = 0.3) {
  WalkOptions options;
  options.trials = 24;
  options.longest = 20;
  options.seed = seed;
  options.threads = 1;
  const WalkerSetting setting{Walker::compass, 3, slope_sd, dynamics::Terrain::fresh};
  return *parse_walks(source_of(draw_walks(setting, effects, options, "drawn"), "drawn"));
}

// Loses a row in the middle of every so many of the longer trials, the first included. The legs are counted anew
// behind.
Walks with_rows_lost(Walks walks, std::size_t every) {
  std::size_t longer = 0;
  for (MachineTrial& trial : walks.runs.trials) {
    std::vector<MachineRow>& rows = trial.rows;
    if (rows.size() < 12 || longer++ % every != 0) continue;
    rows.erase(rows.begin() + 5);
    for (std::size_t k = 5; k < rows.size(); ++k) {
      rows[k].phase = 1 - rows[k].phase;
      rows[k].inputs.front() = 3 - rows[k].inputs.front();
    }
  }
  return walks;
}

std::vector<std::string> asked(const Walks& walks) { return questions_on_leg_turns(*walks.machine, walks.runs); }

TEST(LegTurns, AreAskedAboutWhereLegsDifferTheOtherWayRound) {
  for (const Effects& effects : {Effects{{"leg_mass.mass_ratio", 1.08}}, Effects{{"leg_mass.higher", 0.01}},
                                 Effects{{"leg_length.longer", 0.002}}})
    for (const std::size_t every : {2U, 8U}) {
      const std::vector<std::string> questions = asked(with_rows_lost(walked(effects, 3), every));
      ASSERT_EQ(questions.size(), 1U) << effects.front().first << ", every " << every;
      EXPECT_TRUE(questions[0].starts_with("phase: from trial ")) << questions[0];
      EXPECT_TRUE(questions[0].ends_with("?")) << questions[0];
    }
}

TEST(LegTurns, OfUndisturbedWalksNothingIsAsked) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    for (const Effects& effects :
         {Effects{}, Effects{{"leg_mass.mass_ratio", 1.1}}, Effects{{"hip_damping.damping", 0.1}},
          Effects{{"leg_length.longer", 0.003}, {"impact_loss.share", 0.03}}}) {
      EXPECT_EQ(asked(walked(effects, seed)), std::vector<std::string>{}) << seed;
      EXPECT_EQ(asked(walked(effects, seed, 0.8)), std::vector<std::string>{}) << seed;
    }
}

// Legs that are alike may be called as one likes.
TEST(LegTurns, OfLegsThatAreAlikeNothingIsAsked) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    EXPECT_EQ(asked(with_rows_lost(walked({}, seed), 2)), std::vector<std::string>{}) << seed;
}

TEST(LegTurns, AStepOfTwiceTheTimeOrTheWayIsAskedAbout) {
  Walks walks = walked({}, 1);
  for (MachineTrial& trial : walks.runs.trials)
    for (std::size_t k = 0; k < trial.rows.size(); ++k) {
      trial.rows[k].time = 0.7 * static_cast<double>(k);
      trial.rows[k].position = 0.5 * static_cast<double>(k);
    }
  EXPECT_EQ(asked(walks), std::vector<std::string>{});
  walks = with_rows_lost(std::move(walks), 100);
  const std::vector<std::string> questions = asked(walks);
  ASSERT_EQ(questions.size(), 2U);
  EXPECT_TRUE(questions[0].starts_with(
      "time_s: trial 1, row 6 is 1.4 s behind the row before, where the usual step is 0.7 s: is a row missing there?"))
      << questions[0];
  EXPECT_TRUE(questions[1].starts_with("position_m: trial 1, row 6 is 1 m behind the row before")) << questions[1];
}

}  // namespace
}  // namespace metastable::analysis::test
