#include "reports/experiment_commands/coast_down_command.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>

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

}  // namespace

void run_coast_down(const CoastDownRequest& request) {
  ExperimentOutput folder(request.out);
  Answer answer(request.json);
  std::vector<analysis::CoastDownRun> runs;
  for (const std::string& path : request.logs) {
    analysis::CounterLog log = analysis::parse_counter_log(path, read_file(path));
    log.name = std::filesystem::path(path).stem().string();
    if (log.name.find_first_of(",\"\r\n") != std::string::npos)
      throw std::invalid_argument(
          fmt::format("{}: a comma or a quote in the file's name cannot name a condition", path));
    for (const analysis::CoastDownRun& other : runs)
      if (other.name == log.name) throw std::invalid_argument(fmt::format("{}: a log named so was there before", path));
    analysis::CoastDownRun& run = runs.emplace_back(analysis::coast_down(log, request.options));
    keep(run, request.blocks);
    answer.say(
        "{}: {} revolutions from {:.4g} to {:.4g} rad/s, {} blocks; ticks missed {}, double {}, displaced {}; "
        "{} revolutions left out",
        run.name, run.revolutions, run.top, request.options.stop, run.blocks.size(), run.missed, run.doubled,
        run.displaced, run.left_out);
  }
  analysis::RevolutionLoss nominal;
  std::string origin;
  if (request.nominal.empty()) {
    analysis::LossFit fit = analysis::fit_loss(runs, true);
    const bool linear = request.linear || std::abs(fit.loss.linear) > clearly * fit.linear_error;
    if (!linear) fit = analysis::fit_loss(runs, false);
    nominal = fit.loss;
    if (runs.size() > 1) nominal.run_to_run = analysis::run_to_run_of(runs, linear);
    origin = "nominal loss fitted robustly to these runs";
    const std::string term = linear ? fmt::format(" + ({:.4g} +- {:.2g}) omega", nominal.linear, fit.linear_error) : "";
    answer.say(
        "loss of omega^2 a revolution [rad^2/s^2]: {:.4g} +- {:.2g}{} + ({:.4g} +- {:.2g}) omega^2, noise sd {:.3g}; "
        "{} of {} transitions beyond five of those",
        nominal.constant, fit.constant_error, term, nominal.quadratic, fit.quadratic_error, nominal.noise_sd,
        fit.outliers, fit.transitions);
  } else {
    const analysis::Experiment other = analysis::parse_description(analysis::read_source(request.nominal));
    if (other.system != analysis::System::coast_down)
      throw std::invalid_argument(fmt::format("--nominal: {} is no coast-down", request.nominal));
    nominal = other.loss;
    origin = fmt::format("nominal loss of the experiment \"{}\"", other.title);
  }
  if (nominal.run_to_run)
    answer.say("from run to run: {:.2g} % of the loss, {}", 100 * *nominal.run_to_run,
               request.nominal.empty() ? fmt::format("from {} runs and one difference of {:.0f} %", runs.size(),
                                                     100 * analysis::usual_run_to_run)
                                       : "as the nominal experiment says");
  else
    answer.say("from run to run: {:.0f} % of the loss assumed, because one run does not say (give several)",
               100 * analysis::usual_run_to_run);
  for (const analysis::CoastDownRun& run : runs) accept(analysis::objection(run, nominal), request, nominal);
  Provenance provenance{request.command, origin, 0, version()};
  const analysis::ExperimentFiles files = analysis::coast_down_files(
      runs, nominal, request.rotor_inertia, "Coast-down of " + runs.front().name, provenance_lines(provenance));
  folder.write(analysis::source_of(files, request.out));
  answer.fact("folder", request.out);
  answer.fact("constant", nominal.constant);
  answer.fact("linear", nominal.linear);
  answer.fact("quadratic", nominal.quadratic);
  answer.fact("noise_sd", nominal.noise_sd);
  answer.fact("run_to_run", nominal.run_to_run ? Cell(*nominal.run_to_run) : Cell(""));
  answer.finish(provenance);
}

}  // namespace metastable::reports
