#include "dynamics/wheel/contact_law.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "dynamics/wheel/coulomb_law.h"
#include "dynamics/wheel/plastic_law.h"
#include "dynamics/wheel/published_law.h"
#include "dynamics/wheel/ranges.h"

namespace metastable::dynamics {
namespace {

constexpr double assumed_gyration = 0.05;  // [m]: not in the paper, an assumption of this project

constexpr std::array<std::pair<std::string_view, Law>, 4> names{
    {{"published", Law::published}, {"coulomb", Law::coulomb}, {"plastic", Law::plastic}, {"settled", Law::settled}}};

double radius_of_gyration(const Wheel& wheel, Law law) {
  if (wheel.radius_of_gyration) return *wheel.radius_of_gyration;
  if (law == Law::published) return 0;  // the law takes r = L2
  if (wheel.inertia) {
    if (const std::string objection = inertia_objection(wheel); !objection.empty())
      throw std::invalid_argument("inertia: " + objection);
    const double about_foot = wheel.hub_mass * wheel.mean_leg_length() * wheel.mean_leg_length();
    // A point mass written with rounded digits is still a point mass.
    return std::sqrt(std::max(0.0, (*wheel.inertia - about_foot) / wheel.hub_mass));
  }
  return law == Law::plastic ? 0 : assumed_gyration;
}

}  // namespace

Law law_from_name(std::string_view name) {
  for (const auto& [known, law] : names)
    if (known == name) return law;
  throw std::invalid_argument(fmt::format("law: \"{}\" is none of {}", name, fmt::join(law_names(), ", ")));
}

std::string_view law_name(Law law) { return names[static_cast<std::size_t>(law)].first; }

std::vector<std::string> law_names() {
  std::vector<std::string> all;
  for (const auto& entry : names) all.emplace_back(entry.first);
  return all;
}

ContactModel contact_model(const Wheel& wheel, Law law, double rebound_lost) {
  if (!(rebound_lost >= 0 && rebound_lost <= 1))
    throw std::invalid_argument(fmt::format("rebound_lost: {} is outside [0, 1]", rebound_lost));
  ContactModel model;
  model.law = law;
  model.mass = wheel.hub_mass;
  model.radius_of_gyration = radius_of_gyration(wheel, law);
  model.ramp_stiffness = wheel.ramp_stiffness;
  model.contact_mass = wheel.contact_mass.value_or(wheel.hub_mass);
  model.gravity = wheel.gravity;
  model.rebound_lost = rebound_lost;
  return model;
}

Loss collide(const ContactModel& model, const Collision& collision, const Contact& contact) {
  switch (model.law) {
    case Law::published:
      return published_loss(model, collision, contact);
    case Law::coulomb:
      return coulomb_loss(model, collision, contact);
    case Law::plastic:
      return plastic_loss(model, collision);
    case Law::settled:
      break;
  }
  throw std::logic_error("collide: not a law of one impact");
}

std::vector<double> friction_breaks(const ContactModel& model, const Collision& collision) {
  switch (model.law) {
    case Law::published:
      return published_friction_breaks(collision);
    case Law::coulomb:
      return {coulomb_sticking_friction(model, collision)};
    case Law::plastic:
      return {};
    case Law::settled:
      break;
  }
  throw std::logic_error("friction_breaks: not a law of one impact");
}

double stance_inertia(const Wheel& wheel, Law law, double length) {
  const double mean = wheel.mean_leg_length();
  if (law == Law::published) return wheel.inertia.value_or(wheel.hub_mass * mean * mean);
  if (wheel.inertia) return *wheel.inertia + wheel.hub_mass * (length * length - mean * mean);
  const double gyration = radius_of_gyration(wheel, law);
  return wheel.hub_mass * (gyration * gyration + length * length);
}

}  // namespace metastable::dynamics
