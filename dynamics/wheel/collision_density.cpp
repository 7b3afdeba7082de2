#include "dynamics/wheel/collision_density.h"

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dynamics/wheel/coulomb_law.h"
#include "dynamics/wheel/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr double reach = 4.6;  // scores beyond it weigh 4e-6

constexpr double finest = 0.05, widest = 0.8;  // spacing of nodes

// Nodes in the standard score between `from` and `to`, with the normal's probabilities: equally spaced where the normal
// fades out at both ends (then the rule converges exponentially), panels of Gauss-Legendre nodes where it is cut.
template <class Add>
void score_nodes(double from, double to, double spacing, Add add) {
  if (from <= -reach && to >= reach) {
    const int half = static_cast<int>(std::ceil(reach / spacing));
    for (int i = -half; i <= half; ++i) add(i * spacing, spacing * normal_density(i * spacing));
    return;
  }
  from = std::max(from, -reach);
  to = std::min(to, reach);
  if (!(from < to)) return;
  using Rule = boost::math::quadrature::gauss<double, 30>;
  const int panels = std::max(1, static_cast<int>(std::ceil((to - from) / (30 * spacing))));
  const double half = (to - from) / (2 * panels);
  for (int panel = 0; panel < panels; ++panel) {
    const double middle = from + half * (2 * panel + 1);
    for (std::size_t i = 0; i < Rule::abscissa().size(); ++i) {
      const double offset = half * Rule::abscissa()[i], weight = half * Rule::weights()[i];
      add(middle - offset, weight * normal_density(middle - offset));
      if (offset != 0) add(middle + offset, weight * normal_density(middle + offset));
    }
  }
}

// The spacing of nodes in one variable's score where the other's density is known in closed form: along the line of
// equal loss the product of both densities is narrower than that variable's by what it contributes to the loss.
// @param own, other  change of the loss with a standard deviation of either
double node_spacing(double own, double other) {
  const double ratio = own / std::max(1e-12, other);
  return std::clamp(1.25 / std::sqrt(1 + ratio * ratio), finest, widest);
}

// Density and upper tail of mu = ratio N(mean, sd^2), mu >= 0.
class Friction {
 public:
  Friction(const ContactSpread& contact, const CollisionChange& change)
      : mean_((contact.friction_mean + change.friction_shift) * change.friction_ratio),
        scale_(1 / (contact.friction_sd * change.friction_ratio)),
        inverse_mass_(1 / normal_cdf(mean_ * scale_)) {}
  double density(double mu) const { return normal_density((mu - mean_) * scale_) * scale_ * inverse_mass_; }
  double above(double mu) const { return mu <= 0 ? 1 : normal_cdf((mean_ - mu) * scale_) * inverse_mass_; }
  double below(double mu) const { return 1 - above(mu); }
  double mean() const { return mean_; }
  double sd() const { return 1 / scale_; }

 private:
  double mean_, scale_, inverse_mass_;
};

}  // namespace

CollisionDensity::CollisionDensity(const ContactModel& model, const ContactSpread& contact)
    : model_(model), contact_(contact) {
  if (model.law == Law::plastic)
    throw std::invalid_argument("law: plastic has no restitution and no friction that could be distributed");
  if (!(contact.restitution_sd > 0 && contact.friction_sd > 0))
    throw std::invalid_argument("contact: the sds of restitution and friction must be > 0");
  const double from = -contact.restitution_mean / contact.restitution_sd;
  const double to = (1 - contact.restitution_mean) / contact.restitution_sd;
  restitution_mass_ = normal_cdf(to) - normal_cdf(from);
  double spacing = widest;
  for (std::vector<Node>& nodes : nodes_) {
    score_nodes(from, to, spacing, [&](double score, double weight) {
      const double eta = contact.restitution_mean + contact.restitution_sd * score;
      nodes.push_back({eta, weight / restitution_mass_, contact_duration(eta)});
    });
    spacing /= 2;
  }
}

double CollisionDensity::contact_duration(double restitution) {
  const double log_eta = std::log(std::max(restitution, std::numeric_limits<double>::min()));
  return std::sqrt(std::numbers::pi * std::numbers::pi + log_eta * log_eta);
}

SpeedDensity CollisionDensity::at(const Collision& collision, double before, double after,
                                  const CollisionChange& change, double speed) const {
  return model_.law == Law::published ? published(collision, before, after, change, speed)
                                      : coulomb(collision, before, after, change, speed);
}

SpeedDensity CollisionDensity::published(const Collision& c, double before, double after, const CollisionChange& change,
                                         double speed) const {
  // In units of M v0^2 r^2 / 2 the loss is [alpha D + (beta + delta D) mu (c mu - b)] / D^2 with D = a - b mu.
  const double r2 = c.landing_length * c.landing_length;
  const double a = r2 + c.contact_x * c.contact_x, b = c.contact_x * c.contact_y, cc = r2 + c.contact_y * c.contact_y;
  const double v0 = c.normal_speed, omega = v0 / c.chord;
  const double unit = model_.mass * v0 * v0 * r2 * change.loss_ratio;
  const double loss = (before * omega * omega - after * speed * speed) / unit;
  const double loss_rate = 2 * after * speed / unit;  // -d loss / d omega+
  const double time = std::sqrt(model_.contact_mass / model_.ramp_stiffness);
  const double pull = model_.gravity * std::sin(c.slope_rad) / (v0 * r2);
  const Friction friction(contact_, change);
  const bool usual = change.restitution_ratio == 1;

  // The loss as a function of mu at one restitution.
  struct Curve {
    double alpha, beta, delta, steady, q2, q1, q0, discriminant;
  };
  const auto curve = [&](double restitution, double duration) {
    const double eta = usual ? restitution : std::min(1.0, restitution * change.restitution_ratio);
    Curve k;
    k.alpha = 1 - eta * eta * (1 - change.rebound_lost), k.beta = (1 + eta) * (1 + eta);
    k.delta = pull * (1 + eta) * time * (usual ? duration : contact_duration(eta));
    // The term with delta is small and nearly constant: put into beta, it leaves a quadratic in mu.
    k.steady = k.beta + k.delta * (a - b * friction.mean());
    k.q2 = k.steady * cc - loss * b * b, k.q1 = b * (2 * loss * a - k.alpha - k.steady);
    k.q0 = a * (k.alpha - loss * a);
    k.discriminant = k.q1 * k.q1 - 4 * k.q2 * k.q0;  // not positive: every friction loses more
    return k;
  };
  const auto at_restitution = [&](const Curve& k) {
    SpeedDensity one;
    const double root = std::sqrt(k.discriminant);  // the slope of the quadratic at its roots
    const auto refine = [&](double mu, double side) {
      const auto slope = [&](double d) {
        return -k.alpha * b + (k.beta + k.delta * d) * (2 * cc * mu - b) - k.delta * b * mu * (cc * mu - b) +
               2 * loss * b * d;
      };
      // One Newton step for what is left, no further than the quadratic's other side.
      const double d = a - b * mu;
      const double left = (k.alpha * d + (k.beta + k.delta * d) * mu * (cc * mu - b) - loss * d * d) / slope(d);
      if (std::abs(left) < root / std::abs(4 * k.q2)) mu -= left;
      const double there = a - b * mu, steep = std::max(side * slope(there), 0.5 * root);
      return std::pair{mu, there * there / steep};
    };
    const auto [upper, upper_rate] = refine(k.q1 <= 0 ? (root - k.q1) / (2 * k.q2) : -2 * k.q0 / (k.q1 + root), 1);
    one.below = friction.above(upper);
    if (upper > 0) one.density = friction.density(upper) * upper_rate * loss_rate;
    if (k.q2 <= 0) return one;
    const double start = k.q1 <= 0 ? 2 * k.q0 / (root - k.q1) : -(k.q1 + root) / (2 * k.q2);
    if (start <= 0) return one;  // there is no lower branch: friction below which the loss rises again
    const auto [lower, lower_rate] = refine(start, -1);
    if (!(lower > 0 && lower < upper)) return one;
    one.below += friction.below(lower);
    one.density += friction.density(lower) * lower_rate * loss_rate;
    return one;
  };

  // Nodes as close as the loss's slopes at the means ask for.
  const double spacing = [&] {
    const double eta = std::min(1.0, contact_.restitution_mean * change.restitution_ratio), mu = friction.mean();
    const double d = a - b * mu, squared = (1 + eta) * (1 + eta), rubbing = mu * (cc * mu - b);
    const double kept = 1 - change.rebound_lost, alpha = 1 - eta * eta * kept;
    const double by_eta = (-2 * eta * kept * d + 2 * (1 + eta) * rubbing) / (d * d);
    const double by_mu = (squared * (2 * cc * mu - b) - alpha * b + 2 * b * (alpha + squared * rubbing / d)) / (d * d);
    return node_spacing(contact_.restitution_sd * change.restitution_ratio * std::abs(by_eta),
                        friction.sd() * (std::abs(by_mu) + friction.sd() * squared * cc / (d * d)));
  }();
  std::size_t level = 0;
  for (double s = widest; level + 1 < nodes_.size() && s > 1.01 * spacing; s /= 2) ++level;
  const std::vector<Node>& nodes = nodes_[level];

  SpeedDensity result;
  double edge = -1;  // the largest restitution of a node that cannot lose so little
  for (const Node& node : nodes) {
    const Curve k = curve(node.restitution, node.duration);
    if (!(k.discriminant > 0)) {
      result.below += node.weight;
      edge = std::max(edge, node.restitution);
      continue;
    }
    const SpeedDensity one = at_restitution(k);
    result.below += node.weight * one.below;
    result.density += node.weight * one.density;
  }
  result.below = std::clamp(result.below, 0.0, 1.0);
  if (edge < 0) return result;
  const Node* next = nullptr;  // after the edge
  for (const Node& node : nodes)
    if (node.restitution > edge && (!next || node.restitution < next->restitution)) next = &node;
  if (!next || next->weight * at_restitution(curve(next->restitution, next->duration)).density < 1e-4 * result.density)
    return result;
  // Near the least restitution that can lose so little the density grows like an inverse square root.
  std::uintmax_t iterations = 40;
  const double low = boost::math::tools::toms748_solve(
                         [&](double eta) { return curve(eta, contact_duration(eta)).discriminant; }, edge,
                         next->restitution, boost::math::tools::eps_tolerance<double>(40), iterations)
                         .second;
  const double high =
      std::max(next->restitution, std::min(1.0, contact_.restitution_mean + reach * contact_.restitution_sd));
  using Rule = boost::math::quadrature::gauss<double, 30>;
  const auto score = [&](double eta) { return (eta - contact_.restitution_mean) / contact_.restitution_sd; };
  const double half = std::sqrt(high - low) / 2;
  const double scale = 2 * half / (contact_.restitution_sd * restitution_mass_);
  result = {0, (normal_cdf(score(low)) - normal_cdf(score(0))) / restitution_mass_};
  for (std::size_t i = 0; i < Rule::abscissa().size(); ++i)
    for (const double side : {1.0, -1.0}) {
      const double t = half * (1 + side * Rule::abscissa()[i]), eta = low + t * t;
      const Curve k = curve(eta, contact_duration(eta));
      if (!(k.discriminant > 0)) continue;
      const double weight = Rule::weights()[i] * t * scale * normal_density(score(eta));
      const SpeedDensity one = at_restitution(k);
      result.below += weight * one.below;
      result.density += weight * one.density;
    }
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

SpeedDensity CollisionDensity::coulomb(const Collision& c, double before, double after, const CollisionChange& change,
                                       double speed) const {
  const double omega = c.normal_speed / c.chord;
  const double unit = c.normal_speed * c.normal_speed / 2 * change.loss_ratio;
  const double loss = (before * omega * omega - after * speed * speed) / (2 * unit);
  const double loss_rate = after * speed / unit;
  const double rg2 = std::max(model_.radius_of_gyration * model_.radius_of_gyration, 1e-16);
  const double x = c.contact_x, y = c.contact_y;
  const double sticking = std::abs(x * y) / (rg2 + y * y);
  const Friction friction(contact_, change);
  const double eta_mean = contact_.restitution_mean * change.restitution_ratio;
  const double eta_sd = contact_.restitution_sd * change.restitution_ratio;
  const auto eta_below = [&](double eta) {
    if (eta >= 1) return 1.0;
    if (eta <= 0) return 0.0;
    const double low = normal_cdf(-eta_mean / eta_sd);
    return std::clamp((normal_cdf((eta - eta_mean) / eta_sd) - low) / restitution_mass_, 0.0, 1.0);
  };
  const auto eta_density = [&](double eta) {
    return eta > 0 && eta < 1 ? normal_density((eta - eta_mean) / eta_sd) / (eta_sd * restitution_mass_) : 0.0;
  };

  SpeedDensity result;
  // The loss at given mu: mass (1 - (1 - lost) eta^2) + rubbing (1 + eta)^2, in J per v0^2/2.
  const auto add = [&](double weight, double mass, double rubbing) {
    const double curvature = mass * (1 - change.rebound_lost) - rubbing;
    if (!(curvature > 1e-9 * mass)) return;  // rubbing takes more than any restitution gives back
    const double discriminant = rubbing * rubbing + curvature * (mass + rubbing - loss);
    if (!(discriminant > 0)) return;  // every restitution loses less
    const double root = std::sqrt(discriminant);
    const double high = (rubbing + root) / curvature, low = (rubbing - root) / curvature;
    result.below += weight * (eta_below(high) - eta_below(low));
    result.density += weight * (eta_density(high) + eta_density(low)) * loss_rate / (2 * root);
  };
  add(friction.above(sticking), model_.mass * (rg2 + y * y) / (rg2 + x * x + y * y), 0);
  const double from = -friction.mean() / friction.sd(), to = (sticking - friction.mean()) / friction.sd();
  const double mass_above_zero = normal_cdf(-from);
  // The slopes of the loss below, mass (1 - eta^2) + rubbing (1 + eta)^2, at the means.
  const auto parts = [&](double mu) {
    const double normal = (rg2 + x * x - mu * x * y) / (model_.mass * rg2);
    const double tangential = (x * y - mu * (rg2 + y * y)) / (model_.mass * rg2);
    return std::pair{1 / normal, mu * std::abs(tangential) / (normal * normal)};
  };
  const double middle = std::min(friction.mean(), sticking), step = 1e-4;
  const auto [mass, rubbing] = parts(middle);
  const auto [mass_less, rubbing_less] = parts(middle - step);
  const double squared = (1 + eta_mean) * (1 + eta_mean);
  const double by_mu = ((mass - mass_less) * (1 - eta_mean * eta_mean) + (rubbing - rubbing_less) * squared) / step;
  const double by_eta = -2 * eta_mean * mass + 2 * (1 + eta_mean) * rubbing;
  const double spacing =
      std::min(0.5, node_spacing(friction.sd() * std::abs(by_mu), eta_sd * (std::abs(by_eta) + eta_sd * mass)));
  score_nodes(from, to, spacing, [&](double score, double weight) {
    const auto [mass_at, rubbing_at] = parts(friction.mean() + friction.sd() * score);
    add(weight / mass_above_zero, mass_at, rubbing_at);
  });
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

}  // namespace metastable::dynamics
