#include "analysis/experiment/reality.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stdexcept>

#include "analysis/statistics/random.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double tail = 0.3;  // [s] recorded of a wheel that has come to rest

// Uniform in (0, 1) from Philox4x64 at counter (index, number, stream), key (seed): apart from the laboratory's draws.
double uniform(std::uint64_t seed, std::uint64_t index, std::uint64_t number, std::uint64_t stream) {
  const r123::Philox4x64::ctr_type counter{{index, number, stream, 0}};
  const auto bits = r123::Philox4x64()(counter, r123::Philox4x64::key_type{{seed, 0}});
  return unit_interval(bits[0]);
}

std::string angles(const std::string& id, const dynamics::LaboratoryTrial& trial, std::size_t index,
                   const CameraOptions& camera) {
  const bool rested = trial.outcome == dynamics::Outcome::rest;
  const double last = trial.collisions.back().time, turned = trial.motion.back().time;
  const double begin = trial.motion.front().time, end = rested ? 2 * turned - last + tail : turned;
  const double offset = uniform(camera.seed, index, 0, 201);
  std::string rows;
  for (std::uint64_t k = 0;; ++k) {
    const double time = begin + (static_cast<double>(k) + offset) / camera.rate;
    if (!(time < end)) return rows;
    // A wheel that turns back falls the way it came, onto both feet.
    const double moment = rested && time > turned ? std::max(last, 2 * turned - time) : time;
    const double noise = camera.noise_sd_rad > 0
                             ? camera.noise_sd_rad * dynamics::normal_quantile(uniform(camera.seed, index, k + 1, 201))
                             : 0;
    fmt::format_to(std::back_inserter(rows), "{},{},{:.6f},{:.{}f}\n", id, index + 1, time,
                   dynamics::angle_at(trial.motion, moment) + noise, camera.decimals);
  }
}

}  // namespace

dynamics::NominalValues stated_values(const Spread& restitution, const Spread& friction,
                                      const std::vector<double>& leg_lengths) {
  return {restitution.mean, restitution.sd, friction.mean, friction.sd, leg_lengths};
}

dynamics::LaboratorySetup laboratory_setup(const std::vector<RealityCondition>& conditions,
                                           const RealityOptions& options) {
  if (conditions.empty()) throw std::invalid_argument("laboratory: no condition");
  const Setting& first = conditions.front().setting;
  if (first.correlation != 0 || !first.pairs.empty())
    throw std::invalid_argument("laboratory: restitution and friction are independent normals there");
  if (first.rebound_lost != 0)
    throw std::invalid_argument("laboratory: the share of the rebound that is lost is its effect 'bounce'");
  if (options.collisions < 1 || options.collisions > 100000)
    throw std::invalid_argument(fmt::format("collisions: {} is outside 1..100000", options.collisions));
  dynamics::LaboratorySetup setup;
  setup.wheel = first.wheel;
  setup.law = first.law;
  setup.restitution_mean = first.restitution.mean;
  setup.restitution_sd = first.restitution.sd;
  setup.friction_mean = first.friction.mean;
  setup.friction_sd = first.friction.sd;
  setup.restitution_skewness = options.restitution_skewness;
  setup.sensor_noise = options.sensor_noise;
  setup.smoothing = options.smoothing;
  setup.flight = options.flight;
  setup.max_collisions = options.collisions;
  setup.effects = options.effects;
  setup.outside = options.outside;
  setup.seed = options.seed;
  for (std::size_t c = 0; c < conditions.size(); ++c) {
    const Setting& setting = conditions[c].setting;
    if (conditions[c].trials < 1 || conditions[c].trials > 100000)
      throw std::invalid_argument(fmt::format("trials: {} is outside 1..100000", conditions[c].trials));
    setup.conditions.push_back({setting.slope_deg * std::numbers::pi / 180, setting.ramp_length,
                                setting.initial_speed.mean, setting.initial_speed.sd, setting.first_landing_leg});
    setup.order.insert(setup.order.end(), static_cast<std::size_t>(conditions[c].trials), c);
  }
  if (options.shuffled)  // Fisher-Yates
    for (std::size_t i = setup.order.size() - 1; i > 0; --i)
      std::swap(setup.order[i],
                setup.order[static_cast<std::size_t>(uniform(options.seed, i, 0, 200) * static_cast<double>(i + 1))]);
  return setup;
}

std::vector<dynamics::LaboratoryTrial> run_laboratory(const dynamics::LaboratorySetup& setup, int threads) {
  const dynamics::Laboratory laboratory(setup);
  std::vector<dynamics::LaboratoryTrial> trials(setup.order.size());
  markov::parallel_for(trials.size(), threads, [&](std::size_t t) { trials[t] = laboratory.run(t); });
  return trials;
}

const std::vector<std::string>& droppable() {
  static const std::vector<std::string> names{
      "leg", "time_s", "position_m", "omega_plus_rad_s", "outcome", "initial_speed_rad_s", "noise"};
  return names;
}

RealityFiles reality_files(const std::vector<RealityCondition>& conditions, const dynamics::LaboratorySetup& setup,
                           const std::vector<dynamics::LaboratoryTrial>& trials, const FolderOptions& options) {
  if (conditions.empty()) throw std::invalid_argument("laboratory: no condition");
  for (const std::string& name : options.dropped)
    if (std::find(droppable().begin(), droppable().end(), name) == droppable().end()) {
      std::string known;
      for (const std::string& one : droppable()) known += (known.empty() ? "" : ", ") + one;
      throw std::invalid_argument(fmt::format("drop: \"{}\" is none of {}", name, known));
    }
  const auto told = [&](std::string_view name) {
    return std::find(options.dropped.begin(), options.dropped.end(), name) == options.dropped.end();
  };
  const Setting& first = conditions.front().setting;
  RealityFiles result;
  ExperimentFiles& files = result.files;
  files.experiment_toml = wheel_description(first, options.restitution.value_or(first.restitution),
                                            options.friction.value_or(first.friction), options.title, options.comment);
  for (const RealityCondition& condition : conditions)
    files.experiment_toml += condition_description(condition.id, condition.setting, told("initial_speed_rad_s"));
  std::string sensor;
  if (options.camera) sensor += fmt::format("rate_hz = {}\n", options.camera->rate);
  if (told("noise")) sensor += fmt::format("noise_sd_rad_s = {}\n", setup.sensor_noise);
  if (!sensor.empty()) files.experiment_toml += "\n[sensor]\n" + sensor;

  const bool leg = told("leg"), time = told("time_s"), position = told("position_m"), after = told("omega_plus_rad_s");
  files.collisions_csv =
      fmt::format("condition,trial,collision{}{}{},omega_minus_rad_s{}\n", leg ? ",leg" : "", time ? ",time_s" : "",
                  position ? ",position_m" : "", after ? ",omega_plus_rad_s" : "");
  if (told("outcome")) files.trials_csv = "condition,trial,outcome\n";
  std::vector<std::string> recordings(trials.size());
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const std::string& id = conditions[trials[t].condition].id;
    auto row = std::back_inserter(files.collisions_csv);
    for (std::size_t k = 0; k < trials[t].collisions.size(); ++k) {
      const dynamics::LaboratoryCollision& c = trials[t].collisions[k];
      fmt::format_to(row, "{},{},{}", id, t + 1, k + 1);
      if (leg) fmt::format_to(row, ",{}", c.leg);
      if (time) fmt::format_to(row, ",{:.6f}", c.time);
      if (position) fmt::format_to(row, ",{:.6f}", c.position);
      fmt::format_to(row, ",{:.6f}", c.reported_minus);
      if (after) fmt::format_to(row, ",{:.6f}", c.reported_plus);
      files.collisions_csv += '\n';
    }
    if (told("outcome")) files.trials_csv += fmt::format("{},{},{}\n", id, t + 1, outcome_name(trials[t].outcome));
  }
  if (options.camera) {
    options.camera->validate();
    markov::parallel_for(trials.size(), options.camera->threads, [&](std::size_t t) {
      recordings[t] = angles(conditions[trials[t].condition].id, trials[t], t, *options.camera);
    });
    result.angle_csv = "condition,trial,time_s,angle_rad\n";
    for (const std::string& part : recordings) *result.angle_csv += part;
  }
  return result;
}

}  // namespace metastable::analysis
