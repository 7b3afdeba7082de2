#include "analysis/study/how_it_fails.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/study/chain_summary.h"
#include "analysis/study/pilot.h"
#include "markov/parallel.h"
#include "markov/passage/last_steps.h"
#include "markov/transition_rows/discretization.h"

namespace metastable::analysis {
namespace {

constexpr int steps_told = 6;
constexpr std::size_t most_cells_told = 512, draws_told = 4096;
constexpr double negligible_share = 1e-9;  // of a step's failures, in one state

/// Holds the draws of one phase with what each is worth as the noise of step k before failure.
struct NoiseOfPhase {
  markov::Draws draws;
  std::vector<dynamics::Contact> contact;
  std::vector<std::vector<double>> weight;  ///< [k][draw]
  double score_square(std::size_t k) const {
    double sum = 0;
    const auto d = static_cast<std::size_t>(draws.dimension);
    for (std::size_t i = k * d; i < (k + 1) * d; ++i) sum += draws.score[i] * draws.score[i];
    return sum;
  }
};

class Failures {
 public:
  Failures(const Setting& setting, const Problem& problem, const StudyOptions& options, const Pilot& pilot,
           std::size_t cells)
      : problem_(problem),
        contact_noise_(setting.noise()),
        options_(options),
        space_(pilot.graded(cells)),
        sampled_(sample(pilot)),
        solved_(sampled_, pilot.regime(space_)) {
    visits_ = solved_.solver.solve_left(sampled_.launch.after);
    for (std::size_t i = 0; i < space_.size(); ++i)
      width_.push_back(space_.grid(space_.phase(i)).width(space_.cell(i)));
    last_ = markov::last_steps(sampled_.chain, visits_, steps_told, width_);
    bound_ = markov::passage_to(sampled_.chain, middle_of_regime()).fail;
  }

  LastMoments tell() {
    LastMoments told;
    told.state_names = {"speed before the collision [rad/s]"};
    told.noise_names = {"restitution", "friction"};
    for (int p = 0; p < space_.phases(); ++p) noise_.push_back(noise_of(p));
    markov::parallel_for(noise_.size(), options_.threads, [&](std::size_t p) { weigh(static_cast<int>(p)); });
    for (std::size_t k = 0; k < last_.share.size(); ++k)
      told.last.push_back(profile(last_.share[k], static_cast<int>(k)));
    told.regime = profile(solved_.survivors, -1);
    told.by_phase.assign(static_cast<std::size_t>(space_.phases()), 0.0);
    for (std::size_t i = 0; i < space_.size(); ++i)
      told.by_phase[static_cast<std::size_t>(space_.phase(i))] += last_.share[0][i] * (1 - sampled_.launch.rest);
    told.by_phase[static_cast<std::size_t>(problem_.launch.phase)] += sampled_.launch.rest;
    for (std::size_t k = last_.likeliest.size(); k-- > 0;) told.likeliest.push_back(path_step(k));
    return told;
  }

 private:
  markov::SampledChain sample(const Pilot& pilot) const {
    markov::SampledChain sampled =
        markov::discretize(problem_.map, space_, problem_.launch,
                           {.draws = draw_options(options_, 4 * draws_told, 0), .threads = options_.threads});
    return pilot.beside ? without_unreached(std::move(sampled)) : sampled;
  }

  double state(std::size_t i) const { return space_.grid(space_.phase(i)).midpoint(space_.cell(i)); }

  std::vector<std::uint8_t> middle_of_regime() const {
    std::vector<double> states;
    for (std::size_t i = 0; i < space_.size(); ++i) states.push_back(state(i));
    const double median = middle_90(states, solved_.survivors).value;
    std::vector<std::uint8_t> set;
    for (const double one : states) set.push_back(one >= median);
    return set;
  }

  NoiseOfPhase noise_of(int phase) const {
    markov::DrawOptions own = draw_options(options_, draws_told, 0);
    own.replicate = 1u << 22 | static_cast<std::uint32_t>(phase);  // a study's replicates are fewer
    NoiseOfPhase noise{markov::make_draws(problem_.map.noise_dimension(), own), {}, {}};
    const auto d = static_cast<std::size_t>(noise.draws.dimension);
    for (std::size_t k = 0; k < noise.draws.count(); ++k)
      noise.contact.push_back(contact_noise_.draw(std::span(noise.draws.score).subspan(k * d, d)));
    noise.weight.assign(steps_told, std::vector<double>(noise.draws.count(), 0.0));
    return noise;
  }

  bool matters(std::size_t i) const {
    return std::any_of(last_.share.begin(), last_.share.end(),
                       [&](const auto& share) { return share[i] > negligible_share; });
  }

  /// Says where every draw leads from a cell; -infinity for rest.
  std::vector<double> landings(std::size_t i, const markov::NoiseTable& table, const markov::Draws& draws) const {
    std::vector<double> next(draws.count());
    const markov::Grid& grid = space_.grid(space_.phase(i));
    table.land(grid.lower(space_.cell(i)), grid.width(space_.cell(i)), draws.offset, 0, next);
    return next;
  }

  void weigh(int phase) {
    NoiseOfPhase& noise = noise_[static_cast<std::size_t>(phase)];
    const auto table = problem_.map.tabulate(phase, noise.draws.score);
    const int next_phase = (phase + 1) % space_.phases();
    for (std::size_t c = 0; c < space_.cells(); ++c) {
      const std::size_t i = space_.index(phase, c);
      if (!matters(i)) continue;
      const std::vector<double> next = landings(i, *table, noise.draws);
      for (std::size_t n = 0; n < next.size(); ++n) {
        const double weight = visits_[i] * noise.draws.weight[n];
        if (std::isinf(next[n])) {
          noise.weight[0][n] += weight;
          continue;
        }
        const std::size_t to = space_.index(next_phase, space_.grid(next_phase).cell(next[n]));
        for (std::size_t k = 1; k < last_.share.size(); ++k) noise.weight[k][n] += weight * last_.fails_in[k - 1][to];
      }
    }
  }

  /// Describes step k before failure, or all steps of the regime (k = -1).
  StepProfile profile(const std::vector<double>& share, int k) const {
    StepProfile told;
    std::vector<double> speeds, widths;
    double all = 0;
    for (std::size_t i = 0; i < share.size(); ++i) {
      const markov::Grid& grid = space_.grid(space_.phase(i));
      const double low = problem_.observable(grid.lower(space_.cell(i))),
                   high = problem_.observable(grid.lower(space_.cell(i)) + grid.width(space_.cell(i)));
      speeds.push_back(0.5 * (low + high));
      widths.push_back(std::abs(high - low));
      told.bound_to_fail += share[i] * bound_[i];
      all += share[i];
    }
    told.bound_to_fail /= all;
    told.state.push_back(middle_90(speeds, share, widths));
    std::vector<double> restitution, friction, weight;
    for (const NoiseOfPhase& noise : noise_)
      for (std::size_t n = 0; n < noise.contact.size(); ++n) {
        restitution.push_back(noise.contact[n].restitution);
        friction.push_back(noise.contact[n].friction);
        weight.push_back(k < 0 ? noise.draws.weight[n] : noise.weight[static_cast<std::size_t>(k)][n]);
      }
    told.noise = {middle_90(restitution, weight), middle_90(friction, weight)};
    return told;
  }

  /// Returns the likeliest path's step k, with the draw of the largest density that leads on.
  PathStep path_step(std::size_t k) const {
    const std::size_t i = last_.likeliest[k];
    const int phase = space_.phase(i), next_phase = (phase + 1) % space_.phases();
    const NoiseOfPhase& noise = noise_[static_cast<std::size_t>(phase)];
    const auto table = problem_.map.tabulate(phase, noise.draws.score);
    const std::vector<double> next = landings(i, *table, noise.draws);
    PathStep step{phase, {problem_.observable(state(i))}, {}};
    double least = infinite;
    for (std::size_t n = 0; n < next.size(); ++n) {
      const bool leads_on =
          k == 0 ? std::isinf(next[n])
                 : std::isfinite(next[n]) &&
                       space_.index(next_phase, space_.grid(next_phase).cell(next[n])) == last_.likeliest[k - 1];
      const double square = noise.score_square(n);
      if (!leads_on || square >= least) continue;
      least = square;
      step.noise = {noise.contact[n].restitution, noise.contact[n].friction};
    }
    return step;
  }

  const Problem& problem_;
  dynamics::ContactNoise contact_noise_;
  const StudyOptions& options_;
  markov::StateSpace space_;
  markov::SampledChain sampled_;
  SolvedChain solved_;
  std::vector<double> visits_, width_, bound_;
  markov::LastSteps last_;
  std::vector<NoiseOfPhase> noise_;
};

LastMoments nothing(const char* reason) {
  LastMoments told;
  told.reason = reason;
  return told;
}

}  // namespace

LastMoments how_it_fails(const Setting& setting, const Metastability& study, const StudyOptions& options) {
  if (std::isinf(study.steps.from_start.value)) return nothing("the expected steps are infinite or not resolved");
  if (setting.noise_free()) return nothing("without noise every step is the same");
  if (study.method == Method::followed) return nothing("the noise is too narrow for cells of states");
  const Problem problem = setting.problem(landing_options(options));
  const StudyOptions own = deep_enough(options, study.spectrum.failure_rate.value);
  const bool beside = study.steps.safe_state.has_value();
  const std::optional<Pilot> pilot = solve_pilot(problem, own, beside);
  if (!pilot) return nothing("no draw came to rest");
  const std::size_t cells = std::clamp<std::size_t>(study.cells, 128, most_cells_told);
  return Failures(setting, problem, own, *pilot, cells).tell();
}

}  // namespace metastable::analysis
