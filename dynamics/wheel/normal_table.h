#pragma once
// Reads the standard normal from a table, for likelihoods that need it by the million: calls of a loop overlap, as
// those of erfc and exp do not.

#include <array>
#include <cstddef>

namespace metastable::dynamics {

/// Holds Phi(z), and the density there.
struct NormalAt {
  double below = 0, density = 0;
};

/// Is the range of the table.
inline constexpr int normal_reach = 8;
inline constexpr int normal_nodes_per_unit = 64;
/// Holds the nodes from -normal_reach to normal_reach.
using NormalNodes = std::array<NormalAt, 2 * normal_reach * normal_nodes_per_unit + 1>;
const NormalNodes& normal_nodes();

/// Returns both to 1e-9 of either. @param z  in [-normal_reach, normal_reach]
inline NormalAt normal_in_reach(double z, const NormalNodes& nodes) {
  const auto i = static_cast<int>((z + normal_reach) * normal_nodes_per_unit + 0.5);
  const NormalAt& node = nodes[static_cast<std::size_t>(i)];
  const double from = static_cast<double>(i) / normal_nodes_per_unit - normal_reach, d = z - from;
  // Taylor's series about the node: of exp(-from d - d^2 / 2), and of the density's integral (Hermite's polynomials).
  const double x = -d * (from + d / 2), square = from * from;
  const double ratio = 1 + x * (1 + x * (1.0 / 2 + x * (1.0 / 6 + x * (1.0 / 24 + x * (1.0 / 120)))));
  const double width =
      d * (1 + d * (-from / 2 + d * ((square - 1) * (1.0 / 6) + d * (from * (3 - square) * (1.0 / 24) +
                                                                     d * ((square - 6) * square + 3) * (1.0 / 120)))));
  return {node.below + node.density * width, node.density * ratio};
}

/// Returns the same for any z: what is beyond the table is computed.
NormalAt normal_at(double z);

}  // namespace metastable::dynamics
