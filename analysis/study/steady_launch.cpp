#include "analysis/study/steady_launch.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/wheel/law_quantities.h"

namespace metastable::analysis {
namespace {

constexpr double least_mass = 1e-300;  // beyond an edge, of which a score can be had
constexpr std::size_t regime_cells = 128, regime_samples = 4096;
constexpr int regime_replicates = 4;

// Returns the speeds at the edges of the cells that hold something; what lies between follows smoothly.
dynamics::LaunchSpeed speeds_of(const PhaseDistribution& phase) {
  std::vector<double> above(phase.edges.size(), 0.0);
  for (std::size_t i = phase.mass.size(); i-- > 0;) above[i] = above[i + 1] + std::max(0.0, phase.mass[i]);
  const double total = above.front();
  std::vector<double> score, speed;
  double below = 0;
  for (std::size_t i = 0; i < phase.edges.size(); ++i) {
    if (i > 0) below += std::max(0.0, phase.mass[i - 1]);
    const double lower = below / total, upper = above[i] / total;
    if (lower < least_mass || upper < least_mass) continue;
    const double at = lower < upper ? dynamics::normal_quantile(lower) : -dynamics::normal_quantile(upper);
    if (!score.empty() && at <= score.back()) continue;
    score.push_back(at);
    speed.push_back(std::sqrt(phase.edges[i]));
  }
  if (!score.empty()) return {std::move(score), std::move(speed)};
  // All lies in one cell.
  return {{0.0}, {std::sqrt(phase.edges.front() + phase.edges.back()) / std::numbers::sqrt2}};
}

// Does the wheel without noise go on from that state, revolution after revolution?
bool rolls_on(const Problem& problem) {
  const std::vector<double> no_noise(static_cast<std::size_t>(problem.map.noise_dimension()), 0.0);
  double state = problem.launch.state(0);
  for (int step = 0; step < problem.map.phases(); ++step) {
    const std::optional<double> next =
        problem.map.landing(state, (problem.launch.phase + step) % problem.map.phases(), no_noise);
    if (!next) return false;
    state = *next;
  }
  return true;
}

bool noise_free(const Setting& setting) {
  using dynamics::LawQuantity;
  if (!dynamics::uses(setting.law, LawQuantity::restitution) && !dynamics::uses(setting.law, LawQuantity::friction))
    return true;
  if (!setting.pairs.empty()) return setting.pairs.size() == 1;
  return setting.restitution.sd == 0 && setting.friction.sd == 0;
}

}  // namespace

Setting steadily_launched(const Setting& setting, const StudyOptions& options) {
  if (!setting.steady_launch || setting.steady_speed) return setting;
  const Problem problem = setting.problem(landing_options(options, 0, 0));
  const auto launched = [&](const dynamics::LaunchSpeed& speed) {
    Setting found = setting;
    found.steady_speed = std::make_shared<const dynamics::LaunchSpeed>(speed);
    found.initial_speed = {speed.mean(), speed.sd()};
    return found;
  };
  const dynamics::LaunchSpeed orbit({0.0}, {std::sqrt(problem.launch.state(0))});
  if (noise_free(setting)) {
    if (!rolls_on(problem))
      throw NoRegime("initial speed: steady: the wheel, which has no noise, comes to rest and has no steady speed");
    return launched(orbit);
  }
  StudyOptions own = options;
  own.brief = true;
  if (own.method == Method::sampled) {  // one size of the ladder: it leaves 1e-4 of the steps from there, or less
    if (own.cells == 0) own.cells = regime_cells;
    if (own.samples == 0) own.samples = regime_samples;
    own.replicates = std::min(own.replicates, regime_replicates);
  }
  const Metastability regime = study(problem, own);
  if (regime.status == Status::rest_unresolved) return launched(orbit);
  if (std::isnan(regime.survivors.mean) || regime.survivors.by_phase.empty())
    throw NoRegime(
        "initial speed: steady: fewer than 1e-12 of the wheels survive a step, and there is no metastable regime to "
        "launch from");
  return launched(speeds_of(regime.survivors.by_phase[static_cast<std::size_t>(problem.launch.phase)]));
}

}  // namespace metastable::analysis
