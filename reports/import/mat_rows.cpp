#include "reports/import/mat_rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "analysis/experiment/input_error.h"
#include "reports/import/mat_file.h"

namespace metastable::reports {
namespace {

// One array of numbers or one text, with the name that MATLAB would give it.
struct Piece {
  std::string place;
  std::vector<double> numbers;
  std::optional<std::string> text;
  std::size_t rows = 0, columns = 0;
};

// Holds what a path leads to: one array, or one an element of a struct or cell array.
struct Found {
  std::vector<Piece> pieces;
  bool each = false;  // a piece a trial
};

class MatFile {
 public:
  MatFile(const std::string& path, std::vector<MatValue> variables) : path_(path), variables_(std::move(variables)) {
    for (const MatValue& v : variables_) name(v.name, v);
  }

  const std::vector<std::string>& names() const { return names_; }
  const std::string& path() const { return path_; }

  // @param path  one of names()
  Found at(const std::string& path) const {
    const std::size_t dot = path.find('.');
    const std::string name = path.substr(0, dot);
    Found found;
    follow(found, name, *std::ranges::find(variables_, name, &MatValue::name),
           dot == std::string::npos ? "" : path.substr(dot + 1));
    return found;
  }

  [[noreturn]] void refuse(const std::string& place, const std::string& what) const {
    throw std::invalid_argument(fmt::format("{}: {}: {}", path_, place, what));
  }

 private:
  // Names a variable or field, and its fields; those of a struct array's elements by its first.
  void name(const std::string& path, const MatValue& v) {
    names_.push_back(path);
    for (std::size_t f = 0; f < v.fields.size(); ++f) {
      const MatValue* const first = v.parts.empty() ? nullptr : &v.parts[f];
      if (first != nullptr)
        name(path + "." + v.fields[f], *first);
      else
        names_.push_back(path + "." + v.fields[f]);
    }
  }

  void follow(Found& found, const std::string& place, const MatValue& v, const std::string& rest) const {
    if (rest.empty()) {
      if (v.kind == MatValue::Kind::cells && found.pieces.empty()) {
        found.each = true;
        for (std::size_t i = 0; i < v.parts.size(); ++i)
          found.pieces.push_back(piece(fmt::format("{}{{{}}}", place, i + 1), v.parts[i]));
      } else {
        found.pieces.push_back(piece(place, v));
      }
      return;
    }
    const std::size_t dot = rest.find('.');
    const std::string field = rest.substr(0, dot), behind = dot == std::string::npos ? "" : rest.substr(dot + 1);
    const auto at = std::ranges::find(v.fields, field);
    if (at == v.fields.end()) refuse(place, fmt::format("has no field '{}'", field));
    const std::size_t f = static_cast<std::size_t>(at - v.fields.begin()), count = v.parts.size() / v.fields.size();
    if (count == 1) return follow(found, place + "." + field, v.parts[f], behind);
    if (found.each) refuse(place, fmt::format("is a struct array ({}) in a struct array", v.shape()));
    found.each = true;
    for (std::size_t e = 0; e < count; ++e)
      follow(found, fmt::format("{}({}).{}", place, e + 1, field), v.parts[e * v.fields.size() + f], behind);
  }

  Piece piece(const std::string& place, const MatValue& v) const {
    Piece piece{.place = place, .numbers = v.numbers, .text = {}};
    switch (v.kind) {
      case MatValue::Kind::numbers:
        break;
      case MatValue::Kind::text:
        piece.text = v.text;
        break;
      case MatValue::Kind::cells:
        refuse(place, fmt::format("is a cell array ({}), where numbers or a text are expected", v.shape()));
      case MatValue::Kind::structure:
        refuse(place, fmt::format("is a struct ({}) with the fields {}; name one of them", v.shape(),
                                  fmt::join(v.fields, ", ")));
      case MatValue::Kind::other:
        refuse(place, fmt::format(
                          "is {}{}", v.what,
                          v.dims.empty() ? "" : fmt::format(" ({}), where numbers or a text are expected", v.shape())));
    }
    if (v.dims.size() > 2) refuse(place, fmt::format("has {} dimensions ({})", v.dims.size(), v.shape()));
    piece.rows = v.dims.empty() ? 0 : v.dims[0];
    piece.columns = v.dims.size() > 1 ? v.dims[1] : 0;
    if (!piece.text && piece.numbers.size() != piece.rows * piece.columns)
      refuse(place,
             fmt::format("has {} numbers where its size ({}) asks for more: it is damaged, or compressed in a way "
                         "that is not read (save('-v6', ...) does without)",
                         piece.numbers.size(), v.shape()));
    return piece;
  }

  const std::string& path_;
  std::vector<MatValue> variables_;
  std::vector<std::string> names_;
};

using Text = std::optional<std::string> ImportedRow::*;

Text text_member(Role role) {
  return role == Role::condition ? &ImportedRow::condition
         : role == Role::trial   ? &ImportedRow::trial
                                 : &ImportedRow::outcome;
}

// Holds one trial's numbers of a role, with MATLAB's name of each.
struct Series {
  std::vector<double> values;
  std::string place;    // "trials(3).omega"
  std::size_t row = 0;  // of a matrix, from 1: the trial; 0: the series is a whole vector
  bool is_row = false;  // the trial is a row of the matrix
  std::string at(std::size_t i) const {
    if (row == 0) return fmt::format("{}({})", place, i + 1);
    return is_row ? fmt::format("{}({},{})", place, row, i + 1) : fmt::format("{}({},{})", place, i + 1, row);
  }
};

// Says what a role is told by.
struct Told {
  MappedColumn column;
  Found found;

  std::size_t count() const { return found.each ? found.pieces.size() : found.pieces.front().numbers.size(); }
  const Piece& first() const { return found.pieces.front(); }
};

bool is_vector(const Piece& piece) { return piece.rows <= 1 || piece.columns <= 1; }

class MatTrials {
 public:
  MatTrials(const MatFile& file, const std::vector<MappedColumn>& map, TrialsIn orientation, bool hdf5, Subject subject)
      : file_(file) {
    const Told* trial = nullptr;
    const MappedColumn* main = main_column(map);
    for (const MappedColumn& column : map) {
      Told& told = told_.emplace_back(Told{column, file.at(column.name)});
      if (told.found.pieces.empty()) file.refuse(column.name, "is empty");
    }
    for (const Told& told : told_) {
      if (main && told.column.role == main->role) main_ = &told;
      if (told.column.role == Role::trial) trial = &told;
    }
    if (main_ == nullptr)
      throw std::invalid_argument(fmt::format("--columns: which variable of {} is {}? It has {}", file.path(),
                                              main_name(subject), fmt::join(file.names(), ", ")));
    const Piece& first = main_->first();
    if (main_->found.each) {
      shape_ = Shape::each;
      trials_ = main_->found.pieces.size();
    } else if (is_vector(first) && orientation == TrialsIn::not_told && trial != nullptr &&
               trial->count() == first.numbers.size()) {
      shape_ = Shape::vectors;
    } else {
      if (orientation == TrialsIn::not_told)
        file.refuse(main_->column.name,
                    fmt::format("is {} x {}: say --trials-in columns or --trials-in rows{}", first.rows, first.columns,
                                is_vector(first) ? ", or map trial to a vector of as many" : ""));
      bool in_columns = orientation == TrialsIn::columns;
      if (hdf5 && !is_vector(first)) {
        const bool turned = !padded(first, in_columns) && padded(first, !in_columns);
        in_columns = in_columns != turned;
        found_.push_back(fmt::format(
            "{} is {} x {} as MATLAB has it, and {} x {} as HDF5 stores it; each of MATLAB's {} "
            "is taken for a trial{}",
            main_->column.name, first.rows, first.columns, first.columns, first.rows, in_columns ? "columns" : "rows",
            turned ? ", for they are padded at their ends and the others are not" : ""));
      }
      shape_ = in_columns ? Shape::columns : Shape::rows;
      trials_ = shape_ == Shape::columns ? first.columns : first.rows;
    }
  }

  std::vector<ImportedRow> rows() const {
    std::vector<ImportedRow> rows;
    if (shape_ == Shape::vectors) append(rows, 0);
    for (std::size_t trial = 0; trial < trials_; ++trial) append(rows, trial);
    return rows;
  }

  const std::vector<std::string>& found() const { return found_; }

 private:
  enum class Shape { each, columns, rows, vectors };

  // Says whether no number follows a NaN in any column, or row.
  static bool padded(const Piece& piece, bool columns) {
    for (std::size_t i = 0; i < piece.rows; ++i)
      for (std::size_t k = 0; k < piece.columns; ++k)
        if ((columns ? i : k) > 0 && !std::isnan(piece.numbers[i + k * piece.rows]) &&
            std::isnan(piece.numbers[columns ? i - 1 + k * piece.rows : i + (k - 1) * piece.rows]))
          return false;
    return true;
  }

  // Returns one trial's numbers. @param length  of the main role's, padding included; 0 while that is not known
  Series series(const Told& told, std::size_t trial, std::size_t length) const {
    if (told.found.each) {
      if (shape_ != Shape::each || told.found.pieces.size() != trials_)
        file_.refuse(told.column.name, fmt::format("has {} elements, which does not go with {}",
                                                   told.found.pieces.size(), main_->column.name));
      const Piece& piece = told.found.pieces[trial];
      if (!is_vector(piece))
        file_.refuse(piece.place, fmt::format("is {} x {} where a vector is expected", piece.rows, piece.columns));
      return {piece.numbers, piece.place};
    }
    const Piece& piece = told.first();
    if (shape_ == Shape::vectors || (&told != main_ && is_vector(piece) && piece.numbers.size() == length))
      return {piece.numbers, piece.place};
    const bool in_rows = shape_ == Shape::rows;
    if (shape_ == Shape::each || (in_rows ? piece.rows : piece.columns) != trials_)
      file_.refuse(told.column.name, fmt::format("is {} x {}, which does not go with the {} trials of {}", piece.rows,
                                                 piece.columns, trials_, main_->column.name));
    Series one{.values = {}, .place = piece.place, .row = trial + 1, .is_row = in_rows};
    for (std::size_t i = 0; i < (in_rows ? piece.columns : piece.rows); ++i)
      one.values.push_back(piece.numbers[in_rows ? trial + i * piece.rows : i + trial * piece.rows]);
    return one;
  }

  // Returns a text, or a number as its shortest text, of one trial or of one row of vectors; one text is of all.
  std::string text(const Told& told, std::size_t index, std::size_t count) const {
    const Piece& piece = told.found.each && index < told.count() ? told.found.pieces[index] : told.first();
    if (!told.found.each && piece.text) return *piece.text;
    if (told.count() != count)
      file_.refuse(told.column.name, fmt::format("has {} elements where {} has {} {}", told.count(), main_->column.name,
                                                 count, shape_ == Shape::vectors ? "numbers" : "trials"));
    if (piece.text) return *piece.text;
    if (told.found.each && piece.numbers.size() != 1)
      file_.refuse(piece.place, fmt::format("holds {} numbers where one or a text is expected", piece.numbers.size()));
    return fmt::format("{}", piece.numbers[told.found.each ? 0 : index]);
  }

  [[noreturn]] static void bad(const std::string& place, const std::string& what) {
    throw analysis::InputError({fmt::format("{}: {}", place, what)});
  }

  // Appends the rows of one trial, or all rows of vectors.
  void append(std::vector<ImportedRow>& rows, std::size_t trial) const {
    const bool all = shape_ == Shape::vectors;
    Series main = series(*main_, trial, 0);
    const std::size_t whole = main.values.size(), begin = rows.size();
    while (!all && !main.values.empty() && std::isnan(main.values.back())) main.values.pop_back();
    if (main.values.empty()) file_.refuse(main.place, fmt::format("trial {} holds no number", trial + 1));
    for (std::size_t i = 0; i < main.values.size(); ++i) {
      ImportedRow& row = rows.emplace_back(ImportedRow{.place = fmt::format("{}: {}", file_.path(), main.at(i))});
      if (std::isnan(main.values[i]) && main_->column.role != Role::half_angle)
        bad(row.place, "NaN before the last number");
      if (!all) row.trial = fmt::format("{}", trial + 1);
    }
    for (const Told& told : told_) {
      if (value_member(told.column.role) == nullptr)
        for (std::size_t i = begin; i < rows.size(); ++i)
          rows[i].*text_member(told.column.role) = all ? text(told, i, whole) : text(told, trial, trials_);
      else
        fill(rows, begin, told, main, &told == main_ ? main : series(told, trial, whole));
    }
  }

  // Puts one role's numbers into the rows of a trial.
  void fill(std::vector<ImportedRow>& rows, std::size_t begin, const Told& told, const Series& main,
            const Series& one) const {
    if (one.values.size() < main.values.size())
      file_.refuse(one.place,
                   fmt::format("has {} numbers where {} has {}", one.values.size(), main.place, main.values.size()));
    for (std::size_t i = 0; i < one.values.size(); ++i) {
      const std::string place = fmt::format("{}: {}", file_.path(), one.at(i));
      if (std::isnan(one.values[i])) continue;
      if (std::isinf(one.values[i])) bad(place, "is infinite");
      if (i >= main.values.size()) {
        if (one.row == 0 && shape_ != Shape::each) break;  // of all trials, the longest too
        bad(place, fmt::format("a number where {} has none", main_->column.name));
      }
      const double scale = told.column.scale;
      rows[begin + i].*value_member(told.column.role) = scale == 1 ? one.values[i] : one.values[i] * scale;
    }
  }

  const MatFile& file_;
  std::vector<Told> told_;
  const Told* main_ = nullptr;
  Shape shape_ = Shape::each;
  std::size_t trials_ = 0;  // not of vectors
  std::vector<std::string> found_;
};

}  // namespace

MatRows mat_rows(const std::string& path, std::string_view text, const std::vector<RequestedColumn>& requests,
                 TrialsIn orientation, int first_collision, Subject subject) {
  const MatFile file(path, mat_variables(path, text));
  MatRows read{.rows = {},
               .map = map_columns(requests, file.names(), path, first_collision, subject),
               .names = file.names(),
               .found = {}};
  for (const MappedColumn& column : read.map)
    if (column.numbered)
      throw std::invalid_argument(fmt::format("--columns: {}: a * is for columns of a CSV", role_name(column.role)));
  const MatTrials trials(file, read.map, orientation, is_hdf5_file(text), subject);
  read.rows = trials.rows();
  read.found = trials.found();
  return read;
}

}  // namespace metastable::reports
