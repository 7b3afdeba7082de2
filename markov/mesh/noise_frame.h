#pragma once
// Finds the principal axes of a map's noise, in which the linear response to it has unit variance in every direction.

#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "markov/mesh/batch_map.h"

namespace metastable::markov {

/// Holds the coordinates u of one phase: state = centre + axes u, u = inverse (state - centre). Matrices are row-major.
struct NoiseFrame {
  std::vector<double> centre;  ///< the noise-free orbit's state
  std::vector<double> axes;    ///< dimension x dimension
  std::vector<double> inverse;
  std::vector<double> sds;  ///< share of each axis in the correlations' spread, falling; sds^2 sum to the dimension
};

/// Says that there is no noise-free orbit to centre a mesh on: the map fails there, does not settle, or is unstable.
class NoOrbit : public MapError {
 public:
  using MapError::MapError;
};

/// Says that a map has more dimensions than meshes hold.
class TooManyDimensions : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Finds the noise-free orbit by following the map from `start` at phase 0, its derivatives by central differences, and
/// from them the stationary covariance of the linear response, S' = A S A^T + B B^T, phase by phase. Axes are the
/// eigenvectors of its correlations. Where the map jumps in a score, so that the derivative is more than three times
/// the change from -1 to 1 sd, that change counts. An axis narrower than 0.05 of the widest counts as that wide: bent
/// landings would fill it with nodes that tell nothing (a compass on facets takes twelve times fewer).
/// @throws NoOrbit when the map fails without noise or right beside that, does not settle, or is unstable, naming the
/// state; MapError as checked_step does, and when the noise does not move every number of the state, or one alike to
/// either side; TooManyDimensions
std::vector<NoiseFrame> noise_frames(const BatchMap& map, std::span<const double> start);

/// Holds the noise-free orbit, by the frames around it, and how what is beside it comes back.
struct NoiseFreeOrbit {
  std::vector<NoiseFrame> frames;                 ///< phase by phase
  std::vector<std::complex<double>> eigenvalues;  ///< of the derivative over all phases, by falling modulus
};
/// Does the same as noise_frames(), and keeps the eigenvalues. @throws as it
NoiseFreeOrbit noise_free_orbit(const BatchMap& map, std::span<const double> start);

inline constexpr int longest_period = 16;

/// An attractor without noise that comes back after several revolutions.
struct PeriodicGait {
  int period = 1;             ///< revolutions, up to longest_period
  std::vector<double> state;  ///< on it, at phase 0
};

/// Finds where the map leads without noise from right beside `start`, 1e-6 of it away: an orbit that is a start itself
/// may be unstable. Returns nothing where that fails within 5000 revolutions, or has no period up to longest_period.
std::optional<PeriodicGait> periodic_gait(const BatchMap& map, std::span<const double> start);

/// Follows the map likewise, and returns the period [revolutions] of an orbit that comes back more seldom than
/// longest_period, but within 1000; 0: there is none.
int longer_period(const BatchMap& map, std::span<const double> start);

/// Returns one frame for each of the first `phases` of frames that follow one another in turns: of the mean of their
/// covariances, around the centre of the first.
std::vector<NoiseFrame> common_frames(const std::vector<NoiseFrame>& frames, int phases);

/// A walk without noise, wherever it leads.
struct NoiseFreeWalk {
  std::vector<NoiseFrame> frames;  ///< one for each phase, around the first of its states that has one
  std::uint64_t fails_after = 0;   ///< steps; 0: it does not fail
};

/// Follows the map without noise from right beside `start`, for 300 revolutions or to its failure. A frame holds all
/// states of its phase: it is that of the response to the noise of the last steps, as many as the state has numbers,
/// with the mean of the inverse covariances, so that it is as narrow as they are. What stretches without end has no
/// stationary response, and of an orbit of several revolutions that would be wider than what a shift bends.
/// Returns nothing where no step of the walk has a derivative, or one leads where the map is not defined.
std::optional<NoiseFreeWalk> noise_free_walk(const BatchMap& map, std::span<const double> start);

/// Returns the map watched over so many of its revolutions: of the phases of one come those of the next.
BatchMap over_revolutions(const BatchMap& map, int revolutions);

}  // namespace metastable::markov
