#pragma once
// Turns one text into a field of a CSV file, and back.

#include <string>
#include <string_view>

namespace metastable::analysis {

/// Returns the text as a CSV field (RFC 4180): in double quotes where it holds a comma, a quote or a control character,
/// or begins with # (a comment elsewhere). A text that a spreadsheet would run as a formula (it begins with = + - @ or
/// a tab, and is no number) gets a single quote in front, as does one that would be taken for such a text: csv_text()
/// takes it off.
std::string csv_field(const std::string& text);

/// Returns what csv_field() was given, from a field whose double quotes are off.
std::string_view csv_text(std::string_view field);

}  // namespace metastable::analysis
