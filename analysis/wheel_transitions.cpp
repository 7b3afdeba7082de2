#include "analysis/wheel_transitions.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "analysis/missing_columns.h"
#include "analysis/score_tilt.h"
#include "analysis/speed_filter.h"
#include "analysis/wheel_candidates.h"
#include "dynamics/extended_wheel.h"
#include "dynamics/truncated_normal.h"

namespace metastable::analysis {
namespace {

using dynamics::ContactSpread;
using dynamics::ExtendedWheel;
using dynamics::Extension;
using dynamics::normal_cdf;
using dynamics::StepContext;

constexpr double degree = std::numbers::pi / 180;
struct Node {  // of Gauss-Hermite's rules for the standard normal
  double score, weight;
};
constexpr std::array<Node, 5> five_nodes{{{-2.856970013872806, 0.01125741132772069},
                                          {-1.355626179974266, 0.2220759220056126},
                                          {0, 0.5333333333333333},
                                          {1.355626179974266, 0.2220759220056126},
                                          {2.856970013872806, 0.01125741132772069}}};

struct Measured {
  StepContext context;
  double before = 0;
  std::optional<double> after;
};

struct MeasuredRun {
  std::size_t condition = 0;
  std::vector<Measured> collisions;
  std::optional<dynamics::Outcome> outcome;
};

// A draw of collision `event` of trial `index`: uniforms of one Philox block.
std::array<double, 4> uniforms(std::uint64_t seed, std::uint64_t index, std::uint64_t event) {
  const r123::Philox4x64::ctr_type counter{{index, event, 0x64696167, 0}};
  const r123::Philox4x64::key_type key{{seed, 0}};
  const auto bits = r123::Philox4x64()(counter, key);
  std::array<double, 4> u{};
  for (std::size_t i = 0; i < 4; ++i) u[i] = (static_cast<double>(bits[i] >> 12) + 0.5) * 0x1p-52;
  return u;
}

class WheelTransitions : public TransitionModel {
 public:
  explicit WheelTransitions(const Experiment& experiment);

  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return runs_.size(); }
  std::size_t conditions() const override { return conditions_.size(); }
  int legs() const override { return legs_known_ ? wheel_.legs() : 0; }
  std::string condition_name(std::size_t condition) const override { return conditions_.at(condition).id; }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  const std::vector<std::string>& notes() const override { return notes_; }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const Term> terms) const override;
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const Term> terms,
                                            std::uint64_t seed) const override;
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> alternatives(std::span<const double> nuisance,
                                                                                     std::uint64_t seed) const override;
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> completed(std::span<const double> nuisance,
                                                                                  std::uint64_t seed) const override;
  std::pair<double, double> rests() const override;
  double expected_steps(std::span<const double> nuisance, std::span<const Term> terms,
                        std::uint64_t seed) const override;
  std::vector<Named> report_nuisances(std::span<const double> nuisance) const override;

 private:
  Extension extension(std::span<const Term> terms) const;
  std::vector<ExtendedWheel> wheels(std::span<const double> nuisance, const Extension& extension) const;
  void find_legs(bool column);
  void complete_contexts();
  void estimate_noise();
  void list_events();
  void set_up_parameters();
  void name_what_is_too_few();
  // One trial drawn from the model; `visit` sees each collision's speed, context and probability of rest.
  template <class Visit>
  MeasuredRun draw(const MeasuredRun& design, std::size_t index, const std::vector<ExtendedWheel>& wheels,
                   const Extension& extension, std::span<const double> nuisance, std::uint64_t seed, Visit visit) const;

  Experiment experiment_;  // as it was read
  dynamics::Wheel wheel_;
  dynamics::Law law_ = dynamics::Law::published;
  std::vector<Condition> conditions_;
  std::vector<MeasuredRun> runs_;
  double noise_ = 0;  // stated sd of reported speeds [rad/s]
  bool legs_known_ = true, noise_stated_ = true, speeds_after_ = false, exact_stances_ = false;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<WheelCandidate> effects_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

WheelTransitions::WheelTransitions(const Experiment& experiment)
    : experiment_(experiment),
      wheel_(experiment.wheel),
      law_(experiment.contact.law),
      conditions_(experiment.conditions) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("wheel_transitions: the experiment is a coast-down");
  if (law_ == dynamics::Law::plastic)
    throw std::invalid_argument(
        "contact.law: plastic has no restitution and no friction, hence no spread to compare trials with "
        "(published or coulomb is needed)");
  noise_ = experiment.sensor.noise_sd.value_or(0);
  bool leg_column = true;
  const double count = static_cast<double>(experiment.trials.size());
  for (std::size_t t = 0; t < experiment.trials.size(); ++t) {
    const MeasuredTrial& trial = experiment.trials[t];
    MeasuredRun run;
    run.condition = trial.condition;
    run.outcome = trial.outcome;
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      const MeasuredCollision& c = trial.collisions[k];
      Measured m;
      m.context.leg = c.leg.value_or(0);
      leg_column = leg_column && c.leg;
      m.context.position = c.position.value_or(std::numeric_limits<double>::quiet_NaN());
      if (k > 0 && c.time && trial.collisions[k - 1].time)
        m.context.since_previous = *c.time - *trial.collisions[k - 1].time;
      m.context.run_share = count > 1 ? static_cast<double>(t) / (count - 1) : 0;
      m.before = c.omega_minus;
      m.after = c.omega_plus;
      if (c.omega_plus && *c.omega_plus > 0) speeds_after_ = true;
      run.collisions.push_back(m);
    }
    runs_.push_back(std::move(run));
  }
  find_legs(leg_column);
  complete_contexts();
  estimate_noise();
  list_events();
  if (events_.size() < 2 || std::none_of(events_.begin(), events_.end(), [](const Event& e) {
        return e.kind == EventKind::collision || e.kind == EventKind::step;
      }))
    throw std::invalid_argument(
        "collisions.csv: no trial has two collisions or omega_plus_rad_s: there is no transition");
  set_up_parameters();
  name_what_is_too_few();
  if (experiment.columns.time == Presence::none)
    notes_.push_back(
        "time_s is missing: times between collisions are those of the model's stance; ramp_vibration rests on them");
  if (experiment.columns.position == Presence::none)
    notes_.push_back(
        "position_m is missing: positions follow from the legs' lengths; slope_profile and friction_patch rest on "
        "them");
  if (!speeds_after_) notes_.push_back("omega_plus_rad_s is missing: collision and stance cannot be told apart");
  if (!experiment.columns.outcomes) notes_.push_back("trials.csv is missing: whether trials came to rest is not known");
}

// Legs that were not noted: the stances tell them where omega_plus is there, because the legs' lengths differ.
void WheelTransitions::find_legs(bool column) {
  if (column || wheel_.equal_legs()) {
    legs_known_ = column;
    return;
  }
  legs_known_ = speeds_after_;
  const int legs = wheel_.legs();
  std::vector<ExtendedWheel> stated;
  for (const Condition& c : conditions_)
    stated.emplace_back(wheel_, c.slope_deg * degree, law_, ContactSpread{}, Extension{});
  std::size_t found = 0;
  for (MeasuredRun& run : runs_) {
    std::vector<double> misfit(static_cast<std::size_t>(legs));
    for (int first = 0; first < legs && speeds_after_; ++first)
      for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) {
        if (!run.collisions[k].after) continue;
        const auto next =
            stated[run.condition].next({.leg = (first + static_cast<int>(k)) % legs}, *run.collisions[k].after);
        const double miss = next ? run.collisions[k + 1].before - *next : 1;
        misfit[static_cast<std::size_t>(first)] += std::min(1.0, miss * miss);
      }
    const auto best = std::min_element(misfit.begin(), misfit.end());
    double second = std::numeric_limits<double>::infinity();
    for (auto m = misfit.begin(); m != misfit.end(); ++m)
      if (m != best) second = std::min(second, *m);
    const double steps = static_cast<double>(run.collisions.size());
    const double variance = std::max({2 * noise_ * noise_, *best / steps, 1e-8});
    found += (second - *best) / (2 * variance) > 3;
    for (std::size_t k = 0; k < run.collisions.size(); ++k)
      run.collisions[k].context.leg =
          static_cast<int>((static_cast<std::size_t>(best - misfit.begin()) + k) % static_cast<std::size_t>(legs));
  }
  legs_known_ = speeds_after_ && static_cast<double>(found) >= 0.9 * static_cast<double>(runs_.size());
  if (legs_known_) {
    notes_.push_back("leg is missing: found for each trial from its stances, whose legs differ in length");
    return;
  }
  notes_.push_back("leg is missing: legs of the mean length are taken, and no effect of a single leg can be told");
  for (MeasuredRun& run : runs_)
    for (Measured& m : run.collisions) m.context.leg = 0;
  std::fill(wheel_.leg_length.begin(), wheel_.leg_length.end(), wheel_.mean_leg_length());
}

// Positions and times that were not measured follow from the geometry.
void WheelTransitions::complete_contexts() {
  for (MeasuredRun& run : runs_) {
    const ExtendedWheel stated(wheel_, conditions_[run.condition].slope_deg * degree, law_, ContactSpread{},
                               Extension{});
    double position = 0;
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      Measured& m = run.collisions[k];
      if (k > 0) {
        const Measured& previous = run.collisions[k - 1];
        position += stated.advance(previous.context.leg);
        if (!m.context.since_previous) {
          const auto from = previous.after ? previous.after : stated.back(previous.context, m.before);
          if (from && *from > 0) m.context.since_previous = stated.duration(previous.context, *from);
        }
      }
      if (std::isnan(m.context.position)) m.context.position = position;
    }
  }
}

void WheelTransitions::estimate_noise() {
  noise_stated_ = noise_ > 0;
  if (noise_stated_ || !speeds_after_) {
    noise_ = std::max(noise_, 1e-4);
    return;
  }
  std::vector<double> residual;
  for (const MeasuredRun& run : runs_) {
    const ExtendedWheel stated(wheel_, conditions_[run.condition].slope_deg * degree, law_, ContactSpread{},
                               Extension{});
    for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k)
      if (run.collisions[k].after)
        if (const auto next = stated.next(run.collisions[k].context, *run.collisions[k].after))
          residual.push_back(run.collisions[k + 1].before - *next);
  }
  if (residual.size() < 20) {
    noise_ = 0.01;
    return;
  }
  const auto median = [](std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
  };
  const double middle = median(residual);
  for (double& r : residual) r = std::abs(r - middle);
  noise_ = std::max(1e-4, 1.4826 * median(residual) / 1.2);  // of the sum of two speeds' noise, one damped to 0.65
  exact_stances_ = std::abs(middle) < 1e-5 && median(residual) < 1e-5;
  if (exact_stances_) {
    notes_.push_back("the stances repeat the model to rounding, as simulated ones do: they are left out");
    return;
  }
  notes_.push_back(fmt::format("no sensor noise is stated: {:.2g} rad/s taken from the stances", noise_));
}

void WheelTransitions::list_events() {
  for (std::size_t t = 0; t < runs_.size(); ++t) {
    const MeasuredRun& run = runs_[t];
    double elapsed = 0;
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const Measured& m = run.collisions[k];
      if (k > 0) elapsed += m.context.since_previous.value_or(0);
      Event event;
      event.trial = t;
      event.condition = run.condition;
      event.number = static_cast<int>(k) + 1;
      if (legs_known_) event.leg = m.context.leg;
      event.position = m.context.position;
      event.since_previous = m.context.since_previous;
      event.elapsed = elapsed;
      event.speed = m.before;
      const auto add = [&](EventKind kind) {
        event.kind = kind;
        events_.push_back(event);
      };
      if (k == 0 && conditions_[run.condition].initial_speed) add(EventKind::launch);
      const bool last = k + 1 == run.collisions.size();
      const bool after = m.after && *m.after > 0;
      if (after) add(EventKind::collision);
      if (!last) {
        if (after) event.speed = *m.after;
        if (!after || !exact_stances_) add(after ? EventKind::stance : EventKind::step);
      } else if (!after && run.outcome) {
        add(*run.outcome == dynamics::Outcome::rest ? EventKind::rest : EventKind::survival);
      }
    }
  }
}

void WheelTransitions::set_up_parameters() {
  const NominalContact& c = experiment_.contact;
  // Spreads are fitted by their logarithms.
  nuisances_ = {
      {"restitution_mean", c.restitution.mean, 0.08, 1e-4, 0.02, 0.98},
      {"log restitution_sd", std::log(std::max(0.01, c.restitution.sd)), 0.4, 1e-3, std::log(0.005), std::log(0.4)},
      {"friction_mean", c.friction.mean, 0.08, 1e-4, 0.02, 1.5},
      {"log friction_sd", std::log(std::max(0.01, c.friction.sd)), 0.4, 1e-3, std::log(0.005), std::log(0.5)},
      {"skew", 0, 0.06, 1e-3, -0.5, 0.5},
      {"tails", 0, 0.06, 1e-3, -0.4, 0.4}};
  WheelDesign design;
  design.legs = wheel_.legs();
  design.legs_known = legs_known_;
  design.times_known = experiment_.columns.time != Presence::none;
  design.speeds_after = speeds_after_;
  design.launches_stated = std::any_of(conditions_.begin(), conditions_.end(),
                                       [](const Condition& one) { return one.initial_speed.has_value(); });
  design.noise_stated = noise_stated_ || !speeds_after_;
  design.trials = runs_.size();
  design.leg_lengths = wheel_.leg_length;
  design.law = law_;
  design.furthest = 0.1;
  for (const MeasuredRun& run : runs_)
    design.furthest = std::max(design.furthest, run.collisions.back().context.position);
  design.ramp_length = 0;
  for (const Condition& one : conditions_) design.ramp_length = std::max(design.ramp_length, one.ramp_length);
  effects_ = wheel_candidates(design);
  for (const WheelCandidate& effect : effects_) candidates_.push_back(effect.candidate);
}

// Effects between trials, launches or collisions need some of them, whatever their size.
void WheelTransitions::name_what_is_too_few() {
  std::size_t launches = 0, successive = 0, away = 0;
  for (const Event& e : events_) {
    launches += e.kind == EventKind::launch;
    const bool contact = e.kind == EventKind::collision || e.kind == EventKind::step;
    successive += contact && e.number > 1;
    away += contact && e.position > 0;
  }
  const auto needs = [this](const char* effect, std::size_t least, std::size_t here, const char* of_what) {
    for (Candidate& c : candidates_)
      if (c.id == effect && c.undecidable.empty() && here < least)
        c.undecidable = fmt::format("it needs {} {}, and there {} {}", least, of_what, here == 1 ? "is" : "are", here);
  };
  // A mean and a spread, or a trend, and as many again to judge them by.
  needs("initial_speed", 5, launches, "launches where a launch speed is stated");
  needs("trial_spread", 5, runs_.size(), "trials");
  needs("trial_drift", 3, runs_.size(), "trials");
  needs("contact_memory", 2, successive, "collisions with one before them in their trial");
  needs("ramp_vibration", 2, successive, "collisions with one before them in their trial");
  needs("slope_profile", 2, away, "collisions away from the start");
  needs("friction_patch", 2, away, "collisions away from the start");
}

Extension WheelTransitions::extension(std::span<const Term> terms) const {
  Extension e;
  for (const Term& term : terms)
    for (const WheelCandidate& effect : effects_)
      if (effect.candidate.id == term.candidate->id) effect.apply(e, term.variant, term.values);
  return e;
}

std::vector<ExtendedWheel> WheelTransitions::wheels(std::span<const double> nuisance, const Extension& e) const {
  const ContactSpread contact{nuisance[0], std::exp(nuisance[1]), nuisance[2], std::exp(nuisance[3])};
  std::vector<ExtendedWheel> all;
  all.reserve(conditions_.size());
  for (const Condition& c : conditions_) all.emplace_back(wheel_, c.slope_deg * degree, law_, contact, e);
  return all;
}

Evaluation WheelTransitions::evaluate(std::span<const double> nuisance, std::span<const Term> terms) const {
  const Extension e = extension(terms);
  const std::vector<ExtendedWheel> wheel = wheels(nuisance, e);
  const ScoreTilt tilt(nuisance[4], nuisance[5]);
  Evaluation result;
  result.log_density.reserve(events_.size());
  result.score.reserve(events_.size());
  result.unit.reserve(events_.size());
  // A friction of the trial's own is integrated over: every node follows the trial, weighted by what it has explained.
  const bool spread = e.trial_friction_sd > 0;
  const std::size_t nodes = spread ? five_nodes.size() : 1;
  for (const MeasuredRun& run : runs_) {
    std::vector<SpeedFilter> filters(nodes, SpeedFilter(e, tilt, noise_));
    std::array<double, five_nodes.size()> log_weight{};
    for (std::size_t q = 0; q < nodes && spread; ++q) log_weight[q] = std::log(five_nodes[q].weight);
    const ExtendedWheel& at = wheel[run.condition];
    const auto add = [&](auto observe) {
      if (!spread) {
        const SpeedFilter::Out out = observe(filters[0], 0.0);
        result.log_density.push_back(out.log_density);
        result.score.push_back(out.score);
        result.unit.push_back(out.unit);
        return;
      }
      std::array<SpeedFilter::Out, five_nodes.size()> out;
      double largest = -std::numeric_limits<double>::infinity(), before = 0, now = 0, below = 0, unit = 0;
      for (std::size_t q = 0; q < nodes; ++q) {
        out[q] = observe(filters[q], five_nodes[q].score * e.trial_friction_sd);
        largest = std::max(largest, log_weight[q]);
      }
      for (std::size_t q = 0; q < nodes; ++q) {
        const double w = std::exp(log_weight[q] - largest);
        before += w;
        now += w * std::exp(out[q].log_density);
        below += w * normal_cdf(out[q].score);
        unit += w * out[q].unit;
        log_weight[q] += out[q].log_density;
      }
      result.log_density.push_back(now > 0 ? std::max(least_log_density, std::log(now / before)) : least_log_density);
      result.score.push_back(score_of_probability(below / before));
      result.unit.push_back(unit / before);
    };
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const Measured& m = run.collisions[k];
      const auto context = [&m](double shift) {
        StepContext c = m.context;
        c.friction_shift = shift;
        return c;
      };
      if (k == 0) {
        if (conditions_[run.condition].initial_speed)
          add([&](SpeedFilter& f, double) { return f.launch(conditions_[run.condition], m.before); });
        else
          for (SpeedFilter& f : filters) f.start(m.before);
      }
      const bool last = k + 1 == run.collisions.size();
      const bool after = m.after && *m.after > 0;
      if (after) add([&](SpeedFilter& f, double shift) { return f.collision(at, context(shift), *m.after); });
      if (!last) {
        const double next = run.collisions[k + 1].before;
        if (after && exact_stances_)
          for (SpeedFilter& f : filters) f.start(next);
        else if (after)
          add([&](SpeedFilter& f, double shift) { return f.stance(at, context(shift), next); });
        else
          add([&](SpeedFilter& f, double shift) { return f.step(at, context(shift), next); });
      } else if (!after && run.outcome) {
        const bool rested = *run.outcome == dynamics::Outcome::rest;
        add([&](SpeedFilter& f, double shift) { return f.rest(at, context(shift), rested); });
      }
    }
  }
  for (std::size_t i = 0; i < events_.size(); ++i) {
    if (events_[i].kind == EventKind::survival) result.score[i] = 0;
    if (!std::isfinite(result.log_density[i])) result.log_density[i] = least_log_density;
    if (!std::isfinite(result.score[i])) result.score[i] = -8;
  }
  return result;
}

template <class Visit>
MeasuredRun WheelTransitions::draw(const MeasuredRun& design, std::size_t index,
                                   const std::vector<ExtendedWheel>& wheels, const Extension& e,
                                   std::span<const double> nuisance, std::uint64_t seed, Visit visit) const {
  const ScoreTilt tilt(nuisance[4], nuisance[5]);
  const dynamics::TruncatedNormal restitution(nuisance[0], std::exp(nuisance[1]), 0, 1);
  const dynamics::TruncatedNormal friction(nuisance[2], std::exp(nuisance[3]), 0);
  const ExtendedWheel& wheel = wheels[design.condition];
  const double noise = std::sqrt(noise_ * noise_ + e.noise_sd * e.noise_sd);
  const auto score = [](double u) { return dynamics::normal_quantile(u); };
  const auto first = uniforms(seed, index, 0);
  MeasuredRun run = design;
  run.collisions.clear();
  const double shift = e.trial_friction_sd * score(first[0]);
  double omega = design.collisions.front().before;
  if (const auto& launch = conditions_[design.condition].initial_speed)
    omega =
        std::max(0.1, launch->mean + e.launch_shift + std::max(0.01, launch->sd + e.launch_widening) * score(first[1]));
  std::optional<double> eta_score, mu_score;
  const std::size_t most =
      std::max<std::size_t>(design.outcome == dynamics::Outcome::rest ? 16 : 1, design.collisions.size());
  run.outcome = dynamics::Outcome::max_collisions;
  for (std::size_t k = 0; k < most; ++k) {
    Measured m;
    const Measured& like = design.collisions[std::min(k, design.collisions.size() - 1)];
    m.context = like.context;
    if (k > 0) {
      const Measured& previous = run.collisions.back();
      m.context.leg = (previous.context.leg + 1) % wheel.legs();
      m.context.position = previous.context.position + wheel.advance(previous.context.leg);
    } else {
      m.context.since_previous.reset();
    }
    m.context.friction_shift = shift;
    const double rho = e.memory, left = std::sqrt(1 - rho * rho);
    std::optional<double> plus;
    for (std::uint64_t attempt = 0; attempt < 60; ++attempt) {  // the tilt by rejection
      const auto u = uniforms(seed, index, 1 + k * 64 + attempt);
      double a = score(u[0]), b = score(u[1]);
      if (rho != 0 && eta_score) {
        a = rho * *eta_score + left * a;
        b = rho * *mu_score + left * b;
      }
      plus =
          wheel.omega_plus(m.context, omega, {restitution.at_score(a), friction.at_score(b)}, u[2] < e.outlier_share);
      const double below = plus ? wheel.after_collision(m.context, omega, *plus).below : 0.0;
      if (attempt == 59 || u[3] * tilt.largest_density() <= std::exp(tilt.log_density(below))) {
        eta_score = a;
        mu_score = b;
        break;
      }
    }
    const double barrier = wheel.barrier(m.context);
    visit(omega, tilt.below(wheel.after_collision(m.context, omega, barrier).below));
    const auto error = uniforms(seed ^ 0x6e6f697365ULL, index, k);
    m.before = std::max(1e-3, omega + e.bias_before + noise * score(error[0]));
    const bool rests = !plus || *plus < barrier;
    if (like.after && plus) m.after = std::max(1e-3, *plus + e.bias_after + noise * score(error[1]));
    if (like.after && !plus) m.after.reset();
    run.collisions.push_back(m);
    const auto next = rests ? std::nullopt : wheel.next(m.context, *plus);
    if (!next) {
      run.outcome = dynamics::Outcome::rest;
      break;
    }
    if (k + 1 < most) {
      omega = *next;
      // The time of this stance belongs to the next collision.
    }
  }
  for (std::size_t k = 1; k < run.collisions.size(); ++k) {
    const Measured& previous = run.collisions[k - 1];
    const auto from = previous.after ? previous.after : wheel.back(previous.context, run.collisions[k].before);
    if (from && *from > 0) run.collisions[k].context.since_previous = wheel.duration(previous.context, *from);
  }
  for (Measured& m : run.collisions) m.context.friction_shift = 0;
  if (!design.outcome) run.outcome.reset();
  return run;
}

std::unique_ptr<TransitionModel> WheelTransitions::simulate(std::span<const double> nuisance,
                                                            std::span<const Term> terms, std::uint64_t seed) const {
  const Extension e = extension(terms);
  const std::vector<ExtendedWheel> wheel = wheels(nuisance, e);
  auto copy = std::make_unique<WheelTransitions>(*this);
  for (std::size_t t = 0; t < runs_.size(); ++t)
    copy->runs_[t] = draw(runs_[t], t, wheel, e, nuisance, seed, [](double, double) {});
  copy->events_.clear();
  copy->list_events();
  return copy;
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> WheelTransitions::alternatives(
    std::span<const double> nuisance, std::uint64_t seed) const {
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> all;
  const auto add = [&](std::string words, const std::function<void(WheelTransitions&)>& change) {
    WheelTransitions changed = *this;
    change(changed);
    all.emplace_back(std::move(words), changed.simulate(nuisance, {}, seed));
  };
  add("the same experiment once more", [](WheelTransitions&) {});
  const double steepest = dynamics::steepest_slope(wheel_.legs()) / degree;
  for (const double by : {-2.0, 2.0})
    if (std::all_of(conditions_.begin(), conditions_.end(),
                    [&](const Condition& c) { return c.slope_deg + by > 1 && c.slope_deg + by < steepest; }))
      add(fmt::format("slopes {} by 2 deg", by < 0 ? "flatter" : "steeper"), [by](WheelTransitions& w) {
        for (Condition& c : w.conditions_) c.slope_deg += by;
      });
  for (const double by : {-1.0, 1.0})
    add(fmt::format("launches {} by 1 rad/s", by < 0 ? "slower" : "faster"), [by](WheelTransitions& w) {
      for (Condition& c : w.conditions_)
        if (c.initial_speed) c.initial_speed->mean = std::max(1.0, c.initial_speed->mean + by);
      for (MeasuredRun& run : w.runs_)
        run.collisions.front().before = std::max(1.0, run.collisions.front().before + by);
    });
  if (!speeds_after_)
    add("the speed after each collision measured as well", [](WheelTransitions& w) {
      w.speeds_after_ = true;
      w.noise_ = std::max(w.noise_, 0.005);
      for (MeasuredRun& run : w.runs_)
        for (Measured& m : run.collisions) m.after = m.before;  // a value to be drawn anew
    });
  add("trials of twice as many collisions", [](WheelTransitions& w) {
    for (MeasuredRun& run : w.runs_) {
      const auto count = run.collisions.size();
      run.collisions.resize(2 * count, run.collisions.back());
    }
  });
  return all;
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> WheelTransitions::completed(
    std::span<const double> nuisance, std::uint64_t seed) const {
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> all;
  for (const auto& [column, experiment] : completed_experiments(experiment_))
    if (!(column == "leg" && legs_known_))
      all.emplace_back(column, WheelTransitions(experiment).simulate(nuisance, {}, seed));
  return all;
}

std::pair<double, double> WheelTransitions::rests() const {
  double at_risk = 0, rested = 0;
  for (const MeasuredRun& run : runs_) {
    if (!run.outcome) return {0, 0};
    at_risk += static_cast<double>(run.collisions.size());
    rested += *run.outcome == dynamics::Outcome::rest;
  }
  return {at_risk, rested};
}

double WheelTransitions::expected_steps(std::span<const double> nuisance, std::span<const Term> terms,
                                        std::uint64_t seed) const {
  const Extension e = extension(terms);
  const std::vector<ExtendedWheel> wheel = wheels(nuisance, e);
  double steps = 0, hazard = 0;
  constexpr std::size_t rounds = 4;
  for (std::size_t round = 0; round < rounds; ++round)
    for (std::size_t t = 0; t < runs_.size(); ++t)
      draw(runs_[t], t + round * runs_.size(), wheel, e, nuisance, seed, [&](double, double probability) {
        steps += 1;
        hazard += probability;
      });
  return hazard > 0 ? steps / hazard : std::numeric_limits<double>::infinity();
}

std::vector<Named> WheelTransitions::report_nuisances(std::span<const double> nuisance) const {
  return {{"restitution_mean", nuisance[0]},
          {"restitution_sd", std::exp(nuisance[1])},
          {"friction_mean", nuisance[2]},
          {"friction_sd", std::exp(nuisance[3])}};
}

}  // namespace

std::unique_ptr<TransitionModel> wheel_transitions(const Experiment& experiment) {
  return std::make_unique<WheelTransitions>(experiment);
}

}  // namespace metastable::analysis
