#include "markov/chain/elimination.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "markov/chain/dense_elimination.h"
#include "markov/parallel.h"

namespace metastable::markov {
namespace {

using Index = Eigen::Index;
using Vector = Eigen::Map<Eigen::VectorXd>;
using ConstVector = Eigen::Map<const Eigen::VectorXd>;

/// So many pivots are eliminated together from a full matrix.
constexpr std::size_t block_size = 128;
/// Below this size, or below this fill of the square, the row-by-row elimination is used.
constexpr std::size_t blocked_size = block_size;
constexpr double blocked_fill = 0.6;
/// So many columns, or rows, of a full matrix one thread takes at a time.
constexpr std::size_t column_share = 16 * dense::tile_columns, row_share = 96;
std::size_t shares(std::size_t count, std::size_t share) { return (count + share - 1) / share; }

/// Does row += weight * source over columns [from, to).
void add_multiple(double* row, double weight, const double* source, std::size_t from, std::size_t to) {
  const auto count = static_cast<Index>(to - from);
  Vector(row + from, count) += weight * ConstVector(source + from, count);
}

double sum(const double* row, std::size_t from, std::size_t to) {
  return ConstVector(row + from, static_cast<Index>(to - from)).sum();
}

double dot(const double* a, const double* b, std::size_t from, std::size_t to) {
  const auto count = static_cast<Index>(to - from);
  return ConstVector(a + from, count).dot(ConstVector(b + from, count));
}

}  // namespace

/// Row i holds, left of the diagonal, the probabilities at which the chain watched on states 0 .. i leaves i, and,
/// right of it, the expected visits to j > i before the chain is back among 0 .. i (the entries of U). What is stored
/// on the diagonal is never read.
struct Elimination::Factors final : Elimination::Solver {
  Factors(const Chain& chain, int threads);
  std::size_t size() const override { return kill.size(); }
  std::vector<double> solve(std::span<const double> rhs) const override;
  std::vector<double> solve_left(std::span<const double> rhs) const override;

  /// Returns row i, indexed by column low[i] .. high[i] (offset[i] >= i >= low[i]: no row is shorter than its
  /// diagonal).
  double* row(std::size_t i) { return entries.data() + offset[i] - low[i]; }
  const double* row(std::size_t i) const { return entries.data() + offset[i] - low[i]; }
  void check_right_side(std::span<const double> rhs) const;

  std::vector<std::size_t> low, high;  ///< row i occupies columns low[i] .. high[i], i among them
  std::vector<std::size_t> offset;     ///< where low[i] of row i is stored
  std::vector<double> entries;
  std::vector<double> kill;  ///< of the chain watched on 0 .. i, when i is eliminated
  std::vector<double> exit;  ///< rate of leaving i in that chain (the diagonal of D)

 private:
  std::size_t find_envelope(const Chain& chain);
  void eliminate_rows();
  void eliminate_square(std::size_t first, std::size_t last);
  void eliminate_blocks(int threads);
  static double checked_rate(std::size_t n, double rate);

  std::vector<std::size_t> top_;  ///< first row whose envelope reaches column n
};

/// Finds the envelopes after fill; returns the number of entries. Only low[] can change: a pivot n adds columns below n
/// to rows that reach at least to n.
std::size_t Elimination::Factors::find_envelope(const Chain& chain) {
  const std::size_t n = chain.size();
  low.resize(n);
  high.resize(n);
  top_.resize(n);
  for (std::size_t i = 0; i < n; ++i) top_[i] = i;
  for (std::size_t i = 0; i < n; ++i) {
    const auto columns = chain.columns(i);
    low[i] = columns.empty() ? i : std::min<std::size_t>(i, columns.front());
    high[i] = columns.empty() ? i : std::max<std::size_t>(i, columns.back());
    top_[high[i]] = std::min(top_[high[i]], i);
  }
  for (std::size_t i = n; i-- > 1;) top_[i - 1] = std::min(top_[i - 1], top_[i]);
  std::size_t total = 0;
  for (std::size_t pivot = n; pivot-- > 0;) {
    total += high[pivot] - low[pivot] + 1;
    for (std::size_t i = top_[pivot]; i < pivot; ++i) {
      if (high[i] >= pivot) low[i] = std::min(low[i], low[pivot]);
    }
  }
  return total;
}

Elimination::Factors::Factors(const Chain& chain, int threads) : kill(chain.kill().begin(), chain.kill().end()) {
  const std::size_t n = chain.size();
  std::size_t total = find_envelope(chain);
  const bool blocked = n >= blocked_size && static_cast<double>(total) > blocked_fill * static_cast<double>(n * n);
  if (blocked) {
    total = n * n;
    std::fill(low.begin(), low.end(), 0);
    std::fill(high.begin(), high.end(), n - 1);
  }
  offset.resize(n);
  entries.reserve(total);
  std::size_t used = 0;
  for (std::size_t i = 0; i < n; ++i) {
    offset[i] = used;
    used += high[i] - low[i] + 1;
    entries.resize(used);
    const auto columns = chain.columns(i);
    const auto values = chain.values(i);
    double* entry = row(i);
    for (std::size_t e = 0; e < columns.size(); ++e) entry[columns[e]] = values[e];
  }
  exit.resize(n);
  if (blocked) {
    eliminate_blocks(threads);
  } else {
    eliminate_rows();
  }
}

double Elimination::Factors::checked_rate(std::size_t n, double rate) {
  if (!(rate >= std::numeric_limits<double>::min())) {
    throw RestTooRare(rate, n);
  }
  return rate;
}

void Elimination::Factors::eliminate_rows() {
  for (std::size_t n = size(); n-- > 0;) {
    const double* pivot = row(n);
    exit[n] = checked_rate(n, kill[n] + sum(pivot, low[n], n));
    for (std::size_t i = top_[n]; i < n; ++i) {
      if (high[i] < n) continue;
      double* target = row(i);
      if (target[n] == 0) continue;
      target[n] /= exit[n];
      add_multiple(target, target[n], pivot, low[n], n);
      kill[i] += target[n] * kill[n];
    }
  }
}

/// Eliminates the pivots last-1 .. first among themselves, in columns first .. last-1. What lies left of these and the
/// kill rate enter the rate of leaving as one number, carried along as a kill rate is.
void Elimination::Factors::eliminate_square(std::size_t first, std::size_t last) {
  const std::size_t pivots = last - first;
  std::vector<double> copy;
  for (std::size_t i = first; i < last; ++i) {
    copy.push_back(kill[i] + sum(row(i), 0, first));
    copy.insert(copy.end(), row(i) + first, row(i) + last);
  }
  dense::eliminate_square({copy.data(), pivots + 1}, exit.data() + first, pivots);
  for (std::size_t n = last; n-- > first;) {
    checked_rate(n, exit[n]);
    std::copy_n(copy.data() + (n - first) * (pivots + 1) + 1, pivots, row(n) + first);
  }
}

/// Does the same on a full square by blocks of pivots: first the block's square, then the rest of its rows, the visits
/// of the rows above to the block, and all that these visits lead to as one matrix product.
void Elimination::Factors::eliminate_blocks(int threads) {
  const std::size_t n = size();
  std::vector<dense::TileRow> onward(shares(n, dense::tile_columns) * block_size);
  for (std::size_t last = n; last > 0;) {
    const std::size_t first = last > block_size ? last - block_size : 0, pivots = last - first;
    eliminate_square(first, last);
    const dense::Part square{row(first) + first, n};
    dense::eliminate_columns({kill.data() + first, 1}, square, pivots, 1);
    parallel_for(shares(first, column_share), threads, [&](std::size_t share) {
      const std::size_t from = share * column_share, columns = std::min(column_share, first - from);
      const dense::Part rows{row(first) + from, n};
      dense::eliminate_columns(rows, square, pivots, columns);
      dense::pack(rows, pivots, columns, onward.data() + from / dense::tile_columns * pivots);
    });
    parallel_for(shares(first, row_share), threads, [&](std::size_t share) {
      const std::size_t from = share * row_share, rows = std::min(row_share, first - from);
      const dense::Part visits{row(from) + first, n};
      dense::visit_pivots(visits, rows, square, exit.data() + first, pivots);
      for (std::size_t i = from; i < from + rows; ++i) kill[i] += dot(row(i), kill.data(), first, last);
      dense::add_product({row(from), n}, visits, onward.data(), rows, pivots, first);
    });
    last = first;
  }
}

void Elimination::Factors::check_right_side(std::span<const double> rhs) const {
  if (rhs.size() != size()) {
    throw std::invalid_argument("elimination: right side of size " + std::to_string(rhs.size()) + " for " +
                                std::to_string(size()) + " states");
  }
  for (std::size_t i = 0; i < rhs.size(); ++i) {
    if (!(rhs[i] >= 0) || std::isinf(rhs[i])) {
      throw std::invalid_argument("elimination: entry " + std::to_string(i) + " of the right side is " +
                                  std::to_string(rhs[i]) + ", not a finite number >= 0");
    }
  }
}

/// Solves (I - Q) x = b with x = c + w, w = 0 at one state: (I - Q) 1 is the kill rates, which take its column, and
/// the rest is far from singular however rare rest is.
struct Elimination::Bordered final : Elimination::Solver {
  explicit Bordered(const Chain& chain);
  std::size_t size() const override { return order.size(); }
  std::vector<double> solve(std::span<const double> rhs) const override;
  std::vector<double> solve_left(std::span<const double> rhs) const override;

  std::vector<std::size_t> order;  ///< of the states; the last one's column holds the kill rates
  Eigen::PartialPivLU<Eigen::MatrixXd> lu;
};

Elimination::Bordered::Bordered(const Chain& chain) {
  const std::size_t n = chain.size();
  // This says where survivors are: small entries of the left solution then come from small ones, not from differences.
  constexpr int steps = 20;
  std::vector<double> survivors(n, 1.0);
  for (int step = 0; step < steps; ++step) {
    std::vector<double> next(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      next[i] += chain.stay(i) * survivors[i];
      for (std::size_t e = 0; e < chain.columns(i).size(); ++e)
        next[chain.columns(i)[e]] += chain.values(i)[e] * survivors[i];
    }
    const double largest = *std::max_element(next.begin(), next.end());
    for (std::size_t i = 0; i < n; ++i) survivors[i] = std::max(0.0, next[i] / largest);
  }
  order.resize(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return survivors[a] < survivors[b]; });
  std::vector<std::size_t> place(n);
  for (std::size_t i = 0; i < n; ++i) place[order[i]] = i;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(static_cast<Index>(n), static_cast<Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const auto row = static_cast<Index>(place[i]);
    matrix(row, row) = 1 - chain.stay(i);
    for (std::size_t e = 0; e < chain.columns(i).size(); ++e)
      matrix(row, static_cast<Index>(place[chain.columns(i)[e]])) = -chain.values(i)[e];
    matrix(row, static_cast<Index>(n - 1)) = chain.kill(i);
  }
  lu.compute(matrix);
}

std::vector<double> Elimination::Bordered::solve(std::span<const double> rhs) const {
  const std::size_t n = size();
  if (rhs.size() != n) throw std::invalid_argument("elimination: right side of another size than the chain");
  Eigen::VectorXd b(static_cast<Index>(n));
  for (std::size_t i = 0; i < n; ++i) b[static_cast<Index>(i)] = rhs[order[i]];
  const Eigen::VectorXd z = lu.solve(b);
  const double constant = z[static_cast<Index>(n - 1)];
  std::vector<double> x(n, constant);
  for (std::size_t i = 0; i + 1 < n; ++i) x[order[i]] += z[static_cast<Index>(i)];
  return x;
}

std::vector<double> Elimination::Bordered::solve_left(std::span<const double> rhs) const {
  const std::size_t n = size();
  if (rhs.size() != n) throw std::invalid_argument("elimination: right side of another size than the chain");
  Eigen::VectorXd b(static_cast<Index>(n));
  for (std::size_t i = 0; i < n; ++i) b[static_cast<Index>(i)] = rhs[order[i]];
  b[static_cast<Index>(n - 1)] = std::accumulate(rhs.begin(), rhs.end(), 0.0);
  const Eigen::VectorXd z = lu.transpose().solve(b);
  std::vector<double> y(n);
  for (std::size_t i = 0; i < n; ++i) y[order[i]] = z[static_cast<Index>(i)];
  return y;
}

namespace {

std::vector<double> checked(std::vector<double> solution) {
  for (const double entry : solution) {
    if (!std::isfinite(entry)) {
      throw RestTooRare("elimination", entry, "the solution exceeds the range of double precision");
    }
  }
  return solution;
}

void check_reach(const Chain& chain) {
  const std::vector<std::uint8_t> can_rest = classify(chain).can_rest;
  const auto stuck = std::find(can_rest.begin(), can_rest.end(), 0);
  if (stuck != can_rest.end()) {
    throw std::domain_error("elimination: rest cannot be reached from state " +
                            std::to_string(stuck - can_rest.begin()));
  }
}

}  // namespace

RestTooRare::RestTooRare(double rate, std::size_t state)
    : ConvergenceError("elimination", rate,
                       "state " + std::to_string(state) + " is left too rarely for double precision"),
      state_(state) {}

RestTooRare RestTooRare::in_states(std::span<const std::uint32_t> numbers) const {
  return state_ ? RestTooRare(residual(), numbers[*state_]) : *this;
}

Elimination::Elimination(const Chain& chain, int threads) {
  if (chain.interpolated()) {
    check_reach(chain);
    solver_ = std::make_unique<Bordered>(chain);
    return;
  }
  // The first of the states that cannot reach rest is left at a rate of exactly zero once the others are eliminated.
  try {
    solver_ = std::make_unique<Factors>(chain, threads);
  } catch (const ConvergenceError&) {
    check_reach(chain);
    throw;
  }
}

Elimination::~Elimination() = default;
Elimination::Elimination(Elimination&&) noexcept = default;
Elimination& Elimination::operator=(Elimination&&) noexcept = default;

std::size_t Elimination::size() const { return solver_->size(); }
std::vector<double> Elimination::solve(std::span<const double> rhs) const { return checked(solver_->solve(rhs)); }
std::vector<double> Elimination::solve_left(std::span<const double> rhs) const {
  return checked(solver_->solve_left(rhs));
}

std::vector<double> Elimination::Factors::solve(std::span<const double> rhs) const {
  const Factors& f = *this;
  f.check_right_side(rhs);
  std::vector<double> x(rhs.begin(), rhs.end());
  for (std::size_t i = x.size(); i-- > 0;) x[i] += dot(f.row(i), x.data(), i + 1, f.high[i] + 1);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = (x[i] + dot(f.row(i), x.data(), f.low[i], i)) / f.exit[i];
  return x;
}

std::vector<double> Elimination::Factors::solve_left(std::span<const double> rhs) const {
  const Factors& f = *this;
  f.check_right_side(rhs);
  std::vector<double> y(rhs.begin(), rhs.end());
  for (std::size_t i = y.size(); i-- > 0;) {
    y[i] /= f.exit[i];
    add_multiple(y.data(), y[i], f.row(i), f.low[i], i);
  }
  for (std::size_t i = 0; i < y.size(); ++i) add_multiple(y.data(), y[i], f.row(i), i + 1, f.high[i] + 1);
  return y;
}

}  // namespace metastable::markov
