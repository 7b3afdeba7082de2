#include "analysis/minimize.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace metastable::analysis {

Minimum nelder_mead(const std::function<double(const std::vector<double>&)>& function, std::vector<double> start,
                    const std::vector<double>& step, double tolerance, int most) {
  const std::size_t n = start.size();
  struct Corner {
    std::vector<double> at;
    double value;
  };
  Minimum result;
  const auto corner = [&](std::vector<double> at) {
    ++result.evaluations;
    const double value = function(at);
    return Corner{std::move(at), value};
  };
  std::vector<Corner> simplex{corner(start)};
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> at = start;
    at[i] += step[i];
    simplex.push_back(corner(std::move(at)));
  }
  const auto lower = [](const Corner& a, const Corner& b) { return a.value < b.value; };
  for (;;) {
    std::stable_sort(simplex.begin(), simplex.end(), lower);
    result.converged = simplex.back().value - simplex.front().value < tolerance;
    if (result.converged || result.evaluations >= most) break;
    std::vector<double> centre(n, 0);
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t i = 0; i < n; ++i) centre[i] += simplex[c].at[i] / static_cast<double>(n);
    const Corner worst = simplex.back();
    const auto along = [&](double t) {  // from the worst corner through the centre of the others
      std::vector<double> at(n);
      for (std::size_t i = 0; i < n; ++i) at[i] = centre[i] + t * (centre[i] - worst.at[i]);
      return corner(std::move(at));
    };
    Corner next = along(1);
    if (next.value < simplex.front().value) {
      Corner further = along(2);
      simplex.back() = further.value < next.value ? std::move(further) : std::move(next);
      continue;
    }
    if (next.value < simplex[n - 1].value) {
      simplex.back() = std::move(next);
      continue;
    }
    Corner inside = next.value < worst.value ? along(0.5) : along(-0.5);
    if (inside.value < std::min(next.value, worst.value)) {
      simplex.back() = std::move(inside);
      continue;
    }
    for (std::size_t c = 1; c <= n; ++c) {
      std::vector<double> at(n);
      for (std::size_t i = 0; i < n; ++i) at[i] = (simplex[0].at[i] + simplex[c].at[i]) / 2;
      simplex[c] = corner(std::move(at));
    }
  }
  result.at = simplex.front().at;
  result.value = simplex.front().value;
  return result;
}

}  // namespace metastable::analysis
