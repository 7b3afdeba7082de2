#pragma once
// Makes a passive walker on rough ground a stochastic return map, from just after one strike to just after the next.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dynamics/walkers/two_link_walker.h"

namespace metastable::dynamics {

/// Says how the slope varies. Every step meets a slope of its own, N(mean, sd^2), independent of all others.
enum class Terrain {
  fresh,  ///< a plane that tilts anew at every step; the state is the walker's
  facets  ///< facets: at the start of a step the feet still stand on the last one, whose slope is one more number
};

/// The walker's stochastic return map: one score a step, the slope's.
///
/// States are the walker's (half angle [rad], rates [rad/s]), with Terrain::facets followed by the slope [rad] of the
/// facet under both feet. Thread-safe.
class WalkerMap {
 public:
  struct Options {
    double slope_rad = 0;
    double slope_sd_rad = 0;  ///< >= 0
    Terrain terrain = Terrain::fresh;
  };
  /// @throws std::invalid_argument naming the quantity and its range
  WalkerMap(TwoLinkWalker walker, Options options);

  const TwoLinkWalker& walker() const { return walker_; }
  const Options& options() const { return options_; }
  int dimension() const;
  /// Says what the numbers of a state are, with units.
  std::vector<std::string> names() const;

  /// Takes one step of each of scores.size() walkers (TwoLinkWalker::step).
  void step(std::span<const double> states, std::span<const double> scores, std::span<double> next,
            std::span<std::uint8_t> fell) const;

 private:
  TwoLinkWalker walker_;
  Options options_;
};

}  // namespace metastable::dynamics
