#include "analysis/experiment/stand_in.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "analysis/experiment/experiment.h"
#include "dynamics/return_map/trials.h"
#include "tests/analysis/folders.h"

namespace metastable::analysis {
namespace {

TEST(StandIn, HasThePapersConditionsAndNoTrialTwice) {
  const auto conditions = stand_in(stand_in_setting(), 1);
  ASSERT_EQ(conditions.size(), 3u);
  EXPECT_EQ(conditions[0].trials.size(), 51u);
  EXPECT_EQ(conditions[1].trials.size(), 48u);
  EXPECT_EQ(conditions[2].trials.size(), 50u);
  std::set<double> restitutions;
  for (const auto& condition : conditions)
    for (const auto& trial : condition.trials) restitutions.insert(trial.collisions[0].contact.restitution);
  EXPECT_EQ(restitutions.size(), 149u);  // no draw serves two conditions
}

// tests/data/stand-in is what `metastable simulate --stand-in --out tests/data/stand-in` makes.
TEST(StandIn, IsTheFolderInTheRepository) {
  const Experiment folder = stand_in_folder();
  std::size_t trial = 0;
  const auto conditions = stand_in(stand_in_setting(), 1);
  for (std::size_t c = 0; c < conditions.size(); ++c) {
    EXPECT_EQ(folder.conditions[c].id, conditions[c].id);
    for (const dynamics::Trial& made : conditions[c].trials) {
      const MeasuredTrial& listed = folder.trials.at(trial++);
      EXPECT_EQ(listed.outcome, made.outcome);
      ASSERT_EQ(listed.collisions.size(), made.collisions.size());
      for (std::size_t k = 0; k < made.collisions.size(); ++k)
        EXPECT_NEAR(listed.collisions[k].omega_minus, made.collisions[k].omega_minus, 1e-7);
    }
  }
  EXPECT_EQ(trial, folder.trials.size());
}

}  // namespace
}  // namespace metastable::analysis
