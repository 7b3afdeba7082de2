#pragma once
// metastable solve

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "analysis/sensitivity/rigid_body_check.h"
#include "analysis/sensitivity/solve.h"
#include "analysis/walkers/walker_study.h"
#include "markov/mesh/mesh_study.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

/// Asks for `metastable solve`: of a wheel, or of a walker.
struct SolveRequest {
  analysis::Setting setting;
  analysis::Parameter parameter = analysis::Parameter::slope;
  analysis::StudyOptions study;
  std::optional<analysis::WalkerSetting> walker = {};  ///< in the wheel's place
  bool of_slope_sd = false;                            ///< of a walker: slope_sd_deg is solved for, else slope_deg
  markov::MeshStudyOptions meshes = {};
  analysis::Target target;
  analysis::SolveOptions solve;
  std::string json = {};      ///< file, "-" for standard output, "" for none
  std::string command = {};   ///< the command line, for provenance
  bool rigid_bodies = false;  ///< what the law `settled` gives at each value as well: no law was named
};

/// Holds what `solve` finds, and its renderings.
struct SolveAnswer {
  analysis::Solution solution;
  std::vector<analysis::BesideRigidBodies> rigid_bodies = {};  ///< a value each; empty where they were not asked for
};
/// @throws as analysis::solve()
SolveAnswer answer_solve(const SolveRequest& request, const BeginPart& begin);
/// Writes keys as in the README ("solve --json"), with a final line end.
std::string solve_answer_json(const SolveRequest& request, const SolveAnswer& answer);
std::string solve_answer_text(const SolveRequest& request, const SolveAnswer& answer);

void run_solve(const SolveRequest& request);

}  // namespace metastable::reports
