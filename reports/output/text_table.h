#pragma once
// Renders a table for the terminal.

#include <cstddef>
#include <string>

#include "reports/output/table.h"

namespace metastable::reports {

/// Title, then aligned columns (text flush left, the rest flush right) and the notes; at most `most` rows, and how many
/// were left out. Columns that are empty in all rows are not shown. Same errors as the renderings of table.h.
std::string to_text(const Table& table, std::size_t most = 1000);

/// `text` in lines of at most `width` characters, broken at spaces, every line after `indent`.
std::string wrapped(const std::string& text, const std::string& indent = "", std::size_t width = 100);

}  // namespace metastable::reports
