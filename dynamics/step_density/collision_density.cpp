#include "dynamics/step_density/collision_density.h"

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/step_density/published_roots.h"
#include "dynamics/wheel/coulomb_law.h"

namespace metastable::dynamics {
namespace {

constexpr double farthest_score = 4.6;  // scores beyond it weigh 4e-6

constexpr double finest = 0.05, widest = 0.8;  // spacing of nodes
constexpr double far_from_zero = 4;            // a mean of mu, in sds: that mu ends at 0 shows no more
constexpr double shortest_contact = 0.01;  // a restitution: with less, contacts last long enough to lose little again

// Adds nodes in the standard score between `from` and `to`, with the normal's probabilities: equally spaced where it
// fades out at both ends (then the rule converges exponentially), panels of Gauss-Legendre nodes where it is cut.
template <class Add>
void score_nodes(double from, double to, double spacing, Add add) {
  if (from <= -farthest_score && to >= farthest_score) {
    const int half = static_cast<int>(std::ceil(farthest_score / spacing));
    for (int i = -half; i <= half; ++i) add(i * spacing, spacing * normal_density(i * spacing));
    return;
  }
  from = std::max(from, -farthest_score);
  to = std::min(to, farthest_score);
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

// Returns the spacing of nodes in one variable's score where the other's density is known in closed form: along the
// line of equal loss the product of both densities is narrower than that variable's by what it contributes to the loss.
// @param own, other  change of the loss with a standard deviation of either
double node_spacing(double own, double other) {
  const double ratio = own / std::max(1e-12, other);
  return std::clamp(1.25 / std::sqrt(1 + ratio * ratio), finest, widest);
}

// Knows density and tails of mu = ratio N(mean, sd^2), mu >= 0.
class Friction {
 public:
  Friction(const ContactSpread& contact, const CollisionChange& change)
      : mean_((contact.friction_mean + change.friction_shift) * change.friction_ratio),
        scale_(1 / (contact.friction_sd * change.friction_scatter * change.friction_ratio)),
        inverse_mass_(1 / normal_cdf(mean_ * scale_)) {}
  double density(double mu) const { return normal_density((mu - mean_) * scale_) * scale_ * inverse_mass_; }
  double above(double mu) const { return mu <= 0 ? 1 : normal_cdf((mean_ - mu) * scale_) * inverse_mass_; }
  double below(double mu) const { return 1 - above(mu); }
  double mean() const { return mean_; }
  double sd() const { return 1 / scale_; }

 private:
  double mean_, scale_, inverse_mass_;
};

// Knows density and distribution function of eta = N(mean, sd^2) in [0, 1].
class Restitution {
 public:
  Restitution(const ContactSpread& contact, const CollisionChange& change, double mass)
      : mean_(contact.restitution_mean * change.restitution_ratio),
        sd_(contact.restitution_sd * change.restitution_ratio),
        mass_(mass) {}
  double density(double eta) const {
    return eta > 0 && eta < 1 ? normal_density((eta - mean_) / sd_) / (sd_ * mass_) : 0.0;
  }
  double below(double eta) const {
    if (eta >= 1) return 1.0;
    if (eta <= 0) return 0.0;
    const double low = normal_cdf(-mean_ / sd_);
    return std::clamp((normal_cdf((eta - mean_) / sd_) - low) / mass_, 0.0, 1.0);
  }
  double mean() const { return mean_; }
  double sd() const { return sd_; }

 private:
  double mean_, sd_, mass_;
};

// Returns how long the contact lasts, in units of the half period sqrt(m_c/K_r) (26), (27).
double contact_duration(double restitution) {
  const double log_eta = std::log(std::max(restitution, std::numeric_limits<double>::min()));
  return std::sqrt(std::numbers::pi * std::numbers::pi + log_eta * log_eta);
}

// Gives what the restitutions of one collision under `published` contribute to one omega+.
class PublishedCollision {
 public:
  PublishedCollision(const ContactModel& model, const ContactSpread& contact, const Collision& c, double before,
                     double after, const CollisionChange& change, double speed)
      : contact_(contact), change_(change), friction_(contact, change) {
    const double r2 = c.landing_length * c.landing_length;
    const double v0 = c.normal_speed, omega = v0 / c.chord;
    const double unit = model.mass * v0 * v0 * r2 * change.loss_ratio;
    loss_ = {.a = r2 + c.contact_x * c.contact_x,
             .b = c.contact_x * c.contact_y,
             .c = r2 + c.contact_y * c.contact_y,
             .loss = (before * omega * omega - after * speed * speed) / unit,
             .kept = 1 - change.rebound_lost,
             .pull = model.gravity * std::sin(c.slope_rad) / (v0 * r2),
             .time = std::sqrt(model.contact_mass / model.ramp_stiffness),
             .usual_friction = friction_.mean()};
    loss_rate_ = 2 * after * speed / unit;
  }

  // Takes one more restitution into a batch. @param duration  contact_duration(restitution)
  void add(FrictionRoots& roots, std::size_t at, double restitution, double duration) const {
    const bool usual = change_.restitution_ratio == 1;
    roots.restitution[at] = usual ? restitution : std::min(1.0, restitution * change_.restitution_ratio);
    roots.duration[at] = usual ? duration : contact_duration(roots.restitution[at]);
  }
  void solve(FrictionRoots& roots, std::size_t count) const { find_friction_roots(loss_, roots, count); }

  // Returns what the frictions of one restitution with a positive discriminant contribute.
  SpeedDensity of(const FrictionRoots& roots, std::size_t at) const {
    SpeedDensity one{0, friction_.above(roots.upper[at])};
    if (roots.upper[at] > 0) one.density = friction_.density(roots.upper[at]) * roots.upper_rate[at] * loss_rate_;
    if (roots.lower[at] > 0) {
      one.below += friction_.below(roots.lower[at]);
      one.density += friction_.density(roots.lower[at]) * roots.lower_rate[at] * loss_rate_;
    }
    return one;
  }

  // Returns the restitution that loses as much without friction; below 0: there is none. A root passes mu = 0 there,
  // and with it the density that friction has at 0 comes or goes.
  double without_friction() const {
    const double squared = (1 - loss_.loss * loss_.a) / loss_.kept;
    return squared > 0 ? std::sqrt(squared) / change_.restitution_ratio : -1.0;
  }
  // Returns the score of the larger friction that loses as much.
  double friction_score(const FrictionRoots& roots, std::size_t at) const {
    return (roots.upper[at] - friction_.mean()) / friction_.sd();
  }
  double friction_score(double restitution) const { return friction_score(alone(restitution), 0); }
  bool reaches_no_friction() const { return friction_.mean() < far_from_zero * friction_.sd(); }

  // Returns the least restitution that can lose so little, between one that cannot and one that can. Roots are found
  // from the friction that loses least from then on: where they meet they must do so at that restitution.
  double least_restitution(double edge, double next) {
    double least = next;
    for (int i = 0; i < 2 && alone(edge).discriminant[0] <= 0 && alone(next).discriminant[0] > 0; ++i) {
      std::uintmax_t iterations = 40;
      least = boost::math::tools::toms748_solve([&](double eta) { return alone(eta).discriminant[0]; }, edge, next,
                                                boost::math::tools::eps_tolerance<double>(40), iterations)
                  .second;
      loss_.usual_friction = alone(least).upper[0];
    }
    return least;
  }

  // Solves for one restitution alone.
  FrictionRoots alone(double restitution) const {
    FrictionRoots roots;
    add(roots, 0, restitution, contact_duration(restitution));
    solve(roots, 1);
    return roots;
  }

  // Returns the spacing of nodes in eta's score, from the loss's slopes at the means.
  double spacing() const {
    const double eta = std::min(1.0, contact_.restitution_mean * change_.restitution_ratio), mu = friction_.mean();
    const auto& [a, b, c, loss, kept, pull, time, usual] = loss_;
    const double d = a - b * mu, squared = (1 + eta) * (1 + eta), rubbing = mu * (c * mu - b);
    const double alpha = 1 - eta * eta * kept;
    const double by_eta = (-2 * eta * kept * d + 2 * (1 + eta) * rubbing) / (d * d);
    const double by_mu = (squared * (2 * c * mu - b) - alpha * b + 2 * b * (alpha + squared * rubbing / d)) / (d * d);
    return node_spacing(contact_.restitution_sd * change_.restitution_ratio * std::abs(by_eta),
                        friction_.sd() * (std::abs(by_mu) + friction_.sd() * squared * c / (d * d)));
  }

 private:
  const ContactSpread& contact_;
  const CollisionChange& change_;
  Friction friction_;
  PublishedLoss loss_;
  double loss_rate_ = 0;  // -d loss/d omega+
};

// Sums over eta from `low` on. Where that is the least restitution that can lose so little the density grows like an
// inverse square root, and t with eta = low + t^2 is the variable.
// @param pieces  ends of the pieces in which the density is smooth, rising from low
SpeedDensity sum_over_restitution(const PublishedCollision& collision, const ContactSpread& contact, double mass,
                                  double low, std::initializer_list<double> pieces) {
  using Rule = boost::math::quadrature::gauss<double, 10>;
  constexpr double panel_width = 4;  // in sds of either variable
  constexpr int most_panels = 40;
  const auto score = [&](double eta) { return (eta - contact.restitution_mean) / contact.restitution_sd; };
  SpeedDensity result{0, (normal_cdf(score(low)) - normal_cdf(score(0))) / mass};
  FrictionRoots roots;
  std::array<double, FrictionRoots::most> weight;
  double from = low, friction_from = collision.friction_score(low), friction = friction_from;
  for (const double to : pieces) {
    const double friction_to = collision.friction_score(to);  // it runs nearly evenly along t
    const double width = std::max(friction_to - friction_from, 2 * (to - from) / contact.restitution_sd);
    const int panels = width < most_panels * panel_width ? static_cast<int>(width / panel_width) + 1 : most_panels;
    const double start = std::sqrt(from - low), half = (std::sqrt(to - low) - start) / (2 * panels);
    for (int panel = 0; panel < panels && friction < farthest_score; ++panel) {
      const double middle = start + half * (2 * panel + 1), scale = 2 * half / (contact.restitution_sd * mass);
      std::size_t count = 0;
      for (std::size_t i = 0; i < Rule::abscissa().size(); ++i)
        for (const double side : {1.0, -1.0}) {
          const double t = middle + side * half * Rule::abscissa()[i], eta = low + t * t;
          weight[count] = Rule::weights()[i] * t * scale * normal_density(score(eta));
          collision.add(roots, count++, eta, contact_duration(eta));
        }
      collision.solve(roots, count);
      for (std::size_t i = 0; i < count; ++i) {
        if (!(roots.discriminant[i] > 0)) {  // every friction loses more
          result.below += weight[i];
          continue;
        }
        const SpeedDensity one = collision.of(roots, i);
        result.below += weight[i] * one.below;
        result.density += weight[i] * one.density;
      }
      friction = collision.friction_score(roots, count - 1);
    }
    from = to;
    friction_from = friction_to;
  }
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

// Describes one collision under `coulomb`. Its loss is mass (1 - kept eta^2) + rubbing (1 + eta)^2, in J per v0^2/2.
struct CoulombParts {
  double mass, rubbing;
};

// Holds the restitutions that lose as much as was lost: those between them lose more.
struct RestitutionRoots {
  double low = 0, high = 0;
  double root = 0;        // of the discriminant; 0: no restitution loses just as much
  bool all_more = false;  // where there is none: every restitution loses more, not less
};

class CoulombCollision {
 public:
  // @param kept  share of the rebound's energy that is kept, in [0, 1]
  // @param loss  [J per v0^2/2]
  CoulombCollision(const ContactModel& model, const Collision& c, double kept, double loss)
      : kept_(kept), loss_(loss), sticks_(coulomb_sticking_friction(model, c)) {
    const double m = model.mass, rg2 = coulomb_squared_gyration(model, c);
    const double x = c.contact_x, y = c.contact_y;
    normal_ = {(rg2 + x * x) / (m * rg2), x * y / (m * rg2)};
    tangential_ = {x * y / (m * rg2), (rg2 + y * y) / (m * rg2)};
    sticking_mass_ = m * (rg2 + y * y) / (rg2 + x * x + y * y);
  }

  double sticking_friction() const { return sticks_; }
  // All losses of a sticking foot that hardly springs are alike: the density of a speed has a pole there, onto which a
  // fit could shift one speed without end. Restitutions below `pole` share its height; 0.0015 rad/s are blurred by it.
  RestitutionRoots sticking() const {
    constexpr double pole = 0.03;
    RestitutionRoots found = roots({sticking_mass_, 0});
    const double least = pole * kept_ * sticking_mass_;
    if (found.root > 0) found.root = std::sqrt(std::hypot(found.root * found.root, least * least));
    return found;
  }
  RestitutionRoots slipping(double mu) const {
    const double normal = normal_[0] - mu * normal_[1], tangential = tangential_[0] - mu * tangential_[1];
    return roots({1 / normal, mu * std::abs(tangential) / (normal * normal)});
  }

  // Adds the frictions between which the roots pass 0 or 1, or meet: there the density of a single friction jumps, or
  // grows like an inverse square root.
  void add_breaks(double from, double to, std::vector<double>& breaks) const {
    const auto [n0, n1] = normal_;
    const auto [t0, t1] = tangential_;
    for (const double eta : {0.0, 1.0}) {  // the loss of this restitution, times normal^2, is a parabola in mu
      const double normal = 1 - kept_ * eta * eta, rubbing = (1 + eta) * (1 + eta);
      add_zeros({normal * n0 - loss_ * n0 * n0, rubbing * t0 - normal * n1 + 2 * loss_ * n0 * n1,
                 -rubbing * t1 - loss_ * n1 * n1, 0},
                from, to, breaks);
    }
    const double pull = kept_ - 1, held = kept_ * loss_;  // the discriminant, times normal^3, is a cubic
    add_zeros({kept_ * n0 - held * n0 * n0, pull * t0 - kept_ * n1 + 2 * held * n0 * n1 + loss_ * n0 * t0,
               -pull * t1 - held * n1 * n1 - loss_ * (n0 * t1 + n1 * t0), loss_ * n1 * t1},
              from, to, breaks);
  }

 private:
  RestitutionRoots roots(const CoulombParts& parts) const {
    const auto [mass, rubbing] = parts;
    const double curvature = mass * kept_ - rubbing, excess = mass + rubbing - loss_;
    const double discriminant = rubbing * rubbing + curvature * excess;
    if (!(discriminant > 0)) return {0, 0, 0, excess > 0};
    const double root = std::sqrt(discriminant);
    // Where rubbing takes more than restitution gives back, all restitutions above the lower one lose more.
    const double high = curvature > 0 ? (rubbing + root) / curvature : std::numeric_limits<double>::infinity();
    return {-excess / (rubbing + root), high, root, false};
  }

  // Adds the zeros in (from, to) of a polynomial, given by its coefficients, at which it changes sign.
  static void add_zeros(const std::array<double, 4>& c, double from, double to, std::vector<double>& zeros) {
    const auto value = [&](double mu) { return c[0] + mu * (c[1] + mu * (c[2] + mu * c[3])); };
    std::array<double, 4> ends{from, to, to, to};  // between which it rises or falls
    std::size_t count = 1;
    const double half = c[2] * c[2] - 3 * c[3] * c[1];
    if (half > 0) {
      const double q = -(c[2] + std::copysign(std::sqrt(half), c[2]));
      std::array<double, 2> turns{q / (3 * c[3]), c[1] / q};
      if (turns[0] > turns[1]) std::swap(turns[0], turns[1]);
      for (const double turn : turns)
        if (turn > from && turn < to) ends[count++] = turn;
    }
    ends[count] = to;
    for (std::size_t i = 0; i < count; ++i) {
      const double left = value(ends[i]), right = value(ends[i + 1]);
      if (!(left * right < 0)) continue;
      std::uintmax_t iterations = 60;
      zeros.push_back(boost::math::tools::toms748_solve(value, ends[i], ends[i + 1], left, right,
                                                        boost::math::tools::eps_tolerance<double>(48), iterations)
                          .second);
    }
  }

  double kept_, loss_, sticks_;
  std::array<double, 2> normal_{}, tangential_{};  // change of the contact's speeds with the normal impulse: a - b mu
  double sticking_mass_ = 0;
};

// Sums over the frictions of slipping feet with restitution in closed form, from one break to the next. At each the
// density of a single friction may be an inverse square root: in the angle of which the friction is a cosine it is
// smooth.
template <class Add>
void sum_over_friction(const CoulombCollision& collision, const Friction& friction, double restitution_sd, Add add) {
  using Rule = boost::math::quadrature::gauss<double, 10>;
  constexpr double panel_width = 3;  // in sds of both variables, along the line of equal loss
  constexpr int most_panels = 40, samples = 6;
  std::vector<double> breaks{std::max(0.0, friction.mean() - farthest_score * friction.sd()),
                             std::min(collision.sticking_friction(), friction.mean() + farthest_score * friction.sd())};
  const double from = breaks[0], to = breaks[1];
  if (!(from < to)) return;
  collision.add_breaks(from, to, breaks);
  std::sort(breaks.begin(), breaks.end());
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    const double middle = (breaks[i] + breaks[i + 1]) / 2, half = (breaks[i + 1] - breaks[i]) / 2;
    if (const RestitutionRoots none = collision.slipping(middle); none.root == 0 && !none.all_more) continue;
    const auto at = [&](double angle) { return middle - half * std::cos(angle); };
    const auto inside = [](double eta) { return std::clamp(eta, 0.0, 1.0); };
    double width = 0;
    RestitutionRoots before = collision.slipping(at(0));
    for (int k = 1; k <= samples; ++k) {
      const double angle = std::numbers::pi * k / samples;
      const RestitutionRoots here = collision.slipping(at(angle));
      const double restitution =
          std::max(std::abs(inside(here.low) - inside(before.low)), std::abs(inside(here.high) - inside(before.high)));
      width += std::hypot((at(angle) - at(angle - std::numbers::pi / samples)) / friction.sd(),
                          restitution / restitution_sd);
      before = here;
    }
    const int panels = width < most_panels * panel_width ? static_cast<int>(width / panel_width) + 1 : most_panels;
    const double step = std::numbers::pi / (2 * panels);
    for (int panel = 0; panel < panels; ++panel)
      for (std::size_t k = 0; k < Rule::abscissa().size(); ++k)
        for (const double side : {-1.0, 1.0}) {
          const double angle = step * (2 * panel + 1 + side * Rule::abscissa()[k]), mu = at(angle);
          add(Rule::weights()[k] * step * half * std::sin(angle) * friction.density(mu), collision.slipping(mu));
        }
  }
}

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

SpeedDensity CollisionDensity::at(const Collision& collision, double before, double after,
                                  const CollisionChange& change, double speed) const {
  return model_.law == Law::published ? published(collision, before, after, change, speed)
                                      : coulomb(collision, before, after, change, speed);
}

SpeedDensity CollisionDensity::published(const Collision& c, double before, double after, const CollisionChange& change,
                                         double speed) const {
  PublishedCollision collision(model_, contact_, c, before, after, change, speed);
  const double lowest = std::max(0.0, contact_.restitution_mean - farthest_score * contact_.restitution_sd);
  const double highest = std::min(1.0, contact_.restitution_mean + farthest_score * contact_.restitution_sd);
  const double cut = collision.reaches_no_friction() ? collision.without_friction() : -1.0;
  if (cut > lowest && cut < highest) {
    const double edge = std::max(lowest, shortest_contact / change.restitution_ratio);
    const bool all = edge >= cut || collision.alone(edge).discriminant[0] > 0;
    const double low = all ? lowest : collision.least_restitution(edge, cut);
    return sum_over_restitution(collision, contact_, restitution_mass_, low, {cut, highest});
  }
  const double spacing = collision.spacing();
  std::size_t level = 0;
  for (double s = widest; level + 1 < nodes_.size() && s > 1.01 * spacing; s /= 2) ++level;
  const std::vector<Node>& nodes = nodes_[level];

  SpeedDensity result;
  double edge = -1;  // the largest restitution of a node that cannot lose so little
  FrictionRoots roots;
  for (std::size_t from = 0; from < nodes.size(); from += FrictionRoots::most) {
    const std::size_t count = std::min(FrictionRoots::most, nodes.size() - from);
    for (std::size_t i = 0; i < count; ++i)
      collision.add(roots, i, nodes[from + i].restitution, nodes[from + i].duration);
    collision.solve(roots, count);
    for (std::size_t i = 0; i < count; ++i) {
      const Node& node = nodes[from + i];
      if (!(roots.discriminant[i] > 0)) {
        result.below += node.weight;
        edge = std::max(edge, node.restitution);
        continue;
      }
      const SpeedDensity one = collision.of(roots, i);
      result.below += node.weight * one.below;
      result.density += node.weight * one.density;
    }
  }
  result.below = std::clamp(result.below, 0.0, 1.0);
  if (edge < 0) return result;
  const Node* next = nullptr;  // after the edge
  for (const Node& node : nodes)
    if (node.restitution > edge && (!next || node.restitution < next->restitution)) next = &node;
  if (!next || next->weight * collision.of(collision.alone(next->restitution), 0).density < 1e-4 * result.density)
    return result;
  return sum_over_restitution(collision, contact_, restitution_mass_,
                              collision.least_restitution(edge, next->restitution),
                              {std::max(next->restitution, highest)});
}

SpeedDensity CollisionDensity::coulomb(const Collision& c, double before, double after, const CollisionChange& change,
                                       double speed) const {
  const double omega = c.normal_speed / c.chord;
  const double unit = c.normal_speed * c.normal_speed / 2 * change.loss_ratio;
  const double loss = (before * omega * omega - after * speed * speed) / (2 * unit);
  const double loss_rate = after * speed / unit;
  const Friction friction(contact_, change);
  const Restitution restitution(contact_, change, restitution_mass_);
  const CoulombCollision collision(model_, c, 1 - change.rebound_lost, loss);

  SpeedDensity result;
  const auto add = [&](double weight, const RestitutionRoots& roots) {
    if (roots.root == 0) {
      if (roots.all_more) result.below += weight;
      return;
    }
    result.below += weight * (restitution.below(roots.high) - restitution.below(roots.low));
    result.density +=
        weight * (restitution.density(roots.high) + restitution.density(roots.low)) * loss_rate / (2 * roots.root);
  };
  add(friction.above(collision.sticking_friction()), collision.sticking());
  sum_over_friction(collision, friction, restitution.sd(), add);
  result.below = std::clamp(result.below, 0.0, 1.0);
  return result;
}

}  // namespace metastable::dynamics
