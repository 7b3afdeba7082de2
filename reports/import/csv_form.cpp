#include "reports/import/csv_form.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "reports/import/column_map.h"

namespace metastable::reports {
namespace {

using analysis::CsvForm;
using analysis::CsvReader;
using Record = CsvReader::Record;

constexpr std::size_t most_before = 40, looked_at = 300;  // lines before the header, records

// Says whether a field is a number with this sign before its decimals, and has some.
bool has_decimals(std::string_view field, char sign) {
  while (field.starts_with(' ')) field.remove_prefix(1);
  if (field.starts_with('+') || field.starts_with('-')) field.remove_prefix(1);
  const std::size_t at = field.find(sign);
  const auto digits = [](std::string_view text) {
    return std::ranges::all_of(text, [](unsigned char c) { return std::isdigit(c) != 0; });
  };
  return at != std::string_view::npos && at + 1 < field.size() && digits(field.substr(0, at)) &&
         digits(field.substr(at + 1));
}

bool holds_units(const Record& record) {
  bool unit = false;
  for (const std::string& field : record.fields) {
    if (is_unit(field)) {
      unit = true;
    } else if (std::ranges::any_of(field, [](unsigned char c) { return std::isdigit(c) != 0; })) {
      return false;
    }
  }
  return unit;
}

std::string_view shown(char separator) { return separator == '\t' ? "tabs" : separator == ';' ? "';'" : "','"; }

bool has_decimal_commas(const std::vector<Record>& records) {
  bool commas = false;
  for (const Record& record : records)
    for (const std::string& field : record.fields) {
      if (has_decimals(field, '.')) return false;
      commas = commas || has_decimals(field, ',');
    }
  return commas;
}

// Tries every header with every separator. @return whether one is usable
bool find_header(std::string_view text, const AskedForm& asked, CsvForm& form,
                 const std::function<bool(const std::vector<std::string>&)>& usable) {
  const std::vector<char> separators = asked.separator ? std::vector{*asked.separator} : std::vector{',', ';', '\t'};
  std::vector<std::vector<Record>> records;
  for (const char separator : separators) records.push_back(CsvReader::first_records(text, separator, most_before + 2));
  for (std::size_t row = 0; row <= most_before; ++row)
    for (std::size_t s = 0; s < separators.size(); ++s) {
      if (row >= records[s].size()) continue;
      CsvForm one{.separator = separators[s], .decimal = '.', .skip_rows = records[s][row].line - 1};
      if (asked.skip_rows && one.skip_rows != *asked.skip_rows) continue;
      one.units_row = asked.units_row || (row + 1 < records[s].size() && holds_units(records[s][row + 1]));
      const std::vector<std::string> names = CsvReader::names(text, one);
      if (names.empty() || !usable(names)) continue;
      form = one;
      return true;
    }
  return false;
}

}  // namespace

FoundForm csv_form(std::string_view text, const AskedForm& asked,
                   const std::function<bool(const std::vector<std::string>&)>& usable) {
  FoundForm found;
  CsvForm& form = found.form;
  if (!find_header(text, asked, form, usable)) {
    // It is for the caller to say what its first line lacks.
    form = {.separator = asked.separator.value_or(','),
            .skip_rows = asked.skip_rows.value_or(0),
            .units_row = asked.units_row};
    if (!asked.separator)
      for (const char separator : {';', '\t'})
        if (CsvReader::names(text, form).size() < 2) {
          CsvForm other = form;
          other.separator = separator;
          if (CsvReader::names(text, other).size() > 1) form = other;
        }
  }
  form.decimal = asked.decimal                                                                   ? *asked.decimal
                 : has_decimal_commas(CsvReader::first_records(text, form.separator, looked_at)) ? ','
                                                                                                 : '.';
  if (!asked.separator && form.separator != ',')
    found.found.push_back(fmt::format("fields are separated by {}", shown(form.separator)));
  if (!asked.decimal && form.decimal == ',') found.found.emplace_back("numbers have decimal commas");
  if (!asked.skip_rows && form.skip_rows > 0)
    found.found.push_back(fmt::format("the header is line {}; what is before it is skipped", form.skip_rows + 1));
  if (!asked.units_row && form.units_row) found.found.push_back(fmt::format("line {} holds units", form.skip_rows + 2));
  return found;
}

}  // namespace metastable::reports
