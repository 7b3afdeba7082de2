#include "markov/passage/nested_solver.h"

#include <algorithm>
#include <utility>

namespace metastable::markov {
namespace {

constexpr Extended small_beside = 1e-5L;  // the rounding of a solution is some 1e-17 of its largest entries

}  // namespace

NestedSolver::NestedSolver(const Chain& chain, GeneratorSolver& whole, std::span<const std::uint8_t> reached,
                           const Heard& heard)
    : chain_(chain),
      whole_(whole),
      little_(
          [heard] {
            if (heard) heard();
          },
          0),
      decided_(!whole.iterates()) {
  for (std::uint32_t i = 0; i < reached.size(); ++i)
    if (reached[i]) reached_.push_back(i);
}

std::vector<std::uint32_t> NestedSolver::small_entries(const SplitVector& x) const {
  const std::vector<std::uint32_t>& among = levels_.empty() ? reached_ : levels_.back().states;
  Extended most = 0;
  for (const std::uint32_t i : among) most = std::max(most, x.sum(i));
  std::vector<std::uint32_t> small;
  for (const std::uint32_t i : among)
    if (x.sum(i) < small_beside * most) small.push_back(i);
  return small;
}

void NestedSolver::solve_level(Level& level, std::span<const Extended> right, SplitVector& x) {
  for (const std::uint32_t i : level.states) x.base[i] = x.rest[i] = 0;
  std::vector<Extended> arriving;
  for (const std::uint32_t i : level.states) {
    arriving.push_back(right[i]);
    for (std::size_t e = 0; e < chain_.columns(i).size(); ++e)
      arriving.back() += chain_.values(i)[e] * x.sum(chain_.columns(i)[e]);
  }
  const Extended unit = *std::max_element(arriving.begin(), arriving.end());
  if (!(unit > 0)) return;
  for (Extended& one : arriving) one /= unit;  // solutions are iterated for in double precision, and its range
  const SplitVector solved = level.solver.solve_split(arriving);
  for (std::size_t k = 0; k < arriving.size(); ++k) {
    if (!(solved.sum(k) > 0)) continue;
    x.base[level.states[k]] = unit * solved.base[k];
    x.rest[level.states[k]] = unit * solved.rest[k];
  }
}

SplitVector NestedSolver::solve(std::span<const Extended> right) {
  const SplitVector solved = whole_.solve_split(right);
  SplitVector x{std::vector<Extended>(right.size(), 0), std::vector<Extended>(right.size(), 0)};
  for (const std::uint32_t i : reached_)
    if (solved.sum(i) > 0) x.base[i] = solved.base[i], x.rest[i] = solved.rest[i];
  for (Level& level : levels_) solve_level(level, right, x);
  std::vector<std::uint32_t> scratch(right.size(), Generator::outside);
  while (!decided_) {
    std::vector<std::uint32_t> small = small_entries(x);
    decided_ = small.empty();
    if (decided_) break;
    GeneratorSolver solver(generator_of(chain_).restricted_to(small, scratch), little_);
    decided_ = !solver.iterates();
    levels_.push_back({std::move(small), std::move(solver)});
    solve_level(levels_.back(), right, x);
  }
  return x;
}

}  // namespace metastable::markov
