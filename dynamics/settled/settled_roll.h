#pragma once
// Rolls a wheel under `settled`: impacts, feet on the ground, flight, from touch to touch.

#include <optional>
#include <vector>

#include "dynamics/settled/foot_strike.h"
#include "dynamics/settled/settled_motion.h"
#include "dynamics/settled/settled_wheel.h"

namespace metastable::dynamics {

struct FootMotion;

/// Rolls a wheel step by step with its complete state carried on: direct simulation of the law. It starts from a touch
/// of a wheel that turns about a standing foot.
class SettledRoll {
 public:
  /// @param motion must outlive the roll; others as in SettledMotion::land
  SettledRoll(const SettledMotion& motion, int leg, double omega_minus, const Contact& landed, const Contact& old);

  /// Goes from the touch of leg() to the next one, which then is leg(): its contact has to be set before the next call.
  /// @throws RunsAway as SettledMotion::land
  Step step();
  /// Follows the landing alone, until its foot has settled. Ends the roll unless it is `settled`.
  Landing land();
  /// Does as SettledMotion::slip_left. Ends the roll.
  std::optional<SlipLeft> slip_left(int strike);

  int leg() const { return leg_; }                ///< that touches, counted on without end
  double position() const;                        ///< of its tip, down the plane from the first touch [m]
  double spin() const { return velocity_.spin; }  ///< [rad/s]
  double time() const { return time_; }           ///< since the start [s]
  double energy() const;                          ///< kinetic and of gravity, from the first touch [J]
  void set_contact(const Contact& contact);       ///< of the foothold that leg() touches
  void set_slope(double slope);                   ///< [rad] from here on, about leg()'s foot

 private:
  enum class Event { strikes, carries, flies, next_touch, settled, rests, given_up };
  struct GroundedFoot;
  struct PieceEnd;
  Event run(bool until_settled);
  Event resolve();
  Event carry(bool until_settled);
  GroundedFoot grounded_foot() const;
  void follow(const GroundedFoot& foot);
  Event strikes(int leg);
  std::optional<Event> begin_to_carry(GroundedFoot& foot);
  std::optional<Event> begin_to_stand(const GroundedFoot& foot, bool until_settled);
  static PieceEnd end_of_piece(const GroundedFoot& foot, const FootMotion& motion, double longest);
  void carry_to(const PieceEnd& end, const FootMotion& motion, GroundedFoot& foot);
  std::optional<Event> after_piece(const PieceEnd& end, GroundedFoot& foot);
  Event fly();
  const Contact& contact_of(int leg) const;
  double angle_of(int leg) const;
  ContactLever lever(int leg) const;
  bool spent() const;
  bool two_feet_rest(int ahead, int back, int& loaded) const;
  double apex(int leg) const;
  bool stands_on(int leg, double angle, double energy) const;
  void note_stand(int leg, double angle, double spin);
  void note_moving_touch();
  double tip_along(int leg) const;
  double kinetic() const;
  void strike_foot();

  const SettledMotion* motion_;
  int leg_;
  std::vector<Contact> contact_;  // of the last foothold of every leg
  double sine_, cosine_;          // of the slope, times gravity
  // Hold the hub, the angle of leg_ past the normal, the time.
  double along_ = 0, height_ = 0, angle_ = 0, time_ = 0;
  PlaneVelocity velocity_;
  // Hold what the last event left: the foot that strikes or carries, another one on the ground.
  int foot_ = 0, other_ = 0;
  bool has_other_ = false;
  int events_ = 0;
  double touch_along_ = 0, touch_time_ = 0;
  double stood_ = -1;  // when the wheel stood on two feet
  Landing landing_;
};

}  // namespace metastable::dynamics
