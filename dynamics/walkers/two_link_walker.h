#pragma once
// Steps passive walkers of two stiff legs joined at a hip, on a plane, from just after a strike to just after the next.

#include <cstdint>
#include <optional>
#include <span>

#include "dynamics/walkers/leg_motion.h"

namespace metastable::dynamics {

/// Holds the compass gait's masses and lengths (Goswami, Thuilot, Espiau 1998). A leg is a + b long.
struct CompassOptions {
  double leg_mass = 5;        ///< m [kg], > 0, a point on each leg
  double hip_mass = 10;       ///< m_H [kg], >= 0
  double foot_to_mass = 0.5;  ///< a [m], > 0
  double mass_to_hip = 0.5;   ///< b [m], > 0
  double gravity = 9.81;      ///< g [m/s^2], > 0
};

/// Holds both legs just after a strike. The stance leg stands `half_angle_rad` behind the slope's normal, the swing leg
/// as far before it; rates are those of the angles to the normal, negative when the hip moves downhill.
struct Stride {
  double half_angle_rad = 0;  ///< half the angle between the legs [rad]
  double stance_rate = 0;     ///< [rad/s]
  double swing_rate = 0;      ///< [rad/s]
};

/// Holds the slope [rad] of the ground that the next strike is on, and of the ground on which both feet stand: both
/// angles turn by the difference. Equal, if the ground is one plane that only tilts.
struct Ground {
  double slope_rad = 0;
  double last_slope_rad = 0;
};

/// Walks on two equal legs with point masses, feet that neither slip nor bounce. The swing foot may pass through the
/// ground beside the stance foot (knees would prevent that); it strikes when it comes down before the stance foot.
///
/// A slope turns gravity: the state stays in the slope's frame (of the ground ahead). The motion is that of
/// LegEquations with a hip that turns freely; energy is kept to 1e-12 between strikes.
class TwoLinkWalker {
 public:
  /// Returns the simplest walker (Garcia, Chatterjee, Ruina, Coleman 1998): all mass at the hip, feet of vanishing
  /// mass. Lengths in legs, times in sqrt(l/g). The swing leg's rate after a strike follows from the stance leg's: its
  /// states have two numbers (half angle, stance rate).
  static TwoLinkWalker simplest();
  /// Returns the compass gait: three numbers (half angle, stance rate, swing rate).
  /// @throws std::invalid_argument naming the quantity and its range
  static TwoLinkWalker compass(const CompassOptions& options = {});

  /// Says how many numbers a state has, 2 or 3: the first ones of Stride.
  int dimension() const { return dimension_; }
  /// Completes a state (its first dimension() numbers) to a stride.
  Stride stride(std::span<const double> state) const;

  /// Takes one step of each of n walkers: state i stands at states[i * dimension()], meets grounds[i] and leads to
  /// next[i * dimension()], or fell[i] is 1 (and next is left alone): the stance leg lies down, or no strike comes
  /// within 30 sqrt(l/g). About 1.2 us a step. The bits of a walker's step do not depend on the others.
  /// @throws std::invalid_argument for sizes that do not match; for a state that is not finite, or lies outside
  ///         0 < half angle < pi/2: it is named
  void step(std::span<const double> states, std::span<const Ground> grounds, std::span<double> next,
            std::span<std::uint8_t> fell) const;

  /// Follows one step to just before the strike; nothing if the walker falls. Throws as step() does.
  std::optional<LegMotion> before_strike(const Stride& start, const Ground& ground) const;
  /// Returns the motion `time` >= 0 [s] after the last strike, whether or not a foot has struck by then.
  LegMotion at(const Stride& start, const Ground& ground, double time) const;
  /// Applies the strike: both feet on the ground, the angular momenta of the walker about the struck foot and of the
  /// new swing leg about the hip stay what they were. `before` has stance_angle = -swing_angle.
  Stride strike(const LegMotion& before) const;
  /// Returns the mechanical energy [J] (of the simplest walker: per weight of the hip and length of a leg).
  double energy(const LegMotion& motion, double slope) const;

 private:
  TwoLinkWalker(const CompassOptions& masses, const LegEquations& equations, int dimension);

  CompassOptions masses_;
  LegEquations equations_;
  int dimension_;
  LegCourse course_;
};

}  // namespace metastable::dynamics
