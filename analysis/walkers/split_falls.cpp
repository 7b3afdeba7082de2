#include "analysis/walkers/split_falls.h"

#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

constexpr double not_told = std::numeric_limits<double>::quiet_NaN();

// Returns the number i of a step of every walk.
template <class Of>
std::vector<double> column(std::size_t walks, const Of& of) {
  std::vector<double> values;
  for (std::size_t walk = 0; walk < walks; ++walk) values.push_back(of(walk));
  return values;
}

StepProfile profile(const markov::FailingWalks& walks, std::size_t k, const std::vector<NamedNoise>& noises) {
  StepProfile told;
  told.bound_to_fail = not_told;
  for (std::size_t i = 0; i < walks.dimension; ++i)
    told.state.push_back(
        middle_90(column(walks.size(), [&](std::size_t walk) { return walks.state(walk, k)[i]; }), walks.weights));
  for (std::size_t i = 0; i < noises.size(); ++i)
    told.noise.push_back(middle_90(
        column(walks.size(),
               [&](std::size_t walk) { return noises[i].mean + noises[i].sd * walks.scores_met(walk, k)[i]; }),
        walks.weights));
  return told;
}

StepProfile regime(const markov::SplittingStudy& study, const std::vector<NamedNoise>& noises) {
  StepProfile told;
  told.bound_to_fail = not_told;
  const std::size_t d = study.failing.dimension, n = study.regime_weights.size();
  for (std::size_t i = 0; i < d; ++i)
    told.state.push_back(
        middle_90(column(n, [&](std::size_t at) { return study.regime_states[at * d + i]; }), study.regime_weights));
  for (const NamedNoise& noise : noises)
    told.noise.push_back({noise.mean, noise.mean - normal_90 * noise.sd, noise.mean + normal_90 * noise.sd});
  return told;
}

std::vector<PathStep> likeliest(const markov::FailingWalks& walks, const std::vector<NamedNoise>& noises, int phases) {
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t walk = 0; walk < walks.size(); ++walk) {
    double squares = 0;
    for (std::size_t k = 0; k < walks.steps; ++k)
      for (const double score : walks.scores_met(walk, k)) squares += score * score;
    if (squares < least) best = walk, least = squares;
  }
  std::vector<PathStep> path;
  for (std::size_t k = walks.steps; k-- > 0;) {
    PathStep& step = path.emplace_back();
    const int back = static_cast<int>(k % static_cast<std::size_t>(phases));
    step.phase = (walks.phases[best] - back + phases) % phases;
    const auto state = walks.state(best, k), scores = walks.scores_met(best, k);
    step.state.assign(state.begin(), state.end());
    for (std::size_t i = 0; i < noises.size(); ++i) step.noise.push_back(noises[i].mean + noises[i].sd * scores[i]);
  }
  return path;
}

}  // namespace

LastMoments how_it_falls(const markov::BatchMap& map, const std::vector<NamedNoise>& noises,
                         const markov::SplittingStudy& study) {
  const markov::FailingWalks& walks = study.failing;
  if (noises.size() != walks.scores) throw std::invalid_argument("how it falls: one noise for each score expected");
  LastMoments moments;
  moments.state_names = map.names;
  for (std::size_t k = moments.state_names.size(); k < walks.dimension; ++k)
    moments.state_names.push_back("x" + std::to_string(k + 1));
  for (const NamedNoise& noise : noises) moments.noise_names.push_back(noise.name);
  if (walks.size() == 0) moments.reason = "no walk was long enough";
  if (study.all_failed) moments.reason = "walks fail before the start is forgotten, so that no regime stands beside them";
  if (!moments.reason.empty()) return moments;
  moments.by_phase.assign(static_cast<std::size_t>(map.phases), 0.0);
  double all = 0;
  for (const double weight : walks.weights) all += weight;
  for (std::size_t walk = 0; walk < walks.size(); ++walk)
    moments.by_phase[static_cast<std::size_t>(walks.phases[walk])] += walks.weights[walk] / all;
  for (std::size_t k = 0; k < walks.steps; ++k) moments.last.push_back(profile(walks, k, noises));
  moments.regime = regime(study, noises);
  if (!noises.empty()) moments.likeliest = likeliest(walks, noises, map.phases);
  return moments;
}

}  // namespace metastable::analysis
