#include "markov/chain/sparse_solver.h"

#include <gtest/gtest.h>

#include "tests/markov/exact_answers.h"
#include "tests/markov/reference_chains.h"
#include "tests/message_of.h"

namespace metastable::markov {
namespace {

TEST(SparseSolver, SymmetricWalkInClosedForm) {
  constexpr std::size_t n = 1000;
  const SparseSolver solver(reference::birth_death(n, 0.25, 0.25, true));
  const std::vector<double> mean = solver.solve(std::vector<double>(n, 1.0));
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(mean[i] / (static_cast<double>((i + 1) * (n - i)) / 0.5), 1, 1e-9);
}

TEST(SparseSolver, ShiftedSolvesFromTheLeftAndFromTheRight) {
  const Chain chain = reference::random_chain(5, 3, 0.1);
  auto matrix = reference::generator<reference::Rational>(chain);
  for (std::size_t i = 0; i < 5; ++i) matrix[i][i] += reference::Rational(0.25);
  const std::vector<double> rhs{1, -2, 0, 0.5, 3};
  const auto right = reference::gauss(matrix, {rhs.begin(), rhs.end()});
  auto transposed = matrix;
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < 5; ++j) transposed[i][j] = matrix[j][i];
  }
  const auto left = reference::gauss(transposed, {rhs.begin(), rhs.end()});
  const SparseSolver solver(chain, 1.25);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(solver.solve(rhs)[i], right[i].convert_to<double>(), 1e-13);
    EXPECT_NEAR(solver.solve_left(rhs)[i], left[i].convert_to<double>(), 1e-13);
  }
}

TEST(SparseSolver, MoveKeepsTheFactors) {
  SparseSolver first(reference::birth_death(3, 0.25, 0.25, true));
  SparseSolver second(std::move(first));
  EXPECT_NEAR(second.solve(std::vector<double>(3, 1.0))[1], 8, 1e-13);
}

TEST(SparseSolver, SingularMatrixIsAnError) {
  const Chain endless({0, 1, 2}, {1, 0}, {0.5, 0.5}, {0, 0});
  const std::string message = message_of<ConvergenceError>([&] { SparseSolver{endless}; });
  EXPECT_NE(message.find("KLU did not converge: residual"), std::string::npos) << message;
  EXPECT_NE(message.find("the matrix is numerically singular"), std::string::npos) << message;
}

TEST(SparseSolver, IllegalInputs) {
  const SparseSolver solver(reference::birth_death(3, 0.25, 0.25, true));
  EXPECT_EQ(message_of<std::invalid_argument>([&] { solver.solve(std::vector<double>(2)); }),
            "KLU: right side of size 2 for 3 states");
  EXPECT_EQ(message_of<std::invalid_argument>([] { SparseSolver{Chain{}}; }), "KLU: the chain has no states");
}

}  // namespace
}  // namespace metastable::markov
