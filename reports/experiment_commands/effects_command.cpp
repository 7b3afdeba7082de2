#include "reports/experiment_commands/effects_command.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "dynamics/catalogue/effect_catalogue.h"
#include "reports/diagnosis/diagnosis_json.h"
#include "reports/output/output_file.h"
#include "reports/output/standard_output.h"

namespace metastable::reports {
namespace {

std::string range_text(const dynamics::EffectParameter& p) {
  const std::string unit = p.unit.empty() ? "" : " " + p.unit;
  return fmt::format("{:.4g} to {:.4g}{}, {}", p.lower, p.upper, unit,
                     p.neutral ? fmt::format("none at {:.4g}", *p.neutral) : "none at the stated value");
}

void list_effects(const std::vector<dynamics::EffectInfo>& all) {
  for (const dynamics::EffectInfo& info : all) {
    say("{}: {}\n", info.id, info.summary);
    for (const dynamics::EffectParameter& p : info.parameters)
      say("  {:<19} {}{} ({})\n", p.name, p.meaning, p.per_leg ? ", one a leg" : "", range_text(p));
  }
}

}  // namespace

void run_effects(const EffectsRequest& request) {
  if (!request.json.empty()) write_file(request.json, effects_json());
  if (request.json != "-") list_effects(dynamics::effect_catalogue());
}

void run_walker_effects(const EffectsRequest& request, analysis::Walker walker) {
  const std::vector<dynamics::EffectInfo> all = analysis::effects_known_to(walker);
  if (!request.json.empty()) write_file(request.json, effects_json(all, analysis::walker_name(walker)));
  if (request.json != "-") list_effects(all);
}

}  // namespace metastable::reports
