#pragma once
// Says a diagnosis in plain words.

#include <string>
#include <vector>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::analysis {

/// The verdict, where the gap shows most, how much of it closes, and what the data could not say. @param d  complete
/// but for its sentences
std::vector<std::string> sentences(const Diagnosis& d);

}  // namespace metastable::analysis
