#include "dynamics/return_map/landing_quadrature.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/tools/minima.hpp>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "dynamics/return_map/loss_curve.h"

namespace metastable::dynamics {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double depth = 85;          // the integrand is followed down to e^-depth
constexpr double deepest = 300;       // where only one of eta and mu is random
constexpr double logarithmic = 0.02;  // eta below which ln eta is the variable: the contact lasts like |ln eta|
constexpr double unlikely = 12;       // -ln eta
constexpr double widest = 3;          // panel [sd]
constexpr std::size_t most_quadrature_panels = 40;

// Lays Gauss-Legendre panels over t in [0, 1], where a share sin^2(pi t / 2) of an interval is the variable: a square
// root at either end of the interval is smooth in t.
struct QuadraturePoint {
  double at, weight;
};
const std::vector<QuadraturePoint>& quadrature_points(std::size_t panels) {
  constexpr unsigned order = 16;
  using Rule = boost::math::quadrature::gauss<double, order>;
  static const std::vector<std::vector<QuadraturePoint>> all = [] {
    std::vector<std::vector<QuadraturePoint>> rules(most_quadrature_panels);
    for (std::size_t count = 1; count <= most_quadrature_panels; ++count)
      for (std::size_t p = 0; p < count; ++p)
        for (std::size_t k = 0; k < order; ++k) {
          const std::size_t at = k < order / 2 ? order / 2 - 1 - k : k - order / 2;
          const double place = 0.5 + (k < order / 2 ? -0.5 : 0.5) * Rule::abscissa()[at];
          const double t = (static_cast<double>(p) + place) / static_cast<double>(count);
          const double sine = std::sin(std::numbers::pi / 2 * t);
          rules[count - 1].push_back({sine * sine, 0.5 * Rule::weights()[at] / static_cast<double>(count) *
                                                       std::numbers::pi / 2 * std::sin(std::numbers::pi * t)});
        }
    return rules;
  }();
  return all[std::clamp<std::size_t>(panels, 1, most_quadrature_panels) - 1];
}

// Calls f(place, weight) at the points of an integral over [from, to] of a function that varies over `scale`.
template <class F>
void integrate(double from, double to, double scale, const F& f) {
  const double length = to - from;
  if (!(length > 0)) return;
  for (const QuadraturePoint& s :
       quadrature_points(1 + static_cast<std::size_t>(std::numbers::pi / 2 * length / scale)))
    f(from + length * s.at, length * s.weight);
}

struct Reach {
  double lower, upper;
};
// Says where the density is above e^-exponent of its largest.
Reach reach(const TruncatedNormal& n, double exponent) {
  const double most = std::clamp(n.mean(), n.lower(), n.upper()), z = (most - n.mean()) / n.sd();
  const double far = n.sd() * std::sqrt(2 * std::max(0.0, exponent) + z * z);
  return {std::max(n.lower(), n.mean() - far), std::min(n.upper(), n.mean() + far)};
}

class Quadrature {
 public:
  Quadrature(const WheelMap& map, double state, int phase, std::span<const double> breaks,
             std::vector<std::pair<double, double>>& points)
      : restitution_(map.noise().restitution()),
        friction_(map.noise().friction()),
        curve_(map, state, phase),
        depth_(restitution_.constant() || friction_.constant() ? deepest : depth),
        points_(points) {
    levels_.push_back(curve_.level(curve_.lowest()));
    if (!restitution_.constant()) {
      const double z =
          (std::clamp(restitution_.mean(), restitution_.lower(), restitution_.upper()) - restitution_.mean()) /
          restitution_.sd();
      usual_ = 0.5 * z * z;
    }
    for (const double b : breaks)
      if (b > curve_.lowest()) levels_.push_back(curve_.level(b));
  }

  double run() {
    if (restitution_.constant()) {
      given_restitution(restitution_.mean(), 1);
    } else {
      const auto [lower, upper] = reach(restitution_, depth_);
      const double split = curve_.coulomb() ? lower : std::clamp(logarithmic, lower, upper);
      if (split < upper) over(split, upper, false);
      if (split > lower) over(-std::log(split), lower > 0 ? std::min(depth_, -std::log(lower)) : depth_, true);
    }
    return std::min(1.0, rest_);
  }

 private:
  // Returns the loss at a mu that may stick or jam.
  double at_friction(const LossCurve::Coefficients& k, double mu) const {
    if (mu < curve_.end()) return curve_.loss(k, mu);
    return curve_.coulomb() ? curve_.loss(k, curve_.end()) : infinity;
  }

  // Returns a loss that bounds the landing at one eta: its crossing a level adds or takes away a root in mu.
  double bound(int which, double eta) const {
    const LossCurve::Coefficients k = curve_.at(eta);
    if (friction_.constant()) return at_friction(k, friction_.mean());
    if (which == 0) return curve_.extreme(k, 0).loss;
    return curve_.loss(k, which == 1 ? 0 : curve_.end());
  }

  // Lays panels over eta in [from, to], or over -ln eta.
  void over(double from, double to, bool log) {
    const auto eta = [log](double u) { return log ? std::exp(-u) : u; };
    const double step = log ? 1.5 : std::min(restitution_.sd(), 2 * (friction_.constant() ? infinity : friction_.sd()));
    std::vector<double> cuts{from, to};
    const int scan = std::clamp(static_cast<int>(std::ceil(2 * (std::min(to, log ? 30.0 : to) - from) / step)), 8, 80);
    const int curves = friction_.constant() ? 1 : curve_.coulomb() ? 3 : 2;
    for (int which = 0; which < curves; ++which) {
      std::vector<double> at, value;
      const auto f = [&](double u) { return bound(which, eta(u)); };
      for (int i = 0; i <= scan; ++i) {
        at.push_back(i == scan ? to : from + (to - from) * i / scan);
        value.push_back(f(at.back()));
      }
      // It is a turning point of the bound itself, so that no pair of roots is missed.
      for (std::size_t i = 1; i + 1 < at.size(); ++i) {
        if ((value[i] - value[i - 1]) * (value[i + 1] - value[i]) >= 0 || !std::isfinite(value[i])) continue;
        const double sign = value[i] > value[i - 1] ? -1 : 1;
        std::uintmax_t iterations = 60;
        const auto [u, turn] = boost::math::tools::brent_find_minima([&](double t) { return sign * f(t); }, at[i - 1],
                                                                     at[i + 1], 30, iterations);
        // Beside a level, the loss has roots close to it: in the plane if not on the line.
        for (double d = 0.3; friction_.constant() && d > 1e-8; d /= 8)
          for (const double cut : {u - d, u + d})
            if (cut > from && cut < to) cuts.push_back(cut);
        if (friction_.constant()) cuts.push_back(u);
        const std::size_t place = i + (u > at[i] ? 1 : 0);
        at.insert(at.begin() + static_cast<std::ptrdiff_t>(place), u);
        value.insert(value.begin() + static_cast<std::ptrdiff_t>(place), sign * turn);
        ++i;
      }
      for (const double level : levels_)
        for (std::size_t i = 1; i < at.size(); ++i) {
          const double a = value[i - 1] - level, b = value[i] - level;
          if (!(a * b < 0) || !std::isfinite(a) || !std::isfinite(b)) continue;
          std::uintmax_t iterations = 60;
          const auto root =
              boost::math::tools::toms748_solve([&](double u) { return f(u) - level; }, at[i - 1], at[i], a, b,
                                                boost::math::tools::eps_tolerance<double>(50), iterations);
          cuts.push_back(0.5 * (root.first + root.second));
        }
    }
    if (log && to > unlikely) cuts.push_back(unlikely);
    std::sort(cuts.begin(), cuts.end());
    for (std::size_t i = 1; i < cuts.size(); ++i) {
      if (friction_.constant() && bound(0, eta(0.5 * (cuts[i - 1] + cuts[i]))) > levels_[0]) {
        double low = eta(cuts[log ? i : i - 1]), high = eta(cuts[log ? i - 1 : i]);
        if (log && i + 1 == cuts.size()) low = -infinity;
        if (!log && i + 1 == cuts.size()) high = infinity;
        rest_ += restitution_.between(low, high);
        continue;
      }
      integrate(cuts[i - 1], cuts[i], log ? (cuts[i] > unlikely ? 12 : 4) : widest * step,
                [&](double u, double weight) {
                  const double e = eta(u);
                  given_restitution(e, weight * (log ? e : 1) * restitution_.density(e));
                });
    }
  }

  void add(double loss, double weight) {
    if (loss > levels_[0])
      rest_ += weight;
    else
      points_.emplace_back(curve_.landing(loss), weight);
  }

  void given_restitution(double eta, double weight) {
    if (!(weight > 0)) return;
    const LossCurve::Coefficients k = curve_.at(eta);
    if (friction_.constant()) return add(at_friction(k, friction_.mean()), weight);
    const LossCurve::Extreme turn = curve_.extreme(k, turn_guess_);
    turn_guess_ = turn.friction;
    const double z = restitution_.constant() ? 0 : (eta - restitution_.mean()) / restitution_.sd();
    const auto [low, high] = reach(friction_, depth_ - std::max(0.0, 0.5 * z * z - usual_));
    const double end = curve_.end();
    cuts_.assign({low, end});
    if (turn.friction > low && turn.friction < end) cuts_.push_back(turn.friction);
    const double first = curve_.loss(k, 0), last = curve_.jams() ? infinity : curve_.loss(k, end);
    for (const double level : levels_) {
      const auto crossing = [&](double from, double to, double a, double b) {
        if ((a < level) != (b < level)) cuts_.push_back(curve_.root(k, level, from, to, a < b, 0.5 * (from + to)));
      };
      if (turn.friction > 0) crossing(0, turn.friction, first, turn.loss);
      if (turn.friction < end) crossing(turn.friction, end, turn.loss, last);
    }
    std::sort(cuts_.begin(), cuts_.end());
    for (std::size_t i = 1; i < cuts_.size(); ++i) {
      if (!(cuts_[i] > cuts_[i - 1])) continue;
      if (curve_.loss(k, cuts_[i - 1] + 0.5 * (cuts_[i] - cuts_[i - 1])) > levels_[0]) {
        const bool last_piece = !curve_.coulomb() && i + 1 == cuts_.size();
        rest_ += weight * friction_.between(cuts_[i - 1], last_piece ? infinity : cuts_[i]);
        continue;
      }
      integrate(std::max(cuts_[i - 1], low), std::min(cuts_[i], high), widest * friction_.sd(),
                [&](double mu, double share) {
                  points_.emplace_back(curve_.landing(curve_.loss(k, mu)), weight * share * friction_.density(mu));
                });
    }
    if (curve_.coulomb()) add(last, weight * friction_.complement(end));
  }

  const TruncatedNormal& restitution_;
  const TruncatedNormal& friction_;
  const LossCurve curve_;
  const double depth_;
  std::vector<std::pair<double, double>>& points_;
  std::vector<double> levels_, cuts_;             // levels_[0]: rest
  double turn_guess_ = 0, rest_ = 0, usual_ = 0;  // exponent of the likeliest eta
};

// Says that between lower and upper omega+^2 as a function of eta has its least (sign 1) or largest (-1) value nearby.
struct Turn {
  double lower, upper, sign;
};
std::vector<Turn> turns(const WheelMap& map, int phase, double friction) {
  const double state = map.state_interval(phase).first;
  std::vector<double> grid;
  for (double eta = 1e-16; eta < 0.005; eta *= 3) grid.push_back(eta);
  for (int i = 1; i <= 200; ++i) grid.push_back(0.005 * i);
  std::vector<Turn> found;
  const auto after = [&](double eta) { return map.after_collision(state, phase, {eta, friction}); };
  for (std::size_t i = 1; i + 1 < grid.size(); ++i) {
    const double before = after(grid[i]) - after(grid[i - 1]), behind = after(grid[i + 1]) - after(grid[i]);
    if (before * behind < 0) found.push_back({grid[i - 1], grid[i + 1], before < 0 ? 1.0 : -1.0});
  }
  return found;
}

// Finds the state from which `contact`, which may depend on the state, leads to a landing; nothing if none does.
template <class ContactOf>
std::optional<double> state_leading_to(const WheelMap& map, int phase, double landing, const ContactOf& contact) {
  const double level = landing - map.stance(phase).gain;
  double state = map.state_interval(phase).first;
  for (int i = 0; i < 5; ++i) {
    const StepCoefficients c = map.coefficients(phase, contact(state));
    if (!(c.scale > 0) || !std::isfinite(c.drag)) return std::nullopt;
    const double root = (c.drag + std::sqrt(std::max(0.0, c.drag * c.drag + 4 * c.scale * level))) / (2 * c.scale);
    state = root * root;
  }
  return state;
}

// Returns the restitutions at which landings have an extreme: the constant one, or the ends of its range.
std::vector<double> extreme_restitutions(const WheelMap& map) {
  const TruncatedNormal& restitution = map.noise().restitution();
  if (restitution.constant()) return {restitution.mean()};
  std::vector<double> etas;
  const auto [lower, upper] = reach(restitution, depth);
  if (lower == restitution.lower() && (map.law() == Law::coulomb || lower > 0)) etas.push_back(lower);
  if (upper == restitution.upper()) etas.push_back(upper);
  return etas;
}

// Calls `add` with each contact of this friction whose landing is extreme.
template <class Add>
void add_at_one_friction(const WheelMap& map, int phase, double mu, double landing, const std::vector<double>& etas,
                         const Add& add) {
  const TruncatedNormal& restitution = map.noise().restitution();
  const Stance& stance = map.stance(phase);
  for (const double eta : etas) add(landing, [&](double) { return Contact{eta, mu}; });
  const bool at_rest = landing <= (stance.barrier + stance.gain) * (1 + 1e-12);
  if (map.law() == Law::published && at_rest && !restitution.constant() && reach(restitution, depth).lower == 0)
    for (const double eta : {1e-1, 1e-2, 1e-4, 1e-8, 1e-16}) add(landing, [&](double) { return Contact{eta, mu}; });
  if (restitution.constant()) return;
  // These are states where the loss turns over eta: brackets come from a grid at the lowest, refined at each.
  for (const Turn& turn : turns(map, phase, mu))
    add(landing, [&](double state) {
      std::uintmax_t iterations = 100;
      const auto turning = boost::math::tools::brent_find_minima(
          [&](double eta) {
            return turn.sign * map.after_collision(state, phase, {eta, mu});
          },
          turn.lower, turn.upper, 50, iterations);
      return Contact{turning.first, mu};
    });
}

}  // namespace

double landing_points(const WheelMap& map, double state, int phase, std::span<const double> breaks,
                      std::vector<std::pair<double, double>>& points) {
  const ContactNoise& noise = map.noise();
  if (noise.is_empirical() || map.law() == Law::plastic) {
    const Stance& stance = map.stance(phase);
    const std::vector<Contact> one{{}};
    const auto contacts = noise.is_empirical() ? noise.pairs() : std::span<const Contact>(one);
    double rest = 0;
    for (const Contact& c : contacts) {
      const double after = map.after_collision(state, phase, c), weight = 1.0 / static_cast<double>(contacts.size());
      if (after >= stance.barrier)
        points.emplace_back(after + stance.gain, weight);
      else
        rest += weight;
    }
    return std::min(1.0, rest);
  }
  if (noise.correlation() != 0)
    throw std::invalid_argument(
        "method integrated: correlated restitution and friction have no rows by quadrature; use the sampled method");
  return Quadrature(map, state, phase, breaks, points).run();
}

std::vector<double> states_of_extremes(const WheelMap& map, int phase, std::span<const double> next) {
  const ContactNoise& noise = map.noise();
  std::vector<double> found;
  const auto add = [&](double landing, auto contact) {
    if (const auto state = state_leading_to(map, phase, landing, contact)) found.push_back(*state);
  };
  const bool listed = map.law() == Law::plastic || noise.is_empirical();
  const std::vector<double> etas = listed ? std::vector<double>{} : extreme_restitutions(map);
  const double sticks = listed ? 0 : LossCurve(map, map.state_interval(phase).first, phase).end();
  for (const double landing : next) {
    if (listed) {
      if (!noise.is_empirical()) add(landing, [](double) { return Contact{}; });
      for (const Contact& c : noise.pairs()) add(landing, [&c](double) { return c; });
    } else if (noise.friction().constant()) {
      const double mu = noise.friction().mean();
      add_at_one_friction(map, phase, map.law() == Law::coulomb ? std::min(mu, sticks) : mu, landing, etas, add);
    } else {
      for (const double eta : etas) {
        if (reach(noise.friction(), depth).lower == noise.friction().lower())
          add(landing, [&](double) { return Contact{eta, noise.friction().lower()}; });
        add(landing, [&](double state) {
          const LossCurve curve(map, state, phase);
          return Contact{eta, curve.extreme(curve.at(eta), 0).friction};
        });
        if (map.law() == Law::coulomb) add(landing, [&](double) { return Contact{eta, sticks}; });
      }
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace metastable::dynamics
