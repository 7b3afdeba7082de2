#include "reports/output/text_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <variant>
#include <vector>

namespace metastable::reports {
namespace {

// Characters, not bytes, of UTF-8.
std::size_t length(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string cell_text(const Cell& cell, const Column& column) {
  struct Visitor {
    const Column& column;
    std::string operator()(const std::string& text) const { return text; }
    std::string operator()(std::int64_t whole) const { return fmt::format("{}", whole); }
    std::string operator()(double number) const { return format_number(number, column.format, column.digits); }
    std::string operator()(const Estimate& e) const {
      return fmt::format("{} ({} to {})", (*this)(e.value), (*this)(e.lower), (*this)(e.upper));
    }
    std::string operator()(Infinite) const { return "infinite"; }
  };
  return std::visit(Visitor{column}, cell.value());
}

}  // namespace

std::string wrapped(const std::string& text, const std::string& indent, std::size_t width) {
  std::string out, line = indent;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (line != indent && length(line) + 1 + length(word) > width) {
      out += line + "\n";
      line = indent;
    }
    line += (line == indent ? "" : " ") + word;
  }
  return out + line + "\n";
}

std::string to_text(const Table& table, std::size_t most) {
  struct Shown {
    std::vector<std::string> cells;
    std::size_t width = 0;
    bool flush_left = true;
  };
  const std::size_t rows = std::min(most, table.rows.size());
  std::vector<Shown> columns;
  for (std::size_t j = 0; j < table.columns.size(); ++j) {
    const Column& column = table.columns[j];
    Shown shown;
    bool empty = true;
    shown.cells.push_back(column.unit.empty() ? column.name : column.name + " [" + column.unit + "]");
    for (std::size_t i = 0; i < rows; ++i) {
      const Cell& cell = table.rows[i].at(j);
      try {
        shown.cells.push_back(cell_text(cell, column));
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(
            fmt::format("table '{}', row {}, column '{}': {}", table.id, i + 1, column.name, error.what()));
      }
      empty = empty && shown.cells.back().empty();
      shown.flush_left = shown.flush_left && std::holds_alternative<std::string>(cell.value());
    }
    if (empty && rows > 0) continue;
    for (const std::string& text : shown.cells) shown.width = std::max(shown.width, length(text));
    columns.push_back(std::move(shown));
  }
  std::string out = table.title + "\n";
  for (std::size_t i = 0; i <= rows; ++i) {
    std::string line;
    for (const Shown& column : columns) {
      const std::string space(column.width - length(column.cells[i]), ' ');
      line += "  " + (column.flush_left ? column.cells[i] + space : space + column.cells[i]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  if (table.rows.size() > rows) out += fmt::format("  and {} more\n", table.rows.size() - rows);
  for (const std::string& note : table.notes) out += wrapped(note, "  ");
  return out;
}

}  // namespace metastable::reports
