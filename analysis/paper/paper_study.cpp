#include "analysis/paper/paper_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {
namespace {

constexpr int collisions = 16;       // of a trial, Sec. III
constexpr double leg_sd = 0.000687;  // [m], Sec. IV-A
constexpr Spread launch_702{7.35, 0.19};
constexpr std::array fig6_friction{0.40, 0.45, 0.50, 0.55};
constexpr std::array fig6_launch{3.35, 5.35, 7.35};
constexpr std::array fig7_restitution_sd{0.05, 0.10, 0.15};
constexpr std::array fig7_friction_sd{0.05, 0.10, 0.15, 0.20};
constexpr std::array fig8_sd{0.05, 2 * 0.05, 3 * 0.05, 4 * 0.05};
constexpr std::array fig9_friction{0.2, 0.3, 0.4, 0.5};
constexpr std::array fig9_restitution{0.3, 0.5, 0.7};
constexpr std::array variance_friction{0.3, 0.4, 0.5, 0.55};
constexpr std::size_t fewest_samples = 32, settled_samples = 8;  // a trial that is rolled takes as many times longer
constexpr double usual_mean = 0.4, usual_sd = 0.1;               // of eta and mu, Sec. III

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

SteadyTest steady_test(const StudiedProfile& a, const StudiedProfile& b) {
  return {p_of(pooled_t_test, a.steady, b.steady), p_of(welch_t_test, a.trial_means, b.trial_means)};
}

// Simulates the profiles of one variant; every profile has random numbers of its own, so that tests between them hold.
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

Fig4 study_fig4(Simulator& simulator) {
  Setting steep;
  steep.slope_deg = 9.59;
  steep.initial_speed = {5.83, 0.28};
  Fig4 fig;
  fig.fast = simulator.profile(steep, "fast start");
  steep.initial_speed = {4.51, 0.36};
  fig.slow = simulator.profile(steep, "slow start");
  fig.comparison = compare_conditions(fig.fast.speeds, fig.slow.speeds);
  return fig;
}

LaunchPanel study_fig6(Simulator& simulator, double friction) {
  LaunchPanel panel;
  panel.friction = friction;
  for (std::size_t k = 0; k < panel.runs.size(); ++k) {
    LaunchRun& run = panel.runs[k];
    Setting setting;
    setting.restitution = {0.4, 0.2};
    setting.friction = {friction, 0};
    run.launch = fig6_launch[k];
    setting.initial_speed = {run.launch, 0.198};
    run.measured_legs = simulator.profile(setting, fmt::format("launch {} rad/s", run.launch));
    setting.wheel.leg_length.assign(setting.wheel.leg_length.size(), Setting{}.wheel.mean_leg_length());
    run.equal_legs = simulator.profile(setting, "equal legs");
    run.legs_alike = steady_test(run.measured_legs, run.equal_legs);
  }
  auto pair = panel.pairs.begin();
  for (const auto& [first, second] : {std::pair(1, 2), std::pair(1, 3), std::pair(2, 3)})
    *pair++ = {first, second, steady_test(panel.run(first).measured_legs, panel.run(second).measured_legs)};
  return panel;
}

// @param measured  steady speeds of the experiment
SpreadPanel study_fig7(Simulator& simulator, double friction_sd, const std::vector<double>& measured) {
  SpreadPanel panel;
  panel.friction_sd = friction_sd;
  for (std::size_t k = 0; k < panel.runs.size(); ++k) {
    SpreadRun& run = panel.runs[k];
    run.restitution_sd = fig7_restitution_sd[k];
    Setting setting;
    setting.restitution = {usual_mean, run.restitution_sd};
    setting.friction = {usual_mean, friction_sd};
    setting.initial_speed = launch_702;
    run.profile = simulator.profile(setting, fmt::format("η sd {}", run.restitution_sd));
    if (measured.size() >= 2 && run.profile.steady.size() >= 2)
      run.against_experiment = pooled_t_test(measured, run.profile.steady);
  }
  return panel;
}

MeanPanel study_fig9(Simulator& simulator, double friction) {
  MeanPanel panel;
  panel.friction = friction;
  for (std::size_t m = 0; m < panel.runs.size(); ++m) {
    MeanRun& run = panel.runs[m];
    run.restitution = fig9_restitution[m];
    Setting setting;
    setting.restitution = {run.restitution, 0.15};
    setting.friction = {friction, 0.15};
    run.profile = simulator.profile(setting, fmt::format("η mean {}", run.restitution));
  }
  return panel;
}

}  // namespace

std::vector<Variant> paper_variants() {
  return {{dynamics::Law::published, RestReading::goes_on, "published, goes on"},
          {dynamics::Law::published, RestReading::rests, "published, rests"},
          {dynamics::Law::coulomb, RestReading::rests, "coulomb"},
          {dynamics::Law::settled, RestReading::rests, "settled"}};
}

double StudiedProfile::transient_sd() const { return mean_sd(profile, 2, 6); }
double StudiedProfile::steady_sd() const { return mean_sd(profile, steady_collision, collisions); }

const LaunchPair& LaunchPanel::pair(int first, int second) const {
  for (const LaunchPair& one : pairs)
    if (one.first == first && one.second == second) return one;
  throw std::out_of_range(fmt::format("launches: {} and {} are no pair of Fig. 6", first, second));
}

const SpreadRun& VariantStudy::usual_spreads() const {
  const auto panel = std::ranges::find(fig7, usual_sd, &SpreadPanel::friction_sd);
  return *std::ranges::find(panel->runs, usual_sd, &SpreadRun::restitution_sd);
}
const LossRun& VariantStudy::usual_losses() const { return *std::ranges::find(fig8, usual_sd, &LossRun::sd); }
const VarianceRun& VariantStudy::usual_variance() const {
  return *std::ranges::find(variance, usual_mean, &VarianceRun::friction);
}

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
    if (std::abs(experiment.conditions[i].slope_deg - 9.59) < 0.5) steep.emplace_back(speed_summary(first).mean, i);
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
  const auto of = [&](std::string_view id) -> const std::vector<dynamics::Trial>& {
    return std::ranges::find(conditions, id, &SimulatedCondition::id)->trials;
  };
  const std::vector<dynamics::Trial>& flat = of("fast-7.02");
  const auto rests =
      std::count_if(flat.begin(), flat.end(), [](const auto& t) { return t.outcome == dynamics::Outcome::rest; });
  return {true,
          "simulated stand-in",
          speeds(of("fast-9.59")),
          speeds(of("slow-9.59")),
          speeds(flat),
          static_cast<double>(rests) / static_cast<double>(flat.size())};
}

std::size_t paper_study_units() { return 2 + 4 * 12 + fig8_sd.size() + variance_friction.size(); }

VariantStudy study_variant(const Variant& variant, const PaperExperiments& experiments,
                           const PaperStudyOptions& options) {
  if (options.trials < 20) throw std::invalid_argument(fmt::format("trials: {} is below 20", options.trials));
  VariantStudy study;
  study.variant = variant;
  Simulator simulator(variant, options);
  study.fig4 = study_fig4(simulator);
  for (std::size_t j = 0; j < study.fig6.size(); ++j) study.fig6[j] = study_fig6(simulator, fig6_friction[j]);
  const std::vector<double> measured = steady_speeds(experiments.fast_702);
  for (std::size_t j = 0; j < study.fig7.size(); ++j)
    study.fig7[j] = study_fig7(simulator, fig7_friction_sd[j], measured);
  for (std::size_t k = 0; k < study.fig8.size(); ++k) {
    Setting setting;
    setting.law = variant.law;
    setting.restitution.sd = setting.friction.sd = study.fig8[k].sd = fig8_sd[k];
    study.fig8[k].losses = energy_losses(setting, {.trials = options.trials,
                                                   .collisions = collisions,
                                                   .rest_rule = variant.reading == RestReading::rests,
                                                   .seed = options.seed,
                                                   .threads = options.threads});
    simulator.done();
  }
  for (std::size_t n = 0; n < study.fig9.size(); ++n) study.fig9[n] = study_fig9(simulator, fig9_friction[n]);
  const bool rolled = variant.law == dynamics::Law::settled;
  const std::size_t samples = rolled ? std::max(options.samples / settled_samples, fewest_samples) : options.samples;
  for (std::size_t f = 0; f < study.variance.size(); ++f) {
    Setting setting;
    setting.law = variant.law;
    setting.friction.mean = study.variance[f].friction = variance_friction[f];
    study.variance[f].shares =
        variance_of_trials(setting, leg_sd, {.samples = samples, .seed = options.seed, .threads = options.threads});
    simulator.done();
  }
  return study;
}

}  // namespace metastable::analysis
