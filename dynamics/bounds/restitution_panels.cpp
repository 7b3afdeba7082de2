#include "dynamics/bounds/restitution_panels.h"

#include <algorithm>
#include <stdexcept>

namespace metastable::dynamics {
namespace {

constexpr double reach = 10;  // [sd]
constexpr double slack = 1 + 1e-12;

class Cutter {
 public:
  explicit Cutter(const TruncatedNormal& normal) : mean_(normal.mean()), sd_(normal.sd()) {
    mass_ = normal_between(score(normal.lower()), score(normal.upper()));
    if (!(mass_.lower > 0))
      throw std::domain_error("hardly any of restitution's normal distribution lies within [0, 1]");
  }

  Interval mass(double lower, double upper) const {
    const Interval a = score(lower), b = score(upper);
    // Tails cancel on narrow panels, the range of the density does not.
    const Interval width = (Interval(upper) - Interval(lower)) / Interval(sd_);
    const Interval m = common(normal_between(a, b), normal_bump(hull(a, b)) * width) / mass_;
    return {std::clamp(m.lower, 0.0, 1.0), std::clamp(m.upper, 0.0, 1.0)};
  }

  MomentPanel panel(double lower, double upper) const {
    MomentPanel p;
    p.lower = lower;
    p.upper = upper;
    p.centre = lower + 0.5 * (upper - lower);
    p.weight = mass(lower, upper);
    const Interval a = score(lower), b = score(upper), at_a = normal_bump(a), at_b = normal_bump(b);
    const Interval off = Interval(p.centre) - Interval(mean_);
    const Interval first = Interval(sd_) * (at_a - at_b) / mass_;
    const Interval second = square(Interval(sd_)) * (p.weight + (a * at_a - b * at_b) / mass_);
    // What cancels between these is bounded by the width of the panel.
    const double half = (upper - lower) * 0.5 * slack, most = p.weight.upper * half * slack;
    p.first = common(first - off * p.weight, {-most, most});
    p.second = common(second - Interval(2) * off * first + square(off) * p.weight, {0, most * half * slack});
    return p;
  }

 private:
  Interval score(double x) const { return (Interval(x) - Interval(mean_)) / Interval(sd_); }

  double mean_, sd_;
  Interval mass_;
};

}  // namespace

Interval normal_between(const Interval& a, const Interval& b) {
  if (a.lower > 0) return normal_tail(a) - normal_tail(b);
  if (b.upper < 0) return normal_tail(-b) - normal_tail(-a);
  return Interval(1) - normal_tail(-a) - normal_tail(b);
}

PanelCut restitution_panels(const TruncatedNormal& restitution, double step) {
  PanelCut cut;
  if (restitution.constant()) {
    const double eta = restitution.mean();
    if (!(eta > 0)) throw std::domain_error("bounds need restitution above 0");
    cut.panels.push_back({eta, eta, eta, Interval(1), Interval(0), Interval(0)});
    return cut;
  }
  const Cutter cutter(restitution);
  const double sd = restitution.sd();
  const double lower = std::max(1e-30, restitution.mean() - reach * sd);
  const double upper = std::min(restitution.upper(), restitution.mean() + reach * sd);
  for (double from = lower; from < upper;) {
    const double width = std::min(step * sd, from < 1e-3 ? 9 * from : from);
    const double to = from + width > upper - 1e-9 * sd ? upper : from + width;
    cut.panels.push_back(cutter.panel(from, to));
    from = to;
  }
  Interval outside(0);
  if (lower > restitution.lower()) outside += cutter.mass(restitution.lower(), lower);
  if (upper < restitution.upper()) outside += cutter.mass(upper, restitution.upper());
  cut.outside = {0, std::min(1.0, outside.upper)};
  return cut;
}

}  // namespace metastable::dynamics
