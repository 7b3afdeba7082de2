#include "dynamics/return_map/published_density.h"

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "dynamics/return_map/published_row.h"
#include "dynamics/return_map/vector_math.h"

// There is one compiled version for each generation of vector units, chosen when the program starts. Fused
// multiply-adds make the last bits depend on it.
#ifdef METASTABLE_AVX2
#define METASTABLE_WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define METASTABLE_WIDEST
#endif

namespace metastable::dynamics {
namespace {

using namespace published;

constexpr std::size_t lanes = 16;      // landings worked on together
constexpr double depth = 22;           // windows end where the integrand is e^-depth of its largest value
constexpr double far_tail = 37;        // [sd]
constexpr double least_sd = 0.001;     // of eta and mu: between the points narrower ones are lost
constexpr double longest = 690;        // -ln eta
constexpr std::size_t most_forms = 4;  // speeds down to sqrt(1/8) of the slowest survivor's

struct Nodes {  // Gauss-Legendre on [0, 1]
  std::vector<double> at, weight;
};
template <unsigned N>
const Nodes& nodes() {
  static const Nodes all = [] {
    using Rule = boost::math::quadrature::gauss<double, N>;
    static_assert(N % 2 == 0);
    Nodes n{std::vector<double>(N), std::vector<double>(N)};
    for (std::size_t k = 0; k < N / 2; ++k) {
      n.at[N / 2 + k] = 0.5 + 0.5 * Rule::abscissa()[k];
      n.at[N / 2 - 1 - k] = 0.5 - 0.5 * Rule::abscissa()[k];
      n.weight[N / 2 + k] = n.weight[N / 2 - 1 - k] = 0.5 * Rule::weights()[k];
    }
    return n;
  }();
  return all;
}

/// Each part of the curve has its rule: above mu_c; there with eta below split, where that matters and where it hardly
/// does; below mu_c, before and after the least loss.
struct Rules {
  const Nodes *main, *tail, *tail_minor, *least, *lower;
};

using Lanes = std::array<double, lanes>;

// Holds what the steps below know of the curves g = level of `lanes` landings. Each step goes through all lanes;
// conditions are joined by & because a branch would keep the compiler from vector instructions.
struct Curves {
  alignas(64) Lanes level;
  alignas(64) Lanes low;                                // eta where the curve passes mu_c, or 0
  alignas(64) Lanes from, to;                           // the window in which the integrand matters
  alignas(64) Lanes near, last;                         // where the next root is expected, and the last one
  alignas(64) Lanes deepest;                            // the exponent's least value so far
  alignas(64) Lanes total;                              // the integral so far
  alignas(64) std::array<Lanes, most_points> exponent;  // on the grid of the step
};

[[gnu::always_inline]] inline void begin(const PublishedRow& r, const double* levels, Curves& c) {
  for (std::size_t l = 0; l < lanes; ++l) {
    c.level[l] = levels[l];
    c.low[l] = std::sqrt(std::max(0.0, 1 - c.level[l] * r.normal_sticking));
    c.deepest[l] = 1e300;
    c.total[l] = 0;
  }
}

[[gnu::always_inline]] inline void expect_usual_friction(const PublishedRow& r, Curves& c) {
  for (std::size_t l = 0; l < lanes; ++l) c.near[l] = c.last[l] = r.friction_middle;
}

// Finds the window above mu_c and above split from a grid over eta.
[[gnu::always_inline]] inline void window_above(const PublishedRow& r, Curves& c) {
  alignas(64) Lanes limit;
  const double lower = r.tail_points > 0 ? split : r.lower, at_sticking = friction_exponent(r, r.sticking);
  for (std::size_t q = 0; q < r.points; ++q)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double inside = friction_exponent(r, rough_friction(r, r.a[q], r.b_middle[q], c.level[l])) + r.exponent[q];
      const double edge = restitution_exponent(r, c.low[l]) + at_sticking;
      const double here = r.eta[q] >= c.low[l] ? inside : edge;
      c.exponent[q][l] = here;
      c.deepest[l] = std::min(c.deepest[l], here);
    }
  for (std::size_t l = 0; l < lanes; ++l) {
    limit[l] = c.deepest[l] + depth;
    c.from[l] = std::min(std::max(c.low[l], lower), r.upper);
    c.to[l] = r.upper;
  }
  for (std::size_t q = 1; q < r.points; ++q)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double left = std::max(r.eta[q - 1], c.low[l]), right = std::max(r.eta[q], c.low[l]);
      const double before = c.exponent[q - 1][l], after = c.exponent[q][l];
      const double crossing = left + (right - left) * (limit[l] - before) / (after - before);
      c.from[l] = (before > limit[l]) & (after <= limit[l]) ? crossing : c.from[l];
      c.to[l] = (before <= limit[l]) & (after > limit[l]) ? crossing : c.to[l];
    }
}

// Returns a node's share of the integral: 0 where no curve is and the value is not a number.
[[gnu::always_inline]] inline double share_of(double weight, double exponent) {
  const double value = weight * vector_exp(-std::min(exponent, 700.0));
  return (exponent < 700) & (value > 0) ? value : 0;
}

[[gnu::always_inline]] inline void add_above(const PublishedRow& r, const Nodes& rule, Curves& c) {
  expect_usual_friction(r, c);
  for (std::size_t k = 0; k < rule.at.size(); ++k) {
    const double at = rule.at[k], weight = rule.weight[k];
    for (std::size_t l = 0; l < lanes; ++l) {
      const double width = c.to[l] - c.from[l], eta = c.from[l] + width * at;
      const Root root = friction_at(r, eta, vector_log(std::max(eta, 1e-300)), c.level[l], c.near[l]);
      c.near[l] = 2 * root.at - c.last[l];
      c.last[l] = root.at;
      const double exponent = restitution_exponent(r, eta) + friction_exponent(r, root.at);
      c.total[l] += share_of(weight * width * root.weight, exponent);
    }
  }
}

// Finds the window above mu_c and below split, over y = -ln eta: long contacts are rare, but they lose much.
// @return by how much the least exponent there exceeds that above split, in the lane where it does so least
[[gnu::always_inline]] inline double window_tail(const PublishedRow& r, Curves& c) {
  alignas(64) Lanes limit;
  for (std::size_t q = 0; q < r.tail_points; ++q)
    for (std::size_t l = 0; l < lanes; ++l)
      c.exponent[q][l] =
          friction_exponent(r, rough_friction(r, r.y_a[q], r.y_b_middle[q], c.level[l])) + r.y_exponent[q];
  for (std::size_t l = 0; l < lanes; ++l) {
    const double end = c.low[l] > 0 ? -vector_log(std::max(c.low[l], 1e-300)) : longest;
    c.from[l] = r.y[0];
    c.to[l] = c.low[l] >= split ? r.y[0] : std::min(end, longest);
    limit[l] = c.low[l] >= split ? 1e300 : c.exponent[0][l];
  }
  for (std::size_t q = 1; q < r.tail_points; ++q)
    for (std::size_t l = 0; l < lanes; ++l)
      limit[l] = r.y[q] < c.to[l] ? std::min(limit[l], c.exponent[q][l]) : limit[l];
  double nearest = 1e300;
  for (std::size_t l = 0; l < lanes; ++l) {
    nearest = std::min(nearest, limit[l] - c.deepest[l]);
    c.deepest[l] = std::min(c.deepest[l], limit[l]);
    limit[l] = std::max(c.deepest[l] + depth, limit[l] + 1);
  }
  for (std::size_t q = 1; q < r.tail_points; ++q)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double before = c.exponent[q - 1][l], after = c.exponent[q][l];
      const double crossing = r.y[q - 1] + (r.y[q] - r.y[q - 1]) * (limit[l] - before) / (after - before);
      const bool inside = r.y[q - 1] < c.to[l];
      c.from[l] = inside & (before > limit[l]) & (after <= limit[l]) ? crossing : c.from[l];
      c.to[l] = inside & (before <= limit[l]) & (after > limit[l]) ? std::min(c.to[l], crossing) : c.to[l];
    }
  return nearest;
}

[[gnu::always_inline]] inline void add_tail(const PublishedRow& r, const Nodes& rule, Curves& c) {
  expect_usual_friction(r, c);
  for (std::size_t k = 0; k < rule.at.size(); ++k) {
    const double at = rule.at[k], weight = rule.weight[k];
    for (std::size_t l = 0; l < lanes; ++l) {
      const double width = c.to[l] - c.from[l], y = c.from[l] + width * at, eta = vector_exp(-std::min(y, longest));
      const Root root = friction_at(r, eta, -y, c.level[l], c.near[l]);
      c.near[l] = 2 * root.at - c.last[l];
      c.last[l] = root.at;
      const double exponent = y + restitution_exponent(r, eta) + friction_exponent(r, root.at);
      c.total[l] += share_of(weight * width * root.weight, exponent);
    }
  }
}

// Names the parts of the curve below mu_c: mu lies in [0, mu1], before the least loss, or in [mu2, mu_c], after it.
enum class Lower { before_least, after_least };

// Finds the window of a part below mu_c from a grid over mu.
// @return whether the integrand matters in any lane
[[gnu::always_inline]] inline bool window_below(const PublishedRow& r, Lower part, Curves& c) {
  constexpr std::size_t steps = 6;
  alignas(64) Lanes least, limit, start, width;
  for (std::size_t l = 0; l < lanes; ++l) {
    const double zero = reaching_zero(r, c.level[l], part == Lower::before_least ? -1 : 1);
    c.from[l] = part == Lower::before_least ? 0 : std::min(std::max(zero, r.least), r.sticking);
    c.to[l] = part == Lower::before_least ? std::min(std::max(zero, 0.0), r.least) : r.sticking;
    least[l] = 1e300;
  }
  for (std::size_t q = 0; q <= steps; ++q)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double mu = c.from[l] + (c.to[l] - c.from[l]) * (static_cast<double>(q) / steps);
      const double normal = r.a0 - r.a1 * mu, ratio = mu * (r.t1 * mu - r.t0) / normal;
      c.exponent[q][l] =
          friction_exponent(r, mu) + restitution_exponent(r, rough_restitution(r, ratio, normal, c.level[l]));
      least[l] = std::min(least[l], c.exponent[q][l]);
    }
  double nearest = 1e300;
  for (std::size_t l = 0; l < lanes; ++l) {
    const double bound = c.deepest[l] + depth + 8;  // the exponent is not convex here
    nearest = std::min(nearest, least[l] - bound);
    limit[l] = std::max(bound, least[l] + 1);
    start[l] = c.from[l];
    width[l] = c.to[l] - c.from[l];
  }
  if (nearest > 2) return false;
  for (std::size_t q = 1; q <= steps; ++q)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double before = c.exponent[q - 1][l], after = c.exponent[q][l];
      const double share = (limit[l] - before) / (after - before);
      const double crossing = start[l] + width[l] / steps * (static_cast<double>(q - 1) + share);
      c.from[l] = (before > limit[l]) & (after <= limit[l]) ? crossing : c.from[l];
      c.to[l] = (before <= limit[l]) & (after > limit[l]) ? crossing : c.to[l];
    }
  return true;
}

[[gnu::always_inline]] inline void add_below(const PublishedRow& r, const Nodes& rule, Curves& c) {
  for (std::size_t k = 0; k < rule.at.size(); ++k) {
    const double at = rule.at[k], weight = rule.weight[k];
    for (std::size_t l = 0; l < lanes; ++l) {
      const double width = c.to[l] - c.from[l], mu = c.from[l] + width * at;
      const Root root = restitution_at(r, mu, c.level[l]);
      const double exponent = friction_exponent(r, mu) + restitution_exponent(r, root.at);
      const double share = share_of(weight * width * root.weight, exponent);
      c.total[l] += (root.at >= r.lower) & (root.at <= r.upper) ? share : 0;
    }
  }
}

// Integrates exp(-z_eta^2/2 - z_mu^2/2) / |grad g| along the curves g = level, lane by lane.
METASTABLE_WIDEST
void along_curves(const PublishedRow& r, const double* levels, const Rules& rules, double* sums) {
  Curves c;
  begin(r, levels, c);
  window_above(r, c);
  add_above(r, *rules.main, c);
  if (r.tail_points > 0) {
    const double nearest = window_tail(r, c);
    if (nearest < depth + 2) add_tail(r, nearest > 5 ? *rules.tail_minor : *rules.tail, c);
  }
  if (r.sticking > 0) {
    if (window_below(r, Lower::before_least, c)) add_below(r, *rules.least, c);
    if (window_below(r, Lower::after_least, c)) add_below(r, *rules.lower, c);
  }
  for (std::size_t l = 0; l < lanes; ++l) sums[l] = c.total[l];
}

// Finds the window of [lower, upper] outside of which exp(-h) is below e^-(depth + 6) of its largest value.
template <class Exponent>
std::pair<double, double> window(double lower, double upper, std::size_t steps, const Exponent& exponent) {
  std::array<double, most_points> at, h;
  double least = 1e300;
  for (std::size_t q = 0; q <= steps; ++q) {
    at[q] = lower + (upper - lower) * static_cast<double>(q) / static_cast<double>(steps);
    least = std::min(least, h[q] = exponent(at[q]));
  }
  const double bound = least + depth + 6;
  std::pair<double, double> found{lower, upper};
  for (std::size_t q = 1; q <= steps; ++q) {
    const double crossing = at[q - 1] + (at[q] - at[q - 1]) * (bound - h[q - 1]) / (h[q] - h[q - 1]);
    if (h[q - 1] > bound && h[q] <= bound) found.first = crossing;
    if (h[q - 1] <= bound && h[q] > bound) found.second = crossing;
  }
  return found;
}

template <unsigned N, class F>
double integrate(std::pair<double, double> range, const F& f) {
  const Nodes& rule = nodes<N>();
  const double width = range.second - range.first;
  double sum = 0;
  for (std::size_t k = 0; k < rule.at.size(); ++k) sum += rule.weight[k] * f(range.first + width * rule.at[k]);
  return width * sum;
}

// Returns P(g > level): what lies beyond the upper part of the curve, and below the lower one.
double rest(const PublishedRow& r, const TruncatedNormal& restitution, const TruncatedNormal& friction, double level) {
  const double open = 1 - level * r.normal_sticking, low = std::sqrt(std::max(0.0, open));
  const double lower = r.tail_points > 0 ? split : r.lower;
  double sum = 0;
  if (open > 0) sum += restitution.cdf(std::min(low, r.upper)) * friction.complement(r.sticking);
  double near = r.friction_middle;  // of the last one asked for
  const auto friction_of = [&](double eta, double log_eta) {
    near = friction_at(r, eta, log_eta, level, near).at;
    return near;
  };
  const auto beyond = [&](double mu) { return mu > r.friction ? friction_exponent(r, mu) : 0; };
  if (low < r.upper) {
    const auto range = window(std::max(low, lower), r.upper, r.points - 1, [&](double eta) {
      return restitution_exponent(r, eta) + beyond(friction_of(eta, std::log(eta)));
    });
    sum += integrate<32>(range, [&](double eta) {
      return restitution.density(eta) * friction.complement(friction_of(eta, std::log(eta)));
    });
  }
  if (low < lower && r.tail_points > 0) {
    const double end = low > 0 ? std::min(longest, -std::log(low)) : longest;
    const auto range = window(std::log(r.y[0]), std::log(end), r.tail_points - 1, [&](double log_y) {
      const double y = std::exp(log_y), eta = std::exp(-y);
      return y + restitution_exponent(r, eta) + beyond(friction_of(eta, -y));
    });
    sum += integrate<40>({std::exp(range.first), std::exp(range.second)}, [&](double y) {
      const double eta = std::exp(-y);
      return eta * restitution.density(eta) * friction.complement(friction_of(eta, -y));
    });
  }
  if (r.sticking > 0 && friction.cdf(r.sticking) > 0) {
    const double mu1 = std::min(reaching_zero(r, level, -1), r.least),
                 mu2 = std::max(reaching_zero(r, level, 1), r.least);
    for (const auto& [from, to] : {std::pair(0.0, mu1), std::pair(mu2, r.sticking)}) {
      if (!(to > from)) continue;
      const auto restitution_of = [&](double mu) { return restitution_at(r, mu, level).at; };
      const auto range = window(from, to, 12, [&](double mu) {
        const double eta = restitution_of(mu);
        return friction_exponent(r, mu) + (eta < r.restitution ? restitution_exponent(r, eta) : 0);
      });
      sum +=
          integrate<16>(range, [&](double mu) { return friction.density(mu) * restitution.cdf(restitution_of(mu)); });
    }
  }
  return std::min(sum, 1.0);
}

double normalisation(const TruncatedNormal& n) {  // density over exp(-z^2/2)
  const double at = std::clamp(n.mean(), n.lower(), n.upper()), z = (at - n.mean()) / n.sd();
  return n.density(at) * std::exp(0.5 * z * z);
}

Rules rules_of(const PublishedRow& r, double restitution_sd, double friction_sd) {
  // The curve bends by so many sds over one sd of eta: d^2 mu/d eta^2 is about 0.6 on it.
  const double bend = 0.6 * restitution_sd * restitution_sd / friction_sd;
  // Where eta = 0 meets the least loss, below mu_c, |grad g| is small and the curve turns sharply.
  const double corner = restitution_exponent(r, r.lower) + friction_exponent(r, r.least);
  const bool minor = r.friction > r.sticking + 2 * friction_sd;
  const bool sharp = r.sticking > 0 && corner < 11;
  return {bend < 0.1 ? &nodes<24>() : &nodes<40>(), &nodes<24>(), sharp ? &nodes<24>() : &nodes<10>(),
          sharp   ? &nodes<60>()
          : minor ? &nodes<6>()
                  : &nodes<16>(),
          sharp   ? &nodes<60>()
          : minor ? &nodes<10>()
                  : &nodes<16>()};
}

}  // namespace

bool PublishedDensity::covers(const WheelMap& map) {
  const ContactNoise& noise = map.noise();
  return map.law() == Law::published && !noise.is_empirical() && noise.correlation() == 0 &&
         noise.restitution().sd() >= least_sd && noise.friction().sd() >= least_sd;
}

PublishedDensity::PublishedDensity(const WheelMap& map, int phase)
    : restitution_(map.noise().restitution()), friction_(map.noise().friction()) {
  const ContactModel& model = map.contact_model();
  const Collision c = map.collision(phase, 1);
  const double x = c.contact_x, y = c.contact_y, r2 = c.landing_length * c.landing_length;
  const double scale = 1 / (model.mass * r2);
  a0_ = (r2 + x * x) * scale;
  a1_ = t0_ = x * y * scale;
  t1_ = (r2 + y * y) * scale;
  const Stance& stance = map.stance(phase);
  lowest_ = stance.barrier + stance.gain;
  gain_ = stance.gain;
  inertia_ = stance.inertia;
  before_ = map.stance(phase > 0 ? phase - 1 : map.phases() - 1).inertia;
  energy_ = c.chord * c.chord / 2;
  kappa_ = model.mass * model.gravity * std::sin(c.slope_rad) * c.chord / 2 *
           std::sqrt(model.contact_mass / model.ramp_stiffness) / energy_;

  const double sd = restitution_.sd();
  const double lower = std::max(restitution_.lower(), restitution_.mean() - far_tail * sd);
  const double upper = std::min(restitution_.upper(), restitution_.mean() + far_tail * sd);
  const int steps = std::clamp(static_cast<int>(std::ceil((upper - lower) / sd)), 7, static_cast<int>(most_points) - 1);
  lower_ = lower;
  constexpr int tail_steps = 24;
  for (int q = 0; q <= tail_steps && lower == 0; ++q) {
    tail_.push_back(-std::log(split) * std::pow(-longest / std::log(split), static_cast<double>(q) / tail_steps));
    tail_restitution_.push_back(std::exp(-tail_.back()));
  }
  const double first = lower > 0 ? lower : split;
  for (int q = 0; q <= steps; ++q) {
    grid_.push_back(q == steps ? upper : first + (upper - first) * q / steps);
    duration_.push_back(stretched(grid_.back(), 0));
  }

  // Each form takes the least rounding with which g falls with eta for every mu below mu_c, with room to spare.
  sticking_ = std::max(0.0, t0_ / t1_);
  if (sticking_ == 0) return;
  const auto falls = [&](double rounding, double kappa) {
    constexpr int count = 16;
    for (int i = 1; i < count; ++i)
      for (int k = 0; k <= 2 * count; ++k) {
        const double mu = sticking_ * i / count;
        const double eta = k < count ? 4 * rounding * k / count : static_cast<double>(k - count) / count;
        const double normal = a0_ - a1_ * mu, ratio = mu * (t1_ * mu - t0_) / normal;
        const double s = stretched(eta, rounding), far2 = eta * eta + rounding * rounding;
        const double speed = 0.5 * std::log(far2) * eta / (far2 * s);
        if (2 * (1 + eta) * ratio - 2 * eta + kappa * normal * ratio * (s + 2 * (1 + eta) * speed) > 0) return false;
      }
    return true;
  };
  constexpr std::array roundings{0.005, 0.007, 0.01, 0.014, 0.02, 0.03, 0.04, 0.06, 0.1, 0.2, 0.5};
  double state = map.state_interval(phase).first;
  for (auto rounding = roundings.begin(); forms_.size() < most_forms; state /= 2) {
    while (rounding != roundings.end() && !falls(*rounding, kappa_ / std::sqrt(state))) ++rounding;
    if (rounding == roundings.end()) break;
    forms_.push_back({state, *rounding});
  }
}

double PublishedDensity::slowest() const {
  return sticking_ == 0 ? 0 : forms_.empty() ? std::numeric_limits<double>::infinity() : forms_.back().slowest;
}

double PublishedDensity::operator()(double state, std::span<const double> next, std::span<double> density) const {
  if (next.size() != density.size()) throw std::invalid_argument("density: spans of different sizes");
  PublishedRow r{};
  r.a0 = a0_;
  r.a1 = a1_;
  r.t0 = t0_;
  r.t1 = t1_;
  r.kappa = kappa_ / std::sqrt(state);
  const auto form = std::find_if(forms_.begin(), forms_.end(), [&](const Form& f) { return state >= f.slowest; });
  r.rounding = form == forms_.end() ? rounding() : form->rounding;
  r.sticking = sticking_;
  r.normal_sticking = a0_ - a1_ * r.sticking;
  set_contact(r, restitution_, friction_);
  set_grid(r, grid_, duration_, lower_);
  set_tail(r, tail_, tail_restitution_);
  set_least(r);

  const double energy = energy_ * state;
  const auto level = [&](double landing) { return (before_ * state - inertia_ * (landing - gain_)) / (2 * energy); };
  const double per_loss = 0.5 * inertia_ / energy * normalisation(restitution_) * normalisation(friction_);
  const double lowest_level = least_level(r, duration_.back());
  const Rules rules = rules_of(r, restitution_.sd(), friction_.sd());
  for (std::size_t first = 0; first < next.size(); first += lanes) {
    std::array<double, lanes> levels, sums;
    const std::size_t count = std::min(lanes, next.size() - first);
    for (std::size_t l = 0; l < lanes; ++l) levels[l] = level(next[first + std::min(l, count - 1)]);
    if (*std::max_element(levels.begin(), levels.end()) < lowest_level) {
      std::fill_n(density.begin() + static_cast<std::ptrdiff_t>(first), count, 0.0);
      continue;
    }
    along_curves(r, levels.data(), rules, sums.data());
    for (std::size_t l = 0; l < count; ++l) density[first + l] = next[first + l] < lowest_ ? 0 : per_loss * sums[l];
  }
  return rest(r, restitution_, friction_, level(lowest_));
}

}  // namespace metastable::dynamics
