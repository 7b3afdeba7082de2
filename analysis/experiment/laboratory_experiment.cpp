#include "analysis/experiment/laboratory_experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <numbers>
#include <stdexcept>

#include "analysis/experiment/angle_recording.h"
#include "analysis/experiment/csv_field.h"
#include "analysis/experiment/experiment_notes.h"
#include "analysis/experiment/suggestion.h"
#include "analysis/statistics/random.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

// Returns the number that a reader finds where the files hold this one.
double as_written(double value) {
  const std::string text = fmt::format("{:.6f}", value);
  double read = 0;
  std::from_chars(text.data(), text.data() + text.size(), read);
  return read;
}

// Returns what experiment.toml says of a wheel.
dynamics::Wheel stated_wheel(const Setting& setting) {
  dynamics::Wheel wheel;
  wheel.hub_mass = setting.wheel.hub_mass;
  wheel.leg_length = setting.wheel.leg_length;
  wheel.inertia = setting.wheel.inertia;
  wheel.radius_of_gyration = setting.law == dynamics::Law::published
                                 ? setting.wheel.radius_of_gyration
                                 : dynamics::contact_model(setting.wheel, setting.law).radius_of_gyration;
  return wheel;
}

std::string angles(const std::string& id, const dynamics::LaboratoryTrial& trial, std::size_t index,
                   const CameraOptions& camera) {
  const bool rested = trial.outcome == dynamics::Outcome::rest;
  const double last = trial.collisions.back().time, turned = trial.motion.back().time;
  const double begin = trial.motion.front().time, end = rested ? 2 * turned - last + recorded_after_rest_s : turned;
  const double offset = uniform_at(camera.seed, index, 0, 201);
  std::string rows;
  for (std::uint64_t k = 0;; ++k) {
    const double time = begin + (static_cast<double>(k) + offset) / camera.rate;
    if (!(time < end)) return rows;
    // A wheel that turns back falls the way it came, onto both feet.
    const double moment = rested && time > turned ? std::max(last, 2 * turned - time) : time;
    const double noise =
        camera.noise_sd_rad > 0
            ? camera.noise_sd_rad * dynamics::normal_quantile(uniform_at(camera.seed, index, k + 1, 201))
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

dynamics::LaboratorySetup laboratory_setup(const std::vector<LaboratoryCondition>& conditions,
                                           const LaboratoryOptions& options) {
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
      std::swap(
          setup.order[i],
          setup.order[static_cast<std::size_t>(uniform_at(options.seed, i, 0, 200) * static_cast<double>(i + 1))]);
  return setup;
}

std::vector<dynamics::LaboratoryTrial> run_laboratory(const dynamics::LaboratorySetup& setup, int threads,
                                                      const markov::Share& progress) {
  const dynamics::Laboratory laboratory(setup);
  std::vector<dynamics::LaboratoryTrial> trials(setup.order.size());
  markov::parallel_for(
      trials.size(), threads, [&](std::size_t t) { trials[t] = laboratory.run(t); }, progress);
  return trials;
}

const std::vector<std::string>& droppable() {
  static const std::vector<std::string> names{
      "leg", "time_s", "position_m", "omega_plus_rad_s", "outcome", "initial_speed_rad_s", "noise"};
  return names;
}

Experiment experiment_of(const std::vector<LaboratoryCondition>& conditions, const dynamics::LaboratorySetup& setup,
                         const std::vector<dynamics::LaboratoryTrial>& trials, const FolderOptions& options) {
  if (conditions.empty()) throw std::invalid_argument("laboratory: no condition");
  for (const std::string& name : options.dropped) require_word("drop", name, droppable());
  const auto told = [&](std::string_view name) {
    return std::find(options.dropped.begin(), options.dropped.end(), name) == options.dropped.end();
  };
  const Setting& first = conditions.front().setting;
  Experiment experiment;
  experiment.title = options.title;
  experiment.wheel = stated_wheel(first);
  experiment.contact = {first.law, options.restitution.value_or(first.restitution),
                        options.friction.value_or(first.friction)};
  for (const auto& [id, setting, count] : conditions) {
    Condition& condition = experiment.conditions.emplace_back();
    condition.id = id;
    condition.slope_deg = setting.slope_deg;
    condition.ramp_length = setting.ramp_length;
    if (told("initial_speed_rad_s")) condition.initial_speed = setting.initial_speed;
    condition.first_landing_leg = setting.first_landing_leg;
    condition.first_leg_stated = true;
  }
  if (options.camera) experiment.sensor.rate = options.camera->rate;
  if (told("noise")) experiment.sensor.noise_sd = setup.sensor_noise;

  const auto presence = [&](std::string_view name) { return told(name) ? Presence::all : Presence::none; };
  experiment.columns = {presence("leg"), presence("time_s"), presence("position_m"), presence("omega_plus_rad_s"),
                        told("outcome")};
  const auto given = [](Presence column, auto value) {
    return column == Presence::all ? std::optional(value) : std::nullopt;
  };
  for (const dynamics::LaboratoryTrial& trial : trials) {
    MeasuredTrial& measured = experiment.trials.emplace_back();
    measured.number = static_cast<int>(experiment.trials.size());
    measured.condition = trial.condition;
    for (const dynamics::LaboratoryCollision& c : trial.collisions)
      measured.collisions.push_back(
          {static_cast<int>(measured.collisions.size()) + 1, given(experiment.columns.leg, c.leg),
           given(experiment.columns.time, as_written(c.time)),
           given(experiment.columns.position, as_written(c.position)), as_written(c.reported_minus),
           given(experiment.columns.omega_plus, as_written(c.reported_plus))});
    if (experiment.columns.outcomes) measured.outcome = trial.outcome;
  }
  experiment.notes = notes_on(experiment);
  return experiment;
}

LaboratoryFiles laboratory_files(const std::vector<LaboratoryCondition>& conditions,
                                 const dynamics::LaboratorySetup& setup,
                                 const std::vector<dynamics::LaboratoryTrial>& trials, const FolderOptions& options) {
  if (options.camera && setup.law == dynamics::Law::settled)
    throw std::invalid_argument(
        "laboratory: a camera is pointed at wheels of published, coulomb or plastic; under settled its collisions are "
        "told alone");
  const Experiment told = experiment_of(conditions, setup, trials, options);
  LaboratoryFiles result;
  ExperimentFiles& files = result.files;
  files.experiment_toml = wheel_description(conditions.front().setting, told.contact.restitution, told.contact.friction,
                                            told.title, options.comment);
  for (std::size_t c = 0; c < conditions.size(); ++c)
    files.experiment_toml +=
        condition_description(conditions[c].id, conditions[c].setting, told.conditions[c].initial_speed.has_value());
  std::string sensor;
  if (told.sensor.rate) sensor += fmt::format("rate_hz = {}\n", *told.sensor.rate);
  if (told.sensor.noise_sd) sensor += fmt::format("noise_sd_rad_s = {}\n", *told.sensor.noise_sd);
  if (!sensor.empty()) files.experiment_toml += "\n[sensor]\n" + sensor;

  const auto name = [](Presence column, const char* text) { return column == Presence::all ? text : ""; };
  files.collisions_csv =
      fmt::format("condition,trial,collision{}{}{},omega_minus_rad_s{}\n", name(told.columns.leg, ",leg"),
                  name(told.columns.time, ",time_s"), name(told.columns.position, ",position_m"),
                  name(told.columns.omega_plus, ",omega_plus_rad_s"));
  if (told.columns.outcomes) files.trials_csv = "condition,trial,outcome\n";
  for (const MeasuredTrial& trial : told.trials) {
    const std::string id = csv_field(told.conditions[trial.condition].id);
    auto row = std::back_inserter(files.collisions_csv);
    for (const MeasuredCollision& c : trial.collisions) {
      fmt::format_to(row, "{},{},{}", id, trial.number, c.number);
      if (c.leg) fmt::format_to(row, ",{}", *c.leg);
      if (c.time) fmt::format_to(row, ",{:.6f}", *c.time);
      if (c.position) fmt::format_to(row, ",{:.6f}", *c.position);
      fmt::format_to(row, ",{:.6f}", c.omega_minus);
      if (c.omega_plus) fmt::format_to(row, ",{:.6f}", *c.omega_plus);
      files.collisions_csv += '\n';
    }
    if (trial.outcome) files.trials_csv += fmt::format("{},{},{}\n", id, trial.number, outcome_name(*trial.outcome));
  }
  if (options.camera) {
    options.camera->validate();
    std::vector<std::string> recordings(trials.size());
    markov::parallel_for(
        trials.size(), options.camera->threads,
        [&](std::size_t t) {
          recordings[t] = angles(conditions[trials[t].condition].id, trials[t], t, *options.camera);
        },
        options.camera->progress);
    result.angle_csv = "condition,trial,time_s,angle_rad\n";
    for (const std::string& part : recordings) *result.angle_csv += part;
  }
  return result;
}

}  // namespace metastable::analysis
