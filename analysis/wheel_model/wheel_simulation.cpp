#include "analysis/wheel_model/wheel_simulation.h"

#include <Random123/philox.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "analysis/statistics/random.h"
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

// Simulates one trial; `visit` sees the probability of rest in each of its collisions.
template <class Visit>
WheelRun drawn_run(const WheelRuns& all, const WheelRun& design, std::size_t index,
                   const std::vector<ExtendedWheel>& wheels, const WheelHypothesis& hypothesis, std::uint64_t seed,
                   Visit visit) {
  const dynamics::Extension& e = hypothesis.extension;
  const dynamics::ContactSpread& contact = hypothesis.contact;
  const dynamics::TruncatedNormal restitution(contact.restitution_mean, contact.restitution_sd, 0, 1);
  const dynamics::TruncatedNormal friction(contact.friction_mean, contact.friction_sd, 0);
  const ExtendedWheel& wheel = wheels[design.condition];
  const double noise = std::hypot(hypothesis.noise.value_or(all.noise), e.sensor.noise_sd);
  const auto score = [](double u) { return dynamics::normal_quantile(u); };
  const auto first = uniforms(seed, index, 0);
  WheelRun run = design;
  run.collisions.clear();
  const double shift = hypothesis.shift_of(design.condition) + e.contact.trial_friction_sd * score(first[0]);
  double omega = design.collisions.front().before;
  if (const auto& launch = all.conditions[design.condition].initial_speed)
    omega = std::max(0.1, launch->mean + e.sensor.launch_shift +
                              std::max(0.01, launch->sd + e.sensor.launch_widening) * score(first[1]));
  std::optional<double> eta_score, mu_score;
  double slid = 0;
  const std::size_t most =
      std::max<std::size_t>(design.outcome == dynamics::Outcome::rest ? 16 : 1, design.collisions.size());
  run.outcome = dynamics::Outcome::max_collisions;
  for (std::size_t k = 0; k < most; ++k) {
    RunCollision m;
    const RunCollision& like = design.collisions[std::min(k, design.collisions.size() - 1)];
    m.context = like.context;
    if (k > 0) {
      const RunCollision& previous = run.collisions.back();
      m.context.leg = (previous.context.leg + 1) % wheel.legs();
      m.context.position = previous.context.position + wheel.advance(previous.context.leg) + slid;
    } else {
      m.context.since_previous.reset();
    }
    m.context.friction_shift = shift;
    if (hypothesis.varied) hypothesis.varied(collision_place(run, index % all.runs.size(), k, m, omega), m.context);
    const double rho = e.contact.memory, left = std::sqrt(1 - rho * rho);
    std::optional<double> plus;
    ExtendedWheel::Drawn landed;
    for (std::uint64_t attempt = 0; attempt < 60; ++attempt) {  // the tilt by rejection
      const auto u = uniforms(seed, index, 1 + k * 64 + attempt);
      double a = score(u[0]), b = score(u[1]);
      if (rho != 0 && eta_score) {
        a = rho * *eta_score + left * a;
        b = rho * *mu_score + left * b;
      }
      const dynamics::Contact drawn{restitution.at_score(a), friction.at_score(b)};
      plus = wheel.omega_plus(m.context, omega, drawn, u[2] < e.contact.outlier_share);
      double below = plus ? wheel.after_collision(m.context, omega, *plus).below : 0.0;
      if (wheel.settles()) {
        landed = wheel.land(m.context, omega, drawn, u[2] < e.contact.outlier_share);
        if (!like.after)
          below = landed.next ? wheel.at_next_touch(m.context, omega, {}, noise, *landed.next).speed.below : 0.0;
      }
      if (attempt == 59 || u[3] * hypothesis.tilt.largest_density() <= std::exp(hypothesis.tilt.log_density(below))) {
        eta_score = a;
        mu_score = b;
        break;
      }
    }
    const double barrier = wheel.barrier(m.context);
    visit(hypothesis.tilt.below(wheel.settles() ? wheel.rest_share(m.context, omega, std::nullopt)
                                                : wheel.after_collision(m.context, omega, barrier).below));
    const auto error = uniforms(seed ^ 0x6e6f697365ULL, index, k);
    m.before = std::max(1e-3, omega + e.sensor.bias_before + noise * score(error[0]));
    m.law_error = all.law_error * score(error[2]);
    const bool rests = wheel.settles() ? !landed.next : !plus || *plus < barrier;
    if (like.after && plus) m.after = std::max(1e-3, *plus + e.sensor.bias_after + noise * score(error[1]));
    if (like.after && !plus) m.after = 0;
    m.slide.reset();
    slid = all.slides_seen ? landed.displacement : 0;
    if (all.slides_seen && !rests) m.slide = slid + all.slide_error * dynamics::slide_score(error[3]);
    run.collisions.push_back(m);
    const auto next = rests ? std::nullopt : wheel.settles() ? landed.next : wheel.next(m.context, *plus);
    if (!next) {
      run.outcome = dynamics::Outcome::rest;
      break;
    }
    omega = *next;
  }
  for (std::size_t k = 1; k < run.collisions.size(); ++k) {
    const RunCollision& previous = run.collisions[k - 1];
    const auto from = previous.after ? previous.after : wheel.back(previous.context, run.collisions[k].before);
    if (from && *from > 0) run.collisions[k].context.since_previous = wheel.duration(previous.context, *from);
  }
  for (RunCollision& m : run.collisions) {  // what was drawn there is not known of the run
    m.context.friction_shift = 0;
    m.context.friction_ratio = m.context.friction_scatter = m.context.restitution_ratio = 1;
  }
  if (!design.outcome) run.outcome.reset();
  if (run.collisions.back().slide && run.outcome != dynamics::Outcome::rest) run.collisions.back().slide.reset();
  mark_counted(all, run);
  mark_jam(all, run);
  return run;
}

}  // namespace

std::vector<WheelRun> simulated_runs(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed) {
  const std::vector<ExtendedWheel> wheels = wheels_on_ramps(design, hypothesis.contact, hypothesis.extension);
  std::vector<WheelRun> runs;
  for (std::size_t t = 0; t < design.runs.size(); ++t)
    runs.push_back(drawn_run(design, design.runs[t], t, wheels, hypothesis, seed, [](double) {}));
  return runs;
}

double simulated_steps(const WheelRuns& design, const WheelHypothesis& hypothesis, std::uint64_t seed) {
  const std::vector<ExtendedWheel> wheels = wheels_on_ramps(design, hypothesis.contact, hypothesis.extension);
  double steps = 0, hazard = 0;
  constexpr std::size_t rounds = 4;
  for (std::size_t round = 0; round < rounds; ++round)
    for (std::size_t t = 0; t < design.runs.size(); ++t)
      drawn_run(design, design.runs[t], t + round * design.runs.size(), wheels, hypothesis, seed,
                [&](double probability) {
                  steps += 1;
                  hazard += probability;
                });
  return hazard > 0 ? steps / hazard : std::numeric_limits<double>::infinity();
}

}  // namespace metastable::analysis
