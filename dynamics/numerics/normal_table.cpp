#include "dynamics/numerics/normal_table.h"

#include <array>

#include "dynamics/numerics/truncated_normal.h"

namespace metastable::dynamics {
namespace {

constexpr int per_unit = 64;  // nodes
constexpr double reach = normal_reach;

struct NormalNodes {
  std::array<double, 2 * static_cast<std::size_t>(reach) * per_unit + 1> below, density;
  NormalNodes() {
    for (std::size_t i = 0; i < below.size(); ++i) {
      const double z = static_cast<double>(i) / per_unit - reach;
      below[i] = normal_cdf(z);
      density[i] = normal_density(z);
    }
  }
};

METASTABLE_WIDE void read(const NormalNodes& nodes, const double* __restrict z, std::size_t count,
                          double* __restrict below, double* __restrict density) {
  const double *below_nodes = nodes.below.data(), *density_nodes = nodes.density.data();
  for (std::size_t k = 0; k < count; ++k) {
    const double low = z[k] > -reach ? z[k] : -reach, here = low < reach ? low : reach;
    const std::ptrdiff_t i = static_cast<int>((here + reach) * per_unit + 0.5);
    const double from = static_cast<double>(i) * (1.0 / per_unit) - reach, d = here - from;
    // Taylor's series about the node: of exp(-from d - d^2 / 2), and of the density's integral (Hermite's polynomials).
    const double x = -d * (from + d * 0.5), square = from * from;
    const double ratio = 1 + x * (1 + x * (1.0 / 2 + x * (1.0 / 6 + x * (1.0 / 24 + x * (1.0 / 120)))));
    const double width =
        d *
        (1 + d * (-from * 0.5 + d * ((square - 1) * (1.0 / 6) + d * (from * (3 - square) * (1.0 / 24) +
                                                                     d * ((square - 6) * square + 3) * (1.0 / 120)))));
    below[k] = below_nodes[i] + density_nodes[i] * width;
    density[k] = density_nodes[i] * ratio;
  }
}

}  // namespace

void normals_at(const double* z, std::size_t count, double* below, double* density) {
  static const NormalNodes nodes;
  read(nodes, z, count, below, density);
}

}  // namespace metastable::dynamics
