#include "analysis/wheel_model/speed_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/numerics/square.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

using dynamics::ExtendedWheel;
using dynamics::Extension;
using dynamics::normal_cdf;
using dynamics::normal_density;
using dynamics::StepContext;

constexpr double log_sqrt_two_pi = 0.91893853320467274178;
// The noise that a collision's density is blurred by [rad/s]; less than this is half a per cent of its variance.
constexpr double least_blur = 0.012;

struct Node {  // of Gauss-Hermite's rule for the standard normal
  double score, weight;
};
constexpr std::array<Node, 3> three_nodes{
    {{-1.7320508075688772, 1.0 / 6}, {0, 2.0 / 3}, {1.7320508075688772, 1.0 / 6}}};

constexpr std::array<Node, 7> seven_nodes{{{-3.7504397177257425, 5.48268855972218e-4},
                                           {-2.3667594107345415, 0.030757123967586497},
                                           {-1.1544053947399682, 0.24012317860501271},
                                           {0, 0.45714285714285714},
                                           {1.1544053947399682, 0.24012317860501271},
                                           {2.3667594107345415, 0.030757123967586497},
                                           {3.7504397177257425, 5.48268855972218e-4}}};

// Spreads of omega+ by contacts, in sds of the noise: up to the first the sum over seven contacts is good to half a per
// cent, from the second on that over three speeds is.
constexpr double few_contacts = 1.2, few_speeds = 2;
// Restitution and friction spread omega+ widely beside the noise [rad/s] if the sd of each is so many times the noise.
constexpr double surely_wide = 10;
constexpr double least_spread = 1e-12;  // [rad/s]

double log_normal(double z) { return -0.5 * z * z - log_sqrt_two_pi; }

}  // namespace

ContactNodes contact_nodes(const dynamics::ContactSpread& contact) {
  constexpr double negligible = 1e-6;
  const dynamics::TruncatedNormal restitution(contact.restitution_mean, contact.restitution_sd, 0, 1);
  const dynamics::TruncatedNormal friction(contact.friction_mean, contact.friction_sd, 0);
  std::array<double, seven_nodes.size()> eta{}, mu{};
  for (std::size_t i = 0; i < seven_nodes.size(); ++i) {
    eta[i] = restitution.at_score(seven_nodes[i].score);
    mu[i] = friction.at_score(seven_nodes[i].score);
  }
  ContactNodes nodes;
  for (std::size_t i = 0; i < seven_nodes.size(); ++i)
    for (std::size_t j = 0; j < seven_nodes.size(); ++j)
      if (const double weight = seven_nodes[i].weight * seven_nodes[j].weight; weight > negligible)
        nodes.all.push_back({{eta[i], mu[j]}, weight});
  const double eta_median = restitution.at_score(0), mu_median = friction.at_score(0);
  nodes.aside = {{{restitution.at_score(-1), mu_median},
                  {restitution.at_score(1), mu_median},
                  {eta_median, friction.at_score(-1)},
                  {eta_median, friction.at_score(1)}}};
  nodes.narrower = std::min(contact.restitution_sd, contact.friction_sd);
  return nodes;
}

double score_of_probability(double below) { return dynamics::normal_quantile(std::clamp(below, 1e-15, 1 - 1e-15)); }

SpeedFilter::SpeedFilter(const Extension& extension, const ScoreTilt& tilt, double noise, double slack,
                         double law_error, double slide_error, const MemoryOfScores& memory,
                         std::shared_ptr<const ContactNodes> contacts)
    : extension_(extension),
      tilt_(tilt),
      noise2_(noise * noise + extension.sensor.noise_sd * extension.sensor.noise_sd),
      slack2_(slack * slack),
      law2_(law_error * law_error),
      slide_error_(slide_error),
      memory_(extension.contact.memory),
      // Where scores go mostly with the squares of contacts' a negative memory may turn them the other way: that is not
      // followed.
      told_(memory_ == 0 ? 0 : std::max(0.0, memory(memory_) / memory_)),
      blurred_(noise > least_blur || extension.sensor.noise_sd > least_blur),
      contacts_(std::move(contacts)) {
  if (contacts_ && contacts_->narrower > surely_wide * std::sqrt(noise2_)) contacts_.reset();
}

SpeedFilter::Out SpeedFilter::launch(const Condition& condition, double reported) {
  const double mean = condition.initial_speed->mean + extension_.sensor.launch_shift;
  const double sd = std::max(0.01, condition.initial_speed->sd + extension_.sensor.launch_widening);
  const double seen = reported - extension_.sensor.bias_before, total = std::sqrt(sd * sd + noise2_);
  const double z = (seen - mean) / total, gain = sd * sd / (total * total);
  mean_ = mean + gain * (seen - mean);
  variance_ = gain * noise2_;
  return {log_normal(z) - std::log(total), z, total};
}

void SpeedFilter::start(double reported) {
  mean_ = reported - extension_.sensor.bias_before;
  variance_ = noise2_;
  before_.reset();
}

SpeedFilter::Out SpeedFilter::collision(const ExtendedWheel& wheel, const StepContext& context, double reported) {
  const double seen = std::max(1e-3, reported - extension_.sensor.bias_after);
  const Before before{mean_, variance_};
  const Out out = transition(wheel, context, seen, 1, std::sqrt(noise2_ + dynamics::square(seen / mean_) * variance_));
  update(wheel, out, seen, seen, 1);
  if (wheel.settles()) before_ = before;
  return out;
}

SpeedFilter::Out SpeedFilter::stance(const ExtendedWheel& wheel, const StepContext& context, const Touch& touch) {
  if (wheel.settles()) return settled_step(wheel, context, touch);
  const double seen = touch.speed - extension_.sensor.bias_before;
  const auto next = wheel.next(context, mean_);
  if (!next) {
    start(touch.speed);
    return {least_log_density, -8, 0.1};
  }
  const double slope = mean_ / *next, predicted = slope * slope * variance_;
  const double total = std::sqrt(predicted + noise2_), z = (seen - *next) / total;
  const double gain = predicted / (predicted + noise2_);
  mean_ = *next + gain * (seen - *next);
  variance_ = (1 - gain) * predicted;
  return {log_normal(z) - std::log(total), z, total};
}

SpeedFilter::Out SpeedFilter::step(const ExtendedWheel& wheel, const StepContext& context, const Touch& touch) {
  if (wheel.settles()) return settled_step(wheel, context, touch);
  const double seen = std::max(1e-3, touch.speed - extension_.sensor.bias_before);
  const auto plus = wheel.back(context, seen);
  if (!plus) {
    start(touch.speed);
    return {least_log_density, -8, 0.1};
  }
  // d omega+ / d next omega- is seen / plus without torques, which change it.
  const double step = 1e-4 * seen;
  const auto faster = wheel.back(context, seen + step), slower = wheel.back(context, seen - step);
  const double rate = faster && slower ? (*faster - *slower) / (2 * step) : seen / *plus;
  Out out = transition(wheel, context, *plus, rate,
                       std::sqrt(noise2_ * rate * rate + dynamics::square(*plus / mean_) * variance_));
  // It did go on: omega+ was beyond the barrier, of which the noise of the reported speed tells only so much.
  const double beyond = (*plus - wheel.barrier(context)) / std::max(1e-3, std::sqrt(noise2_ + slack2_) * rate);
  if (beyond < 8)
    out.log_density = std::max(least_log_density, out.log_density + std::log(std::max(1e-300, normal_cdf(beyond))));
  update(wheel, out, seen, *plus, rate);
  return out;
}

// Takes the landing up to the next touch. Where omega+ was seen its contact is known all but one number, and only what
// that leaves is weighed here; else the landing is the collision.
SpeedFilter::Out SpeedFilter::settled_step(const ExtendedWheel& wheel, const StepContext& context, const Touch& touch) {
  constexpr double carried_on = 0.5;  // d next / d omega-, times the ratio of the two
  const double reported = std::max(1e-3, touch.speed - extension_.sensor.bias_before);
  const double seen = std::max(1e-3, reported + touch.law_error);
  const Before before = before_.value_or(Before{mean_, variance_});
  const double rate = carried_on * before.mean / seen;
  const double blur = std::sqrt(noise2_ + law2_ + rate * rate * before.variance);
  const dynamics::NextTouch next = wheel.at_next_touch(
      context, before.mean, {before_ ? std::optional(mean_) : std::nullopt, touch.slide, slide_error_}, blur, seen);
  Out out;
  if (before_) {
    const double density = next.speed.density, z = score_of_probability(next.speed.below);
    out = {density > 0 ? std::max(least_log_density, std::log(density)) : least_log_density, z,
           density > 0 ? std::clamp(normal_density(z) / density, 1e-4, 2.0) : 0.3};
  } else {
    out = weighed(next.speed.density * std::exp(tilt_.log_density(next.speed.below)), tilt_.below(next.speed.below), 1);
  }
  // The sensor's part of what was missed is taken back: left in, it would be missed again, with the other sign, at the
  // next touch. Mean and variance of a normal error follow from the log density of what was seen (Tweedie's formula).
  constexpr double surest = 0.02;
  mean_ = std::max(1e-2, reported + noise2_ * next.slope);
  variance_ = noise2_ * std::clamp(1 + noise2_ * next.curvature, surest, 1.0);
  before_.reset();
  out.log_density = std::max(least_log_density, out.log_density + std::log(std::max(1e-300, next.slide_density)));
  return out;
}

double SpeedFilter::chance_below(const ExtendedWheel& wheel, const StepContext& context, double bound) const {
  if (before_) return std::clamp(wheel.rest_share(context, before_->mean, mean_), 1e-300, 1.0);
  if (wheel.settles() && bound >= wheel.barrier(context))
    return conditional(tilt_.below(wheel.rest_share(context, mean_, std::nullopt)));
  if (wheel.certain()) {
    const double plus = wheel.omega_plus(context, mean_, {}, false).value_or(0);
    return std::max(1e-300,
                    normal_cdf((bound - plus) / std::sqrt(noise2_ + dynamics::square(plus / mean_) * variance_)));
  }
  const Narrow narrow = narrowness(wheel, context, std::sqrt(noise2_ + variance_));
  double below = 0;
  if (narrow.share > 0) {
    const double slope = bound / mean_, sd = std::max(least_spread, slope * std::sqrt(variance_));
    visit_contacts(wheel, context, [&](double weight, const std::optional<double>& at) {
      below += narrow.share * weight * (at ? normal_cdf((bound - *at) / sd) : 1.0);
    });
  }
  if (narrow.share < 1) below += (1 - narrow.share) * tilt_.below(wheel.after_collision(context, mean_, bound).below);
  return conditional(below);
}

SpeedFilter::Out SpeedFilter::rest(const ExtendedWheel& wheel, const StepContext& context, double bound, bool rested) {
  const double given = chance_below(wheel, context, bound);
  Out out;
  out.log_density = std::max(least_log_density, rested ? std::log(given) : std::log1p(-given));
  if (rested) out.score = score_of_probability(given / 2);
  out.unit = 0.3;
  return out;
}

// Returns mean and standard deviation of the next score, given those before.
std::pair<double, double> SpeedFilter::foreseen() const {
  const double told = told_ * shown_;
  return {std::sqrt(told) * memory_ * recalled_, std::sqrt(1 - told * memory_ * memory_ * (1 - doubt_))};
}

// What contacts remember is a state of its own, of which a score tells a part: it outlasts what the last score says.
void SpeedFilter::remember(double score) {
  const double told = told_ * shown_, part = std::sqrt(told), before = memory_ * recalled_;
  const double variance = 1 - memory_ * memory_ * (1 - doubt_);
  const double gain = part * variance / (told * variance + 1 - told);
  recalled_ = before + gain * (score - part * before);
  doubt_ = (1 - gain * part) * variance;
}

// The chance of a lower score is that given the collisions before.
double SpeedFilter::conditional(double below) const {
  if (memory_ == 0) return std::clamp(below, 1e-300, 1.0);
  const auto [mean, sd] = foreseen();
  return std::max(1e-300, normal_cdf((score_of_probability(below) - mean) / sd));
}

// What is seen of a certain omega+ differs by the errors of both speeds.
SpeedFilter::Out SpeedFilter::certain_transition(const ExtendedWheel& wheel, const StepContext& context, double plus,
                                                 double rate, double blur) const {
  const auto expected = wheel.omega_plus(context, mean_, {}, false);
  if (!expected) return {least_log_density, -8, 0.1};
  const double z = std::clamp((plus - *expected) / blur, -1e3, 1e3);
  return {std::max(least_log_density, log_normal(z) - std::log(blur / rate)), std::clamp(z, -8.0, 8.0), blur / rate};
}

SpeedFilter::Out SpeedFilter::transition(const ExtendedWheel& wheel, const StepContext& context, double plus,
                                         double rate, double blur) {
  if (wheel.certain()) return certain_transition(wheel, context, plus, rate, blur);
  narrow_ = narrowness(wheel, context, blur);
  if (narrow_.share > 0) sum_over_contacts(wheel, context, plus, rate, narrow_);
  shown_ = narrow_.share > 0 ? 1 - narrow_.share * blur * blur / (narrow_.variance + blur * blur) : 1;
  if (narrow_.share == 1) return weighed(narrow_.density, narrow_.below, rate);
  double density = 0, below = 0;
  const auto add = [&](double at, double weight) {
    if (at <= 0) return;
    const dynamics::SpeedDensity d = wheel.after_collision(context, mean_, at);
    density += weight * d.density * std::exp(tilt_.log_density(d.below));
    below += weight * tilt_.below(d.below);
  };
  if (!blurred_) {
    add(plus, 1);
  } else {
    for (const Node& node : three_nodes) add(plus + node.score * blur, node.weight);
  }
  const double share = narrow_.share;
  return share > 0 ? weighed(share * narrow_.density + (1 - share) * density,
                             share * narrow_.below + (1 - share) * below, rate)
                   : weighed(density, below, rate);
}

// Returns by how much contacts spread omega+, and the share that the sum over contacts has where the noise of omega+ is
// `blur` [rad/s].
SpeedFilter::Narrow SpeedFilter::narrowness(const ExtendedWheel& wheel, const StepContext& context, double blur) const {
  Narrow narrow;
  if (!contacts_ || wheel.settles() || wheel.certain()) return narrow;
  std::array<double, 4> plus{};
  for (std::size_t i = 0; i < plus.size(); ++i)
    plus[i] = wheel.omega_plus(context, mean_, contacts_->aside[i], false).value_or(0);
  narrow.variance = (dynamics::square(plus[1] - plus[0]) + dynamics::square(plus[3] - plus[2])) / 4;
  const double way = std::clamp((few_speeds - std::sqrt(narrow.variance) / blur) / (few_speeds - few_contacts), 0., 1.);
  narrow.share = way * way * (3 - 2 * way);
  return narrow;
}

// Calls visit(weight, omega+) for contacts that stand for all, as the hypothesis tilts them; where no energy is left
// there is no omega+.
template <class Visit>
void SpeedFilter::visit_contacts(const ExtendedWheel& wheel, const StepContext& context, Visit visit) const {
  struct At {
    double weight;
    std::optional<double> plus;
  };
  std::vector<At> found;
  found.reserve(2 * contacts_->all.size());
  const double outliers = extension_.contact.outlier_share;
  double mean = 0, square = 0, all = 0;
  const auto add = [&](double weight, const dynamics::Contact& contact, bool outlier) {
    found.push_back({weight, wheel.omega_plus(context, mean_, contact, outlier)});
    const double plus = found.back().plus.value_or(0);
    mean += weight * plus;
    square += weight * plus * plus;
    all += weight;
  };
  for (const ContactNodes::Node& node : contacts_->all) {
    add((1 - outliers) * node.weight, node.contact, false);
    if (outliers > 0) add(outliers * node.weight, node.contact, true);
  }
  mean /= all;
  const double sd = std::max(least_spread, std::sqrt(std::max(0.0, square / all - mean * mean)));
  double tilted = 0;
  for (At& at : found) {
    at.weight *= std::exp(tilt_.log_density(normal_cdf((at.plus.value_or(0) - mean) / sd)));
    tilted += at.weight;
  }
  for (const At& at : found) visit(at.weight / tilted, at.plus);
}

// Each contact takes the belief of omega- to one of omega+, against which the noisy omega+ is held.
// @param rate  d omega+ by what the noise is of
void SpeedFilter::sum_over_contacts(const ExtendedWheel& wheel, const StepContext& context, double plus, double rate,
                                    Narrow& narrow) const {
  const double noise = noise2_ * rate * rate, before = dynamics::square(plus / mean_) * variance_;
  const double total = noise + before, sd = std::sqrt(total), gain = before / total;
  double first = 0, second = 0, nearest = 0, distance = std::numeric_limits<double>::infinity();
  visit_contacts(wheel, context, [&](double weight, const std::optional<double>& at) {
    if (!at) {
      narrow.below += weight;
      return;
    }
    const double z = (plus - *at) / sd, density = weight * normal_density(z) / sd, believed = *at + gain * (plus - *at);
    narrow.density += density;
    narrow.below += weight * normal_cdf(z);
    first += density * (believed - plus);
    second += density * dynamics::square(believed - plus);
    if (std::abs(z) < distance) {
      distance = std::abs(z);
      nearest = believed;
    }
  });
  narrow.mean = nearest;
  narrow.left = gain * noise;
  if (!(narrow.density > 1e-200)) return;
  narrow.mean = plus + first / narrow.density;
  narrow.left += std::max(0.0, second / narrow.density - dynamics::square(first / narrow.density));
}

// Returns what a transition's density and distribution function say, given the collisions before.
SpeedFilter::Out SpeedFilter::weighed(double density, double below, double rate) {
  Out out;
  out.log_density = density > 0 ? std::max(least_log_density, std::log(density * rate)) : least_log_density;
  const double z = score_of_probability(below);
  out.score = z;
  out.unit = density > 0 ? std::clamp(normal_density(z) / (density * rate), 1e-4, 2.0) : 0.3;
  if (memory_ != 0) {
    const auto [mean, sd] = foreseen();
    out.score = (z - mean) / sd;
    out.log_density += log_normal(out.score) - log_normal(z) - std::log(sd);
    remember(z);
  }
  return out;
}

// Applies the prior that the transition gives, taken as normal around what was seen. The unit of a certain one is that
// of what is seen, noise included. What a sum over contacts says of omega+ is taken as it is.
// @param plus, rate  omega+ that was seen, and its change with what was seen
void SpeedFilter::update(const ExtendedWheel& wheel, const Out& out, double seen, double plus, double rate) {
  const double prior = std::max(0.0, out.unit * out.unit - (wheel.certain() ? noise2_ : 0)),
               gain = noise2_ / (noise2_ + prior);
  mean_ = std::max(1e-2, seen - gain * std::clamp(out.score, -4.0, 4.0) * out.unit);
  variance_ = gain * prior;
  const double share = narrow_.share;
  if (!(share > 0) || wheel.certain()) return;
  constexpr double farthest = 4;  // in sds of the noise: what lies beyond pulls no more
  const double reach = farthest * std::sqrt(noise2_);
  const double believed = seen + std::clamp((narrow_.mean - plus) / rate, -reach, reach);
  mean_ = std::max(1e-2, (1 - share) * mean_ + share * believed);
  variance_ = (1 - share) * variance_ + share * narrow_.left / (rate * rate);
}

}  // namespace metastable::analysis
