#pragma once
// Steps a planar biped of five links: shanks, thighs and a torso, four motors, feet that are points.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/walkers/five_link_motion.h"

namespace metastable::dynamics {

/// Holds one link: a rigid body along a line from the joint it hangs on, shanks on the knee, the others on the hip.
struct BipedLink {
  double mass = 0;           ///< [kg], > 0
  double joint_to_mass = 0;  ///< distance of the centre of mass [m]
  double inertia = 0;        ///< about the centre of mass [kg m^2], > 0
};

/// Holds all numbers of a biped. The links are those of RABBIT in the set that the five-link demonstration of OptimTraj
/// (M. Kelly) quotes from Westervelt, Grizzle and Koditschek (2003, "Hybrid zero dynamics of planar biped walkers",
/// IEEE Transactions on Automatic Control 48). Other simulators have a torso of 12 kg and smaller inertias.
struct BipedOptions {
  BipedLink shank{3.2, 0.128, 0.93}, thigh{6.8, 0.163, 1.08}, torso{20, 0.2, 2.22};
  double segment_length = 0.4;  ///< of a shank, and of a thigh [m]
  double gravity = 9.81;        ///< [m/s^2]
  BipedPosture posture;
};

/// Walks on point feet that neither slip nor bounce, downhill on positive slopes. Motors see joints, the torso's angle
/// to the vertical and its rate; nobody tells them the slope.
///
/// States are nine numbers just after a strike, in the frame of the slope ahead: half the angle between the legs, the
/// bend of the stance and of the swing knee, the torso's angle [rad] and the five rates [rad/s]. Both feet are on the
/// ground. The walker falls where the swing foot touches the ground before it has passed the stance foot (it falls
/// back, or scuffs), where the foot that is to leave presses on after a strike, where stance leg or torso lies down
/// (1.2 rad from the normal), where a knee bends by less than -0.5 or more than 2.5 rad, or where no strike comes
/// within 3 s. The ground is taken to hold the stance foot whatever the force.
class FiveLinkBiped {
 public:
  static constexpr int dimension = 9;
  /// @throws std::invalid_argument naming the quantity and its range
  explicit FiveLinkBiped(const BipedOptions& options = {});

  const BipedOptions& options() const { return options_; }
  /// Says what the numbers of a state are, with units.
  static std::vector<std::string> names();
  /// Says whether nine numbers are such a state: finite, half angle in (0, 1), the rest as of one who has not fallen.
  static bool inside(std::span<const double> state);

  /// Takes one step of each walker: state i stands at states[9 i], meets a plane of slopes[i] [rad] and leads to next[9
  /// i], or fell[i] is 1. About 20 us, several at once.
  /// @throws std::invalid_argument for sizes that do not match, for a slope that is not finite or a state not inside
  void step(std::span<const double> states, std::span<const double> slopes, std::span<double> next,
            std::span<std::uint8_t> fell) const;
  /// Follows one step to just before the strike; nothing if the walker falls.
  std::optional<BipedMotion> before_strike(std::span<const double> state, double slope) const;
  /// Applies a plastic strike and exchanges the legs: the swing foot stands from now on, the stance foot is free.
  /// Angular momenta about the new foot and about every joint, of what hangs on it, stay what they were.
  BipedMotion strike(const BipedMotion& before) const;

  BipedMotion motion(std::span<const double> state) const;
  std::array<double, 9> state(const BipedMotion& struck) const;
  /// Returns the motion `time` [s] later, whether or not the foot has struck by then, in Runge-Kutta steps of
  /// `longest`.
  BipedMotion moved(const BipedMotion& from, double slope, double time, double longest) const;
  BipedTorques torques(const BipedMotion& motion, double slope) const;
  /// Returns the mechanical energy [J], and what the motors do [W].
  double energy(const BipedMotion& motion, double slope) const;
  double power(const BipedMotion& motion, const BipedTorques& torques) const;
  /// Returns forward position and height of the swing foot from the stance foot [m].
  std::array<double, 2> swing_foot(const BipedMotion& motion) const;

  /// Returns the state of the stable gait that the walker comes to on even ground, by iteration to
  /// 1e-11 from near the gait on 1 deg, the slope being changed in steps of a quarter of a degree.
  /// @throws std::domain_error if it falls or does not come to rest in one within 3000 steps
  std::vector<double> gait(double slope) const;

 private:
  BipedOptions options_;
  BipedEquations equations_;
  std::array<std::array<double, 5>, 5> strike_;  ///< times cosines: rates before a strike to momenta about new joints
};

}  // namespace metastable::dynamics
