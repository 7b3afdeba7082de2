#pragma once
// Learns from states that an ensemble visited how likely a failure is within a window of steps.

#include <cstdint>
#include <span>
#include <vector>

#include "markov/splitting/weighted_ensemble.h"

namespace metastable::markov {

/// States that an ensemble visited, phase by phase, with their weights and levels.
struct Visits {
  struct Phase {
    std::vector<double> states, weights, levels;
  };
  std::vector<Phase> phases;
  void add(const WeightedEnsemble& ensemble);
  void clear();
};

/// Coordinates of one phase in which the states that an ensemble visited, by weight, have mean 0 and unit variance
/// along the principal axes of their correlations; axes narrower than 0.05 of the widest count as that wide.
class VisitFrame {
 public:
  VisitFrame(const BatchMap& map, const Visits::Phase& visits);
  /// Writes the coordinates of a state.
  void place(std::span<const double> state, std::span<float> coordinates) const;

 private:
  std::vector<double> centre_, inverse_;
};

/// Returns the distance from the middle of what was visited: the level that knows nothing of failures.
LevelFunction distance_level(std::vector<VisitFrame> frames, int dimension);

struct LearningOptions {
  std::size_t anchors = 1000;  ///< states that the chance is found at, of all phases together
  int window = 20;             ///< [steps], at least
  std::uint64_t seed = 1, stream = 0;
};

/// Holds the chance of failing within a window at anchors, and interpolates its logarithm between the nearest of them.
struct LearntLevel {
  LevelFunction level;  ///< empty where no anchor leads to failure
  int window = 0;  ///< [steps], at most 20 times that asked: a longer one would let no more anchors lead to failure
  std::uint64_t calls = 0;  ///< rows that the map was asked for
};

/// Takes anchors among the visits, evenly over levels, lands each under several draws of the noise, and finds the
/// chance of failing from the chain among the anchors: a landing is shared among the nearest ones, nearer ones getting
/// more. In more than four dimensions the nearest are far; quadratic forms fitted to the logarithm then take their
/// place. It is coarse, and only a guide: what an ensemble finds does not hang on it, how surely does.
LearntLevel learn_level(const BatchMap& map, const std::vector<VisitFrame>& frames, const Visits& visits,
                        const std::vector<std::vector<double>>& edges, const LearningOptions& options);

/// Returns edges between which the weight of what was visited falls by a factor of exp(1.2), as far as 20 visits lie
/// beyond.
std::vector<std::vector<double>> quantile_edges(const Visits& visits);

}  // namespace metastable::markov
