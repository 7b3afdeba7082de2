#pragma once
// Draws what `report --walker` shows, from finished studies.

#include <complex>
#include <string>
#include <vector>

#include "analysis/walkers/walker_falls.h"
#include "analysis/walkers/walker_study.h"
#include "reports/output/figure.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Holds a walker's study with how it falls.
struct StudiedWalker {
  analysis::WalkerSetting setting;
  analysis::WalkerStudy study;
  analysis::WalkerFalls falls;
};

/// Returns "compass, 3 deg, sd 0.458 deg".
std::string walker_label(const StudiedWalker& walker);
/// Answers in one sentence: expected steps with their interval.
std::string walker_sentence(const StudiedWalker& walker);

/// Puts the walkers side by side: quantities down, settings across.
Table walkers_table(const std::vector<StudiedWalker>& columns, const Provenance& provenance);

/// Lists steps on each size of mesh: how the answer was extrapolated.
Table meshes_table(const StudiedWalker& walker, const std::string& id, const Provenance& provenance);

/// Draws P(steps > n) on a logarithmic axis, one curve a walker.
Figure walker_survival_figure(const std::vector<StudiedWalker>& walkers, const Provenance& provenance);

/// Draws the section by half angle and stance rate over half angle. One: where a walker recovers and where it is bound
/// to fall (other axes of the noise: within a spacing of the gait); two: where all its steps and its last steps begin.
/// Both with the most likely path.
std::vector<Figure> section_figures(const StudiedWalker& walker, const std::string& id, const Provenance& provenance);

/// Returns "-0.1990 ± 0.5445 i, 0.1314".
std::string eigenvalues_text(const std::vector<std::complex<double>>& eigenvalues);

}  // namespace metastable::reports
