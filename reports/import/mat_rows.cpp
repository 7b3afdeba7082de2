#include "reports/import/mat_rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#ifdef METASTABLE_MATIO
#include <matio.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>

#include "analysis/experiment/input_error.h"
#include "reports/import/mat_whole.h"
#include "reports/output/input_file.h"
#endif

namespace metastable::reports {

bool is_mat_file(std::string_view text) {
  return text.starts_with("MATLAB 5.0 MAT-file") || text.starts_with("MATLAB 7.3 MAT-file");
}

#ifndef METASTABLE_MATIO

std::string mat_library() { return ""; }

MatRows mat_rows(const std::string& file, const std::vector<RequestedColumn>&, TrialsIn, int) {
  throw std::invalid_argument(fmt::format(
      "{}: this metastable was built without libmatio, which reads MAT files: install libmatio-dev and build again "
      "(./run install), or save a CSV (writetable, writematrix)",
      file));
}

#else

std::string mat_library() {
  int major = 0, minor = 0, release = 0;
  Mat_GetLibraryVersion(&major, &minor, &release);
  return fmt::format("libmatio {}.{}.{}", major, minor, release);
}

namespace {

constexpr const char* nothing_there =
    "is empty, or compressed in a way that libmatio does not read (save('-v6', ...) does without)";

struct MatClose {
  void operator()(mat_t* file) const { Mat_Close(file); }
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, MatClose>;

std::size_t elements(const matvar_t& v) {
  std::size_t count = 1;
  for (int d = 0; d < v.rank; ++d) count *= v.dims[d];
  return count;
}

template <typename T>
std::vector<double> as_doubles(const matvar_t& v) {
  const T* const data = static_cast<const T*>(v.data);
  if (data == nullptr) return {};
  return {data, data + elements(v)};
}

// Returns the numbers in the order of MATLAB's linear index; nothing where they are none.
std::optional<std::vector<double> > numbers_of(const matvar_t& v) {
  if (v.isComplex) return std::nullopt;
  switch (v.class_type) {
    case MAT_C_EMPTY:
      return std::vector<double>();
    case MAT_C_DOUBLE:
      return as_doubles<double>(v);
    case MAT_C_SINGLE:
      return as_doubles<float>(v);
    case MAT_C_INT8:
      return as_doubles<std::int8_t>(v);
    case MAT_C_UINT8:
      return as_doubles<std::uint8_t>(v);
    case MAT_C_INT16:
      return as_doubles<std::int16_t>(v);
    case MAT_C_UINT16:
      return as_doubles<std::uint16_t>(v);
    case MAT_C_INT32:
      return as_doubles<std::int32_t>(v);
    case MAT_C_UINT32:
      return as_doubles<std::uint32_t>(v);
    case MAT_C_INT64:
      return as_doubles<std::int64_t>(v);
    case MAT_C_UINT64:
      return as_doubles<std::uint64_t>(v);
    default:
      return std::nullopt;
  }
}

// Returns a text of one row; nothing where it is none.
std::optional<std::string> text_of(const matvar_t& v) {
  if (v.class_type != MAT_C_CHAR || v.rank != 2 || v.dims[0] > 1) return std::nullopt;
  std::string text;
  for (std::size_t i = 0; v.data != nullptr && i < elements(v); ++i)
    text += v.data_size == 2 ? static_cast<char>(static_cast<const std::uint16_t*>(v.data)[i])
                             : static_cast<const char*>(v.data)[i];
  return text;
}

std::string shape(const matvar_t& v) {
  std::string text;
  for (int d = 0; d < v.rank; ++d) text += fmt::format("{}{}", d > 0 ? " x " : "", v.dims[d]);
  return text;
}

std::string kind(const matvar_t& v) {
  switch (v.class_type) {
    case MAT_C_CELL:
      return "a cell array";
    case MAT_C_STRUCT:
      return "a struct";
    case MAT_C_CHAR:
      return "a text";
    case MAT_C_SPARSE:
      return "a sparse matrix";
    case MAT_C_OBJECT:
    case MAT_C_OPAQUE:
      return "an object (a table, a timetable, a string): save its columns as arrays, e.g. omega = T.omega";
    case MAT_C_FUNCTION:
      return "a function";
    default:
      return v.isComplex ? "complex" : "numeric";
  }
}

// Is one array of numbers or one text, with the name that MATLAB would give it.
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
  explicit MatFile(const std::string& path) : path_(path) {
    const std::unique_ptr<mat_t, MatClose> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
    if (!file) throw std::invalid_argument(fmt::format("{}: cannot be read as a MAT file", path));
    while (matvar_t* const read = Mat_VarReadNext(file.get())) {
      Variable variable(read);
      if (variable->name != nullptr) variables_.push_back(std::move(variable));
    }
    for (const Variable& v : variables_) {
      names_.emplace_back(v->name);
      if (v->class_type != MAT_C_STRUCT) continue;
      char* const* const fields = Mat_VarGetStructFieldnames(v.get());
      for (unsigned f = 0; f < Mat_VarGetNumberOfFields(v.get()); ++f)
        names_.push_back(fmt::format("{}.{}", v->name, fields[f]));
    }
  }

  const std::vector<std::string>& names() const { return names_; }
  const std::string& path() const { return path_; }

  // @param path  one of names()
  Found at(const std::string& path) const {
    const std::size_t dot = path.find('.');
    const std::string name = path.substr(0, dot);
    const auto variable = std::ranges::find_if(variables_, [&](const Variable& v) { return v->name == name; });
    matvar_t* const v = variable->get();
    Found found;
    if (dot == std::string::npos) {
      add(found, path, *v);
      return found;
    }
    const std::string field = path.substr(dot + 1);
    const std::size_t count = elements(*v);
    found.each = count != 1;
    for (std::size_t i = 0; i < count; ++i) {
      matvar_t* const value = Mat_VarGetStructFieldByName(v, field.c_str(), i);
      const std::string place = count == 1 ? path : fmt::format("{}({}).{}", name, i + 1, field);
      if (value == nullptr) refuse(place, nothing_there);
      if (count == 1)
        add(found, place, *value);
      else
        found.pieces.push_back(piece(place, *value));
    }
    return found;
  }

  [[noreturn]] void refuse(const std::string& place, const std::string& what) const {
    throw std::invalid_argument(fmt::format("{}: {}: {}", path_, place, what));
  }

 private:
  Piece piece(const std::string& place, const matvar_t& v) const {
    Piece piece{.place = place, .numbers = {}, .text = text_of(v)};
    if (const auto numbers = numbers_of(v))
      piece.numbers = *numbers;
    else if (!piece.text)
      refuse(place, fmt::format("is {} ({}), where numbers or a text are expected", kind(v), shape(v)));
    if (v.rank > 2) refuse(place, fmt::format("has {} dimensions ({})", v.rank, shape(v)));
    piece.rows = v.rank > 0 ? v.dims[0] : 0;
    piece.columns = v.rank > 1 ? v.dims[1] : 0;
    return piece;
  }

  void add(Found& found, const std::string& place, matvar_t& v) const {
    if (v.class_type != MAT_C_CELL) return found.pieces.push_back(piece(place, v));
    found.each = true;
    for (std::size_t i = 0; i < elements(v); ++i) {
      const matvar_t* const cell = Mat_VarGetCell(&v, static_cast<int>(i));
      const std::string at = fmt::format("{}{{{}}}", place, i + 1);
      if (cell == nullptr) refuse(at, nothing_there);
      found.pieces.push_back(piece(at, *cell));
    }
  }

  std::string path_;
  std::vector<Variable> variables_;
  std::vector<std::string> names_;
};

using Value = std::optional<double> ImportedRow::*;
using Text = std::optional<std::string> ImportedRow::*;

Value value_member(Role role) {
  switch (role) {
    case Role::collision:
      return &ImportedRow::collision;
    case Role::leg:
      return &ImportedRow::leg;
    case Role::time:
      return &ImportedRow::time;
    case Role::position:
      return &ImportedRow::position;
    case Role::omega_minus:
      return &ImportedRow::omega_minus;
    case Role::omega_plus:
      return &ImportedRow::omega_plus;
    case Role::angle:
      return &ImportedRow::angle;
    default:
      return nullptr;
  }
}

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
  MatTrials(const MatFile& file, const std::vector<MappedColumn>& map, TrialsIn orientation) : file_(file) {
    const Told* trial = nullptr;
    for (const MappedColumn& column : map) {
      Told& told = told_.emplace_back(Told{column, file.at(column.name)});
      if (told.found.pieces.empty()) file.refuse(column.name, "is empty");
    }
    for (const Told& told : told_) {
      if (told.column.role == Role::omega_minus || (told.column.role == Role::angle && main_ == nullptr)) main_ = &told;
      if (told.column.role == Role::trial) trial = &told;
    }
    if (main_ == nullptr)
      throw std::invalid_argument(fmt::format("--columns: which variable of {} is omega_minus (or angle)? It has {}",
                                              file.path(), fmt::join(file.names(), ", ")));
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
      shape_ = orientation == TrialsIn::columns ? Shape::columns : Shape::rows;
      trials_ = shape_ == Shape::columns ? first.columns : first.rows;
    }
  }

  std::vector<ImportedRow> rows() const {
    std::vector<ImportedRow> rows;
    if (shape_ == Shape::vectors) append(rows, 0);
    for (std::size_t trial = 0; trial < trials_; ++trial) append(rows, trial);
    return rows;
  }

 private:
  enum class Shape { each, columns, rows, vectors };

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
      if (std::isnan(main.values[i])) bad(row.place, "NaN before the last number");
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
};

}  // namespace

MatRows mat_rows(const std::string& path, const std::vector<RequestedColumn>& requests, TrialsIn orientation,
                 int first_collision) {
  check_mat_whole(path, read_file(path));
  const MatFile file(path);
  MatRows read{.rows = {}, .map = map_columns(requests, file.names(), path, first_collision), .names = file.names()};
  for (const MappedColumn& column : read.map)
    if (column.numbered)
      throw std::invalid_argument(fmt::format("--columns: {}: a * is for columns of a CSV", role_name(column.role)));
  read.rows = MatTrials(file, read.map, orientation).rows();
  return read;
}

#endif

}  // namespace metastable::reports
