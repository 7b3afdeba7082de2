#pragma once
// metastable-mpi mesh

#include <string>

#include "analysis/walkers/walker_study.h"
#include "markov/mesh/mesh.h"
#include "markov/ranks/ranks.h"

namespace metastable::reports {

struct SharedMeshRequest {
  analysis::WalkerSetting setting;
  markov::MeshOptions mesh;
  std::string json;     ///< file, "-" for standard output, "" for none; by the first rank
  std::string command;  ///< the command line, for provenance
};

/// Solves one mesh of a walker across all ranks: expected steps from the gait by products and by PETSc, failure rate,
/// and the memory of each rank. @throws markov::Disagreement where the two ways lie more than 1e-7 apart; as
/// markov::SharedMesh, follow_survivors() and shared_passage()
void run_shared_mesh(const SharedMeshRequest& request, markov::Ranks& ranks);

}  // namespace metastable::reports
