#include "analysis/experiment/input_error.h"

#include <fmt/format.h>

#include <algorithm>

namespace metastable::analysis {

InputError::InputError(std::vector<std::string> lines)
    : std::invalid_argument(fmt::format("{}", fmt::join(lines, "\n"))), lines_(std::move(lines)) {}

void Defects::add(std::string_view file, TextPosition place, std::string_view what, std::string_view group) {
  ++count_;
  const auto same = std::ranges::find_if(shown_, [&](const Defect& d) { return d.what == what && d.group == group; });
  if (same != shown_.end())
    ++same->rows;
  else if (shown_.size() == most_shown)
    ++left_out_;
  else
    shown_.push_back({std::string(group),
                      place.line == 0 ? fmt::format("{}: {}", file, what)
                                      : fmt::format("{}:{}:{}: {}", file, place.line, place.column, what),
                      std::string(what)});
}

std::vector<std::string> Defects::lines() const {
  std::vector<std::string> all;
  for (const Defect& d : shown_) all.push_back(d.rows == 1 ? d.line : fmt::format("{} (in {} rows)", d.line, d.rows));
  if (left_out_ > 0) all.push_back(fmt::format("... and {} more", left_out_));
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
