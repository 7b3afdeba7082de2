#pragma once
// A filter follows the speed of one trial through its noisy measurements.

#include <array>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/wheel_model/memory_of_scores.h"
#include "analysis/wheel_model/score_tilt.h"
#include "dynamics/extended_wheel/extended_wheel.h"

namespace metastable::analysis {

/// The log density below which no event falls: values outside a model's reach stay finite.
inline constexpr double least_log_density = -60;

/// Returns the normal score of a probability, held inside +-8.
double score_of_probability(double below);

/// Holds contacts that stand for all of a distribution, each with its weight by Gauss and Hermite's rule in both
/// scores.
struct ContactNodes {
  struct Node {
    dynamics::Contact contact;
    double weight;
  };
  std::vector<Node> all;
  std::array<dynamics::Contact, 4> aside;  ///< restitution an sd below and above its median, then friction so
  double narrower = 0;                     ///< the smaller of the two sds
};

/// @param contact  of sds > 0
ContactNodes contact_nodes(const dynamics::ContactSpread& contact);

/// Holds the wheel's speed given all measurements so far as N(mean, variance): just before each collision, just after
/// it where that is measured. A collision that spreads speeds widely beside the sensor noise is summed over that noise,
/// one that spreads them less is summed over its contacts, and between the two sums one gives way to the other. Each
/// trial needs a filter of its own.
class SpeedFilter {
 public:
  /// Holds what one measurement says: its log density, its normal score, and the speed that a unit of score is [rad/s].
  struct Out {
    double log_density = 0, score = 0, unit = 1;
  };

  /// Holds what was seen of a next touch.
  struct Touch {
    double speed = 0;                  ///< reported omega- [rad/s]
    double law_error = 0;              ///< to be added to it, of a known draw [rad/s]; `settled` only
    std::optional<double> slide = {};  ///< of the foot that landed before [m]; `settled` only
  };

  /// Both references must outlive the filter.
  /// @param noise  stated sd of reported speeds [rad/s]
  /// @param slack  sd of the least speed that a next collision can have, where the legs are not known [rad/s]
  /// @param law_error  sd of the law errors that reported speeds are given [rad/s]; `settled` only
  /// @param slide_error  sd of what the law does not know of a slide [m]; `settled` only
  /// @param memory  of scores that the extension's memory of contacts is
  /// @param contacts  of the wheel; nothing: collisions are taken to spread speeds widely beside the noise
  SpeedFilter(const dynamics::Extension& extension, const ScoreTilt& tilt, double noise, double slack = 0,
              double law_error = 0, double slide_error = 1e-3, const MemoryOfScores& memory = {},
              std::shared_ptr<const ContactNodes> contacts = {});

  /// The first speed is seen: it is held against the stated launch.
  Out launch(const Condition& condition, double reported);
  /// The first speed is seen (or one after a gap), and nothing can be held against it.
  void start(double reported);
  /// omega+ is seen: this is the collision.
  Out collision(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double reported);
  /// Then the next omega- is seen: this is the stance.
  Out stance(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, const Touch& touch);
  /// Only the next omega- is seen: this is collision and stance together.
  Out step(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, const Touch& touch);
  /// After the last measured speed omega+ was below `bound` (or there was none, the foot jammed), or it was not. Under
  /// `settled` the barrier stands for the law's own threshold, and a bound below it is that of a foot that jammed.
  Out rest(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double bound, bool rested);
  /// Says how likely omega+ is to be below `bound` after the last measured speed.
  double chance_below(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double bound) const;

 private:
  std::pair<double, double> foreseen() const;
  void remember(double score);
  double conditional(double below) const;
  Out certain_transition(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double plus,
                         double rate, double blur) const;
  Out transition(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double plus, double rate,
                 double blur);
  Out weighed(double density, double below, double rate);
  // Holds what a speed after a collision that spreads speeds little says.
  struct Narrow {
    double share = 0;     // that this sum has beside the one over the noise, in [0, 1]
    double variance = 0;  // of omega+ by its contacts alone
    double density = 0, below = 0;
    double mean = 0, left = 0;  // of the belief of omega+ after it was seen: mean and variance
  };
  Narrow narrowness(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double blur) const;
  template <class Visit>
  void visit_contacts(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, Visit visit) const;
  void sum_over_contacts(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, double plus,
                         double rate, Narrow& narrow) const;
  Out settled_step(const dynamics::ExtendedWheel& wheel, const dynamics::StepContext& context, const Touch& touch);
  void update(const dynamics::ExtendedWheel& wheel, const Out& out, double seen, double plus, double rate);

  const dynamics::Extension& extension_;
  const ScoreTilt& tilt_;
  double noise2_;  // variance of a reported speed
  double slack2_, law2_, slide_error_;
  double memory_;  // of contacts
  double told_;    // share of it that a score tells
  bool blurred_;
  std::shared_ptr<const ContactNodes> contacts_;
  Narrow narrow_;     // of the last transition
  double shown_ = 1;  // share of the last score's variance that its contact has beside the noise
  double mean_ = 0, variance_ = 0;
  double recalled_ = 0, doubt_ = 1;  // mean and variance of what contacts remember, after the last score
  // Tells, under `settled`, the speed before the collision whose omega+ the mean now is; nothing: it is that speed's.
  struct Before {
    double mean, variance;
  };
  std::optional<Before> before_;
};

}  // namespace metastable::analysis
