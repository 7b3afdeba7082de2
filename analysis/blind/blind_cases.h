#pragma once
// Makes blind cases, experiments from the laboratory whose truth is sealed until the diagnosis has answered.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/blind/effect_power.h"
#include "analysis/walker_model/walk_folder.h"

namespace metastable::analysis {

/// Says what a case is about.
enum class BlindKind {
  none,      ///< no gap but what recalibration removes; nuisances varied
  effect,    ///< one effect of the catalogue
  pair,      ///< two
  outside,   ///< an effect that no catalogue holds
  left_out,  ///< one effect, and a catalogue without it
  mixed,     ///< one effect or two of the catalogue, and one that no catalogue holds
  many,      ///< three effects of the catalogue
};
std::string_view blind_kind_name(BlindKind kind);
/// @throws std::invalid_argument for an unknown name
BlindKind blind_kind(std::string_view name);

/// Says how many cases of each kind a run has, none below 0.
struct BlindSize {
  int per_effect_and_strength = 6;  ///< each effect at 1x, 2x and 4x
  int none = 300;
  int pairs = 50;
  int outside = 50;
  int left_out_per_effect = 3;
  /// Laws that the cases of every kind obey in turn: published, or settled (by the laboratory's rigid body). Effects
  /// that one law lacks (can_be_had()) stay with the other; without that among the laws they have no case.
  std::vector<dynamics::Law> laws = {dynamics::Law::published};
  int mixed = 0;
  int many = 0;
  bool walkers = false;  ///< cases of the compass gait (laws then have no meaning) instead of the wheel
};
/// Says whether it is the effect that a recalibration removes: other contacts, another mean slope.
bool is_recalibration(std::string_view effect);
/// Says whether the laboratory has cases of an effect, of the catalogue or outside, under a law. Under settled it has
/// none of what acts on the loss of a collision, of slip_reversal, sloshing_fluid, and of inertia, which is
/// recalibrated; under the other laws none of soft_contact.
bool can_be_had(std::string_view effect, dynamics::Law law);

/// Holds what is true of a case, sealed until it is answered.
struct BlindTruth {
  int number = 0;  ///< from 1
  BlindKind kind = BlindKind::none;
  dynamics::Law law = dynamics::Law::published;  ///< that the wheel obeys and the model states
  std::vector<dynamics::Effect> effects;
  std::optional<dynamics::OutsideEffect> outside;
  int strength = 0;  ///< 1, 2, 4; by size alone where an outside effect cannot be weighed; 0: not defined (none)
  double power = 0;  ///< expected 2 Delta log likelihood, true contact known
  double left = 0;   ///< realised, after recalibration; 0 until complete_truth()
  /// The power left of each of several effects, or of the one of a mixture, after a recalibration that has the others
  /// in the model. It follows from the rest and the case and is not sealed; empty until complete_each().
  std::vector<double> left_by_effect = {};
  /// The power left of the outside effect of a mixture, likewise, where it can be weighed. A walker's is sealed: it
  /// takes the walks as they are without the effect.
  std::optional<double> left_of_outside = {};
  /// The likelihood that the model as given lacks in the mean over experiments, and each effect's part of it. It
  /// follows from the case and is not sealed. It is empty until complete_each(), and where something acts from outside
  /// or is recalibrated.
  std::optional<GapAsGiven> gap_as_given = {};
  /// Collisions at risk and rests of the same experiment, run again and again in the laboratory: their ratio is the
  /// machine's expected steps. 0 where it was not run.
  double collisions_counted = 0, rests_counted = 0;
  bool nominal_is_true = true;
  Spread restitution, friction;  ///< true
  double skewness = 0;
  double noise = 0;  ///< of reported speeds [rad/s]
  std::uint64_t seed = 0;
  std::vector<std::string> left_out;  ///< of the catalogue
  /// The compass gait's true slope and its sd from step to step [deg]; nothing for a wheel. Its cases have no law, no
  /// restitution, friction and skewness; `noise` is that of the half angle [rad].
  std::optional<Spread> slope_deg = {};
};

/// Holds a case as it is written: public files, and the truth.
struct BlindCase {
  BlindTruth truth;
  LaboratoryFiles files;                ///< of a wheel
  std::optional<WalkFiles> walks = {};  ///< of a compass gait
  std::vector<std::string> catalogue;   ///< ids the diagnosis may use; empty: all
};

/// Gives the expected 2 Delta log likelihood of effects in a design (expected_power(), or a stand-in in tests).
using Power = std::function<double(const PowerDesign&, const std::vector<dynamics::Effect>&)>;

/// Says what each case of a run is, without its data: kinds, effects and strengths in an order drawn from the seed.
struct BlindPlan {
  BlindKind kind;
  std::vector<std::string> effects;  ///< ids of the catalogue
  int strength = 0;
  dynamics::Law law = dynamics::Law::published;
  std::string outside = {};  ///< id of what no catalogue holds; empty: nothing
  bool walker = false;       ///< of the compass gait
};
/// @throws std::invalid_argument naming a count below 0, or a law that is neither published nor settled
std::vector<BlindPlan> blind_plan(const BlindSize& size, std::uint64_t seed);

/// Draws case `number` (from 1) of a plan. Sizes are found by a search on `power` for 16, 64, 256 (each of several
/// effects for 64, and what no catalogue holds beside them for half of that to twice as much); an effect that cannot be
/// made so strong within its range keeps its largest size, and truth.power tells. An outside effect that cannot be
/// weighed (outside_power.h) has its strength by its size alone. truth.left is not worked out: a case that is graded
/// takes complete_truth() too. A walker's case has a power of its own.
BlindCase blind_case(const BlindPlan& plan, int number, std::uint64_t seed, const Power& power);

/// Sets truth.left from the case's own files; a case without an effect that can be weighed keeps 0. A fit takes about a
/// second.
void complete_truth(BlindCase& made);
/// Sets truth.left_by_effect of a case of several effects and of a mixture, by a fit or two each, truth.left_of_outside
/// of a wheel's mixture, and truth.gap_as_given of one effect or several, by eight fits; other kinds stay as they are.
/// @param experiment, walks  the case as it was written
void complete_each(BlindTruth& truth, const Experiment& experiment);
void complete_each(BlindTruth& truth, const Walks& walks);
/// Does so by what the effect is worth beside the others.
/// @param left_beside  takes the others  @param gap  measures the gap as given
void complete_each(BlindTruth& truth,
                   const std::function<double(const std::vector<dynamics::Effect>& others)>& left_beside,
                   const std::function<GapAsGiven()>& gap);

}  // namespace metastable::analysis
