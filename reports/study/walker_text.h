#pragma once
// Writes a study of a walker, or of any return map on meshes, for the terminal and as JSON.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "analysis/statistics/last_moments.h"
#include "analysis/walkers/walker_study.h"
#include "reports/output/table.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

/// Does study_walker(), refused where independent ways contradict each other.
/// @throws as analysis::study_walker(); markov::Disagreement
analysis::WalkerStudy agreed_walker(const analysis::WalkerSetting& setting, const markov::MeshStudyOptions& options,
                                    const Tell& tell);

/// Holds a study of a map of one's own.
struct MapStudy {
  std::string name;
  std::vector<std::string> names;  ///< of the numbers of a state
  markov::MeshStudy passage;
};

/// Writes keys as in the README ("steps --json", with --walker), with a final line end.
std::string walker_json(const analysis::WalkerSetting& setting, const analysis::WalkerStudy& study,
                        const std::optional<analysis::LastMoments>& moments, const Provenance& provenance);
/// Does the same; "gait" is the noise-free orbit, with "state_by_phase" where it has several phases.
std::string map_json(const MapStudy& study, const std::optional<analysis::LastMoments>& moments,
                     const Provenance& provenance);
/// Writes "settings" and "contrasts", each with the ratio of its expected steps to those of the first.
std::string walkers_json(const std::vector<analysis::WalkerSetting>& settings,
                         const std::vector<analysis::WalkerStudy>& studies, const Provenance& provenance);

/// Writes everything `steps --walker` prints. @param width  of a line [characters]
std::string walker_text(const analysis::WalkerSetting& setting, const analysis::WalkerStudy& study,
                        const std::optional<analysis::LastMoments>& moments, std::size_t width);
std::string map_text(const MapStudy& study, const std::optional<analysis::LastMoments>& moments, std::size_t width);
/// Writes everything `compare --walker` prints.
std::string walkers_text(const std::vector<analysis::WalkerSetting>& settings,
                         const std::vector<analysis::WalkerStudy>& studies);

/// Does the same as a table: quantities down.
Table mesh_table(const std::string& name, const markov::MeshStudy& study, const Provenance& provenance);

/// Returns "28.19 (95 % interval 28.14 to 28.27)".
std::string estimate_text(const markov::MeshEstimate& estimate);

/// Returns "agreed", "mesh_alone".
const char* walker_status(const markov::MeshStudy& study);

}  // namespace metastable::reports
