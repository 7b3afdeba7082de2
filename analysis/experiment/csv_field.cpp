#include "analysis/experiment/csv_field.h"

#include <algorithm>
#include <charconv>

namespace metastable::analysis {
namespace {

bool is_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

// Says whether the text is a formula behind any number of single quotes.
bool guarded(std::string_view text) {
  const std::string_view formula = text.substr(std::min(text.find_first_not_of('\''), text.size()));
  return !formula.empty() && std::string_view("=+-@\t").find(formula.front()) != std::string_view::npos &&
         formula.size() > 1 && !is_number(formula);
}

}  // namespace

std::string csv_field(const std::string& text) {
  const std::string plain = guarded(text) ? "'" + text : text;
  const auto special = [](char c) { return c == ',' || c == '"' || static_cast<unsigned char>(c) < ' '; };
  if (std::ranges::none_of(plain, special) && !plain.starts_with('#')) return plain;
  std::string quoted = "\"";
  for (const char c : plain) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

std::string_view csv_text(std::string_view field) {
  return field.starts_with('\'') && guarded(field) ? field.substr(1) : field;
}

}  // namespace metastable::analysis
