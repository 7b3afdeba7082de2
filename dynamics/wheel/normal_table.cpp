#include "dynamics/wheel/normal_table.h"

#include <cmath>

#include "dynamics/wheel/truncated_normal.h"

namespace metastable::dynamics {

const NormalNodes& normal_nodes() {
  static const NormalNodes nodes = [] {
    NormalNodes all;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const double z = static_cast<double>(i) / normal_nodes_per_unit - normal_reach;
      all[i] = {normal_cdf(z), normal_density(z)};
    }
    return all;
  }();
  return nodes;
}

NormalAt normal_at(double z) {
  if (!(std::abs(z) < normal_reach)) return {normal_cdf(z), normal_density(z)};
  return normal_in_reach(z, normal_nodes());
}

}  // namespace metastable::dynamics
