#include "markov/transition_rows/chain_pool.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace metastable::markov {

void ChainPool::add(const SampledChain& sampled) {
  const Chain& chain = sampled.chain;
  const std::size_t n = chain.size();
  if (count_ == 0) {
    first_ = sampled;
    rows_.assign(n, {});
    first_column_.assign(n, 0);
    kill_.assign(n, 0.0);
  } else {
    if (n != kill_.size()) throw std::invalid_argument("chain pool: chains of different sizes");
    for (std::size_t i = 0; i < n; ++i) first_.launch.after[i] += sampled.launch.after[i];
    first_.launch.rest += sampled.launch.rest;
  }
  ++count_;
  for (std::size_t i = 0; i < n; ++i) {
    kill_[i] += chain.kill(i);
    const auto columns = chain.columns(i);
    const auto values = chain.values(i);
    if (columns.empty()) continue;
    std::vector<double>& row = rows_[i];
    if (row.empty()) first_column_[i] = columns.front();
    if (columns.front() < first_column_[i]) {
      row.insert(row.begin(), first_column_[i] - columns.front(), 0.0);
      first_column_[i] = columns.front();
    }
    row.resize(std::max<std::size_t>(row.size(), columns.back() - first_column_[i] + 1), 0.0);
    for (std::size_t k = 0; k < columns.size(); ++k) row[columns[k] - first_column_[i]] += values[k];
  }
}

SampledChain ChainPool::mean() const {
  if (count_ == 0) throw std::logic_error("chain pool: empty");
  const double share = 1.0 / static_cast<double>(count_);
  std::vector<std::size_t> row_start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value, kill(kill_);
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    for (std::size_t k = 0; k < rows_[i].size(); ++k) {
      if (rows_[i][k] == 0) continue;
      column.push_back(static_cast<std::uint32_t>(first_column_[i] + k));
      value.push_back(rows_[i][k] * share);
    }
    row_start.push_back(value.size());
    kill[i] *= share;
  }
  SampledChain mean;
  mean.duration = first_.duration;
  mean.advance = first_.advance;
  mean.launch = first_.launch;
  for (double& mass : mean.launch.after) mass *= share;
  mean.launch.rest *= share;
  mean.chain = Chain(std::move(row_start), std::move(column), std::move(value), std::move(kill));
  return mean;
}

}  // namespace metastable::markov
