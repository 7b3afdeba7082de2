// Checks bounds around expected steps known in closed form.

#include "markov/passage/certificate.h"

#include <gtest/gtest.h>

#include "markov/chain/chain.h"

namespace metastable::markov {
namespace {

// From x in [0, 1] it rests with probability k(x) = c (1 - x)^2, otherwise the landing is uniform in [0, 1]. With
// M = the integral of m, m(x) = 1 + (1 - k(x)) M and M = 1 / (integral of k) = 3/c.
class Uniform : public LandingSource {
 public:
  explicit Uniform(double c, int phases = 1) : c_(c), phases_(phases) {}
  double steps(double x) const { return 1 + (1 - kill(x)) * 3 / c_; }

  int phases() const override { return phases_; }
  Range below(int, double state, double edge) const override {
    const double k = kill(state), c = std::min(1.0, k + (1 - k) * std::min(edge, 1.0));
    return {c * (1 - 1e-15), std::min(1.0, c * (1 + 1e-15))};
  }
  std::optional<Bend> bend(int, Range state, Range edge) const override {
    if (!bends || state.upper > 1) return std::nullopt;
    return Bend{{2 * c_ * (1 - edge.upper) - 1e-12, 2 * c_ * (1 - edge.lower) + 1e-12}, {-1e-12, 1e-12}, 0, 0};
  }
  double overshoot(int, double, double edge) const override { return edge >= 1 ? 0 : 1; }
  double growth(int, double) const override { return growth_above; }

  bool bends = true;
  double growth_above = 0;

 private:
  double kill(double x) const { return x < 1 ? c_ * (1 - x) * (1 - x) : 0; }
  double c_;
  int phases_;
};

std::vector<std::vector<double>> even(std::size_t cells, int phases = 1) {
  std::vector<double> nodes;
  for (std::size_t i = 0; i <= cells; ++i) nodes.push_back(static_cast<double>(i) / static_cast<double>(cells));
  return std::vector<std::vector<double>>(static_cast<std::size_t>(phases), nodes);
}

double widest(const Certificate& c) {
  double most = 0;
  for (std::size_t p = 0; p < c.nodes.size(); ++p)
    for (std::size_t i = 0; i < c.nodes[p].size(); ++i) most = std::max(most, c.upper[p][i] / c.lower[p][i] - 1);
  return most;
}

void expect_holds(const Uniform& source, const Certificate& c) {
  ASSERT_TRUE(c.no_upper.empty()) << c.no_upper;
  for (std::size_t p = 0; p < c.nodes.size(); ++p)
    for (std::size_t i = 0; i < c.nodes[p].size(); ++i) {
      EXPECT_LE(c.lower[p][i], source.steps(c.nodes[p][i]));
      EXPECT_GE(c.upper[p][i], source.steps(c.nodes[p][i]));
    }
  // The bounds are linear between nodes.
  for (std::size_t i = 0; i + 1 < c.nodes[0].size(); ++i) {
    const double m = source.steps(0.5 * (c.nodes[0][i] + c.nodes[0][i + 1]));
    EXPECT_LE(0.5 * (c.lower[0][i] + c.lower[0][i + 1]), m);
    EXPECT_GE(0.5 * (c.upper[0][i] + c.upper[0][i + 1]), m);
  }
}

TEST(Certificate, HoldsTheClosedForm) {
  for (const double c : {0.5, 1e-3, 1e-7}) expect_holds(Uniform(c), certify(Uniform(c), even(40), 2));
}

TEST(Certificate, WidthIsOfSecondOrder) {
  const Uniform source(0.5);
  const double coarse = widest(certify(source, even(20), 2)), fine = widest(certify(source, even(40), 2));
  EXPECT_NEAR(coarse / fine, 4, 0.4);
}

TEST(Certificate, WithoutCurvatureRoundingIsOfFirstOrder) {
  Uniform source(0.5);
  source.bends = false;
  const Certificate coarse = certify(source, even(40), 2), fine = certify(source, even(80), 2);
  expect_holds(source, coarse);
  EXPECT_NEAR(widest(coarse) / widest(fine), 2, 0.3);
}

TEST(Certificate, PhasesInARow) {
  const Uniform source(1e-2, 3);
  expect_holds(source, certify(source, even(30, 3), 2));
}

TEST(Certificate, ThreadsDoNotMatter) {
  const Uniform source(1e-2);
  const Certificate one = certify(source, even(50), 2, 1), two = certify(source, even(50), 2, 2);
  EXPECT_EQ(one.lower, two.lower);
  EXPECT_EQ(one.upper, two.upper);
}

TEST(Certificate, WithoutADriftThereIsNoUpperBound) {
  Uniform source(0.5);
  source.growth_above = 1;
  const Certificate c = certify(source, even(20), 2);
  EXPECT_TRUE(c.upper.empty());
  EXPECT_NE(c.no_upper.find("drift"), std::string::npos);
  EXPECT_LE(c.lower[0][10], source.steps(0.5));
  EXPECT_GT(c.lower[0][10], 0.98 * source.steps(0.5));
}

TEST(Certificate, TooManyStepsAreAnErrorNotANumber) {
  EXPECT_THROW(certify(Uniform(1e-18), even(20), 2), ConvergenceError);
}

TEST(Certificate, NodesAreChecked) {
  const Uniform source(0.5);
  EXPECT_THROW(certify(source, {}, 2), std::invalid_argument);
  EXPECT_THROW(certify(source, {{0, 1}}, 2), std::invalid_argument);
  EXPECT_THROW(certify(source, {{0, 0.5, 0.5, 1}}, 2), std::invalid_argument);
  EXPECT_THROW(certify(source, even(10), 0.5), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::markov
