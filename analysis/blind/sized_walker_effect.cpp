#include "analysis/blind/sized_walker_effect.h"

#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "dynamics/catalogue/walker_effects.h"

namespace metastable::analysis {
namespace {

// Holds the id of an effect and the random numbers from which its values are drawn.
struct WalkerDraw {
  std::string id;
  BlindDice& dice;
  double sign;
};

// @param values_of  size -> the effect's values
template <class ValuesOf>
SizedEffect by_size(const WalkerDraw& d, double start, double largest, ValuesOf values_of,
                    std::set<std::string> needs = {}) {
  return {[id = d.id, values_of](double s) {
            return dynamics::Effect{id, values_of(s)};
          },
          start, largest, std::move(needs)};
}

SizedEffect one_way(const WalkerDraw& d, double start, double largest) {
  return by_size(d, start, largest, [](double s) { return std::vector{s}; });
}

SizedEffect two_ways(const WalkerDraw& d, double start, double largest, std::set<std::string> needs = {}) {
  return by_size(
      d, start, largest, [sign = d.sign](double s) { return std::vector{sign * s}; }, std::move(needs));
}

SizedEffect mass_of_leg(const WalkerDraw& d) {
  const double higher = d.dice.chance(0.5) ? 0.2 * d.dice.sign() : 0;  // [m] a unit of the mass ratio's logarithm
  return by_size(d, 0.01, 0.5,
                 [higher, sign = d.sign](double s) {
                   return std::vector{std::exp(sign * s), higher * s};
                 },
                 {"phase"});
}

SizedEffect clock(const WalkerDraw& d) {
  const double frequency = std::exp(d.dice.uniform(std::log(0.005), std::log(0.2)));
  return by_size(d, 0.05, 0.8, [frequency](double s) { return std::vector{s, frequency}; }, {"time_s"});
}

SizedEffect stretch(const WalkerDraw& d) {
  const double from = d.dice.uniform(0.5, 4), to = from + d.dice.uniform(1.5, 4);
  return by_size(d, 0.05, 1,
                 [from, to, sign = d.sign](double s) {
                   return std::vector{sign * s, from, to};
                 },
                 {"position_m"});
}

struct WalkerEntry {
  SizedEffect (*draw)(const WalkerDraw&);
  std::vector<std::string> places;
};

const std::map<std::string, WalkerEntry>& walker_entries() {
  using D = WalkerDraw;
  const std::vector<std::string> anywhere{"phase", "leg", ":mean"};
  const std::vector<std::string> noisy{":spread", ":memory", ":tail", ":correlation"};
  const std::vector<std::string> first{"step", ":mean", ":spread"};
  static const std::map<std::string, WalkerEntry> entries{
      {"hip_damping", {[](const D& d) { return one_way(d, 0.005, 2); }, anywhere}},
      {"hip_dry_friction", {[](const D& d) { return one_way(d, 0.005, 2); }, anywhere}},
      {"impact_loss", {[](const D& d) { return two_ways(d, 5e-4, 0.2); }, anywhere}},
      {"foot_slip", {[](const D& d) { return one_way(d, 1e-4, 0.05); }, anywhere}},
      {"leg_mass", {mass_of_leg, {"leg", ":memory"}}},
      {"leg_length", {[](const D& d) { return two_ways(d, 1e-4, 0.04, {"phase"}); }, {"leg", ":memory"}}},
      {"slope_deg_offset", {[](const D& d) { return two_ways(d, 0.03, 0.6); }, anywhere}},
      {"slope_deg_by_phase", {[](const D& d) { return two_ways(d, 0.04, 1, {"phase"}); }, {"leg", ":memory"}}},
      {"slope_deg_drift", {[](const D& d) { return two_ways(d, 0.1, 1.2); }, {"trial"}}},
      {"slope_deg_spread", {[](const D& d) { return one_way(d, 0.05, 0.6); }, {"trial", ":memory"}}},
      {"slope_deg_clock", {clock, {"time", "trial", ":memory"}}},
      {"slope_deg_stretch", {stretch, {"position", "step", "time"}}},
      {"memory",
       {[](const D& d) {
          return by_size(d, 0.1, 0.85, [sign = d.sign](double s) { return std::vector{sign * s, 1.0}; });
        },
        {":memory"}}},
      {"outliers", {[](const D& d) { return one_way(d, 0.005, 0.15); }, {":tail", ":spread", "outcome"}}},
      {"sensor_noise_half_angle_rad", {[](const D& d) { return one_way(d, 2e-4, 0.01); }, noisy}},
      {"sensor_noise_stance_rate_rad_s", {[](const D& d) { return one_way(d, 2e-3, 0.1); }, noisy}},
      {"sensor_noise_swing_rate_rad_s", {[](const D& d) { return one_way(d, 2e-3, 0.1); }, noisy}},
      {"sensor_bias_half_angle_rad", {[](const D& d) { return two_ways(d, 5e-5, 0.01); }, anywhere}},
      {"sensor_bias_stance_rate_rad_s", {[](const D& d) { return two_ways(d, 5e-4, 0.1); }, anywhere}},
      {"sensor_bias_swing_rate_rad_s", {[](const D& d) { return two_ways(d, 5e-4, 0.1); }, anywhere}},
      {"launch_half_angle_rad", {[](const D& d) { return two_ways(d, 2e-3, 0.05); }, first}},
      {"launch_stance_rate_rad_s", {[](const D& d) { return two_ways(d, 5e-3, 0.2); }, first}},
      {"launch_swing_rate_rad_s", {[](const D& d) { return two_ways(d, 2e-3, 0.2); }, first}},
      {"launch_spread_half_angle_rad", {[](const D& d) { return one_way(d, 1e-3, 0.05); }, first}},
      {"launch_spread_stance_rate_rad_s", {[](const D& d) { return one_way(d, 5e-3, 0.2); }, first}},
      {"launch_spread_swing_rate_rad_s", {[](const D& d) { return one_way(d, 2e-3, 0.2); }, first}},
  };
  return entries;
}

}  // namespace

SizedEffect sized_walker_effect(const std::string& id, BlindDice& dice) {
  const auto found = walker_entries().find(id);
  if (found == walker_entries().end())
    throw std::logic_error("sized_walker_effect: " + id + " is not among those it can draw");
  return found->second.draw({id, dice, dice.sign()});
}

const std::vector<std::string>& rightful_walker_places(const std::string& id) {
  static const std::vector<std::string> none;
  const auto found = walker_entries().find(id);
  return found == walker_entries().end() ? none : found->second.places;
}

}  // namespace metastable::analysis
