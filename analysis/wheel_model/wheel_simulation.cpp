#include "analysis/wheel_model/wheel_simulation.h"

#include <Random123/philox.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "analysis/statistics/random.h"
#include "analysis/wheel_model/standing_feet.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/settled/settled_density.h"

namespace metastable::analysis {
namespace {

using dynamics::ExtendedWheel;

// Draws for collision `event` of trial `index`: uniforms of one Philox block.
std::array<double, 4> uniforms(std::uint64_t seed, std::uint64_t index, std::uint64_t event) {
  const r123::Philox4x64::ctr_type counter{{index, event, 0x64696167, 0}};
  const r123::Philox4x64::key_type key{{seed, 0}};
  const auto bits = r123::Philox4x64()(counter, key);
  std::array<double, 4> u{};
  for (std::size_t i = 0; i < 4; ++i) u[i] = unit_interval(bits[i]);
  return u;
}

double score(double u) { return dynamics::normal_quantile(u); }

// A wheel under a hypothesis, whose trials are drawn like those that were measured.
struct Simulation {
  Simulation(const WheelRuns& like, const WheelHypothesis& h, std::uint64_t from_seed)
      : measured(like),
        hypothesis(h),
        seed(from_seed),
        wheels(wheels_on_ramps(like, h.contact, h.extension)),
        restitution(h.contact.restitution_mean, h.contact.restitution_sd, 0, 1),
        friction(h.contact.friction_mean, h.contact.friction_sd, 0),
        noise(std::hypot(h.noise.value_or(like.noise), h.extension.sensor.noise_sd)) {}

  const WheelRuns& measured;
  const WheelHypothesis& hypothesis;
  std::uint64_t seed;
  std::vector<ExtendedWheel> wheels;  // by condition
  dynamics::TruncatedNormal restitution, friction;
  double noise;  // of reported speeds [rad/s]
};

struct Launch {
  double omega;           // [rad/s]
  double friction_shift;  // what the trial adds to the mean of mu
};

Launch drawn_launch(const Simulation& s, const WheelRun& design, std::size_t index) {
  const dynamics::Extension& e = s.hypothesis.extension;
  const auto first = uniforms(s.seed, index, 0);
  const double shift = s.hypothesis.shift_of(design.condition) + e.contact.trial_friction_sd * score(first[0]);
  const auto& launch = s.measured.conditions[design.condition].initial_speed;
  if (!launch) return {design.collisions.front().before, shift};
  const double sd = std::max(0.01, launch->sd + e.sensor.launch_widening);
  return {std::max(0.1, launch->mean + e.sensor.launch_shift + sd * score(first[1])), shift};
}

// Holds how far the foot of the last collision slid [m], and its omega+ [rad/s], where that is known.
struct Left {
  double slid = 0;
  std::optional<double> plus;
};

// Returns the place of the collision that follows those of the run.
dynamics::StepContext next_context(const ExtendedWheel& wheel, const WheelRun& run, const RunCollision& like,
                                   const Left& left, double friction_shift) {
  dynamics::StepContext context = like.context;
  if (run.collisions.empty()) {
    context.since_previous.reset();
  } else {
    const dynamics::StepContext& previous = run.collisions.back().context;
    context.leg = (previous.leg + 1) % wheel.legs();
    context.position = previous.position + wheel.advance(previous.leg) + left.slid;
    if (left.plus && *left.plus > 0) context.since_previous = wheel.duration(previous, *left.plus);
  }
  context.friction_shift = friction_shift;
  return context;
}

struct ContactScores {
  double restitution, friction;
};

struct DrawnCollision {
  ContactScores scores;
  std::optional<double> plus;     // omega+ [rad/s]; nothing: no energy is left
  ExtendedWheel::Drawn landed{};  // where a landing is a motion of its own
  double below = 0;               // share of landings, by speed, that are slower
};

// A collision of a wheel that is about to be drawn.
struct Landing {
  const ExtendedWheel& wheel;
  const RunCollision& like;
  const dynamics::StepContext& context;
  double omega;  // [rad/s]
};

// Returns the collision that three uniforms draw, each as likely as the contact alone has it.
// @param before  scores of the collision before, which is remembered; nothing: there is none
DrawnCollision proposed(const Simulation& s, const Landing& at, const std::optional<ContactScores>& before,
                        const std::array<double, 3>& u) {
  const dynamics::Extension::ContactChange& e = s.hypothesis.extension.contact;
  const double rho = e.memory, fresh = std::sqrt(1 - rho * rho);
  DrawnCollision drawn{{score(u[0]), score(u[1])}, {}};
  if (rho != 0 && before) {
    drawn.scores.restitution = rho * before->restitution + fresh * drawn.scores.restitution;
    drawn.scores.friction = rho * before->friction + fresh * drawn.scores.friction;
  }
  const dynamics::Contact contact{s.restitution.at_score(drawn.scores.restitution),
                                  s.friction.at_score(drawn.scores.friction)};
  const auto& [wheel, like, context, omega] = at;
  drawn.plus = wheel.omega_plus(context, omega, contact, u[2] < e.outlier_share);
  drawn.below = drawn.plus ? wheel.after_collision(context, omega, *drawn.plus).below : 0.0;
  if (!wheel.settles()) return drawn;
  drawn.landed = wheel.land(context, omega, contact, u[2] < e.outlier_share);
  if (!like.after)
    drawn.below =
        drawn.landed.next ? wheel.at_next_touch(context, omega, {}, s.noise, *drawn.landed.next).speed.below : 0.0;
  return drawn;
}

// Draws the contact of collision k by rejection: landings are as likely as the hypothesis tilts them.
DrawnCollision drawn_collision(const Simulation& s, const Landing& at, const std::optional<ContactScores>& before,
                               std::size_t index, std::size_t k) {
  constexpr std::uint64_t attempts = 60;
  for (std::uint64_t attempt = 0;; ++attempt) {
    const auto u = uniforms(s.seed, index, 1 + k * 64 + attempt);
    const DrawnCollision drawn = proposed(s, at, before, {u[0], u[1], u[2]});
    const ScoreTilt& tilt = s.hypothesis.tilt;
    if (attempt + 1 == attempts || u[3] * tilt.largest_density() <= std::exp(tilt.log_density(drawn.below)))
      return drawn;
  }
}

bool rests_after(const Landing& at, const DrawnCollision& drawn) {
  return at.wheel.settles() ? !drawn.landed.next : !drawn.plus || *drawn.plus < at.wheel.barrier(at.context);
}

// Returns the probability that a collision comes to rest, given what is remembered of the one before: where contacts
// remember, that is no function of the speed alone, and it is summed over a lattice of contacts with a random shift
// (Cranley and Patterson 1976; Korobov's generators for 16 points).
double rest_probability(const Simulation& s, const Landing& at, const std::optional<ContactScores>& before,
                        std::size_t index, std::size_t k) {
  const auto& [wheel, like, context, omega] = at;
  if (s.hypothesis.extension.contact.memory == 0 || !before)
    return s.hypothesis.tilt.below(wheel.settles()
                                       ? wheel.rest_share(context, omega, std::nullopt)
                                       : wheel.after_collision(context, omega, wheel.barrier(context)).below);
  constexpr std::size_t points = 16;
  constexpr std::array<std::size_t, 3> generators{1, 5, 9};  // 5^2 mod 16
  const auto shift = uniforms(s.seed ^ 0x6c617474696365ULL, index, k);
  double rests = 0, all = 0;
  for (std::size_t i = 0; i < points; ++i) {
    std::array<double, 3> u{};
    for (std::size_t d = 0; d < u.size(); ++d) {
      const double place = shift[d] + static_cast<double>(i * generators[d] % points) / points;
      u[d] = std::clamp(place - std::floor(place), 1e-12, 1 - 1e-12);
    }
    const DrawnCollision drawn = proposed(s, at, before, u);
    const double weight = std::exp(s.hypothesis.tilt.log_density(drawn.below));
    all += weight;
    if (rests_after(at, drawn)) rests += weight;
  }
  return rests / all;
}

// Sets what is reported of a collision, with the errors of sensors and law.
void report(const Simulation& s, const RunCollision& like, const DrawnCollision& drawn, double omega, bool rests,
            const std::array<double, 4>& error, RunCollision& m) {
  const dynamics::Extension::Sensor& sensor = s.hypothesis.extension.sensor;
  m.before = std::max(1e-3, omega + sensor.bias_before + s.noise * score(error[0]));
  m.law_error = s.measured.law_error * score(error[2]);
  if (like.after)
    m.after = drawn.plus ? std::max(1e-3, *drawn.plus + sensor.bias_after + s.noise * score(error[1])) : 0;
  m.slide.reset();
  if (s.measured.slides_seen && !rests)
    m.slide = drawn.landed.displacement + s.measured.slide_error * dynamics::slide_score(error[3]);
}

// Reduces a drawn run to what is known of a measured one, with the times that its speeds give.
void make_as_measured(const Simulation& s, const WheelRun& design, const ExtendedWheel& wheel, WheelRun& run) {
  for (std::size_t k = 1; k < run.collisions.size(); ++k) {
    const RunCollision& previous = run.collisions[k - 1];
    const auto from = previous.after ? previous.after : wheel.back(previous.context, run.collisions[k].before);
    if (from && *from > 0) run.collisions[k].context.since_previous = wheel.duration(previous.context, *from);
  }
  for (RunCollision& m : run.collisions) {
    m.context.friction_shift = 0;
    m.context.friction_ratio = m.context.friction_scatter = m.context.restitution_ratio = 1;
  }
  if (!design.outcome) run.outcome.reset();
  if (run.collisions.back().slide && run.outcome != dynamics::Outcome::rest) run.collisions.back().slide.reset();
  mark_counted(s.measured, run);
  mark_jam(s.measured, run);
}

// Simulates one trial; `visit` sees each of its collisions before it is drawn, with what is remembered.
template <class Visit>
WheelRun drawn_run(const Simulation& s, const WheelRun& design, std::size_t index, Visit visit) {
  const ExtendedWheel& wheel = s.wheels[design.condition];
  const WheelHypothesis& hypothesis = s.hypothesis;
  const Launch launch = drawn_launch(s, design, index);
  WheelRun run = design;
  run.collisions.clear();
  run.outcome = dynamics::Outcome::max_collisions;
  double omega = launch.omega;
  Left left;
  std::optional<ContactScores> before;
  const std::size_t most =
      std::max<std::size_t>(design.outcome == dynamics::Outcome::rest ? 16 : 1, design.collisions.size());
  for (std::size_t k = 0; k < most; ++k) {
    const RunCollision& like = design.collisions[std::min(k, design.collisions.size() - 1)];
    RunCollision m;
    m.context = next_context(wheel, run, like, left, launch.friction_shift);
    if (hypothesis.varied)
      hypothesis.varied(collision_place(run, index % s.measured.runs.size(), k, m, omega), m.context);
    const Landing landing{wheel, like, m.context, omega};
    visit(landing, before, k);
    const DrawnCollision drawn = drawn_collision(s, landing, before, index, k);
    before = drawn.scores;
    const bool rests = rests_after(landing, drawn);
    report(s, like, drawn, omega, rests, uniforms(s.seed ^ 0x6e6f697365ULL, index, k), m);
    run.collisions.push_back(m);
    const auto next = rests ? std::nullopt : wheel.settles() ? drawn.landed.next : wheel.next(m.context, *drawn.plus);
    if (!next) {
      run.outcome = dynamics::Outcome::rest;
      break;
    }
    left = {s.measured.slides_seen ? drawn.landed.displacement : 0,
            wheel.settles() ? wheel.back(m.context, *next) : drawn.plus};
    omega = *next;
  }
  make_as_measured(s, design, wheel, run);
  return run;
}

}  // namespace

std::vector<WheelRun> simulated_runs(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed) {
  const Simulation simulation(design, hypothesis, seed);
  std::vector<WheelRun> runs;
  for (std::size_t t = 0; t < design.runs.size(); ++t)
    runs.push_back(drawn_run(simulation, design.runs[t], t, [](const auto&...) {}));
  return runs;
}

double simulated_steps(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed) {
  const Simulation simulation(design, hypothesis, seed);
  double steps = 0, hazard = 0;
  constexpr std::size_t rounds = 4;
  for (std::size_t round = 0; round < rounds; ++round)
    for (std::size_t t = 0; t < design.runs.size(); ++t)
      drawn_run(simulation, design.runs[t], t + round * design.runs.size(),
                [&](const Landing& at, const std::optional<ContactScores>& before, std::size_t k) {
                  steps += 1;
                  hazard += rest_probability(simulation, at, before, t + round * design.runs.size(), k);
                });
  return hazard > 0 ? steps / hazard : std::numeric_limits<double>::infinity();
}

}  // namespace metastable::analysis
