#pragma once
// Writes a diagnosis for the terminal.

#include <cstddef>
#include <string>

#include "analysis/diagnosis/diagnosis.h"
#include "reports/output/text_table.h"

namespace metastable::reports {

/// Writes the verdict in sentences, then compact tables, in the order of the questions: gap, where, which effect, how
/// far, what could not be seen, next experiment, notes. UTF-8; lines of at most `width` characters as to_text()'s.
std::string diagnosis_text(const analysis::Diagnosis& diagnosis, std::size_t width = line_width);

}  // namespace metastable::reports
