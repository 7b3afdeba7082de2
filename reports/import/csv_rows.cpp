#include "reports/import/csv_rows.h"

#include <fmt/format.h>

#include <stdexcept>

namespace metastable::reports {
namespace {

// Says what to write where a column of this role holds letters.
std::string_view remedy_of(Role role) {
  if (role == Role::phase)
    return "phases are numbers: write 1 where leg 1 stands and 2 where leg 2 does (or 0 and 1, and --legs-from 0)";
  if (role == Role::leg) return "legs are numbers: count them from 0 (or from 1, and --legs-from 1)";
  return {};
}

class CsvRows {
 public:
  CsvRows(const std::string& file, analysis::CsvReader& csv, const std::vector<MappedColumn>& map)
      : file_(file), csv_(csv), map_(map) {}

  ImportedRow row() const {
    ImportedRow row{.place = fmt::format("{}:{}", file_, csv_.line())};
    row.condition = text(Role::condition);
    row.trial = text(Role::trial);
    row.outcome = text(Role::outcome);
    return row;
  }

  // Reads the values of one collision. @param number  of a wide row's columns, from 0; 0 in a long row
  void read(ImportedRow& row, std::size_t number) const {
    for (const MappedColumn& column : map_)
      if (const auto member = value_member(column.role)) row.*member = value(column, number);
  }

  // Says whether any of the columns of this number is filled.
  bool any(std::size_t number) const {
    for (const MappedColumn& column : map_)
      if (column.numbered && number < column.columns.size() && !unknown(csv_.text(column.columns[number]))) return true;
    return false;
  }

 private:
  static bool unknown(std::string_view text) {
    return text.empty() || text == "NaN" || text == "nan" || text == "NA" || text == "NAN";
  }

  std::optional<std::string> text(Role role) const {
    const MappedColumn* column = column_of(map_, role);
    if (column == nullptr || csv_.text(column->columns.front()).empty()) return std::nullopt;
    return std::string(csv_.text(column->columns.front()));
  }

  std::optional<double> value(const MappedColumn& column, std::size_t number) const {
    if (number >= column.columns.size()) return std::nullopt;
    const std::size_t at = column.columns[number];
    std::optional<double> read;
    if (!unknown(csv_.text(at)) && csv_.read(at, {}, read) && read && column.scale != 1) *read *= column.scale;
    return read;
  }

  const std::string& file_;
  analysis::CsvReader& csv_;
  const std::vector<MappedColumn>& map_;
};

}  // namespace

std::vector<ImportedRow> csv_rows(const std::string& file, std::string_view text, const analysis::CsvForm& form,
                                  const std::vector<MappedColumn>& map, int first_collision,
                                  analysis::Defects& defects) {
  const std::vector<std::string> names = analysis::CsvReader::names(text, form);
  const std::vector<analysis::CsvColumn> columns = [&] {
    std::vector<analysis::CsvColumn> all;
    for (const std::string& name : names) all.push_back({name});
    for (const MappedColumn& column : map)
      for (const std::size_t at : column.columns) all[at].remedy = remedy_of(column.role);
    return all;
  }();
  const MappedColumn* main = main_column(map);
  const bool wide = main != nullptr && main->role != Role::angle && main->numbered;
  analysis::CsvForm lenient = form;
  lenient.ragged = wide;  // a trial ends where its row does
  analysis::CsvReader csv(file, text, columns, defects, lenient);
  for (const MappedColumn& column : map) {
    if (column.numbered && !wide)
      throw std::invalid_argument(fmt::format("--columns: {}: a * numbers its columns only where {} has one",
                                              role_name(column.role),
                                              main && main->role == Role::half_angle ? "half_angle" : "omega_minus"));
    if (wide && !column.numbered && column.role != Role::condition && column.role != Role::trial &&
        column.role != Role::outcome)
      throw std::invalid_argument(fmt::format(
          "--columns: {}: one column cannot tell it of every collision of a row; number its columns with a *",
          role_name(column.role)));
  }
  const CsvRows reader(file, csv, map);
  std::vector<ImportedRow> rows;
  for (std::size_t trial = 1; csv.next(); ++trial) {
    ImportedRow row = reader.row();
    if (!wide) {
      reader.read(row, 0);
      rows.push_back(std::move(row));
      continue;
    }
    std::size_t last = 0;  // one past the last number
    for (const MappedColumn& column : map)
      for (std::size_t k = last; column.numbered && k < column.columns.size(); ++k)
        if (reader.any(k)) last = k + 1;
    if (last == 0) csv.refuse(main->columns.front(), "the row holds no number");
    if (!row.trial && column_of(map, Role::trial) == nullptr) row.trial = fmt::format("{}", trial);
    for (std::size_t k = 0; k < last; ++k) {
      ImportedRow& one = rows.emplace_back(row);
      reader.read(one, k);
      one.collision = static_cast<double>(k) + first_collision;
      if (main->role == Role::omega_minus && !one.omega_minus && defects.empty())
        csv.refuse(main->columns[std::min(k, main->columns.size() - 1)],
                   "no speed, although the trial goes on or other columns tell of this collision");
    }
  }
  return rows;
}

}  // namespace metastable::reports
