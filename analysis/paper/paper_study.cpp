#include "analysis/paper/paper_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {
namespace {

constexpr int collisions = 16;       // of a trial, Sec. III
constexpr double leg_sd = 0.000687;  // [m], Sec. IV-A
constexpr Spread launch_702{7.35, 0.19};

double mean_sd(const std::vector<SpeedSummary>& profile, std::size_t first, std::size_t last) {
  double sum = 0, count = 0;
  for (std::size_t n = first; n <= std::min(last, profile.size()); ++n)
    if (profile[n - 1].count > 1) sum += profile[n - 1].sd, ++count;
  return count > 0 ? sum / count : 0;
}

double p_of(TTest (*test)(std::span<const double>, std::span<const double>), const std::vector<double>& a,
            const std::vector<double>& b) {
  return a.size() < 2 || b.size() < 2 ? 1 : test(a, b).p;
}

// Profiles of one variant; every profile has random numbers of its own, so that tests between them hold.
class Simulator {
 public:
  Simulator(const Variant& variant, const PaperStudyOptions& options) : variant_(variant), options_(options) {}

  StudiedProfile profile(Setting setting, std::string label) {
    setting.law = variant_.law;
    StudiedProfile result;
    const auto count = static_cast<std::uint64_t>(options_.trials);
    const std::vector<dynamics::Trial> trials =
        simulate_trials(setting, {.trials = options_.trials,
                                  .collisions = collisions,
                                  .seed = options_.seed,
                                  .threads = options_.threads,
                                  .first = count * number_++,
                                  .rest_rule = variant_.reading == RestReading::rests});
    result.speeds = speeds(trials);
    result.setting = std::move(setting);
    result.label = std::move(label);
    result.profile = speed_profile(result.speeds);
    result.steady = steady_speeds(result.speeds);
    result.trial_means = steady_trial_means(result.speeds);
    result.rest_share =
        static_cast<double>(std::count_if(trials.begin(), trials.end(),
                                          [](const auto& t) { return t.outcome == dynamics::Outcome::rest; })) /
        static_cast<double>(count);
    done();
    return result;
  }
  void done() const {
    if (options_.progress) options_.progress();
  }

 private:
  Variant variant_;
  const PaperStudyOptions& options_;
  std::uint64_t number_ = 0;
};

}  // namespace

std::vector<Variant> paper_variants() {
  return {{dynamics::Law::published, RestReading::goes_on, "published, goes on"},
          {dynamics::Law::published, RestReading::rests, "published, rests"},
          {dynamics::Law::coulomb, RestReading::rests, "coulomb"}};
}

double StudiedProfile::transient_sd() const { return mean_sd(profile, 2, 6); }
double StudiedProfile::steady_sd() const { return mean_sd(profile, steady_collision, collisions); }

PaperExperiments paper_experiments(const Experiment& experiment) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("study: the experiment is a coast-down, not a wheel on a ramp");
  PaperExperiments found;
  found.stand_in = false;
  found.title = experiment.title;
  std::vector<std::pair<double, std::size_t>> steep;  // by speed at collision 1
  std::optional<std::size_t> flat;
  for (std::size_t i = 0; i < experiment.conditions.size(); ++i) {
    const std::vector<double> first = at_collision(speeds(experiment, i), 1);
    if (first.size() < 2) continue;
    if (std::abs(experiment.conditions[i].slope_deg - 9.59) < 0.5) steep.emplace_back(summarize(first).mean, i);
    if (std::abs(experiment.conditions[i].slope_deg - 7.02) < 0.5 && !flat) flat = i;
  }
  std::sort(steep.begin(), steep.end());
  if (steep.size() < 2 || !flat)
    throw std::invalid_argument(
        fmt::format("study: the experiment has {} conditions with trials within 0.5 deg of 9.59 deg and {} of 7.02 deg "
                    "(2 and 1 are needed)",
                    steep.size(), flat ? 1 : 0));
  found.slow_959 = speeds(experiment, steep.front().second);
  found.fast_959 = speeds(experiment, steep.back().second);
  found.fast_702 = speeds(experiment, *flat);
  if (experiment.columns.outcomes) {
    double rests = 0, count = 0;
    for (const MeasuredTrial& trial : experiment.trials)
      if (trial.condition == *flat) ++count, rests += trial.outcome == dynamics::Outcome::rest;
    found.rest_share_702 = rests / count;
  }
  return found;
}

PaperExperiments simulated_experiments(std::uint64_t seed, int threads) {
  const std::vector<SimulatedCondition> conditions = stand_in(stand_in_setting(), seed, threads);
  const auto& flat = conditions[2].trials;
  const auto rests =
      std::count_if(flat.begin(), flat.end(), [](const auto& t) { return t.outcome == dynamics::Outcome::rest; });
  return {true,
          "simulated stand-in",
          speeds(conditions[0].trials),
          speeds(conditions[1].trials),
          speeds(flat),
          static_cast<double>(rests) / static_cast<double>(flat.size())};
}

std::size_t paper_study_units() { return 2 + 4 * 12 + 4 + variance_friction.size(); }

VariantStudy study_variant(const Variant& variant, const PaperExperiments& experiments,
                           const PaperStudyOptions& options) {
  if (options.trials < 20) throw std::invalid_argument(fmt::format("trials: {} is below 20", options.trials));
  VariantStudy study;
  study.variant = variant;
  Simulator simulator(variant, options);
  Setting paper;  // 7.02 deg, the paper's legs and launch, eta and mu ~ N(0.4, 0.1^2)

  Setting steep = paper;
  steep.slope_deg = 9.59;
  steep.initial_speed = {5.83, 0.28};
  study.fig4[0] = simulator.profile(steep, "fast start");
  steep.initial_speed = {4.51, 0.36};
  study.fig4[1] = simulator.profile(steep, "slow start");
  study.fig4_comparison = compare_conditions(study.fig4[0].speeds, study.fig4[1].speeds);

  for (std::size_t j = 0; j < 4; ++j) {
    for (std::size_t k = 0; k < 3; ++k) {
      Setting setting = paper;
      setting.restitution = {0.4, 0.2};
      setting.friction = {fig6_friction[j], 0};
      setting.initial_speed = {fig6_launch[k], 0.198};
      study.fig6[j][k] = simulator.profile(setting, fmt::format("launch {} rad/s", fig6_launch[k]));
      std::fill(setting.wheel.leg_length.begin(), setting.wheel.leg_length.end(), paper.wheel.mean_leg_length());
      study.equal_legs[j][k] = simulator.profile(setting, "equal legs");
      study.legs_p[j][k] = p_of(pooled_t_test, study.fig6[j][k].steady, study.equal_legs[j][k].steady);
      study.legs_p_trials[j][k] = p_of(welch_t_test, study.fig6[j][k].trial_means, study.equal_legs[j][k].trial_means);
    }
    constexpr std::array<std::array<std::size_t, 2>, 3> pairs{{{0, 1}, {0, 2}, {1, 2}}};
    for (std::size_t i = 0; i < 3; ++i) {
      const StudiedProfile &a = study.fig6[j][pairs[i][0]], &b = study.fig6[j][pairs[i][1]];
      study.fig6_p[j][i] = p_of(pooled_t_test, a.steady, b.steady);
      study.fig6_p_trials[j][i] = p_of(welch_t_test, a.trial_means, b.trial_means);
    }
  }
  const std::vector<double> measured = steady_speeds(experiments.fast_702);
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = 0; k < 3; ++k) {
      Setting setting = paper;
      setting.restitution = {0.4, fig7_restitution_sd[k]};
      setting.friction = {0.4, fig7_friction_sd[j]};
      setting.initial_speed = launch_702;
      study.fig7[j][k] = simulator.profile(setting, fmt::format("η sd {}", fig7_restitution_sd[k]));
      if (measured.size() >= 2 && study.fig7[j][k].steady.size() >= 2)
        study.fig7_test[j][k] = pooled_t_test(measured, study.fig7[j][k].steady);
    }
  for (std::size_t k = 0; k < 4; ++k) {
    Setting setting = paper;
    setting.law = variant.law;
    setting.restitution.sd = setting.friction.sd = 0.05 * static_cast<double>(k + 1);
    study.fig8[k] = energy_losses(setting, {.trials = options.trials,
                                            .collisions = collisions,
                                            .rest_rule = variant.reading == RestReading::rests,
                                            .seed = options.seed,
                                            .threads = options.threads});
    simulator.done();
  }
  for (std::size_t n = 0; n < 4; ++n)
    for (std::size_t m = 0; m < 3; ++m) {
      Setting setting = paper;
      setting.restitution = {fig9_restitution[m], 0.15};
      setting.friction = {fig9_friction[n], 0.15};
      study.fig9[n][m] = simulator.profile(setting, fmt::format("η mean {}", fig9_restitution[m]));
    }
  for (std::size_t f = 0; f < variance_friction.size(); ++f) {
    Setting setting = paper;
    setting.law = variant.law;
    setting.friction.mean = variance_friction[f];
    study.variance[f] = variance_of_trials(
        setting, leg_sd, {.samples = options.samples, .seed = options.seed, .threads = options.threads});
    simulator.done();
  }
  return study;
}

}  // namespace metastable::analysis
