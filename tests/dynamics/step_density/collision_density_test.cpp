#include "dynamics/step_density/collision_density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/return_map/landing_density.h"
#include "dynamics/return_map/rest_probability.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics {
namespace {

using test::degree;

WheelMap uneven(Law law, double slope_deg, const ContactSpread& s, double rebound_lost = 0) {
  return WheelMap(Wheel{}, slope_deg * degree, law,
                  ContactNoise::normal(s.restitution_mean, s.restitution_sd, s.friction_mean, s.friction_sd),
                  rebound_lost);
}

double inertia_before(const WheelMap& map, int phase) {
  return map.stance((phase + map.phases() - 1) % map.phases()).inertia;
}

// Where one of eta and mu hardly varies, nodes in the other that lie too far apart make a comb of the density.
TEST(CollisionDensity, NarrowSpreadsLoseNoProbabilityAndWinNone) {
  for (const auto& [law, contact] : {std::pair{Law::published, ContactSpread{0.49, 0.0785, 0.15, 0.0096}},
                                     std::pair{Law::published, ContactSpread{0.2, 0.1, 0.15, 0.0096}},
                                     std::pair{Law::published, ContactSpread{0.5, 0.05, 0.35, 0.01}},
                                     std::pair{Law::published, ContactSpread{0.49, 0.09, 0.024, 0.045}},
                                     std::pair{Law::published, ContactSpread{0.5, 0.05, 0.1, 0.05}},
                                     std::pair{Law::published, ContactSpread{0.5, 0.02, -0.02, 0.1}},
                                     std::pair{Law::coulomb, ContactSpread{0.49, 0.09, 0.024, 0.045}},
                                     std::pair{Law::coulomb, ContactSpread{0.5, 0.01, 0.2, 0.05}}}) {
    const WheelMap map = uneven(law, 9.59, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    const Stance& stance = map.stance(6);
    const double omega = 6.0, width = 5e-4;
    double sum = 0, largest = 0;
    const auto at = [&](double plus) {
      return fast.at(map.collision(6, omega), inertia_before(map, 6), stance.inertia, {}, plus);
    };
    double before = at(0.5).below;
    for (double plus = 0.5; plus < omega; plus += width) {
      const double added = width * at(plus + width / 2).density, below = at(plus + width).below;
      largest = std::max(largest, std::abs(added - (below - before)));
      sum += added;
      before = below;
    }
    EXPECT_NEAR(sum, 1, 2e-3) << contact.friction_mean;
    EXPECT_LT(largest, 1e-4) << contact.friction_sd;  // of a density of at most 10 over 5e-4
  }
}

struct ExactCase {
  Law law;
  double slope;
  ContactSpread contact;
  double tolerance;  // of the peak
  friend void PrintTo(const ExactCase& c, std::ostream* out) {
    *out << law_name(c.law) << ", " << c.slope << " deg, restitution " << c.contact.restitution_mean << ", friction "
         << c.contact.friction_mean;
  }
};

class AgainstTheExactDensity : public ::testing::TestWithParam<ExactCase> {};

// Takes another route to the same numbers: adaptive quadrature of the landing, over the stance's energy.
TEST_P(AgainstTheExactDensity, AgreesInTheBody) {
  const auto& [law, slope, contact, tolerance] = GetParam();
  const WheelMap map = uneven(law, slope, contact);
  const CollisionDensity fast(map.contact_model(), contact);
  for (const int phase : {0, 2, 5})
    for (const double omega : {4.0, 5.3, 7.0}) {
      const double x = omega * omega;
      const LandingDensity exact(map, x, phase);
      const Stance& stance = map.stance(phase);
      const auto at = [&](double plus) {
        return fast.at(map.collision(phase, omega), inertia_before(map, phase), stance.inertia, {}, plus);
      };
      double peak = 0;
      for (double share = 0.4; share < 0.99; share += 0.03) peak = std::max(peak, at(share * omega).density);
      for (double share = 0.41; share < 0.98; share += 0.05) {
        const double plus = share * omega;
        if (plus * plus <= stance.barrier) continue;
        EXPECT_NEAR(at(plus).density, 2 * plus * exact(plus * plus + stance.gain), tolerance * peak)
            << omega << ' ' << share << ' ' << phase;
      }
      EXPECT_NEAR(at(std::sqrt(stance.barrier)).below, rest_probability(map, x, phase), 1e-5) << omega;
    }
}

INSTANTIATE_TEST_SUITE_P(Laws, AgainstTheExactDensity,
                         ::testing::Values(ExactCase{Law::published, 9.59, {0.54, 0.045, 0.352, 0.043}, 1e-4},
                                           ExactCase{Law::published, 7.02, {0.4, 0.1, 0.4, 0.1}, 4e-4},
                                           ExactCase{Law::published, 7.02, {0.4, 0.05, 0.3, 0.05}, 1e-4},
                                           ExactCase{Law::published, 7.02, {0.5, 0.09, 0.03, 0.05}, 1e-3},
                                           ExactCase{Law::published, 9.59, {0.5, 0.05, 0.1, 0.05}, 2e-3},
                                           ExactCase{Law::coulomb, 7.02, {0.4, 0.05, 0.45, 0.03}, 5e-4},
                                           ExactCase{Law::coulomb, 9.59, {0.4, 0.1, 0.4, 0.1}, 5e-4},
                                           ExactCase{Law::coulomb, 9.59, {0.4, 0.1, 0.3, 0.05}, 5e-4}),
                         [](const auto& one) {
                           const auto hundredths = [](double value) {
                             return std::to_string(std::lround(100 * value));
                           };
                           return std::string(one.param.law == Law::coulomb ? "Coulomb" : "Published") + "Slope" +
                                  hundredths(one.param.slope) + "Restitution" +
                                  hundredths(one.param.contact.restitution_mean) + "Friction" +
                                  hundredths(one.param.contact.friction_mean);
                         });

TEST(CollisionDensity, IsTheDerivativeOfItsDistribution) {
  for (const Law law : {Law::published, Law::coulomb}) {
    const WheelMap map = uneven(law, 7.02, {0.4, 0.05, 0.36, 0.05});
    const CollisionDensity fast(map.contact_model(), {0.4, 0.05, 0.36, 0.05});
    const CollisionChange change{.friction_ratio = 1.1,
                                 .friction_shift = 0.01,
                                 .restitution_ratio = 0.9,
                                 .loss_ratio = 1.05,
                                 .rebound_lost = 0.3};
    for (double plus = 3.0; plus < 4.6; plus += 0.1) {
      const auto at = [&](double w) {
        return fast.at(map.collision(1, 5.0), inertia_before(map, 1), map.stance(1).inertia, change, w);
      };
      EXPECT_NEAR((at(plus + 1e-4).below - at(plus - 1e-4).below) / 2e-4, at(plus).density,
                  2e-4 + 2e-3 * at(plus).density)
          << plus;
    }
  }
}

// Frictions of which the largest loss is the one that was lost have an infinite density each: nodes between which it
// lies must know of it, or densities and slopes are noise.
TEST(CollisionDensity, UnderCoulombTheLargestLossOfAFrictionLeavesNoTrace) {
  for (const auto& [contact, rebound_lost] :
       {std::pair{ContactSpread{0.4, 0.1, 0.4, 0.1}, 0.0}, std::pair{ContactSpread{0.4, 0.1, 0.3, 0.05}, 0.0},
        std::pair{ContactSpread{0.3, 0.1, 0.2, 0.1}, 0.0}, std::pair{ContactSpread{0.4, 0.05, 0.3, 0.05}, 0.5},
        std::pair{ContactSpread{0.4, 0.1, 0.2, 0.1}, 0.95}}) {
    const WheelMap map = uneven(Law::coulomb, 9.59, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    const double omega = 5.5, step = 5e-4;
    const auto at = [&](double plus) {
      return fast.at(map.collision(7, omega), inertia_before(map, 7), map.stance(7).inertia,
                     {.rebound_lost = rebound_lost}, plus);
    };
    // Below lies the pole of feet that stick and do not spring.
    for (double plus = 4.05; plus < 5.4; plus += 0.013) {
      const double density = at(plus).density;
      EXPECT_NEAR((at(plus + step).below - at(plus - step).below) / (2 * step), density, 5e-3 + 1e-3 * density)
          << plus << ' ' << contact.friction_mean << ' ' << rebound_lost;
    }
  }
}

// A sticking foot loses all but the same whatever small restitution it has. With no bound of the density there, a bias
// of the sensor that shifted one speed onto that loss explained an experiment without a gap.
TEST(CollisionDensity, UnderCoulombNoSpeedIsInfinitelyLikely) {
  for (const ContactSpread& contact : {ContactSpread{0.4, 0.1, 0.4, 0.1}, ContactSpread{0.4, 0.2, 0.5, 0.1}}) {
    const WheelMap map = uneven(Law::coulomb, 9.59, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    const double omega = 5.5, before = inertia_before(map, 7), after = map.stance(7).inertia;
    const Collision collision = map.collision(7, omega);
    const double most = collide(map.contact_model(), collision, {0, 10}).total();
    const double slowest = std::sqrt((before * omega * omega - 2 * most) / after);
    double peak = 0;
    for (double plus = slowest + 0.05; plus < omega; plus += 0.01)
      peak = std::max(peak, fast.at(collision, before, after, {}, plus).density);
    double sum = 0;
    for (double up = 1e-9; up < 0.05; up *= 1.5) {
      const double density = fast.at(collision, before, after, {}, slowest + up).density;
      EXPECT_LT(density, 2 * peak) << up;
      sum += density * up / 2;
    }
    EXPECT_NEAR(sum, fast.at(collision, before, after, {}, slowest + 0.05).below, 0.01);
  }
}

// Scores of the law's own draws at the true contact are uniform: Kolmogorov-Smirnov, and the sum of their squares.
TEST(CollisionDensity, UnderCoulombScoresOfItsOwnDrawsAreUniform) {
  constexpr int draws = 8000;
  for (const ContactSpread& contact :
       {ContactSpread{0.4, 0.1, 0.4, 0.1}, ContactSpread{0.4, 0.1, 0.3, 0.05}, ContactSpread{0.4, 0.1, 0.2, 0.1}}) {
    const WheelMap map = uneven(Law::coulomb, 9.59, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    std::mt19937_64 generator(11);
    std::normal_distribution<double> normal;
    const auto drawn_in = [&](double mean, double sd, double most) {
      double value = -1;
      while (value < 0 || value > most) value = mean + sd * normal(generator);
      return value;
    };
    const double omega = 5.5, before = inertia_before(map, 3), after = map.stance(3).inertia;
    const Collision collision = map.collision(3, omega);
    std::vector<double> scores;
    double squares = 0;
    for (int i = 0; i < draws; ++i) {
      const Contact drawn{drawn_in(contact.restitution_mean, contact.restitution_sd, 1),
                          drawn_in(contact.friction_mean, contact.friction_sd, 10)};
      const double lost = collide(map.contact_model(), collision, drawn).total();
      const double plus = std::sqrt((before * omega * omega - 2 * lost) / after);
      scores.push_back(fast.at(collision, before, after, {}, plus).below);
      squares += std::pow(normal_quantile(std::clamp(scores.back(), 1e-12, 1 - 1e-12)), 2);
    }
    std::sort(scores.begin(), scores.end());
    double farthest = 0;
    for (int i = 0; i < draws; ++i)
      farthest = std::max({farthest, (i + 1.0) / draws - scores[static_cast<std::size_t>(i)],
                           scores[static_cast<std::size_t>(i)] - static_cast<double>(i) / draws});
    EXPECT_LT(farthest, 1.95 / std::sqrt(draws)) << contact.friction_mean;  // at 0.1 %
    EXPECT_NEAR(squares / draws, 1, 3.3 * std::sqrt(2.0 / draws)) << contact.friction_mean;
  }
}

// Collisions are drawn with the change applied by hand.
// The first two spreads reach the fastest speeds possible, where the density of a single friction is singular, the
// others contacts without rebound and without friction, of which the first last long enough to lose little.
TEST(CollisionDensity, HoldsAllProbabilityUpToTheFastestSpeed) {
  for (const ContactSpread& contact :
       {ContactSpread{0.466, 0.187, 0.44, 0.044}, ContactSpread{0.36, 0.079, 0.29, 0.069},
        ContactSpread{0.4, 0.1, 0.2, 0.1}, ContactSpread{0.26, 0.25, 0.02, 0.19}}) {
    const WheelMap map = uneven(Law::published, 7.02, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    for (const double exponent : {0.0, 0.4}) {
      const double omega = 5.2;
      const CollisionChange change{.restitution_ratio = std::pow(omega / 5, -exponent)};
      const auto at = [&](double w) {
        return fast.at(map.collision(2, omega), inertia_before(map, 2), map.stance(2).inertia, change, w);
      };
      const double barrier = std::sqrt(map.stance(2).barrier), width = 1e-3;
      double sum = at(barrier).below, below = sum;
      for (double plus = barrier; plus < 1.1 * omega; plus += width) {
        sum += at(plus + width / 2).density * width;
        const double next = at(plus + width).below;
        EXPECT_GE(next, below - 1e-4) << plus;
        below = next;
      }
      EXPECT_NEAR(sum, 1, 1e-3);
    }
  }
}

TEST(CollisionDensity, ChangesMeanWhatTheySay) {
  const ContactSpread contact{0.5, 0.06, 0.38, 0.05};
  const CollisionChange change{
      .friction_ratio = 1.2, .friction_shift = -0.02, .restitution_ratio = 0.8, .loss_ratio = 1.1};
  for (const Law law : {Law::published, Law::coulomb}) {
    const WheelMap map = uneven(law, 9.59, contact);
    const CollisionDensity fast(map.contact_model(), contact);
    std::mt19937_64 generator(7);
    std::normal_distribution<double> normal;
    const Collision collision = map.collision(3, 5.5);
    const double before = inertia_before(map, 3), after = map.stance(3).inertia;
    const double at = law == Law::published ? 3.1 : 4.1;
    int below = 0;
    constexpr int draws = 40000;
    for (int i = 0; i < draws; ++i) {
      const Contact drawn{(0.5 + 0.06 * normal(generator)) * 0.8, (0.36 + 0.05 * normal(generator)) * 1.2};
      const double plus =
          (before * 5.5 * 5.5 - 2 * 1.1 * collide(map.contact_model(), collision, drawn).total()) / after;
      below += plus <= at * at;
    }
    const double expected = fast.at(collision, before, after, change, at).below;
    EXPECT_GT(expected, 0.02);
    EXPECT_LT(expected, 0.98);
    EXPECT_NEAR(static_cast<double>(below) / draws, expected, 4 * std::sqrt(expected * (1 - expected) / draws));
  }
}

TEST(CollisionDensity, RefusesWhatHasNoDistribution) {
  EXPECT_EQ(message_of([] { CollisionDensity(contact_model(Wheel{}, Law::plastic), {}); }),
            "law: plastic has no restitution and no friction that could be distributed");
  EXPECT_EQ(message_of([] {
              CollisionDensity(contact_model(Wheel{}, Law::published), {0.4, 0, 0.4, 0.1});
            }),
            "contact: the sds of restitution and friction must be > 0");
}

}  // namespace
}  // namespace metastable::dynamics
