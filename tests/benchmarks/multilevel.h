#pragma once
// Finds a failure rate by fixed-effort multilevel splitting, to be held against the weighted ensemble.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "markov/splitting/weighted_ensemble.h"
#include "markov/transition_rows/draws.h"
#include "markov/transition_rows/score_lattice.h"

namespace metastable {

inline constexpr std::size_t walks = 1000;                // of a stage, and replicas of an ensemble
inline constexpr std::uint64_t burn_in = 60, kept = 100;  // steps of an ensemble
inline constexpr double failed_level = std::numeric_limits<double>::infinity();

struct Rate {
  double rate = 0, calls = 0;
};

/// Fixed effort (Garvels and Kroese 1998): as many walks from each threshold, begun where walks crossed it, and
/// followed until they cross the next one, fail, or are back in the middle, whose level is below the first threshold.
/// The rate is the crossings of the second one a step, times the chances of all others.
class Multilevel {
 public:
  Multilevel(const markov::BatchMap& map, const std::vector<double>& start, const markov::Levels& levels,
             std::uint64_t seed)
      : map_(map), start_(start), levels_(levels), seed_(seed), thresholds_(levels.edges.front()) {}

  Rate run(std::uint64_t repetition) {
    stream_ = repetition << 20, calls_ = 0;
    Crossings now = leave_the_middle();
    double rate = now.share;
    for (std::size_t k = 2; k <= thresholds_.size() && rate > 0; ++k) {
      now = follow(now, k < thresholds_.size() ? thresholds_[k] : failed_level);
      rate *= now.share;
    }
    return {rate, static_cast<double>(calls_)};
  }

 private:
  struct Crossings {
    double share = 0;  ///< of the walks that cross, or of crossings a step
    std::vector<double> states;
    std::vector<std::uint8_t> failed;  ///< in the step that crossed
    void add(const double* state, std::size_t dimension, bool fails) {
      states.insert(states.end(), state, state + dimension), failed.push_back(fails);
    }
  };

  std::vector<double> level(std::span<const double> states, const std::vector<std::uint8_t>& failed) const {
    std::vector<double> found(failed.size());
    levels_.level(0, states, found);
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (failed[i]) found[i] = failed_level;
    return found;
  }

  void step(std::vector<double>& states, std::vector<std::uint8_t>& failed) {
    std::vector<double> scores(failed.size() * static_cast<std::size_t>(map_.scores)), next = states;
    for (std::size_t i = 0; i < scores.size(); ++i)
      scores[i] = markov::normal_score(markov::uniforms(seed_, 1, stream_ + i, calls_)[0]);
    markov::checked_step(map_, 0, states, scores, next, failed);
    calls_ += failed.size();
    const std::size_t d = start_.size();
    for (std::size_t i = 0; i < failed.size(); ++i)
      if (!failed[i]) std::copy_n(&next[i * d], d, &states[i * d]);
  }

  /// Lets a quarter of the walks go on, and counts how often they cross the second threshold from the middle.
  Crossings leave_the_middle() {
    const std::size_t d = start_.size(), few = walks / 4;
    std::vector<double> states;
    for (std::size_t i = 0; i < few; ++i) states.insert(states.end(), start_.begin(), start_.end());
    std::vector<std::uint8_t> failed(few, 0), outside(few, 0);
    Crossings found;
    for (std::uint64_t n = 0; n < burn_in + kept; ++n) {
      step(states, failed);
      const std::vector<double> at = level(states, failed);
      for (std::size_t i = 0; i < few; ++i) {
        const bool crosses = !outside[i] && at[i] >= thresholds_[1];
        if (crosses && n >= burn_in) found.add(&states[i * d], d, failed[i]);
        outside[i] = crosses || (outside[i] && at[i] >= thresholds_[0]);
        if (std::exchange(failed[i], 0)) std::copy(start_.begin(), start_.end(), &states[i * d]), outside[i] = 0;
      }
    }
    found.share = static_cast<double>(found.failed.size()) / static_cast<double>(few * kept);
    return found;
  }

  /// Follows walks from crossings, taken in turns from a random one on, up to the next threshold.
  Crossings follow(const Crossings& from, double next) {
    const std::size_t d = start_.size(), there = from.failed.size();
    Crossings now, found;
    const auto first = static_cast<std::size_t>(markov::uniforms(seed_, 2, stream_, calls_)[0] * 1e6);
    for (std::size_t i = 0; i < walks; ++i) {
      const std::size_t at = (first + i * std::max<std::size_t>(1, there / walks)) % there;
      now.add(&from.states[at * d], d, from.failed[at]);
    }
    for (;;) {
      const std::vector<double> at = level(now.states, now.failed);
      Crossings left;
      for (std::size_t i = 0; i < at.size(); ++i)
        if (at[i] >= next)
          found.add(&now.states[i * d], d, now.failed[i]);
        else if (at[i] >= thresholds_[0])
          left.add(&now.states[i * d], d, false);
      if (left.failed.empty()) break;
      now = std::move(left);
      step(now.states, now.failed);
    }
    found.share = static_cast<double>(found.failed.size()) / static_cast<double>(walks);
    return found;
  }

  const markov::BatchMap& map_;
  std::vector<double> start_;
  markov::Levels levels_;
  std::uint64_t seed_, stream_ = 0, calls_ = 0;
  std::vector<double> thresholds_;  ///< the middle's, then those that are crossed
};

}  // namespace metastable
