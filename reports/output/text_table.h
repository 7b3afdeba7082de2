#pragma once
// Renders a table for the terminal.

#include <cstddef>
#include <string>
#include <string_view>

#include "reports/output/table.h"

namespace metastable::reports {

/// The number of characters of a line where standard output is no terminal.
inline constexpr std::size_t line_width = 100;

/// Counts the characters of a line on standard output: the width of its terminal (COLUMNS where that does not tell it,
/// at least 40), else line_width, so that what is piped is the same everywhere.
std::size_t terminal_width();

/// Counts characters, not bytes, of UTF-8.
std::size_t length(std::string_view text);

/// Writes the title, then aligned columns (text flush left, the rest flush right) and the notes; at most `most` rows,
/// and how many were left out. Columns that are empty in all rows are not shown. Lines hold at most `width` characters:
/// headings and text wrap, then numbers before their interval, then columns go on below; nothing is cut. Where most
/// rows take several lines, an empty line stands between them. It throws the same errors as the renderings of table.h.
std::string to_text(const Table& table, std::size_t most = 1000, std::size_t width = line_width);

/// Returns `text` in lines of at most `width` characters, broken at spaces, every line after `indent`.
std::string wrapped(const std::string& text, const std::string& indent = "", std::size_t width = line_width);

/// Returns `text` with each line that is longer than `width` characters broken at spaces. What goes on below
/// stands under the text after the first gap of two spaces ("  label    text"), else two further in than the line.
std::string fitted(std::string_view text, std::size_t width);

}  // namespace metastable::reports
