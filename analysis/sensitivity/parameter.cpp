#include "analysis/sensitivity/parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <ranges>
#include <stdexcept>

#include "dynamics/wheel/law_quantities.h"

namespace metastable::analysis {
namespace {

struct Known {
  Parameter parameter;
  std::string_view name, unit, label;
};

constexpr std::array<Known, 11> known = {{
    {Parameter::slope, "slope", "deg", "slope γ"},
    {Parameter::restitution_mean, "restitution-mean", "1", "mean of restitution η"},
    {Parameter::restitution_sd, "restitution-sd", "1", "sd of restitution η"},
    {Parameter::friction_mean, "friction-mean", "1", "mean of friction μ"},
    {Parameter::friction_sd, "friction-sd", "1", "sd of friction μ"},
    {Parameter::leg_length, "leg-length", "m", "leg length L"},
    {Parameter::inertia, "inertia", "kg m^2", "inertia I"},
    {Parameter::ramp_stiffness, "ramp-stiffness", "N/m", "ramp stiffness K_r"},
    {Parameter::radius_of_gyration, "radius-of-gyration", "m", "radius of gyration r_g"},
    {Parameter::contact_mass, "contact-mass", "kg", "contact mass m_c"},
    {Parameter::tip_radius, "tip-radius", "m", "tip radius r"},
}};

const Known& entry(Parameter parameter) {
  return *std::find_if(known.begin(), known.end(), [&](const Known& one) { return one.parameter == parameter; });
}

dynamics::ContactModel model(const Setting& setting) {
  return dynamics::contact_model(setting.wheel, setting.law, setting.rebound_lost);
}

}  // namespace

Parameter parameter_from_name(std::string_view name) {
  for (const Known& one : known)
    if (one.name == name) return one.parameter;
  throw std::invalid_argument(
      fmt::format("parameter: '{}' is none of {}", name, fmt::join(known | std::views::transform(&Known::name), ", ")));
}

std::string_view parameter_name(Parameter parameter) { return entry(parameter).name; }
std::string_view parameter_unit(Parameter parameter) { return entry(parameter).unit; }
std::string_view parameter_label(Parameter parameter) { return entry(parameter).label; }

double parameter_value(const Setting& setting, Parameter parameter) {
  switch (parameter) {
    case Parameter::slope:
      return setting.slope_deg;
    case Parameter::restitution_mean:
      return setting.restitution.mean;
    case Parameter::restitution_sd:
      return setting.restitution.sd;
    case Parameter::friction_mean:
      return setting.friction.mean;
    case Parameter::friction_sd:
      return setting.friction.sd;
    case Parameter::leg_length:
      return setting.wheel.mean_leg_length();
    case Parameter::inertia:
      return dynamics::stance_inertia(setting.wheel, setting.law, setting.wheel.mean_leg_length());
    case Parameter::ramp_stiffness:
      return setting.wheel.ramp_stiffness;
    case Parameter::radius_of_gyration:
      return model(setting).radius_of_gyration;
    case Parameter::contact_mass:
      return model(setting).contact_mass;
    case Parameter::tip_radius:
      return setting.wheel.tip_radius;
  }
  throw std::logic_error("unknown parameter");
}

void set_parameter(Setting& setting, Parameter parameter, double value) {
  dynamics::Wheel& wheel = setting.wheel;
  switch (parameter) {
    case Parameter::slope:
      setting.slope_deg = value;
      return;
    case Parameter::restitution_mean:
      setting.restitution.mean = value;
      return;
    case Parameter::restitution_sd:
      setting.restitution.sd = value;
      return;
    case Parameter::friction_mean:
      setting.friction.mean = value;
      return;
    case Parameter::friction_sd:
      setting.friction.sd = value;
      return;
    case Parameter::leg_length: {
      const double scale = value / wheel.mean_leg_length();
      for (double& length : wheel.leg_length) length *= scale;
      return;
    }
    case Parameter::inertia:
      // `coulomb` and `plastic` would otherwise take its r_g from the new inertia.
      if (setting.law != dynamics::Law::published) wheel.radius_of_gyration = model(setting).radius_of_gyration;
      wheel.inertia = value;
      return;
    case Parameter::ramp_stiffness:
      wheel.ramp_stiffness = value;
      return;
    case Parameter::radius_of_gyration:
      wheel.radius_of_gyration = value;
      return;
    case Parameter::contact_mass:
      wheel.contact_mass = value;
      return;
    case Parameter::tip_radius:
      wheel.tip_radius = value;
      return;
  }
  throw std::logic_error("unknown parameter");
}

bool matters(const Setting& setting, Parameter parameter) {
  using dynamics::LawQuantity;
  const auto used = [&](LawQuantity quantity) { return dynamics::uses(setting.law, quantity); };
  const bool drawn = setting.pairs.empty();  // a list has no means and spreads
  switch (parameter) {
    case Parameter::restitution_mean:
      return drawn && used(LawQuantity::restitution);
    case Parameter::restitution_sd:
      return drawn && used(LawQuantity::restitution) && setting.restitution.sd > 0;
    case Parameter::friction_mean:
      return drawn && used(LawQuantity::friction);
    case Parameter::friction_sd:
      return drawn && used(LawQuantity::friction) && setting.friction.sd > 0;
    case Parameter::ramp_stiffness:
      return used(LawQuantity::ramp_stiffness);
    case Parameter::contact_mass:
      return used(LawQuantity::contact_mass);
    case Parameter::radius_of_gyration:
      return used(LawQuantity::radius_of_gyration);
    case Parameter::tip_radius:
      return used(LawQuantity::tip_radius);
    case Parameter::inertia:
      return setting.law != dynamics::Law::settled;
    default:
      return true;
  }
}

}  // namespace metastable::analysis
