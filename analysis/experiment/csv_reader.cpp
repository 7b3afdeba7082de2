#include "analysis/experiment/csv_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <ranges>

#include "analysis/experiment/csv_field.h"
#include "analysis/experiment/suggestion.h"

namespace metastable::analysis {
namespace {

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

}  // namespace

CsvReader::CsvReader(std::string file, std::string_view text, std::span<const CsvColumn> columns, Defects& defects,
                     const CsvForm& form)
    : file_(std::move(file)),
      text_(text),
      columns_(columns),
      defects_(defects),
      form_(form),
      position_(columns.size()) {
  if (text_.starts_with(byte_order_mark)) text_.remove_prefix(byte_order_mark.size());
  for (std::size_t row = 0; row < form_.skip_rows && at_ < text_.size(); ++row) skip_line();
  if (!record()) {
    defects_.add(file_, {next_line_, 1}, "the file is empty; a header with the names of the columns is expected");
    return;
  }
  if (form_.units_row && !fields_.empty()) read_units();
  if (fields_.empty()) return;
  usable_ = true;
  width_ = fields_.size();
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const auto known = std::ranges::find(columns_, fields_[i].text, &CsvColumn::name);
    if (known == columns_.end()) {
      std::vector<std::string> names;
      for (const CsvColumn& column : columns_) names.emplace_back(column.name);
      report(fields_[i].offset, fmt::format("unknown column {} (known: {}){}", shown_text(fields_[i].text),
                                            fmt::join(names, ", "), did_you_mean(fields_[i].text, names)));
      continue;
    }
    std::optional<std::size_t>& position = position_[static_cast<std::size_t>(known - columns_.begin())];
    if (position) report(fields_[i].offset, fmt::format("column '{}' appears twice", known->name));
    position = i;
  }
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (!columns_[c].required || has(c)) continue;
    report(begin_, fmt::format("missing column '{}'", columns_[c].name));
    usable_ = false;
  }
}

// Gives the header's fields the units that the row behind it names: "w" and "deg/s" make "w [deg/s]".
void CsvReader::read_units() {
  std::vector<std::string> names;
  for (const Field& field : fields_) names.emplace_back(field.text);
  const std::vector<Field> header = fields_;
  if (!record()) return report(begin_, "a row of units is expected behind the header");
  if (fields_.empty()) return;
  std::vector<std::string_view> units;
  for (const Field& field : fields_) units.push_back(field.text);
  std::vector<Field> named = header;
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string_view unit = i < units.size() ? units[i] : std::string_view();
    while (unit.starts_with(' ') || unit.starts_with('[') || unit.starts_with('(')) unit.remove_prefix(1);
    while (unit.ends_with(' ') || unit.ends_with(']') || unit.ends_with(')')) unit.remove_suffix(1);
    named[i].text = named_.emplace_back(
        unit.empty() || unit == "-" || names[i].empty() ? names[i] : fmt::format("{} [{}]", names[i], unit));
  }
  fields_ = named;
}

std::vector<CsvReader::Record> CsvReader::first_records(std::string_view text, char separator, std::size_t most) {
  Defects unknown;
  CsvReader csv("", text, {}, unknown, {.separator = separator});
  std::vector<Record> records;
  do {
    Record& one = records.emplace_back(Record{csv.line_, {}});
    for (const Field& field : csv.fields_) one.fields.emplace_back(field.text);
  } while (records.size() < most && csv.record());
  return records;
}

std::vector<std::string> CsvReader::names(std::string_view text, const CsvForm& form) {
  Defects unknown;  // all of them are
  const CsvReader header("", text, {}, unknown, form);
  std::vector<std::string> names;
  for (const Field& field : header.fields_) names.emplace_back(field.text);
  return names;
}

bool CsvReader::next() {
  complete_ = complete_ && usable_;
  while (usable_ && record()) {
    if (fields_.size() == width_ || fits()) return true;
    if (form_.ragged && fields_.size() == 1 && fields_.front().text.empty()) continue;
    complete_ = false;
    if (fields_.empty()) continue;
    if (fields_.size() == 1 && fields_.front().text.empty())
      report(begin_, "empty line");
    else
      report(begin_,
             fmt::format("{} field{} where the header has {}", fields_.size(), fields_.size() == 1 ? "" : "s", width_));
  }
  return false;
}

bool CsvReader::fits() {
  if (!form_.ragged || fields_.size() < 2) return false;
  while (fields_.size() > width_ && fields_.back().text.empty()) fields_.pop_back();
  while (fields_.size() < width_) fields_.push_back({.text = {}, .offset = fields_.back().offset});
  return fields_.size() == width_;
}

// Reads the whole text as a finite number.
bool CsvReader::parse(std::string_view text, double& value) const {
  std::string pointed;
  if (form_.decimal != '.') {
    if (text.find('.') != std::string_view::npos) return false;  // of thousands, or a date
    pointed = text;
    std::ranges::replace(pointed, form_.decimal, '.');
    text = pointed;
  }
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

bool CsvReader::record() {
  fields_.clear();
  unescaped_.clear();
  begin_ = at_;
  line_ = next_line_;
  if (at_ >= text_.size()) return false;
  const auto give_up = [&](std::size_t offset, std::string_view what) {
    report(offset, what);
    fields_.clear();
    skip_line();
    return true;
  };
  for (;;) {
    Field field{.text = {}, .offset = at_};
    if (at_ < text_.size() && text_[at_] == '"') {
      if (!quoted_field(field)) return true;
      if (at_ < text_.size() && text_[at_] != form_.separator && text_[at_] != '\n' && text_[at_] != '\r')
        return give_up(at_, "text after a closing quote");
    } else {
      while (at_ < text_.size() && static_cast<unsigned char>(text_[at_]) >= ' ' && text_[at_] != form_.separator &&
             text_[at_] != '"')
        ++at_;
      field.text = text_.substr(field.offset, at_ - field.offset);
    }
    fields_.push_back(field);
    if (at_ >= text_.size()) return true;
    const char stop = text_[at_];
    if (stop == form_.separator) {
      ++at_;
      continue;
    }
    if (stop == '"') return give_up(at_, "quote inside an unquoted field");
    if (stop == '\r' && text_.substr(at_, 2) == "\r\n")
      ++at_;
    else if (stop == '\r')
      return give_up(at_, "carriage return without a line feed");
    else if (stop != '\n')
      return give_up(at_, fmt::format("control character {}", shown_text(text_.substr(at_, 1))));
    ++at_;
    ++next_line_;
    return true;
  }
}

// Goes from the opening quote to behind the closing one. False: it is never closed; reported, and nothing is left to
// read.
bool CsvReader::quoted_field(Field& field) {
  const std::size_t open = at_;
  bool doubled = false;
  for (++at_;; ++at_) {
    at_ = text_.find('"', at_);
    if (at_ == std::string_view::npos) {
      report(open, "quote that is never closed");
      fields_.clear();
      at_ = text_.size();
      return false;
    }
    if (text_.substr(at_, 2) != "\"\"") break;
    doubled = true;
    ++at_;
  }
  field.text = text_.substr(open + 1, at_ - open - 1);
  ++at_;
  next_line_ += static_cast<std::size_t>(std::ranges::count(field.text, '\n'));
  if (!doubled) return true;
  std::string& copy = unescaped_.emplace_back();
  for (std::size_t i = 0; i < field.text.size(); ++i) {
    copy += field.text[i];
    if (field.text[i] == '"') ++i;
  }
  field.text = copy;
  return true;
}

void CsvReader::skip_line() {
  const std::size_t end = text_.find('\n', at_);
  at_ = end == std::string_view::npos ? text_.size() : end + 1;
  ++next_line_;
}

TextPosition CsvReader::place(std::size_t offset) const {
  const std::string_view before = text_.substr(begin_, offset - begin_);
  const std::size_t last = before.rfind('\n');
  return {line_ + static_cast<std::size_t>(std::ranges::count(before, '\n')),
          1 + (last == std::string_view::npos ? before.size() : before.size() - last - 1)};
}

std::string_view CsvReader::text(std::size_t column) const {
  return has(column) ? csv_text(fields_[*position_[column]].text) : std::string_view();
}

void CsvReader::refuse(std::size_t column, std::string_view what) {
  report(has(column) ? fields_[*position_[column]].offset : begin_, fmt::format("{}: {}", columns_[column].name, what));
}

std::string CsvReader::remedy(std::size_t column) const {
  return columns_[column].remedy.empty() ? "" : fmt::format("; {}", columns_[column].remedy);
}

bool CsvReader::read(std::size_t column, const dynamics::Range& range, std::optional<double>& value) {
  value.reset();
  const std::string_view field = text(column);
  if (field.empty()) {
    if (columns_[column].required) refuse(column, "is empty; a number is expected");
    return !columns_[column].required;
  }
  double number = 0;
  if (!parse(field, number)) {
    refuse(column, fmt::format("{} is not a finite number{}", shown_text(field), remedy(column)));
    return false;
  }
  if (!range.holds(number)) {
    refuse(column, fmt::format("{} is outside {}", number, range.text()));
    return false;
  }
  value = number;
  return true;
}

bool CsvReader::read(std::size_t column, std::int64_t least, std::int64_t most, std::optional<std::int64_t>& value) {
  value.reset();
  const std::string_view field = text(column);
  if (field.empty()) {
    if (columns_[column].required) refuse(column, "is empty; a whole number is expected");
    return !columns_[column].required;
  }
  std::int64_t whole = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), whole);
  bool good = error == std::errc() && end == field.data() + field.size();
  if (double number = 0; !good && parse(field, number) && number == std::floor(number) && std::abs(number) < 0x1p53) {
    whole = static_cast<std::int64_t>(number);
    good = true;
  }
  if (!good) {
    refuse(column, fmt::format("{} is not a whole number in {}..{}{}", shown_text(field), least, most, remedy(column)));
    return false;
  }
  if (whole < least || whole > most) {
    refuse(column, fmt::format("{} is outside {}..{}", whole, least, most));
    return false;
  }
  value = whole;
  return true;
}

}  // namespace metastable::analysis
