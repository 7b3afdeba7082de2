// Sets the steps before rest that models of wheels with torques and with footholds that remember expect beside those
// counted in ODE, an engine of rigid bodies. Takes some four minutes.

#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <span>
#include <vector>

#include "analysis/experiment_model/experiment_model.h"
#include "analysis/fitting/model_fit.h"
#include "tests/analysis/experiment_model/engine_wheel.h"

namespace {

using namespace metastable;

struct Row {
  const char* effect;  // of the catalogue
  double size;
  test::EngineRun run;
};

double expected_with(const analysis::TransitionModel& model, std::span<const analysis::EffectTerm> terms) {
  return model.expected_steps(analysis::nominal_values(model), terms, 1);
}

}  // namespace

int main() {
  const std::vector<Row> rows{{"axle_drag_viscous", 0.008, {.trials = 60, .seed = 5, .viscous_drag = 0.008}},
                              {"axle_drag_viscous", 0.016, {.trials = 60, .seed = 5, .viscous_drag = 0.016}},
                              {"contact_memory", 0.8, {.trials = 300, .seed = 7, .memory = 0.8}}};
  fmt::print("effect, size, counted, rests, expected with it, without it\n");
  for (const Row& row : rows) {
    const auto model = analysis::transition_model(test::engine_experiment(row.run));
    const auto [at_risk, rests] = model->rests();
    std::vector<analysis::EffectTerm> with;
    for (const analysis::Candidate& candidate : model->candidates())
      if (candidate.id == row.effect) with.push_back({&candidate, candidate.variants.front(), {row.size}});
    fmt::print("{}, {}, {:.0f}, {}, {:.0f}, {:.0f}\n", row.effect, row.size, at_risk / rests, rests,
               expected_with(*model, with), expected_with(*model, {}));
    std::fflush(stdout);
  }
  return 0;
}
