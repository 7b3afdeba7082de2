#include "analysis/coast_down_transitions.h"

#include <Random123/philox.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "analysis/random.h"
#include "dynamics/truncated_normal.h"

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;
constexpr double pi = std::numbers::pi;
constexpr double log_sqrt_two_pi = 0.91893853320467274178;
constexpr double outlier_size = 6;  // losses of contact_outliers, in noises
constexpr double glitch_size = 10;  // spread of a revolution that the counter garbled, in noises

struct Losses {
  double constant = 0, linear = 0, quadratic = 0;  // a revolution
  double noise = 0.1, sensor = 0, bias = 0;
  double memory = 0, drift = 0, trial_sd = 0, outliers = 0;
  double jitter = 0;    // of the counter's ticks [s]
  double glitches = 0;  // share
};

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
  const std::vector<std::string>& notes() const override { return notes_; }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const Term> terms) const override;
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const Term> terms,
                                            std::uint64_t seed) const override;
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> alternatives(std::span<const double> nuisance,
                                                                                     std::uint64_t seed) const override;
  std::pair<double, double> rests() const override { return {0, 0}; }
  double expected_steps(std::span<const double>, std::span<const Term>, std::uint64_t) const override {
    return std::numeric_limits<double>::infinity();  // a drum does not fail by a step
  }
  std::vector<Named> report_nuisances(std::span<const double> nuisance) const override {
    return {{"noise_sd", std::exp(nuisance[0])},
            {"tick_jitter_s", std::exp(nuisance[1])},
            {"glitch_share", 1 / (1 + std::exp(-nuisance[2]))},
            {"block_loss_sd", std::exp(nuisance[3])}};
  }

 private:
  Losses losses(std::span<const double> nuisance, std::span<const Term> terms) const;
  void set_up_candidates();
  void list_events();

  RevolutionLoss stated_;
  double inertia_ = 1, sensor_ = 0;
  std::vector<std::vector<double>> speeds_;  // by trial
  std::vector<std::size_t> condition_;       // by trial
  std::vector<std::string> names_;
  bool fresh_runs_ = false;  // a later trial starts faster than an earlier one
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

CoastDownTransitions::CoastDownTransitions(const Experiment& experiment) : stated_(experiment.loss) {
  if (experiment.system != System::coast_down)
    throw std::invalid_argument("coast_down_transitions: the experiment is a rimless wheel");
  if (experiment.rotor_inertia) inertia_ = *experiment.rotor_inertia;
  if (!experiment.rotor_inertia) notes_.push_back("rotor.inertia_kg_m2 is missing: torques are those of 1 kg m^2");
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
  // Counters jitter and garble revolutions, and blocks of one run differ a little (air, temperature): none of it is a
  // cause, so all are refitted with every hypothesis.
  nuisances_ = {{"log noise_sd", std::log(std::max(1e-6, stated_.noise_sd)), 2, 1e-3, -14, 7},
                {"log tick_jitter_s", std::log(3e-6), 4, 1e-2, std::log(1e-9), std::log(0.1)},
                {"logit glitch_share", -5, 2, 1e-2, -12, -2},
                {"log block_loss_sd", std::log(0.3 * std::max(1e-6, stated_.noise_sd)), 4, 1e-2, -20, 5}};
  set_up_candidates();
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

void CoastDownTransitions::set_up_candidates() {
  const auto add = [this](std::string id, std::string name, FreeParameter p, double power = 1) {
    Candidate c;
    c.id = std::move(id);
    c.parameters = {p};
    c.report = [name = std::move(name), power](const Values&, const Values& v) {
      return std::vector<Named>{{name, power == 1 ? v[0] : std::pow(std::max(0.0, v[0]), power)}};
    };
    candidates_.push_back(std::move(c));
  };
  const double large = 1e3 * inertia_;
  add("axle_drag_viscous", "n_m_s", {0, -large, large, 1e-5 * inertia_});
  add("rolling_resistance", "torque_n_m", {0, -large, large, 1e-4 * inertia_});
  add("air_drag", "n_m_s2", {0, -large, large, 1e-7 * inertia_});
  add("contact_memory", "correlation", {0, -0.95, 0.95, 1e-3});
  add("trial_drift", "relative_change", {0, -5, 20, 1e-3});
  add("contact_outliers", "share", {0, 0, 0.5, 1e-4, 0.01});
  add("sensor_noise", "sd_rad_s", {0, 0, 1, 1e-9, 1e-7}, 0.5);
  add("sensor_bias", "bias_rad_s", {0, -5, 5, 1e-4});
  for (Candidate& c : candidates_)
    if (c.id == "trial_drift" && !fresh_runs_)
      c.undecidable = "the trials are blocks of one run: a drift cannot be told from a loss that varies with the speed";
}

Losses CoastDownTransitions::losses(std::span<const double> nuisance, std::span<const Term> terms) const {
  Losses l{.constant = stated_.constant, .linear = stated_.linear, .quadratic = stated_.quadratic};
  l.noise = std::exp(nuisance[0]);
  l.sensor = sensor_;
  l.jitter = std::exp(nuisance[1]);
  l.glitches = 1 / (1 + std::exp(-nuisance[2]));
  l.trial_sd = std::exp(nuisance[3]);
  const double per_torque = 4 * pi / inertia_;  // work 2 pi T, kinetic energy I omega^2 / 2
  for (const Term& term : terms) {
    const std::string& id = term.candidate->id;
    const double v = term.values[0];
    if (id == "axle_drag_viscous") l.linear += per_torque * v;
    if (id == "rolling_resistance") l.constant += per_torque * v;
    if (id == "air_drag") l.quadratic += per_torque * v;
    if (id == "contact_memory") l.memory = v;
    if (id == "trial_drift") l.drift = v;
    if (id == "contact_outliers") l.outliers = v;
    if (id == "sensor_noise") l.sensor = std::hypot(l.sensor, std::sqrt(std::max(0.0, v)));
    if (id == "sensor_bias") l.bias = v;
  }
  return l;
}

Evaluation CoastDownTransitions::evaluate(std::span<const double> nuisance, std::span<const Term> terms) const {
  const Losses l = losses(nuisance, terms);
  Evaluation result;
  for (std::size_t t = 0; t < speeds_.size(); ++t) {
    const auto& speeds = speeds_[t];
    const double run = speeds_.size() > 1 ? static_cast<double>(t) / static_cast<double>(speeds_.size() - 1) : 0;
    const double constant = l.constant * (1 + l.drift * run);
    // Kalman filter. State: omega^2, the block's own loss, and the jitter of the tick that began the last period and of
    // the one that ended it; a tick too late makes one period long and the next one short.
    Eigen::Vector4d state = Eigen::Vector4d::Zero();
    Eigen::Matrix4d spread = Eigen::Matrix4d::Zero();
    spread(1, 1) = l.trial_sd * l.trial_sd;
    const double jitter2 = l.jitter * l.jitter;
    double carried = 0;
    for (std::size_t k = 0; k + 1 < speeds.size(); ++k) {
      const double omega = std::max(1e-3, speeds[k] - l.bias);
      if (k == 0) {
        const double slope = 2 * omega * omega * omega / (2 * pi);
        state[0] = omega * omega;
        spread(0, 0) = 4 * state[0] * l.sensor * l.sensor + 2 * slope * slope * jitter2;
        spread(3, 3) = jitter2;
        spread(0, 3) = spread(3, 0) = slope * jitter2;  // a late end of the period: seen too slow
      }
      const double root = std::sqrt(std::max(1e-6, state[0]));
      Eigen::Matrix4d move = Eigen::Matrix4d::Zero();
      move(0, 0) = 1 - l.quadratic - l.linear / (2 * root);
      move(0, 1) = -1;
      move(1, 1) = 1;
      move(2, 3) = 1;
      const double kept = state[1];
      state << state[0] - constant - l.linear * root - l.quadratic * state[0] - kept + l.memory * carried, kept,
          state[3], 0;
      spread = move * spread * move.transpose();
      spread(0, 0) += l.noise * l.noise * (1 - l.memory * l.memory);
      spread(3, 3) = jitter2;
      const double next = std::max(1e-3, speeds[k + 1] - l.bias), seen = next * next;
      const double slope = 2 * next * next * next / (2 * pi);
      const Eigen::Vector4d look(1, 0, slope, -slope);
      const Eigen::Vector4d cross = spread * look;
      const double total = look.dot(cross) + 4 * seen * l.sensor * l.sensor;
      const double sd = std::sqrt(total), residual = seen - look.dot(state), jacobian = 2 * next;
      double z = residual / sd;
      double log_density = -0.5 * z * z - log_sqrt_two_pi - std::log(sd);
      // Mixes in a rare kind of revolution; returns its share given what was seen.
      const auto mix = [&](double share, double centre, double extra) {
        const double wide = std::sqrt(total + extra * extra), far = (residual - centre) / wide;
        const double below = (1 - share) * dynamics::normal_cdf(z) + share * dynamics::normal_cdf(far);
        const double usual = std::log1p(-share) + log_density;
        const double other = std::log(share) - 0.5 * far * far - log_sqrt_two_pi - std::log(wide);
        log_density = std::max(usual, other) + std::log1p(std::exp(-std::abs(usual - other)));
        z = dynamics::normal_quantile(std::clamp(below, 1e-15, 1 - 1e-15));
        return std::exp(other - log_density);
      };
      const double garbled = mix(l.glitches, 0, glitch_size * l.noise);
      if (l.outliers > 0) mix(l.outliers, -outlier_size * l.noise, outlier_size * l.noise);
      result.log_density.push_back(log_density + std::log(jacobian));
      result.score.push_back(std::clamp(z, -1e4, 1e4));
      result.unit.push_back(sd / jacobian);
      if (garbled > 0.5) {  // it says nothing of the loss: what was seen becomes the speed
        state[0] = seen;
        spread.row(0).setZero();
        spread.col(0).setZero();
        spread(0, 0) = 4 * seen * l.sensor * l.sensor + 2 * slope * slope * jitter2;
        carried = 0;
        continue;
      }
      const Eigen::Vector4d gain = cross / total;
      state += gain * residual;
      spread -= gain * cross.transpose();
      carried = gain[0] * residual + l.memory * carried;
    }
  }
  return result;
}

std::unique_ptr<TransitionModel> CoastDownTransitions::simulate(std::span<const double> nuisance,
                                                                std::span<const Term> terms, std::uint64_t seed) const {
  const Losses l = losses(nuisance, terms);
  auto copy = std::make_unique<CoastDownTransitions>(*this);
  for (std::size_t t = 0; t < speeds_.size(); ++t) {
    const double run = speeds_.size() > 1 ? static_cast<double>(t) / static_cast<double>(speeds_.size() - 1) : 0;
    const auto normal = [&](std::uint64_t event, std::size_t which) {
      const auto bits = r123::Philox4x64()({{t, event, 0x636f617374, 0}}, {{seed, 0}});
      return dynamics::normal_quantile(unit_interval(bits[which]));
    };
    const double own = l.trial_sd * normal(2000000, 3);
    double squared = speeds_[t].empty() ? 0 : speeds_[t][0] * speeds_[t][0], carried = 0;
    for (std::size_t k = 0; k < speeds_[t].size(); ++k) {
      const double omega = std::sqrt(std::max(0.0, squared));
      copy->speeds_[t][k] = std::max(0.0, omega + l.bias + l.sensor * normal(k, 1) -
                                              omega * omega / (2 * pi) * l.jitter * (normal(k + 1, 3) - normal(k, 3)));
      carried = l.memory * carried + l.noise * std::sqrt(1 - l.memory * l.memory) * normal(k, 0);
      const bool rare = dynamics::normal_cdf(normal(k, 2)) < l.outliers;
      squared -= l.constant * (1 + l.drift * run) + own + l.linear * omega + l.quadratic * squared - carried +
                 (rare ? outlier_size * l.noise * (1 + normal(k + 1000000, 0)) : 0);
    }
  }
  copy->events_.clear();
  copy->list_events();
  return copy;
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> CoastDownTransitions::alternatives(
    std::span<const double> nuisance, std::uint64_t seed) const {
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> all;
  all.emplace_back("the same experiment once more", simulate(nuisance, {}, seed));
  for (const double by : {0.5, 1.5}) {
    CoastDownTransitions changed = *this;
    for (auto& speeds : changed.speeds_)
      for (double& speed : speeds) speed *= by;
    all.emplace_back(by < 1 ? "runs at half the speed" : "runs at one and a half times the speed",
                     changed.simulate(nuisance, {}, seed));
  }
  return all;
}

}  // namespace

std::unique_ptr<TransitionModel> coast_down_transitions(const Experiment& experiment) {
  return std::make_unique<CoastDownTransitions>(experiment);
}

}  // namespace metastable::analysis
