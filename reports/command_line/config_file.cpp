#include "reports/command_line/config_file.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <stdexcept>

#include "reports/output/input_file.h"

namespace metastable::reports {
namespace {

std::string place(const std::filesystem::path& file, const toml::source_region& source) {
  if (source.begin.line == 0) return file.string();
  return fmt::format("{}:{}", file.string(), source.begin.line);
}

std::string scalar(const std::filesystem::path& file, std::string_view key, const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* whole = node.as_integer()) return fmt::format("{}", whole->get());
  if (const auto* number = node.as_floating_point()) return fmt::format("{}", number->get());
  if (const auto* truth = node.as_boolean()) return truth->get() ? "true" : "false";
  throw std::invalid_argument(
      fmt::format("{}: {}: expected a string, a number, a boolean or an array", place(file, node.source()), key));
}

// A list inside a list is written 7.35,0.19.
std::string joined(const std::filesystem::path& file, std::string_view key, const toml::node& node) {
  const toml::array* list = node.as_array();
  if (list == nullptr) return scalar(file, key, node);
  std::string text;
  for (const toml::node& item : *list) text += (text.empty() ? "" : ",") + scalar(file, key, item);
  return text;
}

}  // namespace

std::vector<ConfigEntry> read_config(const std::filesystem::path& file) {
  toml::table table;
  try {
    table = toml::parse(read_file(file), file.string());
  } catch (const toml::parse_error& error) {
    throw std::invalid_argument(fmt::format("{}: {}", place(file, error.source()), error.description()));
  }
  std::vector<ConfigEntry> entries;
  for (const auto& [key, node] : table) {
    ConfigEntry entry{std::string(key.str()), {}, static_cast<int>(node.source().begin.line)};
    const toml::array* list = node.as_array();
    const bool nested = list != nullptr &&
                        std::any_of(list->begin(), list->end(), [](const toml::node& item) { return item.is_array(); });
    if (nested) {
      for (const toml::node& item : *list) entry.values.push_back(joined(file, entry.key, item));
    } else {
      entry.values.push_back(joined(file, entry.key, node));
    }
    entries.push_back(std::move(entry));
  }
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.line < b.line; });
  return entries;
}

}  // namespace metastable::reports
