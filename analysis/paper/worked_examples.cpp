#include "analysis/paper/worked_examples.h"

#include <algorithm>
#include <stdexcept>

#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/paper/uncharged_sticking.h"
#include "analysis/study/metastability.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {

Experiment laboratory_stand_in(const std::vector<dynamics::Effect>& effects, std::uint64_t seed, int threads,
                               int trials) {
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(stand_in_setting());
  if (trials > 0)
    for (LaboratoryCondition& condition : conditions) condition.trials = trials;
  LaboratoryOptions options;
  options.effects = effects;
  options.sensor_noise = 0.008;
  options.seed = seed;
  options.threads = threads;
  const dynamics::LaboratorySetup setup = laboratory_setup(conditions, options);
  const auto run = run_laboratory(setup, threads);
  return experiment_of(conditions, setup, run, {.title = "laboratory"});
}

std::vector<ChargeOnSticking> charge_on_sticking(std::uint64_t seed, int threads) {
  const StudyOptions options{.tolerance = 0.05, .seed = seed, .threads = threads, .brief = true};
  std::vector<ChargeOnSticking> ramps;
  for (const double slope : {7.02, 9.59}) {
    Setting setting;
    setting.wheel.leg_length.assign(8, 0.1519);
    setting.slope_deg = slope;
    setting.initial_speed = *paper_launch(slope);
    const UnchargedSticking uncharged(setting.map());
    Problem without = setting.problem();
    without.map = markov::AnyReturnMap(uncharged);
    Setting coulomb = setting;
    coulomb.law = dynamics::Law::coulomb;
    ChargeOnSticking& ramp = ramps.emplace_back();
    ramp.slope_deg = slope;
    ramp.critical_friction = uncharged.sticking_friction(0);
    ramp.share_above =
        1 - dynamics::TruncatedNormal(setting.friction.mean, setting.friction.sd, 0).cdf(ramp.critical_friction);
    ramp.published = study(setting, options).steps.from_start;
    ramp.uncharged = study(without, options).steps.from_start;
    ramp.coulomb = study(coulomb, options).steps.from_start;
  }
  return ramps;
}

Experiment believed_half_as_wide(Experiment e, VariabilitySource source) {
  switch (source) {
    case VariabilitySource::none:
      break;
    case VariabilitySource::launch:
      for (Condition& condition : e.conditions) {
        if (!condition.initial_speed)
          throw std::invalid_argument("condition '" + condition.id + "': its launch is not stated");
        condition.initial_speed->sd /= 2;
      }
      break;
    case VariabilitySource::legs: {
      const double mean = e.wheel.mean_leg_length();
      for (double& length : e.wheel.leg_length) length = mean + (length - mean) / 2;
      break;
    }
    case VariabilitySource::contact:
      e.contact.restitution.sd /= 2;
      e.contact.friction.sd /= 2;
      break;
  }
  return e;
}

std::vector<UnderLaw> under_each_law(const Experiment& experiment) {
  std::vector<dynamics::Law> laws{dynamics::Law::published, dynamics::Law::coulomb};
  if (std::find(laws.begin(), laws.end(), experiment.contact.law) == laws.end()) laws.push_back(experiment.contact.law);
  std::vector<UnderLaw> all;
  for (const dynamics::Law law : laws) {
    UnderLaw one{law, false, experiment};
    one.experiment.contact.law = law;
    all.push_back(one);
    if (experiment.columns.omega_plus == Presence::none) continue;
    one.whole_steps = true;
    one.experiment.columns.omega_plus = Presence::none;
    for (MeasuredTrial& trial : one.experiment.trials)
      for (MeasuredCollision& c : trial.collisions) c.omega_plus.reset();
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace metastable::analysis
