#include "reports/experiment_commands/collisions_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <optional>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/experiment/input_error.h"
#include "analysis/experiment/rolling_speeds.h"
#include "analysis/motion_capture/angle_file.h"
#include "analysis/motion_capture/angle_mending.h"
#include "analysis/motion_capture/collision_comparison.h"
#include "analysis/statistics/median.h"
#include "markov/parallel.h"
#include "reports/output/answer.h"
#include "reports/output/output_file.h"
#include "reports/output/table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {
namespace fs = std::filesystem;

using analysis::FoundCollision;
using analysis::FoundTrial;

// From this standard error on [rad/s] a fitted speed tells little: the speeds of one wheel spread by about as much.
constexpr double vague_from = 0.2;

std::string text(const analysis::SpeedDifferences& d) {
  if (d.count < 2) return "too few to say";
  return fmt::format("bias {:+.4f} +- {:.4f} rad/s, spread (sd) {:.4f} rad/s, n = {}", d.bias, d.bias_half_width, d.sd,
                     d.count);
}

struct Files {
  std::string collisions = "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  std::string details =
      "condition,trial,collision,peak_time_s,omega_peak_rad_s,time_fit_s,omega_minus_fit_rad_s,omega_plus_fit_rad_s,"
      "fit_residual_rad,apex_time_s,omega_apex_rad_s,bounces\n";
};

Files write_files(const analysis::Experiment& experiment, const std::vector<analysis::MeasuredAngle>& angles,
                  const std::vector<FoundTrial>& found, const std::vector<dynamics::WheelMap>& maps, bool peak) {
  Files files;
  for (std::size_t t = 0; t < angles.size(); ++t) {
    const analysis::Condition& condition = experiment.conditions[angles[t].condition];
    const dynamics::WheelMap& map = maps[angles[t].condition];
    double position = 0;  // chord by chord
    for (const FoundCollision& c : found[t].collisions) {
      const std::string plus = c.fit && c.mended_rad_s == 0 ? fmt::format("{:.6g}", c.fit->omega_plus) : "";
      const std::string key = fmt::format("{},{},{}", csv_field(condition.id), angles[t].number, c.number);
      const int leg = (condition.first_landing_leg + c.number - 1) % experiment.legs();
      fmt::format_to(std::back_inserter(files.collisions), "{},{},{:.6f},{:.6f},{:.6g},{}\n", key, leg,
                     reported_time(c), position, reported_speed(c, peak), plus);
      position += map.advance(leg % map.phases());
      const std::string fit =
          c.fit ? fmt::format("{:.6f},{:.6g},{},{:.3g}", c.fit->time, c.fit->omega_minus, plus, c.fit->residual_sd_rad)
                : ",,,";
      fmt::format_to(std::back_inserter(files.details), "{},{:.6f},{:.6g},{},{:.6f},{:.6g},{}\n", key, c.peak_time,
                     c.peak, fit, c.apex_time, c.apex, c.bounces);
    }
  }
  return files;
}

void say_comparison(Answer& answer, const analysis::CollisionComparison& c) {
  answer.say("against the {} collisions of collisions.csv: {} found ({:.2f} %), {} others", c.due, c.found,
             c.due > 0 ? 100.0 * static_cast<double>(c.found) / static_cast<double>(c.due) : 0.0, c.others);
  answer.say("  omega_minus as written:  {}", text(c.written));
  answer.say("  omega_minus, peak:       {}", text(c.peak));
  answer.say("  omega_minus, stance fit: {}", text(c.fit_before));
  answer.say("  omega_plus, stance fit:  {}", text(c.fit_after));
}

// Refuses speeds that no wheel keeps up on such a ramp: times or angles are in another unit then.
void check_speeds(const analysis::Experiment& experiment, const std::vector<analysis::MeasuredAngle>& angles,
                  const std::vector<FoundTrial>& found, const std::string& file) {
  constexpr std::size_t enough = 3;
  constexpr double beyond_lifting = 1.25;
  for (std::size_t condition = 0; condition < experiment.conditions.size(); ++condition) {
    std::vector<double> speeds;
    for (std::size_t t = 0; t < angles.size(); ++t)
      for (const FoundCollision& c : found[t].collisions)
        if (angles[t].condition == condition && c.number > 1) speeds.push_back(analysis::reported_speed(c, false));
    if (speeds.size() < enough) continue;
    const analysis::RollingSpeeds bounds = analysis::rolling_speeds(experiment, condition);
    const double middle = analysis::median(speeds);
    if (middle >= bounds.slowest && middle <= beyond_lifting * bounds.lifting) continue;
    throw std::invalid_argument(fmt::format(
        "{}: condition '{}': half of the speeds before a collision are {} {:.3g} rad/s, where a wheel that "
        "comes over its legs on this ramp has {:.3g} at least and lifts its feet at {:.3g}: is time_s in seconds, "
        "is angle_rad in radians, and is the slope right?",
        file, experiment.conditions[condition].id, middle < bounds.slowest ? "below" : "above", middle,
        bounds.slowest / analysis::RollingSpeeds::room, bounds.lifting));
  }
}

// Says which fitted speeds are less exact than the others, and why.
void say_fits(Answer& answer, const std::vector<FoundTrial>& found) {
  std::size_t less_one = 0, rough = 0, vague = 0, mended = 0;
  double most_stray = 0, roughest = 0, vaguest = 0, wildest = 0;
  for (const FoundTrial& trial : found)
    for (const FoundCollision& c : trial.collisions) {
      less_one += c.stray_rad > 0;
      most_stray = std::max(most_stray, c.stray_rad);
      rough += c.rough_rad > 0;
      mended += c.mended_rad_s > 0;
      wildest = std::max(wildest, c.mended_rad_s);
      if (c.fit && c.mended_rad_s == 0 && c.fit->omega_minus_se > vague_from) {
        ++vague;
        vaguest = std::max(vaguest, c.fit->omega_minus_se);
      }
      roughest = std::max(roughest, c.rough_rad);
    }
  if (less_one > 0)
    answer.say(
        "{} collisions are fitted without one frame, which lies off the motion of the others by up to {:.2g} rad",
        less_one, most_stray);
  if (mended > 0)
    answer.say(
        "{} collisions have omega_minus from the time since the collision before, off which the fit lies by up to "
        "{:.2g} "
        "rad/s, as noise and frames that are off make it; their omega_plus is left out",
        mended, wildest);
  if (vague > 0)
    answer.say(
        "the noise of the angle leaves omega_minus of {} collisions open by more than {} rad/s (standard error, up to "
        "{:.2g}): film at a higher rate, or leave them out",
        vague, vague_from, vaguest);
  if (rough > 0)
    answer.say(
        "{} collisions leave more than the noise of the angle beside their fit (sd up to {:.2g} rad), as where frames "
        "are lost or off, or a foot hops: their speeds are less exact (column fit_residual_rad of the details)",
        rough, roughest);
}

// Names trials that trials.csv lists as rest but that roll on after the last collision written: read together, the two
// files would put the rest too early.
void say_cut_rests(Answer& answer, const analysis::ExperimentSource& source, const std::string& collisions,
                   const std::vector<analysis::MeasuredAngle>& angles, const std::vector<char>& cut,
                   std::size_t limit) {
  if (!source.trials_csv) return;
  analysis::ExperimentSource written = source;
  written.collisions_csv = collisions;
  analysis::Experiment experiment;
  try {
    experiment = analysis::parse_experiment(written);
  } catch (const analysis::InputError& error) {
    answer.say("trials.csv does not go with these collisions: {}", error.lines().front());
    return;
  }
  std::map<int, dynamics::Outcome> outcomes;
  for (const analysis::MeasuredTrial& trial : experiment.trials)
    if (trial.outcome) outcomes[trial.number] = *trial.outcome;
  std::vector<int> early;
  for (std::size_t t = 0; t < angles.size(); ++t) {
    const auto outcome = outcomes.find(angles[t].number);
    if (cut[t] && outcome != outcomes.end() && outcome->second == dynamics::Outcome::rest)
      early.push_back(angles[t].number);
  }
  if (early.empty()) return;
  answer.say(
      "{} trials that trials.csv lists as rest roll on after collision {}, where they are cut (the first is trial {}): "
      "raise --collisions, or list them as max_collisions",
      early.size(), limit, early.front());
}

// Holds what the folder tells.
struct Filmed {
  analysis::ExperimentSource source;
  analysis::Experiment experiment;  // without trials
  std::string angle_file;
  analysis::MendedAngles mended;
  std::optional<analysis::Experiment> known;  // with the collisions that are there already
};

Filmed read_filmed(const fs::path& folder) {
  Filmed filmed{analysis::read_source(folder), {}, (folder / "angle.csv").string(), {}, {}};
  filmed.experiment = analysis::parse_description(filmed.source);
  if (filmed.experiment.system != analysis::System::rimless_wheel)
    throw std::invalid_argument(fmt::format("{}: a coast-down has no collisions to find", folder.string()));
  filmed.mended = analysis::mend_angles(analysis::parse_angles(filmed.source, filmed.experiment), filmed.experiment,
                                        filmed.angle_file);
  if (filmed.source.collisions_csv) filmed.known = analysis::parse_experiment(filmed.source);
  return filmed;
}

// Returns the file of the collisions, "-" for standard output. @throws std::invalid_argument if it is one that is read
fs::path collisions_path(const CollisionsRequest& request, bool known) {
  const fs::path folder = request.folder;
  const fs::path out = !request.out.empty() ? fs::path(request.out)
                       : known              ? folder / "collisions-from-angle.csv"
                                            : folder / "collisions.csv";
  if (out == "-" && !request.json.empty())
    throw std::invalid_argument("--json: there is none with --out -, which prints the collisions themselves");
  for (const char* read : {"experiment.toml", "angle.csv", "trials.csv"})
    if (same_file(out, folder / read))
      throw std::invalid_argument(fmt::format("--out: {} is what is read", out.string()));
  return out;
}

// Returns the nominal return map of each condition.
std::vector<dynamics::WheelMap> condition_maps(const analysis::Experiment& experiment) {
  std::vector<dynamics::WheelMap> maps;
  for (const analysis::Condition& condition : experiment.conditions) {
    analysis::Setting setting;
    setting.wheel = experiment.wheel;
    setting.slope_deg = condition.slope_deg;
    setting.law = experiment.contact.law;
    setting.first_landing_leg = condition.first_landing_leg;
    maps.push_back(setting.map());
  }
  return maps;
}

// Holds the trials in the order of their angles.
struct FoundTrials {
  std::vector<FoundTrial> trials;
  std::vector<char> cut;  // whether a trial has more collisions than were asked for
};

// @throws analysis::InputError, a line for each trial that is refused
FoundTrials find_trials(const Filmed& filmed, const std::vector<dynamics::WheelMap>& maps,
                        analysis::FinderOptions finder, int threads) {
  // One more than asked for tells a trial that ends there from one that is cut.
  const auto limit = static_cast<std::size_t>(finder.collisions++);
  const std::vector<analysis::MeasuredAngle>& angles = filmed.mended.angles;
  FoundTrials found{std::vector<FoundTrial>(angles.size()), std::vector<char>(angles.size())};
  std::vector<std::string> refused(angles.size());
  markov::parallel_for(angles.size(), threads, [&](std::size_t t) {
    const auto& [number, condition, recording] = angles[t];
    try {
      FoundTrial& trial = found.trials[t];
      trial = analysis::find_collisions(recording, maps[condition],
                                        filmed.experiment.conditions[condition].first_landing_leg, finder);
      found.cut[t] = trial.collisions.size() > limit;
      if (found.cut[t]) trial.collisions.resize(limit);
    } catch (const std::invalid_argument& error) {
      refused[t] = fmt::format("trial {}: {}", number, error.what());
    }
  });
  analysis::Defects defects;
  for (const std::string& why : refused)
    if (!why.empty()) defects.add(filmed.angle_file, {}, why);
  defects.check();
  return found;
}

// Counts what was found, over all trials.
struct Counts {
  std::size_t collisions = 0, bounces = 0, unfitted = 0;
  std::map<std::string, std::size_t> stopped;  // trials without a collision, by reason
};

Counts count(const std::vector<FoundTrial>& found) {
  Counts counts;
  for (const FoundTrial& trial : found) {
    counts.collisions += trial.collisions.size();
    for (const FoundCollision& c : trial.collisions) {
      counts.bounces += static_cast<std::size_t>(c.bounces);
      counts.unfitted += !c.fit;
    }
    if (trial.collisions.empty()) ++counts.stopped[trial.stopped];
  }
  return counts;
}

void say_found(Answer& answer, const Counts& counts, const std::vector<FoundTrial>& found, bool peak) {
  answer.say("omega_minus is the {}", peak ? "peak of the smoothed speed (biased low by the smoothing)"
                                           : "stance motion extrapolated to the collision");
  if (counts.unfitted > 0)
    answer.say(
        "{} collisions have too few frames around them for the fit: omega_minus is their peak, omega_plus is left "
        "empty",
        counts.unfitted);
  say_fits(answer, found);
  for (const auto& [why, trials] : counts.stopped) answer.say("{} trials without a collision: {}", trials, why);
}

}  // namespace

void run_collisions(const CollisionsRequest& request) {
  const Filmed filmed = read_filmed(request.folder);
  const std::vector<analysis::MeasuredAngle>& angles = filmed.mended.angles;
  const fs::path out = collisions_path(request, filmed.known.has_value());
  const bool to_terminal = out == "-";
  Answer answer(request.json);
  OutputFile collisions_file(out);
  const fs::path details = out.parent_path() / (out.stem().string() + "-details.csv");
  std::optional<OutputFile> details_file;
  if (!to_terminal) details_file.emplace(details);

  const std::vector<dynamics::WheelMap> maps = condition_maps(filmed.experiment);
  const auto [found, cut] = find_trials(filmed, maps, request.finder, request.threads);
  check_speeds(filmed.experiment, angles, found, filmed.angle_file);
  const Files files = write_files(filmed.experiment, angles, found, maps, request.peak);
  collisions_file.stream() << files.collisions;
  if (details_file) {
    details_file->stream() << files.details;
    details_file->commit();
  }
  collisions_file.commit();
  if (to_terminal) {  // where the collisions themselves are
    for (const std::string& sentence : filmed.mended.said) fmt::print(stderr, "mended: {}\n", sentence);
    return;
  }

  const Counts counts = count(found);
  const auto limit = static_cast<std::size_t>(request.finder.collisions);
  answer.say("{}: {} collisions of {} trials, {} bounces in between; apexes and bounces in {}", out.string(),
             counts.collisions, angles.size(), counts.bounces, details.string());
  for (const std::string& sentence : filmed.mended.said) answer.say("mended: {}", sentence);
  say_found(answer, counts, found, request.peak);
  if (const auto trials = std::count(cut.begin(), cut.end(), 1); trials > 0)
    answer.say("{} trials roll on after collision {}, where --collisions stops them", trials, limit);
  say_cut_rests(answer, filmed.source, files.collisions, angles, cut, limit);
  if (filmed.known)
    say_comparison(answer,
                   analysis::compare_collisions(*filmed.known, angles, found, request.peak, request.finder.collisions));
  answer.fact("collisions", counts.collisions);
  answer.fact("trials", angles.size());
  answer.fact("bounces", counts.bounces);
  answer.file(out.string());
  answer.file(details.string());
  answer.finish({request.command, {}, 0, version()});
}

}  // namespace metastable::reports
