#include "dynamics/return_map/rest_probability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

constexpr double slope = 7.02 * degree;

bool rests(const WheelMap& map, double state, const Contact& contact) {
  return !(map.after_collision(state, 0, contact) >= map.stance(0).barrier);
}

// Takes fine quadrature in eta and, for each eta, in mu up to every sign change found on a fine grid of mu (bisection).
double two_dimensional(const WheelMap& map, double state) {
  const TruncatedNormal &eta = map.noise().restitution(), &mu = map.noise().friction();
  using Gauss = boost::math::quadrature::gauss<double, 15>;
  const double top = std::min(4.0, mu.mean() + 12 * mu.sd());
  const auto inner = [&](double e) {
    constexpr int grid = 400;
    double sum = 0, start = 0;
    bool inside = rests(map, state, {e, 0});
    const auto add = [&](double from, double to) {  // the density of mu itself, not its distribution function
      for (int i = 0; i < 20; ++i)
        sum += Gauss::integrate([&](double m) { return mu.density(m); }, from + (to - from) * i / 20,
                                from + (to - from) * (i + 1) / 20);
    };
    for (int i = 1; i <= grid; ++i) {
      double a = top * (i - 1) / grid, b = top * i / grid;
      if (rests(map, state, {e, b}) == inside) continue;
      for (int k = 0; k < 60; ++k) (rests(map, state, {e, (a + b) / 2}) == inside ? a : b) = (a + b) / 2;
      if (inside) add(start, a);
      inside = !inside;
      start = a;
    }
    if (inside) add(start, top);
    return sum;
  };
  double total = 0;
  constexpr int panels = 40;
  for (int i = 0; i < panels; ++i) {
    // Panels shrink towards eta = 0, where T_r has its logarithm.
    const double a = std::pow(i / double(panels), 3), b = std::pow((i + 1) / double(panels), 3);
    total += Gauss::integrate([&](double e) { return eta.density(e) * inner(e); }, a, b);
  }
  return total;
}

TEST(RestProbability, AgreesWithTwoDimensionalQuadrature) {
  for (double sd : {0.05, 0.1, 0.2})
    for (double state : {15.0, 25.0, 50.0}) {
      const WheelMap map(even_wheel(), slope, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, sd));
      const double p = rest_probability(map, state, 0);
      EXPECT_NEAR(p / two_dimensional(map, state), 1, 1e-8) << "sd " << sd << " x " << state << " p " << p;
    }
}

// All frictions above mu_c are one: the rest probability jumps as a function of eta. The reference takes for each mu
// the set of eta in closed form, over mu by a midpoint rule below mu_c (good to 1e-4 at its kinks) and by its
// distribution function above.
TEST(RestProbability, AgreesWithTheOtherOrderOfIntegrationForCoulomb) {
  const WheelMap map(even_wheel(), 3 * degree, Law::coulomb, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  const TruncatedNormal &eta = map.noise().restitution(), &mu = map.noise().friction();
  const double sticking = friction_breaks(map.contact_model(), map.collision(0, 1)).back();
  int reachable = 0;
  for (double state : {9.0, 10.0, 11.0, 11.5, 12.0, 12.3, 14.0}) {
    const auto resting = [&](double friction) {
      double sum = 0;
      constexpr int grid = 200;
      for (int i = 0; i < grid; ++i) {
        double a = i / double(grid), b = (i + 1) / double(grid);
        const bool at_a = rests(map, state, {a, friction}), at_b = rests(map, state, {b, friction});
        if (at_a && at_b) sum += eta.between(a, b);
        if (at_a == at_b) continue;
        double low = a, high = b;
        for (int k = 0; k < 55; ++k)
          (rests(map, state, {(low + high) / 2, friction}) == at_a ? low : high) = (low + high) / 2;
        sum += at_a ? eta.between(a, low) : eta.between(low, b);
      }
      return sum;
    };
    double reference = resting(sticking + 1) * mu.complement(sticking);
    constexpr int steps = 1000;
    for (int i = 0; i < steps; ++i)
      reference += resting(sticking * (i + 0.5) / steps) * mu.between(sticking * i / steps, sticking * (i + 1) / steps);
    const double p = rest_probability(map, state, 0);
    reachable += p > 0 && p < 1;
    EXPECT_NEAR(p, reference, 2e-4 * reference) << "x " << state;
  }
  EXPECT_GE(reachable, 4);
}

// In far tails, on ln p, the two ways must agree to the accuracy of the quadrature, at 1e-20 and far below.
TEST(RestProbability, KeepsRelativeAccuracyInTheFarTail) {
  double smallest = 1;
  for (double mean : {0.3, 0.25})
    for (double sd : {0.03, 0.02, 0.008}) {
      const WheelMap map(even_wheel(), slope, Law::published, ContactNoise::normal(0.4, 0.05, mean, sd));
      const double state = 26;
      const double p = rest_probability(map, state, 0);
      smallest = std::min(smallest, p);
      // The reference is composite Gauss over eta on 400 panels, mu's root by bisection (a single upper root here).
      double reference = 0;
      for (int i = 0; i < 400; ++i)
        reference += boost::math::quadrature::gauss<double, 15>::integrate(
            [&](double e) {
              double a = mean, b = 3.0;
              for (int k = 0; k < 80; ++k) (rests(map, state, {e, (a + b) / 2}) ? b : a) = (a + b) / 2;
              return map.noise().restitution().density(e) * map.noise().friction().complement(b);
            },
            i / 400.0, (i + 1) / 400.0);
      EXPECT_NEAR(p / reference, 1, 1e-9) << "mean " << mean << " sd " << sd << " p " << p;
    }
  EXPECT_LT(smallest, 1e-100);
}

TEST(RestProbability, AgreesWithSampling) {
  const WheelMap map(Wheel(), slope, Law::published, ContactNoise::normal(0.4, 0.15, 0.4, 0.15));
  // A regular grid of probability levels stands for the sample: its error falls like 1/n.
  constexpr int n = 600;
  for (int phase : {0, 5}) {
    int count = 0;
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) {
        const std::array score{normal_quantile((i + 0.5) / n), normal_quantile((k + 0.5) / n)};
        count += !map.landing(20, phase, score);
      }
    EXPECT_NEAR(*map.rest_probability(20, phase), count / double(n * n), 2.0 / n);
  }
}

TEST(RestProbability, ConstantsAndListsAreHandled) {
  const auto at = [](const ContactNoise& noise) {
    return rest_probability(WheelMap(even_wheel(), slope, Law::published, noise), 20, 0);
  };
  EXPECT_EQ(at(ContactNoise::normal(0.4, 0, 0.9, 0)), 1);
  EXPECT_EQ(at(ContactNoise::normal(0.4, 0, 0.1, 0)), 0);
  EXPECT_EQ(at(ContactNoise::empirical({{0.4, 0.9}, {0.4, 0.1}, {0.4, 0.1}, {0.4, 0.1}})), 0.25);
  // A constant is the limit of a narrow normal.
  EXPECT_NEAR(at(ContactNoise::normal(0.4, 0, 0.4, 0.1)), at(ContactNoise::normal(0.4, 1e-5, 0.4, 0.1)), 1e-6);
  EXPECT_NEAR(at(ContactNoise::normal(0.3, 0.2, 0.42, 0)), at(ContactNoise::normal(0.3, 0.2, 0.42, 1e-5)), 1e-3);
}

TEST(RestProbability, PlasticWheelRestsSurelyOrNever) {
  const WheelMap map(even_wheel(), slope, Law::plastic, ContactNoise::normal(0.4, 0.1, 0.4, 0.1));
  const double edge = map.stance(0).barrier / map.coefficients(0, {0.4, 0.4}).scale;
  EXPECT_NEAR(rest_probability(map, edge * 0.999, 0), 1, 1e-14);
  EXPECT_EQ(rest_probability(map, edge * 1.001, 0), 0);
}

TEST(RestProbability, CorrelatedPairsHaveNone) {
  const WheelMap map(even_wheel(), slope, Law::published, ContactNoise::normal(0.4, 0.1, 0.4, 0.1, 0.3));
  EXPECT_FALSE(map.rest_probability(20, 0).has_value());
  EXPECT_THROW(rest_probability(map, 20, 0), std::logic_error);
}

}  // namespace
}  // namespace metastable::dynamics::test
