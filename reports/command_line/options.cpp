#include "reports/command_line/options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "analysis/experiment/suggestion.h"
#include "reports/command_line/config_file.h"
#include "reports/command_line/option_values.h"

namespace metastable::reports {
namespace {

// Returns it as people write it: places are in capitals.
std::string named(const std::string& name) {
  return std::isupper(static_cast<unsigned char>(name.front())) ? name : "--" + name;
}

// Returns a and b of "a|b"; nothing of what is not words alone.
std::vector<std::string> words_of(const std::string& value) {
  if (value.find('|') == std::string::npos ||
      value.find_first_not_of("abcdefghijklmnopqrstuvwxyz|") != std::string::npos)
    return {};
  std::vector<std::string> words;
  std::istringstream stream(value);
  for (std::string word; std::getline(stream, word, '|');) words.push_back(word);
  return words;
}

}  // namespace

std::string value_objection(const std::string& text, const std::string& value) {
  const std::size_t dashes = text.find_first_not_of('-');
  const bool option = dashes != std::string::npos && (dashes == 2 || (dashes == 1 && text.size() == 2)) &&
                      std::isalpha(static_cast<unsigned char>(text[dashes])) != 0;
  return option ? fmt::format("{} is missing: '{}' is an option", value, text) : "";
}

LooseOptions::LooseOptions(const std::function<void(Options&)>& declare)
    : holder_(std::make_unique<CLI::App>()), options_(*holder_) {
  declare(options_);
}

LooseOptions::LooseOptions(LooseOptions&&) noexcept = default;

LooseOptions::~LooseOptions() = default;

void Options::group(std::string_view name) {
  if (std::ranges::find(option_groups, name) == std::end(option_groups))
    throw std::logic_error(fmt::format("options: '{}' is no group", name));
  group_ = name;
}

void Options::add(const std::string& name, const std::string& value, const std::string& fallback,
                  const std::string& help) {
  std::vector<std::string>& texts = texts_[name];
  CLI::Option* option = command_.add_option("--" + name, texts, help);
  option->expected(1)->allow_extra_args(false)->type_name(value)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  option->group(group_);
  option->check([value](const std::string& text) { return value_objection(text, value); }, "");
  if (!fallback.empty()) {
    option->default_str(fallback);
    fallback_[name] = fallback;
  }
}

void Options::add(const std::string& name, const std::string& value, const std::string& fallback,
                  const std::string& help, const dynamics::Range& range) {
  add(name, value, fallback, fmt::format("{}; in {}", help, range.text()));
  ranges_[name] = range;
}

void Options::add_json() {
  const std::string before = group_;
  group("Files and help");
  add("json", "FILE|-", "", "Write what comes out as JSON; on standard output (-) nothing else is printed");
  group_ = before;
}

void Options::drop_default(const std::string& name) {
  command_.get_option("--" + name)->default_str("");
  fallback_.erase(name);
}

void Options::add_flag(const std::string& name, const std::string& help) {
  std::vector<std::string>& texts = texts_[name];
  command_
      .add_flag_callback(
          "--" + name, [&texts] { texts = {"true"}; }, help)
      ->group(group_);
  fallback_[name] = "false";
}

void Options::add_place(const std::string& name, const std::string& help, const std::string& words) {
  command_.add_option(name, texts_[name], help)->required()->expected(1)->allow_extra_args(false)->type_name(words);
}

void Options::add_optional_place(const std::string& name, const std::string& help) {
  command_.add_option(name, texts_[name], help)->expected(1)->allow_extra_args(false)->type_name("");
}

std::vector<std::string> Options::names() const {
  std::vector<std::string> all;
  for (const auto& [name, texts] : texts_) all.push_back(name);
  return all;
}

void Options::add_places(const std::string& name, const std::string& help) {
  command_.add_option(name, texts_[name], help)->required()->expected(1, -1)->type_name("");
}

void Options::read(const std::string& file) {
  for (const ConfigEntry& entry : read_config(file)) {
    if (entry.key == "config" || !texts_.contains(entry.key))
      throw std::invalid_argument(
          fmt::format("{}:{}: unknown key '{}' (keys are the long options of 'metastable {}'){}", file, entry.line,
                      entry.key, command_.get_name(), analysis::did_you_mean(entry.key, names())));
    std::vector<std::string>& texts = texts_[entry.key];
    if (!texts.empty()) continue;
    texts = entry.values;
    places_[entry.key] = fmt::format("{}:{}: ", file, entry.line);
  }
}

std::string Options::placed(const std::string& message) const {
  for (const auto& [name, place] : places_)
    if (message.starts_with(named(name) + ":")) return place + message;
  return message;
}

std::string Options::value(const std::string& name) const {
  const CLI::Option* option = command_.get_option_no_throw(named(name));
  return option != nullptr && option->get_expected_max() > 0 ? option->get_type_name() : "";
}

std::string Options::text(const std::string& name) const {
  const std::vector<std::string>& texts = texts_.at(name);
  if (texts.size() > 1) throw std::invalid_argument(fmt::format("--{}: given {} times", name, texts.size()));
  if (!texts.empty()) return texts.front();
  const auto fallback = fallback_.find(name);
  return fallback == fallback_.end() ? "" : fallback->second;
}

std::vector<std::string> Options::values(const std::string& name) const {
  if (!given(name)) return {text(name)};
  if (!several_.contains(name)) return all(name);
  std::vector<std::string> parts;
  for (const std::string& text : all(name)) {
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
    if (text.ends_with(',')) parts.emplace_back();
  }
  return parts;
}

bool Options::flag(const std::string& name) const {
  const std::string value = text(name);
  if (value != "true" && value != "false")
    throw std::invalid_argument(fmt::format("--{}: '{}' is neither true nor false", name, value));
  return value == "true";
}

void Options::check_given() const {
  for (const auto& [name, texts] : texts_) {
    if (std::ranges::find(texts, "") != texts.end())
      throw std::invalid_argument(fmt::format("{}: what is given is empty", named(name)));
    if (texts.empty()) continue;
    const std::vector<std::string> words = words_of(value(name));
    for (const std::string& text : values(name))
      if (!words.empty()) analysis::require_word(named(name), text, words);
  }
}

const dynamics::Range& Options::range(const std::string& name) const {
  static constexpr dynamics::Range any;
  const auto found = ranges_.find(name);
  return found == ranges_.end() ? any : found->second;
}

double Options::number(const std::string& name) const { return number_value(name, text(name), range(name)); }

void Options::add_seed() { add("seed", "SEED", "1", "Seed of the random numbers"); }

void Options::add_threads() { add("threads", "T", "0", "Threads, 0..1024; 0: all cores. Results do not depend on it"); }

std::uint64_t Options::whole(const std::string& name, std::uint64_t least, std::uint64_t most) const {
  return whole_value(name, text(name), least, most);
}

int Options::count(const std::string& name, int least, int most) const {
  return static_cast<int>(whole(name, static_cast<std::uint64_t>(least), static_cast<std::uint64_t>(most)));
}

std::uint64_t Options::seed() const { return whole("seed", 0, UINT64_MAX); }

int Options::threads() const { return count("threads", 0, 1024); }

analysis::Spread Options::spread(const std::string& name) const { return spread_value(name, text(name), range(name)); }

}  // namespace metastable::reports
