#pragma once
// Makes a wheel's measured trials runs of collisions whose legs, positions, times and sensor noise are all known or
// completed, and the list of their transitions.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/fitting/transition_model.h"
#include "analysis/wheel_model/memory_of_scores.h"
#include "dynamics/extended_wheel/extended_wheel.h"
#include "dynamics/settled/landing_shares.h"

namespace metastable::analysis {

/// Holds one collision and what a step from it depends on.
struct RunCollision {
  dynamics::StepContext context;
  double before = 0;            ///< reported omega- [rad/s]
  std::optional<double> after;  ///< reported omega+ [rad/s]
  std::optional<double> slide;  ///< of the foot, from its place and the next one's [m]; `settled` only
  double law_error = 0;         ///< added to `before` where the law foretells it [rad/s]; `settled` only
  bool counted = true;          ///< false: the law does not hold for it, and it is left out
  bool stands = true;           ///< false: nor for what follows its first impact, which is left out
};

/// One trial is a run of collisions.
struct WheelRun {
  std::size_t condition = 0;  ///< index
  std::vector<RunCollision> collisions;
  std::optional<dynamics::Outcome> outcome;
};

/// Holds all trials, in the order they were run, and what is known of wheel and sensors.
struct WheelRuns {
  dynamics::Wheel wheel;  ///< as stated; legs of mean length where it is not known which leg landed
  dynamics::Law law = dynamics::Law::published;
  dynamics::ContactSpread contact;  ///< nominal
  std::vector<Condition> conditions;
  std::vector<std::shared_ptr<const dynamics::LandingShares>> landings;  ///< by condition; `settled` only
  std::vector<WheelRun> runs;
  double noise = 0;                ///< sd of reported speeds [rad/s], stated, taken from the stances or assumed
  double noise_seen = 0;           ///< by how much stances scatter [rad/s]; 0: too few to say
  double slack = 0;                ///< sd of a stance's outcome because its leg is not known [rad/s]
  double law_error = 0;            ///< sd of what the law does not know of a next omega- [rad/s]; `settled` only
  double slide_error = 1e-3;       ///< sd of what the law does not know of a slide [m]; `settled` only
  MemoryOfScores memory;           ///< of the speeds that tell of landings; under other laws that of the contacts
  bool noise_stated = true;        ///< noise is the experiment's own
  bool legs_known = true;          ///< by the column, or found
  bool speeds_after = false;       ///< omega+ is there
  bool slides_seen = false;        ///< the feet's places are there; `settled` only
  bool stands_by_plus = false;     ///< whether a foot stands is judged by its omega+; `settled` only
  std::vector<bool> springing;     ///< by leg: its feet are judged so where the others' are not; empty: no leg's
  bool exact_stances = false;      ///< they repeat the model to rounding, and say nothing
  bool times_judge = true;         ///< false: times are so much more exact than speeds that they tell the speeds' noise
  std::vector<std::string> notes;  ///< what was assumed, a sentence each
};

/// Returns the wheel with this contact and these effects, on the ramp of each condition.
/// @throws std::invalid_argument as dynamics::ExtendedWheel
std::vector<dynamics::ExtendedWheel> wheels_on_ramps(const WheelRuns& measured, const dynamics::ContactSpread& contact,
                                                     const dynamics::Extension& extension);

/// Returns the next omega- that follows from the speeds around a collision [rad/s]; under `settled` as if the foot
/// stuck. It returns nothing where no restitution gives these speeds. @param m  with an omega+
std::optional<double> expected_next(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context,
                                    const RunCollision& m);

/// Says how good `settled` is as a model of rigid-body engines: by so much a next omega- is off in a way that goes with
/// leg, slope and speed [rad/s]. It does not average out, so n touches are given an error of sqrt(n) times it, after
/// which they tell no mean more exactly. (The engine of the paper's wheel with steps of 0.1 ms: medians of legs by
/// 0.0004.)
inline constexpr double settled_precision = 0.0005;
/// Says the same of a slide [m]: torques and slopes that the law does not hold move a foot's hops by up to twice that.
inline constexpr double settled_slide_precision = 0.0002;

/// Landings under `settled` are tabulated up to this speed before a collision [rad/s].
inline constexpr double fastest_tabulated = 15;

/// Tabulates the landings of every condition anew, under `settled`; under other laws there are none.
void tabulate_landings(WheelRuns& measured);

/// Reads an experiment. A missing leg is found from the stances where omega_plus is there, else legs of mean length are
/// taken; missing positions and times follow from the geometry. Where digits are most of the noise a normal error is
/// added to the reported speeds, as the notes say.
/// @throws std::invalid_argument for a coast-down
WheelRuns wheel_runs(const Experiment& experiment);

/// Returns the bound [rad/s] for which an omega+ below it is that of a foot that jammed, seen through the noise.
double jam_bound(const WheelRuns& measured);

/// The last collision's omega+ becomes 0 where it is below jam_bound and the wheel is not known to have gone on.
void mark_jam(const WheelRuns& measured, WheelRun& run);

/// Lists their transitions, the one list that likelihoods go by: per trial launch (where one is stated), then collision
/// and stance, or step, and rest or survival where the outcome is known. Stances that are exact are left out.
std::vector<Event> wheel_events(const WheelRuns& measured);

}  // namespace metastable::analysis
