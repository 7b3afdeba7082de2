#pragma once
// Reads CSV files with a header (RFC 4180) strictly: whatever is not understood is a defect with its line and column.

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/experiment/input_error.h"
#include "dynamics/wheel/ranges.h"

namespace metastable::analysis {

/// Describes a column that a file may or must have.
struct CsvColumn {
  std::string_view name;
  bool required = false;         ///< must be in the header, and filled in every row
  std::string_view remedy = {};  ///< behind what is refused as no number: how to write it
};

/// Says how a file differs from the CSV of an experiment folder.
struct CsvForm {
  char separator = ',';       ///< between fields
  char decimal = '.';         ///< of numbers: a point or a comma
  std::size_t skip_rows = 0;  ///< lines before the header
  bool units_row = false;     ///< a row of units behind the header: columns are called "name [unit]"
  bool ragged = false;        ///< rows may be short of their last fields, or have empty ones beyond; so may lines
};

/// Walks through the records of a CSV text once, in order. Line ends LF or CRLF, an optional byte order mark, an
/// optional line end after the last record; fields in double quotes may hold commas, line ends and doubled quotes.
/// Defects: a quote inside an unquoted field, text after a closing quote, an unclosed quote, control characters, a
/// carriage return alone, an empty line, too few or too many fields, a column that is missing, unknown or named twice.
/// One pass, O(bytes); only quoted fields with doubled quotes are copied.
class CsvReader {
 public:
  /// Reads the header. @param file name for messages; @param text, defects must outlive the reader
  /// @param columns  all columns the file may have; members below name them by their index
  CsvReader(std::string file, std::string_view text, std::span<const CsvColumn> columns, Defects& defects,
            const CsvForm& form = {});

  /// Returns the names in the header of a file whose columns are not known; empty where the constructor finds a defect
  /// in the record.
  static std::vector<std::string> names(std::string_view text, const CsvForm& form);
  /// Returns the fields of a file's first records, whatever they are, each with its line; of defective ones none.
  struct Record {
    std::size_t line = 0;
    std::vector<std::string> fields;
  };
  static std::vector<Record> first_records(std::string_view text, char separator, std::size_t most);

  bool has(std::size_t column) const { return position_[column].has_value(); }
  /// Goes to the next record that has as many fields as the header; defective ones are reported and skipped. False at
  /// the end of the text, and at once if a required column is missing.
  bool next();
  /// Says whether every record so far had as many fields as the header, and no required column is missing.
  bool complete() const { return complete_; }
  std::size_t line() const { return line_; }  ///< where the record begins

  /// Returns the field as csv_field() was given it; it is empty if the column is absent.
  std::string_view text(std::size_t column) const;
  /// Reads a number within the range; nothing if the column is absent or the field empty. False: it is none, reported.
  bool read(std::size_t column, const dynamics::Range& range, std::optional<double>& value);
  /// Reads a whole number in [least, most], likewise ("3.0" is one, as tools write that know floating point only).
  bool read(std::size_t column, std::int64_t least, std::int64_t most, std::optional<std::int64_t>& value);
  /// Reports a defect of this record's field ("COLUMN: what").
  void refuse(std::size_t column, std::string_view what);

 private:
  struct Field {
    std::string_view text;
    std::size_t offset = 0;  // in the file's text
  };

  bool record();  // false: nothing left. fields_ empty: defective, reported
  bool quoted_field(Field& field);
  void read_units();
  bool fits();  // has the record as many fields as the header, or is made to
  bool parse(std::string_view text, double& value) const;
  std::string remedy(std::size_t column) const;
  void skip_line();
  TextPosition place(std::size_t offset) const;
  void report(std::size_t offset, std::string_view what) { defects_.add(file_, place(offset), what); }

  std::string file_;
  std::string_view text_;
  std::span<const CsvColumn> columns_;
  Defects& defects_;
  CsvForm form_;
  std::deque<std::string> named_;                     // columns with the units of their row
  std::vector<std::optional<std::size_t>> position_;  // of each column among the fields
  std::size_t width_ = 0;
  bool usable_ = false, complete_ = true;
  std::vector<Field> fields_;
  std::deque<std::string> unescaped_;
  std::size_t at_ = 0, begin_ = 0;        // offsets: next byte, this record
  std::size_t line_ = 0, next_line_ = 1;  // numbers: this record's, the next one's
};

}  // namespace metastable::analysis
