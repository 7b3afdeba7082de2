#include "analysis/walkers/walker_trials.h"

#include <span>
#include <utility>

#include "markov/parallel.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable::analysis {
namespace {

constexpr std::uint64_t stream_of_walks = 0x7000;

}  // namespace

std::vector<Walk> simulate_walks(const WalkerSetting& setting, const WalkOptions& options) {
  const markov::BatchMap batch = batch_map(setting);
  const std::vector<double> start = start_state(setting);
  std::vector<Walk> walks(options.trials);
  const auto follow = [&](std::size_t trial) {
    Walk& walk = walks[trial];
    std::vector<double> state = start, next(start.size());
    for (std::uint64_t step = 0; step < options.longest && !walk.fell; ++step) {
      const double score = markov::normal_score(markov::uniforms(options.seed, stream_of_walks, trial, step)[0]);
      std::uint8_t fell = 0;
      markov::checked_step(batch, 0, state, std::span(&score, 1), next, {&fell, 1});
      walk.steps.push_back({state, setting.slope_deg + setting.slope_sd_deg * score});
      walk.fell = fell != 0;
      state.swap(next);
    }
  };
  markov::parallel_for(options.trials, options.threads, follow, options.progress);
  return walks;
}

}  // namespace metastable::analysis
