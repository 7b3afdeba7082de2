#include "reports/experiment_commands/coast_down_command.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "reports/experiment_commands/experiment_output.h"
#include "reports/output/answer.h"
#include "reports/output/input_file.h"
#include "reports/output/table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

constexpr double clearly = 5;  // standard errors from which on a loss proportional to omega is there

// Keeps even or odd blocks: what one half says can be checked on the other.
void keep(analysis::CoastDownRun& run, const std::string& which) {
  if (which == "all") return;
  std::vector<std::vector<analysis::Revolution>> kept;
  for (std::size_t b = which == "odd" ? 0 : 1; b < run.blocks.size(); b += 2) kept.push_back(run.blocks[b]);
  if (kept.empty()) throw std::invalid_argument(fmt::format("--blocks: {} has no {} block", run.name, which));
  run.blocks = std::move(kept);
}

// Refuses what is objected to, or takes it down for every verdict to repeat.
void accept(const std::string& objection, const CoastDownRequest& request, analysis::RevolutionLoss& nominal) {
  if (objection.empty()) return;
  if (!request.accept_defects)
    throw std::invalid_argument(fmt::format(
        "{}: no basis for a model (--accept-defects takes it, and every verdict will repeat this)", objection));
  if (!nominal.accepted_defects.empty()) nominal.accepted_defects += "; ";
  nominal.accepted_defects += objection;
}

// Reads a log, whose name has to name a condition. @throws std::invalid_argument
analysis::CounterLog named_log(const std::string& path, const std::vector<analysis::CoastDownRun>& before) {
  analysis::CounterLog log = analysis::parse_counter_log(path, read_file(path));
  log.name = std::filesystem::path(path).stem().string();
  if (log.name.find_first_of(",\"\r\n") != std::string::npos)
    throw std::invalid_argument(fmt::format("{}: a comma or a quote in the file's name cannot name a condition", path));
  for (const analysis::CoastDownRun& other : before)
    if (other.name == log.name) throw std::invalid_argument(fmt::format("{}: a log named so was there before", path));
  return log;
}

std::vector<analysis::CoastDownRun> read_runs(const CoastDownRequest& request, Answer& answer) {
  std::vector<analysis::CoastDownRun> runs;
  for (const std::string& path : request.logs) {
    analysis::CoastDownRun run = analysis::coast_down(named_log(path, runs), request.options);
    keep(run, request.blocks);
    answer.say(
        "{}: {} revolutions from {:.4g} to {:.4g} rad/s, {} blocks; ticks of the counter missed {}, "
        "doubled {}, displaced {}; {} revolutions left out",
        run.name, run.revolutions, run.top, request.options.stop, run.blocks.size(), run.missed, run.doubled,
        run.displaced, run.left_out);
    runs.push_back(std::move(run));
  }
  return runs;
}

struct NominalLoss {
  analysis::RevolutionLoss loss;
  std::string origin;
};

// @param force_linear  keeps the loss proportional to omega even where the runs do not show it
NominalLoss fitted_loss(const std::vector<analysis::CoastDownRun>& runs, bool force_linear, Answer& answer) {
  analysis::LossFit fit = analysis::fit_loss(runs, true);
  const bool linear = force_linear || std::abs(fit.loss.linear) > clearly * fit.linear_error;
  if (!linear) fit = analysis::fit_loss(runs, false);
  analysis::RevolutionLoss nominal = fit.loss;
  if (runs.size() > 1) nominal.run_to_run = analysis::run_to_run_of(runs, linear);
  const std::string term = linear ? fmt::format(" + ({:.4g} +- {:.2g}) omega", nominal.linear, fit.linear_error) : "";
  answer.say(
      "loss of omega^2 a revolution [rad^2/s^2]: {:.4g} +- {:.2g}{} + ({:.4g} +- {:.2g}) omega^2 (+- standard errors); "
      "single revolutions scatter about that with sd {:.3g}, and {} of {} lie more than five sds away",
      nominal.constant, fit.constant_error, term, nominal.quadratic, fit.quadratic_error, nominal.noise_sd,
      fit.outliers, fit.transitions);
  return {nominal, "nominal loss fitted robustly to these runs"};
}

NominalLoss stated_loss(const std::string& folder) {
  const analysis::Experiment other = analysis::parse_description(analysis::read_source(folder));
  if (other.system != analysis::System::coast_down)
    throw std::invalid_argument(fmt::format("--nominal: {} is no coast-down", folder));
  return {other.loss, fmt::format("nominal loss of the experiment \"{}\"", other.title)};
}

// @param runs  those the loss was fitted to; 0: it was stated
void say_run_to_run(Answer& answer, const analysis::RevolutionLoss& nominal, std::size_t runs) {
  if (nominal.run_to_run)
    answer.say("from run to run: {:.2g} % of the loss, {}", 100 * *nominal.run_to_run,
               runs > 0
                   ? fmt::format("from {} runs and one difference of {:.0f} %", runs, 100 * analysis::usual_run_to_run)
                   : "as the nominal experiment says");
  else
    answer.say("from run to run: {:.0f} % of the loss assumed, because one run does not say (give several)",
               100 * analysis::usual_run_to_run);
}

}  // namespace

void run_coast_down(const CoastDownRequest& request) {
  ExperimentOutput folder(request.out);
  Answer answer(request.json);
  const std::vector<analysis::CoastDownRun> runs = read_runs(request, answer);
  const bool fitted = request.nominal.empty();
  auto [nominal, origin] = fitted ? fitted_loss(runs, request.linear, answer) : stated_loss(request.nominal);
  say_run_to_run(answer, nominal, fitted ? runs.size() : 0);
  for (const analysis::CoastDownRun& run : runs) accept(analysis::objection(run, nominal), request, nominal);
  const Provenance provenance{request.command, origin, 0, version()};
  const analysis::ExperimentFiles files = analysis::coast_down_files(
      runs, nominal, request.rotor_inertia, "Coast-down of " + runs.front().name, provenance_lines(provenance));
  const analysis::ExperimentSource source = analysis::source_of(files, request.out);
  analysis::parse_experiment(source);  // what could not be read back is refused here, and not written
  folder.write(source);
  answer.fact("folder", request.out);
  answer.fact("constant", nominal.constant);
  answer.fact("linear", nominal.linear);
  answer.fact("quadratic", nominal.quadratic);
  answer.fact("noise_sd", nominal.noise_sd);
  answer.fact("run_to_run", nominal.run_to_run ? Cell(*nominal.run_to_run) : Cell(""));
  answer.finish(provenance);
}

}  // namespace metastable::reports
