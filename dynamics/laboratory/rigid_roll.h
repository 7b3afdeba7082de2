#pragma once
// Rolls a rigid wheel under forces and impulses: the second laboratory, judge of the law `settled`.
//
// Shares no formula with settled/: the mass centre and the turn are integrated by Runge-Kutta steps of fixed length,
// contact forces come from a linear system of the tips' accelerations, and an impact is followed in time as a stiff
// spring that gives back eta^2 of the energy it took (Walton and Braun 1986), with Coulomb friction beside it. Slip
// stop, stick, reversal and jam are not told apart there: they follow. Tips of finite stiffness press a spring and a
// damper while all the wheel goes on moving.

#include <array>
#include <vector>

#include "dynamics/laboratory/rolling_motion.h"
#include "dynamics/wheel/contact_noise.h"

namespace metastable::dynamics {

class RigidRoll {
 public:
  /// Starts where `leg` touches, its tip at 0 m, as the wheel turns about the standing foot behind it.
  /// @param body, surface must outlive the roll; the fluid and `flight` of the body are left out
  /// @param inertia about the mass centre [kg m^2], > 0; @param speed > 0 [rad/s]
  /// @param stiffness of the tips along the normal [N/m]; 0: rigid
  RigidRoll(const RollingBody& body, const RampSurface& surface, double inertia, int leg, double speed,
            double stiffness = 0);

  int leg() const { return leg_ % body_.legs(); }    ///< that touches
  double position() const;                           ///< of its tip, down the plane [m]
  double spin() const { return state_[5]; }          ///< [rad/s]
  double time() const { return time_; }              ///< since the start [s]
  double after_impact() const { return after_; }     ///< spin after the first impact of the last landing [rad/s]
  bool on_ground() const { return !feet_.empty(); }  ///< the foot behind has not lifted
  /// Lands leg() and follows hops, slides and stance until the next leg touches, which then is leg().
  /// @param contact of the foothold: eta in [0, 0.95], mu >= 0; the first call gives it to the foot behind, too
  /// @param moments if given: the motion is added, time and turn from the start
  /// @returns false if the wheel comes to rest
  bool step(const Contact& contact, std::vector<Moment>* moments = nullptr);

 private:
  using State = std::array<double, 6>;  // mass centre x, z; turn of leg 0 past the normal; their rates
  struct Foothold {
    Point at, along, up;
    Contact contact;
    double damping = 0;  // of a soft tip, ratio of the critical one
  };
  struct Foot {  // on the ground
    int leg = 0;
    int way = 0;  // of its slip: 1 down the ramp, -1 up; 0: sticks
  };
  struct Carried {  // what the ground does to the wheel, and what becomes of that
    State rate{};
    std::array<double, 2> normal{}, tangential{};
    double stiffness = 1;  // of a sliding foot against being pressed; below 0 it jams
  };
  enum class Event { none, touches, lifts, slips, stops, jams, turns_back };

  Point arm(const State& s, int leg) const;  // from the mass centre to a tip
  Point tip_at(const State& s, int leg) const;
  Point tip_velocity(const State& s, int leg) const;
  double gap(const State& s, int leg) const;
  double slip(const State& s, int leg) const;
  double lift(const State& s, int leg) const;
  Foothold& foothold(int leg) { return footholds_[static_cast<std::size_t>(leg) % footholds_.size()]; }
  const Foothold& foothold(int leg) const { return footholds_[static_cast<std::size_t>(leg) % footholds_.size()]; }
  bool down(int leg) const;
  double drag(double spin) const;
  double turn_of(const State& s, int leg, const Point& force) const;
  Carried carried(const State& s) const;
  State moved(const State& from, double time) const;
  double step_length() const;
  double value(const State& s, Event event, int foot) const;
  Event run(int& foot);
  void note();
  void push(int leg, double normal, double tangential);
  void strike(int leg);
  void press(int leg);
  void resolve(std::vector<int> closed);
  void choose_modes();
  bool spent() const;

  const RollingBody& body_;
  const RampSurface& surface_;
  double inertia_, stiffness_, start_turn_, time_ = 0, after_ = 0;
  std::vector<Moment>* moments_ = nullptr;
  int leg_;  // counted on
  bool first_ = true;
  State state_{};
  std::vector<Foot> feet_;
  std::array<Foothold, 4> footholds_{};
};

}  // namespace metastable::dynamics
