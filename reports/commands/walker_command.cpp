#include "reports/commands/walker_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <stdexcept>

#include "analysis/walker_model/walk_folder.h"
#include "analysis/walkers/split_falls.h"
#include "analysis/walkers/walker_falls.h"
#include "markov/mesh/noise_frame.h"
#include "reports/commands/sweep_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/output_file.h"
#include "reports/output/page_folder.h"
#include "reports/output/standard_output.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"
#include "reports/study/last_moments_text.h"
#include "reports/study/walker_figures.h"
#include "reports/study/walker_text.h"

namespace metastable::reports {
namespace {

using analysis::WalkerFalls;
using analysis::WalkerSetting;
using analysis::WalkerStudy;
using markov::MeshEstimate;

WalkerStudy walker_study(const WalkerSetting& setting, const WalkerRequest& request, Progress& progress) {
  return agreed_walker(setting, request.study, study_progress(progress));
}

Provenance walker_provenance(const WalkerRequest& request) {
  Provenance provenance{request.command, {}, request.study.seed, version()};
  for (const WalkerSetting& setting : request.settings)
    provenance.settings += (provenance.settings.empty() ? "" : "\n") + setting.describe();
  return provenance;
}

}  // namespace

markov::SplittingOptions with_level(markov::SplittingOptions options, WalkerLevel level) {
  options.level_of_mesh = !options.level && level == WalkerLevel::mesh;
  return options;
}

std::optional<SplittingAnswer> ask_both_ways(WalkerMethod method, const std::string& name,
                                             const std::function<const markov::MeshStudy*()>& mesh,
                                             const std::function<markov::SplittingStudy()>& split) {
  SplittingAnswer answer{name, {}, {}, {}};
  const markov::MeshStudy* found = nullptr;
  if (method == WalkerMethod::mesh) try {
      mesh();
    } catch (const markov::RefutedMesh& error) {
      throw markov::RefutedMesh(name, error.why(), " (the method splitting needs no mesh)");
    }
  if (method == WalkerMethod::both) try {
      found = mesh();
    } catch (const markov::RefutedMesh& error) {
      answer.no_mesh = error.why();
    } catch (const markov::MapError& error) {
      answer.no_mesh = error.what();
    } catch (const markov::TooManyDimensions& error) {
      answer.no_mesh = error.what();
    } catch (const std::length_error& error) {  // too much memory
      answer.no_mesh = error.what();
    }
  if (method == WalkerMethod::mesh) return std::nullopt;
  try {
    answer.passage = split();
  } catch (const markov::Disagreement& error) {
    if (!found) throw;
    answer.no_splitting = error.what();
  } catch (const markov::NoSplitting& error) {
    if (!found) throw;
    answer.no_splitting = error.what();
  }
  if (!answer.no_splitting.empty()) return answer;
  if (found) markov::require_agreement(*found, answer.passage, name);
  return answer;
}

WalkerAnswer answer_walker_steps(const WalkerRequest& request, const BeginPart& begin_part) {
  const BeginPart begin = within(request.time_limit, begin_part);
  const WalkerSetting& setting = request.settings.front();
  WalkerAnswer answer;
  answer.splitting = ask_both_ways(
      request.method, setting.describe(),
      [&] {
        answer.studies.push_back(agreed_walker(setting, request.study, begin("steps")));
        return &answer.studies.front().passage;
      },
      [&] {
        markov::SplittingOptions splitting = with_level(request.splitting, request.level);
        splitting.last_steps = request.how_it_fails ? analysis::steps_of_a_fall : 0;
        return agreed_splitting(setting.describe(), splitting, begin("splitting"),
                                [&](const auto& options) { return analysis::split_walker(setting, options); });
      });
  if (!request.how_it_fails) return answer;
  const Tell tell = begin("how it fails");
  tell(0, "");
  answer.moments = answer.studies.empty()
                       ? analysis::how_it_falls(analysis::batch_map(setting), analysis::noises_of(setting),
                                                answer.splitting->passage)
                       : analysis::how_it_falls(setting, answer.studies.front(), request.study).moments;
  return answer;
}

WalkerAnswer answer_walker_compare(const WalkerRequest& request, const BeginPart& begin) {
  WalkerAnswer answer;
  for (const WalkerSetting& setting : request.settings)
    answer.studies.push_back(agreed_walker(setting, request.study, begin("compare")));
  return answer;
}

std::string walker_answer_json(const WalkerRequest& request, const WalkerAnswer& answer) {
  if (request.settings.size() > 1) return walkers_json(request.settings, answer.studies, walker_provenance(request));
  if (answer.studies.empty()) return splitting_json(*answer.splitting, answer.moments, walker_provenance(request));
  const std::string json =
      walker_json(request.settings.front(), answer.studies.front(), answer.moments, walker_provenance(request));
  return answer.splitting ? with_splitting_json(json, *answer.splitting) : json;
}

std::string walker_answer_text(const WalkerRequest& request, const WalkerAnswer& answer, std::size_t width) {
  if (request.settings.size() > 1) return walkers_text(request.settings, answer.studies);
  if (answer.studies.empty()) return splitting_text(*answer.splitting, answer.moments, width);
  const std::string text = walker_text(request.settings.front(), answer.studies.front(), answer.moments, width);
  return answer.splitting ? with_splitting_text(text, *answer.splitting) : text;
}

namespace {

void run_walker(const WalkerRequest& request, WalkerAnswer answer_of(const WalkerRequest&, const BeginPart&)) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const WalkerAnswer answer = [&] {
    ProgressParts progress;
    return answer_of(request, progress.begin());
  }();
  if (json) {
    json->stream() << walker_answer_json(request, answer);
    json->commit();
  }
  if (request.json != "-") say("{}", walker_answer_text(request, answer, terminal_width()));
}

}  // namespace

void run_walker_steps(const WalkerRequest& request) { run_walker(request, answer_walker_steps); }

void run_walker_compare(const WalkerRequest& request) { run_walker(request, answer_walker_compare); }

namespace {

std::string sweep_row(const WalkerRequest& request, const WalkerSetting& setting, Progress& progress) {
  const std::string at = fmt::format("{},{},", setting.slope_deg, setting.slope_sd_deg);
  const auto other = [](const std::optional<MeshEstimate>& e) { return e ? fmt::format("{}", e->value) : ""; };
  try {
    const markov::MeshStudy s = walker_study(setting, request, progress).passage;
    return at + fmt::format("{},{},{},{},{},{},{},{}\n", s.steps.value, s.steps.lower, s.steps.upper,
                            s.failure_rate.value, s.mixing_steps, other(s.guided), other(s.simulated),
                            walker_status(s));
  } catch (const Interrupted&) {
    throw;
  } catch (const std::runtime_error& error) {  // no gait that is stable, or ways that disagree: the others go on
    return at + fmt::format(",,,,,,,{}\n", csv_field(error.what()));
  } catch (const std::domain_error& error) {
    return at + fmt::format(",,,,,,,{}\n", csv_field(error.what()));
  }
}

}  // namespace

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
                  {request.command, what, request.study.seed, version()},
                  request.json};
  if (request.sharing)
    return share_sweep_file(sweep, *request.sharing, [&](std::size_t point) {
      Progress progress("point", study_units);
      return sweep_row(request, request.settings[point], progress);
    });
  run_sweep_file(sweep, [&](std::size_t had, const auto& add) {
    Progress progress("sweep", study_units * request.settings.size());
    progress.skip(study_units * had);
    for (std::size_t i = had; i < request.settings.size(); ++i) add(sweep_row(request, request.settings[i], progress));
  });
}

namespace {

void say_walks(Answer& answer, const WalkerRequest& request, std::size_t trials, std::size_t fallen,
               const Provenance& provenance) {
  answer.say("{}: {} trials, {} of them fell", request.out, trials, fallen);
  answer.fact("folder", request.out);
  answer.fact("trials", trials);
  answer.fact("fell", fallen);
  answer.finish(provenance);
}

void write_experiment(const WalkerRequest& request, OutputFolder& whole) {
  Answer answer(request.json);
  const analysis::WalkFiles files = [&] {
    ProgressParts progress;
    analysis::WalkOptions options = request.walks;
    options.progress = [tell = progress.begin()("simulate")](double share) { tell(share, "simulate"); };
    const WalkerSetting& setting = request.settings.front();
    if (request.reality) {
      const auto laboratory = analysis::walker_laboratory(setting, *request.reality, options);
      return analysis::laboratory_walks(laboratory, analysis::run_walks(laboratory, options),
                                        {"Compass gait in the virtual laboratory", {setting}, {}},
                                        request.reality->left_out);
    }
    return analysis::draw_walks(setting, request.effects, options,
                                fmt::format("Walker {}, simulated", analysis::walker_name(setting.walker)));
  }();
  write_file(whole.path() / "experiment.toml", files.experiment_toml);
  write_file(whole.path() / "steps.csv", files.steps_csv);
  if (!files.trials_csv.empty()) write_file(whole.path() / "trials.csv", files.trials_csv);
  whole.commit("experiment.toml");
  say_walks(answer, request, request.walks.trials, files.fallen, walker_provenance(request));
}

}  // namespace

void run_walker_simulate(const WalkerRequest& request) {
  const WalkerSetting& setting = request.settings.front();
  const std::filesystem::path folder = request.out;
  for (const char* name : {"walks.csv", "steps.csv", "trials.csv", "experiment.toml"})
    if (std::filesystem::exists(folder / name))
      throw OutputError(folder, fmt::format("already holds {}; choose another folder", name));
  const bool facets = setting.terrain != dynamics::Terrain::fresh;
  if (facets && !request.effects.empty()) throw std::invalid_argument("--effect: has no meaning with --terrain facets");
  const markov::BatchMap map = analysis::batch_map(setting);
  OutputFolder whole(folder);
  const bool biped = setting.walker == analysis::Walker::biped;
  if (!(biped || facets) || request.reality) return write_experiment(request, whole);
  Answer answer(request.json);
  const std::vector<analysis::Walk> walks = [&] {
    ProgressParts progress;
    analysis::WalkOptions options = request.walks;
    options.progress = [tell = progress.begin()("simulate")](double share) { tell(share, "simulate"); };
    return analysis::simulate_walks(setting, options);
  }();
  const Provenance provenance = walker_provenance(request);
  std::string head, steps = "trial,step", trials = "trial,steps,outcome\n";
  for (const std::string& line : provenance_lines(provenance)) head += "# " + line + "\n";
  for (const std::string& name : map.names) steps += "," + csv_field(name);
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
  say_walks(answer, request, walks.size(), fallen, provenance);
}

void run_walker_report(const WalkerRequest& request) {
  PageFolder pages(request.out);
  Answer answer(request.json);
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
  page.title = "How long does a walker on two legs walk before it falls?";
  for (const StudiedWalker& walker : walkers) page.lead.push_back(walker_sentence(walker));
  page.provenance = provenance;
  std::vector<Fold> meshes;
  for (std::size_t i = 0; i < walkers.size(); ++i)
    meshes.push_back({"Meshes of the walker " + walker_label(walkers[i]),
                      {walkers[i].setting.describe() + "."},
                      {},
                      {meshes_table(walkers[i], fmt::format("walker-{}-meshes", i + 1), provenance)}});
  pages.section("walkers", "The chance of still walking",
                "From meshes of the walker’s stochastic return map; guided sampling and direct simulation stand beside "
                "them.",
                {walker_survival_figure(walkers, provenance)}, {walkers_table(walkers, provenance)}, std::move(meshes),
                Arrangement::beside);
  for (std::size_t i = 0; i < walkers.size(); ++i) {
    const std::string id = fmt::format("walker-{}", i + 1), name = walker_label(walkers[i]);
    const analysis::LastMoments& moments = walkers[i].falls.moments;
    pages.section(
        id + "-section", "Basin and failure: " + name,
        "Each dot is a state just after a strike, a node of the mesh. From some a walker comes back to its gait "
        "(within one sd of the noise), from others it falls before; and where the last steps before a fall "
        "begin, beside all steps.",
        section_figures(walkers[i], id, provenance), {});
    pages.section(id + "-last-steps", "The last steps before a fall: " + name,
                  moments.reason.empty() ? "Backwards from the step that fails: " + last_moments_sentence(moments) + "."
                                         : "There is nothing to tell: " + moments.reason + ".",
                  last_moments_figures(moments, id + "-last", name, provenance), {},
                  {{"In numbers", {}, {}, {last_moments_table(moments, id + "-last-steps", name, provenance)}}});
  }
  pages.write_index();
  pages.finish(answer);
}

}  // namespace metastable::reports
