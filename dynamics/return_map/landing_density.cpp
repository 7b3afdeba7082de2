#include "dynamics/return_map/landing_density.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/tools/minima.hpp>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

using LandingRule = boost::math::quadrature::gauss_kronrod<double, 21>;

constexpr double far_tail = 38;  // [sd]: beyond it probabilities underflow
constexpr double tolerance = 3e-12;
constexpr double negligible = 1e-16;  // size of a panel over that of the largest
constexpr std::size_t most_panels = 400;

// Maps t in [0, 1] to a place on a piece of eta and its speed there: quadratic at an end where two roots meet.
struct MappedPoint {
  double restitution, speed;
};
MappedPoint mapped_point(double lower, double upper, bool fold_below, bool fold_above, double t) {
  const double length = upper - lower;
  if (fold_below && fold_above) {
    const double angle = std::numbers::pi / 2 * t, s = std::sin(angle);
    return {lower + length * s * s, length * std::numbers::pi / 2 * std::sin(2 * angle)};
  }
  if (fold_below) return {lower + length * t * t, 2 * length * t};
  if (fold_above) return {upper - length * (1 - t) * (1 - t), 2 * length * (1 - t)};
  return {lower + length * t, length};
}

const WheelMap& checked(const WheelMap& map) {
  LandingDensity::check(map);
  return map;
}

}  // namespace

void LandingDensity::check(const WheelMap& map) {
  const char* reason = nullptr;
  if (map.noise().is_empirical())
    reason = "a list of contacts";
  else if (map.law() == Law::plastic)
    reason = "the plastic law (nothing is random)";
  else if (map.noise().friction().constant())
    reason = "a constant friction";
  else if (map.noise().correlation() != 0)
    reason = "correlated restitution and friction";
  else if (map.law() == Law::coulomb && map.contact_model().rebound_lost == 1)
    reason = "rebound_lost = 1 under coulomb (sticking collisions all land alike)";
  else if (map.law() == Law::coulomb && map.noise().restitution().constant())
    reason = "a constant restitution under coulomb (sticking collisions all land alike)";
  if (reason != nullptr)
    throw std::invalid_argument(std::string("method integrated: the landing has no density in closed form for ") +
                                reason + "; use the sampled method");
}

LandingDensity::LandingDensity(const WheelMap& map, double state, int phase)
    : restitution_(map.noise().restitution()), friction_(map.noise().friction()), curve_(checked(map), state, phase) {
  if (restitution_.constant()) {
    lower_ = upper_ = restitution_.mean();
    return;
  }
  const double sd = restitution_.sd();
  lower_ = std::max(restitution_.lower(), restitution_.mean() - far_tail * sd);
  upper_ = std::min(restitution_.upper(), restitution_.mean() + far_tail * sd);
  // T_r grows like |ln eta| towards eta = 0.
  std::vector<double> grid{lower_};
  for (double eta : {1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 0.02})
    if (eta > lower_ && eta < upper_) grid.push_back(eta);
  const double start = grid.back();
  const int steps = std::clamp(static_cast<int>(std::ceil(2 * (upper_ - start) / sd)), 8, 40);
  for (int i = 1; i <= steps; ++i) grid.push_back(i == steps ? upper_ : start + (upper_ - start) * i / steps);
  double guess = 0;
  const auto extreme_loss = [this, &guess](double eta) {
    const LossCurve::Extreme found = curve_.extreme(curve_.at(eta), guess);
    guess = found.friction;
    return found.loss;
  };
  for (const double eta : grid) extremes_.push_back({eta, extreme_loss(eta)});
  const std::vector<Point> plain = extremes_;
  for (std::size_t i = 1; i + 1 < plain.size(); ++i) {
    const double before = plain[i].loss - plain[i - 1].loss, after = plain[i + 1].loss - plain[i].loss;
    if (before * after >= 0) continue;
    const double sign = before > 0 ? -1 : 1;
    std::uintmax_t iterations = 60;
    const auto best =
        boost::math::tools::brent_find_minima([&](double eta) { return sign * extreme_loss(eta); },
                                              plain[i - 1].restitution, plain[i + 1].restitution, 26, iterations);
    extremes_.push_back({best.first, sign * best.second});
  }
  std::sort(extremes_.begin(), extremes_.end(),
            [](const Point& p, const Point& q) { return p.restitution < q.restitution; });
}

double LandingDensity::given_restitution(double restitution, double level, Guess& guess) const {
  const LossCurve::Coefficients k = curve_.at(restitution);
  const LossCurve::Extreme turn = curve_.extreme(k, guess.extreme);
  guess.extreme = turn.friction;
  double sum = 0;
  const auto add = [&](double from, double to, bool rising, double& near) {
    const double mu = near = curve_.root(k, level, from, to, rising, near);
    const double steepness = std::abs(curve_.slope(k, mu));
    if (steepness > 0) sum += friction_.density(mu) / steepness;
  };
  const double first = curve_.loss(k, 0), sign = curve_.coulomb() ? -1 : 1;
  const double beyond = sign * (level - turn.loss);
  if (beyond <= 0) return 0;
  if (turn.friction > 0 && sign * (first - level) > 0) add(0, turn.friction, curve_.coulomb(), guess.first);
  if (turn.friction < curve_.end() && (curve_.jams() || sign * (curve_.loss(k, curve_.end()) - level) > 0))
    add(turn.friction, curve_.end(), !curve_.coulomb(), guess.second);
  return sum;
}

// Adds the share that sticks: its loss is a(eta) / A(mu_c) whatever mu is.
double LandingDensity::sticking(double level) const {
  const double share = friction_.complement(curve_.end()), normal = curve_.normal(curve_.end());
  const double squared = (1 - level * normal / curve_.energy()) / curve_.kept();
  if (share == 0 || !(squared > 0)) return 0;
  const double eta = std::sqrt(squared);
  if (eta < lower_ || eta > upper_) return 0;
  return share * restitution_.density(eta) * normal / (2 * curve_.energy() * curve_.kept() * eta);
}

std::vector<LandingDensity::Piece> LandingDensity::pieces(double level) const {
  struct Break {
    double restitution;
    bool fold;
  };
  std::vector<Break> breaks{{lower_, false}};
  double guess = 0;
  const auto fold = [&](double eta) {
    const LossCurve::Extreme found = curve_.extreme(curve_.at(eta), guess);
    guess = found.friction;
    return found.loss - level;
  };
  for (std::size_t i = 1; i < extremes_.size(); ++i) {
    const Point &p = extremes_[i - 1], &q = extremes_[i];
    const double before = p.loss - level, after = q.loss - level;
    if (!(before * after < 0)) continue;
    std::uintmax_t iterations = 100;
    const auto [l, r] = boost::math::tools::toms748_solve(fold, p.restitution, q.restitution, before, after,
                                                          boost::math::tools::eps_tolerance<double>(52), iterations);
    breaks.push_back({0.5 * (l + r), true});
  }
  // A root of mu comes in at 0, and under `coulomb` at mu_c.
  const auto enters = [&](double normal) {
    const double squared = (1 - level * normal / curve_.energy()) / curve_.kept();
    if (squared > lower_ * lower_ && squared < upper_ * upper_) breaks.push_back({std::sqrt(squared), false});
  };
  enters(curve_.normal(0));
  if (curve_.coulomb()) enters(curve_.normal(curve_.end()));
  for (double eta : {1e-9, 1e-6, 1e-3, 0.02})
    if (!curve_.coulomb() && eta > lower_ && eta < upper_) breaks.push_back({eta, false});
  breaks.push_back({upper_, false});
  std::sort(breaks.begin(), breaks.end(), [](const Break& p, const Break& q) { return p.restitution < q.restitution; });
  std::vector<Piece> found;
  const double sign = curve_.coulomb() ? -1 : 1;
  for (std::size_t i = 1; i < breaks.size(); ++i) {
    const Break &l = breaks[i - 1], &r = breaks[i];
    if (!(r.restitution > l.restitution)) continue;
    if (sign * fold(0.5 * (l.restitution + r.restitution)) >= 0) continue;
    found.push_back({l.restitution, r.restitution, l.fold, r.fold});
  }
  return found;
}

// A part of a piece with the integral over it.
struct LandingDensity::Panel {
  const Piece* piece;
  double from, to, value = 0, error = 0;
  bool operator<(const Panel& other) const { return error < other.error; }
};

double LandingDensity::integrand(const Piece& p, double t, double level, Guess& guess) const {
  const MappedPoint at = mapped_point(p.lower, p.upper, p.fold_below, p.fold_above, t);
  const double weight = at.speed * restitution_.density(at.restitution);
  return weight > 0 ? weight * given_restitution(at.restitution, level, guess) : 0;
}

// Cuts the pieces into panels and leaves out those whose size, by three points, does not count.
std::vector<LandingDensity::Panel> LandingDensity::panels(const std::vector<Piece>& all, double level,
                                                          Guess& guess) const {
  std::vector<Panel> panels, kept;
  std::vector<double> size;
  double largest = 0;
  const double step = std::min(1.5 * restitution_.sd(), 3 * friction_.sd());
  for (const Piece& p : all) {
    const int count = std::clamp(static_cast<int>(std::ceil((p.upper - p.lower) / step)), 1, 80);
    double left = integrand(p, 0, level, guess);
    if (p.fold_below) left = 0;
    for (int i = 0; i < count; ++i) {
      const double from = static_cast<double>(i) / count, to = static_cast<double>(i + 1) / count;
      const double middle = integrand(p, 0.5 * (from + to), level, guess),
                   right = i + 1 == count && p.fold_above ? 0 : integrand(p, to, level, guess);
      panels.push_back({&p, from, to});
      size.push_back(std::max({left, middle, right}) * (to - from));
      largest = std::max(largest, size.back());
      left = right;
    }
  }
  for (std::size_t i = 0; largest > 0 && i < panels.size(); ++i)
    if (!(size[i] < negligible * largest)) kept.push_back(panels[i]);
  return kept;
}

void LandingDensity::evaluate(Panel& p, double level, Guess& guess) const {
  p.value = LandingRule::integrate([&](double t) { return integrand(*p.piece, t, level, guess); }, p.from, p.to, 0, 0.0,
                                   &p.error);
  // As in rest_probability.cpp, Boost's estimate is that of the Gauss rule on [-1, 1].
  const double difference = p.error * (p.to - p.from) / 2;
  p.error = p.value > 0 ? p.value * std::min(1.0, std::pow(200 * difference / p.value, 1.5)) : 0;
}

// Halves the panel with the largest error until their sum is small enough.
double LandingDensity::integrate(const std::vector<Piece>& all, double level) const {
  Guess guess;
  std::vector<Panel> kept = panels(all, level, guess);
  for (Panel& p : kept) evaluate(p, level, guess);
  std::make_heap(kept.begin(), kept.end());
  double sum = 0, error = 0;
  const auto add_up = [&] {
    sum = error = 0;
    for (const Panel& p : kept) {
      sum += p.value;
      error += p.error;
    }
  };
  for (add_up(); error > tolerance * sum && kept.size() < most_panels; add_up()) {
    std::pop_heap(kept.begin(), kept.end());
    Panel lower = kept.back(), upper = lower;
    lower.to = upper.from = 0.5 * (lower.from + lower.to);
    kept.pop_back();
    for (Panel* half : {&lower, &upper}) {
      evaluate(*half, level, guess);
      kept.push_back(*half);
      std::push_heap(kept.begin(), kept.end());
    }
  }
  return sum;
}

double LandingDensity::operator()(double next) const {
  if (next < curve_.lowest()) return 0;
  const double level = curve_.level(next);
  const double per_loss = curve_.inertia() / 2;
  if (restitution_.constant()) {
    Guess guess;
    return per_loss * given_restitution(lower_, level, guess);
  }
  double sum = integrate(pieces(level), level);
  if (curve_.coulomb()) sum += sticking(level);
  return per_loss * sum;
}

}  // namespace metastable::dynamics
