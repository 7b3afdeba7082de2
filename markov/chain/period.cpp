#include "markov/chain/period.h"

#include <cstdlib>
#include <numeric>

namespace metastable::markov {
namespace {

constexpr double stays = 1e-12;

/// Finds breadth-first levels of the chain as an undirected graph: one up along a transition, one down against it.
std::vector<std::int64_t> levels(const Chain& chain) {
  const std::size_t n = chain.size();
  const Incoming into = incoming(chain);
  std::vector<std::int64_t> level(n, 0);
  std::vector<std::uint8_t> seen(n, 0);
  std::vector<std::uint32_t> queue;
  queue.reserve(n);
  const auto visit = [&](std::uint32_t state, std::int64_t its_level) {
    if (seen[state]) return;
    seen[state] = 1;
    level[state] = its_level;
    queue.push_back(state);
  };
  std::size_t head = 0;
  for (std::size_t root = 0; root < n; ++root) {
    visit(static_cast<std::uint32_t>(root), 0);
    for (; head < queue.size(); ++head) {
      const std::uint32_t state = queue[head];
      for (const std::uint32_t next : chain.columns(state)) visit(next, level[state] + 1);
      for (std::size_t e = into.start[state]; e < into.start[state + 1]; ++e) visit(into.row[e], level[state] - 1);
    }
  }
  return level;
}

}  // namespace

Period find_period(const Chain& chain) {
  const std::size_t n = chain.size();
  const std::vector<std::int64_t> level = levels(chain);
  std::int64_t divisor = 0;
  for (std::size_t i = 0; i < n && divisor != 1; ++i) {
    if (chain.stay(i) > stays) divisor = 1;
    for (const std::uint32_t j : chain.columns(i)) divisor = std::gcd(divisor, std::abs(level[i] + 1 - level[j]));
  }
  Period period;
  period.period = divisor == 0 ? 1 : static_cast<int>(divisor);
  period.state_class.resize(n);
  period.classes.resize(static_cast<std::size_t>(period.period));
  for (std::size_t i = 0; i < n; ++i) {
    const auto remainder = static_cast<int>(level[i] % period.period);
    const int its_class = remainder < 0 ? remainder + period.period : remainder;
    period.state_class[i] = its_class;
    period.classes[static_cast<std::size_t>(its_class)].push_back(static_cast<std::uint32_t>(i));
  }
  return period;
}

}  // namespace metastable::markov
