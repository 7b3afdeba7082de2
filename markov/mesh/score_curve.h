#pragma once
// Reads where a state leads as a smooth curve in the one score of its noise: a few steps of the map, interpolated.

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "markov/mesh/batch_map.h"
#include "markov/mesh/node_lattice.h"

namespace metastable::markov {

/// Holds where one state leads under every value of one score: places that were stepped, ascending, and between
/// neighbours that both survive the polynomial through the nearest six, in coordinates of the lattice that it lands on.
/// A gap that the polynomial through its neighbours does not foretell is halved, and so is one at whose ends different
/// things happen.
class ScoreCurve {
 public:
  enum class Fate : std::uint8_t { lands, fails, leaves };
  struct Landing {
    Fate fate = Fate::lands;
    NodeLattice::Point at{};
  };
  struct Shares {
    double fails = 0, leaves = 0;  ///< probabilities; the rest lands
  };

  /// @param spacing  > 0: between places where the curve is smooth
  /// @param reach    > 0: scores beyond, of either sign, are not looked at; they fail where the last place does, or
  ///                 else leave
  /// @param beyond   the state's action less that of the cheapest failure: the rarer that makes what happens, the less
  ///                 closely it is looked at where failures begin, and where the curve bends or jumps
  ScoreCurve(double spacing, double reach, double beyond = -std::numeric_limits<double>::infinity());

  /// Returns the scores to be stepped next, ascending; none when the curve is known.
  const std::vector<double>& asked() const { return asked_; }
  /// Returns scores that may be asked for after these: at first the middles of all gaps, which are sure to be, and
  /// later those of gaps that would be halved `halvings` times more.
  std::vector<double> may_ask(int halvings) const;
  /// Takes the landings of the scores asked for.
  /// @param unit  of the lattice's coordinates, in stationary sds
  void answer(std::span<const Landing> landings, double unit);

  /// Returns what happens at a score between two places at which the same happens; nothing where different things do,
  /// in the narrow gaps in which failures begin, and beyond the places.
  std::optional<Fate> fate(double score) const;

  /// Adds to `parts` what each corner of the cells around all landings gets, in proportion to nearness on every axis
  /// and times `weight`; corners may come again. The shares returned are of this curve alone.
  Shares share(const NodeLattice& lattice, int phase, double weight,
               std::vector<std::pair<std::uint64_t, double>>& parts) const;

 private:
  struct Place {
    double score = 0;
    Landing landing;
    bool open = false;  ///< the gap from here to the next place is to be halved
    bool torn = false;  ///< the curve jumps in it
  };
  bool joined(std::size_t left) const;
  double narrowest_gap(double score) const;
  std::span<const Place> stencil(std::size_t left, std::size_t right) const;
  void halve(Place& left, Place& middle, const Place& right, std::size_t at, double unit) const;

  double spacing_, beyond_;
  std::vector<Place> place_;
  std::vector<double> asked_;
};

/// Holds straight lines through the space of a step's scores, along the first, each from one state.
struct ScoreLines {
  std::vector<double> states;  ///< in rows of the map's dimension
  std::vector<double> others;  ///< the scores but the first, in rows of map.scores - 1
  std::vector<double> reach;   ///< of the first score
  std::vector<double> beyond;  ///< as ScoreCurve's; empty: all are looked at closely
};

/// Follows the curves along lines of one phase together: the map is asked for many steps at once, and a dear one for
/// those that the next rounds may need as well.
/// @param unit  as ScoreCurve::answer's
/// @throws as checked_step does
std::vector<ScoreCurve> follow_curves(const BatchMap& map, const NodeLattice& lattice, int phase,
                                      const ScoreLines& lines, double spacing, double unit);

}  // namespace metastable::markov
