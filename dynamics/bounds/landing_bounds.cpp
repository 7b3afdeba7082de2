#include "dynamics/bounds/landing_bounds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "dynamics/bounds/restitution_panels.h"

namespace metastable::dynamics {
namespace {

constexpr double far_friction = 12;                        // mu beyond so many sds: its tail alone is counted
constexpr int strips = 24;                                 // of [0, mu_c]
constexpr double nearly_none = 1e-22, nearly_all = 1e-11;  // where the table ends

bool negative(const Interval& a) { return a.upper < 0; }
double magnitude(const Interval& a) { return std::max(std::abs(a.lower), std::abs(a.upper)); }
Interval clipped(const Interval& a, double lower, double upper) {
  return {std::clamp(a.lower, lower, upper), std::clamp(a.upper, lower, upper)};
}

using Shape = FrictionTerms<Interval>;
using RoughShape = FrictionTerms<double>;
using Drive = RestitutionTerms;

struct Panel : MomentPanel {
  Drive at_centre, slope_at_centre;  // values and d/d eta
  Drive over, slope, bend;           // over the panel: values, d/d eta, d^2/d eta^2
  double start = 0;                  // G falls with mu from here on
  int open_strips = 0;               // strips below `start`
  double least_fall = 0;             // -dG/dmu from `start` on, for all speeds
};

// Holds what is known of one panel's H = P(mu > mu*) on a set of (t, q).
struct Root {
  enum class Kind { enclosed, constant, open } kind = Kind::open;
  Interval friction;  // mu* if enclosed; where it lies within [start, cap], if it does, otherwise
  Interval share;     // range of H
};

}  // namespace

class LandingBounds::Table {
 public:
  Table(const WheelMap& map, int phase, double lowest, double highest, const BoundsResolution& resolution,
        const ForEach& for_each)
      : level_(map, phase), eta_(map.noise().restitution()), mu_(map.noise().friction()) {
    refuse(map);
    limits();
    make_strips();
    make_panels(resolution.restitution_step);
    speeds(lowest, highest, resolution.speed_cells);
    levels(lowest, highest, resolution.level_step);
    fill(for_each);
  }

  Interval level(const Interval& state, const Interval& edge) const {
    Interval drop = edge - level_.gain;
    drop = {std::max(drop.lower, level_.barrier.lower), std::max(drop.upper, level_.barrier.upper)};
    return drop / state;
  }

  // Returns q = 1/omega.
  Interval speed(const Interval& state) const {
    const Interval q = inverse(sqrt(state));
    if (!(state.lower > 0 && q.lower >= q_.front() && q.upper <= q_.back()))
      throw std::out_of_range(
          fmt::format("landing bounds: state {} to {} is outside the table", state.lower, state.upper));
    return q;
  }

  Interval below(double state, double edge) const {
    const Interval t = level(state, edge), q = speed(state);
    const auto [first_q, last_q] = cells(q_, q);
    if (t.upper <= t_.front()) return {0, bounded(q, 0, false)};
    if (t.lower >= t_.back()) return {bounded(q, t_.size() - 1, true), 1};
    const auto [first_t, last_t] = cells(t_, t);
    Interval all(1, 0);
    for (std::size_t j = first_q; j <= last_q; ++j)
      for (std::size_t i = first_t; i <= last_t; ++i) {
        const Interval part = interpolate(i, j, t, q);
        all = all.lower > all.upper ? part : hull(all, part);
      }
    if (t.lower < t_.front()) all.lower = 0;
    if (t.upper > t_.back()) all.upper = 1;
    return clipped(all, 0, 1);
  }

  std::optional<Curvature> curvature(const Interval& state, const Interval& edge) const {
    const Interval t = level(state, edge), q = speed(state);
    if (t.lower < t_.front() || t.upper > t_.back()) return std::nullopt;
    const auto [first_q, last_q] = cells(q_, q);
    const auto [first_t, last_t] = cells(t_, t);
    Derivatives d = cell_[index(first_t, first_q)];
    for (std::size_t j = first_q; j <= last_q; ++j)
      for (std::size_t i = first_t; i <= last_t; ++i) {
        const Derivatives& more = cell_[index(i, j)];
        d = {hull(d.t, more.t),
             hull(d.q, more.q),
             hull(d.tt, more.tt),
             hull(d.tq, more.tq),
             hull(d.qq, more.qq),
             std::max(d.loose, more.loose),
             std::max(d.steps, more.steps),
             std::max(d.kink_t, more.kink_t),
             std::max(d.kink_q, more.kink_q)};
      }
    const Interval per = inverse(state);
    const Interval t1 = -(t * per), q1 = -(q * per * Interval(0.5));
    Curvature c;
    c.state = d.tt * square(t1) + Interval(2) * (d.tq * (t1 * q1)) + d.qq * square(q1) +
              d.t * (Interval(2) * t * square(per)) + d.q * (Interval(0.75) * q * square(per));
    c.edge = d.tt * square(per);
    // Along x or e the cells are crossed one by one. Steps deviate from the chord by their height. What bends in a cell
    // without a second derivative changes its slope there by at most twice the bound: a deviation of a quarter of that
    // times the length.
    const double crossed = static_cast<double>((last_t - first_t + 1) + (last_q - first_q + 1)) * (1 + 1e-12);
    const double slope = d.kink_t * magnitude(t1) + d.kink_q * magnitude(q1);
    c.loose_state = crossed * (d.steps + 0.5 * (state.upper - state.lower) * slope) * (1 + 1e-12);
    c.loose_edge = crossed * (d.steps + 0.5 * (edge.upper - edge.lower) * d.kink_t * per.upper) * (1 + 1e-12);
    return c;
  }

  double overshoot(double state, double edge) const {
    const Interval x(state), root = sqrt(x);
    Interval sum(0);
    for (const Panel& p : panels_) {
      const auto [s, d] = best(p);
      const Interval over = s * x + d * root + level_.gain - Interval(edge);
      sum += p.weight * Interval(0, std::max(0.0, over.upper));
    }
    const Interval most = most_scale_ * x + most_drag_ * root + level_.gain - Interval(edge);
    sum += outside_ * Interval(0, std::max(0.0, most.upper));
    return sum.upper;
  }

  double growth(double state) const {
    const Interval half = Interval(0.5) / sqrt(Interval(state));
    Interval sum(0);
    for (const Panel& p : panels_) {
      const auto [s, d] = best(p);
      sum += p.weight * Interval(0, std::max(0.0, (s + d * half).upper));
    }
    sum += outside_ * Interval(0, std::max(0.0, (most_scale_ + most_drag_ * half).upper));
    return sum.upper;
  }

 private:
  struct Derivatives {
    Interval t, q, tt, tq, qq;
    double loose = 0;               // oscillation of what has no derivatives
    double steps = 0;               // of it, what is constant but for steps
    double kink_t = 0, kink_q = 0;  // and bounds on the slopes of the rest, in t and q
  };

  static void refuse(const WheelMap& map) {
    if (map.noise().is_empirical())
      throw NoBounds("bounds need distributions of restitution and friction, not a list of pairs");
    if (map.noise().correlation() != 0) throw NoBounds("bounds need restitution and friction to be independent");
    if (map.noise().friction().constant()) throw NoBounds("bounds need friction to vary (sd above 0)");
  }

  void limits() {
    turn_ = level_.turn;
    cap_ = std::min(mu_.mean() + far_friction * mu_.sd(), 0.98 * level_.jam);
    if (!(cap_ > turn_ && (cap_ > 2 * turn_ || cap_ > mu_.mean() + 6 * mu_.sd())))
      throw NoBounds("friction lies below what the law needs to slow the foot");
    mu_mass_ = normal_tail(score(Interval(mu_.lower())));
    if (!(mu_mass_.lower > 0)) throw NoBounds("hardly any of friction's normal distribution lies above 0");
    beyond_ = (normal_tail(score(Interval(cap_))) / mu_mass_).upper;
  }

  void make_strips() {
    for (int i = 0; i < strips; ++i) strip_.push_back(turn_ * i / strips);
    strip_.push_back(turn_);
    for (int i = 0; i < strips; ++i) {
      const Interval m(strip_[i], strip_[i + 1]);
      strip_shape_.push_back(shape(m));
      strip_mass_.push_back(
          clipped((normal_tail(score(strip_[i])) - normal_tail(score(strip_[i + 1]))) / mu_mass_, 0, 1));
    }
  }

  Interval score(const Interval& mu) const { return (mu - Interval(mu_.mean())) / Interval(mu_.sd()); }
  // Returns P(mu* < mu < cap); what lies beyond the cap is open.
  Interval exceeding(const Interval& mu) const {
    const Interval all = clipped(normal_tail(score(mu)) / mu_mass_, 0, 1);
    return {std::max(0.0, rounding::down(all.lower - beyond_)), all.upper};
  }

  Shape shape(const Interval& mu) const { return level_.at(mu); }
  RoughShape rough_shape(double mu) const { return level_.roughly_at(mu); }

  // ---- eta ----------------------------------------------------------------------------------------------------------

  void add_panel(const MomentPanel& moments) {
    Panel p;
    static_cast<MomentPanel&>(p) = moments;
    const Interval whole(p.lower, p.upper), at(p.centre);
    p.at_centre = level_.drive(at);
    p.slope_at_centre = level_.drive_slope(at);
    p.over = level_.drive(whole);
    p.slope = level_.drive_slope(whole);
    p.bend = level_.drive_bend(whole);
    p.start = turn_;
    p.open_strips = strips;
    panels_.push_back(p);
  }

  void make_panels(double step) {
    try {
      const PanelCut cut = restitution_panels(eta_, step);
      for (const MomentPanel& moments : cut.panels) add_panel(moments);
      outside_ = cut.outside;
    } catch (const std::domain_error& error) {
      throw NoBounds(error.what());
    }
    open_ = std::min(1.0, rounding::up(outside_.upper + beyond_));
    // These are the least b and u over all mu: they rise from mu_c on, where both are 0.
    least_b_ = least_u_ = 0;
    for (const Shape& f : strip_shape_) {
      least_b_ = std::min(least_b_, f.b.lower);
      least_u_ = std::min(least_u_, f.u.lower);
    }
    most_scale_ = level_.kept - level_.kappa * Interval(4) * Interval(least_b_);
    most_drag_ = level_.delta * Interval(2) * sqrt(square(around(std::numbers::pi)) + Interval(709.0 * 709.0)) *
                 Interval(-least_u_);
  }

  // These bound s and -d over mu from above, on a panel.
  std::pair<Interval, Interval> best(const Panel& p) const {
    const Interval s = level_.kept - p.over.k1 * inverse(level_.inverse_mass) - p.over.k2 * Interval(least_b_);
    return {s, p.over.k3 * Interval(-least_u_)};
  }

  // ---- grid of (t, q)
  // -------------------------------------------------------------------------------------------------

  void speeds(double lowest, double highest, int count) {
    const double from = 1 / std::sqrt(highest) * (1 - 1e-9), to = 1 / std::sqrt(lowest) * (1 + 1e-9);
    for (int i = 0; i <= count; ++i) q_.push_back(from + (to - from) * i / count);
    // From this mu on G falls with mu, for all speeds.
    const Interval q(from, to);
    for (Panel& p : panels_) {
      const double at_turn = slope(rough_shape(turn_), p, 0.5 * (from + to));
      while (p.open_strips > 0) {
        const Interval fall = mu_slope(strip_shape_[p.open_strips - 1], p.over, q);
        if (!(fall.upper < 0.25 * at_turn)) break;
        --p.open_strips;
      }
      p.start = strip_[p.open_strips];
      p.least_fall = -mu_slope(shape(Interval(turn_)), p.over, q).upper;
      for (int s = p.open_strips; s < strips; ++s)
        p.least_fall = std::min(p.least_fall, -mu_slope(strip_shape_[s], p.over, q).upper);
      if (!(p.least_fall > 0)) throw NoBounds("the landing cannot be shown to fall with friction");
    }
  }

  double slope(const RoughShape& f, const Panel& p, double q) const {
    return -(p.at_centre.k1.middle() * f.a1 + p.at_centre.k2.middle() * f.b1 + q * p.at_centre.k3.middle() * f.u1);
  }
  double value(const RoughShape& f, const Panel& p, double q) const {
    return level_.kept.middle() -
           (p.at_centre.k1.middle() * f.a + p.at_centre.k2.middle() * f.b + q * p.at_centre.k3.middle() * f.u);
  }
  static Interval mu_slope(const Shape& f, const Drive& k, const Interval& q) {
    return -(k.k1 * f.a1 + k.k2 * f.b1 + q * (k.k3 * f.u1));
  }

  void levels(double lowest, double highest, double step) {
    const Panel& p = *std::max_element(panels_.begin(), panels_.end(),
                                       [](const Panel& a, const Panel& b) { return a.weight.upper < b.weight.upper; });
    const double q = 0.5 * (q_.front() + q_.back());
    const double m = std::clamp(mu_.mean(), turn_, cap_);
    const RoughShape f = rough_shape(m);
    const double by_mu = slope(f, p, q) * mu_.sd();
    const double by_eta =
        (p.slope_at_centre.k1.middle() * f.a + p.slope_at_centre.k2.middle() * f.b) * (eta_.constant() ? 0 : eta_.sd());
    const double sd = std::hypot(by_mu, by_eta), width = step * sd;
    const double floor = level_.barrier.lower / highest, ceiling = std::max(highest / lowest, 2 * floor);
    // The table covers what lies between nearly_none and nearly_all, scanned at both ends of q.
    double first = floor, last = floor;
    bool some = false, all = false;
    for (double t = floor; t < ceiling + sd / 2 && !all; t += sd / 2) {
      const Interval a = point(t, q_.front()), b = point(t, q_.back());
      if (!some) {
        if (std::max(a.upper, b.upper) > nearly_none)
          some = true;
        else
          first = t;
      }
      last = t;
      all = std::min(a.lower, b.lower) > 1 - nearly_all;
    }
    if (!(last > first)) throw NoBounds("no noise moves the landing");
    const auto count = static_cast<std::size_t>(std::ceil((last - first) / width)) + 1;
    first *= 1 - 1e-12;
    for (std::size_t i = 0; i <= count; ++i) t_.push_back(first + width * static_cast<double>(i));
  }

  static std::pair<std::size_t, std::size_t> cells(const std::vector<double>& grid, const Interval& range) {
    const auto cell = [&](double v) {
      const double at = (v - grid.front()) / (grid.back() - grid.front()) * static_cast<double>(grid.size() - 1);
      auto i = static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(grid.size() - 2)));
      while (i > 0 && v < grid[i]) --i;
      while (i + 2 < grid.size() && v > grid[i + 1]) ++i;
      return i;
    };
    return {cell(range.lower), cell(range.upper)};
  }
  std::size_t index(std::size_t t, std::size_t q) const { return q * (t_.size() - 1) + t; }
  const Interval& corner(std::size_t t, std::size_t q) const { return corner_[q * t_.size() + t]; }

  // Bounds C along one line of constant t by the corners of the cells q touches, whose C is monotone in t only.
  double bounded(const Interval& q, std::size_t t, bool lower) const {
    const auto [first, last] = cells(q_, q);
    double bound = lower ? 1 : 0;
    for (std::size_t j = first; j <= last; ++j) {
      const Interval part = interpolate(t == 0 ? 0 : t - 1, j, Interval(t_[t]), common(q, {q_[j], q_[j + 1]}));
      bound = lower ? std::min(bound, part.lower) : std::max(bound, part.upper);
    }
    return std::clamp(bound, 0.0, 1.0);
  }

  Interval interpolate(std::size_t i, std::size_t j, Interval t, Interval q) const {
    const double t0 = t_[i], t1 = t_[i + 1], q0 = q_[j], q1 = q_[j + 1];
    t = {std::clamp(t.lower, t0, t1), std::clamp(t.upper, t0, t1)};
    q = {std::clamp(q.lower, q0, q1), std::clamp(q.upper, q0, q1)};
    const Interval u = clipped((t - Interval(t0)) / (Interval(t1) - Interval(t0)), 0, 1);
    const Interval v = clipped((q - Interval(q0)) / (Interval(q1) - Interval(q0)), 0, 1);
    const auto mix = [](const Interval& a, const Interval& b, const Interval& s) {
      // It encloses a + (b - a) s, whose ends lie at ends of a, b and s.
      const auto at = [&](double x, double y, double w) { return x * (1 - w) + y * w; };
      const double low = std::min(at(a.lower, b.lower, s.lower), at(a.lower, b.lower, s.upper));
      const double high = std::max(at(a.upper, b.upper, s.lower), at(a.upper, b.upper, s.upper));
      return Interval(std::max(0.0, rounding::down(low, 4)), rounding::up(high, 4));
    };
    const Interval flat =
        mix(mix(corner(i, j), corner(i + 1, j), u), mix(corner(i, j + 1), corner(i + 1, j + 1), u), v);
    const Derivatives& d = cell_[index(i, j)];
    const auto half_product = [](const Interval& s, const Interval& width) {
      const Interval p = s * (Interval(1) - s) * square(width) * Interval(0.5);
      return Interval(std::max(0.0, p.lower), std::min(p.upper, (square(width) * Interval(0.125)).upper));
    };
    const Interval bend =
        d.tt * half_product(u, Interval(t1) - Interval(t0)) + d.qq * half_product(v, Interval(q1) - Interval(q0));
    return clipped(flat - bend + Interval(-d.loose, d.loose), 0, 1);
  }

  // ---- filling it
  // -------------------------------------------------------------------------------------------------------

  void fill(const ForEach& for_each) {
    corner_.resize(t_.size() * q_.size());
    cell_.resize((t_.size() - 1) * (q_.size() - 1));
    for_each(2 * q_.size() - 1, [this](std::size_t job) {
      const std::size_t j = job / 2;
      std::vector<double> guess(panels_.size(), -1);
      if (job % 2 == 0) {
        for (std::size_t i = 0; i < t_.size(); ++i) corner_[j * t_.size() + i] = point(t_[i], q_[j], &guess);
      } else {
        for (std::size_t i = 0; i + 1 < t_.size(); ++i)
          cell_[index(i, j)] = derivatives(Interval(t_[i], t_[i + 1]), Interval(q_[j], q_[j + 1]), guess);
      }
    });
  }

  // Finds the root of G = t at the panel's centre, to double accuracy, not proven.
  double rough_root(const Panel& p, double t, double q, double guess) const {
    double low = p.start, high = cap_;
    if (value(rough_shape(low), p, q) <= t) return low;
    if (value(rough_shape(high), p, q) >= t) return high;
    double m = guess > low && guess < high ? guess : 0.5 * (low + high);
    for (int i = 0; i < 60; ++i) {
      const RoughShape f = rough_shape(m);
      const double miss = value(f, p, q) - t;
      (miss > 0 ? low : high) = m;
      const double next = m - miss / slope(f, p, q);
      if (std::abs(next - m) < 1e-14) break;
      m = next > low && next < high ? next : 0.5 * (low + high);
    }
    return m;
  }

  // Encloses G at one mu over (panel or its centre) x q; `f` is taken at that mu.
  Interval at(const Shape& f, const Panel& p, const Interval& q, bool whole) const {
    const Interval qc(q.middle());
    const Interval base = level_.kept - (p.at_centre.k1 * f.a + p.at_centre.k2 * f.b + qc * (p.at_centre.k3 * f.u));
    const Drive& k = whole ? p.over : p.at_centre;
    Interval sum = base;
    if (q.upper > q.lower) sum += -(k.k3 * f.u) * (q - qc);
    if (whole && p.upper > p.lower)
      sum += -(p.slope.k1 * f.a + p.slope.k2 * f.b + q * (p.slope.k3 * f.u)) *
             (Interval(p.lower, p.upper) - Interval(p.centre));
    return sum;
  }

  Root root(const Panel& p, const Interval& t, const Interval& q, double guess, bool whole) const {
    Root r;
    const Drive& k = whole ? p.over : p.at_centre;
    const Interval start(p.start), most = exceeding(start);
    r.share = {0, most.upper};
    r.friction = {p.start, cap_};
    if (guess >= cap_ && at(shape(Interval(cap_)), p, q, whole).lower > t.upper) {
      r.kind = Root::Kind::constant;
      r.share = Interval(0);
      return r;
    }
    if (guess <= p.start && at(shape(start), p, q, whole).upper < t.lower) {
      r.kind = Root::Kind::constant;
      r.share = most;
      return r;
    }
    const Shape f = shape(Interval(guess));
    const Interval miss = at(f, p, q, whole) - t;
    const double rate = -mu_slope(f, k, q).middle();
    double radius = 1.25 * magnitude(miss) / rate + 1e-15;
    for (int i = 0; i < 4; ++i, radius *= 1.5) {
      const Interval around_guess(guess - radius, guess + radius);
      if (!(around_guess.lower >= p.start && around_guess.upper <= cap_)) break;
      const Interval fall = mu_slope(shape(around_guess), k, q);
      if (!negative(fall)) break;
      const Interval next = Interval(guess) - miss / fall;
      if (next.lower >= around_guess.lower && next.upper <= around_guess.upper) {
        r.kind = Root::Kind::enclosed;
        r.friction = next;
        r.share = exceeding(next);
        return r;
      }
    }
    // There is no derivative, but at least a range of H.
    radius = 1.25 * magnitude(miss) / rate + 1e-15;
    for (int i = 0; i < 3; ++i, radius *= 2) {
      const double above = std::min(guess + radius, cap_), under = std::min(guess - radius, cap_);
      if (r.friction.upper == cap_ && above > p.start && above < cap_ &&
          at(shape(Interval(above)), p, q, whole).upper < t.lower)
        r.friction.upper = above;
      if (r.friction.lower == p.start && under > p.start && at(shape(Interval(under)), p, q, whole).lower > t.upper)
        r.friction.lower = under;
    }
    r.share = {r.friction.upper < cap_ ? exceeding(Interval(r.friction.upper)).lower : 0.0,
               exceeding(Interval(r.friction.lower)).upper};
    return r;
  }

  // Sums the mass of the strips below `start` that lands below t: known, and open.
  std::pair<Interval, double> strip_share(const Panel& p, const Interval& t, const Interval& q) const {
    Interval known(0);
    double open = 0;
    for (int s = 0; s < p.open_strips; ++s) {
      const Shape& f = strip_shape_[s];
      const Interval g = level_.kept - (p.over.k1 * f.a + p.over.k2 * f.b + q * (p.over.k3 * f.u));
      if (g.upper < t.lower)
        known += strip_mass_[s];
      else if (!(g.lower > t.upper))
        open = rounding::up(open + strip_mass_[s].upper);
    }
    return {known, open};
  }

  Interval point(double level, double speed, std::vector<double>* guesses = nullptr) const {
    const Interval t(level), q(speed);
    Interval sum(0, open_);
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      const Panel& p = panels_[i];
      const double guess = rough_root(p, level, speed, guesses ? (*guesses)[i] : -1);
      if (guesses) (*guesses)[i] = guess;
      const Root over = root(p, t, q, guess, true);
      Interval part = p.weight * over.share;
      if (over.kind == Root::Kind::enclosed && p.upper > p.lower) {
        const Root centre = root(p, t, q, guess, false);
        if (centre.kind == Root::Kind::enclosed) {
          const Interval slope = eta_slope(p, centre.friction, q), bend = eta_bend(p, over.friction, q);
          const Interval better = p.weight * centre.share + p.first * slope + Interval(0.5) * (p.second * bend);
          part = common(part, better);
        }
      }
      sum += part;
      if (p.open_strips > 0) {
        const auto [known, open] = strip_share(p, t, q);
        sum += p.weight * (known + Interval(0, open));
      }
    }
    return clipped(sum, 0, 1);
  }

  // Encloses dH/d eta at the centre of the panel.
  Interval eta_slope(const Panel& p, const Interval& mu, const Interval& q) const {
    const Shape f = shape(mu);
    const Drive& k = p.slope_at_centre;
    const Interval by_eta = -(k.k1 * f.a + k.k2 * f.b + q * (k.k3 * f.u));
    const Interval move = -(by_eta / mu_slope(f, p.at_centre, q)) / Interval(mu_.sd());
    return -(normal_bump(score(mu)) / mu_mass_ * move);
  }

  // Encloses d^2 H/d eta^2 over the panel.
  Interval eta_bend(const Panel& p, const Interval& mu, const Interval& q) const {
    const Shape f = shape(mu);
    const auto combine = [&](const Drive& k, const Interval& a, const Interval& b, const Interval& u) {
      return -(k.k1 * a + k.k2 * b + q * (k.k3 * u));
    };
    const Interval g_m = combine(p.over, f.a1, f.b1, f.u1), g_mm = combine(p.over, f.a2, f.b2, f.u2);
    const Interval g_e = combine(p.slope, f.a, f.b, f.u), g_em = combine(p.slope, f.a1, f.b1, f.u1);
    const Interval g_ee = combine(p.bend, f.a, f.b, f.u);
    const Interval per = inverse(g_m), sd(mu_.sd()), z = score(mu);
    const Interval m_e = -(g_e * per);
    const Interval m_ee = -((g_ee + Interval(2) * (g_em * m_e) + g_mm * square(m_e)) * per);
    return -(normal_bump(z) / mu_mass_ * (m_ee / sd - z * square(m_e / sd)));
  }

  Derivatives derivatives(const Interval& t, const Interval& q, std::vector<double>& guesses) const {
    Derivatives sum;
    double loose = 0, steps = open_;
    const Interval sd_inverse = inverse(Interval(mu_.sd())), mass_inverse = inverse(mu_mass_);
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      const Panel& p = panels_[i];
      const double guess = guesses[i] = rough_root(p, t.middle(), q.middle(), guesses[i]);
      const Root over = root(p, t, q, guess, true);
      if (over.kind == Root::Kind::enclosed) {
        const Shape f = shape(over.friction);
        const Interval g_m = mu_slope(f, p.over, q), per = inverse(g_m);
        const Interval g_mm = -(p.over.k1 * f.a2 + p.over.k2 * f.b2 + q * (p.over.k3 * f.u2));
        const Interval g_q = -(p.over.k3 * f.u), g_qm = -(p.over.k3 * f.u1);
        const Interval m_q = -(g_q * per), bent = g_mm * m_q;
        const Interval z = score(over.friction), bump = p.weight * normal_bump(z) * mass_inverse;
        const Interval z_t = per * sd_inverse, z_q = m_q * sd_inverse;
        const Interval z_tt = -(g_mm * (per * square(per))) * sd_inverse;
        const Interval z_tq = -((bent + g_qm) * square(per)) * sd_inverse;
        const Interval z_qq = -((Interval(2) * (g_qm * m_q) + bent * m_q) * per) * sd_inverse;
        sum.t += -(bump * z_t);
        sum.q += -(bump * z_q);
        sum.tt += -(bump * (z_tt - z * square(z_t)));
        sum.tq += -(bump * (z_tq - z * (z_t * z_q)));
        sum.qq += -(bump * (z_qq - z * square(z_q)));
      } else if (over.kind == Root::Kind::open) {
        loose = rounding::up(loose + p.weight.upper * (over.share.upper - over.share.lower), 4);
        const Interval steepest =
            p.weight * normal_bump(score(over.friction)) * mass_inverse * sd_inverse / Interval(p.least_fall);
        sum.kink_t = rounding::up(sum.kink_t + steepest.upper);
        sum.kink_q =
            rounding::up(sum.kink_q + (steepest * p.over.k3 * Interval(magnitude(shape(over.friction).u))).upper);
      }
      if (p.open_strips > 0) steps = rounding::up(steps + p.weight.upper * strip_share(p, t, q).second, 4);
    }
    sum.steps = steps;
    sum.loose = rounding::up(loose + steps);
    return sum;
  }

  const PublishedLevel level_;
  const TruncatedNormal eta_;
  const TruncatedNormal mu_;
  Interval mu_mass_, outside_{0};
  Interval most_scale_, most_drag_;
  double turn_ = 0, cap_ = 0, beyond_ = 0, open_ = 0, least_b_ = 0, least_u_ = 0;
  std::vector<double> strip_;
  std::vector<Shape> strip_shape_;
  std::vector<Interval> strip_mass_;
  std::vector<Panel> panels_;
  std::vector<double> t_, q_;
  std::vector<Interval> corner_;
  std::vector<Derivatives> cell_;
};

LandingBounds::LandingBounds(const WheelMap& map, int phase, double lowest, double highest,
                             const BoundsResolution& resolution, const ForEach& for_each)
    : table_(std::make_unique<const Table>(map, phase, lowest, highest, resolution, for_each)) {}
LandingBounds::~LandingBounds() = default;
LandingBounds::LandingBounds(LandingBounds&&) noexcept = default;
LandingBounds& LandingBounds::operator=(LandingBounds&&) noexcept = default;

Interval LandingBounds::below(double state, double edge) const { return table_->below(state, edge); }
std::optional<LandingBounds::Curvature> LandingBounds::curvature(const Interval& state, const Interval& edge) const {
  return table_->curvature(state, edge);
}
double LandingBounds::overshoot(double state, double edge) const { return table_->overshoot(state, edge); }
double LandingBounds::growth(double state) const { return table_->growth(state); }

}  // namespace metastable::dynamics
