#pragma once
// Follows a weighted ensemble of replicas through a return map: where failures are rare it splits replicas, where they
// are far it merges them, and what fails is recycled among the survivors.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "markov/mesh/batch_map.h"
#include "markov/splitting/failing_walks.h"

namespace metastable::markov {

/// Says that splitting has no number to give, and why.
class NoSplitting : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Writes the level of each state at a phase: a number that rises towards failure. Must be safe to call from several
/// threads, finite, and the same for the same state.
using LevelFunction = std::function<void(int phase, std::span<const double> states, std::span<double> levels)>;

/// Holds what an ensemble is split by.
struct Levels {
  LevelFunction level;                     ///< empty: all replicas stand in one bin
  std::vector<std::vector<double>> edges;  ///< phase by phase, ascending: bins are [edge, next edge)
};

/// Replicas of one machine that carry weights, which sum to one. In every step each replica steps with noise of its
/// own. The weight of those that fail is spread over the survivors in proportion to theirs, so that the ensemble
/// settles at the quasi-stationary distribution. Bins of the level then get the same number of replicas each, of even
/// weights: expectations stay what they were (Huber and Kim 1996; recycling at the quasi-stationary distribution: Wang,
/// Ambrose and Zuckerman 2009; Aristoff and Zuckerman 2020 for the choice of bins).
///
/// The share that fails in step n, given survival so far, converges to the true one like 1/replicas, and the product of
/// the shares that survive has its exact mean for any level and any bins (Del Moral 2004, section 7.4).
class WeightedEnsemble {
 public:
  /// All replicas start at `start`, at phase 0. @param replicas  in all, shared among the bins, >= 2
  /// @param stream  of random numbers (Philox: seed, stream, replica, step)
  WeightedEnsemble(const BatchMap& map, std::span<const double> start, std::size_t replicas, std::uint64_t seed,
                   std::uint64_t stream);

  /// Splits by other levels from the next step on.
  void set_levels(Levels levels);
  /// Takes one step and returns the share of the weight that fails in it: 1 where all replicas fail, which is the last.
  /// @pre  not all_failed()  @throws MapError where a level is not finite; as checked_step
  double advance();
  bool all_failed() const { return size() == 0; }
  double survival() const { return survival_; }  ///< share of the weight that has not failed in any step
  /// Lets every replica found a line of descent; failures are counted for the lines founded two marks ago.
  void mark();

  int phase() const { return phase_; }
  std::uint64_t steps() const { return steps_; }  ///< taken by the ensemble
  std::uint64_t calls() const { return calls_; }  ///< rows that the map was asked for
  std::size_t size() const { return weights_.size(); }
  std::span<const double> states() const { return states_; }
  std::span<const double> weights() const { return weights_; }
  std::span<const double> levels() const { return levels_; }  ///< 0 where there are none
  std::span<const int> bins() const { return bins_; }
  /// Returns the weight that failed of each line that any failed of, since the second mark.
  std::vector<double> lines() const;
  std::uint64_t failures() const { return failures_; }  ///< replicas that failed

  /// Remembers from now on the last steps of what fails, of some `most` to twice as many walks.
  void remember(std::size_t steps, std::size_t most);
  /// Returns them. @pre remember() was called
  const FailingWalks& failing() const { return memory_->walks(); }

 private:
  void step();
  void place();
  std::vector<std::uint32_t> resample();

  const BatchMap& map_;
  std::size_t replicas_;
  std::uint64_t seed_, stream_;
  Levels split_;
  int phase_ = 0, marks_ = 0;
  double survival_ = 1;
  std::uint64_t steps_ = 0, calls_ = 0, failures_ = 0;
  std::vector<double> states_, weights_, levels_;
  std::vector<int> bins_;
  std::vector<std::uint32_t> line_, older_line_;
  std::vector<double> failed_of_line_, ended_lines_;
  std::vector<double> scores_, next_;
  std::vector<std::uint64_t> words_;
  std::vector<std::uint8_t> failed_;
  std::optional<WalkMemory> memory_;
  std::size_t most_remembered_ = 0;
};

}  // namespace metastable::markov
