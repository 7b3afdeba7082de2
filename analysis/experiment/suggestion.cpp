#include "analysis/experiment/suggestion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <ranges>
#include <stdexcept>

namespace metastable::analysis {
namespace {

// Counts typing errors: Damerau-Levenshtein distance by its dynamic programme (optimal string alignment).
std::size_t typing_errors(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> errors(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t k = 0; k <= b.size(); ++k) {
      if (i == 0 || k == 0) {
        errors[i][k] = i + k;
        continue;
      }
      errors[i][k] =
          std::min({errors[i - 1][k] + 1, errors[i][k - 1] + 1, errors[i - 1][k - 1] + (a[i - 1] != b[k - 1])});
      if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
        errors[i][k] = std::min(errors[i][k], errors[i - 2][k - 2] + 1);
    }
  return errors[a.size()][b.size()];
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& names) {
  constexpr std::size_t longest_name = 100;
  if (word.size() > longest_name) return "";  // a file's text may be of any length
  std::string found;
  std::size_t least = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string& name : names) {
    const std::size_t errors = typing_errors(word, name);
    if (errors == least) found.clear();
    if (errors >= least) continue;
    least = errors;
    found = name;
  }
  return found;
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& names) {
  const std::string name = nearest(word, names);
  return name.empty() ? "" : fmt::format("; did you mean '{}'?", name);
}

void require_word(std::string_view called, std::string_view word, const std::vector<std::string>& known) {
  if (std::ranges::find(known, word) == known.end())
    throw std::invalid_argument(
        fmt::format("{}: '{}' is none of {}{}", called, word, fmt::join(known, ", "), did_you_mean(word, known)));
}

void require_effects(const std::vector<std::string>& catalogue, const std::vector<std::string>& known) {
  for (const std::string& entry : catalogue)
    for (const auto id : std::views::split(entry, '+'))
      require_word("catalogue", std::string_view(id.begin(), id.end()), known);
}

}  // namespace metastable::analysis
