#include "analysis/blind/sized_effect.h"

#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace metastable::analysis {
namespace {

using Values = std::map<std::string, std::vector<double>>;

// Holds what the draws of one effect start from.
struct Draw {
  std::string id;
  dynamics::NominalValues truth;
  BlindDice& dice;
  double sign;
};

template <class ValuesOf>  // size -> Values
SizedEffect sized(const Draw& d, double start, double largest, ValuesOf values, std::set<std::string> needs = {}) {
  return {[id = d.id, truth = d.truth, values](double s) { return dynamics::effect_from_values(id, values(s), truth); },
          start, largest, std::move(needs)};
}

// Makes one parameter the size itself, or the size with the sign drawn, or its exponential for a ratio.
SizedEffect plain(const Draw& d, const char* name, double start, double largest, std::set<std::string> needs = {}) {
  return sized(
      d, start, largest,
      [name](double s) {
        return Values{{name, {s}}};
      },
      std::move(needs));
}
SizedEffect either_sign(const Draw& d, const char* name, double start, double largest,
                        std::set<std::string> needs = {}) {
  return sized(
      d, start, largest,
      [name, sign = d.sign](double s) {
        return Values{{name, {sign * s}}};
      },
      std::move(needs));
}
SizedEffect ratio(const Draw& d, const char* name, double start, double largest) {
  return sized(d, start, largest, [name, sign = d.sign](double s) { return Values{{name, {std::exp(sign * s)}}}; });
}

SizedEffect contact_distribution(const Draw& d) {
  const double a = d.dice.uniform(0, 2 * std::numbers::pi), b = d.dice.uniform(-0.3, 0.3);
  return sized(d, 0.01, 0.3, [a, b, truth = d.truth](double s) {
    return Values{{"restitution_mean", {truth.restitution_mean + 0.5 * s * std::cos(a)}},
                  {"restitution_sd", {truth.restitution_sd * std::exp(b * s)}},
                  {"friction_mean", {truth.friction_mean + 0.5 * s * std::sin(a)}},
                  {"friction_sd", {truth.friction_sd * std::exp(-b * s)}}};
  });
}

SizedEffect bounce(const Draw& d) {
  const double onset = std::max(0.0, d.dice.uniform(-4, 5));  // every other wheel hops at all speeds
  return sized(d, 0.02, 1, [onset](double s) { return Values{{"rebound_lost", {s}}, {"onset_rad_s", {onset}}}; });
}

SizedEffect initial_speed(const Draw& d) {
  const double a = d.dice.uniform(-0.25, 0.25) * std::numbers::pi;
  return sized(d, 0.08, 0.6,
               [a, sign = d.sign](double s) {
                 return Values{{"mean_rad_s", {sign * s * std::cos(a)}}, {"sd_rad_s", {s * std::sin(a) / 2}}};
               },
               {"initial_speed_rad_s"});
}

// Draws a pattern of legs whose mean length stays: a common change would be another wheel.
SizedEffect leg_lengths(const Draw& d) {
  std::vector<double> pattern(d.truth.leg_lengths.size());
  double mean = 0;
  for (double& p : pattern) mean += (p = d.dice.normal()) / static_cast<double>(pattern.size());
  for (double& p : pattern) p -= mean;
  return sized(d, 2e-4, 5e-3,
               [pattern, truth = d.truth](double s) {
                 std::vector<double> lengths = truth.leg_lengths;
                 for (std::size_t i = 0; i < lengths.size(); ++i) lengths[i] += s * pattern[i];
                 return Values{{"leg_lengths_m", lengths}};
               },
               {"leg"});
}

SizedEffect leg_contact(const Draw& d) {
  const double leg = d.dice.whole(0, static_cast<int>(d.truth.leg_lengths.size()) - 1);
  return sized(d, 0.03, 1,
               [leg, sign = d.sign](double s) {
                 return Values{{"leg", {leg}}, {"friction_ratio", {std::exp(sign * s)}}};
               },
               {"leg"});
}

SizedEffect hub_eccentricity(const Draw& d) {
  const double phase = d.dice.uniform(-std::numbers::pi, std::numbers::pi);
  return sized(d, 2e-4, 0.01, [phase](double s) { return Values{{"offset_m", {s}}, {"phase_rad", {phase}}}; }, {"leg"});
}

SizedEffect slope_profile(const Draw& d) {
  const double to = d.dice.chance(0.5) ? 0 : 1.83;
  return sized(d, 2e-3, 0.06, [to, sign = d.sign](double s) { return Values{{"sag_m", {sign * s}}, {"to_m", {to}}}; });
}

SizedEffect speed_dependent_friction(const Draw& d) {
  const double speed = d.dice.uniform(1, 8);
  return sized(d, 0.05, 4, [speed](double s) { return Values{{"amplitude", {s}}, {"speed_rad_s", {speed}}}; });
}

SizedEffect friction_patch(const Draw& d) {
  const double from = d.dice.uniform(0.1, 0.9), to = from + d.dice.uniform(0.35, 0.8);
  return sized(d, 0.02, 1, [from, to, sign = d.sign](double s) {
    return Values{{"from_m", {from}}, {"to_m", {to}}, {"friction_ratio", {std::exp(sign * s)}}};
  });
}

SizedEffect contact_outliers(const Draw& d) {
  const double friction_ratio = d.dice.uniform(1.7, 2.5);
  return sized(d, 0.005, 0.08, [friction_ratio](double s) {
    return Values{{"share", {s}}, {"friction_ratio", {friction_ratio}}};
  });
}

// The size is what an impact lasts in proportion to.
SizedEffect soft_contact(const Draw& d) {
  return sized(d, 1e-4, 3e-3, [](double s) { return Values{{"compliance_m_n", {s * s}}}; });
}

SizedEffect ramp_vibration(const Draw& d) {
  const double frequency = d.dice.uniform(4, 40);
  return sized(d, 0.02, 0.6,
               [frequency](double s) {
                 return Values{{"amplitude", {s}}, {"frequency_hz", {frequency}}};
               },
               {"time_s"});
}

// Says how an effect is drawn, and where it may rightly be found.
struct Entry {
  SizedEffect (*draw)(const Draw&);
  std::vector<std::string> places;
};

const std::map<std::string, Entry>& all() {
  using D = Draw;
  static const std::map<std::string, Entry> entries{
      {"contact_distribution", {contact_distribution, {"phase", "speed", "condition", ":spread", ":mean"}}},
      {"initial_speed", {initial_speed, {"collision", "phase", "condition", "speed"}}},
      {"leg_lengths", {leg_lengths, {"leg"}}},
      {"leg_contact", {leg_contact, {"leg"}}},
      {"hub_eccentricity", {hub_eccentricity, {"leg"}}},
      {"inertia", {[](const D& d) { return ratio(d, "ratio", 0.01, 0.4); }, {"phase", "speed", "condition"}}},
      {"slope_offset",
       {[](const D& d) { return either_sign(d, "offset_deg", 0.05, 1.5); }, {"phase", "condition", "speed"}}},
      {"slope_profile", {slope_profile, {"position", "collision", "time"}}},
      {"axle_drag_viscous",
       {[](const D& d) { return plain(d, "n_m_s", 1e-3, 0.03); }, {"phase", "speed", "condition"}}},
      {"rolling_resistance",
       {[](const D& d) { return plain(d, "torque_n_m", 4e-3, 0.1); }, {"phase", "speed", "condition"}}},
      {"air_drag", {[](const D& d) { return plain(d, "n_m_s2", 2e-4, 6e-3); }, {"phase", "speed", "condition"}}},
      {"speed_dependent_restitution",
       {[](const D& d) { return either_sign(d, "exponent", 0.05, 1.5); }, {"speed", "phase", "condition"}}},
      {"speed_dependent_friction", {speed_dependent_friction, {"speed", "phase", "condition"}}},
      {"contact_memory", {[](const D& d) { return plain(d, "correlation", 0.1, 0.95); }, {":memory"}}},
      {"friction_patch", {friction_patch, {"position", "collision", "time"}}},
      {"trial_drift", {[](const D& d) { return either_sign(d, "relative_change", 0.03, 0.8); }, {"trial"}}},
      {"trial_spread", {[](const D& d) { return plain(d, "friction_sd", 0.015, 0.12); }, {"trial", ":memory"}}},
      {"contact_outliers", {contact_outliers, {":tail", ":spread", "outcome"}}},
      {"sensor_noise",
       {[](const D& d) {
          return plain(d, "sd_rad_s", 0.03, 0.5, {"noise", "omega_plus_rad_s"});
        },
        {":spread", ":memory", "phase"}}},
      {"sensor_bias",
       {[](const D& d) { return either_sign(d, "bias_rad_s", 0.005, 0.3, {"omega_plus_rad_s"}); }, {"phase", ":mean"}}},
      {"bounce", {bounce, {"phase", "speed", "condition"}}},
      {"soft_contact", {soft_contact, {"speed", "phase", "condition"}}},
      {"ramp_vibration", {ramp_vibration, {"time", "speed", "phase", ":spread"}}},
      {"slip_reversal",
       {[](const D& d) { return sized(d, 1, 1, [](double) { return Values{}; }); },
        {"phase", "speed", ":spread", ":tail", "condition"}}},
  };
  return entries;
}

}  // namespace

SizedEffect sized_effect(const std::string& id, const dynamics::NominalValues& truth, BlindDice& dice) {
  const auto found = all().find(id);
  if (found == all().end()) throw std::logic_error("sized_effect: " + id + " is not among those it can draw");
  return found->second.draw({id, truth, dice, dice.sign()});
}

const std::vector<std::string>& rightful_places(const std::string& id) {
  static const std::vector<std::string> none;
  const auto found = all().find(id);
  return found == all().end() ? none : found->second.places;
}

}  // namespace metastable::analysis
