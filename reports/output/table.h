#pragma once
// Holds a table as data, and renders it as CSV, Markdown, LaTeX (booktabs) and HTML.

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "analysis/statistics/interval_95.h"
#include "analysis/statistics/number_text.h"

namespace metastable::reports {

/// Says what made a result. It is carried by every table, figure and page.
struct Provenance {
  std::string command;   ///< command line that reproduces it
  std::string settings;  ///< the settings in full; may have several lines
  std::uint64_t seed = 0;
  std::string version;  ///< version()
};
/// Returns "command: ...", "settings: ..." (one entry for each of its lines), "seed: ...", "version: ..."; empty parts
/// left out.
std::vector<std::string> provenance_lines(const Provenance& provenance);

/// Ends may be infinite.
using analysis::Estimate;
// These say how numbers are shown.
using analysis::Decimal;
using analysis::DecimalEstimate;
using analysis::format_estimate;
using analysis::format_number;
using analysis::NumberFormat;
using analysis::plain_text;
using analysis::to_decimal;

/// Returns the normal 95 % interval.
inline Estimate with_error(double value, double standard_error) {
  const double half = analysis::normal_95 * standard_error;
  return {value, value - half, value + half};
}
/// A value that is rendered as the word "infinite".
struct Infinite {};

/// A number that says too little to be shown: CSV has it, people read what there is to say.
struct NotShown {
  Estimate number;   ///< equal ends: without an interval
  std::string said;  ///< "not known: ..."
};

/// One cell: text, whole number, number, number with interval, or infinite. An empty text is an empty cell. An
/// infinite double is shown as "infinite" too; a NaN is refused when the table is rendered.
class Cell {
 public:
  Cell(std::string text) : value_(std::move(text)) {}
  Cell(const char* text) : value_(std::string(text)) {}
  Cell(double number) : value_(number) {}
  template <std::integral T>
  requires(!std::same_as<T, bool>) Cell(T whole) : value_(static_cast<std::int64_t>(whole)) {}
  Cell(Estimate estimate) : value_(estimate) {}
  Cell(Infinite infinite) : value_(infinite) {}
  Cell(NotShown not_shown) : value_(std::move(not_shown)) {}

  using Value = std::variant<std::string, std::int64_t, double, Estimate, Infinite, NotShown>;
  const Value& value() const { return value_; }

 private:
  Value value_;
};

struct Column {
  std::string name;
  std::string unit = {};  ///< "" for none
  NumberFormat format = NumberFormat::significant;
  int digits = 3;  ///< 1..17 (fixed: 0..17); of the shown renderings, CSV always has full precision
  int level = 95;  ///< of the intervals in this column [%]
};

struct Table {
  std::string id;     ///< short name of letters, digits and '-': file name, LaTeX label and HTML anchor
  std::string title;  ///< caption; no final stop
  std::vector<std::string> notes = {};  ///< below the table, a paragraph each
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows = {};
  Provenance provenance = {};
};

/// All renderings throw std::invalid_argument naming table, row and column for a row of the wrong length or a NaN, and
/// give the same bytes for the same table in every locale. Text may hold any UTF-8.

/// RFC 4180 quoting with line ends LF. Title, notes and provenance come first as lines that start with "# "; then a
/// header "name [unit]", then the rows at full precision. A column with intervals becomes three: "name [unit]",
/// "name low95 [unit]", "name high95 [unit]", the level being the column's. Infinite is the word "infinite".
std::string to_csv(const Table& table);
/// Returns one field of such a file: in quotes where it holds a comma, a quote or a line end, or starts with '#'.
std::string csv_field(const std::string& text);
/// Writes the title as bold text, pipe table, notes, provenance.
std::string to_markdown(const Table& table);
/// Writes a floating table for \usepackage{booktabs}, any engine: everything but ASCII is turned into commands where
/// LaTeX has one. Provenance stands in comments and in the visible note.
std::string to_latex(const Table& table);
/// Writes a <figure> with id "table-<id>" holding the <table>, for page.h.
std::string to_html(const Table& table);

/// Writes &, <, >, " and ' as entities.
std::string escape_html(std::string_view text);

}  // namespace metastable::reports
