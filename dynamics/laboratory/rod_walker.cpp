#include "dynamics/laboratory/rod_walker.h"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <numbers>

namespace metastable::dynamics {
namespace {

namespace odeint = boost::numeric::odeint;

constexpr double piece = 0.07;          // of sqrt(length/gravity): a Runge-Kutta step; halving it moves a step by 1e-10
constexpr double longest_share = 30;    // of sqrt(length/gravity), that a strike may take
constexpr double cord = 0.25;           // [m] of the load
constexpr double drive_lag = 0.3;       // [s]
constexpr double ramp_frequency = 0.6;  // [Hz]
constexpr double ground = 1e-6;         // [m], over which a foot is not on it
constexpr double least_compliance = 1e-7;  // [rad/(N m)] of a knee that is not rigid
constexpr double knee_piece = 0.7;         // of 1/(natural frequency of a knee); halving it moves a step by 1e-9
constexpr int projections = 2;             // from errors of 1e-9 to those of rounding

using Eight = std::array<double, 8>;
using Six = std::array<double, 6>;

// Returns where `value` changes its sign in (0, longest), at whose ends it has different signs.
template <class Value>
double crossing(const Value& value, double longest, double at_zero, double at_longest) {
  std::uintmax_t most = 60;
  const auto [low, high] = boost::math::tools::toms748_solve(value, 0.0, longest, at_zero, at_longest,
                                                             boost::math::tools::eps_tolerance<double>(48), most);
  return 0.5 * (low + high);
}

// The knee of a leg whose foot stands on the ground at x: its bend, thigh less shank, and the bend's slopes by the
// positions of hip and knee.
struct Knee {
  double bend = 0, rate = 0;
  std::array<double, 2> by_hip{}, by_knee{};

  Knee(const double* s, std::size_t leg, double x) {
    const std::size_t at = 2 + 2 * leg;
    const double tx = s[at] - s[0], ty = s[at + 1] - s[1], sx = x - s[at], sy = -s[at + 1];
    const double t = tx * tx + ty * ty, l = sx * sx + sy * sy;
    bend = std::atan2(tx * -sy + ty * sx, tx * sx + ty * sy);
    by_hip = {ty / t, -tx / t};
    by_knee = {-ty / t - sy / l, tx / t + sx / l};
    rate = by_hip[0] * s[8] + by_hip[1] * s[9] + by_knee[0] * s[8 + at] + by_knee[1] * s[9 + at];
  }
};

// Returns m (ab/(a + b))^2: the inertia of the knee's bend where hip and foot are held.
double inertia_of_bend(const RodLeg& leg) {
  const double arm = leg.foot_to_mass * leg.mass_to_hip / leg.length();
  return leg.mass * arm * arm;
}

// The rates of the constraints by the rates of the coordinates, row by row: the two legs; the standing foot's height
// and its rolling, or the shank of a knee that gives; the cord.
struct Constraints {
  std::size_t rows = 4, coordinates = 6;
  std::array<Eight, 6> by{};
  Six turning{};  // what the acceleration of a constraint has without accelerations
  Six off{};      // by how much the positions violate it
  Eight inverse_mass{};

  // Holds the knee at a distance from the foot that stands at x.
  void shank(std::size_t row, const double* s, std::size_t knee, double x, double length) {
    const double d[] = {s[2 * knee] - x, s[2 * knee + 1]}, *v = s + 8 + 2 * knee;
    by[row][2 * knee] = d[0];
    by[row][2 * knee + 1] = d[1];
    turning[row] = v[0] * v[0] + v[1] * v[1];
    off[row] = 0.5 * (d[0] * d[0] + d[1] * d[1] - length * length);
  }

  void rod(std::size_t row, const double* s, std::size_t from, std::size_t to, double length) {
    double squared = 0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double d = s[2 * to + axis] - s[2 * from + axis], v = s[8 + 2 * to + axis] - s[8 + 2 * from + axis];
      by[row][2 * to + axis] = d;
      by[row][2 * from + axis] = -d;
      turning[row] += v * v;
      squared += d * d;
    }
    off[row] = 0.5 * (squared - length * length);
  }

  // Changes `rates` by impulses along the constraints, so that these change at the rates wanted.
  void hold(Eight& rates, const Six& wanted) const {
    std::array<Six, 6> a{};
    Six b{};
    for (std::size_t i = 0; i < rows; ++i) {
      b[i] = wanted[i];
      for (std::size_t k = 0; k < coordinates; ++k) b[i] -= by[i][k] * rates[k];
      for (std::size_t j = 0; j <= i; ++j)
        for (std::size_t k = 0; k < coordinates; ++k) a[i][j] += by[i][k] * inverse_mass[k] * by[j][k];
    }
    // Cholesky's factors in place of the lower triangle.
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        for (std::size_t k = 0; k < j; ++k) a[i][j] -= a[i][k] * a[j][k];
        a[i][j] = i == j ? std::sqrt(a[i][i]) : a[i][j] / a[j][j];
      }
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
      b[i] /= a[i][i];
    }
    for (std::size_t i = rows; i-- > 0;) {
      for (std::size_t k = i + 1; k < rows; ++k) b[i] -= a[k][i] * b[k];
      b[i] /= a[i][i];
    }
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = 0; k < coordinates; ++k) rates[k] += inverse_mass[k] * by[i][k] * b[i];
  }
};

// @param s  positions and velocities; @param anchor  of the standing foot's rolling
Constraints constraints_at(const RodWalkerOptions& o, int stance, double anchor, double angle, const double* s) {
  Constraints c;
  const bool loaded = o.load_mass > 0, gives = o.knee_compliance >= least_compliance;
  c.rows = (loaded ? 5 : 4) - (gives ? 1 : 0);
  c.coordinates = loaded ? 8 : 6;
  const double masses[] = {o.hip_mass, o.legs[0].mass, o.legs[1].mass, o.load_mass};
  for (std::size_t k = 0; k < c.coordinates; ++k) c.inverse_mass[k] = 1 / masses[k / 2];
  for (std::size_t leg = 0; leg < 2; ++leg) c.rod(leg, s, 0, 1 + leg, o.legs[leg].mass_to_hip);
  const auto leg = static_cast<std::size_t>(stance), at = 1 + leg;
  if (loaded) c.rod(c.rows - 1, s, 0, 3, cord);
  if (gives) {
    c.shank(2, s, at, anchor, o.legs[leg].foot_to_mass);
    return c;
  }
  const double b = o.legs[leg].mass_to_hip, share = (o.legs[leg].length() - o.foot_radius) / b;
  const double dx = s[2 * at] - s[0], dy = s[2 * at + 1] - s[1];
  c.by[2][1] = c.by[3][0] = 1 - share;
  c.by[2][2 * at + 1] = c.by[3][2 * at] = share;
  c.off[2] = (1 - share) * s[1] + share * s[2 * at + 1] - o.foot_radius;
  c.off[3] = (1 - share) * s[0] + share * s[2 * at] + o.foot_radius * angle - anchor;
  const double roll = o.foot_radius / (b * b);
  c.by[3][2 * at] -= roll * dy;
  c.by[3][2 * at + 1] += roll * dx;
  c.by[3][0] += roll * dy;
  c.by[3][1] -= roll * dx;
  return c;
}

}  // namespace

RodWalker::RodWalker(const RodWalkerOptions& options, int stance_leg, const RodStride& start)
    : options_(options), stance_(stance_leg) {
  put_down(stance_leg, start, 0);
  hang_load({0, -cord, 0, 0});
}

double RodWalker::mass(std::size_t point) const {
  return point == 0 ? options_.hip_mass : point == 3 ? options_.load_mass : options_.legs[point - 1].mass;
}

bool RodWalker::gives() const { return options_.knee_compliance >= least_compliance; }

// Returns the length of a Runge-Kutta step [s]. @param length  of the leg that sets the unit of time
double RodWalker::longest_piece(double length) const {
  const double usual = piece * std::sqrt(length / options_.gravity);
  if (!gives()) return usual;
  const double inertia = inertia_of_bend(options_.legs[static_cast<std::size_t>(stance_)]);
  return std::min(usual, knee_piece * std::sqrt(inertia * options_.knee_compliance));
}

std::array<double, 2> RodWalker::knee() const {
  if (!gives()) return {0, 0};
  const Knee found(state_.data(), static_cast<std::size_t>(stance_), anchor_);
  return {found.bend, found.rate};
}

// Returns the foot of a leg, or the centre of its arc, along and above the slope.
std::array<double, 2> RodWalker::foot(int leg) const {
  if (gives() && leg == stance_) return {anchor_, 0};
  const auto i = static_cast<std::size_t>(leg);
  const double share = (options_.legs[i].length() - options_.foot_radius) / options_.legs[i].mass_to_hip;
  return {state_[0] + share * (state_[2 + 2 * i] - state_[0]), state_[1] + share * (state_[3 + 2 * i] - state_[1])};
}

double RodWalker::angle(const State& s, int leg) const {
  const auto at = 2 + 2 * static_cast<std::size_t>(leg);
  return std::atan2(s[at] - s[0], s[1] - s[at + 1]);
}

double RodWalker::rate(const State& s, int leg) const {
  const auto at = 2 + 2 * static_cast<std::size_t>(leg);
  const double dx = s[at] - s[0], dy = s[at + 1] - s[1], vx = s[8 + at] - s[8], vy = s[9 + at] - s[9];
  return (dx * vy - dy * vx) / (dx * dx + dy * dy);
}

// Returns how high the swing foot is over the ground.
double RodWalker::height(const State& s) const { return height_of(s, 0) - options_.foot_radius; }

// Returns that of the swing foot's arc's centre, from the positions at 0, or its rate, from the velocities at 8.
double RodWalker::height_of(const State& s, std::size_t at) const {
  const auto i = static_cast<std::size_t>(1 - stance_);
  const double share = (options_.legs[i].length() - options_.foot_radius) / options_.legs[i].mass_to_hip;
  return s[at + 1] + share * (s[at + 3 + 2 * i] - s[at + 1]);
}

// Returns how much further down the slope the swing foot is than the standing one.
double RodWalker::lead(const State& s) const {
  double x[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const double share = (options_.legs[i].length() - options_.foot_radius) / options_.legs[i].mass_to_hip;
    x[i] = s[0] + share * (s[2 + 2 * i] - s[0]);
  }
  if (gives()) x[stance_] = anchor_;
  return x[1 - stance_] - x[stance_];
}

Eight RodWalker::forces(const State& s, double time) const {
  const RodWalkerOptions& o = options_;
  Eight f{};
  double along = o.gravity * std::sin(slope_);
  const double down = o.gravity * std::cos(slope_);
  if (o.sway != 0) {
    const double turn = 2 * std::numbers::pi * ramp_frequency;
    along += o.sway * turn * turn * std::cos(turn * time + o.sway_phase_rad);
  }
  for (std::size_t i = 0; i < count(); ++i) {
    f[2 * i] = mass(i) * along;
    f[2 * i + 1] = -mass(i) * down;
  }
  if (gives()) {
    const auto leg = static_cast<std::size_t>(stance_), at = 2 + 2 * leg;
    const Knee knee(s.data(), leg, anchor_);
    const double stiffness = 1 / o.knee_compliance;
    const double moment = stiffness * knee.bend + 2 * std::sqrt(stiffness * inertia_of_bend(o.legs[leg])) * knee.rate;
    for (std::size_t k = 0; k < 2; ++k) f[k] -= moment * knee.by_hip[k], f[at + k] -= moment * knee.by_knee[k];
  }
  double on_stance = stance_ == 0 ? -s[16] : s[16];
  if (o.hip_damping != 0) on_stance -= o.hip_damping * turning(s);
  if (o.hip_friction != 0) on_stance -= o.hip_friction * against_;
  if (o.hip_spring != 0) on_stance -= o.hip_spring * (angle(s, stance_) - angle(s, 1 - stance_));
  if (on_stance == 0) return f;
  for (const int leg : {0, 1}) {
    const double torque = leg == stance_ ? on_stance : -on_stance;
    const auto at = 2 + 2 * static_cast<std::size_t>(leg);
    const double dx = s[at] - s[0], dy = s[at + 1] - s[1], squared = dx * dx + dy * dy;
    f[at] -= torque * dy / squared;
    f[at + 1] += torque * dx / squared;
    f[0] += torque * dy / squared;
    f[1] -= torque * dx / squared;
  }
  return f;
}

void RodWalker::derivative(const State& s, State& ds, double time) const {
  Constraints c = constraints_at(options_, stance_, anchor_, 0, s.data());
  Eight a = forces(s, time);
  Six wanted{};
  for (std::size_t k = 0; k < c.coordinates; ++k) a[k] *= c.inverse_mass[k];
  for (std::size_t i = 0; i < c.rows; ++i) wanted[i] = -c.turning[i];
  c.hold(a, wanted);
  for (std::size_t k = 0; k < 8; ++k) {
    ds[k] = s[8 + k];
    ds[8 + k] = k < c.coordinates ? a[k] : 0;
  }
  const double asked = stance_ == 0 ? options_.drive_torque : -options_.drive_torque;  // leg 1 swings, or leg 0
  ds[16] = (asked - s[16]) / drive_lag;
}

RodWalker::State RodWalker::moved(double time) const {
  odeint::runge_kutta_fehlberg78<State> stepper;
  State s = state_;
  stepper.do_step([this](const State& x, State& dx, double t) { derivative(x, dx, t); }, s, time_, time);
  return s;
}

// Returns the time of the next piece, and its end: a Runge-Kutta step, or less where the hip with friction turns back.
double RodWalker::next_piece(double longest, State& end) {
  if (options_.hip_friction > 0 && !just_turned_) against_ = turning(state_) > 0 ? 1 : -1;
  end = moved(longest);
  if (!(options_.hip_friction > 0)) return longest;
  const double last = turning(end);
  if (!(against_ * last < 0)) {
    just_turned_ = false;
    return longest;
  }
  if (just_turned_) {  // the friction would turn the legs back at once
    against_ = 0;
    end = moved(longest);
    just_turned_ = false;
    return longest;
  }
  const double first = turning(state_);
  if (against_ * first > 0) {
    longest = crossing([&](double t) { return turning(moved(t)); }, longest, first, last);
    end = moved(longest);
  }
  turns_ = true;
  return longest;
}

// Returns when within the piece the swing foot comes down before the standing one; nothing if it does not. The slope of
// the line from foot to foot is followed: where legs of one length pass each other it goes on smoothly.
std::optional<double> RodWalker::landing(double passed, const State& end) const {
  const auto slope = [this](const State& s) { return height(s) / lead(s); };
  double from = 0, before = slope(state_);
  const double after = slope(end);
  if (!(after <= 0)) return std::nullopt;
  if (!(before > 0)) {
    // A foot before the standing one may have risen over the ground and come down within the piece.
    const auto rise = [this](const State& s) { return height_of(s, 8); };
    if (!(lead(state_) > 0 && lead(end) > 0 && rise(state_) > 0 && rise(end) < 0)) return std::nullopt;
    from = crossing([&](double t) { return rise(moved(t)); }, passed, rise(state_), rise(end));
    before = slope(moved(from));
    if (!(before > 0)) return std::nullopt;
  }
  const double time = from + crossing([&](double t) { return slope(moved(from + t)); }, passed - from, before, after);
  const State at = moved(time);
  // A shorter leg may come down as it passes the other one: its foot is still behind the hip then.
  const bool before_hip = at[2 + 2 * static_cast<std::size_t>(1 - stance_)] > at[0];
  if (!(lead(at) > 0 && before_hip && std::abs(height(at)) < ground)) return std::nullopt;
  return time;
}

void RodWalker::arrive(const State& end, double passed) {
  if (turns_) {
    against_ = -against_;
    just_turned_ = true;
    turns_ = false;
  }
  state_ = end;
  time_ += passed;
  project();
}

// Puts positions and velocities back onto the constraints, by the least change of motion.
void RodWalker::project() {
  for (int i = 0; i < projections; ++i) {
    const Constraints c = constraints_at(options_, stance_, anchor_, angle(state_, stance_), state_.data());
    Eight change{};
    Six wanted{};
    for (std::size_t row = 0; row < c.rows; ++row) wanted[row] = -c.off[row];
    c.hold(change, wanted);
    for (std::size_t k = 0; k < c.coordinates; ++k) state_[k] += change[k];
  }
  const Constraints c = constraints_at(options_, stance_, anchor_, angle(state_, stance_), state_.data());
  Eight v;
  std::copy_n(state_.begin() + 8, 8, v.begin());
  c.hold(v, {});
  std::copy_n(v.begin(), 8, state_.begin() + 8);
}

// Puts hip and legs down with both feet on the ground, the standing one at x. The load stays where it was.
void RodWalker::put_down(int stance, const RodStride& stride, double x) {
  const double radius = options_.foot_radius;
  const auto on = static_cast<std::size_t>(stance);
  const double l = options_.legs[on].length() - radius, other = options_.legs[1 - on].length() - radius;
  // Legs of unequal length lean by this: both feet are down.
  const double lean = std::atan((l - other) / (l + other) / std::tan(stride.half_angle));
  stance_ = stance;
  const double angles[] = {stride.half_angle + lean, lean - stride.half_angle};
  const double rates[] = {stride.stance_rate, stride.swing_rate};
  state_[0] = x - l * std::sin(angles[0]);
  state_[1] = radius + l * std::cos(angles[0]);
  state_[8] = -rates[0] * (radius + l * std::cos(angles[0]));
  state_[9] = -rates[0] * l * std::sin(angles[0]);
  for (std::size_t part = 0; part < 2; ++part) {
    const std::size_t leg = part == 0 ? on : 1 - on, at = 2 + 2 * leg;
    const double b = options_.legs[leg].mass_to_hip;
    state_[at] = state_[0] + b * std::sin(angles[part]);
    state_[at + 1] = state_[1] - b * std::cos(angles[part]);
    state_[8 + at] = state_[8] + b * rates[part] * std::cos(angles[part]);
    state_[9 + at] = state_[9] + b * rates[part] * std::sin(angles[part]);
  }
  anchor_ = x + radius * angles[0];
}

// Puts the load where it is seen from the hip: position and velocity.
void RodWalker::hang_load(const std::array<double, 4>& from_hip) {
  for (std::size_t k = 0; k < 2; ++k) {
    state_[6 + k] = state_[k] + from_hip[k];
    state_[14 + k] = state_[8 + k] + from_hip[2 + k];
  }
}

bool RodWalker::reach_strike(double slope) {
  slope_ = slope;
  just_turned_ = false;
  const double length = options_.legs[static_cast<std::size_t>(stance_)].length();
  const double unit = std::sqrt(length / options_.gravity), begun = time_, longest = longest_piece(length);
  while (time_ - begun <= longest_share * unit) {
    State end;
    const double passed = next_piece(longest, end);
    if (const auto time = landing(passed, end)) {
      const State struck = moved(*time);
      turns_ = false;
      arrive(struck, *time);
      return true;
    }
    arrive(end, passed);
    if (!(std::abs(angle(state_, stance_)) < std::numbers::pi / 2)) return false;
    if (!(std::abs(knee()[0]) < std::numbers::pi / 2)) return false;
  }
  return false;
}

void RodWalker::strike() {
  const double struck = foot(1 - stance_)[0], kept = std::sqrt(1 - options_.impact_loss);
  stance_ = 1 - stance_;
  anchor_ = struck + options_.foot_radius * angle(state_, stance_);
  project();
  for (std::size_t k = 8; k < 16; ++k) state_[k] *= kept;
  if (options_.foot_slip == 0) return;
  // Both feet stay on the ground, further apart; the legs turn as they did, the new standing one as a whole.
  state_ = locked();
  const double on = foot(stance_)[0] + options_.foot_slip, apart = on - foot(1 - stance_)[0];
  const double l = options_.legs[static_cast<std::size_t>(stance_)].length() - options_.foot_radius;
  const double other = options_.legs[static_cast<std::size_t>(1 - stance_)].length() - options_.foot_radius;
  RodStride stride = this->stride();
  stride.half_angle = 0.5 * std::acos(std::clamp((l * l + other * other - apart * apart) / (2 * l * other), -1.0, 1.0));
  std::array<double, 4> load{};
  for (std::size_t k = 0; k < 2; ++k) load[k] = state_[6 + k] - state_[k], load[2 + k] = state_[14 + k] - state_[8 + k];
  put_down(stance_, stride, on);
  hang_load(load);
}

bool RodWalker::step(double slope) {
  if (!reach_strike(slope)) return false;
  strike();
  const double half = stride().half_angle;
  return half > 0 && half < std::numbers::pi / 2;
}

void RodWalker::move(double slope, double time) {
  slope_ = slope;
  just_turned_ = false;
  const double unit = longest_piece(options_.legs[0].length());
  for (const double until = time_ + time; time_ < until;) {
    State end;
    const double passed = next_piece(std::min(unit, until - time_), end);
    arrive(end, passed);
  }
}

// Returns the state after the impulse that locks a standing knee that gives.
RodWalker::State RodWalker::locked() const {
  if (!gives()) return state_;
  Constraints c = constraints_at(options_, stance_, anchor_, 0, state_.data());
  const auto leg = static_cast<std::size_t>(stance_), at = 2 + 2 * leg;
  const Knee knee(state_.data(), leg, anchor_);
  for (std::size_t k = 0; k < 2; ++k) c.by[c.rows][k] = knee.by_hip[k], c.by[c.rows][at + k] = knee.by_knee[k];
  ++c.rows;
  Eight v;
  std::copy_n(state_.begin() + 8, 8, v.begin());
  c.hold(v, {});
  State s = state_;
  std::copy_n(v.begin(), 8, s.begin() + 8);
  return s;
}

RodStride RodWalker::stride() const {
  const State s = locked();
  const double stands = gives() ? std::atan2(anchor_ - s[0], s[1]) : angle(s, stance_);
  return {0.5 * (stands - angle(s, 1 - stance_)), rate(s, stance_), rate(s, 1 - stance_)};
}

std::vector<RodPoint> RodWalker::points() const {
  std::vector<RodPoint> all;
  for (std::size_t i = 0; i < count(); ++i)
    all.push_back({mass(i), state_[2 * i], state_[2 * i + 1], state_[8 + 2 * i], state_[9 + 2 * i]});
  return all;
}

double RodWalker::energy(double slope) const {
  const double apart = angle(state_, stance_) - angle(state_, 1 - stance_);
  double sum = 0.5 * options_.hip_spring * apart * apart;
  if (gives()) sum += 0.5 * knee()[0] * knee()[0] / options_.knee_compliance;
  for (const RodPoint& p : points())
    sum += p.mass *
           (0.5 * (p.vx * p.vx + p.vy * p.vy) + options_.gravity * (p.y * std::cos(slope) - p.x * std::sin(slope)));
  return sum;
}

}  // namespace metastable::dynamics
