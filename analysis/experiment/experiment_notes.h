#pragma once
// Says what an experiment does not tell, and what looks odd in it.

#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Returns the experiment's `notes`, a sentence each. A coast-down has no leg and no position to tell.
std::vector<std::string> notes_on(const Experiment& experiment);

}  // namespace metastable::analysis
