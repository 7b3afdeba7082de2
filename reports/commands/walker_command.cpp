#include "reports/commands/walker_command.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <stdexcept>

#include "reports/output/output_file.h"
#include "reports/output/table.h"
#include "reports/output/version.h"

namespace metastable::reports {
namespace {

using Json = nlohmann::ordered_json;
using markov::MeshEstimate;

std::string text(const MeshEstimate& e) {
  return format_estimate({e.value, e.lower, e.upper}, NumberFormat::significant, 4);
}

Json json_of(const MeshEstimate& e) { return {{"value", e.value}, {"interval_95", {e.lower, e.upper}}}; }

Json study_json(const analysis::WalkerStudy& study, const Provenance& provenance) {
  const markov::MeshStudy& s = study.passage;
  Json eigenvalues = Json::array(), sizes = Json::array();
  for (const auto& value : study.gait.eigenvalues) eigenvalues.push_back({value.real(), value.imag()});
  for (const markov::MeshSize& size : s.sizes)
    sizes.push_back(
        {{"spacing", size.spacing}, {"nodes", size.nodes}, {"entries", size.entries}, {"steps", size.steps}});
  Json json = {{"expected_steps", json_of(s.steps)},
               {"failure_rate", json_of(s.failure_rate)},
               {"mixing_steps", s.mixing_steps},
               {"relative_errors",
                {{"shifts", s.shift_error}, {"discretization", s.discretization_error}, {"leaving_mesh", s.bracket}}},
               {"guided_sampling", s.guided ? json_of(*s.guided) : Json(nullptr)},
               {"direct_simulation", s.simulated ? json_of(*s.simulated) : Json(nullptr)},
               {"gait", {{"state", study.gait.state}, {"eigenvalues", eigenvalues}}},
               {"meshes", sizes}};
  json["provenance"] = {{"command", provenance.command},
                        {"settings", provenance.settings},
                        {"seed", provenance.seed},
                        {"version", provenance.version}};
  return json;
}

void print_line(const std::string& name, const std::string& what) { fmt::print("  {:<38}{}\n", name, what); }

std::string eigenvalues_text(const dynamics::Gait& gait) {
  std::string all;
  for (std::size_t i = 0; i < gait.eigenvalues.size(); ++i) {
    const auto& value = gait.eigenvalues[i];
    if (!all.empty()) all += ", ";
    if (value.imag() == 0) {
      all += fmt::format("{:.4f}", value.real());
    } else {
      all += fmt::format("{:.4f} ± {:.4f} i", value.real(), std::abs(value.imag()));
      ++i;  // its conjugate
    }
  }
  return all;
}

}  // namespace

void run_walker_steps(const WalkerStepsRequest& request) {
  std::optional<OutputFile> json;
  if (!request.json.empty()) json.emplace(request.json);
  const analysis::WalkerStudy study = analysis::study_walker(request.setting, request.study);
  const markov::MeshStudy& s = study.passage;
  if (!s.disagreement.empty()) throw std::runtime_error(s.disagreement);
  if (json) {
    json->stream()
        << study_json(study, {request.command, request.setting.describe(), request.study.seed, version()}).dump(2)
        << '\n';
    json->commit();
  }
  if (request.json == "-") return;
  fmt::print("{}\n", request.setting.describe());
  const std::vector<std::string> names = request.setting.map().names();
  for (std::size_t k = 0; k < study.gait.state.size(); ++k)
    print_line("gait: " + names[k], fmt::format("{:.9f}", study.gait.state[k]));
  print_line("gait: eigenvalues", eigenvalues_text(study.gait));
  print_line("expected steps before failure", text(s.steps));
  print_line("  by guided sampling", s.guided ? text(*s.guided) : "not asked: failures are too frequent");
  print_line("  by direct simulation", s.simulated ? text(*s.simulated) : "out of reach");
  print_line("failure rate a step", text(s.failure_rate));
  print_line("mixing [steps]", fmt::format("{:.3g}", s.mixing_steps));
  print_line("relative errors", fmt::format("shifts {:.2g}, discretization {:.2g}, leaving the mesh {:.2g}",
                                            s.shift_error, s.discretization_error, s.bracket));
  for (const markov::MeshSize& size : s.sizes)
    print_line(fmt::format("mesh of spacing {:.3g} sd", size.spacing),
               fmt::format("{} nodes, {} entries", size.nodes, size.entries));
}

}  // namespace metastable::reports
