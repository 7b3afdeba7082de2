#include "dynamics/return_map/loss_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "dynamics/wheel/coulomb_law.h"

namespace metastable::dynamics {
namespace {

constexpr double farthest_drawn = 38;  // [sd]: beyond it probabilities underflow

// Takes Newton's step from mu, halving the bracket where it leaves it; sign * value rises through the root.
[[gnu::always_inline]] inline double newton_step(double sign, double value, double derivative, double& low,
                                                 double& high, double& mu) {
  (sign * value < 0 ? low : high) = mu;
  double next = mu - value / derivative;
  if (!(next > low && next < high)) next = 0.5 * (low + high);
  const double moved = std::abs(next - mu);
  mu = next;
  return moved;
}

}  // namespace

LossCurve::LossCurve(const WheelMap& map, double state, int phase) {
  const TruncatedNormal& friction = map.noise().friction();
  const ContactModel& model = map.contact_model();
  const Collision c = map.collision(phase, 1);
  coulomb_ = model.law == Law::coulomb;
  const double x = c.contact_x, y = c.contact_y;
  const double r2 = coulomb_ ? coulomb_squared_gyration(model, c) : c.landing_length * c.landing_length;
  const double scale = 1 / (model.mass * r2), coupling = (coulomb_ ? std::abs(x * y) : x * y) * scale;
  normal_0_ = (r2 + x * x) * scale;
  normal_1_ = coupling;
  tangential_0_ = coupling;
  tangential_1_ = (r2 + y * y) * scale;
  const Stance& stance = map.stance(phase);
  lowest_ = stance.barrier + stance.gain;
  gain_ = stance.gain;
  inertia_ = stance.inertia;
  available_ = map.stance(phase > 0 ? phase - 1 : map.phases() - 1).inertia * state;
  energy_ = c.chord * c.chord * state / 2;
  if (coulomb_) {
    kept_ = 1 - model.rebound_lost;
  } else {
    pull_ = model.mass * model.gravity * std::sin(c.slope_rad) * c.chord * std::sqrt(state) / 2;
    stretch_ = std::sqrt(model.contact_mass / model.ramp_stiffness);
  }
  end_ = friction.constant() ? std::numeric_limits<double>::infinity()
                             : std::max(friction.lower(), friction.mean()) + farthest_drawn * friction.sd();
  if (coulomb_)
    end_ = tangential_0_ / tangential_1_;
  else if (normal_1_ > 0)
    end_ = std::min(end_, normal_0_ / normal_1_);
}

LossCurve::Coefficients LossCurve::at(double restitution) const {
  const double one_more = 1 + restitution;
  Coefficients k{energy_ * (1 - kept_ * restitution * restitution), energy_ * one_more * one_more, 0};
  if (coulomb_) {
    k.b = -k.b;
  } else {
    const double log_eta = std::log(std::max(restitution, std::numeric_limits<double>::min()));
    k.c = pull_ * one_more * stretch_ * std::sqrt(std::numbers::pi * std::numbers::pi + log_eta * log_eta);
  }
  return k;
}

double LossCurve::loss(const Coefficients& k, double mu) const {
  const double inverse = 1 / (normal_0_ - normal_1_ * mu), product = mu * (tangential_1_ * mu - tangential_0_);
  return inverse * (k.a + product * (k.b * inverse + k.c));
}

double LossCurve::slope(const Coefficients& k, double mu) const {
  const double inverse = 1 / (normal_0_ - normal_1_ * mu);
  return stationary_polynomial(k, mu) * inverse * inverse * inverse;
}

// Returns d loss / d mu times A^3.
double LossCurve::stationary_polynomial(const Coefficients& k, double mu) const {
  const double normal = normal_0_ - normal_1_ * mu, product = mu * (tangential_1_ * mu - tangential_0_),
               rise = 2 * tangential_1_ * mu - tangential_0_;
  return k.a * normal_1_ * normal + k.b * (rise * normal + 2 * product * normal_1_) +
         k.c * normal * (rise * normal + product * normal_1_);
}

LossCurve::Extreme LossCurve::extreme(const Coefficients& k, double guess) const {
  const double sign = coulomb_ ? -1 : 1;
  double low = 0, high = end_;
  if (sign * stationary_polynomial(k, low) >= 0) return {low, loss(k, low)};
  if (sign * stationary_polynomial(k, high) <= 0) return {high, loss(k, high)};
  double mu = guess > low && guess < high ? guess : 0.5 * (low + high);
  for (int i = 0; i < 100; ++i) {
    const double normal = normal_0_ - normal_1_ * mu, product = mu * (tangential_1_ * mu - tangential_0_),
                 rise = 2 * tangential_1_ * mu - tangential_0_, both = rise * normal + product * normal_1_;
    const double value = k.a * normal_1_ * normal + k.b * (both + product * normal_1_) + k.c * normal * both;
    const double derivative =
        normal_1_ * (k.b * rise - k.a * normal_1_ - k.c * both) + 2 * tangential_1_ * normal * (k.b + k.c * normal);
    if (value == 0) break;
    const double moved = newton_step(sign, value, derivative, low, high, mu);
    if (moved <= 1e-9 * mu || high - low <= 4e-16 * high) break;  // the next step would move it by less than rounding
  }
  return {mu, loss(k, mu)};
}

// Newton's method works on (loss - level) A^2.
double LossCurve::root(const Coefficients& k, double level, double from, double to, bool rising, double guess) const {
  const double sign = rising ? 1 : -1;
  double low = from, high = to, mu = guess > low && guess < high ? guess : 0.5 * (low + high);
  for (int i = 0; i < 100; ++i) {
    const double normal = normal_0_ - normal_1_ * mu, product = mu * (tangential_1_ * mu - tangential_0_),
                 rise = 2 * tangential_1_ * mu - tangential_0_;
    const double value = (k.a - level * normal) * normal + product * (k.b + k.c * normal);
    const double derivative = normal_1_ * (2 * level * normal - k.a - k.c * product) + rise * (k.b + k.c * normal);
    if (value == 0) break;
    const double moved = newton_step(sign, value, derivative, low, high, mu);
    // An error e becomes e^2 / (2 times the distance to the other root's side).
    const double apart = std::min(mu - from, to - mu);
    if (moved * moved <= 1e-16 * mu * apart || high - low <= 2e-16 * high || moved <= 4e-16 * mu) break;
  }
  return mu;
}

}  // namespace metastable::dynamics
