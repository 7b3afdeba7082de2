// The diagnosis' model and the laboratory share no formula: each effect that the laboratory puts in must be found
// there, at its size, by maximum likelihood with the true contact known.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "analysis/blind/blind_cases.h"
#include "analysis/blind/effect_power.h"
#include "analysis/blind/sized_effect.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/gap/gap_map.h"
#include "analysis/wheel_model/wheel_nuisances.h"
#include "analysis/wheel_model/wheel_transitions.h"
#include "dynamics/laboratory/laboratory_changes.h"

namespace metastable::analysis::test {
namespace {

std::unique_ptr<TransitionModel> model_of(const LaboratoryFiles& made) {
  return wheel_transitions(parse_experiment(source_of(made.files, "laboratory")));
}

LaboratoryFiles with_effect(const Setting& base, const dynamics::Effect& effect,
                            const std::vector<std::string>& dropped) {
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(base);
  for (LaboratoryCondition& c : conditions) c.trials = 25;
  const LaboratoryOptions laboratory{.effects = {effect}, .sensor_noise = 0.008, .flight = false, .seed = 5};
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, laboratory);
  return laboratory_files(conditions, setup, run_laboratory(setup, 0), {.dropped = dropped});
}

const dynamics::NominalValues true_values = [] {
  const Setting base = stand_in_setting();
  return stated_values(base.restitution, base.friction, base.wheel.leg_length);
}();

// Starts halfway between no effect and the truth: a model on which the effect does nothing stays there.
void expect_found(const dynamics::Effect& effect, const std::vector<std::string>& dropped) {
  const std::string text = effect_text(effect);
  const auto model = model_of(with_effect(stand_in_setting(), effect, dropped));
  const EffectTerm truth = fitted_term(*model, effect);
  const std::vector<FreeParameter>& parameters = truth.candidate->parameters;
  ASSERT_EQ(parameters.size(), truth.values.size()) << text;
  EffectTerm start = truth;
  for (std::size_t i = 0; i < start.values.size(); ++i) start.values[i] = (parameters[i].neutral + truth.values[i]) / 2;
  const FitOptions given_contact{.count = {}, .refit_nuisances = false};
  const std::vector<double> nuisance = true_nuisances(*model, true_values);
  const Fit found = fit(*model, nuisance, {start}, given_contact), without = fit(*model, nuisance, {}, given_contact);
  EXPECT_TRUE(found.converged) << text << ": " << found.reason;
  EXPECT_GT(found.log_likelihood, without.log_likelihood + 8) << text;
  const std::vector<double>& values = found.terms.front().values;
  const auto count = static_cast<Eigen::Index>(values.size());
  const Eigen::MatrixXd covariance = found.information.bottomRightCorner(count, count).inverse();
  for (Eigen::Index i = 0; i < count; ++i) {
    const double error = std::sqrt(covariance(i, i)), truth_i = truth.values[static_cast<std::size_t>(i)];
    EXPECT_GT(error, 0) << text;
    EXPECT_TRUE(std::isfinite(error)) << text;
    EXPECT_NEAR(values[static_cast<std::size_t>(i)], truth_i, 4.5 * error) << text << ", value " << i;
  }
}

constexpr double form = 0.05;  // error of the logarithm of steps that is put down to the form of a model

Setting rigid_setting() {
  Setting base = stand_in_setting();
  base.law = dynamics::Law::settled;
  base.wheel.radius_of_gyration = 0.0424;
  base.restitution = {0.4, 0.05};
  base.friction = {0.4, 0.03};
  return base;
}

// Lists every effect of the catalogue that has a size, drawn as for a blind case.
std::vector<SizedEffect> sized_effects() {
  std::vector<SizedEffect> effects;
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) {
    if (info.id == dynamics::contact_distribution_id || info.parameters.empty()) continue;
    BlindDice dice(11, effects.size() + 1);
    effects.push_back(sized_effect(info.id, true_values, dice));
  }
  return effects;
}

// Finds the least size, doubled from where the blind search begins, that raises the log likelihood of its trials by 16.
dynamics::Effect clearly_seen(const SizedEffect& sized) {
  for (double size = sized.start;; size = std::min(2 * size, sized.largest)) {
    const dynamics::Effect effect = sized.at(size);
    const auto model = model_of(with_effect(stand_in_setting(), effect, {}));
    const std::vector<double> nuisance = true_nuisances(*model, true_values);
    const std::vector<EffectTerm> with{fitted_term(*model, effect)};
    if (model->evaluate(nuisance, with).total() > model->evaluate(nuisance, {}).total() + 16 || size == sized.largest)
      return effect;
  }
}

// Compares what the model with an effect expects in steps before failure with what the laboratory counts.
void expect_steps(const Setting& base, const dynamics::Effect& effect, int trials) {
  const std::string text = effect_text(effect);
  const std::vector<LaboratoryCondition> conditions{{"slow", base, trials}};
  const dynamics::LaboratorySetup setup =
      laboratory_setup(conditions, {.effects = {effect}, .sensor_noise = 0.001, .flight = false, .seed = 9});
  const auto model = model_of(laboratory_files(conditions, setup, run_laboratory(setup, 0), {}));
  const std::vector<double> truth =
      true_nuisances(*model, stated_values(base.restitution, base.friction, base.wheel.leg_length));
  const double expected = model->expected_steps(truth, std::vector{fitted_term(*model, effect)}, 1);
  const auto [at_risk, rests] = model->rests();
  ASSERT_GT(rests, 5) << text;
  EXPECT_NEAR(std::log(expected * rests / at_risk), 0, 3.5 / std::sqrt(rests) + form) << text;
}

Setting slow_launches(Setting base, double slope_deg, double speed) {
  base.slope_deg = slope_deg;
  base.initial_speed = {speed, 0.3};
  return base;
}

TEST(LaboratoryAgreement, ExpectedStepsAreThoseCounted) {
  const Setting base = slow_launches(stand_in_setting(), 7.02, 5.5);
  for (const SizedEffect& sized : sized_effects())
    if (const dynamics::Effect effect = sized.at(std::min(sized.largest, 4 * sized.start));
        can_be_had(effect.id, dynamics::Law::published))
      expect_steps(base, effect, 800);
}

// A wheel whose contacts remember rests more often or less at the same speed, and a ramp that rings is in another phase
// where the wheel is slower.
TEST(LaboratoryAgreement, ExpectedStepsKnowWhatTheCollisionBeforeWas) {
  const Setting base = slow_launches(stand_in_setting(), 7.02, 5.5);
  expect_steps(base, {"contact_memory", {0.6}}, 1500);
  expect_steps(base, {"ramp_vibration", {0.16, 33.7}}, 3000);
}

// Under `settled` a wheel also rests because its foot slides too far, and torques raise the friction that stops it.
// Each effect is so large that a model which forgets it expects 2 to 4 times the steps, which is outside what is
// allowed.
TEST(LaboratoryAgreement, ExpectedStepsAreThoseCountedUnderSettled) {
  const Setting base = slow_launches(rigid_setting(), 9.59, 5);
  for (const char* text : {"rolling_resistance:torque_n_m=0.032", "axle_drag_viscous:n_m_s=0.016",
                           "air_drag:n_m_s2=0.01", "leg_contact:leg=5,friction_ratio=0.85"})
    expect_steps(base, dynamics::effect_from_text(text, true_values), 200);
}

// An effect of the catalogue stands in four places. Forgotten in the last two it would be called absent without notice;
// each line says where to add it.
TEST(LaboratoryAgreement, EveryEffectOfTheCatalogueHasItsPlaces) {
  const auto model = model_of(with_effect(stand_in_setting(), {"slip_reversal", {}}, {}));
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) {
    const dynamics::Effect neutral = dynamics::effect_from_values(info.id, {}, true_values);
    EXPECT_NO_THROW(dynamics::laboratory_changes(true_values, {neutral}, {}))
        << info.id << " has no entry in dynamics/laboratory/laboratory_changes.cpp";
    if (info.id != dynamics::contact_distribution_id) {
      EXPECT_NO_THROW(fitted_term(*model, neutral))
          << info.id << " has no entry in analysis/wheel_model/wheel_candidates.cpp";
    }
    BlindDice dice(1, 1);
    EXPECT_NO_THROW(sized_effect(info.id, true_values, dice))
        << info.id << " has no entry in analysis/blind/sized_effect.cpp";
    EXPECT_FALSE(rightful_places(info.id).empty()) << info.id << " may show nowhere: analysis/blind/sized_effect.cpp";
  }
  EXPECT_TRUE(rightful_places("sloshing_fluid").empty());
}

// A candidate makes a fitted form of each effect, and reports that form as the same effect.
TEST(LaboratoryAgreement, FormsAreTheInverseOfReports) {
  const auto model = model_of(with_effect(stand_in_setting(), {"slip_reversal", {}}, {}));
  for (const SizedEffect& sized : sized_effects()) {
    const dynamics::Effect effect = sized.at(sized.start);
    const EffectTerm term = fitted_term(*model, effect);
    const std::vector<NamedValue> reported = term.candidate->report(term.variant, term.values);
    const dynamics::EffectInfo& info = dynamics::effect_info(effect.id);
    std::size_t at = 0;
    for (const dynamics::EffectParameter& p : info.parameters) {
      std::size_t found = 0;
      for (const NamedValue& one : reported) {
        if (one.first != p.name) continue;
        const double stated = effect.values.at(at + found++);
        const bool ramps_end = p.name == "to_m" && stated == 0;
        EXPECT_NEAR(one.second, ramps_end ? 3.66 : stated, 1e-12) << effect.id << ' ' << p.name;
      }
      EXPECT_EQ(found, p.per_leg ? true_values.leg_lengths.size() : 1U) << effect.id << ' ' << p.name;
      at += found;
    }
  }
}

TEST(LaboratoryAgreement, EveryEffectIsFoundAtItsSize) {
  for (const SizedEffect& sized : sized_effects())
    if (can_be_had(sized.at(sized.start).id, dynamics::Law::published)) expect_found(clearly_seen(sized), {});
}

TEST(LaboratoryAgreement, ASoftContactIsFoundAtItsSize) {
  const Setting base = rigid_setting();
  const dynamics::NominalValues nominal = stated_values(base.restitution, base.friction, base.wheel.leg_length);
  const dynamics::Effect effect{"soft_contact", {1e-6}};
  const auto model = model_of(with_effect(base, effect, {}));
  const std::vector<double> nuisance = true_nuisances(*model, nominal);
  const EffectTerm truth = fitted_term(*model, effect);
  const FitOptions given_contact{.count = {}, .refit_nuisances = false};
  const Fit found = fit(*model, nuisance, {truth}, given_contact), without = fit(*model, nuisance, {}, given_contact);
  EXPECT_GT(found.log_likelihood, without.log_likelihood + 8);
  const auto last = found.information.rows() - 1;
  const double error = std::sqrt(found.information.inverse()(last, last));
  EXPECT_LT(error, truth.values[0] / 3);
  EXPECT_NEAR(found.terms.front().values[0], truth.values[0], 3 * error);
}

TEST(LaboratoryAgreement, SlipReversalIsMoreLikelyThanNone) {
  Setting base = stand_in_setting();
  base.wheel.radius_of_gyration = 0.05;
  const dynamics::Effect effect{"slip_reversal", {}};
  const auto model = model_of(with_effect(base, effect, {}));
  const std::vector<EffectTerm> with{fitted_term(*model, effect)};
  const std::vector<double> nuisance = true_nuisances(*model, true_values);
  EXPECT_GT(model->evaluate(nuisance, with).total(), model->evaluate(nuisance, {}).total() + 8);
}

// One density then covers collision and stance: its Jacobian once forgot the torques, and negative drags paid.
TEST(LaboratoryAgreement, AlsoWhereTheSpeedAfterACollisionIsNotTold) {
  for (const char* text :
       {"axle_drag_viscous:n_m_s=0.004", "rolling_resistance:torque_n_m=0.02", "air_drag:n_m_s2=0.0008",
        "hub_eccentricity:offset_m=0.002,phase_rad=-2", "slope_offset:offset_deg=0.3"})
    expect_found(dynamics::effect_from_text(text, true_values), {"omega_plus_rad_s"});
}

// No trial rested and next to none should have: once that counted as a rest too few at -sqrt(trials) standard
// deviations.
TEST(LaboratoryAgreement, RestsThatDidNotHappenAreNoGap) {
  Setting base = stand_in_setting();
  base.slope_deg = 9.59;
  base.initial_speed = {5.83, 0.28};
  const std::vector<LaboratoryCondition> conditions{{"fast", base, 40}};
  const dynamics::LaboratorySetup setup =
      laboratory_setup(conditions, {.sensor_noise = 0.008, .flight = false, .seed = 3});
  const LaboratoryFiles made =
      laboratory_files(conditions, setup, run_laboratory(setup, 0), {.dropped = {"omega_plus_rad_s"}});
  ASSERT_EQ(made.files.trials_csv.find("rest"), std::string::npos);
  const auto model = model_of(made);
  const GapMap map = gap_map(*model, fit(*model, true_nuisances(*model, true_values), {}), 300, 1);
  for (const GapCell& cell : map.cells) {
    EXPECT_LT(std::abs(cell.statistic), 4.5) << cell.facet << ' ' << cell.aspect << ' ' << cell.at;
    EXPECT_NE(cell.facet, "outcome") << "fewer than three rests are seen or expected";
  }
}

LaboratoryFiles many_rests(const std::vector<std::string>& dropped) {
  Setting base = stand_in_setting();
  base.slope_deg = 6.0;
  base.initial_speed = {5.2, 0.28};
  base.first_landing_leg = 3;
  const std::vector<LaboratoryCondition> conditions{{"slow", base, 100}};
  const dynamics::LaboratorySetup setup =
      laboratory_setup(conditions, {.sensor_noise = 0.008, .flight = false, .seed = 4});
  return laboratory_files(conditions, setup, run_laboratory(setup, 0), {.dropped = dropped});
}

// A good part of the trials come to rest. Rests are the lower end of the next speed's distribution: left out of it, the
// other steps look too fast and too narrow (-0.25 of the model's spread), and counted only where they came, too many.
TEST(LaboratoryAgreement, RestsAreNoGap) {
  for (const char* dropped : {"omega_plus_rad_s", "position_m"}) {
    const auto model = model_of(many_rests({dropped}));
    EXPECT_GT(model->rests().second, 30);
    const std::vector<double> true_contact = true_nuisances(*model, true_values);
    const GapMap map = gap_map(*model, fit(*model, true_contact, {}), 300, 1);
    int outcomes = 0;
    for (const GapCell& cell : map.cells) {
      EXPECT_LT(std::abs(cell.statistic), 4) << dropped << ' ' << cell.facet << ' ' << cell.aspect << ' ' << cell.at;
      outcomes += cell.facet == "outcome";
    }
    EXPECT_EQ(outcomes, 1);
    double expected = 0;
    for (const double chance : model->rest_chances(true_contact, {})) expected += chance;
    EXPECT_NEAR(expected, model->rests().second, 4 * std::sqrt(expected));
  }
}

TEST(LaboratoryAgreement, LegsThatWereNotNotedFollowFromTheFirstOneIfTheTransitionsAgree) {
  LaboratoryFiles made = many_rests({"omega_plus_rad_s", "leg"});
  EXPECT_EQ(model_of(made)->legs(), 8);
  const std::string stated = "first_landing_leg = 3";
  const auto at = made.files.experiment_toml.find(stated);
  ASSERT_NE(at, std::string::npos);
  made.files.experiment_toml.replace(at, stated.size(), "first_landing_leg = 7");
  EXPECT_EQ(model_of(made)->legs(), 0);
}

TEST(LaboratoryAgreement, ANoiseThatIsNotStatedIsFitted) {
  const auto model = model_of(many_rests({"noise"}));
  ASSERT_EQ(model->nuisances().size(), WheelSlot::log_noise_sd + 1);
  std::vector<double> start = true_nuisances(*model, true_values);
  start[WheelSlot::log_noise_sd] = std::log(0.016);
  const Fit found = fit(*model, start, {});
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(std::exp(found.nuisance[WheelSlot::log_noise_sd]), 0.008, 0.0008);
}

}  // namespace
}  // namespace metastable::analysis::test
