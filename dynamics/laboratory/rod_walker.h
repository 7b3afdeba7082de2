#pragma once
// Walks on two legs made of point masses and massless rods: the laboratory of walkers, judge of dynamics/walkers.
//
// Shares no formula with it: positions and velocities are Cartesian, rods and the standing foot hold them by Lagrange's
// multipliers, Runge-Kutta steps of fixed length are projected back onto the constraints, and a strike is the impulse
// that the constraints of the new standing foot ask for.

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace metastable::dynamics {

/// Holds one leg, a rod from foot to hip with a mass at a point of it. Foot and mass may not both be at the hip.
struct RodLeg {
  double mass = 5;            ///< [kg], > 0
  double foot_to_mass = 0.5;  ///< [m], >= 0
  double mass_to_hip = 0.5;   ///< [m], > 0
  double length() const { return foot_to_mass + mass_to_hip; }
};

/// Holds a walker and what acts on it. With no more than legs and hip it is the compass gait of Goswami, Thuilot and
/// Espiau (1998).
struct RodWalkerOptions {
  std::array<RodLeg, 2> legs{};
  double hip_mass = 10;     ///< [kg], > 0
  double gravity = 9.81;    ///< [m/s^2], > 0
  double hip_damping = 0;   ///< [N m s/rad], torque between the legs a rate of turning against each other
  double hip_friction = 0;  ///< [N m], of constant size against that turning; it never holds the legs still
  double impact_loss = 0;   ///< share of the energy of motion after a strike that goes, too, < 1
  double foot_slip = 0;     ///< [m] by which the struck foot slips on, away from the other, as it is loaded

  // No model of a walker in dynamics/walkers has these.
  double foot_radius = 0;     ///< [m], in [0, length of a leg): feet are arcs that roll
  double hip_spring = 0;      ///< [N m/rad], draws the legs together
  double drive_torque = 0;    ///< [N m] of a motor that swings the leg forward, and reaches it with a lag of 0.3 s
  double load_mass = 0;       ///< [kg], hung from the hip on a cord of 0.25 m
  double sway = 0;            ///< [m], amplitude of the ramp along itself, at 0.6 Hz
  double sway_phase_rad = 0;  ///< [rad] of it at time 0
  /// Compliance of the standing leg's knee [rad/(N m)]; below 1e-7 the knee is rigid. It takes foot_radius = 0 and legs
  /// with foot_to_mass > 0. The knee sits at the leg's mass, a spring of stiffness k = 1/compliance and a damper
  /// 2 sqrt(k m) a b/(a + b) hold it straight (critical where hip and foot are held; m, a, b of the leg), and it bends
  /// either way. The shank below it has no mass: the moment that its foot leaves the ground it is straight again.
  double knee_compliance = 0;
};

/// One of the point masses. Axes: x along the slope, downhill; y normal to it, up.
struct RodPoint {
  double mass = 0;        ///< [kg]
  double x = 0, y = 0;    ///< [m]
  double vx = 0, vy = 0;  ///< [m/s]
};

/// A walker just after a strike, as dynamics/walkers writes it: half the angle between the legs [rad], and the rates of
/// their angles to the slope's normal [rad/s], negative where the hip moves downhill.
struct RodStride {
  double half_angle = 0, stance_rate = 0, swing_rate = 0;
};

class RodWalker {
 public:
  /// Puts the walker down with both feet on the ground; the load hangs straight and moves with the hip.
  /// @param stance_leg  0 or 1; @param start  half angle in (0, pi/2)
  RodWalker(const RodWalkerOptions& options, int stance_leg, const RodStride& start);

  /// Walks to just after the next strike on a plane of this slope [rad]; the plane tilts under the walker as it begins.
  /// Returns false if it falls: the stance leg lies down, no strike comes within 30 sqrt(length/gravity), or the legs
  /// are then not apart by an angle below pi, or the standing knee bends by more than pi/2. About 0.2 ms, and with a
  /// knee 0.4 ms sqrt(1e-3 rad/(N m) / compliance) where that is more.
  bool step(double slope);
  /// Walks to just before the strike; false if it falls.
  bool reach_strike(double slope);
  /// Applies the strike, with loss and slip; the legs change their parts.
  void strike();
  /// Walks on for a time [s] without looking for a strike.
  void move(double slope, double time);

  int stance_leg() const { return stance_; }
  /// Returns angles from hip to foot, and the rates that legs have if the standing knee locks now, by what impulse that
  /// takes: a knee that gives bears no impulsive moment, and as it stiffens what it does after a strike becomes this.
  RodStride stride() const;
  double time() const { return time_; }                       ///< since it was put down [s]
  double position() const { return foot(stance_)[0]; }        ///< of the standing foot, downhill [m]
  double swing_foot() const { return foot(1 - stance_)[0]; }  ///< of the other one
  std::vector<RodPoint> points() const;                       ///< hip, leg 0, leg 1 and, if there is one, the load
  double energy(double slope) const;                          ///< of motion, height and springs [J]; the ramp at rest
  /// Returns the bend of the standing leg's knee [rad], thigh less shank, and its rate [rad/s]; 0 where it is rigid.
  std::array<double, 2> knee() const;

 private:
  // Positions x, y of hip, leg 0, leg 1, load; their velocities; the motor's torque on leg 1.
  using State = std::array<double, 17>;
  std::size_t count() const { return options_.load_mass > 0 ? 4 : 3; }
  double mass(std::size_t point) const;
  std::array<double, 2> foot(int leg) const;
  double angle(const State& s, int leg) const;
  double rate(const State& s, int leg) const;
  double turning(const State& s) const { return rate(s, stance_) - rate(s, 1 - stance_); }
  double height(const State& s) const;
  double height_of(const State& s, std::size_t at) const;
  double lead(const State& s) const;
  bool gives() const;
  double longest_piece(double length) const;
  std::array<double, 8> forces(const State& s, double time) const;
  void derivative(const State& s, State& ds, double time) const;
  State moved(double time) const;
  State locked() const;
  double next_piece(double longest, State& end);
  std::optional<double> landing(double passed, const State& end) const;
  void arrive(const State& end, double passed);
  void project();
  void put_down(int stance, const RodStride& stride, double x);
  void hang_load(const std::array<double, 4>& from_hip);

  RodWalkerOptions options_;
  int stance_;
  double time_ = 0, slope_ = 0, anchor_ = 0;
  double against_ = 0;        // sign of the turning that the hip's friction acts against; 0: none
  bool turns_ = false;        // the turning is zero at the end of this piece
  bool just_turned_ = false;  // it is zero now
  State state_{};
};

}  // namespace metastable::dynamics
