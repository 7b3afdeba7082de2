#include "analysis/paper/paper_study.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "analysis/experiment/experiment.h"
#include "analysis/paper/paper_claims.h"
#include "tests/analysis/folders.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

const PaperStudyOptions few = {.trials = 200, .samples = 512, .seed = 3};

// The stand-in in memory is the one in the repository.
TEST(PaperStudy, TakesItsExperimentsFromAFolder) {
  const Experiment folder = stand_in_folder();
  const PaperExperiments read = paper_experiments(folder), made = simulated_experiments(1, 0);
  EXPECT_FALSE(read.stand_in);
  EXPECT_TRUE(made.stand_in);
  EXPECT_EQ(read.fast_959.size(), 51u);
  EXPECT_EQ(read.slow_959.size(), 48u);
  EXPECT_EQ(read.rest_share_702, made.rest_share_702);
  EXPECT_NEAR(read.fast_702[7].back(), made.fast_702[7].back(), 1e-7);
  Experiment one = folder;
  std::erase_if(one.trials, [](const MeasuredTrial& t) { return t.condition == 1; });
  EXPECT_EQ(message_of([&] { paper_experiments(one); }),
            "study: the experiment has 1 conditions with trials within 0.5 deg of 9.59 deg and 1 of 7.02 deg (2 and "
            "1 are needed)");
}

TEST(PaperStudy, ReadingsAndLawsDiffer) {
  const PaperExperiments experiments = simulated_experiments(1, 0);
  std::vector<VariantStudy> studies;
  std::size_t units = 0;
  PaperStudyOptions options = few;
  options.progress = [&] { ++units; };
  for (const Variant& variant : paper_variants()) studies.push_back(study_variant(variant, experiments, options));
  EXPECT_EQ(units, 4 * paper_study_units());
  const VariantStudy &goes_on = studies[0], &rests = studies[1], &coulomb = studies[2], &settled = studies[3];
  // Without a rest rule all trials have 16 collisions; with it nearly all rest at 7.02 deg; under coulomb none.
  EXPECT_EQ(goes_on.usual_spreads().profile.steady.size(), 200u * 4);
  EXPECT_EQ(goes_on.usual_spreads().profile.rest_share, 0);
  EXPECT_GT(rests.usual_spreads().profile.rest_share, 0.95);
  EXPECT_EQ(coulomb.usual_spreads().profile.rest_share, 0);
  EXPECT_EQ(coulomb.usual_spreads().profile.steady.size(), 200u * 4);
  EXPECT_GT(settled.usual_spreads().profile.rest_share, 0.8);
  // This is Fig. 8 (energy_losses_test.cpp: spreads of 0.05 and 0.2), to the sampling error of 200 trials.
  EXPECT_NEAR(goes_on.fig8.front().losses.tangential_net.mean, 0.066,
              4 * goes_on.fig8.front().losses.tangential_net.standard_error + 5e-4);
  EXPECT_NEAR(goes_on.fig8.back().losses.normal.mean, 0.141,
              4 * goes_on.fig8.back().losses.normal.standard_error + 5e-4);
  // The first collision's speeds are the launch's.
  EXPECT_NEAR(goes_on.fig6.front().run(3).measured_legs.profile[0].mean, 7.35, 4 * 0.198 / std::sqrt(200.0));

  const std::vector<Claim> claims = paper_claims(studies, experiments);
  for (const Claim& claim : claims) EXPECT_EQ(claim.findings.size(), 4u) << claim.claim;
  EXPECT_EQ(claims.front().experiment.verdict, ClaimVerdict::reproduced);
  EXPECT_EQ(claims.back().findings[0].verdict, ClaimVerdict::not_applicable);
  EXPECT_EQ(claims.back().findings[2].verdict, ClaimVerdict::not_reproduced);
  // Under published with its rests none of the launches lasts at mu = 0.55: a claim about its steady state says
  // nothing.
  const auto fastest = std::find_if(claims.begin(), claims.end(), [](const Claim& claim) {
    return claim.claim.find("the fastest launch") != std::string::npos;
  });
  ASSERT_NE(fastest, claims.end());
  EXPECT_TRUE(rests.fig6.back().run(3).measured_legs.trial_means.empty());
  EXPECT_EQ(fastest->findings[0].verdict, ClaimVerdict::not_reproduced);
  EXPECT_EQ(fastest->findings[1].verdict, ClaimVerdict::not_applicable);
  const std::vector<Hypothesis> hypotheses = paper_hypotheses(studies);
  ASSERT_EQ(hypotheses.size(), 3u);
  for (std::size_t v = 0; v < 3; ++v)
    EXPECT_EQ(hypotheses[0].findings[v].verdict, ClaimVerdict::not_reproduced) << hypotheses[0].findings[v].ours;
  // The 32 samples that `settled` has here may put the launch's share of the steps anywhere, that of the speed at none.
  EXPECT_NE(hypotheses[0].findings[3].verdict, ClaimVerdict::reproduced) << hypotheses[0].findings[3].ours;
  for (std::size_t v = 0; v < 4; ++v)
    EXPECT_EQ(hypotheses[2].findings[v].verdict, ClaimVerdict::reproduced) << hypotheses[2].findings[v].ours;
}

TEST(PaperStudy, SameBitsOnAnyNumberOfThreadsAndOwnNumbersForEveryProfile) {
  const PaperExperiments experiments = simulated_experiments(1, 0);
  PaperStudyOptions one = few, three = few;
  one.threads = 1, three.threads = 3;
  one.trials = three.trials = 20;
  one.samples = three.samples = 32;
  const Variant coulomb = paper_variants()[2];
  const VariantStudy a = study_variant(coulomb, experiments, one), b = study_variant(coulomb, experiments, three);
  EXPECT_EQ(a.fig9.back().high_restitution().steady, b.fig9.back().high_restitution().steady);
  EXPECT_EQ(a.variance[2].shares.steady_speed.sd, b.variance[2].shares.steady_speed.sd);
  EXPECT_NE(a.fig7[0].runs[0].profile.speeds[0][0], a.fig7[0].runs[1].profile.speeds[0][0]);
  one.trials = 19;
  EXPECT_THROW(study_variant(coulomb, experiments, one), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
