#include "analysis/paper/uncharged_sticking.h"

#include <cmath>
#include <stdexcept>

namespace metastable::analysis {

UnchargedSticking::UnchargedSticking(dynamics::WheelMap map) : map_(std::move(map)) {
  if (map_.law() != dynamics::Law::published)
    throw std::invalid_argument("UnchargedSticking: only `published` charges collisions that stick");
}

double UnchargedSticking::sticking_friction(int phase) const {
  const dynamics::Collision c = map_.collision(phase, 1);
  return c.contact_x * c.contact_y / (c.landing_length * c.landing_length + c.contact_y * c.contact_y);
}

dynamics::StepCoefficients UnchargedSticking::coefficients(int phase, const dynamics::Contact& contact) const {
  if (contact.friction < sticking_friction(phase)) return map_.coefficients(phase, contact);
  const double normal = map_.loss(phase, 1, contact).normal();  // losses go with omega^2
  return {1 - 2 * normal / map_.stance(phase).inertia, 0};
}

double UnchargedSticking::after_collision(double state, int phase, const dynamics::Contact& contact) const {
  const dynamics::StepCoefficients c = coefficients(phase, contact);
  return c.drag == 0 ? c.scale * state : c.scale * state - c.drag * std::sqrt(state);
}

std::optional<double> UnchargedSticking::landing(double state, int phase, std::span<const double> score) const {
  const double after = after_collision(state, phase, map_.noise().draw(score));
  const dynamics::Stance& stance = map_.stance(phase);
  if (!(after >= stance.barrier)) return std::nullopt;
  return after + stance.gain;
}

UnchargedSticking::Table UnchargedSticking::tabulate(int phase, std::span<const double> score) const {
  Table table(map_.stance(phase));
  const auto dimension = static_cast<std::size_t>(noise_dimension());
  for (std::size_t i = 0; i + dimension <= score.size(); i += dimension)
    table.add(coefficients(phase, map_.noise().draw(score.subspan(i, dimension))));
  return table;
}

}  // namespace metastable::analysis
