#pragma once
// A diagnosis for the terminal.

#include <string>

#include "analysis/diagnosis/diagnosis.h"

namespace metastable::reports {

/// The verdict in sentences, then compact tables, in the order of the questions: gap, where, which effect, how far,
/// what could not be seen, next experiment, notes. UTF-8, about 100 columns.
std::string diagnosis_text(const analysis::Diagnosis& diagnosis);

}  // namespace metastable::reports
