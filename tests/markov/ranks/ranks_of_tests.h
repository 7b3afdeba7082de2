#pragma once
// Gives the ranks that tests run on, and holds what they find against one process.

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "markov/mesh/mesh_passage.h"
#include "markov/ranks/shared_passage.h"

namespace metastable::markov::testing {

Ranks& ranks();

/// Returns the node of one process's mesh that is this node of the shared one.
inline std::uint32_t same_node(const Mesh& mesh, const SharedMesh& shared, std::size_t node) {
  const Mesh::Corners corners = mesh.corners(shared.phase(node), shared.state(node));
  for (int c = 0; c < corners.count; ++c)
    if (corners.weight[static_cast<std::size_t>(c)] > 0.5) return corners.node[static_cast<std::size_t>(c)];
  ADD_FAILURE() << "node " << node << " is none of one process's mesh";
  return 0;
}

/// Wants nodes, entries, expected steps from the start, failure rate as by products on one process, to 1e-10.
inline void expect_same_as_one_process(const BatchMap& map, const std::vector<double>& start,
                                       const MeshOptions& options) {
  const auto frames = noise_frames(map, start);
  const Mesh mesh(map, frames, start, options);
  const SharedMesh shared(map, frames, start, options, ranks());
  EXPECT_EQ(shared.nodes(), mesh.size());
  EXPECT_EQ(shared.entries(), mesh.entries());
  if (ranks().ranks() > 1) {
    EXPECT_LT(shared.size(), mesh.size());  // nobody holds all
  }
  EXPECT_EQ(shared.cheapest_failure(), mesh.cheapest_failure());
  const MeshPassage one = mesh_passage(mesh, start, 1e-13);
  const SharedPassage all = shared_passage(shared);
  EXPECT_NEAR(all.steps / one.steps_lower, 1, 1e-10);
  double rate = 0, log_kept = 0;
  for (int phase = 0; phase < mesh.phases(); ++phase) {
    double lost = 0;
    for (std::size_t i = 0; i < mesh.size(); ++i)
      if (mesh.phase(i) == phase) lost += one.distribution[i] * (mesh.kill()[i] + mesh.leave()[i]);
    log_kept += std::log1p(-lost) / mesh.phases();
    rate = mesh.phases() == 1 ? lost : -std::expm1(log_kept);
  }
  EXPECT_NEAR(all.failure_rate / rate, 1, 1e-10);
  double apart = 0;
  for (std::size_t i = 0; i < shared.size(); ++i)
    apart += std::abs(all.distribution[i] - one.distribution[same_node(mesh, shared, i)]);
  EXPECT_LT(ranks().sum(apart), 1e-10 * mesh.phases());
}

}  // namespace metastable::markov::testing
