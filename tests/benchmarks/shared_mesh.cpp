// Times one mesh of three dimensions across the ranks of mpirun, of a map that costs next to nothing: what rows,
// products and solvers take by themselves. Expected steps are known from quadrature in one dimension.
//   mpirun -n 2 shared_mesh SPACING [SCORE_SPACING]

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "markov/ranks/shared_passage.h"

namespace metastable::markov {
namespace {

/// Maps x' = x / 2 + 1 + 0.5 z, failed where x' <= 0, and two numbers that follow x.
BatchMap cheap_map() {
  BatchMap map;
  map.dimension = 3;
  map.step = [](int, auto states, auto scores, auto next, auto failed) {
    for (std::size_t i = 0; i < failed.size(); ++i) {
      const double* from = &states[3 * i];
      double* to = &next[3 * i];
      to[0] = from[0] / 2 + 1 + 0.5 * scores[i];
      to[1] = 0.6 * from[1] + from[0];
      to[2] = 0.5 * from[2] + from[1];
      failed[i] = to[0] <= 0;
    }
  };
  return map;
}

int run(double spacing, double score_spacing) {
  Ranks ranks;
  auto since = std::chrono::steady_clock::now();
  const auto lap = [&] {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = ranks.largest(std::chrono::duration<double>(now - since).count());
    since = now;
    return seconds;
  };
  const BatchMap map = cheap_map();
  const std::vector<double> start{2, 5, 10};
  const MeshOptions options{.spacing = spacing, .score_spacing = score_spacing, .most_bytes = std::size_t{1} << 40};
  const SharedMesh mesh(map, noise_frames(map, start), start, options, ranks);
  const double rows = lap(), landed = peak_memory();
  const MeshPassage followed = follow_survivors(mesh.rows(), {mesh.start().begin(), mesh.start().end()});
  const double products = lap();
  const SharedPassage solved = shared_passage(mesh);
  const double solving = lap();
  const auto own = ranks.gather(static_cast<double>(mesh.size())), peaks = ranks.gather(peak_memory()),
             landing_peaks = ranks.gather(landed), entries = ranks.gather(static_cast<double>(mesh.own_entries()));
  if (ranks.rank() > 0) return 0;
  fmt::print("  expected steps on this mesh           {:.12g} (lower {:.12g}, by PETSc {:.12g})\n", followed.steps,
             followed.steps_lower, solved.steps);
  fmt::print("  failure rate per step                 {:.12g} (with what leaves the mesh, by SLEPc {:.12g})\n",
             followed.failure_rate, solved.failure_rate);
  fmt::print("  mesh of spacing {:.3g} sd    {} nodes, {} entries\n", spacing, mesh.nodes(), mesh.entries());
  fmt::print("  work    {} products; {} restarts and {} products; {} iterations of GMRES, residual {:.2g}\n",
             followed.products, solved.eigen_iterations, solved.products, solved.linear_iterations, solved.residual);
  fmt::print("  seconds  rows {:.1f}, products {:.1f}, SLEPc and PETSc {:.1f}\n", rows, products, solving);
  for (std::size_t r = 0; r < own.size(); ++r)
    fmt::print("  rank {}  {:.0f} nodes, {:.0f} entries, {:.2f} GB after the rows, {:.2f} GB at its peak\n", r, own[r],
               entries[r], landing_peaks[r] / 0x1p30, peaks[r] / 0x1p30);
  return 0;
}

}  // namespace
}  // namespace metastable::markov

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fputs("shared_mesh: SPACING [SCORE_SPACING] expected\n", stderr);
    return 2;
  }
  return metastable::markov::run(std::atof(argv[1]), argc > 2 ? std::atof(argv[2]) : 0.6);
}
