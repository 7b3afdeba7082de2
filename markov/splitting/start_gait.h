#pragma once
// Knows the gait of a start, and tells which states lead to another one.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "markov/mesh/batch_map.h"

namespace metastable::markov {

/// Holds the noise-free orbit that leads away from right beside a start. Not thread-safe.
class StartGait {
 public:
  /// @param map    must outlive it
  /// @param start  a state at phase 0
  /// @param scale  of each number of a state: what is within half of it in all directions counts as near, > 0
  StartGait(const BatchMap& map, std::span<const double> start, std::vector<double> scale);

  /// Says that there is no gait to leave: the start fails without noise, or the map draws for itself, so that it cannot
  /// be followed without noise.
  bool none() const { return orbit_.empty(); }

  /// Follows states of phase 0 without noise, 300 revolutions at most. Returns for each whether it ends neither in
  /// failure nor near the orbit. A number of the state that comes back more slowly, or never, counts as another gait's.
  /// @pre !none()
  std::vector<std::uint8_t> left(std::span<const double> states);

  /// Returns states of phase 0 that 128 walks from `start` come through in 128 steps, or eight revolutions, under
  /// `heat` times the noise; a walk that fails begins again.
  std::vector<double> heated(std::span<const double> start, double heat, std::uint64_t seed);

  /// Returns the state to which the first of those led that left() has found; empty: it has found none.
  const std::vector<double>& elsewhere() const { return elsewhere_; }
  std::uint64_t calls() const { return calls_; }  ///< rows that the map was asked for

 private:
  bool near(const double* state) const;
  void revolve(std::vector<double>& states, std::vector<std::size_t>& which,
               const std::function<void(std::size_t place, int phase, std::span<double> scores)>& draw = {});

  const BatchMap& map_;
  std::vector<double> scale_, orbit_, elsewhere_;
  std::uint64_t calls_ = 0;
};

}  // namespace metastable::markov
