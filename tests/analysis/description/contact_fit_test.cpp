#include "analysis/description/contact_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "analysis/description/landings.h"
#include "analysis/experiment/experiment.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/statistics/minimize.h"
#include "tests/analysis/folders.h"

namespace metastable::analysis {
namespace {

using Status = ContactFit::Status;

// Makes trials an experiment, through the same text a folder holds.
Experiment simulated(Setting setting, int trials, std::uint64_t seed) {
  const ExperimentFiles files =
      experiment_files(setting, simulate_trials(setting, {.trials = trials, .collisions = 16, .seed = seed}), "t", {});
  return parse_experiment({.folder = "t",
                           .experiment_toml = files.experiment_toml,
                           .collisions_csv = files.collisions_csv,
                           .trials_csv = files.trials_csv,
                           .angle_csv = {}});
}

TEST(Minimize, FindsRosenbrocksValley) {
  const Minimum smooth = quasi_newton(
      [](const std::vector<double>& x, std::vector<double>& gradient) {
        const double across = x[1] - x[0] * x[0], along = 1 - x[0];
        gradient = {-400 * across * x[0] - 2 * along, 200 * across};
        return 100 * across * across + along * along;
      },
      {-1.2, 1}, 1e-14, 500);
  EXPECT_TRUE(smooth.converged);
  EXPECT_LT(smooth.evaluations, 100);
  EXPECT_NEAR(smooth.at[0], 1, 1e-6);
  EXPECT_NEAR(smooth.at[1], 1, 1e-6);
}

// Holds the curves of the fast likelihood against the exact density of the landing and probability of rest.
TEST(ContactFit, FastLikelihoodAgreesWithTheExactDensity) {
  Setting published = stand_in_setting(), coulomb;
  published.slope_deg = 5;  // some trials rest
  published.initial_speed = {5.0, 0.3};
  coulomb.law = dynamics::Law::coulomb;
  coulomb.slope_deg = 3;
  coulomb.initial_speed = {4.5, 0.2};
  for (const Setting& setting : {published, coulomb})
    for (const Transition transition : {Transition::collision, Transition::step}) {
      const Experiment experiment = simulated(setting, 12, 3);
      const ContactFitOptions options{setting.law, transition};
      std::vector<dynamics::WheelMap> maps{setting.map()};
      const auto transitions = transition == Transition::step ? step_landings(experiment, {0}, maps)
                                                              : collision_landings(experiment, {0}, maps);
      const ContactLikelihood fast(maps, transitions, 0);
      EXPECT_EQ(fast.impossible(), 0u);
      EXPECT_GT(fast.possible_rests(), 0u);
      std::vector<ContactParameters> points{{0.54, 0.045, 0.352, 0.043}, {0.4, 0.1, 0.4, 0.1}};
      // A sliver of eta below 1 is thinner than the likelihood's grid: its rests once had a probability above 1.
      if (setting.law == dynamics::Law::published) points.push_back({1.02, 0.01, 0.4, 0.1});
      for (const ContactParameters& p : points) {
        const double exact = contact_log_likelihood(experiment, {0}, options, p);
        ASSERT_TRUE(std::isfinite(exact));
        EXPECT_NEAR(fast(p), exact,
                    1e-3 * static_cast<double>(transitions.size()) + 0.03 * static_cast<double>(fast.possible_rests()));
        ContactParameters gradient;
        fast(p, &gradient);
        for (std::size_t i = 0; i < 4; ++i) {
          constexpr double h = 1e-5;
          ContactParameters above = p, below = p;
          above[i] += h;
          below[i] -= h;
          const double difference = (fast(above) - fast(below)) / (2 * h);
          EXPECT_NEAR(gradient[i], difference, 1e-5 * std::abs(difference) + 1e-3) << contact_parameter_names[i];
        }
      }
    }
}

TEST(ContactFit, RecoversTheStandInAlongWhatCanBeKnown) {
  const Experiment experiment = stand_in_folder();
  EXPECT_EQ(best_transition(experiment), Transition::collision);
  const ContactFit fit = fit_contact(experiment, {0}, {dynamics::Law::published, Transition::collision, 0, false});
  ASSERT_EQ(fit.status, Status::converged) << fit.message;
  EXPECT_EQ(fit.impossible, 0u);
  const ContactParameters truth = {0.54, 0.045, 0.352, 0.043};
  double distance = 0;  // along each direction, in its own standard errors
  for (const FitDirection& direction : fit.directions) {
    double along = 0;
    for (std::size_t i = 0; i < 4; ++i) along += direction.weight[i] * (truth[i] - fit.value[i]);
    distance += along * along / (direction.sd * direction.sd);
  }
  EXPECT_LT(distance, 13.3);  // chi^2 with 4 degrees of freedom, 99 %
  // The fit is better than the truth, by less than chance allows: an absolute check of the maximum.
  const double at_truth = contact_log_likelihood(experiment, {2}, {}, truth);
  const ContactFit steps = fit_contact(experiment, {2}, {.intervals = false});
  EXPECT_GT(steps.log_likelihood, at_truth - 0.2);
  EXPECT_LT(steps.log_likelihood, at_truth + 6.7);
  // eta and mu are hardly told apart by these data, and that is said.
  EXPECT_GT(std::abs(fit.correlation[0][2]), 0.95);
  std::string all;
  for (const std::string& sentence : ambiguities(fit)) all += sentence;
  EXPECT_NE(all.find("eta mean and mu mean can hardly be told apart"), std::string::npos) << all;
}

TEST(ContactFit, RecoversWideSpreadsUnderCoulomb) {
  Setting setting;
  setting.law = dynamics::Law::coulomb;
  const ContactFit fit =
      fit_contact(simulated(setting, 40, 5), {0}, {dynamics::Law::coulomb, Transition::collision, 0, false});
  ASSERT_EQ(fit.status, Status::converged) << fit.message;
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(fit.value[i], (ContactParameters{0.4, 0.1, 0.4, 0.1}[i]), 3.5 * fit.standard_error[i])
        << contact_parameter_names[i];
}

// An interval is the shadow of a region of the four parameters: whatever has nearly the likelihood of the maximum lies
// in all four, here what made the trials, under laws whose likelihoods have ridges and several maxima.
TEST(ContactFit, IntervalsHoldWhateverIsAsLikely) {
  Setting published = stand_in_setting(), coulomb;
  coulomb.law = dynamics::Law::coulomb;
  for (const auto& [setting, seeds] : {std::pair{published, std::array{5001}}, {coulomb, {106}}})
    for (const int seed : seeds) {
      const Experiment experiment = simulated(setting, 10, static_cast<std::uint64_t>(seed));
      const ContactFitOptions options{setting.law, Transition::collision};
      const ContactFit fit = fit_contact(experiment, {0}, options);
      const ContactParameters truth = {setting.restitution.mean, setting.restitution.sd, setting.friction.mean,
                                       setting.friction.sd};
      // With these seeds it has.
      ASSERT_LT(2 * (fit.log_likelihood - contact_log_likelihood(experiment, {0}, options, truth)), 3.7);
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LE(fit.lower_95[i], truth[i]) << contact_parameter_names[i] << ", seed " << seed;
        EXPECT_GE(fit.upper_95[i], truth[i]) << contact_parameter_names[i] << ", seed " << seed;
      }
    }
}

TEST(ContactFit, SaysWhatALawCannotDo) {
  const Experiment experiment = stand_in_folder();
  const ContactFit coulomb = fit_contact(experiment, {0}, {dynamics::Law::coulomb, Transition::collision});
  EXPECT_EQ(coulomb.status, Status::impossible);
  EXPECT_NE(coulomb.message.find("outside what coulomb can do"), std::string::npos);
  EXPECT_EQ(fit_contact(experiment, {0}, {dynamics::Law::plastic}).status, Status::no_parameters);
  Experiment without = experiment;
  without.columns.omega_plus = Presence::none;
  EXPECT_EQ(best_transition(without), Transition::step);
  EXPECT_THROW(fit_contact(without, {0}, {dynamics::Law::published, Transition::collision}), std::invalid_argument);
  EXPECT_THROW(fit_contact(experiment, {7}, {}), std::invalid_argument);
}

TEST(ContactFit, SameBitsOnAnyNumberOfThreads) {
  const Experiment experiment = simulated(stand_in_setting(), 8, 9);
  const ContactFit one = fit_contact(experiment, {0}, {.threads = 1}),
                   three = fit_contact(experiment, {0}, {.threads = 3});
  EXPECT_EQ(one.value, three.value);
  EXPECT_EQ(one.log_likelihood, three.log_likelihood);
}

}  // namespace
}  // namespace metastable::analysis
