#include "reports/command_line/suggestion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

namespace metastable::reports {
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

}  // namespace metastable::reports
