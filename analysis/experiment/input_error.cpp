#include "analysis/experiment/input_error.h"

#include <fmt/format.h>

namespace metastable::analysis {

InputError::InputError(std::vector<std::string> lines)
    : std::invalid_argument(fmt::format("{}", fmt::join(lines, "\n"))), lines_(std::move(lines)) {}

void Defects::add(std::string_view file, TextPosition place, std::string_view what) {
  if (++count_ > most_shown) return;
  if (place.line == 0)
    lines_.push_back(fmt::format("{}: {}", file, what));
  else
    lines_.push_back(fmt::format("{}:{}:{}: {}", file, place.line, place.column, what));
}

std::vector<std::string> Defects::lines() const {
  std::vector<std::string> all = lines_;
  if (count_ > most_shown) all.push_back(fmt::format("... and {} more", count_ - most_shown));
  return all;
}

void Defects::check() const {
  if (!empty()) throw InputError(lines());
}

std::string shown_text(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string out = "'";
  for (const char c : text.substr(0, longest)) {
    if (c >= ' ' && c <= '~')
      out += c;
    else
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  }
  return out + (text.size() > longest ? "...'" : "'");
}

}  // namespace metastable::analysis
