#include "analysis/wheel_model/wheel_transitions.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment_model/experiment_model.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/gap/map_columns.h"
#include "analysis/statistics/random.h"
#include "tests/analysis/diagnosed.h"

namespace metastable::analysis {
namespace {

using test::term;

// Fitted effects find the sizes the data were drawn with.
TEST(WheelTransitions, FitsFindTheSizesOfEffects) {
  const auto design = wheel_transitions(test::wheel_design(120, 14));
  struct Case {
    const char* id;
    std::vector<double> variant, values;
  };
  const std::vector<Case> cases{{"leg_contact", {3, 0}, {1.15}},         {"rolling_resistance", {}, {0.004}},
                                {"contact_memory", {}, {0.3}},           {"trial_drift", {}, {0.2}},
                                {"trial_spread", {}, {0.02 * 0.02}},     {"friction_patch", {0.4, 0.9}, {0.85}},
                                {"hub_eccentricity", {}, {2e-4, -1e-4}}, {"sensor_noise", {}, {1e-4}},
                                {"sensor_bias", {1, 1}, {0.02}}};
  for (const Case& one : cases) {
    const EffectTerm truth = term(*design, one.id, one.variant, one.values);
    const auto data = design->simulate(nominal_values(*design), std::vector{truth}, 11);
    EffectTerm start = term(*data, one.id, one.variant, one.values);
    for (double& value : start.values) value *= 0.9;
    const Fit found = fit(*data, nominal_values(*data), {start});
    EXPECT_TRUE(found.converged) << one.id << ' ' << found.reason;
    const Eigen::MatrixXd covariance = found.information.inverse();
    for (std::size_t p = 0; p < one.values.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(nominal_values(*data).size() + p);
      EXPECT_NEAR(found.terms[0].values[p], one.values[p], 4 * std::sqrt(covariance(at, at))) << one.id << ' ' << p;
    }
    EXPECT_GT(found.penalised, fit(*data, nominal_values(*data), {}).penalised + 8) << one.id;
  }
}

// Drags are fitted with either sign, and one that drives is told for what it is not.
TEST(WheelTransitions, SayThatNoDragDrivesAWheel) {
  const auto design = wheel_transitions(test::wheel_design(4, 14));
  const auto said = [&](const char* id, double value) {
    return design->size_in_words(std::vector{term(*design, id, {}, {value})});
  };
  EXPECT_EQ(said("axle_drag_viscous", 0.01) + said("trial_drift", -0.1), "");
  EXPECT_TRUE(said("axle_drag_viscous", -0.01).starts_with("A negative axle_drag_viscous would drive the wheel"));
}

// Constant contacts leave speeds that scatter by the noise alone, and a recalibration finds nothing else. Where they
// scatter all the same, it finds by how much.
TEST(WheelTransitions, OfConstantContactsTakeTheNoiseForWhatItIs) {
  Experiment constant = test::wheel_design(40, 16);
  constant.contact.restitution.sd = constant.contact.friction.sd = 0;
  constant.sensor.noise_sd = 0.02;
  const auto design = wheel_transitions(constant);
  for (const double sd : {0.0, 0.03}) {
    std::vector<double> truth = nominal_values(*design);
    if (sd > 0) truth[1] = truth[3] = std::log(sd);  // of restitution, of friction
    const auto data = design->simulate(truth, {}, 3);
    const Fit found = best_fit(*data, nominal_values(*data), {});
    EXPECT_TRUE(found.converged) << found.reason;
    const double friction_sd = std::exp(found.nuisance[3]);
    EXPECT_GT(friction_sd, sd / 1.3);
    EXPECT_LT(friction_sd, sd > 0 ? 1.3 * sd : 0.002);
    const double gained = found.log_likelihood - data->evaluate(nominal_values(*data), {}).total();
    EXPECT_LT(gained, sd > 0 ? std::numeric_limits<double>::infinity() : 8);
  }
}

// Where all trials land on the same footholds, a patch that holds one of them alone is a collision number.
TEST(WheelTransitions, PatchesHoldTwoFootholdsWhereTheseAreFixed) {
  Experiment experiment = test::wheel_design(8, 16);
  const auto narrow = [&] {  // patches that hold one foothold or none; and of all, how many there are
    const auto patch = term(*wheel_transitions(experiment), "friction_patch", {}, {}).candidate->variants;
    return std::pair(std::count_if(patch.begin(), patch.end(),
                                   [](const std::vector<double>& v) {
                                     return std::floor(v[1] / 0.1163) - std::ceil(std::max(0.0, v[0]) / 0.1163) < 1;
                                   }),
                     patch.size());
  };
  const auto fixed = narrow();
  EXPECT_EQ(fixed.first, 0);
  EXPECT_GT(fixed.second, 30U);
  for (MeasuredCollision& c : experiment.trials[3].collisions) *c.position += 0.06;  // starts half a step further down
  EXPECT_GT(narrow().first, 0);
}

// Rolls trials event by event under `settled`, with feet that hop and slide; next speeds after odd legs are reported so
// much too fast, those after even ones too slow [rad/s].
Experiment rolled_experiment(int trials, double slope_off, double form_error, double slope_deg = 7.02) {
  Setting stated;
  stated.law = dynamics::Law::settled;
  stated.slope_deg = slope_deg;
  stated.wheel.leg_length.assign(8, 0.152);
  stated.wheel.radius_of_gyration = 0.0424;
  stated.wheel.tip_radius = 0.0005;
  stated.restitution = {0.4, 0.05};
  stated.friction = {0.4, 0.03};
  stated.initial_speed = {4.9, 0.2};
  Setting real = stated;
  real.slope_deg += slope_off;
  auto rolled = simulate_trials(real, {.trials = trials, .collisions = 24, .seed = 3});
  for (dynamics::Trial& trial : rolled)
    for (dynamics::TrialCollision& c : trial.collisions) c.omega_minus += c.leg % 2 == 0 ? form_error : -form_error;
  return parse_experiment(source_of(experiment_files({{"ramp", stated, rolled}}, "rolled", {}), "rolled"));
}

Experiment without_speeds_after(Experiment experiment) {
  experiment.columns.omega_plus = Presence::none;
  for (MeasuredTrial& trial : experiment.trials)
    for (MeasuredCollision& collision : trial.collisions) collision.omega_plus.reset();
  return experiment;
}

// Trials roll with legs of these lengths [m]; neither their legs nor their speeds after collisions are noted.
Experiment without_legs(std::vector<double> leg_length) {
  Setting setting;
  setting.wheel.leg_length = std::move(leg_length);
  setting.slope_deg = 9.59;
  setting.restitution = {0.4, 0.02};
  setting.friction = {0.4, 0.02};
  setting.initial_speed = {5.8, 0.2};
  setting.first_landing_leg = 3;
  const auto rolled = simulate_trials(setting, {.trials = 80, .collisions = 12, .seed = 4});
  Experiment experiment = without_speeds_after(
      parse_experiment(source_of(experiment_files({{"ramp", setting, rolled}}, "rolled", {}), "rolled")));
  experiment.columns.leg = Presence::none;
  for (MeasuredTrial& trial : experiment.trials)
    for (MeasuredCollision& collision : trial.collisions) collision.leg.reset();
  return experiment;
}

// Equal legs tell nothing about who lands first, so that the statement counts. Legs of different lengths contradict a
// statement that is wrong.
TEST(WheelTransitions, CountLegsFromTheFirstOneThatIsStated) {
  Experiment equal = without_legs(std::vector<double>(8, 0.152));
  EXPECT_TRUE(runs_with_legs(equal).legs_known);
  EXPECT_EQ(runs_with_legs(equal).runs[0].collisions[1].context.leg, 4);
  equal.conditions[0].first_leg_stated = false;
  EXPECT_FALSE(runs_with_legs(equal).legs_known);

  Experiment unequal = without_legs({0.154, 0.152, 0.150, 0.152, 0.151, 0.153, 0.150, 0.152});
  EXPECT_TRUE(runs_with_legs(unequal).legs_known);
  unequal.conditions[0].first_landing_leg = 0;
  EXPECT_FALSE(runs_with_legs(unequal).legs_known);
}

// Gives all speeds that noise [rad/s], without stating it.
Experiment with_noise(Experiment experiment, double noise, std::uint64_t draw = 5) {
  experiment.sensor.noise_sd.reset();
  std::uint64_t number = 0;
  for (MeasuredTrial& trial : experiment.trials) {
    const std::vector<double> error = normal_multipliers(draw, number++, DrawStream::blur, 2 * trial.collisions.size());
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      trial.collisions[k].omega_minus += noise * error[2 * k];
      if (auto& plus = trial.collisions[k].omega_plus) *plus += noise * error[2 * k + 1];
    }
  }
  return experiment;
}

// Makes transitions of them; sensors have that noise [rad/s], and it is stated.
std::unique_ptr<TransitionModel> rolled_transitions(int trials, double slope_off, double form_error = 0,
                                                    double noise = 0) {
  Experiment experiment = rolled_experiment(trials, slope_off, form_error);
  if (noise == 0) return transition_model(experiment);
  experiment = with_noise(std::move(experiment), noise);
  experiment.sensor.noise_sd = noise;
  return transition_model(experiment);
}

TEST(WheelTransitions, OfSettledHoldForTrialsThatAreFollowed) {
  const auto data = rolled_transitions(60, 0);
  const Evaluation nominal = data->evaluate(nominal_values(*data), {});
  for (const EventKind kind : {EventKind::collision, EventKind::stance}) {
    double count = 0, sum = 0, squares = 0;
    for (std::size_t i = 0; i < nominal.score.size(); ++i)
      if (data->events()[i].kind == kind) ++count, sum += nominal.score[i], squares += std::pow(nominal.score[i], 2);
    EXPECT_GT(count, 600);
    EXPECT_NEAR(sum / count, 0, 4 / std::sqrt(count));
    EXPECT_NEAR(squares / count, 1, 0.15);
  }
  const Fit refitted = fit(*data, nominal_values(*data), {});
  EXPECT_TRUE(refitted.converged) << refitted.reason;
  const auto named = data->report_nuisances(refitted.nuisance);
  EXPECT_NEAR(named[0].second, 0.4, 0.01);
  EXPECT_NEAR(named[2].second, 0.4, 0.01);
  EXPECT_EQ(named[4].first, "hub_inertia_kg_m2");
  EXPECT_NEAR(named[4].second, 0.0025, 0.0003);
}

TEST(WheelTransitions, OfSettledFindASlopeThatIsMisread) {
  const auto data = rolled_transitions(40, 0.25);
  const Fit found = fit(*data, nominal_values(*data), {term(*data, "slope_offset", {}, {0.1})});
  EXPECT_TRUE(found.converged) << found.reason;
  const auto at = static_cast<Eigen::Index>(nominal_values(*data).size());
  const Eigen::MatrixXd covariance = found.information.inverse();
  EXPECT_NEAR(found.terms[0].values[0], 0.25, 4 * std::sqrt(covariance(at, at)) + 0.01);
}

// A slide is held to be known less well than it is; a step that is judged beside it is not judged harder for that.
TEST(WheelTransitions, OfSettledHoldWithoutSpeedsAfterCollisions) {
  const Experiment experiment = without_speeds_after(rolled_experiment(100, 0, 0));
  ASSERT_EQ(experiment.columns.position, Presence::all);
  const auto data = transition_model(experiment);
  const Evaluation nominal = data->evaluate(nominal_values(*data), {});
  // A rest is the low end of what a next speed might have been: only together are they centred, and as wide as they
  // are.
  double count = 0, mean = 0, spread = 0;
  const std::vector<EventResidual> left = residuals(*data, nominal);
  for (std::size_t i = 0; i < left.size(); ++i)
    if (data->events()[i].kind != EventKind::launch) ++count, mean += left[i].mean, spread += left[i].spread;
  EXPECT_GT(count, 600);
  EXPECT_NEAR(mean / count, 0, 3 / std::sqrt(count));
  EXPECT_NEAR(spread / count, 0, 0.1);
}

// Of trials whose end is not known the collisions that they rested in are missing: those that are seen went on.
TEST(WheelTransitions, StepsOfTrialsWithoutAnEndSayNothingOfRest) {
  Experiment rolled = without_speeds_after(rolled_experiment(300, 0, 0, 5));
  Experiment design = test::wheel_design(900, 12, false);
  design.contact.restitution.mean = 0.1;  // so that many landings are rests
  for (Experiment* e : {&rolled, &design})
    for (MeasuredTrial& trial : e->trials) trial.outcome.reset();
  const auto settled = transition_model(rolled), stated = wheel_transitions(design);
  const auto published = stated->simulate(nominal_values(*stated), {}, 3);
  for (const TransitionModel* data : {settled.get(), published.get()}) {
    double count = 0, sum = 0;
    const std::vector<EventResidual> left = residuals(*data, data->evaluate(nominal_values(*data), {}));
    for (std::size_t i = 0; i < left.size(); ++i) {
      EXPECT_FALSE(data->events()[i].rested);
      if (data->events()[i].kind == EventKind::step) ++count, sum += left[i].mean;
    }
    EXPECT_GT(count, 600);
    EXPECT_NEAR(sum / count, 0, 3 / std::sqrt(count)) << (data == settled.get() ? "settled" : "published");
  }
}

// What the sensor added to one next speed is not missed again, with the other sign, at the next touch.
TEST(WheelTransitions, OfSettledRememberNoNoise) {
  const auto data = rolled_transitions(100, 0, 0, 0.015);
  const Evaluation nominal = data->evaluate(nominal_values(*data), {});
  double count = 0, squares = 0, products = 0, previous = 0;
  for (std::size_t i = 0; i < nominal.score.size(); ++i) {
    const Event& event = data->events()[i];
    if (event.kind != EventKind::stance) continue;
    const double score = nominal.score[i];
    if (event.number > 1) products += previous * score;
    ++count, squares += score * score;
    previous = score;
  }
  EXPECT_GT(count, 600);
  EXPECT_NEAR(products / squares, 0, 3 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 1, 0.15);
}

// Noise that is not stated is found by its size, and leaves the scatter of stances as it should be: what they scatter
// is not the law's once more.
TEST(WheelTransitions, OfSettledFindNoiseThatIsNotStated) {
  constexpr double noise = 0.025, stated = 0.012;
  constexpr int draws = 3;
  const Experiment rolled = rolled_experiment(60, 0, 0);
  double found = 0, count = 0, squares = 0;
  for (std::uint64_t draw = 5; draw < 5 + draws; ++draw) {
    Experiment experiment = with_noise(rolled, noise, draw);
    experiment.sensor.noise_sd = stated;
    const auto data = transition_model(experiment);
    const Fit with = fit(*data, nominal_values(*data), {term(*data, "sensor_noise", {}, {1e-4})});
    EXPECT_TRUE(with.converged) << with.reason;
    found += std::hypot(stated, std::sqrt(with.terms[0].values[0])) / draws;
    for (std::size_t i = 0; i < with.evaluation.score.size(); ++i)
      if (data->events()[i].kind == EventKind::stance) ++count, squares += std::pow(with.evaluation.score[i], 2);
  }
  EXPECT_NEAR(found, noise, 0.0015);
  EXPECT_NEAR(squares / count, 1, 3 * std::sqrt(2 / count));
}

// Steps of feet whose places are seen tell a noise that nobody stated, and that was only assumed.
TEST(WheelTransitions, OfSettledRefitNoiseWithoutSpeedsAfterCollisions) {
  constexpr double noise = 0.02;
  const auto data = transition_model(without_speeds_after(with_noise(rolled_experiment(60, 0, 0), noise)));
  const Fit found = fit(*data, nominal_values(*data), {});
  EXPECT_TRUE(found.converged) << found.reason;
  ASSERT_EQ(data->nuisances().back().name, "log noise_sd");
  EXPECT_NEAR(std::exp(found.nuisance.back()), noise, 0.005);
}

// An error of form, as engines have it, is no gap.
TEST(WheelTransitions, OfSettledTakeAnErrorOfItsFormForNoGap) {
  constexpr double chance_999 = 26.1;  // chi-squared, eight degrees of freedom
  const auto data = rolled_transitions(40, 0, 0.001);
  const Evaluation nominal = data->evaluate(nominal_values(*data), {});
  std::array<double, 8> sum{}, count{};
  for (std::size_t i = 0; i < nominal.score.size(); ++i)
    if (const Event& event = data->events()[i]; event.kind == EventKind::stance)
      sum.at(static_cast<std::size_t>(*event.leg)) += nominal.score[i],
          ++count.at(static_cast<std::size_t>(*event.leg));
  double left = 0;
  for (std::size_t leg = 0; leg < 8; ++leg) left += sum[leg] * sum[leg] / count[leg];
  EXPECT_LT(left, chance_999);
}

// Two conditions of two days: a recalibration takes up a difference of mu as large as days differ, and no larger one.
TEST(WheelTransitions, MayDifferFromDayToDay) {
  constexpr double shift = 0.012;
  Experiment design = test::wheel_design(80, 12);
  design.conditions[1].day = 2;
  const auto drawn = wheel_transitions(design);
  ASSERT_EQ(drawn->nuisances().back().name, "friction_shift_day_2");
  std::vector<double> truth = nominal_values(*drawn);
  truth.back() = shift;
  const auto data = drawn->simulate(truth, {}, 3);
  const Fit taken_up = fit(*data, nominal_values(*data), {});
  const auto last = static_cast<Eigen::Index>(truth.size()) - 1;
  EXPECT_NEAR(taken_up.nuisance.back(), shift, 3 / std::sqrt(taken_up.information(last, last)) + 0.004);
  EXPECT_GT(2 * (taken_up.penalised - data->evaluate(nominal_values(*data), {}).total()), 10);
  EXPECT_EQ(data->notes().back(),
            "contact.day_to_day is missing: the mean friction is taken to differ by 3 % from day to day");

  design.contact.day_to_day = 0.001;
  const auto strict = wheel_transitions(design)->simulate(truth, {}, 3);
  EXPECT_LT(std::abs(fit(*strict, nominal_values(*strict), {}).nuisance.back()), 0.003);
}

TEST(WheelTransitions, NeedATransition) {
  EXPECT_THROW(wheel_transitions(test::wheel_design(3, 1, false)), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::analysis
