#include "markov/chain/solver.h"

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace metastable::markov {
namespace {

using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor, std::int64_t>;
using States = std::vector<std::uint32_t>;

constexpr double sparse_fill = 0.1;
constexpr double row_excess = 1e-9;

void check_size(const Chain& chain, std::span<const double> vector) {
  if (vector.size() != chain.size()) {
    throw std::invalid_argument("vector of size " + std::to_string(vector.size()) + " for a chain of " +
                                std::to_string(chain.size()) + " states");
  }
}

/// A negative or undefined entry must not hide in the sums of a substitution.
void check_right_side(const Chain& chain, std::span<const double> rhs) {
  check_size(chain, rhs);
  for (std::size_t i = 0; i < rhs.size(); ++i) {
    if (!(chain.interpolated() || rhs[i] >= 0) || !std::isfinite(rhs[i])) {
      throw std::invalid_argument("right side: entry " + std::to_string(i) + " is " + std::to_string(rhs[i]) +
                                  ", not a finite number >= 0");
    }
  }
}

/// Sets x_i = rhs_i + sum_j q_ij x_j for the states of one class, from the class that follows it.
void substitute(const Chain& chain, const States& states, std::span<const double> rhs, std::vector<double>& x) {
  for (const std::uint32_t i : states) {
    const auto to = chain.columns(i);
    const auto probability = chain.values(i);
    double sum = rhs[i];
    for (std::size_t e = 0; e < to.size(); ++e) sum += probability[e] * x[to[e]];
    x[i] = sum;
  }
}

/// Does y_j += y_i q_ij from the states of one class to the class that follows it.
void push_forward(const Chain& chain, const States& states, std::vector<double>& y) {
  for (const std::uint32_t i : states) {
    const auto to = chain.columns(i);
    const auto probability = chain.values(i);
    for (std::size_t e = 0; e < to.size(); ++e) y[to[e]] += y[i] * probability[e];
  }
}

/// Returns the position of every state within its class.
States positions(const Period& period) {
  States position(period.state_class.size());
  for (const States& states : period.classes) {
    for (std::size_t i = 0; i < states.size(); ++i) position[states[i]] = static_cast<std::uint32_t>(i);
  }
  return position;
}

double largest_fill(const Chain& chain, const Period& period) {
  double fill = 0;
  for (std::size_t c = 0; c < period.classes.size(); ++c) {
    const States& from = period.classes[c];
    const States& to = period.classes[(c + 1) % period.classes.size()];
    std::size_t entries = 0;
    for (const std::uint32_t i : from) entries += chain.columns(i).size();
    if (entries > 0) fill = std::max(fill, static_cast<double>(entries) / static_cast<double>(from.size() * to.size()));
  }
  return fill;
}

template <typename Matrix>
Matrix class_block(const Chain& chain, const Period& period, const States& position, std::size_t from) {
  const States& rows = period.classes[from];
  const States& columns = period.classes[(from + 1) % period.classes.size()];
  Matrix block(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(columns.size()));
  if constexpr (std::is_same_v<Matrix, Dense>) block.setZero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto to = chain.columns(rows[i]);
    const auto probability = chain.values(rows[i]);
    for (std::size_t e = 0; e < to.size(); ++e) {
      if constexpr (std::is_same_v<Matrix, Dense>) {
        block(static_cast<Eigen::Index>(i), position[to[e]]) = probability[e];
      } else {
        block.insert(static_cast<Eigen::Index>(i), position[to[e]]) = probability[e];
      }
    }
  }
  if constexpr (std::is_same_v<Matrix, Sparse>) block.makeCompressed();
  return block;
}

/// Multiplies Q_0 Q_1 ... Q_{d-1}.
template <typename Matrix>
Matrix revolution_product(const Chain& chain, const Period& period) {
  const States position = positions(period);
  Matrix product = class_block<Matrix>(chain, period, position, 0);
  for (std::size_t c = 1; c < period.classes.size(); ++c) {
    product = Matrix(product * class_block<Matrix>(chain, period, position, c));
  }
  return product;
}

/// Returns the kill rates of one revolution, k_0 + Q_0 (k_1 + Q_1 (k_2 + ...)), for the states of class 0.
std::vector<double> revolution_kill(const Chain& chain, const Period& period) {
  std::vector<double> killed(chain.kill().begin(), chain.kill().end());
  for (std::size_t c = period.classes.size() - 1; c-- > 0;) {
    substitute(chain, period.classes[c], chain.kill(), killed);
  }
  std::vector<double> kill;
  for (const std::uint32_t i : period.classes[0]) kill.push_back(killed[i]);
  return kill;
}

const Chain& must_reach_rest(const Chain& chain) {
  const std::vector<std::uint8_t> can_rest = classify(chain).can_rest;
  const auto stuck = std::find(can_rest.begin(), can_rest.end(), 0);
  if (stuck != can_rest.end()) {
    throw std::domain_error("chain solver: rest cannot be reached from state " +
                            std::to_string(stuck - can_rest.begin()));
  }
  return chain;
}

}  // namespace

Chain revolution_chain(const Chain& chain, const Period& period) {
  if (period.period == 1) return chain;
  std::vector<std::size_t> start{0};
  std::vector<std::uint32_t> column;
  std::vector<double> value;
  const auto append = [&](std::size_t row, Eigen::Index to, double probability) {
    if (to == static_cast<Eigen::Index>(row) || probability == 0) return;
    column.push_back(static_cast<std::uint32_t>(to));
    value.push_back(probability);
  };
  const std::size_t states = period.classes[0].size();
  if (largest_fill(chain, period) < sparse_fill) {
    const Sparse product = revolution_product<Sparse>(chain, period);
    for (std::size_t i = 0; i < states; ++i) {
      for (Sparse::InnerIterator entry(product, static_cast<Eigen::Index>(i)); entry; ++entry) {
        append(i, entry.col(), entry.value());
      }
      start.push_back(column.size());
    }
  } else {
    const Dense product = revolution_product<Dense>(chain, period);
    for (std::size_t i = 0; i < states; ++i) {
      for (Eigen::Index j = 0; j < product.cols(); ++j) append(i, j, product(static_cast<Eigen::Index>(i), j));
      start.push_back(column.size());
    }
  }
  if (chain.interpolated())
    return Chain::interpolated(std::move(start), std::move(column), std::move(value), revolution_kill(chain, period));
  return Chain(std::move(start), std::move(column), std::move(value), revolution_kill(chain, period),
               row_excess * period.period);
}

ChainSolver::ChainSolver(const Chain& chain, int threads)
    : chain_(must_reach_rest(chain)),
      period_(find_period(chain_)),
      revolution_(revolution_chain(chain_, period_)),
      elimination_(on_states(period_.classes[0], [&] { return Elimination(revolution_, threads); })) {}

std::vector<double> ChainSolver::solve(std::span<const double> rhs) const {
  if (period_.period == 1) return elimination_.solve(rhs);
  check_right_side(chain_, rhs);
  const auto& classes = period_.classes;
  // First comes what one revolution gathers, then all revolutions at once, then the other classes from class 0.
  std::vector<double> x(rhs.begin(), rhs.end());
  for (std::size_t c = classes.size() - 1; c-- > 0;) substitute(chain_, classes[c], rhs, x);
  std::vector<double> gathered;
  for (const std::uint32_t i : classes[0]) gathered.push_back(x[i]);
  const std::vector<double> first = elimination_.solve(gathered);
  for (std::size_t i = 0; i < first.size(); ++i) x[classes[0][i]] = first[i];
  for (std::size_t c = classes.size(); c-- > 1;) substitute(chain_, classes[c], rhs, x);
  return x;
}

std::vector<double> ChainSolver::solve_left(std::span<const double> rhs) const {
  if (period_.period == 1) return elimination_.solve_left(rhs);
  check_right_side(chain_, rhs);
  const auto& classes = period_.classes;
  std::vector<double> y(rhs.begin(), rhs.end());
  for (std::size_t c = 1; c < classes.size(); ++c) push_forward(chain_, classes[c], y);
  std::vector<double> arrived;
  for (const std::uint32_t i : classes[0]) arrived.push_back(y[i]);
  const std::vector<double> first = elimination_.solve_left(arrived);
  std::copy(rhs.begin(), rhs.end(), y.begin());
  for (std::size_t i = 0; i < first.size(); ++i) y[classes[0][i]] = first[i];
  for (std::size_t c = 0; c + 1 < classes.size(); ++c) push_forward(chain_, classes[c], y);
  return y;
}

std::vector<double> apply(const Chain& chain, std::span<const double> x) {
  check_size(chain, x);
  std::vector<double> result(chain.size());
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto to = chain.columns(i);
    const auto probability = chain.values(i);
    double sum = chain.stay(i) * x[i];
    for (std::size_t e = 0; e < to.size(); ++e) sum += probability[e] * x[to[e]];
    result[i] = sum;
  }
  return result;
}

std::vector<double> apply_left(const Chain& chain, std::span<const double> y) {
  check_size(chain, y);
  std::vector<double> result(chain.size(), 0.0);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto to = chain.columns(i);
    const auto probability = chain.values(i);
    result[i] += chain.stay(i) * y[i];
    for (std::size_t e = 0; e < to.size(); ++e) result[to[e]] += y[i] * probability[e];
  }
  return result;
}

}  // namespace metastable::markov
