#include "analysis/experiment/experiment_folder.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <stdexcept>

#include "analysis/experiment/csv_field.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

std::string toml_spread(const Spread& spread) {
  return fmt::format("{{ mean = {}, sd = {} }}", spread.mean, spread.sd);
}

// Holds the nominal distributions; of a list of pairs, its means and sds.
struct Nominal {
  Spread restitution, friction;
};

Nominal nominal(const Setting& setting) {
  if (setting.pairs.empty()) return {setting.restitution, setting.friction};
  const auto spread = [&](double dynamics::Contact::*which) {
    const auto count = static_cast<double>(setting.pairs.size());
    double mean = 0, square = 0;
    for (const dynamics::Contact& pair : setting.pairs) mean += pair.*which / count;
    for (const dynamics::Contact& pair : setting.pairs) square += (pair.*which - mean) * (pair.*which - mean) / count;
    return Spread{mean, std::sqrt(square)};
  };
  return {spread(&dynamics::Contact::restitution), spread(&dynamics::Contact::friction)};
}

}  // namespace

ExperimentSource source_of(const ExperimentFiles& files, const std::string& name) {
  return {.folder = name,
          .experiment_toml = files.experiment_toml,
          .collisions_csv = files.collisions_csv,
          .trials_csv = files.trials_csv.empty() ? std::nullopt : std::optional(files.trials_csv),
          .angle_csv = {}};
}

std::vector<dynamics::Trial> simulate_trials(const Setting& setting, const SimulationOptions& options) {
  if (options.trials < 1 || options.trials > 1000000)
    throw std::invalid_argument(fmt::format("trials: {} is outside 1..1000000", options.trials));
  if (options.collisions < 1 || options.collisions > 100000)
    throw std::invalid_argument(fmt::format("collisions: {} is outside 1..100000", options.collisions));
  setting.validate();
  const dynamics::WheelMap map = setting.map();
  const dynamics::LaunchSpeed launch = setting.launch();
  const dynamics::TrialOptions trial{.first_landing_leg = setting.first_landing_leg,
                                     .max_collisions = options.collisions,
                                     .ramp_length = setting.ramp_length,
                                     .rest_rule = options.rest_rule,
                                     .seed = options.seed};
  std::vector<dynamics::Trial> trials(static_cast<std::size_t>(options.trials));
  const std::optional<dynamics::SettledMotion> motion =
      setting.law == dynamics::Law::settled ? std::optional(setting.motion()) : std::nullopt;
  markov::parallel_for(
      trials.size(), options.threads,
      [&](std::size_t t) {
        trials[t] = motion ? dynamics::simulate_trial(*motion, map.noise(), launch, trial, options.first + t)
                           : dynamics::simulate_trial(map, launch, trial, options.first + t);
      },
      options.progress);
  return trials;
}

std::string_view outcome_name(dynamics::Outcome outcome) {
  switch (outcome) {
    case dynamics::Outcome::rest:
      return "rest";
    case dynamics::Outcome::end_of_ramp:
      return "end_of_ramp";
    case dynamics::Outcome::max_collisions:
      return "max_collisions";
  }
  throw std::logic_error("unknown outcome");
}

std::string toml_text(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f')
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
    else
      quoted += c;
  }
  return quoted + '"';
}

std::string wheel_description(const Setting& setting, Spread restitution, Spread friction, const std::string& title,
                              const std::vector<std::string>& comment) {
  std::string toml;
  for (const std::string& line : comment) toml += "# " + line + "\n";
  toml += fmt::format("title = {}\n\n[wheel]\nhub_mass_kg = {}\nleg_lengths_m = [{}]\n", toml_text(title),
                      setting.wheel.hub_mass, fmt::join(setting.wheel.leg_length, ", "));
  if (setting.wheel.inertia) toml += fmt::format("inertia_kg_m2 = {}\n", *setting.wheel.inertia);
  if (setting.law != dynamics::Law::published)
    toml += fmt::format("radius_of_gyration_m = {}\n",
                        dynamics::contact_model(setting.wheel, setting.law).radius_of_gyration);
  else if (setting.wheel.radius_of_gyration)
    toml += fmt::format("radius_of_gyration_m = {}\n", *setting.wheel.radius_of_gyration);
  if (setting.wheel.tip_radius > 0) toml += fmt::format("tip_radius_m = {}\n", setting.wheel.tip_radius);
  toml += fmt::format("\n[contact]\nlaw = \"{}\"\nrestitution = {}\nfriction = {}\n", dynamics::law_name(setting.law),
                      toml_spread(restitution), toml_spread(friction));
  return toml;
}

std::string condition_description(const std::string& id, const Setting& setting, bool launch_stated,
                                  bool first_leg_stated) {
  std::string toml = fmt::format("\n[[condition]]\nid = {}\nslope_deg = {}\nramp_length_m = {}\n", toml_text(id),
                                 setting.slope_deg, setting.ramp_length);
  if (launch_stated) toml += fmt::format("initial_speed_rad_s = {}\n", toml_spread(setting.initial_speed));
  if (first_leg_stated) toml += fmt::format("first_landing_leg = {}\n", setting.first_landing_leg);
  return toml;
}

ExperimentFiles experiment_files(const std::vector<SimulatedCondition>& conditions, const std::string& title,
                                 const std::vector<std::string>& comment) {
  if (conditions.empty()) throw std::invalid_argument("experiment: no condition");
  const Setting& first = conditions.front().setting;
  const Nominal contact = nominal(first);
  ExperimentFiles files;
  std::string& toml = files.experiment_toml;
  toml = wheel_description(first, contact.restitution, contact.friction, title, comment);
  if (!first.pairs.empty()) toml += "# drawn from a list of pairs; these are its means and sds\n";

  files.collisions_csv = "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  files.trials_csv = "condition,trial,outcome\n";
  std::size_t number = 0;
  for (const auto& [id, setting, trials] : conditions) {
    toml += condition_description(id, setting);
    const std::string field = csv_field(id);
    for (const dynamics::Trial& trial : trials) {
      ++number;
      for (const dynamics::TrialCollision& c : trial.collisions)
        files.collisions_csv += fmt::format("{},{},{},{},{:.6f},{:.6f},{:.9g},{:.9g}\n", field, number, c.number, c.leg,
                                            c.time, c.position, c.omega_minus, c.omega_plus);
      files.trials_csv += fmt::format("{},{},{}\n", field, number, outcome_name(trial.outcome));
    }
  }
  return files;
}

ExperimentFiles experiment_files(const Setting& setting, const std::vector<dynamics::Trial>& trials,
                                 const std::string& title, const std::vector<std::string>& comment) {
  return experiment_files({{fmt::format("{}", setting.slope_deg), setting, trials}}, title, comment);
}

}  // namespace metastable::analysis
