#include "markov/chain/chain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

namespace metastable::markov {
namespace {

std::string row_name(std::size_t row) { return "chain row " + std::to_string(row); }

void check_probability(double value, std::size_t row, const char* what, bool any_sign = false) {
  if (!std::isfinite(value) || (value < 0 && !any_sign)) {
    std::ostringstream message;
    message << row_name(row) << ": " << what << " is " << value << ", not a finite number >= 0";
    throw std::invalid_argument(message.str());
  }
}

/// Marks every state from which a marked one can be reached.
void spread_backwards(const Incoming& into, std::vector<std::uint8_t>& marked) {
  std::vector<std::uint32_t> queue;
  for (std::size_t i = 0; i < marked.size(); ++i) {
    if (marked[i]) queue.push_back(static_cast<std::uint32_t>(i));
  }
  while (!queue.empty()) {
    const std::uint32_t state = queue.back();
    queue.pop_back();
    for (std::size_t e = into.start[state]; e < into.start[state + 1]; ++e) {
      const std::uint32_t source = into.row[e];
      if (marked[source]) continue;
      marked[source] = 1;
      queue.push_back(source);
    }
  }
}

std::string describe(const std::string& solver, double residual, const std::string& detail) {
  std::ostringstream message;
  message << solver << " did not converge: ";
  if (std::isfinite(residual)) message << "residual " << residual << ": ";
  message << detail;
  return message.str();
}

}  // namespace

ConvergenceError::ConvergenceError(std::string solver, double residual, const std::string& detail)
    : std::runtime_error(describe(solver, residual, detail)), solver_(std::move(solver)), residual_(residual) {}

Chain::Chain(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column, std::vector<double> value,
             std::vector<double> kill, double excess)
    : Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill), excess, false) {}

Chain Chain::interpolated(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column,
                          std::vector<double> value, std::vector<double> kill) {
  constexpr double any = std::numeric_limits<double>::infinity();  // without its diagonal a row may sum to more than 1
  return {std::move(row_start), std::move(column), std::move(value), std::move(kill), any, true};
}

Chain::Chain(std::vector<std::size_t> row_start, std::vector<std::uint32_t> column, std::vector<double> value,
             std::vector<double> kill, double excess, bool interpolated)
    : interpolated_(interpolated) {
  const std::size_t n = kill.size();
  if (n > std::numeric_limits<std::uint32_t>::max()) throw std::invalid_argument("chain: too many states");
  if (row_start.size() != n + 1 || row_start.front() != 0 || row_start.back() != column.size() ||
      column.size() != value.size() || !std::is_sorted(row_start.begin(), row_start.end())) {
    throw std::invalid_argument("chain: row_start must ascend from 0 to the number of entries, one more than rows");
  }
  std::size_t kept = 0;
  std::vector<std::size_t> start(n + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    check_probability(kill[i], i, "the kill rate", interpolated);
    double sum = kill[i];
    for (std::size_t e = row_start[i]; e < row_start[i + 1]; ++e) {
      check_probability(value[e], i, "an entry", interpolated);
      if (column[e] >= n)
        throw std::invalid_argument(row_name(i) + ": column " + std::to_string(column[e]) + " of " + std::to_string(n) +
                                    " is out of range");
      if (column[e] == i) throw std::invalid_argument(row_name(i) + ": the diagonal must not be stored");
      if (e > row_start[i] && column[e] <= column[e - 1]) {
        throw std::invalid_argument(row_name(i) + ": columns must ascend");
      }
      sum += value[e];
    }
    if (sum > 1 + excess) {
      std::ostringstream message;
      message << row_name(i) << ": entries and kill rate sum to 1 + " << sum - 1;
      throw std::invalid_argument(message.str());
    }
    // Only once the row has been checked: earlier columns are compared with, and then overwritten.
    for (std::size_t e = row_start[i]; e < row_start[i + 1]; ++e) {
      if (value[e] == 0) continue;
      column[kept] = column[e];
      value[kept++] = value[e];
    }
    start[i + 1] = kept;
  }
  column.resize(kept);
  value.resize(kept);
  row_start_ = std::move(start);
  column_ = std::move(column);
  value_ = std::move(value);
  kill_ = std::move(kill);
}

Chain Chain::from_dense(std::size_t n, std::span<const double> matrix, std::span<const double> kill) {
  if (matrix.size() != n * n || kill.size() != n) {
    throw std::invalid_argument("dense chain: expected " + std::to_string(n) + " x " + std::to_string(n) +
                                " entries and as many kill rates as rows");
  }
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      if (j == i || matrix[i * n + j] == 0) continue;
      column.push_back(static_cast<std::uint32_t>(j));
      value.push_back(matrix[i * n + j]);
    }
    start.push_back(column.size());
  }
  return Chain(std::move(start), std::move(column), std::move(value), {kill.begin(), kill.end()});
}

std::span<const std::uint32_t> Chain::columns(std::size_t row) const {
  return {column_.data() + row_start_[row], row_start_[row + 1] - row_start_[row]};
}

std::span<const double> Chain::values(std::size_t row) const {
  return {value_.data() + row_start_[row], row_start_[row + 1] - row_start_[row]};
}

double Chain::stay(std::size_t row) const {
  const auto entries = values(row);
  const double stays = 1 - std::accumulate(entries.begin(), entries.end(), kill_[row]);
  return interpolated_ ? stays : std::max(0.0, stays);
}

Chain Chain::restricted_to(std::span<const std::uint32_t> states) const {
  constexpr std::uint32_t outside = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> index(size(), outside);
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states[i] >= size() || (i > 0 && states[i] <= states[i - 1])) {
      throw std::invalid_argument("restricted chain: states must ascend and lie below " + std::to_string(size()));
    }
    index[states[i]] = static_cast<std::uint32_t>(i);
  }
  Chain part;
  part.interpolated_ = interpolated_;
  for (const std::uint32_t state : states) {
    double exits = kill_[state];
    const auto to = columns(state);
    const auto probability = values(state);
    for (std::size_t e = 0; e < to.size(); ++e) {
      if (index[to[e]] == outside) {
        exits += probability[e];
      } else {
        part.column_.push_back(index[to[e]]);
        part.value_.push_back(probability[e]);
      }
    }
    part.row_start_.push_back(part.column_.size());
    part.kill_.push_back(exits);
  }
  return part;
}

Incoming incoming(const Chain& chain) {
  const std::size_t n = chain.size();
  Incoming into;
  into.start.assign(n + 1, 0);
  into.row.resize(chain.entries());
  for (std::size_t i = 0; i < n; ++i) {
    for (const std::uint32_t j : chain.columns(i)) ++into.start[j + 1];
  }
  std::partial_sum(into.start.begin(), into.start.end(), into.start.begin());
  std::vector<std::size_t> next(into.start.begin(), into.start.end() - 1);
  for (std::size_t i = 0; i < n; ++i) {
    for (const std::uint32_t j : chain.columns(i)) into.row[next[j]++] = static_cast<std::uint32_t>(i);
  }
  return into;
}

Reachability classify(const Chain& chain) {
  const std::size_t n = chain.size();
  const Incoming into = incoming(chain);
  Reachability reach;
  reach.can_rest.resize(n);
  for (std::size_t i = 0; i < n; ++i) reach.can_rest[i] = chain.kill(i) > 0;
  spread_backwards(into, reach.can_rest);
  std::vector<std::uint8_t> can_escape(n);
  for (std::size_t i = 0; i < n; ++i) can_escape[i] = !reach.can_rest[i];
  spread_backwards(into, can_escape);
  reach.must_rest.resize(n);
  for (std::size_t i = 0; i < n; ++i) reach.must_rest[i] = !can_escape[i];
  return reach;
}

std::vector<std::uint8_t> reachable_from(const Chain& chain, std::span<const double> start) {
  if (start.size() != chain.size()) throw std::invalid_argument("start distribution: one entry per state expected");
  std::vector<std::uint8_t> reached(chain.size(), 0);
  std::vector<std::uint32_t> queue;
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (!(start[i] > 0)) continue;
    reached[i] = 1;
    queue.push_back(static_cast<std::uint32_t>(i));
  }
  while (!queue.empty()) {
    const std::uint32_t state = queue.back();
    queue.pop_back();
    for (const std::uint32_t next : chain.columns(state)) {
      if (reached[next]) continue;
      reached[next] = 1;
      queue.push_back(next);
    }
  }
  return reached;
}

}  // namespace metastable::markov
