#include "reports/ranks/mesh_command.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "markov/ranks/shared_passage.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

constexpr double most_apart = 1e-7;  // the survivors are followed until the rate changes by 1e-9

struct SharedAnswer {
  std::uint64_t nodes = 0, entries = 0;
  double cheapest_failure = 0;
  markov::MeshPassage followed;
  markov::SharedPassage solved;
  std::vector<double> own_nodes, own_entries, memory;  ///< of each rank; memory at its peak [bytes]
  std::vector<double> seconds;                         ///< rows, products, eigenvectors and linear solves
};

SharedAnswer solve(const SharedMeshRequest& request, markov::Ranks& ranks) {
  SharedAnswer answer;
  auto since = std::chrono::steady_clock::now();
  const auto lap = [&] {
    const auto now = std::chrono::steady_clock::now();
    answer.seconds.push_back(ranks.largest(std::chrono::duration<double>(now - since).count()));
    since = now;
  };
  const dynamics::WalkerMap walker = request.setting.map();
  const markov::BatchMap map = analysis::batch_map(walker);
  const auto gait = dynamics::find_gait(walker.walker(), request.setting.slope_deg * analysis::degree);
  const std::vector<double> start = analysis::gait_state(request.setting, gait);
  markov::MeshOptions options = request.mesh;
  options.score_spacing = markov::study_score_spacing(map);
  const markov::SharedMesh mesh(map, markov::noise_frames(map, start), start, options, ranks);
  lap();
  answer.followed = markov::follow_survivors(mesh.rows(), {mesh.start().begin(), mesh.start().end()});
  lap();
  answer.solved = markov::shared_passage(mesh);
  lap();
  answer.nodes = mesh.nodes();
  answer.entries = mesh.entries();
  answer.cheapest_failure = mesh.cheapest_failure();
  answer.own_nodes = ranks.gather(static_cast<double>(mesh.size()));
  answer.own_entries = ranks.gather(static_cast<double>(mesh.own_entries()));
  answer.memory = ranks.gather(markov::peak_memory());
  const double apart = answer.solved.steps / answer.followed.steps_lower - 1;
  if (!(std::abs(apart) <= most_apart))
    throw markov::Disagreement(
        fmt::format("{}: products ({:.10g} steps) and PETSc ({:.10g}) disagree: no number is given",
                    request.setting.describe(), answer.followed.steps_lower, answer.solved.steps));
  return answer;
}

std::string shared_mesh_json(const SharedMeshRequest& request, const SharedAnswer& a) {
  const nlohmann::ordered_json json{
      {"setting", request.setting.describe()},
      {"spacing", request.mesh.spacing},
      {"shift", request.mesh.shift},
      {"margin", request.mesh.margin},
      {"nodes", a.nodes},
      {"entries", a.entries},
      {"nodes_by_rank", a.own_nodes},
      {"expected_steps", {{"value", a.followed.steps}, {"lower", a.followed.steps_lower}, {"upper", a.followed.steps}}},
      {"expected_steps_solved", a.solved.steps},
      {"failure_rate_per_step", a.followed.failure_rate},
      {"failure_rate_per_step_solved", a.solved.failure_rate},
      {"mixing_steps", a.followed.mixing_steps},
      {"residual", a.solved.residual},
      {"provenance", {{"command", request.command}, {"seed", request.mesh.seed}, {"version", version()}}}};
  return json.dump(2) + "\n";
}

void print(const SharedMeshRequest& request, const SharedAnswer& a) {
  const auto line = [](const std::string& name, const std::string& what) { say("  {:<38}{}\n", name, what); };
  say("{}\n\n", request.setting.describe());
  line("expected steps on this mesh",
       fmt::format("{:.10g} (if what leaves it failed: {:.10g})", a.followed.steps, a.followed.steps_lower));
  line("  by PETSc, what leaves it failing", fmt::format("{:.12g}", a.solved.steps));
  line("failure rate per step", fmt::format("{:.10g}", a.followed.failure_rate));
  line("  by SLEPc, what leaves it failing", fmt::format("{:.12g}", a.solved.failure_rate));
  line("mixing", fmt::format("{:.3g} steps", a.followed.mixing_steps));
  line(fmt::format("mesh of spacing {:.3g} sd", request.mesh.spacing),
       fmt::format("{} nodes, {} entries", a.nodes, a.entries));
  line("work",
       fmt::format("{} products; {} restarts of Krylov-Schur and {} products; {} iterations of GMRES",
                   a.followed.products, a.solved.eigen_iterations, a.solved.products, a.solved.linear_iterations));
  line("seconds",
       fmt::format("rows {:.1f}, products {:.1f}, SLEPc and PETSc {:.1f}", a.seconds[0], a.seconds[1], a.seconds[2]));
  for (std::size_t rank = 0; rank < a.memory.size(); ++rank)
    line(fmt::format("rank {}", rank), fmt::format("{:.0f} nodes, {:.0f} entries, {:.2f} GB at its peak",
                                                   a.own_nodes[rank], a.own_entries[rank], a.memory[rank] / 0x1p30));
}

}  // namespace

void run_shared_mesh(const SharedMeshRequest& request, markov::Ranks& ranks) {
  std::optional<OutputFile> json;
  std::string cannot;
  try {
    if (!request.json.empty() && ranks.rank() == 0) json.emplace(request.json);
  } catch (const OutputError& error) {
    cannot = error.what();
  }
  cannot = ranks.first_text(cannot);  // all end
  if (!cannot.empty()) throw std::invalid_argument(cannot);
  const SharedAnswer answer = solve(request, ranks);
  if (ranks.rank() != 0) return;
  if (json) {
    json->stream() << shared_mesh_json(request, answer);
    json->commit();
  }
  if (request.json != "-") print(request, answer);
}

}  // namespace metastable::reports
