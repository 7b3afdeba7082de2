#include "analysis/sensitivity/pathwise.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/study/pilot.h"
#include "markov/chain/chain.h"
#include "markov/passage/adjoint.h"
#include "markov/transition_rows/discretization.h"

namespace metastable::analysis {
namespace {

constexpr int strata = 8;                     // launches a draw
constexpr std::uint32_t other_draws = 1024u;  // replicates of a study are fewer: these draws are not the chain's

// The expected steps m on the states of one phase: linear between the midpoints of cells, from differences that keep
// their digits.
class MeanOfPhase {
 public:
  MeanOfPhase(const markov::Adjoint& at, const markov::StateSpace& space, int phase) : grid_(space.grid(phase)) {
    const std::size_t n = grid_.cells();
    slope_.assign(n + 1, 0.0);
    for (std::size_t c = 1; c < n; ++c)
      slope_[c] = (at.excess[space.index(phase, c)] - at.excess[space.index(phase, c - 1)]) /
                  (grid_.midpoint(c) - grid_.midpoint(c - 1));
    if (n > 1) slope_[0] = slope_[1], slope_[n] = slope_[n - 1];
    lowest_ = std::max(1.0, at.mean[space.index(phase, 0)] - slope_[0] * grid_.width(0) / 2);
  }
  double slope(double state) const {
    const std::uint32_t c = grid_.cell(state);
    return slope_[state < grid_.midpoint(c) ? c : c + 1];
  }
  double at_lowest_state() const { return lowest_; }

 private:
  const markov::Grid& grid_;
  std::vector<double> slope_;  // [c]: below the midpoint of cell c
  double lowest_ = 0;
};

// Holds dM / d(scale, drag) of every draw of a phase, weights included, and dM / d(barrier, gain) of the phase.
struct PhaseGradient {
  std::vector<dynamics::Contact> contact;
  std::vector<double> scale, drag;
  double barrier = 0, gain = 0;
};

class PhaseSlopes {
 public:
  PhaseSlopes(const dynamics::WheelMap& map, int phase, const MeanOfPhase& mean, const markov::Draws& draws)
      : stance_(map.stance(phase)), mean_(mean), draws_(draws) {
    const auto dimension = static_cast<std::size_t>(draws.dimension);
    gradient.scale.assign(draws.count(), 0.0);
    gradient.drag.assign(draws.count(), 0.0);
    for (std::size_t k = 0; k < draws.count(); ++k) {
      gradient.contact.push_back(map.noise().draw(std::span(draws.score).subspan(k * dimension, dimension)));
      step_.push_back(map.coefficients(phase, gradient.contact.back()));
    }
  }

  // Adds `mass` launches of draw k from one state.
  void add_landing(std::size_t k, double state, double root, double mass) {
    const dynamics::StepCoefficients& c = step_[k];
    const double after = c.scale * state - c.drag * root;
    if (!(after >= stance_.barrier)) return;
    const double weight = draws_.weight[k] * mass * mean_.slope(after + stance_.gain);
    gradient.scale[k] += weight * state;
    gradient.drag[k] -= weight * root;
    gradient.gain += weight;
  }

  // Adds launches of draw k with the density density(x): what comes over the barrier begins or ends at x*.
  template <class Density>
  void add_barrier(std::size_t k, const Density& density) {
    const dynamics::StepCoefficients& c = step_[k];
    if (c.scale == 0 || !std::isfinite(c.scale)) return;
    const double discriminant = c.drag * c.drag + 4 * c.scale * stance_.barrier;
    if (discriminant < 0) return;
    const double far = 0.5 * (c.drag + std::copysign(std::sqrt(discriminant), c.drag));
    for (const double root : {far / c.scale, far == 0 ? 0.0 : -stance_.barrier / far}) {
      if (!(root > 0)) continue;
      const double state = root * root, rise = std::abs(c.scale - c.drag / (2 * root));
      const double mass = density(state);
      if (mass == 0 || rise == 0) continue;
      const double weight = draws_.weight[k] * mass * mean_.at_lowest_state() / rise;
      gradient.scale[k] += weight * state;
      gradient.drag[k] -= weight * root;
      gradient.barrier -= weight;
    }
  }

  PhaseGradient gradient;

 private:
  const dynamics::Stance& stance_;
  const MeanOfPhase& mean_;
  const markov::Draws& draws_;
  std::vector<dynamics::StepCoefficients> step_;
};

double change(const PhaseGradient& gradient, int phase, const dynamics::WheelMap& minus, const dynamics::WheelMap& plus,
              const markov::Draws& draws) {
  const auto dimension = static_cast<std::size_t>(draws.dimension);
  double sum = gradient.barrier * (plus.stance(phase).barrier - minus.stance(phase).barrier) +
               gradient.gain * (plus.stance(phase).gain - minus.stance(phase).gain);
  for (std::size_t k = 0; k < draws.count(); ++k) {
    if (gradient.scale[k] == 0 && gradient.drag[k] == 0) continue;
    const auto score = std::span(draws.score).subspan(k * dimension, dimension);
    const dynamics::StepCoefficients low = minus.coefficients(phase, minus.noise().draw(score)),
                                     high = plus.coefficients(phase, plus.noise().draw(score));
    if (!std::isfinite(low.scale) || !std::isfinite(high.scale)) continue;
    sum += gradient.scale[k] * (high.scale - low.scale) + gradient.drag[k] * (high.drag - low.drag);
  }
  return sum;
}

}  // namespace

std::vector<double> pathwise_slopes(const Setting& setting, const std::vector<Neighbours>& neighbours,
                                    const markov::StateSpace& space, const markov::DrawOptions& options) {
  const dynamics::WheelMap map = setting.map();
  const Problem problem = setting.problem();
  const markov::SampledChain sampled = markov::discretize(problem.map, space, problem.launch, {.draws = options});
  if (!rests(sampled))
    throw markov::ConvergenceError("sensitivities", 1, "the draws do not come to rest from every state");
  const markov::Adjoint at = markov::adjoint(markov::ChainSolver(sampled.chain), sampled.launch);
  std::vector<std::pair<dynamics::WheelMap, dynamics::WheelMap>> maps;
  for (const Neighbours& pair : neighbours) maps.emplace_back(pair.minus.map(), pair.plus.map());

  std::vector<double> slopes(neighbours.size(), 0.0);
  const dynamics::LaunchSpeed speed = setting.launch();
  for (int phase = 0; phase < space.phases(); ++phase) {
    const markov::Grid& grid = space.grid(phase);
    const MeanOfPhase mean(at, space, (phase + 1) % space.phases());
    markov::DrawOptions own = options;
    own.replicate = (options.replicate + other_draws) * other_draws + static_cast<std::uint32_t>(phase);
    const markov::Draws draws = markov::make_draws(map.noise_dimension(), own);
    PhaseSlopes along(map, phase, mean, draws);

    std::vector<double> density(grid.cells());
    for (std::size_t c = 0; c < grid.cells(); ++c) density[c] = at.visits[space.index(phase, c)] / grid.width(c);
    const auto visited = [&](double state) {
      return state < grid.edges().front() || state >= grid.edges().back() ? 0.0 : density[grid.cell(state)];
    };
    for (std::size_t k = 0; k < draws.count(); ++k) {
      for (std::size_t c = 0; c < grid.cells(); ++c) {
        const double visits = at.visits[space.index(phase, c)];
        if (visits == 0) continue;
        const double state = grid.lower(c) + grid.width(c) * draws.offset[k];
        along.add_landing(k, state, std::sqrt(state), visits);
      }
      along.add_barrier(k, visited);
      if (phase != problem.launch.phase) continue;
      for (int s = 0; s < strata; ++s) {
        const double state = problem.launch.state(markov::normal_score((s + draws.offset[k]) / strata));
        along.add_landing(k, state, std::sqrt(state), 1.0 / strata);
      }
      if (!speed.constant())
        along.add_barrier(k, [&](double state) { return speed.density(std::sqrt(state)) / (2 * std::sqrt(state)); });
    }
    for (std::size_t i = 0; i < maps.size(); ++i) {
      const auto& [minus, plus] = maps[i];
      double sum = change(along.gradient, phase, minus, plus, draws);
      if (phase == problem.launch.phase && speed.constant()) {
        // All launches meet the barrier in one state: what comes over it is read off its probability.
        const double state = problem.launch.state(0);
        const auto low = minus.rest_probability(state, phase), high = plus.rest_probability(state, phase);
        if (!low || !high)
          throw std::invalid_argument(
              "sensitivities: not known for a constant launch speed with correlated restitution and friction");
        sum -= (*high - *low) * mean.at_lowest_state();
      }
      slopes[i] += sum / (neighbours[i].distance * at.steps);
    }
  }
  return slopes;
}

}  // namespace metastable::analysis
