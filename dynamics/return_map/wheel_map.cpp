#include "dynamics/return_map/wheel_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/special_functions/ellint_rf.hpp>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "dynamics/return_map/landing_density.h"
#include "dynamics/return_map/landing_quadrature.h"
#include "dynamics/return_map/landing_range.h"
#include "dynamics/return_map/published_density.h"
#include "dynamics/return_map/rest_probability.h"

namespace metastable::dynamics {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double degree = std::numbers::pi / 180;

Stance make_stance(const Wheel& wheel, Law law, double length, const Triangle& landed, const Triangle& next,
                   double slope) {
  Stance s;
  s.length = length;
  s.inertia = stance_inertia(wheel, law, length);
  if (!(s.inertia > 0))
    throw std::invalid_argument(
        fmt::format("inertia: {} kg m^2 about a foot at {} m is outside (0, inf)", s.inertia, length));
  s.start_angle_rad = landed.beta_second_rad + slope;
  s.end_angle_rad = std::numbers::pi - (next.beta_first_rad - slope);
  s.pendulum = 2 * wheel.hub_mass * wheel.gravity * length / s.inertia;
  s.barrier = s.start_angle_rad < std::numbers::pi / 2 ? s.pendulum * (1 - std::sin(s.start_angle_rad)) : 0;
  s.gain = s.pendulum * (std::sin(s.start_angle_rad) - std::sin(s.end_angle_rad));
  return s;
}

struct Landing {
  double origin, width, barrier, gain;
};

METASTABLE_WIDE void land_all(const Landing& of, const double* offset, const double* scale, const double* drag,
                              std::span<double> next) {
  const auto [origin, width, barrier, gain] = of;
  for (std::size_t k = 0; k < next.size(); ++k) {
    const double state = origin + width * offset[k];
    const double after = scale[k] * state - drag[k] * std::sqrt(state);
    next[k] = after >= barrier ? after + gain : -infinity;
  }
}

// Integrates d phi / sqrt(a + b sin^2 phi) over sin^2 phi in [from, to], phi in [0, pi/2] (DLMF 19.29.4).
double pendulum_integral(double a, double b, double from, double to) {
  const double x1 = std::sqrt(to), x2 = std::sqrt(1 - to), x3 = std::sqrt(a + b * to);
  const double y1 = std::sqrt(from), y2 = std::sqrt(1 - from), y3 = std::sqrt(a + b * from);
  const double u12 = (x1 * x2 * y3 + y1 * y2 * x3) / (to - from);
  const double u13 = (x1 * x3 * y2 + y1 * y3 * x2) / (to - from);
  const double u23 = (x2 * x3 * y1 + y2 * y3 * x1) / (to - from);
  return boost::math::ellint_rf(u12 * u12, u13 * u13, u23 * u23);
}

}  // namespace

// They are made when first asked for: they take a thousand times as long as the rest of a map, and few maps are asked.
struct WheelMap::FastDensities {
  std::once_flag made;
  std::vector<PublishedDensity> by_phase;
};

WheelMap::WheelMap(Wheel wheel, double slope, Law law, ContactNoise noise, double rebound_lost)
    : wheel_(std::move(wheel)), slope_(slope), noise_(std::move(noise)) {
  wheel_.validate();
  const double steepest = steepest_slope(wheel_.legs());
  if (!(slope > 0 && slope < steepest))
    throw std::invalid_argument(
        fmt::format("slope: {:.6g} deg is outside (0, {:.6g}) deg (half the angle between legs)", slope / degree,
                    steepest / degree));
  model_ = dynamics::contact_model(wheel_, law, rebound_lost);
  const auto count = wheel_.equal_legs() ? std::size_t{1} : wheel_.leg_length.size();
  const auto leg = [this, count](std::size_t p) { return wheel_.leg_length[p % count]; };
  for (std::size_t p = 0; p < count; ++p)
    triangle_.push_back(dynamics::triangle(leg(p + count - 1), leg(p), wheel_.leg_angle()));
  for (std::size_t p = 0; p < count; ++p)
    stance_.push_back(make_stance(wheel_, law, leg(p), triangle_[p], triangle_[(p + 1) % count], slope));
  fast_densities_ = std::make_shared<FastDensities>();
}

const std::vector<PublishedDensity>& WheelMap::fast_densities() const {
  std::call_once(fast_densities_->made, [this] {
    if (!PublishedDensity::covers(*this)) return;
    for (int p = 0; p < phases(); ++p) fast_densities_->by_phase.emplace_back(*this, p);
  });
  return fast_densities_->by_phase;
}

Collision WheelMap::collision(int phase, double omega) const {
  const Triangle& t = triangle(phase);
  Collision c;
  c.stance_length = stance(phase > 0 ? phase - 1 : phases() - 1).length;
  c.landing_length = stance(phase).length;
  c.contact_x = t.contact_x;
  c.contact_y = t.hub_height;
  c.chord = t.chord;
  c.normal_speed = t.chord * omega;
  c.slope_rad = slope_;
  return c;
}

Loss WheelMap::loss(int phase, double omega, const Contact& contact) const {
  return collide(model_, collision(phase, omega), contact);
}

StepCoefficients WheelMap::coefficients(int phase, const Contact& contact) const {
  // A rolling wheel (u0 = 0) loses energies proportional to omega^2, and gains a potential energy proportional to
  // omega: the losses at 1 rad/s are the coefficients.
  const Loss unit = loss(phase, 1, contact);
  if (unit.jammed) return {-infinity, 0};
  const double landing = stance(phase).inertia;
  const double before = stance(phase > 0 ? phase - 1 : phases() - 1).inertia;
  const double quadratic = unit.normal() + unit.tangential() + unit.rebound;
  return {(before - 2 * quadratic) / landing, -2 * unit.potential / landing};
}

double WheelMap::after_collision(double state, int phase, const Contact& contact) const {
  const StepCoefficients c = coefficients(phase, contact);
  return c.scale == -infinity ? -infinity : c.scale * state - c.drag * std::sqrt(state);
}

std::pair<double, double> WheelMap::state_interval(int phase) const {
  const Stance& before = stance(phase > 0 ? phase - 1 : phases() - 1);
  return {before.barrier + before.gain, infinity};
}

std::optional<double> WheelMap::landing(double state, int phase, std::span<const double> score) const {
  const double after = after_collision(state, phase, noise_.draw(score));
  const Stance& s = stance(phase);
  if (!(after >= s.barrier)) return std::nullopt;
  return after + s.gain;
}

std::optional<double> WheelMap::rest_probability(double state, int phase) const {
  if (!noise_.is_empirical() && noise_.correlation() != 0) return std::nullopt;
  return dynamics::rest_probability(*this, state, phase);
}

std::optional<double> WheelMap::landing_density(double state, int phase, std::span<const double> next,
                                                std::span<double> density) const {
  const std::vector<PublishedDensity>& densities = fast_densities();
  if (densities.empty()) return std::nullopt;
  const PublishedDensity& fast = densities[static_cast<std::size_t>(phase)];
  if (state >= fast.slowest()) return fast(state, next, density);
  const LandingDensity at(*this, state, phase);
  std::transform(next.begin(), next.end(), density.begin(), at);
  return dynamics::rest_probability(*this, state, phase);
}

double WheelMap::landing_points(double state, int phase, std::span<const double> breaks,
                                std::vector<std::pair<double, double>>& points) const {
  return dynamics::landing_points(*this, state, phase, breaks, points);
}

std::vector<double> WheelMap::states_of_extremes(int phase, std::span<const double> next) const {
  return dynamics::states_of_extremes(*this, phase, next);
}

std::pair<double, double> WheelMap::landing_range(double state, int phase) const {
  const auto [least, most] = after_collision_range(*this, state, phase);
  const Stance& s = stance(phase);
  const auto landed = [&s](double after) { return after >= s.barrier ? after + s.gain : -infinity; };
  return {landed(least), landed(most)};
}

double WheelMap::duration(double next_state, int phase) const {
  // With theta = pi/2 + 2 phi, omega^2 is apex + 2 pendulum sin^2(phi).
  const Stance& s = stance(phase);
  const double lift = 2 * s.pendulum;
  const double start = std::sin((s.start_angle_rad - std::numbers::pi / 2) / 2);
  const double end = std::sin((s.end_angle_rad - std::numbers::pi / 2) / 2);
  const double apex = next_state - lift * end * end;
  if (start >= 0) {
    if (apex + lift * start * start < 0) return infinity;
    return 2 * pendulum_integral(apex, lift, start * start, end * end);
  }
  if (apex <= 0) return infinity;
  return 2 * (pendulum_integral(apex, lift, 0, start * start) + pendulum_integral(apex, lift, 0, end * end));
}

double WheelMap::advance(int phase) const { return triangle((phase + 1) % phases()).chord; }

std::vector<std::string> WheelMap::assumptions() const { return {"foot lifts", "negative loss", "energy gain"}; }

bool WheelMap::violates(int which, double state, int phase, std::span<const double> score) const {
  if (which == 0) {
    const Triangle& t = triangle(phase);
    const double stance_length = stance(phase > 0 ? phase - 1 : phases() - 1).length;
    const Stance& s = stance(phase);
    return state * stance_length > wheel_.gravity * std::sin(t.beta_first_rad - slope_) ||
           after_collision(state, phase, noise_.draw(score)) * s.length > wheel_.gravity * std::sin(s.start_angle_rad);
  }
  const Loss l = loss(phase, std::sqrt(state), noise_.draw(score));
  if (l.jammed) return false;
  if (which == 1) return l.normal() < 0 || l.tangential() < 0;
  if (which == 2) return l.total() < 0;
  throw std::invalid_argument(fmt::format("assumption: {} is outside [0, 2]", which));
}

void WheelMap::Table::add(const StepCoefficients& draw) {
  scale_.push_back(draw.scale);
  drag_.push_back(draw.drag);
}

void WheelMap::Table::land(double origin, double width, std::span<const double> offset, std::size_t first,
                           std::span<double> next) const {
  land_all({origin, width, barrier_, gain_}, offset.data(), scale_.data() + first, drag_.data() + first, next);
}

// Solves scale x - drag sqrt(x) = barrier; a loss of more than all energy may leave survivors at low speeds, by
// the potential energy gained.
double WheelMap::Table::lowest_survivor(std::size_t k) const {
  const double scale = scale_[k], drag = drag_[k];
  if (!(scale > 0)) return drag < 0 && scale > -infinity ? 0 : infinity;
  constexpr double rounding = 1e-12;
  const double root = (drag + std::sqrt(drag * drag + 4 * scale * barrier_)) / (2 * scale);
  return root > 0 ? root * root * (1 - rounding) : 0;
}

void WheelMap::Table::reorder(std::span<const std::uint32_t> order) {
  for (std::vector<double>* of : {&scale_, &drag_}) {
    std::vector<double> moved;
    for (const std::uint32_t k : order) moved.push_back((*of)[k]);
    *of = std::move(moved);
  }
}

WheelMap::Table WheelMap::tabulate(int phase, std::span<const double> score) const {
  const auto dimension = static_cast<std::size_t>(noise_dimension());
  if (score.size() % dimension != 0)
    throw std::invalid_argument(fmt::format("score: {} numbers are not a multiple of {}", score.size(), dimension));
  Table table(stance(phase));
  for (std::size_t i = 0; i < score.size(); i += dimension)
    table.add(coefficients(phase, noise_.draw(score.subspan(i, dimension))));
  return table;
}

double lift_speed(const WheelMap& map, int phase) {
  const Stance& before = map.stance(phase > 0 ? phase - 1 : map.phases() - 1);
  const double pull = map.wheel().gravity * std::sin(map.triangle(phase).beta_first_rad - map.slope());
  return std::sqrt(std::max(0.0, pull) / before.length);
}

}  // namespace metastable::dynamics
