#include "markov/chain/generator_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "markov/chain/elimination.h"
#include "markov/chain/envelope.h"

namespace metastable::markov {
namespace {

using Row = std::vector<Extended>;

constexpr double extended_multiply_adds = 5e9, extended_entries = 4e7;

/// Returns what the factors take beside what iterating would [byte]; infinite where they are not to be made.
double memory_beside(const Generator& generator) {
  const Envelope envelope = envelope_of(generator.start, generator.column);
  if (envelope.multiply_adds > extended_multiply_adds || envelope.entries > extended_entries)
    return std::numeric_limits<double>::infinity();
  const double factors = static_cast<double>(sizeof(Extended)) * envelope.entries;
  return std::max(0.0, factors - iterated_memory(generator.size(), generator.column.size()));
}

}  // namespace

bool eliminated(const Generator& generator, double memory) {
  const double beside = memory_beside(generator);
  return std::isfinite(beside) && beside <= memory;
}

GeneratorSolver::GeneratorSolver(const Generator& generator, Heard heard, std::span<const Extended> start)
    : heard_(std::move(heard)) {
  double left = heard_.memory();
  if (eliminated(generator, left)) {
    whole_ = std::make_unique<GeneratorFactors>(generator, heard_);
    return;
  }
  generator_ = generator;
  std::vector<std::uint32_t> scratch(generator.size(), Generator::outside);
  part_of_.resize(generator.size());
  for (std::vector<std::uint32_t>& states : communicating_classes(generator)) {
    Part part;
    for (const std::uint32_t i : states) part_of_[i] = static_cast<std::uint32_t>(parts_.size());
    if (states.size() > 1) {
      Generator inside = generator.restricted_to(states, scratch);
      const double beside = memory_beside(inside);
      if (std::isfinite(beside) && beside <= left) {
        left -= beside;
        part.factors = std::make_unique<GeneratorFactors>(inside, heard_);
      } else {
        Row begin;
        for (const std::uint32_t i : states)
          if (!start.empty()) begin.push_back(start[i]);
        part.iterated = std::make_unique<IteratedSolver>(std::move(inside), begin, heard_);
      }
    }
    part.states = std::move(states);
    parts_.push_back(std::move(part));
  }
}

/// Sets x of a part's states from the right sides, to which later parts have been added.
void GeneratorSolver::solve_part(Part& part, Row& arriving, SplitVector& x) {
  Row right;
  for (const std::uint32_t i : part.states) right.push_back(arriving[i]);
  if (part.iterated) {
    const IteratedSolver::Solution solution = part.iterated->solve(right);
    for (std::size_t k = 0; k < right.size(); ++k) {
      x.base[part.states[k]] = solution.base;
      x.rest[part.states[k]] = solution.rest[k];
    }
    return;
  }
  if (!part.factors && !(generator_.exit(part.states[0]) > 0)) throw RestTooRare(0, part.states[0]);
  const Row solved = part.factors ? part.factors->solve(right) : Row{right[0] / generator_.exit(part.states[0])};
  for (std::size_t k = 0; k < right.size(); ++k) x.rest[part.states[k]] = solved[k];
}

SplitVector GeneratorSolver::solve_split(std::span<const Extended> rhs) {
  if (whole_) return {Row(rhs.size(), 0), whole_->solve(rhs)};
  SplitVector x{Row(rhs.size(), 0), Row(rhs.size(), 0)};
  Row arriving(rhs.begin(), rhs.end());
  for (std::size_t p = parts_.size(); p-- > 0;) {
    if (heard_ && parts_[p].factors) heard_();
    for (const std::uint32_t i : parts_[p].states)
      for (std::size_t e = generator_.start[i]; e < generator_.start[i + 1]; ++e)
        if (part_of_[generator_.column[e]] != p) arriving[i] += generator_.rate[e] * x.sum(generator_.column[e]);
    solve_part(parts_[p], arriving, x);
  }
  return x;
}

Row GeneratorSolver::solve(std::span<const Extended> rhs) {
  SplitVector x = solve_split(rhs);
  for (std::size_t i = 0; i < rhs.size(); ++i) x.rest[i] = x.sum(i);
  return std::move(x.rest);
}

Row GeneratorSolver::solve_left(std::span<const Extended> rhs) {
  if (whole_) return whole_->solve_left(rhs);
  Row y(rhs.begin(), rhs.end());
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    Part& part = parts_[p];
    if (heard_ && part.factors) heard_();
    Row right;
    for (const std::uint32_t i : part.states) right.push_back(y[i]);
    if (part.iterated)
      right = part.iterated->solve_left(right);
    else if (part.factors)
      right = part.factors->solve_left(right);
    else
      right[0] /= generator_.exit(part.states[0]);
    for (std::size_t k = 0; k < right.size(); ++k) {
      const std::uint32_t i = part.states[k];
      y[i] = right[k];
      for (std::size_t e = generator_.start[i]; e < generator_.start[i + 1]; ++e)
        if (part_of_[generator_.column[e]] != p) y[generator_.column[e]] += right[k] * generator_.rate[e];
    }
  }
  return y;
}

bool GeneratorSolver::iterates() const {
  return std::any_of(parts_.begin(), parts_.end(), [](const Part& part) { return part.iterated != nullptr; });
}

std::span<const Extended> GeneratorSolver::visits() const {
  if (parts_.size() != 1 || !parts_[0].iterated) return {};
  return parts_[0].iterated->visits();
}

Row stationary_distribution(const Generator& generator, const Heard& heard, std::span<const Extended> start) {
  if (eliminated(generator, heard.memory())) return stationary_vector(generator, heard);
  return IteratedSolver(generator, start, heard).visits();
}

}  // namespace metastable::markov
