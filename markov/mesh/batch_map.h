#pragma once
// States what any stochastic return map is: what meshes, splitting and simulations ask of it.

#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace metastable::markov {

/// Says that a map broke its promises, and from which state.
class MapError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A stochastic return map, in batches: n states in rows of `dimension` numbers, scores in rows of `scores`
/// independent standard normal numbers. The event at phase p is followed by the one at phase (p + 1) % phases.
struct BatchMap {
  int dimension = 1;               ///< 1 to most_dimensions; meshes hold most_mesh_dimensions at most
  int scores = 1;                  ///< 1 or more; 0 for a map that draws for itself
  int phases = 1;                  ///< >= 1
  std::vector<std::string> names;  ///< of the numbers of a state, with units; empty: numbered
  /// Writes where each state leads under its scores, or sets its `failed` to 1 (the row of `next` is then not read).
  /// Must be safe to call from several threads.
  std::function<void(int phase, std::span<const double> states, std::span<const double> scores, std::span<double> next,
                     std::span<std::uint8_t> failed)>
      step;
  /// Serves maps with scores = 0 instead of `step`: each row draws with random words of its own (words[i]). Such maps
  /// can be simulated and split; meshes refuse them, because the tails of their noise cannot be weighted.
  std::function<void(int phase, std::span<const double> states, std::span<const std::uint64_t> words,
                     std::span<double> next, std::span<std::uint8_t> failed)>
      draw;
  /// Says whether a state lies in the section, where the map is defined; empty: everywhere. A mesh counts its nodes
  /// outside as failed; a landing outside is an error.
  std::function<bool(int phase, std::span<const double> state)> inside;
  /// Says that a call costs much more than a row, as where an interpreter runs it: work is then laid out for few calls
  /// of many rows, of which some may turn out not to be needed. Answers are those of a map that is not dear.
  bool dear = false;
};

inline constexpr int most_dimensions = 30, most_mesh_dimensions = 4;

/// Counts the rows at most that a dear map is asked for in one call: enough that the call itself costs nothing.
inline constexpr std::size_t rows_of_a_dear_call = 16384;

/// @throws std::invalid_argument naming what is missing or out of range
void require_map(const BatchMap& map);

/// Does the same, and wants a state as long as it has dimensions to start from.
void require_start(const BatchMap& map, std::span<const double> start);

/// Returns whether a state is finite and inside the map's section at its phase.
bool is_landing(const BatchMap& map, int phase, std::span<const double> state);

/// Looks at what a step from states at `phase` gave.
/// @throws MapError naming the state from which a landing is not finite or outside the map's section
void require_landings(const BatchMap& map, int phase, std::span<const double> states, std::span<const double> next,
                      std::span<const std::uint8_t> failed);

/// Calls map.step and looks at what comes back.
/// @throws MapError naming the state from which a landing is not finite or outside the map's section
void checked_step(const BatchMap& map, int phase, std::span<const double> states, std::span<const double> scores,
                  std::span<double> next, std::span<std::uint8_t> failed);

/// Does the same for maps that draw for themselves.
void checked_draw(const BatchMap& map, int phase, std::span<const double> states, std::span<const std::uint64_t> words,
                  std::span<double> next, std::span<std::uint8_t> failed);

/// Returns the map with numbers of its state that are angles [rad]: landings are counted within pi of `around`, and the
/// map sees them within pi of zero. So an orbit on the seam where a map wraps its angles is no jump.
/// @param angles  places in the state, below the dimension  @param around  a state near the orbit
/// @throws std::invalid_argument for another place
BatchMap with_angles(BatchMap map, const std::vector<int>& angles, std::span<const double> around);

/// Returns a state as words: "half angle [rad] = 0.27, ...".
std::string describe_state(const BatchMap& map, std::span<const double> state);

}  // namespace metastable::markov
