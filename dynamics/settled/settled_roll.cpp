#include "dynamics/settled/settled_roll.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>

#include "dynamics/settled/foot_motion.h"
#include "dynamics/settled/hub_flight.h"

namespace metastable::dynamics {
namespace {

// Shares of M g (mean length): kinetic energy that counts as none (1e-3 J for the paper's wheel) and the height
// under the barrier that it cannot climb.
constexpr double still_share = 4.8e-4, deep_share = 4.8e-3;

// The spin whose energy, about a foot, a wheel is followed up to: ten times the fastest launch that a setting may ask
// [rad/s]. A wheel that gains energy in flight passes any bound.
constexpr double most_spin = 1e4;

void require_range(const char* name, double value, bool fine, const char* range) {
  if (!fine) throw std::invalid_argument(fmt::format("settled: {}: {} is outside {}", name, value, range));
}

void check(const Contact& contact) {
  require_range("restitution", contact.restitution, contact.restitution >= 0 && contact.restitution < 1, "[0, 1)");
  require_range("friction", contact.friction, contact.friction >= 0 && std::isfinite(contact.friction), "[0, inf)");
}

}  // namespace

SettledRoll::SettledRoll(const SettledMotion& motion, int leg, double omega_minus, const Contact& landed,
                         const Contact& old)
    : motion_(&motion),
      leg_(leg),
      contact_(static_cast<std::size_t>(motion.wheel().legs()), old),
      sine_(motion.wheel().gravity * std::sin(motion.wheel().slope_rad)),
      cosine_(motion.wheel().gravity * std::cos(motion.wheel().slope_rad)) {
  require_range("omega-", omega_minus, omega_minus > 0 && std::isfinite(omega_minus), "(0, inf) rad/s");
  check(old);
  set_contact(landed);
  const SettledWheel& wheel = motion.wheel();
  angle_ = motion.foot(leg).landing_angle();
  height_ = wheel.length(leg) * std::cos(angle_) + wheel.tip_radius;
  along_ = wheel.length(leg) * std::sin(angle_);
  const double behind = wheel.length(leg - 1) * std::sin(motion.foot(leg - 1).next_angle());
  velocity_ = {omega_minus * height_, -omega_minus * behind, omega_minus};
  foot_ = leg_;
  other_ = leg_ - 1;
  has_other_ = true;
}

const Contact& SettledRoll::contact_of(int leg) const {
  const int legs = motion_->wheel().legs(), index = leg % legs;
  return contact_[static_cast<std::size_t>(index < 0 ? index + legs : index)];
}

void SettledRoll::set_contact(const Contact& contact) {
  check(contact);
  const int legs = motion_->wheel().legs(), index = leg_ % legs;
  contact_[static_cast<std::size_t>(index < 0 ? index + legs : index)] = contact;
}

void SettledRoll::set_slope(double slope) {
  sine_ = motion_->wheel().gravity * std::sin(slope);
  cosine_ = motion_->wheel().gravity * std::cos(slope);
}

double SettledRoll::angle_of(int leg) const { return angle_ - (leg - leg_) * motion_->wheel().leg_angle(); }

ContactLever SettledRoll::lever(int leg) const {
  return {motion_->wheel().length(leg) * std::sin(angle_of(leg)), height_, motion_->wheel().gyration_sq()};
}

double SettledRoll::tip_along(int leg) const { return along_ - motion_->wheel().length(leg) * std::sin(angle_of(leg)); }

double SettledRoll::position() const { return tip_along(leg_); }

// Returns it per unit mass.
double SettledRoll::kinetic() const {
  return (velocity_.along * velocity_.along + velocity_.out * velocity_.out +
          motion_->wheel().gyration_sq() * velocity_.spin * velocity_.spin) /
         2;
}

double SettledRoll::energy() const { return motion_->wheel().mass * (kinetic() - sine_ * along_ + cosine_ * height_); }

// Returns the top of the barrier over the foot of a leg [rad].
double SettledRoll::apex(int leg) const {
  const SettledWheel& wheel = motion_->wheel();
  const double part = wheel.tip_radius / wheel.length(leg) * sine_ / wheel.gravity;
  return -std::atan2(sine_, cosine_) - (part > 0 ? std::asin(part) : 0);
}

// Says that no motion is left, far below the barrier.
bool SettledRoll::spent() const {
  const double scale = motion_->wheel().gravity * motion_->wheel().length(leg_);
  if (kinetic() > still_share * scale) return false;
  const double lean = angle_ + std::atan2(sine_, cosine_);
  return lean < 0 && 1 - std::cos(lean) > deep_share;
}

// Says, of both feet on the ground without spin, whether both are pressed, or which one alone.
bool SettledRoll::two_feet_rest(int ahead, int back, int& loaded) const {
  const double s_ahead = lever(ahead).behind, s_back = lever(back).behind;
  const double mu_ahead = contact_of(ahead).friction, mu_back = contact_of(back).friction;
  double on_back = -(sine_ * height_ + cosine_ * s_ahead) / (s_back - s_ahead);
  double on_ahead = cosine_ - on_back;
  const double slow = motion_->wheel().rest_speed;
  const bool held = std::abs(velocity_.along) <= slow && mu_ahead * on_ahead + mu_back * on_back >= sine_;
  if (!held) {
    // Both slide: friction follows the pressure on each.
    const double way = velocity_.along < -slow ? -1 : 1;
    const double turn_back = s_back + way * mu_back * height_, turn_ahead = s_ahead + way * mu_ahead * height_;
    on_back = -cosine_ * turn_ahead / (turn_back - turn_ahead);
    on_ahead = cosine_ - on_back;
  }
  loaded = on_back > 0 ? back : ahead;
  return on_back > 0 && on_ahead > 0;
}

// Says whether a foot that sticks at this angle with this energy per unit mass keeps to the cone until the next leg
// touches or the wheel turns back.
bool SettledRoll::stands_on(int leg, double angle, double energy) const {
  const StandingFoot& foot = motion_->foot(leg);
  const SettledWheel& wheel = motion_->wheel();
  const Footing on{&wheel, wheel.length(leg), sine_, cosine_, contact_of(leg).friction, 0};
  constexpr int parts = 12;
  for (int i = 0; i <= parts; ++i) {
    const double at = angle + (foot.next_angle() - angle) * i / parts;
    const double square = foot.spin_squared(at, energy);
    if (square < 0) return true;
    const FootForces f = foot_forces(on, at, std::sqrt(square));
    if (std::abs(f.tangential) > on.friction * f.normal + 1e-9) return false;
  }
  return true;
}

void SettledRoll::note_stand(int leg, double angle, double spin) {
  const StandingFoot& foot = motion_->foot(leg);
  const double radius = motion_->wheel().tip_radius;
  landing_.omega_eq_squared = landing_.carried_squared = landing_.settled_squared =
      foot.spin_squared(foot.landing_angle(), foot.energy(angle, spin));
  landing_.displacement = tip_along(leg) - touch_along_ - radius * (angle - foot.landing_angle());
  landing_.duration = time_ - touch_time_;
}

void SettledRoll::note_moving_touch() {
  const StandingFoot& foot = motion_->foot(leg_);
  const SettledWheel& wheel = motion_->wheel();
  const double about_new =
      wheel.gyration_sq() * velocity_.spin + height_ * velocity_.along - lever(foot_).behind * velocity_.out;
  const double stood = foot.next_angle(), lands = motion_->foot(foot_).landing_angle();
  const double height = wheel.length(leg_) * std::cos(stood) + wheel.tip_radius;
  const double spin = about_new / (wheel.gyration_sq() + height * height +
                                   wheel.length(leg_) * std::sin(stood) * wheel.length(foot_) * std::sin(lands));
  landing_.carried_squared = foot.landing_squared(spin > 0 ? spin * spin : 0);
  landing_.omega_eq_squared = foot.landing_squared(velocity_.spin * std::abs(velocity_.spin));
  landing_.slips_late = landing_.end == LandingEnd::settled;
  if (landing_.slips_late) return;
  landing_.end = LandingEnd::unsettled;
  landing_.duration = time_ - touch_time_;
  landing_.displacement = tip_along(foot_) - touch_along_ - foot.pace();
}

Landing SettledRoll::land() {
  const Event event = run(true);
  if (event == Event::rests) landing_.end = LandingEnd::rest;
  return landing_;
}

std::optional<SlipLeft> SettledRoll::slip_left(int strike) {
  landing_ = {};
  events_ = 0;
  for (Event event = Event::strikes; event == Event::strikes && foot_ == leg_;) {
    if (landing_.strikes + 1 == strike) return dynamics::slip_left(lever(leg_), contact_of(leg_), velocity_);
    event = resolve();
    if (event == Event::flies) event = fly();
  }
  return std::nullopt;
}

Step SettledRoll::step() {
  const double began = time_;
  const Event event = run(false);
  Step step;
  step.duration = time_ - began;
  if (event == Event::rests) landing_.end = LandingEnd::rest;
  if (event == Event::next_touch) {
    step.touched = true;
    step.omega_minus = velocity_.spin;
    step.between_feet = tip_along(foot_) - touch_along_;
  }
  step.landing = landing_;
  if (step.touched) {
    // The next leg is the one that lands now; a wheel that is thrown up may pass some over.
    angle_ -= (foot_ - leg_) * motion_->wheel().leg_angle();
    leg_ = foot_;
  }
  return step;
}

SettledRoll::Event SettledRoll::run(bool until_settled) {
  const double length = motion_->wheel().length(leg_);
  if (kinetic() > (length * length + motion_->wheel().gyration_sq()) * most_spin * most_spin / 2)
    throw RunsAway(
        fmt::format("law settled: the wheel runs away: it flies down the slope of {:.4g} deg faster and faster, and "
                    "turns at {:.3g} rad/s",
                    motion_->wheel().slope_rad * 180 / std::numbers::pi, velocity_.spin));
  landing_ = {};
  touch_along_ = tip_along(leg_);
  touch_time_ = time_;
  events_ = 0;
  stood_ = -1;
  const double touch_angle = angle_;
  Event event = Event::strikes;
  while (++events_ < motion_->wheel().max_events) {
    if (event == Event::strikes)
      event = resolve();
    else if (event == Event::carries)
      event = carry(until_settled);
    else if (event == Event::flies)
      event = fly();
    else
      break;
  }
  landing_.slid = tip_along(leg_) - touch_along_ - motion_->wheel().tip_radius * (angle_ - touch_angle);
  if (events_ < motion_->wheel().max_events) return event;
  landing_.end = LandingEnd::given_up;
  landing_.duration = time_ - touch_time_;
  return Event::given_up;
}

// Strikes the foot; one that then hardly lifts stays down.
void SettledRoll::strike_foot() {
  const double before = kinetic();
  const ContactLever at = lever(foot_);
  const Contact& contact = contact_of(foot_);
  double rubbed = 0;
  PlaneVelocity after = strike(at, contact, velocity_, &rubbed);
  if (at.lift(after) < motion_->wheel().rest_speed) after = strike(at, {0, contact.friction}, velocity_, &rubbed);
  velocity_ = after;
  ++landing_.strikes;
  if (landing_.strikes == 1) landing_.omega_plus = velocity_.spin;
  landing_.friction_loss += motion_->wheel().mass * rubbed;
  landing_.impact_loss += motion_->wheel().mass * (before - kinetic() - rubbed);
}

// Goes through impacts at one moment: the foot that strikes, the other on the ground if driven into it, and so on.
SettledRoll::Event SettledRoll::resolve() {
  const double slow = motion_->wheel().rest_speed;
  for (;;) {
    if (++events_ >= motion_->wheel().max_events) return Event::given_up;
    strike_foot();
    if (!has_other_ || lever(other_).lift(velocity_) >= -slow) break;
    std::swap(foot_, other_);
  }
  if (spent()) return Event::rests;
  // A foot that is slower than rest_speed stays down; what it still moves out of the plane is taken off.
  const auto down = [&](int leg) { return lever(leg).lift(velocity_) < slow; };
  const auto settle = [&](int leg) {
    const ContactLever at = lever(leg);
    const double push = -at.lift(velocity_) / (1 + at.behind * at.behind / at.gyration_sq);
    velocity_.out += push;
    velocity_.spin += push * at.behind / at.gyration_sq;
  };
  const bool first = down(foot_), second = has_other_ && down(other_);
  if (first && second) {
    velocity_.out = velocity_.spin = 0;
    int loaded = foot_;
    if (two_feet_rest(std::max(foot_, other_), std::min(foot_, other_), loaded) || time_ == stood_) return Event::rests;
    stood_ = time_;
    foot_ = loaded;
    return Event::carries;
  }
  if (!first && !second) return Event::flies;
  if (second) std::swap(foot_, other_);
  settle(foot_);
  return Event::carries;
}

// One foot on the ground, with what bounds its motion.
struct SettledRoll::GroundedFoot {
  Footing on;
  FootState state;
  double landing_angle, next_angle;  // where the leg before and the next one touch [rad]
  double top;                        // of the barrier [rad]
  double jams;                       // the stiffness at which slip jams [m^2]

  // Says of a foot without slip whether it lifts; else `on.way` says whether it sticks or which way it is driven.
  bool lifts() {
    on.way = 0;
    const FootForces f = foot_forces(on, state.angle, state.spin);
    if (f.normal <= 0) return true;
    if (std::abs(f.tangential) <= on.friction * f.normal) return false;
    on.way = f.tangential > 0 ? -1 : 1;
    return foot_forces(on, state.angle, state.spin).stiffness <= jams;
  }
};

// The end of one piece of a foot's motion: the earliest of several values that fall below 0.
struct SettledRoll::PieceEnd {
  enum Kind { turns, backward, forward, stops, lifts_off, jammed, next_leg, leg_before, none };
  double when;  // [s] from the beginning of the piece
  Kind kind = none;

  void look(Kind of, const TimeSeries& value, double sign, double least) {
    TimeSeries above = value;
    for (double& term : above.term) term *= sign;
    above.term[0] -= least;
    const double at = above.falls_below_zero(when);
    if (at <= when) when = at, kind = of;
  }
};

// Finds what ends a piece of the motion first. @param longest [s]
SettledRoll::PieceEnd SettledRoll::end_of_piece(const GroundedFoot& foot, const FootMotion& motion, double longest) {
  const Footing& on = foot.on;
  PieceEnd end{longest};
  end.look(PieceEnd::next_leg, motion.angle, -1, -foot.next_angle);
  end.look(PieceEnd::leg_before, motion.angle, 1, foot.landing_angle);
  if (on.way != 0) {
    end.look(PieceEnd::stops, motion.slip, on.way, 0);
    end.look(PieceEnd::lifts_off, motion.normal, 1, 0);
    end.look(PieceEnd::jammed, motion.stiffness, 1, foot.jams);
    return end;
  }
  if (foot.state.spin > 0)
    end.look(PieceEnd::turns, motion.spin, 1, 0);
  else
    end.look(PieceEnd::turns, motion.angle, 1, foot.top);
  for (const int way : {1, -1}) {  // the cone of friction
    TimeSeries room;
    for (std::size_t k = 0; k < room.term.size(); ++k)
      room.term[k] = on.friction * motion.normal.term[k] + way * motion.tangential.term[k];
    end.look(way == 1 ? PieceEnd::forward : PieceEnd::backward, room, 1, 0);
  }
  return end;
}

SettledRoll::GroundedFoot SettledRoll::grounded_foot() const {
  const SettledWheel& wheel = motion_->wheel();
  const StandingFoot& foot = motion_->foot(foot_);
  constexpr double no_slip = 1e-13;  // [m/s]: rounding of a foot that sticks
  GroundedFoot grounded{{&wheel, wheel.length(foot_), sine_, cosine_, contact_of(foot_).friction, 0},
                        {angle_of(foot_), velocity_.spin, lever(foot_).slip(velocity_), tip_along(foot_)},
                        foot.landing_angle(),
                        foot.next_angle(),
                        apex(foot_),
                        1e-6 * wheel.gyration_sq()};
  if (std::abs(grounded.state.slip) < no_slip) grounded.state.slip = 0;
  return grounded;
}

// Moves the hub to where its foot has it.
void SettledRoll::follow(const GroundedFoot& foot) {
  const SettledWheel& wheel = motion_->wheel();
  angle_ = foot.state.angle + (foot_ - leg_) * wheel.leg_angle();
  const double ahead = foot.on.length * std::sin(foot.state.angle);
  height_ = foot.on.length * std::cos(foot.state.angle) + wheel.tip_radius;
  along_ = foot.state.along + ahead;
  velocity_ = {foot.state.slip + foot.state.spin * height_, -foot.state.spin * ahead, foot.state.spin};
}

// Hands over to the foot of a leg, which strikes; the foot that carried may stay on the ground.
SettledRoll::Event SettledRoll::strikes(int leg) {
  has_other_ = leg != foot_;
  other_ = foot_;
  foot_ = leg;
  return Event::strikes;
}

// Says which way the foot slips, or what happens to one that cannot begin to carry.
std::optional<SettledRoll::Event> SettledRoll::begin_to_carry(GroundedFoot& foot) {
  Footing& on = foot.on;
  const FootState& state = foot.state;
  if (state.slip == 0) return foot.lifts() ? std::optional(Event::flies) : std::nullopt;
  on.way = state.slip > 0 ? 1 : -1;
  const FootForces f = foot_forces(on, state.angle, state.spin);
  const bool pressed = cosine_ - on.length * std::cos(state.angle) * state.spin * state.spin > 0;
  if (f.stiffness <= foot.jams) return pressed ? strikes(foot_) : Event::flies;
  return f.normal <= 0 ? std::optional(Event::flies) : std::nullopt;
}

// Says that the landed foot has begun to stand, and whether that ends the landing.
std::optional<SettledRoll::Event> SettledRoll::begin_to_stand(const GroundedFoot& foot, bool until_settled) {
  const StandingFoot& standing = motion_->foot(foot_);
  note_stand(foot_, foot.state.angle, foot.state.spin);
  landing_.end = LandingEnd::settled;
  const double energy = standing.energy(foot.state.angle, foot.state.spin);
  if (!until_settled || motion_->wheel().drags() || !stands_on(foot_, foot.state.angle, energy)) return std::nullopt;
  return foot.state.angle < foot.top && energy <= standing.potential(foot.top) ? Event::rests : Event::settled;
}

// Goes on to the end of a piece of the motion.
void SettledRoll::carry_to(const PieceEnd& end, const FootMotion& motion, GroundedFoot& foot) {
  const double energy_before = energy();
  foot.state = motion.at(end.when);
  time_ += end.when;
  if (end.kind == PieceEnd::turns && foot.state.angle <= foot.top) foot.state.spin = std::min(foot.state.spin, 0.0);
  if (end.kind == PieceEnd::stops || end.kind == PieceEnd::forward || end.kind == PieceEnd::backward)
    foot.state.slip = 0;
  follow(foot);
  if (foot.on.way != 0) landing_.friction_loss += energy_before - energy();
}

// Says what follows a piece of the motion; nothing if the foot carries on.
std::optional<SettledRoll::Event> SettledRoll::after_piece(const PieceEnd& end, GroundedFoot& foot) {
  switch (end.kind) {
    case PieceEnd::none:
    case PieceEnd::turns:
      return std::nullopt;
    case PieceEnd::forward:
      foot.on.way = 1;
      return std::nullopt;
    case PieceEnd::backward:
      foot.on.way = -1;
      return std::nullopt;
    case PieceEnd::stops:
      if (end.when > 0) return foot.lifts() ? std::optional(Event::flies) : std::nullopt;
      foot.on.way = 0;  // at the cone's edge, and back inside
      return std::nullopt;
    case PieceEnd::lifts_off:
      return Event::flies;
    case PieceEnd::jammed:
      return strikes(foot_);
    case PieceEnd::next_leg:
      if (foot_ != leg_) return strikes(foot_ + 1);
      strikes(leg_ + 1);
      if (foot.on.way != 0) note_moving_touch();
      return Event::next_touch;
    case PieceEnd::leg_before:
      return strikes(foot_ - 1);
  }
  return std::nullopt;
}

// Carries one foot on the ground, until it lifts, jams, settles, rests, or another one touches.
SettledRoll::Event SettledRoll::carry(bool until_settled) {
  GroundedFoot foot = grounded_foot();
  has_other_ = false;
  bool stands = false;  // the landed foot, noted when it began to
  follow(foot);
  if (const std::optional<Event> event = begin_to_carry(foot)) return *event;
  for (;;) {
    if (++events_ >= motion_->wheel().max_events) return Event::given_up;
    if (foot.on.way == 0) {
      if (foot.state.spin <= 0 && foot.state.angle <= foot.top) return Event::rests;
      if (foot_ == leg_ && !stands) {
        stands = true;
        if (const std::optional<Event> event = begin_to_stand(foot, until_settled)) return *event;
      }
    } else {
      stands = false;
      if (spent()) return Event::rests;
    }
    const FootMotion motion = foot.on.from(foot.state);
    const double longest = std::min(motion.horizon, 0.3 / std::max(1.0, std::abs(foot.state.spin)));
    if (longest < 1e-9) return strikes(foot_);  // the pressure grows without bounds: slip jams
    const PieceEnd end = end_of_piece(foot, motion, longest);
    carry_to(end, motion, foot);
    if (const std::optional<Event> event = after_piece(end, foot)) return *event;
  }
}

// Flies with no foot on the ground: a parabola at constant spin (drag: constant acceleration over a millisecond), until
// a tip touches.
SettledRoll::Event SettledRoll::fly() {
  const SettledWheel& wheel = motion_->wheel();
  const std::array<int, 2> feet{foot_, other_};
  std::span<const int> lifting(feet.data(), has_other_ ? 2 : 1);
  for (;; lifting = {}) {
    const Flight flight = next_flight(wheel, {leg_, angle_, height_, velocity_.out, velocity_.spin, cosine_}, lifting);
    if (flight.lost || ++events_ >= wheel.max_events) {
      events_ = wheel.max_events;
      return Event::given_up;
    }
    const double lasts = flight.lasts, spin = velocity_.spin;
    along_ += lasts * (velocity_.along + sine_ * lasts / 2);
    height_ += lasts * (velocity_.out - cosine_ * lasts / 2);
    angle_ += lasts * (spin + flight.slowing * lasts / 2);
    time_ += lasts;
    velocity_ = {velocity_.along + sine_ * lasts, velocity_.out - cosine_ * lasts, spin + flight.slowing * lasts};
    if (!flight.touches) continue;
    foot_ = *flight.touches;
    has_other_ = false;
    if (foot_ <= leg_) return Event::strikes;
    note_moving_touch();
    return Event::next_touch;
  }
}

}  // namespace metastable::dynamics
