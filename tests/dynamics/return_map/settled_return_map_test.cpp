#include "dynamics/return_map/settled_return_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "dynamics/return_map/trials.h"
#include "dynamics/settled/settled_roll.h"
#include "tests/dynamics/settled_tables.h"
#include "tests/dynamics/support.h"

namespace metastable::dynamics {
namespace {

// Has equal legs, J = 0.0025 kg m^2; a table that is enough for eta from 0.2 to 0.6.
SettledReturnMap engine_wheel(const ContactNoise& noise, bool direct = false) {
  Wheel wheel = test::even_wheel();
  wheel.radius_of_gyration = std::sqrt(0.0025 / wheel.hub_mass);
  SettledMapOptions options;
  options.range = {6.5, 0.2, 0.6};
  options.speeds = 14;
  options.restitutions = 7;
  options.frictions = 16;
  options.checks = 20;
  options.direct = direct;
  options.executor = test::two_threads;
  return {wheel, 7.02 * test::degree, noise, 6, options};
}

// Contacts with mu ~ N(0.4, 0.03^2), eta ~ N(0.4, 0.05^2).
ContactNoise engine_noise() { return ContactNoise::normal(0.4, 0.05, 0.4, 0.03, 0, most_settled_restitution); }

TEST(SettledReturnMap, RowsAreDistributions) {
  const SettledReturnMap map = engine_wheel(engine_noise());
  const int phase = 0;
  for (const double omega : {4.0, 4.8, 5.5}) {
    std::vector<std::pair<double, double>> points;
    const double rest = map.landing_points(omega * omega, phase, {}, points);
    double sum = rest, mean = 0;
    for (const auto& [next, weight] : points) {
      EXPECT_GE(weight, 0);
      sum += weight;
      mean += weight * next;
    }
    EXPECT_NEAR(sum, 1, 1e-8);
    EXPECT_NEAR(*map.rest_probability(omega * omega, phase) / rest, 1, 1e-10);
    // This is the same by draws.
    std::mt19937_64 random(7);
    std::normal_distribution<double> score;
    constexpr int draws = 4000;
    int rests = 0;
    double total = 0, squares = 0;
    for (int k = 0; k < draws; ++k) {
      const double both[2] = {score(random), score(random)};
      const auto landed = map.landing(omega * omega, phase, both);
      rests += !landed;
      total += landed.value_or(0);
      squares += landed.value_or(0) * landed.value_or(0);
    }
    EXPECT_NEAR(rests, draws * rest, 4.5 * std::sqrt(draws * rest) + 1);
    const double sd = std::sqrt((squares / draws - std::pow(total / draws, 2)) / draws);
    EXPECT_NEAR(total / draws, mean, 4.5 * sd);
  }
}

TEST(SettledReturnMap, TabulatedDrawsLandAsTheMapDoes) {
  const SettledReturnMap map = engine_wheel(engine_noise());
  std::vector<double> scores;
  for (int k = 0; k < 40; ++k) scores.insert(scores.end(), {-2 + 0.1 * k, 2.5 * std::sin(1.7 * k)});
  SettledReturnMap::Table table = map.tabulate(0, scores);
  std::vector<double> offset(40, 0.0), next(40);
  for (double state = 10; state < 60; state += 1.7) {  // the table's last is 42.25
    table.land(state, 0, offset, 0, next);
    for (std::size_t k = 0; k < 40; ++k) {
      const auto landed = map.landing(state, 0, std::span(scores).subspan(2 * k, 2));
      ASSERT_EQ(std::isfinite(next[k]), landed.has_value()) << state << ' ' << k;
      if (landed) {
        EXPECT_NEAR(next[k], *landed, 3e-3 * state) << state << " " << k;
      }
    }
  }
}

// P(rest) is a normal's tail, however far out.
TEST(SettledReturnMap, RestIsATailToTheEndOfDoubles) {
  double before = 1;
  for (const double sd : {0.03, 0.01, 0.005}) {
    const SettledReturnMap map = engine_wheel(ContactNoise::normal(0.4, 0, 0.5, sd, 0, most_settled_restitution));
    const double rest = *map.rest_probability(25, 0);
    const double mu = map.landings().resting_friction(0, 5, 0.4);
    EXPECT_NEAR(rest / normal_cdf((mu - 0.5) / sd), 1, 1e-9);
    EXPECT_LT(rest, before);
    before = rest;
  }
  EXPECT_LT(before, 1e-200);
}

// The mean of the defect is what following instead of reading changes, here with f = next state.
TEST(SettledReturnMap, DefectIsTheDifferenceToLandingsThatAreFollowed) {
  const SettledReturnMap read = engine_wheel(engine_noise()), followed = engine_wheel(engine_noise(), true);
  const auto f = [](double next) { return next; };
  std::mt19937_64 random(3);
  std::normal_distribution<double> score;
  double defect = 0, difference = 0;
  for (int k = 0; k < 300; ++k) {
    const double both[2] = {score(random), score(random)};
    EXPECT_FALSE(followed.landing_defect(24, 0, both, f));
    const double one = *read.landing_defect(24, 0, both, f);
    EXPECT_LT(std::abs(one), 0.05);
    defect += one;
    difference += followed.landing(24, 0, both).value_or(0) - read.landing(24, 0, both).value_or(0);
  }
  EXPECT_NEAR(defect / 300, difference / 300, 2e-3);  // the difference misses what lies between the two thresholds
}

// At a launch's speed most feet still move when the next leg touches. Rolled on from there, wheels differ from those
// that land on a standing foot by what the defect says.
TEST(SettledReturnMap, MemoryDefectIsWhatMovingFeetDo) {
  const SettledReturnMap map = engine_wheel(engine_noise(), true);
  const SettledMotion& motion = map.landings().motion();
  const double state = 7.35 * 7.35;
  std::mt19937_64 random(4);
  std::normal_distribution<double> score;
  constexpr int draws = 200;
  double defect = 0, difference = 0;
  int moving = 0;
  for (int k = 0; k < draws; ++k) {
    const double z[4] = {score(random), score(random), score(random), score(random)};
    defect += *map.memory_defect(state, 0, z, [](double next) { return next; });
    const Contact first = map.noise().draw(std::span(z).first(2)), second = map.noise().draw(std::span(z).last(2));
    SettledRoll roll(motion, 0, 7.35, first, first);
    const Step step = roll.step();
    if (!step.touched || (step.landing.end == LandingEnd::settled && !step.landing.slips_late)) continue;
    ++moving;
    roll.set_contact(second);
    const Step rolled = roll.step();
    const double standing = map.landing(state, 0, std::span(z).first(2)).value_or(0);
    difference += (rolled.touched ? rolled.omega_minus * rolled.omega_minus : 0) -
                  map.landing(standing, 0, std::span(z).last(2)).value_or(0);
  }
  EXPECT_GT(moving, draws / 2);
  EXPECT_NEAR(defect / draws, difference / draws, 0.1);
}

}  // namespace
}  // namespace metastable::dynamics
