#include "dynamics/wheel/wheel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "dynamics/wheel/ranges.h"

namespace metastable::dynamics {
namespace {

void require_positive(const char* name, double value, const char* unit) {
  if (!(value > 0) || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("{}: {} {} is outside (0, inf)", name, value, unit));
}

}  // namespace

std::vector<double> paper_leg_lengths() { return {0.1524, 0.1524, 0.1514, 0.1514, 0.1516, 0.1508, 0.1524, 0.1528}; }

double Wheel::leg_angle() const { return 2 * std::numbers::pi / legs(); }

double Wheel::mean_leg_length() const {
  return std::accumulate(leg_length.begin(), leg_length.end(), 0.0) / static_cast<double>(leg_length.size());
}

bool Wheel::equal_legs() const {
  return std::all_of(leg_length.begin(), leg_length.end(), [this](double l) { return l == leg_length.front(); });
}

void Wheel::validate() const {
  if (leg_length.size() < 3)
    throw std::invalid_argument(fmt::format("leg_length: {} legs are given, 3 or more are needed", leg_length.size()));
  for (std::size_t i = 0; i < leg_length.size(); ++i)
    require_positive(fmt::format("leg_length[{}]", i).c_str(), leg_length[i], "m");
  for (std::size_t i = 0; i < leg_length.size(); ++i)
    for (const std::size_t beside : {i + leg_length.size() - 1, i + 1}) {
      const double neighbour = leg_length[beside % leg_length.size()], least = neighbour * std::cos(leg_angle());
      if (leg_length[i] > least) continue;
      throw std::invalid_argument(
          fmt::format("leg_length[{}]: {} m is outside ({:.4g}, inf) m: beside a leg of {} m, {:.4g} deg from it, a "
                      "shorter one has the "
                      "hub past it as it lands, or never lands",
                      i, leg_length[i], least, neighbour, leg_angle() * 180 / std::numbers::pi));
    }
  require_positive("hub_mass", hub_mass, "kg");
  if (inertia) require_positive("inertia", *inertia, "kg m^2");
  if (contact_mass) require_positive("contact_mass", *contact_mass, "kg");
  require_positive("ramp_stiffness", ramp_stiffness, "N/m");
  require_positive("gravity", gravity, "m/s^2");
  if (radius_of_gyration && !(*radius_of_gyration >= 0 && std::isfinite(*radius_of_gyration)))
    throw std::invalid_argument(fmt::format("radius_of_gyration: {} m is outside [0, inf)", *radius_of_gyration));
  if (const std::string objection = tip_objection(*this); !objection.empty())
    throw std::invalid_argument("tip_radius: " + objection);
}

Triangle triangle(double first, double second, double leg_angle) {
  Triangle t;
  const double cosine = std::cos(leg_angle);
  t.chord = std::sqrt(first * first + second * second - 2 * first * second * cosine);
  t.hub_height = first * second * std::sin(leg_angle) / t.chord;
  t.contact_x = second * (second - first * cosine) / t.chord;
  t.beta_first_rad = std::atan2(t.hub_height, first * (first - second * cosine) / t.chord);
  t.beta_second_rad = std::atan2(t.hub_height, t.contact_x);
  return t;
}

double steepest_slope(int legs) { return std::numbers::pi / legs; }

}  // namespace metastable::dynamics
