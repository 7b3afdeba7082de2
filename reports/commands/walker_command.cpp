#include "reports/commands/walker_command.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <stdexcept>

#include "analysis/walkers/walker_falls.h"
#include "reports/commands/sweep_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/output_file.h"
#include "reports/output/page_folder.h"
#include "reports/output/standard_output.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/study/last_moments_text.h"
#include "reports/study/study_progress.h"
#include "reports/study/walker_figures.h"

namespace metastable::reports {
namespace {

using analysis::WalkerFalls;
using analysis::WalkerSetting;
using analysis::WalkerStudy;
using markov::MeshEstimate;
using WalkerJson = nlohmann::ordered_json;

WalkerStudy walker_study(const WalkerSetting& setting, const WalkerRequest& request, Progress& progress) {
  markov::MeshStudyOptions options = request.study;
  options.progress = [told = study_progress(progress)](double share) { told(share, ""); };
  WalkerStudy study = analysis::study_walker(setting, options);
  options.progress(1);
  if (!study.passage.disagreement.empty())
    throw std::runtime_error(fmt::format("{}: {}", setting.describe(), study.passage.disagreement));
  return study;
}

Provenance walker_provenance(const WalkerRequest& request) {
  Provenance provenance{request.command, {}, request.study.seed, version()};
  for (const WalkerSetting& setting : request.settings)
    provenance.settings += (provenance.settings.empty() ? "" : "\n") + setting.describe();
  return provenance;
}

Estimate estimate_of(const MeshEstimate& e) { return {e.value, e.lower, e.upper}; }

WalkerJson mesh_estimate_json(const MeshEstimate& e) {
  return {{"value", e.value}, {"interval_95", {e.lower, e.upper}}};
}

const char* walker_status(const markov::MeshStudy& study) {
  return study.guided || study.simulated ? "agreed" : "mesh_alone";
}

WalkerJson walker_json(const WalkerSetting& setting, const WalkerStudy& study) {
  const markov::MeshStudy& s = study.passage;
  WalkerJson eigenvalues = WalkerJson::array(), sizes = WalkerJson::array();
  for (const auto& value : study.gait.eigenvalues) eigenvalues.push_back({value.real(), value.imag()});
  for (const markov::MeshSize& size : s.sizes)
    sizes.push_back(
        {{"spacing", size.spacing}, {"nodes", size.nodes}, {"entries", size.entries}, {"steps", size.steps}});
  return {{"setting", setting.describe()},
          {"status", walker_status(s)},
          {"expected_steps", mesh_estimate_json(s.steps)},
          {"failure_rate_per_step", mesh_estimate_json(s.failure_rate)},
          {"mixing_steps", s.mixing_steps},
          {"relative_errors",
           {{"shifts", s.shift_error}, {"discretization", s.discretization_error}, {"leaving_mesh", s.bracket}}},
          {"guided_sampling", s.guided ? mesh_estimate_json(*s.guided) : WalkerJson(nullptr)},
          {"direct_simulation", s.simulated ? mesh_estimate_json(*s.simulated) : WalkerJson(nullptr)},
          {"gait", {{"names", setting.map().names()}, {"state", study.gait.state}, {"eigenvalues", eigenvalues}}},
          {"meshes", sizes},
          {"memory_bytes", s.expected_bytes}};
}

void write_walker_json(OutputFile& file, WalkerJson json, const WalkerRequest& request) {
  const Provenance provenance = walker_provenance(request);
  json["provenance"] = {{"command", provenance.command},
                        {"settings", provenance.settings},
                        {"seed", provenance.seed},
                        {"version", provenance.version}};
  file.stream() << json.dump(2) << '\n';
  file.commit();
}

void print_line(const std::string& name, const std::string& what) { say("  {:<38}{}\n", name, what); }

std::string with_interval(const MeshEstimate& e) {
  const DecimalEstimate text = to_decimal(estimate_of(e), NumberFormat::general, 12);
  return fmt::format("{} (95 % interval {} to {})", plain_text(text.value), plain_text(text.lower),
                     plain_text(text.upper));
}

void print_walker(const WalkerSetting& setting, const WalkerStudy& study) {
  const markov::MeshStudy& s = study.passage;
  say("{}\n\n", setting.describe());
  print_line("expected steps before failure", with_interval(s.steps));
  print_line("  by guided sampling", s.guided ? with_interval(*s.guided) : "not asked: failures are too frequent");
  print_line("  by direct simulation", s.simulated ? with_interval(*s.simulated) : "out of reach");
  print_line("status", s.guided || s.simulated ? "agreed: the independent ways lie within their joint intervals"
                                               : "the mesh alone");
  print_line("failure rate per step", with_interval(s.failure_rate));
  print_line("mixing", fmt::format("{:.3g} steps", s.mixing_steps));
  const std::vector<std::string> names = setting.map().names();
  for (std::size_t k = 0; k < study.gait.state.size(); ++k)
    print_line("gait: " + names[k], fmt::format("{:.9f}", study.gait.state[k]));
  print_line("gait: eigenvalues", eigenvalues_text(study.gait));
  print_line("relative errors", fmt::format("shifts {:.2g}, discretization {:.2g}, leaving the mesh {:.2g}",
                                            s.shift_error, s.discretization_error, s.bracket));
  for (const markov::MeshSize& size : s.sizes)
    print_line(fmt::format("mesh of spacing {:.3g} sd", size.spacing),
               fmt::format("{} nodes, {} entries", size.nodes, size.entries));
  print_line("memory", fmt::format("{:.2g} GB foreseen", s.expected_bytes / 0x1p30));
}

/// The ratio of b's expected steps to a's; the errors of the two are taken as independent.
MeshEstimate ratio(const MeshEstimate& a, const MeshEstimate& b) {
  const double value = b.value / a.value;
  return {value, value * std::exp(-std::hypot(std::log(b.value / b.lower), std::log(a.upper / a.value))),
          value * std::exp(std::hypot(std::log(b.upper / b.value), std::log(a.value / a.lower)))};
}

}  // namespace

void run_walker_steps(const WalkerRequest& request) {
  const WalkerSetting& setting = request.settings.front();
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const WalkerStudy study = [&] {
    Progress progress("steps", study_units);
    return walker_study(setting, request, progress);
  }();
  std::optional<WalkerFalls> falls;
  if (request.how_it_fails) falls = analysis::how_it_falls(setting, study, request.study);
  if (json) {
    WalkerJson answer = walker_json(setting, study);
    if (falls) answer["how_it_fails"] = WalkerJson::parse(last_moments_json(falls->moments));
    write_walker_json(*json, std::move(answer), request);
  }
  if (request.json == "-") return;
  print_walker(setting, study);
  if (falls) say("\n{}", last_moments_text(falls->moments, "phase", terminal_width()));
}

void run_walker_compare(const WalkerRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  std::vector<WalkerStudy> studies;
  {
    Progress progress("compare", study_units * request.settings.size());
    for (const WalkerSetting& setting : request.settings) studies.push_back(walker_study(setting, request, progress));
  }
  std::vector<MeshEstimate> ratios;
  for (std::size_t i = 1; i < studies.size(); ++i)
    ratios.push_back(ratio(studies.front().passage.steps, studies[i].passage.steps));
  if (json) {
    WalkerJson answer = {{"settings", WalkerJson::array()}, {"contrasts", WalkerJson::array()}};
    for (std::size_t i = 0; i < studies.size(); ++i)
      answer["settings"].push_back(walker_json(request.settings[i], studies[i]));
    for (std::size_t i = 0; i < ratios.size(); ++i)
      answer["contrasts"].push_back({{"of", i + 1}, {"against", 0}, {"ratio", mesh_estimate_json(ratios[i])}});
    write_walker_json(*json, std::move(answer), request);
  }
  if (request.json == "-") return;
  for (std::size_t i = 0; i < studies.size(); ++i) {
    print_walker(request.settings[i], studies[i]);
    say("\n");
  }
  for (std::size_t i = 0; i < ratios.size(); ++i)
    say("{}: {} times the steps of {}\n", request.settings[i + 1].describe(),
        format_estimate(estimate_of(ratios[i]), NumberFormat::significant, 4), request.settings.front().describe());
}

void run_walker_sweep(const WalkerRequest& request) {
  for (const WalkerSetting& setting : request.settings) setting.map();  // wrong settings before the first is computed
  const WalkerSetting& first = request.settings.front();
  const std::string what =
      fmt::format("walker {}, terrain {}", analysis::walker_name(first.walker), analysis::terrain_name(first.terrain));
  SweepFile sweep{request.out,
                  fmt::format("# sweep: {}\n# axes: slope = {}; slope-sd = {}\n# spacing {}, seed {}\n# version: {}\n"
                              "slope [deg],slope-sd [deg],expected_steps,expected_steps_low95,expected_steps_high95,"
                              "failure_rate_per_step,mixing_steps,guided_sampling,direct_simulation,status\n",
                              what, fmt::join(request.slopes, " "), fmt::join(request.slope_sds, " "),
                              request.study.spacing, request.study.seed, version()),
                  {{"slope", "deg", request.slopes}, {"sd of the slope", "deg", request.slope_sds}},
                  {request.command, what, request.study.seed, version()}};
  run_sweep_file(sweep, [&](std::size_t had, const auto& add) {
    Progress progress("sweep", study_units * request.settings.size());
    progress.skip(study_units * had);
    for (std::size_t i = had; i < request.settings.size(); ++i) {
      const WalkerSetting& setting = request.settings[i];
      std::string row = fmt::format("{},{},", setting.slope_deg, setting.slope_sd_deg);
      const auto other = [](const std::optional<MeshEstimate>& e) { return e ? fmt::format("{}", e->value) : ""; };
      try {
        const markov::MeshStudy s = walker_study(setting, request, progress).passage;
        row += fmt::format("{},{},{},{},{},{},{},{}", s.steps.value, s.steps.lower, s.steps.upper, s.failure_rate.value,
                           s.mixing_steps, other(s.guided), other(s.simulated), walker_status(s));
      } catch (const Interrupted&) {
        throw;
      } catch (const std::runtime_error& error) {  // no gait that is stable, or ways that disagree: the others go on
        row += fmt::format(",,,,,,,{}", csv_field(error.what()));
      } catch (const std::domain_error& error) {
        row += fmt::format(",,,,,,,{}", csv_field(error.what()));
      }
      add(row + "\n");
    }
  });
}

void run_walker_simulate(const WalkerRequest& request) {
  const WalkerSetting& setting = request.settings.front();
  const std::filesystem::path folder = request.out;
  for (const char* name : {"walks.csv", "trials.csv", "experiment.toml"})
    if (std::filesystem::exists(folder / name))
      throw OutputError(folder, fmt::format("already holds {}; choose another folder", name));
  OutputFolder whole(folder);
  const std::vector<analysis::Walk> walks = analysis::simulate_walks(setting, request.walks);
  const Provenance provenance = walker_provenance(request);
  std::string head, steps = "trial,step", trials = "trial,steps,outcome\n";
  for (const std::string& line : provenance_lines(provenance)) head += "# " + line + "\n";
  for (const std::string& name : setting.map().names()) steps += "," + csv_field(name);
  steps += ",slope met [deg]\n";
  std::size_t fallen = 0;
  for (std::size_t trial = 0; trial < walks.size(); ++trial) {
    const analysis::Walk& walk = walks[trial];
    for (std::size_t step = 0; step < walk.steps.size(); ++step)
      steps += fmt::format("{},{},{},{}\n", trial + 1, step + 1, fmt::join(walk.steps[step].state, ","),
                           walk.steps[step].slope_deg);
    trials += fmt::format("{},{},{}\n", trial + 1, walk.steps.size(), walk.fell ? "fell" : "walked on");
    fallen += walk.fell;
  }
  write_file(whole.path() / "walks.csv", head + steps);
  write_file(whole.path() / "trials.csv", head + trials);
  whole.commit("trials.csv");
  say("{}: {} trials, {} of them fell\n", request.out, walks.size(), fallen);
}

void run_walker_report(const WalkerRequest& request) {
  PageFolder pages(request.out);
  const Provenance provenance = walker_provenance(request);
  std::vector<StudiedWalker> walkers;
  {
    Progress progress("report", study_units * request.settings.size());
    for (const WalkerSetting& setting : request.settings) {
      WalkerStudy study = walker_study(setting, request, progress);
      WalkerFalls falls = analysis::how_it_falls(setting, study, request.study);
      walkers.push_back({setting, std::move(study), std::move(falls)});
    }
  }
  Page& page = pages.page();
  page.title = "Metastability of walkers on two legs";
  page.intro = {
      "Expected steps before a passive walker on rough ground falls, from meshes of its stochastic return map."};
  for (const WalkerSetting& setting : request.settings) page.intro.push_back(setting.describe() + ".");
  page.provenance = provenance;
  pages.section("walkers", "The walkers side by side", "Read down a column for one walker.",
                {walker_survival_figure(walkers, provenance)}, {walkers_table(walkers, provenance)});
  for (std::size_t i = 0; i < walkers.size(); ++i) {
    const std::string id = fmt::format("walker-{}", i + 1);
    const std::string name = walkers[i].setting.describe();
    pages.section(
        id + "-section", "Basin and failure in the section: " + name,
        "Each dot is a state just after a strike, a node of the mesh. From some a walker comes back to its gait "
        "(within one sd of the noise), from others it falls before; and where the last steps before a fall "
        "begin, beside all steps.",
        section_figures(walkers[i], id, provenance), {meshes_table(walkers[i], id + "-meshes", provenance)});
    pages.section(
        id + "-last-steps", "The last steps before a fall: " + name,
        "Backwards from the step that fails: what walkers that are about to fall look like, beside all others.",
        last_moments_figures(walkers[i].falls.moments, id + "-last", provenance),
        {last_moments_table(walkers[i].falls.moments, id + "-last-steps", provenance)});
  }
  pages.write_index();
  say("{}\n", (std::filesystem::path(request.out) / "index.html").string());
}

}  // namespace metastable::reports
