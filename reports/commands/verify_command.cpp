#include "reports/commands/verify_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "analysis/study/verification.h"
#include "markov/passage/chain_files.h"
#include "reports/output/answer.h"
#include "reports/output/output_file.h"
#include "reports/output/progress.h"
#include "reports/output/table.h"
#include "reports/output/text_table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

constexpr double within_draws = 1e20;  // expected steps that draws down to a tail probability of 1e-30 can resolve
const char* const peers =
    "The program's own numbers are those of the elimination that never subtracts. LU and Arnoldi stand beside it as "
    "the peers that most programs would use: as rest becomes rare they lose their digits, and a negative time below is "
    "their failure.";
constexpr double visible = 1e12;  // a relative error beyond is shown as "lost"

struct Checked {
  analysis::Benchmark benchmark;
  analysis::Verified verified;
};

Table accuracy_table(const std::string& id, const std::string& title, const std::string& reference,
                     const std::vector<Checked>& rows) {
  Table table{
      .id = id,
      .title = title,
      .notes = {"Change: largest relative change of the expected steps from the launch and of 1 − λ₁ when the "
                "number of nodes was last doubled. Error: largest relative distance of expected steps (from the "
                "launch, and from the quasi-stationary distribution) and of 1 − λ₁ from " +
                reference + "."},
      .columns = {{"benchmark"},
                  {"nodes a phase"},
                  {"expected steps", "", NumberFormat::significant, 14},
                  {"from quasi-stationary", "", NumberFormat::significant, 14},
                  {"1 − λ₁", "", NumberFormat::significant, 14},
                  {"change", "", NumberFormat::significant, 2},
                  {"error", "", NumberFormat::significant, 2}}};
  for (const auto& [benchmark, verified] : rows)
    table.rows.push_back({benchmark.name, verified.nodes, verified.from_start, verified.from_quasi_stationary,
                          verified.failure_rate, verified.change, verified.error ? Cell(*verified.error) : Cell("")});
  return table;
}

Cell shown(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Cell(*value) : value ? Cell("no number") : Cell("gives up");
}

Cell lost(const std::optional<double>& value, double right) {
  if (!value) return "";
  const double error = std::abs(*value / right - 1);
  return error < visible ? Cell(error) : Cell("all digits lost");
}

Table solver_table(const std::vector<Checked>& rows) {
  Table table{
      .id = "verify-solvers",
      .title = "The same chains by three solvers",
      .notes = {"Subtraction-free elimination, sparse LU of I − Q (KLU) and 1/(1 − λ₁) from Arnoldi with shift-invert "
                "(Spectra), and the relative difference of the last two from the first."},
      .columns = {{"benchmark"},
                  {"elimination", "", NumberFormat::significant, 8},
                  {"LU", "", NumberFormat::significant, 8},
                  {"LU differs by", "", NumberFormat::significant, 2},
                  {"elimination, quasi-stationary", "", NumberFormat::significant, 8},
                  {"Arnoldi", "", NumberFormat::significant, 8},
                  {"Arnoldi differs by", "", NumberFormat::significant, 2}}};
  for (const auto& [benchmark, v] : rows)
    table.rows.push_back({benchmark.name, v.from_start, shown(v.lu_from_start), lost(v.lu_from_start, v.from_start),
                          v.from_quasi_stationary, shown(v.arnoldi_from_quasi_stationary),
                          lost(v.arnoldi_from_quasi_stationary, v.from_quasi_stationary)});
  return table;
}

Table settled_table(const std::vector<analysis::VerifiedTable>& rows) {
  Table table{
      .id = "verify-settled",
      .title = "The table of landings under settled, against landings followed event by event",
      .notes =
          {"At points spread over restitutions to 0.95, speeds to 9 rad/s, and frictions from a little below rest to "
           "beyond sticking. Errors of the ω² that a standing foot would have, over ω² before the landing. Feet slide, "
           "or stick, or the wheel barely passes: less than 0.5 rad/s above the speed at which even a sticking foot "
           "rests; rough: above a restitution of 0.6, or some feet do not settle before the next leg lands. Threshold: "
           "error of the friction below which the wheel rests."},
      .columns = {{"wheel"},
                  {"slope", "deg"},
                  {"landings"},
                  {"number"},
                  {"rms error", "", NumberFormat::significant, 2},
                  {"median", "", NumberFormat::significant, 2},
                  {"largest", "", NumberFormat::significant, 2},
                  {"slide, largest", "m", NumberFormat::significant, 2},
                  {"rests misjudged"},
                  {"threshold, median", "", NumberFormat::significant, 2},
                  {"largest threshold", "", NumberFormat::significant, 2}}};
  const auto if_any = [](double error) { return error > 0 ? Cell(error) : Cell(""); };  // of rough ones none is sought
  for (const auto& [wheel, slope, errors] : rows)
    for (const auto& [landings, e] : {std::pair{"feet slide", errors.sliding},
                                      {"feet stick", errors.sticking},
                                      {"barely passes", errors.slow},
                                      {"rough", errors.rough}})
      table.rows.push_back({wheel, slope, landings, e.landings, e.rms, e.median, e.largest, e.displacement,
                            e.misjudged_rests, if_any(e.resting_friction_median), if_any(e.resting_friction)});
  return table;
}

Table coverage_table(const std::vector<Checked>& rows, const VerifyRequest& request, Progress& progress) {
  Table table{.id = "verify-coverage",
              .title = "How often the sampled study's 95 % interval holds the integrated value",
              .notes = {},
              .columns = {{"benchmark"},
                          {"expected steps", "", NumberFormat::significant, 6},
                          {"seeds"},
                          {"inside"},
                          {"widest half-width", "", NumberFormat::significant, 2}}};
  int inside = 0, seeds = 0;
  for (const auto& [benchmark, verified] : rows) {
    if (verified.from_start > within_draws) {
      progress.advance();
      continue;
    }
    const analysis::Coverage found =
        analysis::coverage(benchmark.problem, verified.from_start, request.seeds, request.threads);
    inside += found.inside;
    seeds += found.seeds;
    table.rows.push_back({benchmark.name, verified.from_start, found.seeds, found.inside, found.widest});
    progress.advance();
  }
  table.notes.push_back(
      fmt::format("Benchmarks beyond {:.0e} steps are left out: the sampled method's default draws end at a tail "
                  "probability of 1e-30.",
                  within_draws));
  table.notes.push_back(
      fmt::format("Over all: {} of {} ({:.1f} %).", inside, seeds, 100.0 * inside / std::max(1, seeds)));
  return table;
}

void export_chain(const Checked& checked, const std::filesystem::path& target) {
  OutputFolder whole(target);
  const std::filesystem::path& folder = whole.path();
  const markov::SampledChain& chain = checked.verified.chain;
  const markov::ChainFiles files = markov::chain_files(chain.chain, chain.launch);
  write_file(folder / "chain.tra", files.transitions);
  write_file(folder / "chain.lab", files.labels);
  write_file(folder / "chain.srew", files.rewards);
  write_file(folder / "chain.mtx", files.matrix_market);
  write_file(folder / "expected-steps.txt",
             fmt::format("{}\nfrom the launch: {:.17g}\n1 - lambda_1: {:.17g}\n", checked.benchmark.name,
                         checked.verified.from_start, checked.verified.failure_rate));
  whole.commit("expected-steps.txt");
}

}  // namespace

void run_verify(const VerifyRequest& request) {
  std::optional<FolderIfFilled> out, export_to;  // before any long computation
  if (!request.out.empty()) out.emplace(request.out);
  if (!request.export_to.empty()) export_to.emplace(request.export_to);
  Answer answer(request.json);
  const std::vector<analysis::Benchmark> terrain = analysis::rough_terrain_benchmarks(),
                                         wheels = analysis::wheel_benchmarks();
  Progress progress("verify", (terrain.size() + wheels.size()) * (request.seeds > 0 ? 2 : 1) + 1);
  const auto check = [&](const std::vector<analysis::Benchmark>& benchmarks) {
    std::vector<Checked> checked;
    for (const analysis::Benchmark& benchmark : benchmarks) {
      checked.push_back({benchmark, analysis::verify(benchmark, request.threads, request.nodes)});
      progress.advance();
    }
    return checked;
  };
  const std::vector<Checked> rough = check(terrain), paper = check(wheels);
  if (!request.export_to.empty()) export_chain(paper[1], request.export_to);
  std::vector<Checked> all = rough;
  all.insert(all.end(), paper.begin(), paper.end());
  std::vector<Table> tables{accuracy_table("verify-rough-terrain", "The rough-terrain wheel by integrated rows",
                                           "values computed to 60 digits", rough),
                            accuracy_table("verify-wheel", "The paper's wheel by integrated rows",
                                           "collocation to 1e-8, which needs no density of the landing", paper),
                            solver_table(all)};
  tables.push_back(settled_table(analysis::verify_tables(request.threads)));
  progress.advance();
  if (request.seeds > 0) tables.push_back(coverage_table(all, request, progress));
  const Provenance provenance{request.command,
                              "rough terrain: mean slope 8 deg, g 9.8 m/s^2, l 1 m, from the fixed point\n"
                              "wheel: law published, eta ~ N(0.4, 0.1^2), the paper's launch, equal legs of 0.1519 m\n"
                              "settled: the paper's legs, r_g = 0.0424094 m",
                              1, version()};
  answer.say("{}", wrapped(peers, "", terminal_width()));
  std::optional<OutputFolder> whole;
  if (out) whole.emplace(out->path());
  for (Table& table : tables) {
    answer.show(table);
    if (!whole) continue;
    table.notes.emplace_back(peers);  // a file stands alone
    table.provenance = provenance;
    const std::filesystem::path file = whole->path() / table.id;
    write_file(file.string() + ".csv", to_csv(table));
    write_file(file.string() + ".md", to_markdown(table));
    write_file(file.string() + ".tex", to_latex(table));
  }
  if (whole) whole->commit(tables.back().id + ".tex");
  for (const std::string& line : provenance_lines(provenance)) answer.say("{}", line);
  answer.finish(provenance);
}

}  // namespace metastable::reports
