#include "analysis/study/trial_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "analysis/study/consistency.h"
#include "tests/analysis/settings.h"

namespace metastable::analysis {
namespace {

// A tenth of the steps and more that hang on what is said to first order: events are followed, and have the last word.
TEST(TrialStudy, CoarseStatesAreHeldAgainstWhatIsFollowed) {
  Problem problem = paper_setting(9.59, true).problem();
  Metastability study = analysis::study(problem, {.tolerance = 0.05, .brief = true});
  double expected = 0;
  for (const double s : study.steps.survival) expected += s;
  std::uint64_t followed = 0;
  problem.follow = [&](std::uint64_t, std::uint64_t, std::uint64_t most) {
    EXPECT_EQ(most, study.steps.survival.size() + 1);  // a trial cut off there has not rested
    return followed;
  };
  const StudyOptions options{.threads = 1};
  study.steps.memory = {0.2, 0.05, 0.35};
  study.steps.from_start.upper *= std::exp(0.35);
  followed = static_cast<std::uint64_t>(1.2 * expected);
  EXPECT_NO_THROW(require_followed(problem, study, options));
  for (const double factor : {2.0, 0.5}) {
    followed = static_cast<std::uint64_t>(factor * expected);
    EXPECT_THROW(require_followed(problem, study, options), StatesTooCoarse) << factor;
  }
  // An error beyond first order bounds nothing, whatever the trials take.
  followed = static_cast<std::uint64_t>(expected);
  study.steps.landing_error = 3.5;
  EXPECT_THROW(require_followed(problem, study, options), StatesTooCoarse);
  study.steps.landing_error = 0;
  study.steps.memory = {0.05, 0.01, 0.09};
  EXPECT_NO_THROW(require_followed(problem, study, options));
}

}  // namespace
}  // namespace metastable::analysis
