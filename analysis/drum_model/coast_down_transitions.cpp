#include "analysis/drum_model/coast_down_transitions.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/random.h"
#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;
constexpr double pi = std::numbers::pi;
constexpr double half_log_two_pi = 0.91893853320467274178;
constexpr double outlier_size = 6;  // losses of contact_outliers, in noises
constexpr double glitch_size = 10;  // spread of a revolution that the counter garbled, in noises

// What differs between runs of one rig is no cause: bearings warm up, air gets thinner. These are shares of the mean
// nominal loss.
constexpr double least_run_to_run = 0.001;            // no two runs are more alike
constexpr double farthest_run = 5;                    // sds from run to run: how far its terms go
constexpr double usual_ring = 0.3, largest_ring = 3;  // more loss where the rig rings
constexpr double largest_wander = 0.3;                // sd of the loss around its terms
constexpr double largest_noise = 1;                   // sd from one revolution to the next
constexpr std::size_t stretch = 10;                   // revolutions whose mean loss a fit starts from
constexpr double small_loss = 0.1;                    // of the nominal loss: less is called small
constexpr double slowest_share = 0.2;                 // of the speed seen: the filter's is never below

// Says where each nuisance stands in the list.
struct DrumSlot {
  enum : std::size_t {
    log_noise_sd,
    log_tick_jitter_s,
    log_tick_jitter_rad,
    logit_glitch_share,
    log_wander_sd,
    log_wander_revolutions,
    constant,
    linear,
    quadratic,
    resonance,
    log_resonance_rad_s,
    log_resonance_width,
    count
  };
};

struct Losses {
  double constant = 0, linear = 0, quadratic = 0;  // a revolution
  double noise = 0.1, sensor = 0, bias = 0;
  double memory = 0, drift = 0, outliers = 0;
  double wander_sd = 0, wander_kept = 0;              // of the loss; kept from one revolution to the next
  double jitter_s = 0, jitter_rad = 0;                // of the counter's ticks: of its clock, of its marks
  double glitches = 0;                                // share
  double ring = 0, ring_speed = 1, ring_width = 0.1;  // more loss around a speed [rad/s] at which the rig rings; width
                                                      // in its logarithm

  double ringing(double omega) const {
    if (ring == 0) return 0;
    const double off = std::log(std::max(1e-3, omega) / ring_speed) / ring_width;
    return ring * std::exp(-0.5 * off * off);
  }

  double jitter_squared(double omega) const {  // [s^2]
    return jitter_s * jitter_s + jitter_rad * jitter_rad / (omega * omega);
  }
};

// An effect as it is fitted, and what its value does to the losses.
struct DrumEffect {
  Candidate candidate;
  std::function<void(Losses&, double)> apply;
  std::optional<int> power = {};  // of the speed with which a torque grows
};

// Says by how much a late tick makes a revolution's omega^2 too small.
double slope_of_lateness(double omega) { return omega * omega * omega / pi; }

class CoastDownTransitions : public TransitionModel {
 public:
  explicit CoastDownTransitions(const Experiment& experiment);

  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return speeds_.size(); }
  std::size_t conditions() const override { return names_.size(); }
  int legs() const override { return 0; }
  bool time_tells() const override { return false; }  // a revolution's time is its speed
  std::string condition_name(std::size_t condition) const override { return names_.at(condition); }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  std::string step_name() const override { return "revolution"; }
  std::string unit_of(const std::string& effect, const std::string& parameter) const override {
    return dynamics::effect_unit(effect, parameter);
  }
  std::vector<EffectGroup> groups() const override {
    return {{"a torque that grows with speed", {"axle_drag_viscous", "air_drag"}},
            {"a constant or growing torque", {"rolling_resistance", "axle_drag_viscous", "air_drag"}},
            {"trials that differ", {"trial_drift", "trial_spread"}}};
  }
  std::string recalibration_id() const override { return std::string(dynamics::contact_distribution_id); }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string accepted_defects() const override { return stated_.accepted_defects; }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override;
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                            std::uint64_t seed) const override;
  std::vector<ChangedExperiment> alternatives(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                              std::uint64_t seed) const override;
  std::pair<double, double> rests() const override { return {0, 0}; }
  double expected_steps(std::span<const double>, std::span<const EffectTerm>, std::uint64_t) const override {
    return std::numeric_limits<double>::infinity();  // a drum does not fail by a step
  }
  std::vector<NamedValue> report_nuisances(std::span<const double> nuisance) const override {
    const Losses l = losses(nuisance, {});
    return {{"constant", l.constant},
            {"linear", l.linear},
            {"quadratic", l.quadratic},
            {"noise_sd", l.noise},
            {"tick_jitter_s", l.jitter_s},
            {"tick_jitter_rad", l.jitter_rad},
            {"glitch_share", l.glitches},
            {"wander_sd", l.wander_sd},
            {"wander_revolutions", std::exp(nuisance[DrumSlot::log_wander_revolutions])},
            {"resonance", l.ring},
            {"resonance_rad_s", l.ring_speed},
            {"resonance_width", l.ring_width}};
  }
  std::string position_unit() const override { return "rad"; }
  std::string recalibrated() const override { return "losses within what differs from run to run, and noise,"; }
  bool refits_noise() const override { return true; }
  std::vector<FitStart> starts(std::span<const EffectTerm> terms) const override;
  std::string size_in_words(std::span<const EffectTerm> terms) const override;

 private:
  Losses losses(std::span<const double> nuisance, std::span<const EffectTerm> terms) const;
  struct Stretches {
    std::vector<double> omega, beyond;  // [rad/s], of omega^2 a revolution
  };
  Stretches stretches() const;
  std::vector<FitStart> starts_of_scatter(FitStart start, const Eigen::VectorXd& left,
                                          const std::vector<double>& omega) const;
  void set_up_nuisances();
  void set_up_effects();
  const DrumEffect& effect_of(const EffectTerm& term) const;
  void list_events();

  RevolutionLoss stated_;
  double inertia_ = 1, sensor_ = 0;
  double typical_speed_ = 0;                 // root mean square [rad/s]
  double typical_loss_ = 0;                  // nominal, there [rad^2/s^2]
  std::vector<std::vector<double>> speeds_;  // by trial
  std::vector<std::size_t> condition_;       // by trial
  std::vector<std::string> names_;
  bool fresh_runs_ = false;  // a later trial starts faster than an earlier one
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<DrumEffect> effects_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

CoastDownTransitions::CoastDownTransitions(const Experiment& experiment) : stated_(experiment.loss) {
  if (experiment.system != System::coast_down)
    throw std::invalid_argument("coast_down_transitions: the experiment is a rimless wheel");
  if (experiment.rotor_inertia) inertia_ = *experiment.rotor_inertia;
  if (!experiment.rotor_inertia) notes_.push_back("rotor.inertia_kg_m2 is missing: torques are those of 1 kg m^2");
  if (!stated_.run_to_run)
    notes_.push_back(fmt::format("loss.run_to_run is missing: losses that differ by {:.0f} % from run to run are taken",
                                 100 * usual_run_to_run));
  sensor_ = experiment.sensor.noise_sd.value_or(0);
  for (const Condition& c : experiment.conditions) names_.push_back(c.id);
  for (const MeasuredTrial& trial : experiment.trials) {
    condition_.push_back(trial.condition);
    auto& speeds = speeds_.emplace_back();
    for (const MeasuredCollision& c : trial.collisions) speeds.push_back(c.omega_minus);
  }
  for (std::size_t t = 1; t < speeds_.size(); ++t)
    if (condition_[t] == condition_[t - 1] && speeds_[t].front() > speeds_[t - 1].front()) fresh_runs_ = true;
  list_events();
  if (events_.empty())
    throw std::invalid_argument("collisions.csv: no trial has two revolutions: there is no transition");
  set_up_nuisances();
  set_up_effects();
}

// Counters jitter and garble revolutions, and the loss of a run wanders a little and differs from the next one's (air,
// temperature): none of it is a cause, so all are refitted with every hypothesis, within what is physical. Nobody
// states how a counter errs or a loss wanders: a guess is no part of the model as given, whose noise may be all that
// there is.
void CoastDownTransitions::set_up_nuisances() {
  for (const Event& e : events_) typical_speed_ += e.speed * e.speed / static_cast<double>(events_.size());
  typical_speed_ = std::max(1e-3, std::sqrt(typical_speed_));
  const double w = typical_speed_;
  typical_loss_ = std::max(1e-6, stated_.at(w));
  const double noise = std::clamp(stated_.noise_sd, 1e-6, 0.5 * typical_loss_);
  double slowest = w, fastest = w;
  for (const Event& e : events_) {
    slowest = std::min(slowest, std::max(1e-3, e.speed));
    fastest = std::max(fastest, e.speed);
  }
  using Slot = DrumSlot;
  nuisances_.resize(Slot::count);
  const auto set = [this](std::size_t slot, Nuisance nuisance) { nuisances_[slot] = std::move(nuisance); };
  set(Slot::log_noise_sd, {"log noise_sd", std::log(noise), 2, 1e-3, -14, std::log(largest_noise * typical_loss_)});
  set(Slot::log_tick_jitter_s, {"log tick_jitter_s", std::log(3e-6), 4, 1e-2, std::log(1e-9), std::log(1e-3)});
  set(Slot::log_tick_jitter_rad, {"log tick_jitter_rad", std::log(3e-6), 4, 1e-2, std::log(1e-9), std::log(0.01)});
  set(Slot::logit_glitch_share, {"logit glitch_share", -5, 2, 1e-2, -12, -4});
  set(Slot::log_wander_sd,
      {"log wander_sd", std::log(0.1 * noise), 4, 1e-2, -20, std::log(largest_wander * typical_loss_)});
  set(Slot::log_wander_revolutions, {"log wander_revolutions", std::log(20), 1, 1e-2, std::log(2), std::log(500)});
  for (const std::size_t slot : {Slot::log_tick_jitter_s, Slot::log_tick_jitter_rad, Slot::logit_glitch_share,
                                 Slot::log_wander_sd, Slot::log_wander_revolutions})
    nuisances_[slot].assumed = true;
  // The terms of the loss differ from run to run by shares of the mean nominal loss.
  const double run_to_run = std::max(least_run_to_run, stated_.run_to_run.value_or(usual_run_to_run));
  const auto term = [&](const char* name, double scale) {
    const double sd = run_to_run * typical_loss_, most = farthest_run * sd;
    return Nuisance{name, 0, sd / scale, 1e-2 * sd / scale, -most / scale, most / scale};
  };
  set(Slot::constant, term("constant", 1));
  set(Slot::linear, term("linear", w));
  set(Slot::quadratic, term("quadratic", w * w));
  set(Slot::resonance,
      {"resonance", 0, usual_ring * typical_loss_, 1e-3 * typical_loss_, 0, largest_ring * typical_loss_});
  set(Slot::log_resonance_rad_s, {"log resonance_rad_s", std::log(w), 0.5, 1e-3, std::log(slowest), std::log(fastest)});
  set(Slot::log_resonance_width, {"log resonance_width", std::log(0.1), 0.5, 1e-2, std::log(0.03), std::log(0.3)});
}

void CoastDownTransitions::list_events() {
  for (std::size_t t = 0; t < speeds_.size(); ++t) {
    for (std::size_t k = 0; k + 1 < speeds_[t].size(); ++k) {
      Event e;
      e.kind = EventKind::step;
      e.trial = t;
      e.condition = condition_[t];
      e.number = static_cast<int>(k) + 1;
      e.speed = speeds_[t][k];
      if (k > 0) e.since_previous = 4 * pi / (speeds_[t][k - 1] + speeds_[t][k]);
      e.position = 2 * pi * static_cast<double>(k);
      events_.push_back(e);
    }
  }
}

// Torques take loss by a power of the speed; below zero: less loss than the nominal model ascribes. The other effects
// keep the catalogue's ranges.
void CoastDownTransitions::set_up_effects() {
  const double per_torque = 4 * pi / inertia_;  // work 2 pi T, kinetic energy I omega^2 / 2
  const auto parameter = [](const char* id) { return dynamics::effect_info(id).parameters.front(); };
  const auto add = [&](const char* id, FreeParameter free, std::function<void(Losses&, double)> apply) {
    DrumEffect effect;
    effect.candidate.id = id;
    effect.candidate.parameters = {free};
    effect.candidate.report = [name = parameter(id).name](const Values&, const Values& v) {
      return std::vector<NamedValue>{{name, v[0]}};
    };
    effect.apply = std::move(apply);
    effects_.push_back(std::move(effect));
  };
  const auto torque = [&](const char* id, int power, double step, double Losses::*loss) {
    const double most = parameter(id).upper;
    add(id, {0, -most, most, step * inertia_}, [loss, per_torque](Losses& l, double v) { l.*loss += per_torque * v; });
    effects_.back().power = power;
  };
  const auto in_range = [&](const char* id, double Losses::*field, double step, double try_at = 0) {
    const dynamics::EffectParameter p = parameter(id);
    add(id, {0, p.lower, p.upper, step, try_at}, [field](Losses& l, double v) { l.*field = v; });
  };
  torque("axle_drag_viscous", 1, 1e-5, &Losses::linear);
  torque("rolling_resistance", 0, 1e-4, &Losses::constant);
  torque("air_drag", 2, 1e-7, &Losses::quadratic);
  in_range("contact_memory", &Losses::memory, 1e-3);
  in_range("trial_drift", &Losses::drift, 1e-3);
  if (!fresh_runs_)
    effects_.back().candidate.undecidable =
        "the trials are blocks of one run: a drift cannot be told from a loss that varies with the speed";
  in_range("contact_outliers", &Losses::outliers, 1e-4, 0.01);
  // It is fitted as a variance: there the likelihood has a slope at nothing.
  add("sensor_noise", {0, 0, std::pow(parameter("sensor_noise").upper, 2), 1e-9, 1e-7},
      [](Losses& l, double v) { l.sensor = std::hypot(l.sensor, std::sqrt(std::max(0.0, v))); });
  effects_.back().candidate.report = [name = parameter("sensor_noise").name](const Values&, const Values& v) {
    return std::vector<NamedValue>{{name, std::sqrt(std::max(0.0, v[0]))}};
  };
  in_range("sensor_bias", &Losses::bias, 1e-4);
  for (const DrumEffect& effect : effects_) candidates_.push_back(effect.candidate);
}

const DrumEffect& CoastDownTransitions::effect_of(const EffectTerm& term) const {
  const auto found = std::find_if(effects_.begin(), effects_.end(),
                                  [&](const DrumEffect& effect) { return effect.candidate.id == term.candidate->id; });
  if (found == effects_.end()) throw std::logic_error("coast_down_transitions: no effect " + term.candidate->id);
  return *found;
}

Losses CoastDownTransitions::losses(std::span<const double> nuisance, std::span<const EffectTerm> terms) const {
  Losses l{.constant = stated_.constant, .linear = stated_.linear, .quadratic = stated_.quadratic};
  l.constant += nuisance[DrumSlot::constant];
  l.linear += nuisance[DrumSlot::linear];
  l.quadratic += nuisance[DrumSlot::quadratic];
  l.ring = nuisance[DrumSlot::resonance];
  l.ring_speed = std::exp(nuisance[DrumSlot::log_resonance_rad_s]);
  l.ring_width = std::exp(nuisance[DrumSlot::log_resonance_width]);
  l.noise = std::exp(nuisance[DrumSlot::log_noise_sd]);
  l.sensor = sensor_;
  l.jitter_s = std::exp(nuisance[DrumSlot::log_tick_jitter_s]);
  l.jitter_rad = std::exp(nuisance[DrumSlot::log_tick_jitter_rad]);
  l.glitches = 1 / (1 + std::exp(-nuisance[DrumSlot::logit_glitch_share]));
  l.wander_sd = std::exp(nuisance[DrumSlot::log_wander_sd]);
  l.wander_kept = std::exp(-1 / std::exp(nuisance[DrumSlot::log_wander_revolutions]));
  for (const EffectTerm& term : terms) effect_of(term).apply(l, term.values[0]);
  return l;
}

// Holds what one transition says.
struct Seen {
  double log_density, score, unit;
};

// A Kalman filter follows one trial. Its state is omega^2, by how much the loss has wandered, and the jitter of the
// tick that began the last period and of the one that ended it; a tick too late makes one period long and the next one
// short.
class LossFilter {
 public:
  // `constant` is the trial's own.
  LossFilter(const Losses& losses, double constant, double first_speed) : l_(losses), constant_(constant) {
    spread_(1, 1) = l_.wander_sd * l_.wander_sd;
    begin(first_speed * first_speed);
    const double slope = slope_of_lateness(first_speed);
    spread_(3, 3) = l_.jitter_squared(first_speed);
    spread_(0, 3) = spread_(3, 0) = slope * spread_(3, 3);  // a late end of the period: seen too slow
  }
  Seen see(double omega);

 private:
  // What was seen becomes the speed.
  void begin(double squared) {
    const double omega = std::sqrt(squared), slope = slope_of_lateness(omega);
    state_[0] = squared;
    spread_.row(0).setZero();
    spread_.col(0).setZero();
    spread_(0, 0) = 4 * squared * l_.sensor * l_.sensor + 2 * slope * slope * l_.jitter_squared(omega);
  }
  void move(double next);

  const Losses& l_;
  double constant_;
  Eigen::Vector4d state_ = Eigen::Vector4d::Zero();
  Eigen::Matrix4d spread_ = Eigen::Matrix4d::Zero();
  double carried_ = 0;
};

void LossFilter::move(double next) {
  const double root = std::max(std::sqrt(std::max(0.0, state_[0])), slowest_share * next);
  Eigen::Matrix4d move = Eigen::Matrix4d::Zero();
  move(0, 0) = 1 - l_.quadratic - l_.linear / (2 * root);
  move(0, 1) = -1;
  move(1, 1) = l_.wander_kept;
  move(2, 3) = 1;
  const double wandered = state_[1];
  state_ << state_[0] - constant_ - l_.linear * root - l_.quadratic * state_[0] - l_.ringing(root) - wandered +
                l_.memory * carried_,
      l_.wander_kept * wandered, state_[3], 0;
  spread_ = move * spread_ * move.transpose();
  spread_(0, 0) += l_.noise * l_.noise * (1 - l_.memory * l_.memory);
  spread_(1, 1) += l_.wander_sd * l_.wander_sd * (1 - l_.wander_kept * l_.wander_kept);
  spread_(3, 3) = l_.jitter_squared(next);
}

Seen LossFilter::see(double omega) {
  move(omega);
  const double squared = omega * omega, slope = slope_of_lateness(omega), jacobian = 2 * omega;
  const Eigen::Vector4d look(1, 0, slope, -slope);
  const Eigen::Vector4d cross = spread_ * look;
  const double total = look.dot(cross) + 4 * squared * l_.sensor * l_.sensor;
  const double residual = squared - look.dot(state_);
  if (!(total > 0) || !std::isfinite(total) || !std::isfinite(residual)) {  // beyond the filter's reach
    begin(squared);
    carried_ = 0;
    return {-1e4, 0, 1};
  }
  const double sd = std::sqrt(total);
  double z = residual / sd;
  double log_density = -0.5 * z * z - half_log_two_pi - std::log(sd);
  // Mixes in a rare kind of revolution; returns its share given what was seen.
  const auto mix = [&](double share, double centre, double extra) {
    const double wide = std::sqrt(total + extra * extra), far = (residual - centre) / wide;
    const double below = (1 - share) * dynamics::normal_cdf(z) + share * dynamics::normal_cdf(far);
    const double usual = std::log1p(-share) + log_density;
    const double other = std::log(share) - 0.5 * far * far - half_log_two_pi - std::log(wide);
    log_density = std::max(usual, other) + std::log1p(std::exp(-std::abs(usual - other)));
    z = dynamics::normal_quantile(std::clamp(below, 1e-15, 1 - 1e-15));
    return std::exp(other - log_density);
  };
  const double garbled = mix(l_.glitches, 0, glitch_size * l_.noise);
  if (l_.outliers > 0) mix(l_.outliers, -outlier_size * l_.noise, outlier_size * l_.noise);
  const Seen seen{log_density + std::log(jacobian), std::clamp(z, -1e4, 1e4), sd / jacobian};
  if (garbled > 0.5) {  // it says nothing of the loss
    begin(squared);
    carried_ = 0;
    return seen;
  }
  const Eigen::Vector4d gain = cross / total;
  state_ += gain * residual;
  spread_ -= gain * cross.transpose();
  carried_ = gain[0] * residual + l_.memory * carried_;
  return seen;
}

Evaluation CoastDownTransitions::evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const {
  const Losses l = losses(nuisance, terms);
  const auto true_speed = [&](double reported) { return std::max(1e-3, reported - l.bias); };
  Evaluation result;
  for (std::size_t t = 0; t < speeds_.size(); ++t) {
    const auto& speeds = speeds_[t];
    if (speeds.size() < 2) continue;
    const double run = speeds_.size() > 1 ? static_cast<double>(t) / static_cast<double>(speeds_.size() - 1) : 0;
    LossFilter filter(l, l.constant * (1 + l.drift * run), true_speed(speeds[0]));
    for (std::size_t k = 1; k < speeds.size(); ++k) {
      const Seen seen = filter.see(true_speed(speeds[k]));
      result.log_density.push_back(seen.log_density);
      result.score.push_back(seen.score);
      result.unit.push_back(seen.unit);
    }
  }
  return result;
}

// Returns the mean loss of short stretches beyond the nominal one, with their mean speeds.
CoastDownTransitions::Stretches CoastDownTransitions::stretches() const {
  Stretches all;
  for (const auto& speeds : speeds_) {
    const std::size_t span = std::min(stretch, speeds.size() - std::min<std::size_t>(1, speeds.size()));
    for (std::size_t k = 0; span > 0 && k + span < speeds.size(); k += span) {
      const double w = 0.5 * (speeds[k] + speeds[k + span]);
      const double lost = (speeds[k] * speeds[k] - speeds[k + span] * speeds[k + span]) / static_cast<double>(span);
      all.omega.push_back(w);
      all.beyond.push_back(lost - stated_.constant - stated_.linear * w - stated_.quadratic * w * w);
    }
  }
  return all;
}

// Lists starts with the effects of `start`, whose nuisances are nominal: what is left may be several things.
// @param left  loss of each stretch beyond what its effects take @param omega  its mean speed
std::vector<FitStart> CoastDownTransitions::starts_of_scatter(FitStart start, const Eigen::VectorXd& left,
                                                              const std::vector<double>& omega) const {
  const double scatter = std::sqrt(left.squaredNorm() / static_cast<double>(left.size()));
  const auto set = [&](std::size_t slot, double value) {
    const Nuisance& n = nuisances_[slot];
    start.nuisance[slot] = std::clamp(std::log(std::max(1e-9, value)), n.lower, n.upper);
  };
  std::vector<FitStart> all;
  // The scatter may be a wandering loss, short or long, or noise.
  set(DrumSlot::log_wander_sd, scatter);
  for (const double revolutions : {5.0, 50.0}) {
    set(DrumSlot::log_wander_revolutions, revolutions);
    all.push_back(start);
  }
  // Or it may be that the stretch that lost most is where the rig rings.
  Eigen::Index most = 0;
  const double ring = left.maxCoeff(&most);
  start.nuisance[DrumSlot::resonance] = std::clamp(ring, 0.0, nuisances_[DrumSlot::resonance].upper);
  set(DrumSlot::log_resonance_rad_s, omega[static_cast<std::size_t>(most)]);
  set(DrumSlot::log_wander_sd, 0.3 * scatter);
  all.push_back(start);
  set(DrumSlot::log_wander_revolutions, 5);
  set(DrumSlot::log_noise_sd, scatter);
  all.push_back(start);
  start.nuisance = nominal_values(*this);
  set(DrumSlot::log_noise_sd, 3 * scatter);
  all.push_back(start);
  return all;
}

// Starts from the mean loss of short stretches beyond the nominal one, by least squares on the terms: close to what
// they are in the end, where the slopes of the likelihood without them point anywhere.
std::vector<FitStart> CoastDownTransitions::starts(std::span<const EffectTerm> terms) const {
  const double per_torque = 4 * pi / inertia_;
  std::vector<std::size_t> fitted;
  std::vector<int> power;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const std::optional<int> p = effect_of(terms[i]).power;
    if (!p) continue;
    fitted.push_back(i);
    power.push_back(*p);
  }
  const auto [omega, beyond] = stretches();
  if (omega.size() < fitted.size() + 2) return {};
  const auto rows = static_cast<Eigen::Index>(omega.size());
  const Eigen::Map<const Eigen::ArrayXd> w(omega.data(), rows);
  const Eigen::Map<const Eigen::VectorXd> y(beyond.data(), rows);
  Eigen::MatrixXd columns(rows, static_cast<Eigen::Index>(power.size()));
  for (std::size_t c = 0; c < power.size(); ++c) columns.col(static_cast<Eigen::Index>(c)) = w.pow(power[c]);
  Eigen::VectorXd left = y;
  Eigen::VectorXd sizes(columns.cols());
  if (!power.empty()) {
    sizes = columns.colPivHouseholderQr().solve(y);
    left -= columns * sizes;
  }
  FitStart start{nominal_values(*this), {}};
  for (const EffectTerm& term : terms) start.values.push_back(term.values);
  for (std::size_t c = 0; c < fitted.size(); ++c) {
    const FreeParameter& p = terms[fitted[c]].candidate->parameters[0];
    start.values[fitted[c]][0] = std::clamp(sizes[static_cast<Eigen::Index>(c)] / per_torque, p.lower, p.upper);
  }
  return starts_of_scatter(std::move(start), left, omega);
}

std::string CoastDownTransitions::size_in_words(std::span<const EffectTerm> terms) const {
  const std::vector<double> nominal = nominal_values(*this);
  // What the terms add to the nominal loss, as a mean over the measured revolutions, is their size.
  const auto mean_loss = [&](std::span<const EffectTerm> some) {
    const Losses l = losses(nominal, some);
    double sum = 0;
    for (const Event& e : events_) sum += l.constant + l.linear * e.speed + l.quadratic * e.speed * e.speed;
    return sum / static_cast<double>(events_.size());
  };
  const double stated = mean_loss({}), all = mean_loss(terms) - stated;
  if (!(stated > 0) || all == 0) return {};
  std::vector<std::string> parts;
  for (const EffectTerm& term : terms)
    if (const double one = mean_loss({&term, 1}) - stated; one != 0)
      parts.push_back(fmt::format("{} {:+.0f} %", term.candidate->id, 100 * one / stated));
  return fmt::format("Of the loss that the nominal model states over these speeds that is {}{}.",
                     fmt::join(parts, ", "), std::abs(all) < small_loss * stated ? ": a small difference" : "");
}

std::unique_ptr<TransitionModel> CoastDownTransitions::simulate(std::span<const double> nuisance,
                                                                std::span<const EffectTerm> terms,
                                                                std::uint64_t seed) const {
  const Losses l = losses(nuisance, terms);
  auto copy = std::make_unique<CoastDownTransitions>(*this);
  for (std::size_t t = 0; t < speeds_.size(); ++t) {
    const double run = speeds_.size() > 1 ? static_cast<double>(t) / static_cast<double>(speeds_.size() - 1) : 0;
    const auto normal = [&](std::uint64_t event, std::size_t which) {
      const auto bits = r123::Philox4x64()({{t, event, 0x636f617374, 0}}, {{seed, 0}});
      return dynamics::normal_quantile(unit_interval(bits[which]));
    };
    double wandered = l.wander_sd * normal(2000000, 3);
    double squared = speeds_[t].empty() ? 0 : speeds_[t][0] * speeds_[t][0], carried = 0;
    for (std::size_t k = 0; k < speeds_[t].size(); ++k) {
      const double omega = std::sqrt(std::max(0.0, squared));
      copy->speeds_[t][k] =
          std::max(0.0, omega + l.bias + l.sensor * normal(k, 1) -
                            omega * omega / (2 * pi) * std::sqrt(l.jitter_squared(std::max(1e-3, omega))) *
                                (normal(k + 1, 3) - normal(k, 3)));
      carried = l.memory * carried + l.noise * std::sqrt(1 - l.memory * l.memory) * normal(k, 0);
      const bool rare = dynamics::normal_cdf(normal(k, 2)) < l.outliers;
      squared -= l.constant * (1 + l.drift * run) + wandered + l.ringing(omega) + l.linear * omega +
                 l.quadratic * squared - carried + (rare ? outlier_size * l.noise * (1 + normal(k + 1000000, 0)) : 0);
      wandered = l.wander_kept * wandered +
                 l.wander_sd * std::sqrt(1 - l.wander_kept * l.wander_kept) * normal(k + 3000000, 3);
    }
  }
  copy->events_.clear();
  copy->list_events();
  return copy;
}

std::vector<ChangedExperiment> CoastDownTransitions::alternatives(std::span<const double> nuisance,
                                                                  std::span<const EffectTerm> terms,
                                                                  std::uint64_t seed) const {
  const std::vector<double> n(nuisance.begin(), nuisance.end());
  const std::vector<EffectTerm> t(terms.begin(), terms.end());
  std::vector<ChangedExperiment> all;
  all.push_back({"", 0, "the same experiment once more", [this, n, t, seed] { return simulate(n, t, seed); }});
  for (const double by : {0.5, 1.5})
    all.push_back({"speed_times", by, by < 1 ? "runs at half the speed" : "runs at one and a half times the speed",
                   [this, n, t, seed, by] {
                     CoastDownTransitions changed = *this;
                     for (auto& speeds : changed.speeds_)
                       for (double& speed : speeds) speed *= by;
                     return changed.simulate(n, t, seed);
                   }});
  return all;
}

}  // namespace

std::unique_ptr<TransitionModel> coast_down_transitions(const Experiment& experiment) {
  return std::make_unique<CoastDownTransitions>(experiment);
}

}  // namespace metastable::analysis
