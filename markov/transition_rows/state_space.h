#pragma once
// Puts cells for all phases of a return map where they matter.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "markov/transition_rows/grid.h"
#include "markov/transition_rows/return_map.h"

namespace metastable::markov {

/// Holds the cells of every phase; states are numbered phase by phase.
class StateSpace {
 public:
  /// @param grids one per phase, all with the same number of cells
  explicit StateSpace(std::vector<Grid> grids);
  int phases() const { return static_cast<int>(grids_.size()); }
  std::size_t cells() const { return grids_.front().cells(); }
  std::size_t size() const { return grids_.size() * cells(); }
  const Grid& grid(int phase) const { return grids_[static_cast<std::size_t>(phase)]; }
  std::size_t index(int phase, std::size_t cell) const { return static_cast<std::size_t>(phase) * cells() + cell; }
  int phase(std::size_t state) const { return static_cast<int>(state / cells()); }
  std::size_t cell(std::size_t state) const { return state % cells(); }
  StateSpace halved() const;

 private:
  std::vector<Grid> grids_;
};

/// Tells the state just before event number 1.
struct LaunchState {
  std::function<double(double score)> state;  ///< state at a standard normal score; ascending
  int phase = 0;                              ///< phase of event number 1
};

/// Lays cells over the map's own reach, from the lowest state a survivor can have at each phase. The bulk, cut into
/// equal cells, ends where landings from its top edge under noise exceeded once in 50 events no longer lead higher, and
/// holds the landings after a launch that is not far above that. Beyond it cells widen in proportion to the distance
/// from the lower edge, up to `reach` times the bulk (a map that can gain energy spreads survivors over decades) and
/// past the landings of a fast launch; a finite upper end of the map's own interval is kept instead when it is lower.
/// @param cells per phase, >= 1; @param reach >= 1
StateSpace covering_space(const AnyReturnMap& map, const LaunchState& launch, std::size_t cells, std::uint64_t seed,
                          double reach = 1.5);

/// Returns the bulk's width over the lowest state where the landings of a fast launch lie far above it, else infinity.
double bulk_below_launch(const AnyReturnMap& map, const LaunchState& launch, std::uint64_t seed);

/// Says how many times the cells of the bulk it takes to hold a fast launch's landings as well; 1 if the bulk does.
double launch_cells(const AnyReturnMap& map, const LaunchState& launch, std::uint64_t seed);

/// Cuts the same range so that cells are small where they matter. By Galerkin's argument the relative error of the
/// failure rate is the sum over cells of width^3 nu'(x) h'(x) / 12 (nu quasi-stationary density, h relative survival),
/// so widths follow |nu' h'|^(-1/3), taken from a solve on `pilot`, and no cell is wider than four times the narrowest
/// in units of the pilot's cells there. Measured at 64 cells, error of ln(expected steps) with equal cells -> graded:
/// the paper's wheel at 1.5e7 steps 0.043 -> 0.004, the rough-terrain wheel at 8e11 steps 0.035 -> 0.012. The upper
/// edge is lowered to where less than 1e-13 of nu and 1e-9 of the early visits lie above.
/// @param nu, h, visits  quasi-stationary distribution, survival weight and expected visits in the transient after the
/// launch
///        (all phases: a fast launch is still fast some legs later), on the pilot's states
StateSpace graded_space(const StateSpace& pilot, std::span<const double> nu, std::span<const double> h,
                        std::span<const double> visits, std::size_t cells);

/// Returns the largest share of nu in the top cell of any phase, which says how much the upper edge cuts off.
double top_share(const StateSpace& space, std::span<const double> nu);

}  // namespace metastable::markov
