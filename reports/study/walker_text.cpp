#include "reports/study/walker_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <nlohmann/json.hpp>
#include <utility>

#include "reports/study/last_moments_text.h"
#include "reports/study/walker_figures.h"

namespace metastable::reports {
namespace {

using analysis::LastMoments;
using analysis::WalkerSetting;
using analysis::WalkerStudy;
using markov::MeshEstimate;
using WalkerJson = nlohmann::ordered_json;
using Lines = std::vector<std::pair<std::string, std::string>>;

Estimate estimate_of(const MeshEstimate& e) { return {e.value, e.lower, e.upper}; }

WalkerJson eigenvalues_json(const std::vector<std::complex<double>>& values) {
  WalkerJson json = WalkerJson::array();
  for (const auto& value : values) json.push_back({value.real(), value.imag()});
  return json;
}

WalkerJson mesh_estimate_json(const MeshEstimate& e) {
  return {{"value", e.value}, {"interval_95", {e.lower, e.upper}}};
}

// Where the study's survival begins with the share that survives one step, P(steps > n) begins at n = 0.
WalkerJson survival_json(const markov::MeshStudy& s) {
  WalkerJson survival = {1.0};
  for (const MeshEstimate& share : s.survival) survival.push_back(share.value);
  return survival;
}

WalkerJson survival_ends_json(const markov::MeshStudy& s) {
  WalkerJson ends = {WalkerJson{1.0, 1.0}};
  for (const MeshEstimate& share : s.survival) ends.push_back({share.lower, share.upper});
  return ends;
}

WalkerJson mesh_study_json(const std::string& name, const markov::MeshStudy& s) {
  WalkerJson sizes = WalkerJson::array();
  for (const markov::MeshSize& size : s.sizes)
    sizes.push_back(
        {{"spacing", size.spacing}, {"nodes", size.nodes}, {"entries", size.entries}, {"steps", size.steps}});
  WalkerJson gaits = WalkerJson::array();
  for (std::size_t g = 1; g < s.gait_share.size(); ++g)
    gaits.push_back({{"state", s.gaits.orbits[g].front()},
                     {"period", s.gaits.orbits[g].size()},
                     {"share_of_steps", s.gait_share[g]},
                     {"share_of_failures", s.gait_failures[g]}});
  const MeshEstimate regime = markov::steps_from_quasi_stationary(s);
  WalkerJson steps = mesh_estimate_json(s.steps);
  steps["from_quasi_stationary"] = regime.value;
  steps["from_quasi_stationary_interval_95"] = {regime.lower, regime.upper};
  return {{"setting", name},
          {"status", walker_status(s)},
          {"expected_steps", steps},
          {"failure_rate_per_step", mesh_estimate_json(s.failure_rate)},
          {"survival", survival_json(s)},
          {"survival_interval_95", survival_ends_json(s)},
          {"mixing_steps", s.mixing_steps},
          {"relative_errors",
           {{"shifts", s.shift_error},
            {"discretization", s.discretization_error},
            {"leaving_mesh", s.bracket},
            {"missed_failures", s.blind_spots.missed},
            {"imagined_failures", s.blind_spots.imagined}}},
          {"other_gaits", gaits},
          {"guided_sampling", s.guided ? mesh_estimate_json(*s.guided) : WalkerJson(nullptr)},
          {"direct_simulation", s.simulated ? mesh_estimate_json(*s.simulated) : WalkerJson(nullptr)},
          {"no_guided_sampling", s.guided ? WalkerJson(nullptr) : WalkerJson(s.no_guided)},
          {"no_direct_simulation", s.simulated ? WalkerJson(nullptr) : WalkerJson(s.no_simulated)},
          {"meshes", sizes},
          {"memory_bytes", s.expected_bytes}};
}

// Tells of the orbit around which a mesh lies; where it has several phases, of each. Period 0: there is none.
WalkerJson orbit_json(const std::vector<std::string>& names, const markov::MeshStudy& study) {
  const std::vector<markov::NoiseFrame>& frames = study.orbit.frames;
  if (study.period == 0)
    return {{"names", names},
            {"state", nullptr},
            {"eigenvalues", WalkerJson::array()},
            {"period", 0},
            {"longer_period", study.longer_period > 0 ? WalkerJson(study.longer_period) : WalkerJson(nullptr)},
            {"fails_without_noise_after",
             study.fails_without_noise > 0 ? WalkerJson(study.fails_without_noise) : WalkerJson(nullptr)}};
  WalkerJson json = {{"names", names},
                     {"state", frames.front().centre},
                     {"eigenvalues", eigenvalues_json(study.orbit.eigenvalues)},
                     {"period", study.period}};
  if (frames.size() == 1) return json;
  json["state_by_phase"] = WalkerJson::array();
  for (const markov::NoiseFrame& frame : frames) json["state_by_phase"].push_back(frame.centre);
  return json;
}

WalkerJson walker_study_json(const WalkerSetting& setting, const WalkerStudy& study) {
  WalkerJson json = mesh_study_json(setting.describe(), study.passage);
  if (study.passage.period != 1)
    json["gait"] = orbit_json(setting.map().names(), study.passage);
  else
    json["gait"] = {{"names", setting.map().names()},
                    {"state", study.gait.state},
                    {"eigenvalues", eigenvalues_json(study.gait.eigenvalues)},
                    {"period", 1}};
  return json;
}

std::string finished(WalkerJson json, const std::optional<LastMoments>& moments, const Provenance& provenance) {
  if (moments) json["how_it_fails"] = WalkerJson::parse(last_moments_json(*moments));
  json["provenance"] = {{"command", provenance.command},
                        {"settings", provenance.settings},
                        {"seed", provenance.seed},
                        {"version", provenance.version}};
  return json.dump(2) + "\n";
}

/// Returns the ratio of b's expected steps to a's; the errors of the two are taken as independent.
MeshEstimate ratio(const MeshEstimate& a, const MeshEstimate& b) {
  const double value = b.value / a.value;
  return {value, value * std::exp(-std::hypot(std::log(b.value / b.lower), std::log(a.upper / a.value))),
          value * std::exp(std::hypot(std::log(b.upper / b.value), std::log(a.value / a.lower)))};
}

constexpr double negligible_blind = 1e-4;  // of the failures: less is not told

Lines head_lines(const markov::MeshStudy& s) {
  return {{"expected steps before failure", estimate_text(s.steps)},
          {"  from the metastable regime", estimate_text(markov::steps_from_quasi_stationary(s))},
          {"  by guided sampling", s.guided ? estimate_text(*s.guided) : s.no_guided},
          {"  by direct simulation", s.simulated ? estimate_text(*s.simulated) : s.no_simulated},
          {"status", s.guided || s.simulated ? "agreed: the independent ways lie within their joint intervals"
                                             : "the mesh alone"},
          {"failure rate per step", estimate_text(s.failure_rate)},
          {"mixing", fmt::format("{:.3g} steps", s.mixing_steps)}};
}

Lines mesh_lines(const markov::MeshStudy& s) {
  Lines lines;
  for (std::size_t g = 1; g < s.gait_share.size(); ++g)
    lines.emplace_back("another gait",
                       fmt::format("at {:.6g}: {:.3g} of the steps, {:.3g} of the failures",
                                   fmt::join(s.gaits.orbits[g].front(), ", "), s.gait_share[g], s.gait_failures[g]));
  lines.emplace_back("relative errors", fmt::format("shifts {:.2g}, discretization {:.2g}, leaving the mesh {:.2g}",
                                                    s.shift_error, s.discretization_error, s.bracket));
  const double blind = std::max(s.blind_spots.missed, s.blind_spots.imagined);
  if (blind > negligible_blind) lines.back().second += fmt::format(", blind spots {:.2g}", blind);
  for (const markov::MeshSize& size : s.sizes)
    lines.emplace_back(fmt::format("mesh of spacing {:.3g} sd", size.spacing),
                       fmt::format("{} nodes, {} entries", size.nodes, size.entries));
  lines.emplace_back("memory", fmt::format("{:.2g} GB foreseen", s.expected_bytes / 0x1p30));
  return lines;
}

std::string lines_text(const std::string& head, const Lines& lines) {
  std::string text = head + "\n\n";
  for (const auto& [name, what] : lines) text += fmt::format("  {:<38}{}\n", name, what);
  return text;
}

// Tells of the orbit around which a mesh lies; of one of several phases, of each.
void add_orbit_lines(Lines& lines, const std::vector<std::string>& names, const markov::MeshStudy& study) {
  if (study.period == 0) {
    lines.emplace_back("gait",
                       study.fails_without_noise > 0
                           ? fmt::format("none: without noise it fails after {} steps", study.fails_without_noise)
                       : study.longer_period > 0
                           ? fmt::format("none of up to {} revolutions: without noise it comes back after {}",
                                         markov::longest_period, study.longer_period)
                           : std::string("none: without noise it comes to no orbit"));
    return;
  }
  if (study.period > 1) lines.emplace_back("gait: period", fmt::format("{} steps", study.orbit.frames.size()));
  for (std::size_t phase = 0; phase < study.orbit.frames.size(); ++phase)
    for (std::size_t k = 0; k < names.size(); ++k)
      lines.emplace_back(
          fmt::format("gait{}: {}", study.orbit.frames.size() > 1 ? fmt::format(", phase {}", phase) : "", names[k]),
          fmt::format("{:.9g}", study.orbit.frames[phase].centre[k]));
  lines.emplace_back("gait: eigenvalues", eigenvalues_text(study.orbit.eigenvalues));
}

std::string study_lines(const WalkerSetting& setting, const WalkerStudy& study) {
  Lines lines = head_lines(study.passage);
  const std::vector<std::string> names = setting.map().names();
  if (study.passage.period != 1) {
    add_orbit_lines(lines, names, study.passage);
  } else {
    for (std::size_t k = 0; k < study.gait.state.size(); ++k)
      lines.emplace_back("gait: " + names[k], fmt::format("{:.9f}", study.gait.state[k]));
    lines.emplace_back("gait: eigenvalues", eigenvalues_text(study.gait.eigenvalues));
  }
  for (auto& line : mesh_lines(study.passage)) lines.push_back(std::move(line));
  return lines_text(setting.describe(), lines);
}

std::string with_moments(std::string text, const std::optional<LastMoments>& moments, std::size_t width) {
  return moments ? text + "\n" + last_moments_text(*moments, "phase", width) : text;
}

}  // namespace

analysis::WalkerStudy agreed_walker(const WalkerSetting& setting, const markov::MeshStudyOptions& options,
                                    const Tell& tell) {
  markov::MeshStudyOptions told = options;
  told.progress = [&](double share) { tell(share, ""); };
  WalkerStudy study = analysis::study_walker(setting, told);
  tell(1, "");
  markov::require_agreement(study.passage, setting.describe());
  return study;
}

std::string estimate_text(const MeshEstimate& e) {
  const DecimalEstimate text = to_decimal(estimate_of(e), NumberFormat::general, 12);
  return fmt::format("{} (95 % interval {} to {})", plain_text(text.value), plain_text(text.lower),
                     plain_text(text.upper));
}

const char* walker_status(const markov::MeshStudy& study) {
  return study.guided || study.simulated ? "agreed" : "mesh_alone";
}

std::string walker_json(const WalkerSetting& setting, const WalkerStudy& study,
                        const std::optional<LastMoments>& moments, const Provenance& provenance) {
  return finished(walker_study_json(setting, study), moments, provenance);
}

std::string map_json(const MapStudy& study, const std::optional<LastMoments>& moments, const Provenance& provenance) {
  WalkerJson json = mesh_study_json(study.name, study.passage);
  json["gait"] = orbit_json(study.names, study.passage);
  return finished(std::move(json), moments, provenance);
}

std::string walkers_json(const std::vector<WalkerSetting>& settings, const std::vector<WalkerStudy>& studies,
                         const Provenance& provenance) {
  WalkerJson answer = {{"settings", WalkerJson::array()}, {"contrasts", WalkerJson::array()}};
  for (std::size_t i = 0; i < studies.size(); ++i) {
    answer["settings"].push_back(walker_study_json(settings[i], studies[i]));
    if (i > 0)
      answer["contrasts"].push_back(
          {{"of", i},
           {"against", 0},
           {"ratio", mesh_estimate_json(ratio(studies.front().passage.steps, studies[i].passage.steps))}});
  }
  return finished(std::move(answer), {}, provenance);
}

std::string walker_text(const WalkerSetting& setting, const WalkerStudy& study,
                        const std::optional<LastMoments>& moments, std::size_t width) {
  return with_moments(study_lines(setting, study), moments, width);
}

std::string map_text(const MapStudy& study, const std::optional<LastMoments>& moments, std::size_t width) {
  Lines lines = head_lines(study.passage);
  add_orbit_lines(lines, study.names, study.passage);
  for (auto& line : mesh_lines(study.passage)) lines.push_back(std::move(line));
  return with_moments(lines_text(study.name, lines), moments, width);
}

std::string walkers_text(const std::vector<WalkerSetting>& settings, const std::vector<WalkerStudy>& studies) {
  std::string text;
  for (std::size_t i = 0; i < studies.size(); ++i) text += study_lines(settings[i], studies[i]) + "\n";
  for (std::size_t i = 1; i < studies.size(); ++i)
    text += fmt::format("{}: {} times the steps of {}\n", settings[i].describe(),
                        format_estimate(estimate_of(ratio(studies.front().passage.steps, studies[i].passage.steps)),
                                        NumberFormat::significant, 4),
                        settings.front().describe());
  return text;
}

Table mesh_table(const std::string& name, const markov::MeshStudy& study, const Provenance& provenance) {
  Table table{.id = "steps", .title = name, .columns = {{"quantity"}, {"value"}}, .provenance = provenance};
  for (const Lines& lines : {head_lines(study), mesh_lines(study)})
    for (const auto& [what, value] : lines) table.rows.push_back({what, value});
  return table;
}

}  // namespace metastable::reports
