#pragma once
// Follows the law `settled`: landings, steps and trials of a planar rigid wheel, event by event.

#include <optional>
#include <stdexcept>
#include <vector>

#include "dynamics/settled/foot_strike.h"
#include "dynamics/settled/settled_wheel.h"
#include "dynamics/wheel/contact_noise.h"

namespace metastable::dynamics {

enum class LandingEnd {
  settled,    ///< the landed foot stands and will until the next leg touches
  rest,       ///< turned back on a standing foot, or stands on two
  unsettled,  ///< the next leg touches while the landed foot hops or slides: an assumption of the chain is broken
  given_up    ///< more events than allowed (two feet that chatter at high eta)
};

/// Says that a wheel gains speed from landing to landing without end: on a steep slope it is thrown up, falls further
/// down the longer it flies, and lands with more energy than it took off with.
class RunsAway : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Says what one landing does.
struct Landing {
  LandingEnd end = LandingEnd::given_up;
  /// The omega^2 that a standing foot would have at the landing angle to reach the same spin at the next touch
  /// [rad^2/s^2]; below the barrier's at rest, 0 where the wheel rests on two feet or was given up.
  double omega_eq_squared = 0;
  /// The same to bring the same angular momentum about the next foot: what the next landing depends on. Differs from
  /// omega_eq_squared only if the foot moves at the next touch: unsettled, or settled and sliding or lifting once more
  /// (`slips_late`: backward, at low mu). The next landing from a standing foot with this then is that from the
  /// moving one to 2e-5 rad/s (median; omega_eq_squared: 1e-3).
  double carried_squared = 0;
  bool slips_late = false;
  /// The omega_eq^2 when the foot began to stand, before any late slip; 0 if it never did [rad^2/s^2]. It is continuous
  /// across the friction below which the wheel rests, where it is the barrier's.
  double settled_squared = 0;
  double displacement =
      0;                  ///< of the foot from where it touched to where it stands, down the plane, without rolling [m]
  double omega_plus = 0;  ///< spin after the first impact [rad/s]
  double duration = 0;    ///< from touch to where the landing ended [s]
  int strikes = 0;        ///< impacts, the first one included
  // Hold until the landing, or its step, has ended; a bearing's drag on a sliding foot counts as friction.
  double friction_loss = 0;  ///< work of friction, in impacts and while feet slide [J]
  double impact_loss = 0;    ///< what impacts take besides [J]
  double slid = 0;           ///< of the landed foot down the plane, without rolling [m]
};

/// A landing and the way to the next touch.
struct Step {
  Landing landing;
  bool touched = false;     ///< the next leg touches; else rest, or given up as `landing.end` has it
  double omega_minus = 0;   ///< spin at the next touch [rad/s]
  double between_feet = 0;  ///< from touch to touch, down the plane [m]
  double duration = 0;      ///< from touch to touch, or to rest [s]
};

/// Holds a wheel with all that does not change from landing to landing. Const members may be called from any thread.
class SettledMotion {
 public:
  /// @throws std::invalid_argument as SettledWheel::validate()
  explicit SettledMotion(SettledWheel wheel);

  const SettledWheel& wheel() const { return wheel_; }
  /// @param leg any whole number, counted around the wheel
  const StandingFoot& foot(int leg) const;

  /// Follows one landing from a standing foot, until the landed foot has settled. 10 to 60 us at the default
  /// rest_speed.
  /// @param leg that lands; @param omega_minus [rad/s], > 0
  /// @param landed, old contact of the landing foot and of those behind it: eta in [0, 1), mu >= 0
  /// @throws std::invalid_argument for a speed or contact out of range, naming it; RunsAway for a wheel that lands with
  /// more kinetic energy than at 10,000 rad/s about a foot
  Landing land(int leg, double omega_minus, const Contact& landed, const Contact& old) const;
  Landing land(int leg, double omega_minus, const Contact& contact) const {
    return land(leg, omega_minus, contact, contact);
  }
  /// Returns what the landed foot has left of its slip in the impact with the number `strike`; nothing if fewer follow.
  /// The landing is not smooth in mu where either part of it becomes 0.
  std::optional<SlipLeft> slip_left(int leg, double omega_minus, const Contact& contact, int strike) const;
  /// Follows a landing as land() does and goes on to the next touch, the stance integrated in time.
  Step step(int leg, double omega_minus, const Contact& landed, const Contact& old) const;
  Step step(int leg, double omega_minus, const Contact& contact) const {
    return step(leg, omega_minus, contact, contact);
  }

 private:
  SettledWheel wheel_;
  std::vector<StandingFoot> foot_;
};

}  // namespace metastable::dynamics
