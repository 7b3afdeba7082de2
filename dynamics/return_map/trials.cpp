#include "dynamics/return_map/trials.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dynamics/settled/settled_roll.h"

namespace metastable::dynamics {
namespace {

// Returns standard normal scores of one event of one trial: Philox4x64 at counter (index, event), key (seed).
std::array<double, 2> scores(std::uint64_t seed, std::uint64_t index, std::uint64_t event) {
  const r123::Philox4x64::ctr_type counter{{index, event, 0, 0}};
  const r123::Philox4x64::key_type key{{seed, 0}};
  const auto bits = r123::Philox4x64()(counter, key);
  // (n + 1/2) / 2^52 with n < 2^52 has 53 significant bits and lies strictly inside (0, 1).
  const auto score = [](std::uint64_t word) {
    return normal_quantile((static_cast<double>(word >> 12) + 0.5) * 0x1p-52);
  };
  return {score(bits[0]), score(bits[1])};
}

// Returns the contact of collision `number` of a trial.
Contact contact_at(const ContactNoise& noise, std::uint64_t seed, std::uint64_t index, std::uint64_t number) {
  const auto both = scores(seed, index, number);
  return noise.draw(std::span(both).first(static_cast<std::size_t>(noise.dimension())));
}

// Follows one trial as it unfolds. Event 0 of a trial is the launch, event n its collision n.
class Roll {
 public:
  Roll(const WheelMap& map, const LaunchSpeed& launch, int first_landing_leg, std::uint64_t seed, std::uint64_t index)
      : map_(map), first_(first_landing_leg), seed_(seed), index_(index) {
    const double omega = launch.at_score(scores(seed, index, 0)[0]);
    state_ = omega * omega;
  }

  int leg() const { return static_cast<int>((static_cast<std::uint64_t>(first_) + number_ - 1) % legs()); }
  int phase() const { return leg() % map_.phases(); }
  std::uint64_t number() const { return number_; }
  double state() const { return state_; }
  Contact contact() const { return contact_at(map_.noise(), seed_, index_, number_); }
  void go_on(double state) {
    state_ = state;
    ++number_;
  }

 private:
  std::uint64_t legs() const { return static_cast<std::uint64_t>(map_.wheel().legs()); }

  const WheelMap& map_;
  int first_;
  std::uint64_t seed_, index_;
  std::uint64_t number_ = 1;
  double state_ = 0;
};

void check_leg(int legs, int leg) {
  if (leg < 0 || leg >= legs)
    throw std::invalid_argument(fmt::format("first_landing_leg: {} is outside [0, {}]", leg, legs - 1));
}

void check_collisions(const TrialOptions& options) {
  if (options.max_collisions < 1)
    throw std::invalid_argument(fmt::format("max_collisions: {} is outside [1, inf)", options.max_collisions));
}

void check_ramp(double ramp_length) {
  if (!(ramp_length >= 0))
    throw std::invalid_argument(fmt::format("ramp_length: {} m is outside [0, inf]", ramp_length));
}

// Follows a trial under `settled` as it unfolds.
class SettledTrial {
 public:
  SettledTrial(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch, int first_landing_leg,
               std::uint64_t seed, std::uint64_t index)
      : noise_(noise),
        seed_(seed),
        index_(index),
        contact_(contact_at(noise, seed, index, 1)),
        roll_(motion, first_landing_leg, launch.at_score(scores(seed, index, 0)[0]), contact_, contact_) {}

  const SettledRoll& roll() const { return roll_; }
  const Contact& contact() const { return contact_; }  // of the collision that comes
  Step step() {
    const Step step = roll_.step();
    contact_ = contact_at(noise_, seed_, index_, ++number_);
    if (step.touched) roll_.set_contact(contact_);
    return step;
  }

 private:
  const ContactNoise& noise_;
  std::uint64_t seed_, index_, number_ = 1;
  Contact contact_;
  SettledRoll roll_;
};

}  // namespace

int last_collision_on_ramp(const WheelMap& map, int first_landing_leg, double ramp_length) {
  check_leg(map.wheel().legs(), first_landing_leg);
  std::vector<double> advance;
  for (int p = 0; p < map.phases(); ++p) advance.push_back(map.advance(p));
  return last_collision_on_ramp(advance, first_landing_leg % map.phases(), ramp_length);
}

int last_collision_on_ramp(std::span<const double> advance, int first_phase, double ramp_length) {
  check_ramp(ramp_length);
  const int phases = static_cast<int>(advance.size());
  const auto from = [&](int phase) { return advance[static_cast<std::size_t>(phase)]; };
  double revolution = 0;
  for (const double one : advance) revolution += one;
  const double whole = std::floor(ramp_length / revolution);
  if (whole * phases > std::numeric_limits<int>::max() / 2) return std::numeric_limits<int>::max();
  int number = 1 + static_cast<int>(whole) * phases;
  double position = whole * revolution;
  for (int p = first_phase; position + from(p) <= ramp_length; p = (p + 1) % phases) {
    position += from(p);
    ++number;
  }
  return number;
}

Trial simulate_trial(const WheelMap& map, const LaunchSpeed& launch, const TrialOptions& options, std::uint64_t index) {
  check_collisions(options);
  const int last = last_collision_on_ramp(map, options.first_landing_leg, options.ramp_length);
  Roll roll(map, launch, options.first_landing_leg, options.seed, index);
  Trial trial;
  double time = 0, position = 0;
  for (;;) {
    const int phase = roll.phase();
    const Stance& stance = map.stance(phase);
    TrialCollision c;
    c.number = static_cast<int>(roll.number());
    c.leg = roll.leg();
    c.time = time;
    c.position = position;
    c.omega_minus = std::sqrt(roll.state());
    c.contact = roll.contact();
    c.loss = map.loss(phase, c.omega_minus, c.contact);
    const double after = map.after_collision(roll.state(), phase, c.contact);
    c.omega_plus = std::sqrt(std::max(0.0, after));
    trial.collisions.push_back(c);
    if (options.rest_rule && !(after >= stance.barrier)) {
      trial.outcome = Outcome::rest;
      return trial;
    }
    if (c.number == last) {
      trial.outcome = Outcome::end_of_ramp;
      return trial;
    }
    if (c.number == options.max_collisions) {
      trial.outcome = Outcome::max_collisions;
      return trial;
    }
    const double next = std::max(0.0, after + stance.gain);
    time += map.duration(next, phase);
    position += map.advance(phase);
    roll.go_on(next);
  }
}

Trial simulate_trial(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                     const TrialOptions& options, std::uint64_t index) {
  check_collisions(options);
  check_ramp(options.ramp_length);
  check_leg(motion.wheel().legs(), options.first_landing_leg);
  if (!options.rest_rule) throw std::invalid_argument("rest_rule: under `settled` a wheel that stops has stopped");
  SettledTrial of(motion, noise, launch, options.first_landing_leg, options.seed, index);
  const double sine = std::sin(motion.wheel().slope_rad);
  Trial trial;
  for (;;) {
    TrialCollision c;
    c.number = static_cast<int>(trial.collisions.size()) + 1;
    c.leg = of.roll().leg() % motion.wheel().legs();
    c.time = of.roll().time();
    c.position = of.roll().position();
    c.omega_minus = of.roll().spin();
    c.contact = of.contact();
    const Step step = of.step();
    c.omega_plus = std::max(0.0, step.landing.omega_plus);
    c.loss.normal_pre = step.landing.impact_loss;
    c.loss.tangential_pre = step.landing.friction_loss;
    c.loss.slip_distance = -step.landing.slid;
    c.loss.potential = motion.wheel().mass * motion.wheel().gravity * sine * step.landing.slid;
    trial.collisions.push_back(c);
    trial.outcome = !step.touched                                ? Outcome::rest
                    : of.roll().position() > options.ramp_length ? Outcome::end_of_ramp
                                                                 : Outcome::max_collisions;
    if (trial.outcome != Outcome::max_collisions || c.number == options.max_collisions) return trial;
  }
}

std::uint64_t steps_to_rest(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                            int first_landing_leg, std::uint64_t seed, std::uint64_t index, std::uint64_t limit) {
  return roll_on(motion, noise, launch, first_landing_leg, seed, index, limit, std::numeric_limits<double>::infinity())
      .steps;
}

RolledOn roll_on(const SettledMotion& motion, const ContactNoise& noise, const LaunchSpeed& launch,
                 int first_landing_leg, std::uint64_t seed, std::uint64_t index, std::uint64_t limit, double fastest) {
  check_leg(motion.wheel().legs(), first_landing_leg);
  SettledTrial of(motion, noise, launch, first_landing_leg, seed, index);
  for (std::uint64_t number = 1;; ++number) {
    if (!of.step().touched) return {number, Outcome::rest, false};
    if (of.roll().spin() > fastest) return {number, Outcome::max_collisions, true};
    if (number >= limit) return {number, Outcome::max_collisions, false};
  }
}

std::uint64_t steps_to_rest(const WheelMap& map, const LaunchSpeed& launch, int first_landing_leg, std::uint64_t seed,
                            std::uint64_t index, std::uint64_t limit) {
  check_leg(map.wheel().legs(), first_landing_leg);
  for (Roll roll(map, launch, first_landing_leg, seed, index);;) {
    const Stance& stance = map.stance(roll.phase());
    const double after = map.after_collision(roll.state(), roll.phase(), roll.contact());
    if (!(after >= stance.barrier) || roll.number() >= limit) return roll.number();
    roll.go_on(after + stance.gain);
  }
}

}  // namespace metastable::dynamics
