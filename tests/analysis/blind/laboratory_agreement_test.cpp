// The diagnosis' model and the laboratory share no formula: each effect that the laboratory puts in must be found
// there, at its size, by maximum likelihood with the true contact known.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "analysis/blind/effect_power.h"
#include "analysis/diagnosis/gap_map.h"
#include "analysis/diagnosis/model_fit.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/likelihood/wheel_transitions.h"

namespace metastable::analysis::test {
namespace {

std::unique_ptr<TransitionModel> model_of(const RealityFiles& made) {
  return wheel_transitions(parse_experiment(source_of(made.files, "laboratory")));
}

RealityFiles with_effect(const Setting& base, const dynamics::Effect& effect, const std::vector<std::string>& dropped) {
  std::vector<RealityCondition> conditions = stand_in_conditions(base);
  for (RealityCondition& c : conditions) c.trials = 25;
  const RealityOptions reality{.effects = {effect}, .sensor_noise = 0.008, .flight = false, .seed = 5};
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, reality);
  return reality_files(conditions, setup, run_laboratory(setup, 0), {.dropped = dropped});
}

// Starts halfway between no effect and the truth: a model on which the effect does nothing stays there.
void expect_found(const std::string& text, const std::vector<std::string>& dropped) {
  const Setting base = stand_in_setting();
  const dynamics::NominalValues contact = stated_values(base.restitution, base.friction, base.wheel.leg_length);
  const dynamics::Effect effect = dynamics::effect_from_text(text, contact);
  const auto model = model_of(with_effect(base, effect, dropped));
  FittedForm form = fitted_form(effect, base.wheel.leg_length, 3.66);
  for (const Candidate& known : model->candidates())
    if (known.id == effect.id) form.candidate.parameters = known.parameters;
  ASSERT_EQ(form.candidate.parameters.size(), form.values.size()) << text;
  Term start{&form.candidate, form.candidate.variants.front(), form.values};
  for (std::size_t i = 0; i < start.values.size(); ++i)
    start.values[i] = (form.candidate.parameters[i].neutral + form.values[i]) / 2;
  const FitOptions given_contact{.count = {}, .refit_nuisances = false};
  const std::vector<double> nuisance = true_nuisances(*model, contact);
  const Fit found = fit(*model, nuisance, {start}, given_contact), without = fit(*model, nuisance, {}, given_contact);
  EXPECT_TRUE(found.converged) << text << ": " << found.reason;
  EXPECT_GT(found.log_likelihood, without.log_likelihood + 8) << text;
  const std::vector<double>& values = found.terms.front().values;
  const auto count = static_cast<Eigen::Index>(values.size());
  const Eigen::MatrixXd covariance = found.information.bottomRightCorner(count, count).inverse();
  for (Eigen::Index i = 0; i < count; ++i) {
    const double error = std::sqrt(covariance(i, i)), truth = form.values[static_cast<std::size_t>(i)];
    EXPECT_GT(error, 0) << text;
    EXPECT_TRUE(std::isfinite(error)) << text;
    EXPECT_NEAR(values[static_cast<std::size_t>(i)], truth, 4.5 * error) << text << ", value " << i;
  }
}

const std::vector<std::string> effects{
    "initial_speed:mean_rad_s=0.2,sd_rad_s=0.1",
    "leg_contact:leg=3,friction_ratio=1.15",
    "leg_lengths:leg_lengths_m=0.1525;0.1528;0.1510;0.1514;0.1518;0.1504;0.1524;0.1530",
    "hub_eccentricity:offset_m=0.0005,phase_rad=1",
    "inertia:ratio=1.03",
    "slope_offset:offset_deg=0.15",
    "slope_profile:sag_m=0.004,to_m=1.83",
    "axle_drag_viscous:n_m_s=0.002",
    "rolling_resistance:torque_n_m=0.01",
    "air_drag:n_m_s2=0.0005",
    "speed_dependent_restitution:exponent=0.8",
    "speed_dependent_friction:amplitude=0.3,speed_rad_s=4",
    "contact_memory:correlation=0.3",
    "friction_patch:from_m=0.5,to_m=1.0,friction_ratio=1.1",
    "trial_drift:relative_change=0.15",
    "trial_spread:friction_sd=0.02",
    "contact_outliers:share=0.02,friction_ratio=1.8",
    "sensor_noise:sd_rad_s=0.02",
    "sensor_bias:bias_rad_s=0.03",
    "bounce:rebound_lost=0.2",
    "ramp_vibration:amplitude=0.05,frequency_hz=12"};

TEST(LaboratoryAgreement, EveryEffectIsFoundAtItsSize) {
  for (const std::string& text : effects) expect_found(text, {});
}

// The contact is the models' nuisance; slip_reversal has no size and is below.
TEST(LaboratoryAgreement, NoEffectOfTheCatalogueIsForgotten) {
  std::set<std::string> tried{"contact_distribution", "slip_reversal"}, known;
  for (const std::string& text : effects) tried.insert(text.substr(0, text.find(':')));
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) known.insert(info.id);
  EXPECT_EQ(tried, known);
}

TEST(LaboratoryAgreement, SlipReversalIsMoreLikelyThanNone) {
  Setting base = stand_in_setting();
  base.wheel.radius_of_gyration = 0.05;
  const dynamics::NominalValues contact = stated_values(base.restitution, base.friction, base.wheel.leg_length);
  const dynamics::Effect effect = dynamics::effect_from_text("slip_reversal", contact);
  const auto model = model_of(with_effect(base, effect, {}));
  const FittedForm form = fitted_form(effect, base.wheel.leg_length, 3.66);
  const std::vector<Term> with{{&form.candidate, {}, {}}};
  const std::vector<double> nuisance = true_nuisances(*model, contact);
  EXPECT_GT(model->evaluate(nuisance, with).total(), model->evaluate(nuisance, {}).total() + 8);
}

// One density then covers collision and stance: its Jacobian once forgot the torques, and negative drags paid.
TEST(LaboratoryAgreement, AlsoWhereTheSpeedAfterACollisionIsNotTold) {
  for (const char* text :
       {"axle_drag_viscous:n_m_s=0.004", "rolling_resistance:torque_n_m=0.02", "air_drag:n_m_s2=0.0008",
        "hub_eccentricity:offset_m=0.002,phase_rad=-2", "slope_offset:offset_deg=0.3"})
    expect_found(text, {"omega_plus_rad_s"});
}

// No trial rested and next to none should have: once that counted as a rest too few at -sqrt(trials) standard
// deviations.
TEST(LaboratoryAgreement, RestsThatDidNotHappenAreNoGap) {
  Setting base = stand_in_setting();
  base.slope_deg = 9.59;
  base.initial_speed = {5.83, 0.28};
  const std::vector<RealityCondition> conditions{{"fast", base, 40}};
  const dynamics::LaboratorySetup setup =
      laboratory_setup(conditions, {.sensor_noise = 0.008, .flight = false, .seed = 3});
  const RealityFiles made =
      reality_files(conditions, setup, run_laboratory(setup, 0), {.dropped = {"omega_plus_rad_s"}});
  ASSERT_EQ(made.files.trials_csv.find("rest"), std::string::npos);
  const auto model = model_of(made);
  const GapMap map = gap_map(*model, fit(*model, {0.54, std::log(0.045), 0.352, std::log(0.043), 0, 0}, {}), 300, 1);
  for (const GapCell& cell : map.cells) {
    EXPECT_LT(std::abs(cell.statistic), 4.5) << cell.facet << ' ' << cell.aspect << ' ' << cell.at;
    EXPECT_NE(cell.facet, "outcome") << "fewer than three rests are seen or expected";
  }
}

RealityFiles many_rests(const std::vector<std::string>& dropped) {
  Setting base = stand_in_setting();
  base.slope_deg = 6.0;
  base.initial_speed = {5.2, 0.28};
  base.first_landing_leg = 3;
  const std::vector<RealityCondition> conditions{{"slow", base, 100}};
  const dynamics::LaboratorySetup setup =
      laboratory_setup(conditions, {.sensor_noise = 0.008, .flight = false, .seed = 4});
  return reality_files(conditions, setup, run_laboratory(setup, 0), {.dropped = dropped});
}

const std::vector<double> true_contact{0.54, std::log(0.045), 0.352, std::log(0.043), 0, 0};

// A good part of the trials come to rest. Rests are the lower end of the next speed's distribution: left out of it, the
// other steps look too fast and too narrow (-0.25 of the model's spread), and counted only where they came, too many.
TEST(LaboratoryAgreement, RestsAreNoGap) {
  for (const char* dropped : {"omega_plus_rad_s", "position_m"}) {
    const auto model = model_of(many_rests({dropped}));
    EXPECT_GT(model->rests().second, 30);
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
  RealityFiles made = many_rests({"omega_plus_rad_s", "leg"});
  EXPECT_EQ(model_of(made)->legs(), 8);
  const std::string stated = "first_landing_leg = 3";
  const auto at = made.files.experiment_toml.find(stated);
  ASSERT_NE(at, std::string::npos);
  made.files.experiment_toml.replace(at, stated.size(), "first_landing_leg = 7");
  EXPECT_EQ(model_of(made)->legs(), 0);
}

TEST(LaboratoryAgreement, ANoiseThatIsNotStatedIsFitted) {
  const auto model = model_of(many_rests({"noise"}));
  ASSERT_EQ(model->nuisances().back().name, "log noise_sd");
  std::vector<double> start = true_contact;
  start.push_back(std::log(0.016));
  const Fit found = fit(*model, start, {});
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(std::exp(found.nuisance.back()), 0.008, 0.0008);
}

}  // namespace
}  // namespace metastable::analysis::test
