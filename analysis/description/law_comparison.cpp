#include "analysis/description/law_comparison.h"

#include <algorithm>

#include "analysis/description/landings.h"
#include "analysis/experiment/experiment_folder.h"
#include "analysis/statistics/interval_95.h"
#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {
namespace {

void summarize_speeds(LawRow& row, const TrialSpeeds& speeds, const std::vector<double>& measured) {
  row.trials = speeds.size();
  const std::vector<double> means = steady_trial_means(speeds);
  row.steady = speed_summary(means);
  row.collision_sd = speed_summary(steady_speeds(speeds)).sd;
  if (means.size() >= 2 && measured.size() >= 2) row.p_speed = welch_t_test(means, measured).p;
}

}  // namespace

LawComparison compare_laws(const Experiment& experiment, const std::vector<dynamics::Law>& laws, int trials,
                           std::uint64_t seed, int threads, const std::function<void()>& progress) {
  LawComparison result;
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < experiment.conditions.size(); ++i)
    if (!speeds(experiment, i).empty()) all.push_back(i);
  for (const dynamics::Law law : laws)
    if (has_contact_fit(law))
      result.fits.emplace_back(law, fit_contact(experiment, all, {law, Transition::step, threads, false, progress}));
  for (const std::size_t i : all) {
    const TrialSpeeds measured = speeds(experiment, i);
    LawRow data;
    data.condition = experiment.conditions[i].id;
    data.source = "measured";
    summarize_speeds(data, measured, {});
    std::size_t rests = 0, longest = 0;
    data.outcomes_known = experiment.columns.outcomes;
    for (const MeasuredTrial& trial : experiment.trials) {
      if (trial.condition != i) continue;
      longest = std::max(longest, trial.collisions.size());
      rests += trial.outcome == dynamics::Outcome::rest;
    }
    if (data.outcomes_known) data.rest_share = exact_share(rests, data.trials);
    const std::vector<double> means = steady_trial_means(measured);
    result.rows.push_back(data);

    const auto predict = [&](Setting setting, const std::string& source) {
      LawRow row;
      row.condition = data.condition;
      row.source = source;
      const std::vector<dynamics::Trial> simulated = simulate_trials(
          setting, {.trials = trials, .collisions = static_cast<int>(longest), .seed = seed, .threads = threads});
      summarize_speeds(row, speeds(simulated), means);
      if (setting.law == dynamics::Law::settled) {
        const dynamics::SettledMotion wheel = setting.motion();
        const std::vector<LegLandings> data_legs = leg_landings(experiment, i, wheel),
                                       legs = leg_landings(simulated, wheel);
        for (std::size_t leg = 0; leg < legs.size(); ++leg) {
          LegRow& of = result.legs.emplace_back(compare_landings(data_legs[leg], legs[leg]));
          of.condition = data.condition;
          of.leg = static_cast<int>(leg);
        }
      }
      row.rest_share = exact_share(
          static_cast<std::size_t>(std::count_if(simulated.begin(), simulated.end(),
                                                 [](const auto& t) { return t.outcome == dynamics::Outcome::rest; })),
          simulated.size());
      result.rows.push_back(row);
      if (progress) progress();
    };
    Setting base = nominal_setting(experiment, i);
    base.wheel = fitted_wheel(experiment);
    for (const dynamics::Law law : laws) {
      Setting setting = base;
      setting.law = law;
      const std::string name(dynamics::law_name(law));
      if (law == dynamics::Law::plastic) {
        predict(setting, name);
        continue;
      }
      if (experiment.contact.law != dynamics::Law::plastic) predict(setting, name + ", as given");
      if (!has_contact_fit(law)) continue;
      const auto fit =
          std::find_if(result.fits.begin(), result.fits.end(), [&](const auto& f) { return f.first == law; });
      if (fit->second.status == ContactFit::Status::impossible) {
        LawRow row;
        row.condition = data.condition;
        row.source = name + ", fitted";
        row.message = fit->second.message;
        result.rows.push_back(row);
        continue;
      }
      const ContactParameters& p = fit->second.value;
      setting.restitution = {p[0], p[1]};
      setting.friction = {p[2], p[3]};
      predict(setting, name + ", fitted");
    }
  }
  return result;
}

}  // namespace metastable::analysis
