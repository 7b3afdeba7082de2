#pragma once
// Remembers the last steps of replicas that fail: where each began, and the noise it met.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

namespace metastable::markov {

/// Holds weighted walks that failed. Step k = 0 is the one that failed, k = 1 the one before, and so on.
struct FailingWalks {
  std::size_t steps = 0;  ///< remembered of each walk
  std::size_t dimension = 0, scores = 0;
  std::vector<double> weights;  ///< of each walk
  std::vector<int> phases;      ///< in which it failed
  std::vector<double> states;   ///< [walk][k][dimension]: in which step k began
  std::vector<double> noise;    ///< [walk][k][scores]: normal scores met in it; of maps that draw for themselves none

  std::size_t size() const { return weights.size(); }
  std::span<const double> state(std::size_t walk, std::size_t k) const {
    return std::span(states).subspan((walk * steps + k) * dimension, dimension);
  }
  std::span<const double> scores_met(std::size_t walk, std::size_t k) const {
    return std::span(noise).subspan((walk * steps + k) * scores, scores);
  }
  void add(const FailingWalks& others);
  /// Keeps about `most` walks of even weights, at evenly spaced places along the weights from `offset`, in [0, 1), on;
  /// nothing changes where there are no more.
  void thin(std::size_t most, double offset);
};

/// Follows the replicas of an ensemble backwards.
class WalkMemory {
 public:
  WalkMemory(std::size_t steps, std::size_t dimension, std::size_t scores);

  /// The replicas step. @param scores  met; empty for maps that draw for themselves
  void begin_step(int phase, std::span<const double> states, std::span<const double> scores);
  /// Replica i failed in this step. It is left out where fewer steps are remembered than asked.
  void failed(std::size_t replica, double weight);
  /// The replicas are now those that had these places when the step began.
  void end_step(std::vector<std::uint32_t> places) { places_ = std::move(places); }

  FailingWalks& walks() { return walks_; }
  const FailingWalks& walks() const { return walks_; }

 private:
  struct Step {
    int phase = 0;
    std::vector<double> states, scores;
    std::vector<std::uint32_t> before;  ///< place of each replica in the step before
  };
  std::size_t asked_;
  std::deque<Step> steps_;  ///< the last one at the end
  std::vector<std::uint32_t> places_;
  FailingWalks walks_;
};

}  // namespace metastable::markov
