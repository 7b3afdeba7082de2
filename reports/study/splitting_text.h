#pragma once
// Writes a study by splitting for the terminal and as JSON, alone or beside one on meshes.

#include <cstddef>
#include <optional>
#include <string>

#include "analysis/statistics/last_moments.h"
#include "analysis/walkers/walker_study.h"
#include "reports/output/table.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

/// Holds a study by splitting of what has a name.
struct SplittingAnswer {
  std::string name;
  markov::SplittingStudy passage;
  std::string no_mesh;       ///< why there is no mesh beside it: a clause; empty: it was not asked
  std::string no_splitting;  ///< why there is only the mesh: a sentence; empty: `passage` is told
};

/// Does `split` with a listener of its own, refused where rounds contradict each other.
/// @throws as markov::splitting_study(); markov::Disagreement
template <class Split>
markov::SplittingStudy agreed_splitting(const std::string& name, markov::SplittingOptions options, const Tell& tell,
                                        const Split& split) {
  options.progress = [&](double share) { tell(share, ""); };
  markov::SplittingStudy study = split(options);
  tell(1, "");
  markov::require_agreement(study, name);
  return study;
}

/// @param moments  how it fails, where that was asked
std::string splitting_json(const SplittingAnswer& answer, const std::optional<analysis::LastMoments>& moments,
                           const Provenance& provenance);
std::string splitting_text(const SplittingAnswer& answer, const std::optional<analysis::LastMoments>& moments,
                           std::size_t width);
Table splitting_table(const SplittingAnswer& answer, const Provenance& provenance);

/// Returns the JSON and the text of a mesh's study with splitting beside it, under the key "splitting": what it found,
/// or "no_number" with the reason why it has none.
std::string with_splitting_json(const std::string& mesh_json, const SplittingAnswer& beside);
std::string with_splitting_text(const std::string& mesh_text, const SplittingAnswer& beside);

}  // namespace metastable::reports
