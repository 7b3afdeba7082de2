#include "analysis/walkers/split_falls.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "analysis/statistics/interval_95.h"
#include "analysis/walkers/round_quantiles.h"

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

// Adds a number to a profile: its median and middle 90 %, and how well they are known.
void tell(const std::vector<double>& values, std::span<const double> weights, std::span<const std::size_t> ends,
          std::vector<Estimate>& spread, std::vector<SpreadIntervals>& known) {
  spread.push_back(middle_90(values, weights));
  known.push_back(round_quantiles(values, weights, ends));
}

StepProfile profile(const markov::SplittingStudy& study, std::size_t k, const std::vector<NamedNoise>& noises) {
  const markov::FailingWalks& walks = study.failing;
  StepProfile told;
  told.bound_to_fail = not_told;
  for (std::size_t i = 0; i < walks.dimension; ++i)
    tell(column(walks.size(), [&](std::size_t walk) { return walks.state(walk, k)[i]; }), walks.weights,
         study.failing_ends, told.state, told.state_95);
  for (std::size_t i = 0; i < noises.size(); ++i)
    tell(column(walks.size(),
                [&](std::size_t walk) { return noises[i].mean + noises[i].sd * walks.scores_met(walk, k)[i]; }),
         walks.weights, study.failing_ends, told.noise, told.noise_95);
  return told;
}

StepProfile regime(const markov::SplittingStudy& study, const std::vector<NamedNoise>& noises) {
  StepProfile told;
  told.bound_to_fail = not_told;
  const std::size_t d = study.failing.dimension, n = study.regime_weights.size();
  for (std::size_t i = 0; i < d; ++i)
    tell(column(n, [&](std::size_t at) { return study.regime_states[at * d + i]; }), study.regime_weights,
         study.regime_ends, told.state, told.state_95);
  for (const NamedNoise& noise : noises) {  // as given
    const Estimate spread{noise.mean, noise.mean - normal_90 * noise.sd, noise.mean + normal_90 * noise.sd};
    told.noise.push_back(spread);
    told.noise_95.push_back({{spread.value, spread.value, spread.value},
                             {spread.lower, spread.lower, spread.lower},
                             {spread.upper, spread.upper, spread.upper}});
  }
  return told;
}

// Says where the rounds lie so far apart that a median is not known; else nothing.
std::string rounds_apart(const LastMoments& moments) {
  for (std::size_t k = 0; k < moments.last.size(); ++k)
    for (const auto& [names, spreads, known] :
         {std::tuple(&moments.state_names, &moments.last[k].state, &moments.last[k].state_95),
          std::tuple(&moments.noise_names, &moments.last[k].noise, &moments.last[k].noise_95)})
      for (std::size_t i = 0; i < spreads->size(); ++i)
        if ((*spreads)[i].upper > (*spreads)[i].lower && !std::isfinite((*known)[i].median.lower))
          return fmt::format("the rounds lie too far apart to tell the median of {} in the step {}", (*names)[i],
                             k == 0 ? "that fails" : fmt::format("{} before that", k));
  return "";
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
  if (study.all_failed)
    moments.reason = "walks fail before the start is forgotten, so that no regime stands beside them";
  if (!moments.reason.empty()) return moments;
  moments.by_phase.assign(static_cast<std::size_t>(map.phases), 0.0);
  double all = 0;
  for (const double weight : walks.weights) all += weight;
  for (std::size_t walk = 0; walk < walks.size(); ++walk)
    moments.by_phase[static_cast<std::size_t>(walks.phases[walk])] += walks.weights[walk] / all;
  for (int p = 0; p < map.phases && map.phases > 1; ++p)
    moments.by_phase_95.push_back(
        round_share(column(walks.size(), [&](std::size_t walk) { return walks.phases[walk] == p ? 1.0 : 0.0; }),
                    walks.weights, study.failing_ends));
  for (std::size_t k = 0; k < walks.steps; ++k) moments.last.push_back(profile(study, k, noises));
  moments.regime = regime(study, noises);
  if (std::string reason = rounds_apart(moments); !reason.empty()) {
    LastMoments none;
    none.reason = std::move(reason);
    return none;
  }
  if (!noises.empty()) moments.likeliest = likeliest(walks, noises, map.phases);
  return moments;
}

}  // namespace metastable::analysis
