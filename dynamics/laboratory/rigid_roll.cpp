#include "dynamics/laboratory/rigid_roll.h"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>

namespace metastable::dynamics {
namespace {

constexpr double longest_step = 2e-3;  // [s]: of order 4, 1e-9 rad/s a stance
constexpr double stays_down = 1e-5;    // [m/s]: a foot bounces no more
constexpr double no_slip = 1e-9;       // [m/s]
constexpr double closed_gap = 1e-9;    // [m]
constexpr double spent_energy = 1e-3;  // [J] of motion; before the barrier such a wheel rests
constexpr double before_top = 0.02;    // [rad]
constexpr int spring_steps = 500;      // of a quarter period
constexpr int soft_steps = 200;        // of a soft tip's period over 2 pi
constexpr int soft_rest = 8;           // such times, in which a foot leaves or has come to rest
// A soft tip that touches slower than this many times the speed that its weight gives it in such a time would not leave
// the ground again; it is struck as a rigid one.
constexpr double soft_above = 5;
constexpr double least_bounce = 0.01;  // of soft tips
constexpr int most_events = 1000;      // of a landing; two feet that chatter longer rest
constexpr int most_steps = 200000;

double dot_of(const Point& a, const Point& b) { return a.x * b.x + a.z * b.z; }
int sign_of(double value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

// Returns the share of its speed that a mass keeps which strikes a spring with a damper of that ratio of the critical
// one, followed in time with the period taken as 2 pi until the force would pull.
double given_back(double damping) {
  constexpr double step = 1.0 / soft_steps;
  double depth = 0, speed = 1;
  for (int n = 0; n < 10 * soft_steps; ++n) {
    depth += speed * step / 2;
    // The damper acts on the mean of the speeds before and after.
    const double next = (speed * (1 - damping * step) - depth * step) / (1 + damping * step);
    if (next >= speed) break;
    speed = next;
    depth += speed * step / 2;
  }
  return -speed;
}

double damping_of(double restitution) {
  double low = 0, high = 20;
  for (int i = 0; i < 40; ++i) {
    const double damping = (low + high) / 2;
    (given_back(damping) > restitution ? low : high) = damping;
  }
  return low;
}

}  // namespace

RigidRoll::RigidRoll(const RollingBody& body, const RampSurface& surface, double inertia, int leg, double speed,
                     double stiffness)
    : body_(body),
      surface_(surface),
      inertia_(inertia),
      stiffness_(stiffness),
      start_turn_(0),
      leg_(leg + body.legs()) {
  const Pose pose = landing_pose(body, surface, leg, 0, speed);
  const Point centre = centre_of_mass(body, pose);
  const int behind = leg_ - 1;
  start_turn_ = pose.angle_rad + behind * body.leg_angle();
  state_ = {centre.x, centre.z, start_turn_, 0, 0, speed};
  const Point from_foot{centre.x - pose.foot.x, centre.z - pose.foot.z};
  state_[3] = speed * from_foot.z;
  state_[4] = -speed * from_foot.x;
  feet_ = {{behind, 0}};
}

Point RigidRoll::arm(const State& s, int leg) const {
  const auto toward_at = [](double angle, double length) {
    return Point{-length * std::sin(angle), -length * std::cos(angle)};
  };
  Point r = toward_at(s[2] - leg * body_.leg_angle(), body_.leg_length[static_cast<std::size_t>(leg % body_.legs())]);
  if (body_.offset != 0) {
    const Point off = toward_at(s[2] - body_.offset_angle_rad, body_.offset);
    r.x -= off.x;
    r.z -= off.z;
  }
  return r;
}

Point RigidRoll::tip_at(const State& s, int leg) const {
  const Point r = arm(s, leg);
  return {s[0] + r.x, s[1] + r.z};
}

Point RigidRoll::tip_velocity(const State& s, int leg) const {
  const Point r = arm(s, leg);
  return {s[3] + s[5] * r.z, s[4] - s[5] * r.x};
}

double RigidRoll::position() const { return tip_at(state_, leg_).x; }

// A foot that has stood keeps the tangent of its foothold; the next one meets the surface as it is.
double RigidRoll::gap(const State& s, int leg) const {
  const Point p = tip_at(s, leg);
  if (leg > leg_) return p.z - surface_.height(p.x);
  const Foothold& f = foothold(leg);
  return dot_of({p.x - f.at.x, p.z - f.at.z}, f.up);
}

double RigidRoll::slip(const State& s, int leg) const { return dot_of(tip_velocity(s, leg), foothold(leg).along); }
double RigidRoll::lift(const State& s, int leg) const { return dot_of(tip_velocity(s, leg), foothold(leg).up); }

bool RigidRoll::down(int leg) const {
  return std::any_of(feet_.begin(), feet_.end(), [&](const Foot& foot) { return foot.leg == leg; });
}

double RigidRoll::drag(double spin) const {
  return body_.constant_drag * sign_of(spin) + body_.linear_drag * spin + body_.quadratic_drag * spin * std::abs(spin);
}

// The torque of a force at a tip, down the ramp counting positive, over the force.
double RigidRoll::turn_of(const State& s, int leg, const Point& force) const {
  const Point r = arm(s, leg);
  return force.x * r.z - force.z * r.x;
}

RigidRoll::Carried RigidRoll::carried(const State& s) const {
  Carried c;
  struct Row {  // a direction in which a tip must not accelerate, and the force that sees to it
    int leg;
    Point still, force;
    double turn_still, turn_force;
  };
  std::array<Row, 4> rows{};
  std::size_t count = 0;
  const auto add = [&](int leg, const Point& still, const Point& force) {
    rows[count++] = {leg, still, force, turn_of(s, leg, still), turn_of(s, leg, force)};
  };
  for (const Foot& foot : feet_) {
    const Foothold& f = foothold(foot.leg);
    const double drawn = foot.way * f.contact.friction;
    add(foot.leg, f.up, {f.up.x - drawn * f.along.x, f.up.z - drawn * f.along.z});
    if (foot.way == 0 && feet_.size() == 1) add(foot.leg, f.along, f.along);
  }
  const double ax = body_.gravity * std::sin(body_.slope_rad), az = -body_.gravity * std::cos(body_.slope_rad);
  const double slowing = -drag(s[5]) / inertia_;
  const auto entry = [&](std::size_t i, std::size_t j) {
    return dot_of(rows[i].still, rows[j].force) / body_.mass + rows[i].turn_still * rows[j].turn_force / inertia_;
  };
  const auto free = [&](std::size_t i) {
    const Point r = arm(s, rows[i].leg);
    return dot_of(rows[i].still, {ax - s[5] * s[5] * r.x, az - s[5] * s[5] * r.z}) + slowing * rows[i].turn_still;
  };
  std::array<double, 2> force{};
  if (count == 1) {
    c.stiffness = entry(0, 0);
    force[0] = -free(0) / c.stiffness;
  } else if (count == 2) {
    const double a = entry(0, 0), b = entry(0, 1), d = entry(1, 0), e = entry(1, 1), p = -free(0), q = -free(1);
    force = {(p * e - b * q) / (a * e - b * d), (a * q - d * p) / (a * e - b * d)};
  }
  c.rate = {s[3], s[4], s[5], ax, az, slowing};
  for (std::size_t i = 0; i < count; ++i) {
    c.rate[3] += force[i] * rows[i].force.x / body_.mass;
    c.rate[4] += force[i] * rows[i].force.z / body_.mass;
    c.rate[5] += force[i] * rows[i].turn_force / inertia_;
  }
  if (feet_.size() == 1)
    c.normal[0] = force[0], c.tangential[0] = force[1];
  else
    c.normal = force;
  return c;
}

RigidRoll::State RigidRoll::moved(const State& from, double time) const {
  const auto ahead = [&](const State& rate, double by) {
    State s = from;
    for (std::size_t i = 0; i < s.size(); ++i) s[i] += by * rate[i];
    return s;
  };
  const State k1 = carried(from).rate, k2 = carried(ahead(k1, time / 2)).rate, k3 = carried(ahead(k2, time / 2)).rate,
              k4 = carried(ahead(k3, time)).rate;
  State s = from;
  for (std::size_t i = 0; i < s.size(); ++i) s[i] += time / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
  return s;
}

// The first step is a quarter of the shortest hop, so that none is missed; later ones grow.
double RigidRoll::step_length() const {
  double length = longest_step;
  const State rate = carried(state_).rate;
  for (const int leg : {leg_ - 1, leg_}) {
    if (down(leg) || gap(state_, leg) > closed_gap) continue;
    const Point r = arm(state_, leg), up = foothold(leg).up;
    const Point pull{rate[3] - state_[5] * state_[5] * r.x, rate[4] - state_[5] * state_[5] * r.z};
    const double falls = -(dot_of(pull, up) + rate[5] * turn_of(state_, leg, up)), rises = lift(state_, leg);
    if (falls > 0 && rises > 0) length = std::min(length, rises / (2 * falls));
  }
  return std::max(length, 1e-9);
}

// An event is where its value falls to 0.
double RigidRoll::value(const State& s, Event event, int foot) const {
  if (event == Event::touches) return gap(s, foot);
  if (event == Event::turns_back) return s[5];
  const auto k = static_cast<std::size_t>(foot);
  if (event == Event::stops) return feet_[k].way * slip(s, feet_[k].leg);
  const Carried c = carried(s);
  if (event == Event::jams) return c.stiffness;
  if (event == Event::lifts) return c.normal[k];
  return foothold(feet_[k].leg).contact.friction * c.normal[k] - std::abs(c.tangential[k]);
}

void RigidRoll::note() {
  if (moments_) moments_->push_back({time_, state_[2] - start_turn_, state_[5]});
}

// Goes to the next event. `foot`: the leg that touches, or the place in feet_ of the foot that it is about.
RigidRoll::Event RigidRoll::run(int& foot) {
  std::vector<std::pair<Event, int>> watched;
  for (const int leg : {leg_ - 1, leg_, leg_ + 1})
    if (!down(leg)) watched.emplace_back(Event::touches, leg);
  for (int k = 0; k < static_cast<int>(feet_.size()); ++k) {
    const bool sticks = feet_[static_cast<std::size_t>(k)].way == 0;
    watched.emplace_back(Event::lifts, k);
    if (!sticks) watched.emplace_back(Event::stops, k);
    if (feet_.size() > 1) continue;
    if (sticks && state_[5] <= 0) return Event::turns_back;
    watched.emplace_back(sticks ? Event::slips : Event::jams, k);
    if (sticks) watched.emplace_back(Event::turns_back, k);
  }
  double length = step_length();
  std::vector<double> before(watched.size());
  for (std::size_t w = 0; w < watched.size(); ++w) before[w] = value(state_, watched[w].first, watched[w].second);
  for (int n = 0; n < most_steps; ++n, length = std::min(2 * length, longest_step)) {
    const State from = state_, to = moved(from, length);
    double first = length;
    Event event = Event::none;
    for (std::size_t w = 0; w < watched.size(); ++w) {
      const auto [kind, which] = watched[w];
      const double after = value(to, kind, which);
      double at = length + 1;
      if (before[w] > 0 && after <= 0) {
        std::uintmax_t most = 60;
        const auto [low, high] = boost::math::tools::toms748_solve(
            [&](double part) { return value(moved(from, part), kind, which); }, 0.0, length, before[w], after,
            boost::math::tools::eps_tolerance<double>(44), most);
        at = high;
      } else if ((kind == Event::touches && before[w] <= 0 && after < -closed_gap) ||
                 (kind == Event::stops && before[w] <= 0 && after < -no_slip)) {
        at = 0;  // it went the wrong way from the start
      }
      if (at < first || (at == first && event == Event::none && at < length)) first = at, event = kind, foot = which;
      before[w] = after;
    }
    state_ = event == Event::none ? to : moved(from, first);
    time_ += event == Event::none ? length : first;
    note();
    if (event != Event::none) return event;
  }
  return Event::turns_back;  // it balances on one leg
}

void RigidRoll::push(int leg, double normal, double tangential) {
  const Foothold& f = foothold(leg);
  const Point p{normal * f.up.x + tangential * f.along.x, normal * f.up.z + tangential * f.along.z};
  state_[3] += p.x / body_.mass;
  state_[4] += p.z / body_.mass;
  state_[5] += turn_of(state_, leg, p) / inertia_;
}

// The foot presses a spring so stiff that nothing else acts meanwhile; its period is taken as 2 pi. Friction holds the
// foot if it can, and else opposes its slip.
void RigidRoll::strike(int leg) {
  const Foothold& f = foothold(leg);
  const double normal_turn = turn_of(state_, leg, f.up), along_turn = turn_of(state_, leg, f.along);
  const double nn = 1 / body_.mass + normal_turn * normal_turn / inertia_,
               tt = 1 / body_.mass + along_turn * along_turn / inertia_, nt = normal_turn * along_turn / inertia_;
  const double eta = f.contact.restitution, mu = f.contact.friction;
  double out = lift(state_, leg), along = slip(state_, leg);
  if (stiffness_ > 0 && -out > soft_above * body_.gravity / std::sqrt(nn * stiffness_)) {
    press(leg);
    return;
  }
  out = std::min(out, -1e-6 * std::abs(along));  // a foot that jams is not moving in yet
  double depth = 0, deepest = 0, normal = 0, tangential = 0;
  bool gives_back = false;
  const double pressing = 1.5707963267948966 / spring_steps;
  double step = pressing;
  for (int n = 0; n < 1000 * spring_steps; ++n) {
    depth -= out * step / 2;
    // Loading has stiffness 1 / nn; unloading is stiffer by 1 / eta^2 and ends at a depth that stays.
    const double force = gives_back ? (depth - deepest * (1 - eta * eta)) / (eta * eta * nn) : depth / nn;
    if (force <= 0) break;
    const double p = force * step, hold = -(along + nt * p) / tt, q = std::clamp(hold, -mu * p, mu * p);
    const double faster = nn * p + nt * q;
    out += faster;
    along += nt * p + tt * q;
    normal += p;
    tangential += q;
    depth -= out * step / 2;
    if (!gives_back && out >= 0) {
      deepest = depth + out * out * step / (2 * faster);
      if (eta < 1e-3) {  // ends where it is deepest
        normal -= p * out / faster;
        tangential -= q * out / faster;
        break;
      }
      gives_back = true;
      step = pressing * eta;
    }
  }
  push(leg, normal, tangential);
}

// The foot presses the spring and damper of its tip, and the wheel moves on under its weight, until the foot is out of
// the ground or has come to stay there.
void RigidRoll::press(int leg) {
  Foothold& f = foothold(leg);
  const double mu = f.contact.friction, ground = std::min(0.0, gap(state_, leg));
  double mass = 0, step = 0, damper = 0;
  const auto drift = [&](double time) {
    for (std::size_t i = 0; i < 3; ++i) state_[i] += time * state_[i + 3];
    time_ += time;
  };
  for (int n = 0; n < soft_rest * soft_steps; ++n) {
    drift(step / 2);
    const double normal_turn = turn_of(state_, leg, f.up), along_turn = turn_of(state_, leg, f.along);
    const double nn = 1 / body_.mass + normal_turn * normal_turn / inertia_,
                 tt = 1 / body_.mass + along_turn * along_turn / inertia_, nt = normal_turn * along_turn / inertia_;
    if (n == 0) {  // the mass that the tip meets is the one it strikes first
      mass = 1 / std::max(nn / 100, nn + nt * std::clamp(-nt / tt, -mu, mu));
      const double unit = std::sqrt(mass / stiffness_);
      step = unit / soft_steps;
      damper = 2 * f.damping * stiffness_ * unit;
      drift(step / 2);
    }
    const double depth = ground - gap(state_, leg);
    if (depth <= 0 && n > 0) break;
    // The damper acts on the mean of the speeds before and after.
    const double force = (stiffness_ * depth - damper * lift(state_, leg)) / (1 + damper * step / (2 * mass));
    const double p = std::max(0.0, force) * step;
    state_[3] += body_.gravity * std::sin(body_.slope_rad) * step;
    state_[4] -= body_.gravity * std::cos(body_.slope_rad) * step;
    state_[5] -= drag(state_[5]) / inertia_ * step;
    push(leg, p, std::clamp(-(slip(state_, leg) + nt * p) / tt, -mu * p, mu * p));
    drift(step / 2);
  }
  if (gap(state_, leg) <= 0) f.at = tip_at(state_, leg);
  note();
}

// Strikes closed feet in turn until none approaches; those that do not leave are down.
void RigidRoll::resolve(std::vector<int> closed) {
  for (int n = 0; n < most_events; ++n) {
    const auto falls =
        std::find_if(closed.begin(), closed.end(), [&](int leg) { return lift(state_, leg) < -stays_down; });
    if (falls == closed.end()) break;
    strike(*falls);
  }
  std::vector<Foot> stay;
  for (const int leg : closed)
    if (lift(state_, leg) <= stays_down) {
      const double s = slip(state_, leg);
      stay.push_back({leg, std::abs(s) <= no_slip ? 0 : sign_of(s)});
    }
  feet_ = stay;
  choose_modes();
}

// Takes the last bounce out of a foot that is down; lets it go where the ground would have to pull, slide where
// friction does not hold it.
void RigidRoll::choose_modes() {
  if (feet_.size() == 1) {
    Foot& foot = feet_.front();
    const Foothold& f = foothold(foot.leg);
    const double a = turn_of(state_, foot.leg, f.up), b = turn_of(state_, foot.leg, f.along);
    const double nn = 1 / body_.mass + a * a / inertia_, tt = 1 / body_.mass + b * b / inertia_, nt = a * b / inertia_;
    const double out = lift(state_, foot.leg), along = slip(state_, foot.leg);
    if (foot.way == 0)
      push(foot.leg, (nt * along - tt * out) / (nn * tt - nt * nt), (nt * out - nn * along) / (nn * tt - nt * nt));
    else
      push(foot.leg, -out / nn, 0);
  }
  for (int n = 0; n < 4 && !feet_.empty(); ++n) {
    const Carried c = carried(state_);
    if (feet_.size() == 1 && feet_[0].way != 0 && c.stiffness <= 0) {
      const int leg = feet_[0].leg;
      strike(leg);
      feet_.clear();
      if (lift(state_, leg) <= stays_down)
        feet_ = {{leg, sign_of(std::abs(slip(state_, leg)) > no_slip ? slip(state_, leg) : 0)}};
      continue;
    }
    const auto weakest = static_cast<std::size_t>(feet_.size() == 2 && c.normal[1] < c.normal[0]);
    if (c.normal[weakest] < 0) {
      feet_.erase(feet_.begin() + static_cast<std::ptrdiff_t>(weakest));
      continue;
    }
    if (feet_.size() == 1 && feet_[0].way == 0 &&
        std::abs(c.tangential[0]) > foothold(feet_[0].leg).contact.friction * c.normal[0])
      feet_[0].way = -sign_of(c.tangential[0]);
    return;
  }
}

// Says whether the wheel has nothing left to do but settle: on two feet, or short of the barrier without motion.
bool RigidRoll::spent() const {
  if (feet_.size() == 2 && feet_[0].way == 0 && feet_[1].way == 0) return true;
  const double motion =
      (body_.mass * (state_[3] * state_[3] + state_[4] * state_[4]) + inertia_ * state_[5] * state_[5]) / 2;
  return motion < spent_energy && state_[2] - leg_ * body_.leg_angle() < -body_.slope_rad - before_top;
}

bool RigidRoll::step(const Contact& contact, std::vector<Moment>* moments) {
  moments_ = moments;
  const double damping = stiffness_ > 0 ? damping_of(std::max(least_bounce, contact.restitution)) : 0;
  const auto put = [&](int leg) {
    const Point at = tip_at(state_, leg);
    const double rise = surface_.rise(at.x);
    foothold(leg) = {at, {std::cos(rise), std::sin(rise)}, {-std::sin(rise), std::cos(rise)}, contact, damping};
  };
  if (first_) put(leg_ - 1);
  first_ = false;
  put(leg_);
  std::vector<int> closed{leg_};
  for (const Foot& foot : feet_)
    if (foot.leg >= leg_ - 1) closed.push_back(foot.leg);
  strike(leg_);
  after_ = state_[5];
  resolve(closed);
  for (int n = 0; n < most_events; ++n) {
    if (spent()) return false;
    int foot = 0;
    const Event event = run(foot);
    if (event == Event::turns_back) return false;
    if (event == Event::touches && foot == leg_ + 1) {
      ++leg_;
      return true;
    }
    closed.clear();
    for (const Foot& each : feet_) closed.push_back(each.leg);
    if (event == Event::touches) {
      strike(foot);
      closed.push_back(foot);
      resolve(closed);
    } else if (event == Event::lifts) {
      feet_.erase(feet_.begin() + foot);
    } else if (event == Event::slips) {
      feet_[static_cast<std::size_t>(foot)].way = -sign_of(carried(state_).tangential[static_cast<std::size_t>(foot)]);
    } else if (event == Event::stops && feet_.size() == 1) {
      feet_[0].way = 0;
      choose_modes();
    } else {  // it jams, or two feet stop as one
      if (event == Event::stops)
        for (Foot& each : feet_) each.way = 0;
      choose_modes();
    }
  }
  return false;
}

}  // namespace metastable::dynamics
