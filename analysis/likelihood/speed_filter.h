#pragma once
// The speed of one trial, followed through its noisy measurements.

#include <optional>

#include "analysis/experiment/experiment.h"
#include "analysis/likelihood/score_tilt.h"
#include "dynamics/wheel/extended_wheel.h"

namespace metastable::analysis {

/// Log density below which no event falls: values outside a model's reach stay finite.
inline constexpr double least_log_density = -60;

/// Normal score of a probability, held inside +-8.
double score_of_probability(double below);

/// The wheel's speed given all measurements so far: N(mean, variance) just before each collision, just after it where
/// that is measured. Gaussian: exact while the sensor noise is small beside the spread of a collision. One object a
/// trial.
class SpeedFilter {
 public:
  /// What one measurement says: its log density, its normal score, and the speed that a unit of score is [rad/s].
  struct Out {
    double log_density = 0, score = 0, unit = 1;
  };

  /// Both references must outlive the filter.
  /// @param noise  stated sd of reported speeds [rad/s]
  /// @param slack  sd of the least speed that a next collision can have, where the legs are not known [rad/s]
  SpeedFilter(const dynamics::Extension& extension, const ScoreTilt& tilt, double noise, double slack = 0);

  /// The first speed, against the stated launch.
  Out launch(const Condition& condition, double reported);
  /// The first speed (or one after a gap), with nothing to hold it against.
  void start(double reported);
  /// omega+ is seen: the collision.
  Out collision(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double reported);
  /// Then the next omega-: the stance.
  Out stance(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double reported);
  /// Only the next omega- is seen: collision and stance together.
  Out step(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double reported);
  /// An omega+ below `bound` (or none, of a foot that jams) after the last measured speed, or not that.
  Out rest(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double bound, bool rested);
  /// The chance of an omega+ below `bound` after the last measured speed.
  double chance_below(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double bound) const;

 private:
  double conditional(double below) const;
  Out transition(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double plus, double rate,
                 double blur);
  void update(const Out& out, double seen);

  const dynamics::Extension& extension_;
  const ScoreTilt& tilt_;
  double noise2_;  // variance of a reported speed
  double slack2_;
  bool blurred_;
  double mean_ = 0, variance_ = 0;
  std::optional<double> previous_;  // collision's score
};

}  // namespace metastable::analysis
