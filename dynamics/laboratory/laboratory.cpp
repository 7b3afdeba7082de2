#include "dynamics/laboratory/laboratory.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "dynamics/laboratory/impulse_collision.h"
#include "dynamics/laboratory/laboratory_draws.h"
#include "dynamics/laboratory/rigid_roll.h"

namespace metastable::dynamics {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double reference_speed = 5;  // [rad/s] of the catalogue's power laws
constexpr double slosh_time = 0.15;    // [s]
constexpr double lead = 0.3;           // [s] of motion kept before collision 1

// Each event of a trial has three standard normal scores and a uniform.
struct Draws {
  std::array<double, 3> score;
  double uniform;
};
Draws draws(std::uint64_t seed, std::uint64_t trial, std::uint64_t event, LaboratoryDraw purpose) {
  const std::array<double, 4> u = laboratory_uniforms(seed, trial, event, purpose);
  return {{normal_quantile(u[0]), normal_quantile(u[1]), normal_quantile(u[2])}, u[3]};
}

// Has mean 0, sd 1 and the given skewness at a standard normal score: a shifted lognormal (mirrored, if negative).
double skewed(double skewness, double score) {
  if (skewness == 0) return score;
  // It has skewness = (w + 2) sqrt(w - 1) with w = exp(s^2).
  const double target = std::abs(skewness);
  double low = 1, high = 3;
  for (int i = 0; i < 60; ++i) {
    const double w = (low + high) / 2;
    ((w + 2) * std::sqrt(w - 1) < target ? low : high) = w;
  }
  const double w = low, s = std::sqrt(std::log(w));
  const double sign = skewness > 0 ? 1 : -1;
  return sign * (std::exp(s * sign * score - s * s / 2) - 1) / std::sqrt(w - 1);
}

NominalValues stated(const LaboratorySetup& setup) {
  return {setup.restitution_mean, setup.restitution_sd, setup.friction_mean, setup.friction_sd, setup.wheel.leg_length};
}

Wheel with_legs(Wheel wheel, const std::vector<double>& lengths) {
  wheel.leg_length = lengths;
  return wheel;
}

// Finds it about a foot at the end of a leg, for a centre of mass at the hub [kg m^2]. It is written here and not asked
// of the contact laws, which are judged: what is stated holds about a foot at the mean length, and parallel axes lead
// from there to the others; the paper's wheel has one inertia about all its feet.
double foot_inertia(const Wheel& wheel, Law law, double radius_of_gyration, double length) {
  const double mass = wheel.hub_mass, mean = wheel.mean_leg_length();
  const bool one_for_all = law == Law::published;
  if (wheel.inertia) return *wheel.inertia + (one_for_all ? 0 : mass * (length * length - mean * mean));
  if (one_for_all) return mass * mean * mean;
  return mass * (radius_of_gyration * radius_of_gyration + length * length);
}

// Bounces of more than that leave feet in the air for longer than a step.
constexpr double most_bouncing = 0.95;

// A rigid body that is followed through its hops has no loss of a collision that an effect could change.
void require_rigid(const LaboratorySetup& setup, const LaboratoryChanges& c) {
  const auto refuse = [](const char* what) {
    throw std::invalid_argument(fmt::format("laboratory: {} acts on no rigid body; law settled has none", what));
  };
  if (setup.wheel.tip_radius > 0) refuse("tip_radius: a round tip");
  if (c.rebound_lost != 0) refuse("effect bounce");
  if (c.vibration != 0) refuse("effect ramp_vibration");
  if (c.slip_reversal) refuse("effect slip_reversal");
  if (c.stored != 0) refuse("effect stored_energy");
  if (c.slosh != 0) refuse("effect sloshing_fluid");
}

void require(bool fine, const char* name, double value, const char* range) {
  if (!fine) throw std::invalid_argument(fmt::format("laboratory: {}: {} is outside {}", name, value, range));
}

}  // namespace

Laboratory::Laboratory(LaboratorySetup setup)
    : setup_(std::move(setup)),
      changes_(laboratory_changes(stated(setup_), setup_.effects, setup_.outside)),
      wheel_(with_legs(setup_.wheel, changes_.stated.leg_lengths)),
      law_(changes_.slip_reversal ? Law::coulomb : setup_.law),
      restitution_(changes_.stated.restitution_mean, changes_.stated.restitution_sd, 0, 1),
      friction_(changes_.stated.friction_mean, changes_.stated.friction_sd, 0) {
  wheel_.validate();
  if (setup_.law == Law::settled)
    require_rigid(setup_, changes_);
  else if (changes_.compliance > 0)
    throw std::invalid_argument(
        fmt::format("laboratory: effect soft_contact needs impacts that last; law {} has none", law_name(setup_.law)));
  model_ = contact_model(wheel_, law_);
  if (law_ == Law::settled) require(rigid_inertia() > 0, "inertia about the hub", rigid_inertia(), "(0, inf) kg m^2");
  require(std::abs(setup_.restitution_skewness) < 2, "restitution_skewness", setup_.restitution_skewness, "(-2, 2)");
  require(setup_.sensor_noise >= 0, "sensor_noise", setup_.sensor_noise, "[0, inf) rad/s");
  require(setup_.smoothing >= 0 && setup_.smoothing <= 0.1, "smoothing", setup_.smoothing, "[0, 0.1] s");
  require(setup_.max_collisions >= 1, "max_collisions", setup_.max_collisions, "[1, inf)");
  for (std::size_t i = 0; i < setup_.conditions.size(); ++i) {
    const LaboratoryCondition& condition = setup_.conditions[i];
    const double slope = condition.slope_rad + changes_.slope_offset_deg * degree;
    const double steepest = steepest_slope(wheel_.legs());
    if (!(slope > 0 && slope < steepest))
      throw std::invalid_argument(fmt::format("condition {}: slope: {:.6g} deg is outside (0, {:.6g}) deg", i,
                                              slope / degree, steepest / degree));
    if (!(condition.ramp_length > 0))
      throw std::invalid_argument(
          fmt::format("condition {}: ramp length: {} m is outside (0, inf)", i, condition.ramp_length));
    if (condition.first_landing_leg < 0 || condition.first_landing_leg >= wheel_.legs())
      throw std::invalid_argument(fmt::format("condition {}: first landing leg: {} is outside [0, {}]", i,
                                              condition.first_landing_leg, wheel_.legs() - 1));
    RollingBody body;
    body.leg_length = wheel_.leg_length;
    body.mass = wheel_.hub_mass;
    body.gravity = wheel_.gravity;
    body.slope_rad = slope;
    body.offset = changes_.mass_offset;
    body.offset_angle_rad = changes_.mass_angle_rad;
    body.constant_drag = changes_.constant_drag;
    body.linear_drag = changes_.linear_drag;
    body.quadratic_drag = changes_.quadratic_drag;
    body.fluid_inertia =
        changes_.slosh * foot_inertia(wheel_, law_, model_.radius_of_gyration, wheel_.mean_leg_length());
    body.fluid_coupling = body.fluid_inertia / slosh_time;
    body.flight = setup_.flight;
    body_.push_back(body);
    const double sag_end = changes_.sag_to > 0 ? changes_.sag_to : condition.ramp_length;
    if (changes_.sag != 0 && !(sag_end > changes_.sag_from))
      throw std::invalid_argument(
          fmt::format("condition {}: the sagging stretch begins beyond its end, {} m", i, sag_end));
    surface_.emplace_back(changes_.sag, changes_.sag_from, sag_end);
    launch_.emplace_back(condition.launch_mean + changes_.launch_mean,
                         std::max(0.0, condition.launch_sd + changes_.launch_sd), 0);
  }
  for (const std::size_t condition : setup_.order)
    if (condition >= setup_.conditions.size())
      throw std::invalid_argument(
          fmt::format("order: condition {} is outside [0, {})", condition, setup_.conditions.size()));
}

// Follows one trial as it unfolds.
class Laboratory::Roll {
 public:
  Roll(const Laboratory& lab, std::size_t index)
      : lab_(lab),
        c_(lab.changes_),
        condition_(lab.setup_.order.at(index)),
        index_(index),
        body_(lab.body_[condition_]),
        surface_(lab.surface_[condition_]) {
    const Draws own = draws(lab.setup_.seed, index, 0, LaboratoryDraw::trial);
    const auto trials = static_cast<double>(lab.setup_.order.size());
    launch_ = lab.launch_[condition_].at_score(own.score[0]);
    added_friction_ = c_.trial_sd * own.score[1];
    drift_ = trials > 1 ? 1 + c_.drift * static_cast<double>(index) / (trials - 1) : 1;
    body_.constant_drag += c_.wind * own.score[2];
    phase_ = 2 * std::numbers::pi * own.uniform;
  }

  LaboratoryTrial run() {
    const LaboratoryCondition& condition = lab_.setup_.conditions[condition_];
    trial_.condition = condition_;
    if (lab_.law_ == Law::settled) return run_rigid(condition);
    const Pose first = landing_pose(body_, surface_, condition.first_landing_leg, 0, launch_);
    Touch touch = touch_standing(body_, first, inertia(first.leg));
    trial_.motion = run_up(body_, surface_, first, inertia(first.leg), lead);
    double time = 0, turn = 0;
    for (;;) {
      const Pose pose = touch.leg == touch.before.leg ? hop(touch) : land(touch, time);
      const std::size_t before = trial_.motion.size();
      touch = roll_on(body_, surface_, pose, inertia(pose.leg), &trial_.motion);
      for (std::size_t m = before; m < trial_.motion.size(); ++m) {
        trial_.motion[m].time += time;
        trial_.motion[m].turn_rad += turn;
      }
      time += touch.time;
      turn += touch.turn_rad;
      const bool over = touch.end == RollEnd::rest;
      if (over || touch.leg != touch.before.leg) report_after();
      if (over) return finish(Outcome::rest);
      if (touch.leg == touch.before.leg) continue;
      if (tip(body_, touch.before, touch.leg).x > condition.ramp_length) return finish(Outcome::end_of_ramp);
      if (static_cast<int>(trial_.collisions.size()) == lab_.setup_.max_collisions)
        return finish(Outcome::max_collisions);
    }
  }

 private:
  double inertia(int leg) const {
    const double length = body_.leg_length[static_cast<std::size_t>(leg)];
    return c_.inertia_ratio * foot_inertia(lab_.wheel_, lab_.law_, lab_.model_.radius_of_gyration, length);
  }

  // The trial in the second laboratory.
  LaboratoryTrial run_rigid(const LaboratoryCondition& condition) {
    const double inertia = lab_.rigid_inertia();
    RigidRoll roll(body_, surface_, inertia, condition.first_landing_leg, launch_,
                   c_.compliance > 0 ? 1 / c_.compliance : 0);
    for (;;) {
      LaboratoryCollision& collision = add_collision(roll.leg(), roll.position(), roll.spin(), roll.time());
      collision.flew = !roll.on_ground();
      collision.contact.restitution = std::min(collision.contact.restitution, most_bouncing);
      if (trial_.motion.empty()) trial_.motion.push_back({0, 0, roll.spin()});
      report_before();
      const bool touched = roll.step(collision.contact, &trial_.motion);
      collision.omega_plus = roll.after_impact();
      report_after();
      if (!touched) return finish(Outcome::rest);
      if (roll.position() > condition.ramp_length) return finish(Outcome::end_of_ramp);
      if (static_cast<int>(trial_.collisions.size()) == lab_.setup_.max_collisions)
        return finish(Outcome::max_collisions);
    }
  }

  LaboratoryTrial finish(Outcome outcome) {
    trial_.outcome = outcome;
    return std::move(trial_);
  }

  // Makes the scores of the collision that comes from fresh ones and those before.
  void remember(const std::array<double, 3>& fresh) {
    const std::size_t before = trial_.collisions.size();
    const double last = before > 0 ? c_.memory : 0, second = before > 1 ? c_.second_memory : 0;
    const double renewed = std::sqrt(std::max(0.0, 1 - last * last - second * second));
    const auto next = [&](std::array<double, 2>& scores, double drawn) {
      scores = {last * scores[0] + second * scores[1] + renewed * drawn, scores[0]};
    };
    next(restitution_score_, fresh[0]);
    next(friction_score_, fresh[1]);
  }

  // Says what effects outside the catalogue make of the contact.
  OutsideRatios outside(int leg, double position, double speed, double time) const {
    OutsideRatios ratios;
    OutsidePlace at{leg, position, speed, 0, time, trial_.collisions.empty()};
    if (!at.first) at.slowed = trial_.collisions.back().omega_minus - speed;
    at.trial = index_;
    at.trials = lab_.setup_.order.size();
    at.condition = condition_;
    at.conditions = lab_.setup_.conditions.size();
    at.phase = phase_;
    for (const OutsideEffect& effect : c_.of_contact) outside_info(effect.id).change(effect.size, at, ratios);
    return ratios;
  }

  // Draws eta and mu of the collision that comes, effects included.
  Contact draw(int leg, double position, double speed, double time) {
    const Draws d = draws(lab_.setup_.seed, index_, trial_.collisions.size() + 1, LaboratoryDraw::contact);
    remember(d.score);
    Contact contact{0, lab_.friction_.at_score(friction_score_[0])};
    if (lab_.setup_.restitution_skewness == 0)
      contact.restitution = lab_.restitution_.at_score(restitution_score_[0]);
    else
      contact.restitution = lab_.restitution_.mean() +
                            lab_.restitution_.sd() * skewed(lab_.setup_.restitution_skewness, restitution_score_[0]);
    const double mean = lab_.friction_.mean();
    const OutsideRatios ratios = outside(leg, position, speed, time);
    if (ratios.scatter != 1) contact.friction = mean + (contact.friction - mean) * ratios.scatter;
    contact.friction = std::max(0.0, contact.friction + added_friction_) * drift_;
    for (const LegChange& change : c_.legs)
      if (change.leg == leg) {
        contact.friction *= change.friction_ratio;
        contact.restitution *= change.restitution_ratio;
      }
    const double ramp = lab_.setup_.conditions[condition_].ramp_length;
    for (const PatchChange& patch : c_.patches)
      if (position >= patch.from && position <= (patch.to > 0 ? patch.to : ramp))
        contact.friction *= patch.friction_ratio;
    contact.friction *= 1 + c_.stribeck_amplitude * std::exp(-speed / c_.stribeck_speed);
    contact.friction *= std::max(0.0, ratios.friction);
    if (d.uniform < c_.outlier_share) contact.friction *= c_.outlier_ratio;
    contact.friction = std::max(0.0, contact.friction);
    contact.restitution *= std::pow(speed / reference_speed, -c_.restitution_exponent);
    contact.restitution *= ratios.restitution;
    contact.restitution = std::clamp(contact.restitution, 0.0, 1.0);
    return contact;
  }

  // Returns the energy left in the wheel after the collision [J]; nothing is left of a foot that jams.
  double collide(const Touch& touch, const Contact& contact, double factor) {
    const Point foot = tip(body_, touch.before, touch.leg), mass = centre_of_mass(body_, touch.before);
    // With both feet on the ground the ramp runs from one to the other. After a flight it is as under the landing foot.
    const double rise =
        touch.flew ? surface_.rise(foot.x) : std::atan2(foot.z - touch.before.foot.z, foot.x - touch.before.foot.x);
    const Point along{std::cos(rise), std::sin(rise)}, up{-std::sin(rise), std::cos(rise)};
    const Point arm{mass.x - foot.x, mass.z - foot.z};
    const auto dot = [](const Point& a, const Point& b) { return a.x * b.x + a.z * b.z; };
    const int stance_leg = touch.leg;
    if (lab_.law_ == Law::plastic) {
      const double about_mass =
          inertia(stance_leg) - body_.mass * std::pow(body_.leg_length[static_cast<std::size_t>(stance_leg)], 2);
      const double omega = touch.before.speed;
      const Point velocity{touch.tip_velocity.x + omega * arm.z, touch.tip_velocity.z - omega * arm.x};
      const double momentum = body_.mass * (arm.z * velocity.x - arm.x * velocity.z) + about_mass * omega;
      const double about_foot = about_mass + body_.mass * dot(arm, arm);
      const double after = momentum > 0 ? momentum * momentum / (2 * about_foot) : 0;
      return touch.energy - factor * (touch.energy - after);
    }
    Impact impact;
    impact.law = lab_.law_;
    impact.mass = body_.mass;
    impact.gyration = lab_.law_ == Law::published
                          ? body_.leg_length[static_cast<std::size_t>(stance_leg)]
                          : std::max(lab_.model_.radius_of_gyration, 1e-8 * std::sqrt(dot(arm, arm)));
    impact.behind = -dot(arm, along);
    impact.above = dot(arm, up);
    impact.approach = -dot(touch.tip_velocity, up);
    impact.along = touch.flew ? dot(touch.tip_velocity, along) : 0;  // a standing wheel turns about the old foot
    impact.restitution = contact.restitution;
    impact.friction = contact.friction;
    impact.slope_rad = body_.slope_rad - rise;
    impact.gravity = body_.gravity;
    impact.stiffness = lab_.model_.ramp_stiffness;
    impact.contact_mass = lab_.model_.contact_mass;
    const ImpactWork work = integrate_impact(impact);
    if (work.jammed) return 0;
    const double hop = touch.before.speed >= c_.hops_from ? c_.rebound_lost * work.released : 0;
    double loss = factor * (work.total() + hop);
    if (c_.stored > 0) {
      const double lost = loss;
      if (losses_ > 1) loss -= c_.stored * (last_loss_ - loss_sum_ / losses_);
      loss_sum_ += lost;
      last_loss_ = lost;
      ++losses_;
    }
    return touch.energy - loss;
  }

  Pose next_pose(const Touch& touch, double energy) const {
    Pose pose = touch.before;
    pose.foot = tip(body_, touch.before, touch.leg);
    if (touch.leg != touch.before.leg) pose.angle_rad -= body_.leg_angle();
    pose.leg = touch.leg;
    pose.speed = energy > 0 ? std::sqrt(2 * energy / inertia_about_foot(body_, pose, inertia(pose.leg))) : 0;
    return pose;
  }

  Pose land(const Touch& touch, double time) {
    const double since = trial_.collisions.empty() ? 0 : time - trial_.collisions.back().time;
    const double factor =
        trial_.collisions.empty() ? 1 : 1 + c_.vibration * std::cos(2 * std::numbers::pi * c_.vibration_hz * since);
    LaboratoryCollision& collision =
        add_collision(touch.leg, tip(body_, touch.before, touch.leg).x, touch.before.speed, time);
    collision.flew = touch.flew;
    contact_ = collision.contact;
    const Pose pose = next_pose(touch, collide(touch, contact_, factor));
    collision.omega_plus = pose.speed;
    report_before();
    return pose;
  }

  LaboratoryCollision& add_collision(int leg, double position, double speed, double time) {
    LaboratoryCollision collision;
    collision.contact = draw(leg, position, speed, time);
    collision.leg = leg;
    collision.time = time;
    collision.position = position;
    collision.omega_minus = speed;
    return trial_.collisions.emplace_back(collision);
  }

  void report_before() {
    LaboratoryCollision& last = trial_.collisions.back();
    const double window = lab_.setup_.smoothing;
    double seen = last.omega_minus;
    if (window > 0 && last.time > trial_.motion.front().time)
      seen = mean_speed(std::max(last.time - window, trial_.motion.front().time), last.time);
    last.reported_minus = sensed(seen, 2 * (trial_.collisions.size() - 1));
  }

  // Lets the old foot come down again, which no camera would call a collision.
  Pose hop(const Touch& touch) { return next_pose(touch, collide(touch, contact_, 1)); }

  void report_after() {
    LaboratoryCollision& last = trial_.collisions.back();
    const double window = lab_.setup_.smoothing, end = trial_.motion.back().time;
    double seen = last.omega_plus;
    if (window > 0 && end > last.time) seen = mean_speed(last.time, std::min(end, last.time + window));
    last.reported_plus = sensed(seen, 2 * trial_.collisions.size() + 1);
  }

  double mean_speed(double from, double to) const {
    return (angle_at(trial_.motion, to) - angle_at(trial_.motion, from)) / (to - from);
  }

  // @param event of the sensor: 2 k before collision k, from 0, and 2 k + 3 after it
  double sensed(double speed, std::size_t event) const {
    const Draws d = draws(lab_.setup_.seed, index_, event, LaboratoryDraw::sensor);
    const double noise = lab_.setup_.sensor_noise * d.score[0] + c_.sensor_noise * d.score[1];
    return std::max(0.0, speed + c_.sensor_bias + noise);
  }

  const Laboratory& lab_;
  const LaboratoryChanges& c_;
  std::size_t condition_, index_;
  RollingBody body_;
  const RampSurface& surface_;
  LaboratoryTrial trial_;
  Contact contact_;
  double launch_ = 0, added_friction_ = 0, drift_ = 1;
  double phase_ = 0;                                              // that the trial draws
  std::array<double, 2> restitution_score_{}, friction_score_{};  // of the last collision and of the one before
  double loss_sum_ = 0, last_loss_ = 0;
  int losses_ = 0;
};

double Laboratory::rigid_inertia() const {
  const double mass = wheel_.hub_mass, mean = wheel_.mean_leg_length(), gyration = model_.radius_of_gyration;
  return mass * (changes_.inertia_ratio * (gyration * gyration + mean * mean) - mean * mean);
}

LaboratoryTrial Laboratory::run(std::size_t index) const { return Roll(*this, index).run(); }

double angle_at(const std::vector<Moment>& motion, double time) {
  const auto after =
      std::upper_bound(motion.begin(), motion.end(), time, [](double t, const Moment& m) { return t < m.time; });
  if (after == motion.begin()) return motion.front().turn_rad;
  const Moment& a = *(after - 1);
  if (after == motion.end()) return a.turn_rad;
  const Moment& b = *after;
  const double h = b.time - a.time, s = (time - a.time) / h;
  return a.turn_rad * (1 + 2 * s) * (1 - s) * (1 - s) + b.turn_rad * s * s * (3 - 2 * s) +
         h * s * (1 - s) * ((1 - s) * a.speed - s * b.speed);
}

}  // namespace metastable::dynamics
