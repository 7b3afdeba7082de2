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

// One condition, which predictions are held against.
struct MeasuredCondition {
  std::size_t index = 0;       // in the experiment
  LawRow row;                  // what was measured
  std::vector<double> means;   // steady ones, by trial [rad/s]
  std::size_t collisions = 0;  // of its longest trial
};

MeasuredCondition measured_condition(const Experiment& experiment, std::size_t index) {
  const TrialSpeeds measured = speeds(experiment, index);
  MeasuredCondition condition{index, {}, steady_trial_means(measured)};
  LawRow& row = condition.row;
  row.condition = experiment.conditions[index].id;
  row.source = "measured";
  summarize_speeds(row, measured, {});
  std::size_t rests = 0;
  row.outcomes_known = experiment.columns.outcomes;
  for (const MeasuredTrial& trial : experiment.trials) {
    if (trial.condition != index) continue;
    condition.collisions = std::max(condition.collisions, trial.collisions.size());
    rests += trial.outcome == dynamics::Outcome::rest;
  }
  if (row.outcomes_known) row.rest_share = exact_share(rests, row.trials);
  return condition;
}

// Returns what simulated trials are beside the measured ones.
LawRow predicted_row(const MeasuredCondition& condition, const std::vector<dynamics::Trial>& simulated,
                     const std::string& source) {
  LawRow row;
  row.condition = condition.row.condition;
  row.source = source;
  summarize_speeds(row, speeds(simulated), condition.means);
  const auto rests = std::count_if(simulated.begin(), simulated.end(),
                                   [](const auto& t) { return t.outcome == dynamics::Outcome::rest; });
  row.rest_share = exact_share(static_cast<std::size_t>(rests), simulated.size());
  return row;
}

// Adds what simulated trials of the wheel are beside the measured ones, leg by leg.
void add_legs(const Experiment& experiment, const MeasuredCondition& condition, const dynamics::SettledMotion& wheel,
              const std::vector<dynamics::Trial>& simulated, std::vector<LegRow>& rows) {
  const std::vector<LegLandings> data_legs = leg_landings(experiment, condition.index, wheel),
                                 legs = leg_landings(simulated, wheel);
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    LegRow& of = rows.emplace_back(compare_landings(data_legs[leg], legs[leg]));
    of.condition = condition.row.condition;
    of.leg = static_cast<int>(leg);
  }
}

// A prediction that is asked for: a setting, or why there is none.
struct Prediction {
  std::string source;
  Setting setting;
  std::optional<std::string> message = {};
};

// Lists what one law predicts: with the contact as given, and as fitted. @param base  a condition's setting
std::vector<Prediction> predictions(const Setting& base, dynamics::Law law, dynamics::Law given_for,
                                    const std::vector<std::pair<dynamics::Law, ContactFit>>& fits) {
  Setting setting = base;
  setting.law = law;
  const std::string name(dynamics::law_name(law));
  if (law == dynamics::Law::plastic) return {{name, setting}};
  std::vector<Prediction> all;
  if (given_for != dynamics::Law::plastic) all.push_back({name + ", as given", setting});
  if (!has_contact_fit(law)) return all;
  const auto fit = std::find_if(fits.begin(), fits.end(), [&](const auto& f) { return f.first == law; });
  const ContactParameters& p = fit->second.value;
  setting.restitution = {p[0], p[1]};
  setting.friction = {p[2], p[3]};
  const bool impossible = fit->second.status == ContactFit::Status::impossible;
  all.push_back({name + ", fitted", setting, impossible ? std::optional(fit->second.message) : std::nullopt});
  return all;
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
    const MeasuredCondition condition = measured_condition(experiment, i);
    result.rows.push_back(condition.row);
    Setting base = nominal_setting(experiment, i);
    base.wheel = fitted_wheel(experiment);
    for (const dynamics::Law law : laws)
      for (const auto& [source, setting, message] : predictions(base, law, experiment.contact.law, result.fits)) {
        if (message) {
          LawRow& row = result.rows.emplace_back();
          row.condition = condition.row.condition;
          row.source = source;
          row.message = *message;
          continue;
        }
        const std::vector<dynamics::Trial> simulated = simulate_trials(
            setting,
            {.trials = trials, .collisions = static_cast<int>(condition.collisions), .seed = seed, .threads = threads});
        if (law == dynamics::Law::settled) add_legs(experiment, condition, setting.motion(), simulated, result.legs);
        result.rows.push_back(predicted_row(condition, simulated, source));
        if (progress) progress();
      }
  }
  return result;
}

}  // namespace metastable::analysis
