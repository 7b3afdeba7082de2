#include "reports/command_line/option_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "analysis/experiment/suggestion.h"
#include "analysis/sensitivity/sweep.h"
#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/wheel/wheel.h"
#include "reports/output/input_file.h"

namespace metastable::reports {
namespace {

std::string dashed(std::string_view name) { return fmt::format("--{}", name); }

[[noreturn]] void refuse(std::string_view name, std::string_view text, std::string_view wanted) {
  throw std::invalid_argument(fmt::format("--{}: '{}' is not {}", name, text, wanted));
}

// Reads the whole text as a number. One beyond all doubles, or `inf`, is infinite: no range holds it.
bool parse(std::string_view text, double& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size() || error == std::errc::invalid_argument) return false;
  if (error == std::errc::result_out_of_range) value = std::strtod(std::string(text).c_str(), nullptr);
  return !std::isnan(value);
}

// Reads one value of a list of contacts.
double contact_value(std::string_view place, std::string_view text, const dynamics::Range& range) {
  double value = 0;
  if (!parse(text, value)) throw std::invalid_argument(fmt::format("{}: '{}' is not a number", place, text));
  check_in_range(place, value, range);
  return value;
}

std::vector<std::string_view> split(std::string_view text, char mark) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t at = text.find(mark);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

}  // namespace

void check_in_range(std::string_view called, double value, const dynamics::Range& range) {
  if (!range.holds(value))
    throw std::invalid_argument(fmt::format("{}: {} is outside {}", called, value, range.text()));
}

void check_in_range(std::string_view called, const analysis::Spread& value, const dynamics::Range& range) {
  if (value.sd < 0) throw std::invalid_argument(fmt::format("{}: sd {} is below 0", called, value.sd));
  for (const auto& [which, number] : {std::pair("mean", value.mean), std::pair("sd", value.sd)})
    if (!range.holds(number))
      throw std::invalid_argument(fmt::format("{}: {} {} is outside {}", called, which, number, range.text()));
}

void check_legs(std::string_view called, const std::vector<double>& lengths) {
  for (const double length : lengths) check_in_range(called, length, dynamics::range::leg_length);
  if (lengths.size() < 3)
    throw std::invalid_argument(fmt::format("{}: {} legs are fewer than 3", called, lengths.size()));
  if (lengths.size() > 1000)
    throw std::invalid_argument(fmt::format("{}: {} legs are more than 1000", called, lengths.size()));
}

double number_value(std::string_view name, std::string_view text, const dynamics::Range& range) {
  double value = 0;
  if (!parse(trimmed(text), value)) refuse(name, text, "a number");
  if (std::isinf(value) && std::isinf(range.low) && std::isinf(range.high)) refuse(name, text, "a finite number");
  check_in_range(dashed(name), value, range);
  return value;
}

std::uint64_t whole_value(std::string_view name, std::string_view text, std::uint64_t least, std::uint64_t most) {
  const std::string_view digits = trimmed(text);
  double number = 0;  // "1e6" is a whole number too, and "-3" is one that no range holds
  if (!parse(digits, number) || number != std::floor(number))
    refuse(name, text, fmt::format("a whole number in {}..{}", least, most));
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  bool held = error == std::errc() && end == digits.data() + digits.size();
  if (!held && number >= 0 && number < 0x1p64) {
    value = static_cast<std::uint64_t>(number);
    held = true;
  }
  if (!held || value < least || value > most)
    throw std::invalid_argument(fmt::format("--{}: {} is outside {}..{}", name, digits, least, most));
  return value;
}

std::vector<double> list_value(std::string_view name, std::string_view text) {
  std::vector<double> values;
  for (const std::string_view part : split(text, ',')) {
    double value = 0;
    if (!parse(trimmed(part), value)) refuse(name, text, "a comma list of numbers");
    values.push_back(value);
  }
  return values;
}

analysis::Spread spread_value(std::string_view name, std::string_view text, const dynamics::Range& range) {
  const std::vector<std::string_view> parts = split(text, ',');
  analysis::Spread spread;
  if (parts.size() > 2 || !parse(trimmed(parts[0]), spread.mean) ||
      (parts.size() == 2 && !parse(trimmed(parts[1]), spread.sd)))
    refuse(name, text, "'mean,sd' (or one number for a constant)");
  const bool coefficient = range.high <= dynamics::range::friction.high;
  if (coefficient && spread.mean == 0 && spread.sd > 1) {
    const std::string_view sd = trimmed(parts[1]);
    const bool whole = sd.find_first_not_of("0123456789") == std::string_view::npos;
    throw std::invalid_argument(fmt::format(
        "--{}: '{}' is mean 0 and sd {}; decimals take a point, {}", name, text, sd,
        whole ? fmt::format("so that {0}.{1} is a constant and {0}.{1},0.1 has sd 0.1", trimmed(parts[0]), sd)
              : std::string("as in 0.4,0.1")));
  }
  check_in_range(dashed(name), spread, range);
  return spread;
}

std::vector<double> range_value(std::string_view name, std::string_view text, const dynamics::Range& range) {
  constexpr std::string_view wanted = "'first:last:step', a comma list in rising order, or one number";
  const std::vector<std::string_view> parts = split(text, ':');
  if (parts.size() == 3) {
    double first = 0, last = 0, step = 0;
    if (!parse(trimmed(parts[0]), first) || !parse(trimmed(parts[1]), last) || !parse(trimmed(parts[2]), step))
      refuse(name, text, wanted);
    for (const double end : {first, last}) check_in_range(dashed(name), end, range);
    try {
      return analysis::axis_values(first, last, step);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("--{}: {}", name, error.what()));
    }
  }
  if (parts.size() != 1) refuse(name, text, wanted);
  const std::vector<double> values = list_value(name, text);
  for (std::size_t i = 1; i < values.size(); ++i)
    if (!(values[i - 1] < values[i])) refuse(name, text, wanted);
  for (const double value : values) check_in_range(dashed(name), value, range);
  return values;
}

std::vector<double> legs_value(std::string_view name, std::string_view text, int count) {
  if (trimmed(text) == "paper") return dynamics::paper_leg_lengths();
  std::vector<double> lengths;
  for (const std::string_view part : split(text, ',')) {
    double length = 0;
    if (!parse(trimmed(part), length)) refuse(name, text, "'paper', one length or a comma list of lengths in m");
    lengths.push_back(length);
  }
  if (lengths.size() == 1) lengths.assign(static_cast<std::size_t>(count), lengths.front());
  check_legs(dashed(name), lengths);
  return lengths;
}

bool is_one_length(std::string_view text) {
  return trimmed(text) != "paper" && text.find(',') == std::string_view::npos;
}

std::vector<dynamics::Contact> contact_list(const std::string& file) {
  std::istringstream in(read_file(file));
  std::vector<dynamics::Contact> pairs;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    const std::string_view text = trimmed(line);
    if (number == 1) {
      if (text != "restitution,friction")
        throw std::invalid_argument(fmt::format("{}:1: expected the header 'restitution,friction'", file));
      continue;
    }
    if (text.empty()) continue;
    const std::vector<std::string_view> parts = split(text, ',');
    if (parts.size() != 2)
      throw std::invalid_argument(fmt::format("{}:{}: {} columns where 2 are expected", file, number, parts.size()));
    dynamics::Contact pair;
    pair.restitution = contact_value(fmt::format("{}:{}: column restitution", file, number), trimmed(parts[0]),
                                     dynamics::range::restitution);
    pair.friction = contact_value(fmt::format("{}:{}: column friction", file, number), trimmed(parts[1]),
                                  dynamics::range::friction);
    pairs.push_back(pair);
  }
  if (pairs.empty()) throw std::invalid_argument(fmt::format("{}: holds no pair", file));
  return pairs;
}

std::vector<std::string> effect_ids() {
  std::vector<std::string> ids;
  for (const dynamics::EffectInfo& effect : dynamics::effect_catalogue()) ids.push_back(effect.id);
  return ids;
}

std::vector<std::string> catalogue_value(std::string_view name, const std::string& text,
                                         const std::vector<std::string>& known) {
  std::vector<std::string> ids;
  const auto take = [&](std::string_view word, const std::string& where) {
    const std::string id(trimmed(word));
    for (const std::string_view one : split(id, '+'))
      if (!known.empty()) analysis::require_word(where, one, known);
    if (std::ranges::count(id, '+') > 1)
      throw std::invalid_argument(fmt::format("{}: \"{}\" has more than two effects", where, id));
    if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  };
  std::error_code too_long;  // a list of names need not be a possible path
  if (std::filesystem::is_regular_file(text, too_long)) {
    std::istringstream in(read_file(text));
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
      const std::string_view word = trimmed(std::string_view(line).substr(0, line.find('#')));
      if (!word.empty()) take(word, fmt::format("{}:{}", text, number));
    }
    if (ids.empty()) throw std::invalid_argument(fmt::format("{}: holds no effect", text));
    return ids;
  }
  if (text.find_first_of("./") != std::string::npos)  // no effect is called so
    throw std::invalid_argument(fmt::format("--{}: {}: no such file, nor a list of effects", name, text));
  for (const std::string_view word : split(text, ',')) take(word, fmt::format("--{}", name));
  return ids;
}

}  // namespace metastable::reports
