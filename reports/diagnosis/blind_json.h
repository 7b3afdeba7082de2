#pragma once
// Writes and reads sealed truths and the diagnosis' answers as JSON; the JSON library stays in the .cpp.

#include <string>
#include <string_view>

#include "analysis/blind/blind_grade.h"

namespace metastable::reports {

/// Writes the truth as it is sealed. @param salt  so that no one finds it by trying
std::string truth_json(const analysis::BlindTruth& truth, const std::string& salt);
/// @throws std::invalid_argument naming `file` for text that is no truth
analysis::BlindTruth read_truth(const std::string& file, std::string_view text);
/// Reads an answer of `metastable diagnose --json`. @throws std::invalid_argument naming `file` and what is missing
analysis::BlindAnswer read_answer(const std::string& file, std::string_view text);

}  // namespace metastable::reports
