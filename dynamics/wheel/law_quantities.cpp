#include "dynamics/wheel/law_quantities.h"

#include <algorithm>
#include <stdexcept>

namespace metastable::dynamics {

std::span<const Law> laws_with(LawQuantity quantity) {
  static constexpr Law with_contacts[] = {Law::published, Law::coulomb, Law::settled};
  static constexpr Law rigid[] = {Law::coulomb, Law::plastic, Law::settled};
  static constexpr Law compliant[] = {Law::published};
  static constexpr Law hopping[] = {Law::coulomb};
  static constexpr Law followed[] = {Law::settled};
  switch (quantity) {
    case LawQuantity::restitution:
    case LawQuantity::friction:
      return with_contacts;
    case LawQuantity::rebound_lost:
      return hopping;
    case LawQuantity::radius_of_gyration:
      return rigid;
    case LawQuantity::tip_radius:
      return followed;
    case LawQuantity::ramp_stiffness:
    case LawQuantity::contact_mass:
      return compliant;
  }
  throw std::logic_error("unknown quantity");
}

bool uses(Law law, LawQuantity quantity) {
  return std::ranges::find(laws_with(quantity), law) != laws_with(quantity).end();
}

}  // namespace metastable::dynamics
