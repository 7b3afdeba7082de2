#include "markov/chain/envelope.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace metastable::markov {
namespace {

constexpr double most_multiply_adds = 1e10;  // of an elimination that is not thought twice about
constexpr double filled = 0.6;               // of the square: above, all of it is stored
// Estimates of what iteration holds at its peak: 0.42 GB for 1e5 states with 1e6 entries, of which the whole process
// took 0.52 GB.
constexpr double bytes_an_entry = 220, bytes_a_state = 2000;
constexpr double work_an_entry = 2e4;  // of an iteration [multiply-adds]

/// Row i, once all later states are eliminated, begins where the first of the rows i + 1 .. high begins. These are
/// known when i is asked for; those that can still be a minimum wait on a stack, ascending in row from its top.
template <typename ColumnsOf>
Envelope envelope(std::size_t n, const ColumnsOf& columns_of) {
  std::vector<std::size_t> low(n), waiting;
  std::vector<double> width_before(n + 1, 0.0);  // width_before[i]: sum of j - low[j] over j >= i
  Envelope envelope;
  for (std::size_t i = n; i-- > 0;) {
    const std::span<const std::uint32_t> columns = columns_of(i);
    const std::size_t high = columns.empty() ? i : std::max<std::size_t>(i, columns.back());
    low[i] = columns.empty() ? i : std::min<std::size_t>(i, columns.front());
    // From the bottom of the stack to its top rows fall and `low` rises: the first row <= high has the least.
    const auto least = std::lower_bound(waiting.begin(), waiting.end(), high,
                                        [](std::size_t row, std::size_t last) { return row > last; });
    if (least != waiting.end()) low[i] = std::min(low[i], low[*least]);
    while (!waiting.empty() && low[waiting.back()] >= low[i]) waiting.pop_back();
    waiting.push_back(i);
    envelope.entries += static_cast<double>(high - low[i] + 1);
    width_before[i] = width_before[i + 1] + static_cast<double>(i - low[i]);
    envelope.multiply_adds += width_before[i + 1] - width_before[high + 1];
  }
  return envelope;
}

}  // namespace

Envelope envelope_of(std::span<const std::size_t> row_start, std::span<const std::uint32_t> column) {
  return envelope(row_start.size() - 1,
                  [&](std::size_t i) { return column.subspan(row_start[i], row_start[i + 1] - row_start[i]); });
}

Envelope envelope_of(const Chain& chain) {
  return envelope(chain.size(), [&](std::size_t i) { return chain.columns(i); });
}

double iterated_memory(std::size_t states, std::size_t entries) {
  return bytes_an_entry * static_cast<double>(entries) + bytes_a_state * static_cast<double>(states);
}

Way way_of(const Chain& chain, double memory) {
  const auto states = static_cast<double>(chain.size()), entries = static_cast<double>(chain.entries());
  const Envelope envelope = envelope_of(chain);
  const double stored = envelope.entries > filled * states * states ? states * states : envelope.entries;
  const double eliminated = 8 * stored + 40 * entries + 100 * states;
  const double iterated = iterated_memory(chain.size(), chain.entries());
  if (eliminated <= memory && envelope.multiply_adds <= most_multiply_adds) return Way::eliminated;
  if (iterated <= memory && work_an_entry * entries <= envelope.multiply_adds) return Way::iterated;
  if (eliminated <= memory) return Way::eliminated;
  if (iterated <= memory) return Way::iterated;
  throw MemoryExceeded(chain, memory, iterated, eliminated);
}

MemoryExceeded::MemoryExceeded(const Chain& chain, double memory, double iterated, double eliminated)
    : ConvergenceError(fmt::format("chain: {} states with {} entries take {:.2g} GB by iteration and {:.2g} GB by "
                                   "elimination; memory_gb allows {:.2g}",
                                   chain.size(), chain.entries(), iterated / 1e9, eliminated / 1e9, memory / 1e9)) {}

}  // namespace metastable::markov
