#include "markov/chain/sparse_solver.h"

#include <klu.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

namespace metastable::markov {

/// Rows of a Chain are handed to KLU as columns: it factorizes the transpose, and its transposed solve is ours.
struct SparseSolver::Factors {
  Factors(const Chain& chain, double sigma);
  ~Factors() {
    klu_l_free_numeric(&numeric, &common);
    klu_l_free_symbolic(&symbolic, &common);
  }
  Factors(const Factors&) = delete;
  Factors& operator=(const Factors&) = delete;

  void assemble(const Chain& chain, double sigma);
  std::vector<double> checked_right_side(std::span<const double> rhs) const;
  static std::vector<double> checked_solution(std::vector<double> solution, SuiteSparse_long ok);

  std::vector<SuiteSparse_long> start, index;
  std::vector<double> value;
  SuiteSparse_long size = 0;
  mutable klu_l_common common{};
  klu_l_symbolic* symbolic = nullptr;
  klu_l_numeric* numeric = nullptr;
};

void SparseSolver::Factors::assemble(const Chain& chain, double sigma) {
  start.push_back(0);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const auto to = chain.columns(i);
    const auto probability = chain.values(i);
    // It takes 1 - stay from the sum itself: one rounding less.
    const double sum = std::accumulate(probability.begin(), probability.end(), chain.kill(i));
    const double leaves = chain.interpolated() ? sum : std::min(1.0, sum);
    const auto diagonal = static_cast<SuiteSparse_long>(i);
    bool placed = false;
    const auto place_diagonal = [&] {
      index.push_back(diagonal);
      value.push_back((sigma - 1) + leaves);
      placed = true;
    };
    for (std::size_t e = 0; e < to.size(); ++e) {
      if (!placed && to[e] > i) place_diagonal();
      index.push_back(to[e]);
      value.push_back(-probability[e]);
    }
    if (!placed) place_diagonal();
    start.push_back(static_cast<SuiteSparse_long>(index.size()));
  }
}

SparseSolver::Factors::Factors(const Chain& chain, double sigma) : size(static_cast<SuiteSparse_long>(chain.size())) {
  assemble(chain, sigma);
  klu_l_defaults(&common);
  symbolic = klu_l_analyze(size, start.data(), index.data(), &common);
  if (symbolic) numeric = klu_l_factor(start.data(), index.data(), value.data(), symbolic, &common);
  if (numeric) klu_l_rcond(symbolic, numeric, &common);
  constexpr double machine_epsilon = std::numeric_limits<double>::epsilon();
  if (!numeric || common.status != KLU_OK || !(common.rcond >= machine_epsilon)) {
    const double residual = numeric ? common.rcond : 0.0;
    const std::string detail = "status " + std::to_string(common.status) + ", the matrix is numerically singular";
    klu_l_free_numeric(&numeric, &common);
    klu_l_free_symbolic(&symbolic, &common);
    throw ConvergenceError("KLU", residual, detail);
  }
}

std::vector<double> SparseSolver::Factors::checked_right_side(std::span<const double> rhs) const {
  if (rhs.size() != static_cast<std::size_t>(size)) {
    throw std::invalid_argument("KLU: right side of size " + std::to_string(rhs.size()) + " for " +
                                std::to_string(size) + " states");
  }
  return {rhs.begin(), rhs.end()};
}

std::vector<double> SparseSolver::Factors::checked_solution(std::vector<double> solution, SuiteSparse_long ok) {
  const bool finite = std::all_of(solution.begin(), solution.end(), [](double x) { return std::isfinite(x); });
  if (!ok || !finite) {
    throw ConvergenceError("KLU", std::numeric_limits<double>::infinity(), "the solution is not finite");
  }
  return solution;
}

SparseSolver::SparseSolver(const Chain& chain, double sigma) {
  if (chain.size() == 0) throw std::invalid_argument("KLU: the chain has no states");
  factors_ = std::make_unique<Factors>(chain, sigma);
}

SparseSolver::~SparseSolver() = default;
SparseSolver::SparseSolver(SparseSolver&&) noexcept = default;
SparseSolver& SparseSolver::operator=(SparseSolver&&) noexcept = default;

std::vector<double> SparseSolver::solve(std::span<const double> rhs) const {
  const Factors& f = *factors_;
  std::vector<double> x = f.checked_right_side(rhs);
  const auto ok = klu_l_tsolve(f.symbolic, f.numeric, f.size, 1, x.data(), &f.common);
  return Factors::checked_solution(std::move(x), ok);
}

std::vector<double> SparseSolver::solve_left(std::span<const double> rhs) const {
  const Factors& f = *factors_;
  std::vector<double> y = f.checked_right_side(rhs);
  const auto ok = klu_l_solve(f.symbolic, f.numeric, f.size, 1, y.data(), &f.common);
  return Factors::checked_solution(std::move(y), ok);
}

}  // namespace metastable::markov
