#pragma once
// Finds which value of a parameter gives the steps, or the survival, that are asked for.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "analysis/sensitivity/parameter.h"
#include "analysis/statistics/estimate.h"
#include "analysis/statistics/level_crossings.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// The quantity that is asked for.
struct Target {
  enum class Of {
    steps,     ///< expected steps before failure from the launch
    survival,  ///< probability of taking more than `steps` steps
    ramp_end   ///< probability of surviving the last collision on the ramp
  };
  Of of = Of::steps;
  double value = 0;  ///< steps > 1, or a probability in (0, 1)
  int steps = 0;     ///< of survival, >= 1
  /// Returns "10000 expected steps", "90 % surviving 1000 steps", "95 % reaching the ramp's end".
  std::string text() const;
  /// @throws std::invalid_argument, one line naming what is out of range
  void validate() const;
};

/// A probability that follows from expected steps known with an interval: its own, as -ln p is in proportion to
/// their inverse. @param p  in [0, 1]
Estimate probability(double p, const Estimate& steps);

/// The quantity of a target at one value of the parameter.
struct Answered {
  Estimate quantity;
  std::string unknown;  ///< why there is none, empty otherwise
};
using AnswerAt = std::function<Answered(double value, int threads)>;

struct SolveOptions {
  std::optional<double> from = {}, to = {};                  ///< of the parameter; nothing: solve_range()
  std::size_t points = 17;                                   ///< looked at first, ends included, 3 .. 1000
  int threads = 0;                                           ///< 0: all cores
  std::function<void(std::size_t looked_at)> progress = {};  ///< may throw to stop
  /// It is called while the table of landings that the points share under `settled` is built; may throw to stop.
  std::function<void(double share)> tabulating = {};
};

/// One value of the parameter looked at, with the target's quantity there.
struct LookedAt {
  double at = 0;
  Answered answer;
};

struct Solution {
  std::string parameter, unit;  ///< its name; "1" for a pure number
  Target target;
  double from = 0, to = 0;             ///< looked at
  std::vector<LookedAt> scanned;       ///< rising
  std::vector<Crossing> found;         ///< values of the parameter, rising, with what the quantity's interval leaves
  std::vector<Metastability> studies;  ///< of a wheel: at each of these values
  /// Returns a line for each value, or that it is out of reach between `from` and `to`, with what there is instead; and
  /// one for what is not known.
  std::vector<std::string> sentences() const;
};

/// Holds a range of a parameter, and whether it is looked at evenly in its logarithm.
struct SolveRange {
  double from = 0, to = 0;
  bool logarithmic = false;
};
/// Returns where solve() looks unless it is told: of a slope a fiftieth of half the angle between legs to all but a
/// fiftieth of it, of eta's mean 0 to 1 (`settled`: 0.95), of mu's 0.05 to 1, of their sds 0.005 to 0.3; of all others
/// around the setting's own value (a factor of two for legs, of four for r_g, of ten for K_r and m_c; of an inertia the
/// least there is to twice that; of tips all there may be).
SolveRange solve_range(const Setting& setting, Parameter parameter);

/// Checks both ends of the range that is looked at.
/// @throws what `check` throws; std::invalid_argument that names the option, --from or --to, where it stated the end
void require_ends(const SolveRange& range, const SolveOptions& options, const std::function<void(double end)>& check);

/// Looks at values of a parameter over a range, and finds all at which the quantity is the target's, as far as the
/// points looked at show them (level_crossings()).
/// @throws std::invalid_argument for a target, range or number of points that is none; std::runtime_error where no
/// value is found and some points have no answer, or a crossing lies among them
Solution solve(const AnswerAt& answer, const Target& target, const SolveRange& range, const SolveOptions& options);

/// Does so for a wheel: studies in brief, of few cells and draws where that leaves no doubt on which side of the target
/// they are, points side by side on the options' threads. The interval of a value is that
/// of the study's own: tolerance 0.01 leaves one per cent of the steps. A wheel of which fewer than 1e-12 survive a
/// step takes one.
/// @throws also std::invalid_argument for a parameter that does not matter() to the setting, naming it, and for ends of
/// the range that it cannot have
Solution solve(const Setting& setting, Parameter parameter, const Target& target, const SolveOptions& options,
               const StudyOptions& study);

}  // namespace metastable::analysis
