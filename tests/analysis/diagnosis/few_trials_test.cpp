// Checks what a diagnosis may say of a handful of trials.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "analysis/diagnosis/diagnosis.h"
#include "tests/analysis/diagnosed.h"
#include "tests/message_of.h"

namespace metastable::analysis {
namespace {

Diagnosis without_gap(std::size_t trials, std::size_t collisions, std::uint64_t seed) {
  const auto design = wheel_transitions(test::wheel_design(trials, collisions));
  DiagnosisOptions options;
  options.draws = 300;
  return diagnose(*design->simulate(nominal_values(*design), {}, seed), options);
}

// Where chance was drawn from the trials' own scores, nearly every experiment of one to three trials had a gap, and
// every other one of a hundred trials of one collision.
TEST(FewTrials, AreNotTakenForAGap) {
  int alarms = 0;
  for (const auto& [trials, collisions] : {std::pair{1, 2}, {2, 10}, {3, 6}, {5, 3}, {100, 1}})
    for (std::uint64_t seed = 1; seed <= 2; ++seed)
      alarms +=
          without_gap(static_cast<std::size_t>(trials), static_cast<std::size_t>(collisions), seed).gap.p_value < 0.04;
  EXPECT_LE(alarms, 2);  // of 10, each with 4 %
}

const NotPossible* find(const Diagnosis& d, const std::string& words) {
  for (const NotPossible& n : d.limits.not_possible)
    if (n.statement.find(words) != std::string::npos) return &n;
  return nullptr;
}

const Cause* undecided(const Diagnosis& d, const std::string& id) {
  for (const Cause& cause : d.causes.not_decided)
    if (cause.name() == id) return &cause;
  return nullptr;
}

// Every small experiment gets an answer, and what it cannot say with the number of trials that would do.
TEST(FewTrials, SayWhatTheyCannotAndHowManyWouldDo) {
  for (const std::size_t trials : {1, 2, 3, 5})
    for (const std::size_t collisions : {1, 12}) {
      const Diagnosis d = without_gap(trials, collisions, 7);
      SCOPED_TRACE(trials * 100 + collisions);
      EXPECT_TRUE(d.shrinkage.measures.empty());
      const NotPossible* shrinkage = find(d, "how far the gap shrinks");
      ASSERT_TRUE(shrinkage);
      EXPECT_EQ(shrinkage->trials, 10u);  // two in each of five folds
      EXPECT_NE(
          std::ranges::find(d.sentences, "It takes 10 trials like these to say how far the gap shrinks, held out."),
          d.sentences.end());
      EXPECT_EQ(undecided(d, "trial_spread") != nullptr, trials < 5);
      EXPECT_EQ(undecided(d, "initial_speed") != nullptr, trials < 5);
      EXPECT_EQ(undecided(d, "trial_drift") != nullptr, trials < 3);
      EXPECT_EQ(undecided(d, "contact_memory") != nullptr, collisions == 1);
      if (trials == 2 && collisions == 1) {
        const NotPossible* where = find(d, "where the gap lies");
        ASSERT_TRUE(where);
        EXPECT_EQ(where->trials, 20u);  // one collision each, twenty a cell
      }
      for (const Cause& cause : d.causes.ranked)
        for (const auto& parameters : cause.parameters)
          for (const EstimatedParameter& p : parameters) EXPECT_FALSE(std::isnan(p.value)) << cause.name();
    }
}

// Steps before failure are asked: where nothing failed, as many trials as make a rest likely under the model.
TEST(FewTrials, OfWhichNoneRestedGiveALowerEndOnly) {
  const Diagnosis d = without_gap(12, 6, 3);
  const NotPossible* steps = find(d, "observed steps before failure");
  ASSERT_TRUE(steps);
  ASSERT_TRUE(steps->trials) << steps->because;
  const double none = std::pow(1 - 1 / d.shrinkage.steps.with_effect, 6.0 * static_cast<double>(*steps->trials));
  EXPECT_LE(none, 0.05 + 1e-6);
  EXPECT_GT(none, 0.045);
}

TEST(FewTrials, OneCollisionWithoutItsOutcomeIsNoTransition) {
  EXPECT_NE(message_of([&] {
              wheel_transitions(test::wheel_design(3, 1, false));
            }).find("no trial has two collisions or omega_plus_rad_s"),
            std::string::npos);
}

// Forwards to a model, but the likelihood of one effect rises at its neutral value and falls off a cliff close by.
class Jagged : public TransitionModel {
 public:
  Jagged(std::unique_ptr<TransitionModel> model, std::string effect)
      : model_(std::move(model)), effect_(std::move(effect)) {}
  const std::vector<Event>& events() const override { return model_->events(); }
  std::size_t trials() const override { return model_->trials(); }
  std::size_t conditions() const override { return model_->conditions(); }
  int legs() const override { return model_->legs(); }
  bool time_tells() const override { return model_->time_tells(); }
  std::string condition_name(std::size_t condition) const override { return model_->condition_name(condition); }
  const std::vector<Nuisance>& nuisances() const override { return model_->nuisances(); }
  const std::vector<Candidate>& candidates() const override { return model_->candidates(); }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override {
    Evaluation e = model_->evaluate(nuisance, terms);
    for (const EffectTerm& term : terms)
      if (term.candidate->id == effect_) {
        const double off = std::abs(term.values[0] - term.candidate->parameters[0].neutral);
        for (double& one : e.log_density) one += off < 1e-2 ? 3 * off : -5;
      }
    return e;
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                            std::uint64_t seed) const override {
    return model_->simulate(nuisance, terms, seed);
  }
  std::vector<ChangedExperiment> alternatives(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                              std::uint64_t seed) const override {
    return model_->alternatives(nuisance, terms, seed);
  }
  std::pair<double, double> rests() const override { return model_->rests(); }
  double expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                        std::uint64_t seed) const override {
    return model_->expected_steps(nuisance, terms, seed);
  }
  const std::vector<std::string>& notes() const override { return model_->notes(); }
  std::vector<NamedValue> report_nuisances(std::span<const double> nuisance) const override {
    return model_->report_nuisances(nuisance);
  }

 private:
  std::unique_ptr<TransitionModel> model_;
  std::string effect_;
};

TEST(NotDecided, AnEffectWhoseLikelihoodFailsToMaximiseIsListedWithTheReason) {
  const auto design = wheel_transitions(test::wheel_design(50, 6));
  const Jagged model(design->simulate(nominal_values(*design), {}, 5), "trial_drift");
  DiagnosisOptions options;
  options.draws = 200;
  options.catalogue = {"trial_drift", "leg_contact", "air_drag"};
  const Diagnosis d = diagnose(model, options);
  const Cause* cause = undecided(d, "trial_drift");
  ASSERT_TRUE(cause);
  EXPECT_FALSE(cause->not_decided.empty());
  for (const Cause& other : d.causes.ranked) EXPECT_NE(other.name(), "trial_drift");
}

std::vector<std::string> hidden_by(const Diagnosis& d, const std::string& column) {
  std::vector<std::string> effects;
  for (const MissingColumn& m : d.limits.missing)
    if (m.column == column)
      for (const HiddenEffect& e : m.effects)
        if (!e.smallest) effects.push_back(e.effect);
  return effects;
}

TEST(MissingColumns, WithoutLegsNoEffectOfALegIsTold) {
  Experiment e = test::wheel_design(40, 8, false);
  e.columns.leg = Presence::none;
  for (MeasuredTrial& trial : e.trials)
    for (MeasuredCollision& c : trial.collisions) c.leg.reset();
  DiagnosisOptions options;
  options.draws = 200;
  options.catalogue = {"leg_contact", "leg_lengths", "hub_eccentricity", "slope_offset", "sensor_bias"};
  const auto design = wheel_transitions(e);
  const Diagnosis d = diagnose(*design->simulate(nominal_values(*design), {}, 4), options);
  ASSERT_EQ(d.limits.missing.size(), 2u);
  EXPECT_EQ(hidden_by(d, "leg"), (std::vector<std::string>{"leg_contact", "hub_eccentricity"}));
  EXPECT_EQ(hidden_by(d, "omega_plus_rad_s"),
            (std::vector<std::string>{"leg_lengths", "leg_contact", "hub_eccentricity"}));
  // The speed after the collision sees a slope a hundred times smaller: the stance has no contact noise.
  for (const HiddenEffect& effect : d.limits.missing[1].effects)
    if (effect.effect == "slope_offset") {
      ASSERT_TRUE(effect.smallest);
      EXPECT_GT(*effect.smallest, 20 * effect.smallest_with_it);
    }
  const bool said = std::any_of(d.sentences.begin(), d.sentences.end(), [](const std::string& s) {
    return s.find("Without leg, leg_contact, hub_eccentricity cannot be told") != std::string::npos;
  });
  EXPECT_TRUE(said);
}

TEST(MissingColumns, NothingIsSaidOfColumnsThatAreThere) {
  const auto design = wheel_transitions(test::wheel_design(12, 4));
  DiagnosisOptions options;
  options.draws = 200;
  options.catalogue = {"air_drag"};
  EXPECT_TRUE(diagnose(*design->simulate(nominal_values(*design), {}, 4), options).limits.missing.empty());
}

}  // namespace
}  // namespace metastable::analysis
