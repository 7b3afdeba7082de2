#include "markov/chain/generator.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "markov/chain/elimination.h"

namespace metastable::markov {
namespace {

constexpr double heard_every = 1e7;  // multiply-adds, some hundredths of a second

}  // namespace

Extended Generator::exit(std::size_t row) const {
  return std::accumulate(rate.begin() + static_cast<std::ptrdiff_t>(start[row]),
                         rate.begin() + static_cast<std::ptrdiff_t>(start[row + 1]), kill[row]);
}

Generator Generator::restricted_to(std::span<const std::uint32_t> states, std::vector<std::uint32_t>& scratch) const {
  std::vector<std::uint32_t>& index = scratch;
  for (std::size_t i = 0; i < states.size(); ++i) index[states[i]] = static_cast<std::uint32_t>(i);
  Generator part;
  for (const std::uint32_t state : states) {
    Extended exits = kill[state];
    for (std::size_t e = start[state]; e < start[state + 1]; ++e) {
      if (index[column[e]] == outside) {
        exits += rate[e];
      } else {
        part.column.push_back(index[column[e]]);
        part.rate.push_back(rate[e]);
      }
    }
    part.start.push_back(part.column.size());
    part.kill.push_back(exits);
  }
  for (const std::uint32_t state : states) index[state] = outside;
  return part;
}

Generator generator_of(const Chain& chain) {
  Generator generator;
  generator.kill.assign(chain.kill().begin(), chain.kill().end());
  for (std::size_t i = 0; i < chain.size(); ++i) {
    generator.column.insert(generator.column.end(), chain.columns(i).begin(), chain.columns(i).end());
    generator.rate.insert(generator.rate.end(), chain.values(i).begin(), chain.values(i).end());
    generator.start.push_back(generator.column.size());
  }
  return generator;
}

GeneratorFactors::GeneratorFactors(const Generator& generator, const Heard& heard)
    : GeneratorFactors(generator, false, heard) {}

/// Finds envelopes and eliminates as Elimination does; of a closed generator the first state, all others eliminated, is
/// never left.
GeneratorFactors::GeneratorFactors(const Generator& generator, bool closed, const Heard& heard) {
  const std::size_t n = generator.size();
  low_.resize(n);
  high_.resize(n);
  std::vector<std::size_t> top(n);
  std::iota(top.begin(), top.end(), std::size_t{0});
  for (std::size_t i = 0; i < n; ++i) {
    const bool empty = generator.start[i] == generator.start[i + 1];
    low_[i] = empty ? i : std::min<std::size_t>(i, generator.column[generator.start[i]]);
    high_[i] = empty ? i : std::max<std::size_t>(i, generator.column[generator.start[i + 1] - 1]);
    top[high_[i]] = std::min(top[high_[i]], i);
  }
  for (std::size_t i = n; i-- > 1;) top[i - 1] = std::min(top[i - 1], top[i]);
  for (std::size_t pivot = n; pivot-- > 0;)
    for (std::size_t i = top[pivot]; i < pivot; ++i)
      if (high_[i] >= pivot) low_[i] = std::min(low_[i], low_[pivot]);
  std::size_t all = 0;
  for (std::size_t i = 0; i < n; ++i) all += high_[i] - low_[i] + 1;
  entries_.reserve(all);
  for (std::size_t i = 0; i < n; ++i) {
    offset_.push_back(entries_.size());
    entries_.resize(entries_.size() + high_[i] - low_[i] + 1);
    for (std::size_t e = generator.start[i]; e < generator.start[i + 1]; ++e)
      row(i)[generator.column[e]] = generator.rate[e];
  }
  std::vector<Extended> kill = generator.kill;
  exit_.resize(n);
  double since_heard = heard_every;
  for (std::size_t pivot = n; pivot-- > 0;) {
    if (heard && since_heard >= heard_every) {
      heard();
      since_heard = 0;
    }
    const Extended* from = row(pivot);
    exit_[pivot] = std::accumulate(from + low_[pivot], from + pivot, kill[pivot]);
    if (closed && pivot == 0) exit_[pivot] = 1;
    if (!(exit_[pivot] > 0)) throw RestTooRare(static_cast<double>(exit_[pivot]), pivot);
    for (std::size_t i = top[pivot]; i < pivot; ++i) {
      if (high_[i] < pivot) continue;
      Extended* target = row(i);
      if (target[pivot] == 0) continue;
      const Extended visits = target[pivot] /= exit_[pivot];
      for (std::size_t j = low_[pivot]; j < pivot; ++j) target[j] += visits * from[j];
      kill[i] += visits * kill[pivot];
      since_heard += static_cast<double>(pivot - low_[pivot]);
    }
  }
}

std::vector<Extended> GeneratorFactors::solve(std::span<const Extended> rhs) const {
  std::vector<Extended> x(rhs.begin(), rhs.end());
  for (std::size_t i = x.size(); i-- > 0;)
    for (std::size_t j = i + 1; j <= high_[i]; ++j) x[i] += row(i)[j] * x[j];
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = low_[i]; j < i; ++j) x[i] += row(i)[j] * x[j];
    x[i] /= exit_[i];
  }
  return x;
}

std::vector<Extended> GeneratorFactors::solve_left(std::span<const Extended> rhs) const {
  std::vector<Extended> y(rhs.begin(), rhs.end());
  for (std::size_t i = y.size(); i-- > 0;) {
    y[i] /= exit_[i];
    for (std::size_t j = low_[i]; j < i; ++j) y[j] += y[i] * row(i)[j];
  }
  for (std::size_t i = 0; i < y.size(); ++i)
    for (std::size_t j = i + 1; j <= high_[i]; ++j) y[j] += y[i] * row(i)[j];
  return y;
}

std::vector<Extended> stationary_vector(Generator generator, const Heard& heard) {
  std::fill(generator.kill.begin(), generator.kill.end(), Extended{0});
  std::vector<Extended> first(generator.size(), 0);
  first[0] = 1;
  std::vector<Extended> visits = GeneratorFactors(generator, true, heard).solve_left(first);
  const Extended all = std::accumulate(visits.begin(), visits.end(), Extended{0});
  for (Extended& share : visits) share /= all;
  return visits;
}

/// Goes by Tarjan's algorithm (SIAM J. Comput. 1, 1972), without recursion: classes are found last first.
std::vector<std::vector<std::uint32_t>> communicating_classes(const Generator& generator) {
  constexpr std::size_t unseen = std::numeric_limits<std::size_t>::max();
  const std::size_t n = generator.size();
  std::vector<std::size_t> number(n, unseen), lowest(n), next(generator.start.begin(), generator.start.end() - 1);
  std::vector<std::uint8_t> open(n, 0);
  std::vector<std::uint32_t> path, waiting;
  std::vector<std::vector<std::uint32_t>> classes;
  std::size_t count = 0;
  const auto enter = [&](std::uint32_t state) {
    number[state] = lowest[state] = count++;
    open[state] = 1;
    path.push_back(state);
    waiting.push_back(state);
  };
  for (std::uint32_t root = 0; root < n; ++root) {
    if (number[root] != unseen) continue;
    enter(root);
    while (!path.empty()) {
      const std::uint32_t at = path.back();
      if (next[at] < generator.start[at + 1]) {
        const std::uint32_t to = generator.column[next[at]++];
        if (number[to] == unseen) {
          enter(to);
        } else if (open[to]) {
          lowest[at] = std::min(lowest[at], number[to]);
        }
        continue;
      }
      path.pop_back();
      if (!path.empty()) lowest[path.back()] = std::min(lowest[path.back()], lowest[at]);
      if (lowest[at] != number[at]) continue;
      classes.emplace_back();
      do {
        classes.back().push_back(waiting.back());
        open[waiting.back()] = 0;
        waiting.pop_back();
      } while (classes.back().back() != at);
      std::sort(classes.back().begin(), classes.back().end());
    }
  }
  std::reverse(classes.begin(), classes.end());
  return classes;
}

}  // namespace metastable::markov
