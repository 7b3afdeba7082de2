#include "dynamics/settled/settled_density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <ostream>
#include <random>
#include <vector>

#include "dynamics/extended_wheel/extended_wheel.h"
#include "dynamics/settled/landing_grid.h"
#include "dynamics/settled/settled_motion.h"

namespace metastable::dynamics {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double slope = 7.02 * degree;
constexpr ContactSpread usual{0.4, 0.05, 0.38, 0.03};

// The wheel has equal legs, so that the grid of one leg serves all of them.
Wheel equal_wheel() {
  Wheel wheel;
  wheel.leg_length.assign(8, 0.152);
  wheel.radius_of_gyration = 0.0424;
  wheel.tip_radius = 0.0005;
  return wheel;
}

SettledWheel rigid(const Wheel& wheel, double at = slope) { return settled_wheel(wheel, at); }

std::shared_ptr<const LandingShares> grid() {
  static const std::shared_ptr<const LandingShares> built = landing_grid(rigid(equal_wheel()), 4, 6, usual);
  return built;
}

ExtendedWheel extended(const Extension& extension = {}) {
  return {equal_wheel(), slope, Law::settled, usual, extension, grid()};
}

class Draws {
 public:
  Contact contact() {
    return {std::clamp(usual.restitution_mean + usual.restitution_sd * normal_(bits_), 0.0, 1.0),
            std::max(0.0, usual.friction_mean + usual.friction_sd * normal_(bits_))};
  }
  double normal() { return normal_(bits_); }

 private:
  std::mt19937_64 bits_{5};
  std::normal_distribution<double> normal_;
};

// Returns the largest distance of the draws' distribution function from `below`, times the root of their number.
double kolmogorov(std::vector<double> drawn, const std::function<double(double)>& below) {
  std::sort(drawn.begin(), drawn.end());
  const auto count = static_cast<double>(drawn.size());
  double most = 0;
  for (std::size_t i = 0; i < drawn.size(); i += 7) {
    if (drawn[i] <= 0) continue;  // rests
    const double share = below(drawn[i]);
    most = std::max(
        {most, std::abs(share - static_cast<double>(i) / count), std::abs(share - static_cast<double>(i + 1) / count)});
  }
  return most * std::sqrt(count);
}

constexpr double kolmogorov_999 = 1.95;

TEST(ShareGrid, KeepsWhatLandingsThatAreFollowedKeep) {
  const SettledMotion motion(rigid(equal_wheel()));
  Draws draws;
  std::vector<double> off;
  int misjudged = 0;
  for (int i = 0; i < 400; ++i) {
    const double omega = 4.2 + 1.5 * i / 400;
    const Contact contact = draws.contact();
    const Landing landing = motion.land(3, omega, contact);
    const LandingShares::SharesAtSpeed place = grid()->place(3, omega);
    const LandingShares::Kept kept = place.at(contact.restitution, contact.friction);
    const bool rests = kept.share * omega * omega < place.leg().barrier_squared;
    misjudged += rests != (landing.end == LandingEnd::rest);
    if (!rests && landing.end != LandingEnd::rest)
      off.push_back(std::abs(kept.share - landing.carried_squared / (omega * omega)));
  }
  std::sort(off.begin(), off.end());
  EXPECT_LT(off[off.size() / 2], 2e-4);
  EXPECT_LT(off[off.size() * 95 / 100], 2e-3);
  EXPECT_LE(misjudged, 1);
}

// Just above mu_r the share rises as a root: straight lines through places lie below it, by 0.003 rad/s of the next
// speed on average.
TEST(ShareGrid, IsNotBiasedWhereAWheelBarelyPasses) {
  const SettledMotion motion(rigid(equal_wheel()));
  double sum = 0, count = 0;
  for (int i = 0; i < 60; ++i) {
    const double omega = 4.2 + 1.5 * i / 60, eta = 0.3 + 0.2 * ((i * 7) % 60) / 60;
    const LandingShares::SharesAtSpeed place = grid()->place(3, omega);
    const double resting = place.at_restitution(eta).resting_friction(), width = place.leg().sticking - resting;
    for (const double part : {0.02, 0.04, 0.07}) {
      const Landing landing = motion.land(3, omega, {eta, resting + part * width});
      if (landing.end != LandingEnd::settled) continue;
      sum += place.at(eta, resting + part * width).share - landing.carried_squared / (omega * omega);
      ++count;
    }
  }
  ASSERT_GT(count, 100);
  EXPECT_LT(std::abs(sum / count), 4e-4);
}

TEST(SettledDensity, OfTheFirstImpactIsThatOfDrawnContacts) {
  const ExtendedWheel wheel = extended();
  const StepContext context{.leg = 2};
  Draws draws;
  std::vector<double> drawn;
  for (int i = 0; i < 20000; ++i) drawn.push_back(wheel.omega_plus(context, 4.9, draws.contact(), false).value_or(0));
  const auto below = [&](double plus) { return wheel.after_collision(context, 4.9, plus).below; };
  EXPECT_LT(kolmogorov(drawn, below), kolmogorov_999);
  for (const double plus : {2.0, 2.7, 3.0, 3.2})
    EXPECT_NEAR(wheel.after_collision(context, 4.9, plus).density, (below(plus + 1e-4) - below(plus - 1e-4)) / 2e-4,
                2e-3);
}

// A ramp that rings moves the density a little, also where a foot that slides has left hardly any speed.
TEST(SettledDensity, OfTheFirstImpactIsSmoothInTheLoss) {
  constexpr double omega = 4.9;
  const StepContext context{.leg = 2, .since_previous = 0.0};  // cos(0)
  const ExtendedWheel plain = extended();
  for (const double ring : {-0.01, 0.003, 0.01}) {
    Extension rings;
    rings.contact.ring_cosine = ring;
    const ExtendedWheel wheel = extended(rings);
    Draws draws;
    std::vector<double> drawn;
    for (int i = 0; i < 20000; ++i)
      drawn.push_back(wheel.omega_plus(context, omega, draws.contact(), false).value_or(0));
    const auto at = [&](double plus) { return wheel.after_collision(context, omega, plus); };
    EXPECT_LT(kolmogorov(drawn, [&](double plus) { return at(plus).below; }), kolmogorov_999) << ring;
    for (const double plus : {0.05, 0.2, 0.5, 1.0, 2.5}) {
      const double density = at(plus).density, without = plain.after_collision(context, omega, plus).density;
      EXPECT_NEAR(density, (at(plus + 1e-4).below - at(plus - 1e-4).below) / 2e-4, 2e-3) << ring << ' ' << plus;
      EXPECT_NEAR(density / without, 1, 0.25) << ring << ' ' << plus;
    }
  }
}

// A landing counts where its foot comes to stand, but for one in forty of its contacts. (At one sd a sixth of the feet
// just below the limit still moved: an engine's wheel without an effect had a gap by that.)
TEST(SettledDensity, FeetStandUpToTwoSdsOfRestitution) {
  const auto settles_below = [](double mean, double sd) {
    return landing_grid(rigid(equal_wheel()), 4, 9, {mean, sd, 0.4, 0.03})->legs[2].settles_below;
  };
  EXPECT_DOUBLE_EQ(settles_below(0.4, 0.05), settles_below(0.5, 0));
  EXPECT_GT(settles_below(0.4, 0.02), settles_below(0.4, 0.05));
}

TEST(SettledDensity, OfTheNextTouchIsThatOfDrawnContacts) {
  const ExtendedWheel wheel = extended();
  const StepContext context{.leg = 2};
  constexpr double omega = 4.9, blur = 0.01;
  Draws draws;
  std::vector<double> drawn;
  for (int i = 0; i < 5000; ++i) {
    const auto next = wheel.land(context, omega, draws.contact(), false).next;
    drawn.push_back(next ? *next + blur * draws.normal() : 0);
  }
  const auto below = [&](double next) { return wheel.at_next_touch(context, omega, {}, blur, next).speed.below; };
  EXPECT_LT(kolmogorov(drawn, below), kolmogorov_999);
}

TEST(SettledDensity, SlopeAndCurvatureAreThoseOfItsLogarithm) {
  const ExtendedWheel wheel = extended();
  const StepContext context{.leg = 2};
  constexpr double omega = 4.9, blur = 0.02, step = 1e-4;
  for (const std::optional<double>& plus : {std::optional<double>(), std::optional(2.9)})
    for (const double at : {4.5, 4.62, 4.7, 4.8, 5.0}) {
      const auto log_density = [&](double next) {
        return std::log(wheel.at_next_touch(context, omega, {plus, {}}, blur, next).speed.density);
      };
      const double before = log_density(at - step), here = log_density(at), after = log_density(at + step);
      const NextTouch next = wheel.at_next_touch(context, omega, {plus, {}}, blur, at);
      const double slope = (after - before) / (2 * step), curvature = (after - 2 * here + before) / (step * step);
      EXPECT_NEAR(next.slope, slope, 0.01 / blur) << at;
      EXPECT_NEAR(next.curvature, curvature, 0.05 / (blur * blur)) << at;
    }
}

// A foot that sticks leaves a next speed that only restitution spreads. (Cells that stand for points in even widths
// spread it more.)
TEST(SettledDensity, OfAFootThatSticksIsTheIntegralOverRestitution) {
  const ContactSpread grips{0.4, 0.05, 0.6, 0.01};
  const ExtendedWheel wheel(equal_wheel(), slope, Law::settled, grips, Extension{}, grid());
  const StepContext context{.leg = 2};
  constexpr double omega = 4.9, blur = 0.003, width = 0.02;  // of the steps of a trapezoid in scores
  std::vector<double> next, mass;
  double mean = 0, square = 0;
  for (double score = -5; score < 5; score += width) {
    next.push_back(wheel.land(context, omega, {0.4 + 0.05 * score, 0.6}, false).next.value());
    mass.push_back(width * std::exp(-0.5 * score * score) / std::sqrt(2 * std::numbers::pi));
    mean += mass.back() * next.back();
    square += mass.back() * next.back() * next.back();
  }
  const double sd = std::sqrt(square - mean * mean);
  ASSERT_GT(sd, 2 * blur);
  for (const double away : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
    const double at = mean + away * sd;
    double density = 0;
    for (std::size_t k = 0; k < next.size(); ++k)
      density +=
          mass[k] * std::exp(-0.5 * std::pow((at - next[k]) / blur, 2)) / (blur * std::sqrt(2 * std::numbers::pi));
    EXPECT_NEAR(wheel.at_next_touch(context, omega, {}, blur, at).speed.density / density, 1, 0.015) << away;
  }
}

// Effects may move the mean of restitution beyond 1, to where hardly any of its normal distribution can be.
TEST(SettledDensity, GoesOnWhereTheMeanOfRestitutionLeavesItsRange) {
  const ContactSpread narrow{0.4, 0.02, 0.36, 0.03};
  const ExtendedWheel wheel(equal_wheel(), slope, Law::settled, narrow, Extension{}, grid());
  std::optional<double> last;
  for (double ratio = 2; ratio < 4; ratio += 0.01) {
    const StepContext context{.leg = 2, .restitution_ratio = ratio};
    const double rests = wheel.rest_share(context, 4.9, std::nullopt);
    EXPECT_GT(rests, 0) << ratio;
    EXPECT_LT(rests, 1) << ratio;
    EXPECT_NEAR(rests, last.value_or(rests), 0.01) << ratio;
    last = rests;
  }
}

// The error of the law's form is of every next speed, and may tilt about 8 deg.
TEST(SettledDensity, TheErrorOfItsFormTiltsWithTheSlope) {
  const StepContext context{.leg = 2};
  const Contact sticks{0.4, 10};
  const double stated = extended().land(context, 4.9, sticks, false).next.value();
  Extension tilted;
  tilted.law_error.next_ratio = 1.002;
  tilted.law_error.next_by_slope = 0.1;
  const double off = extended(tilted).land(context, 4.9, sticks, false).next.value();
  EXPECT_NEAR(off / stated, 1.002 * std::exp(0.1 * (7.02 - 8) * degree), 1e-12);
}

// What a landing says given omega+, averaged over omega+, is what it says without.
TEST(SettledDensity, GivenTheFirstImpactAveragesToThatWithout) {
  const ExtendedWheel wheel = extended();
  const StepContext context{.leg = 2};
  constexpr double omega = 4.6, blur = 0.02, step = 0.01;
  double rests = 0, below = 0, mass = 0;
  for (double plus = 0.02; plus < 4; plus += step) {
    const double weight = step * wheel.after_collision(context, omega, plus).density;
    mass += weight;
    if (!(weight > 0)) continue;
    rests += weight * wheel.rest_share(context, omega, plus);
    below += weight * wheel.at_next_touch(context, omega, {plus, {}}, blur, 4.7).speed.below;
  }
  EXPECT_NEAR(mass, 1, 2e-3);
  EXPECT_NEAR(rests, wheel.rest_share(context, omega, {}), 2e-3);
  EXPECT_NEAR(below, wheel.at_next_touch(context, omega, {}, blur, 4.7).speed.below, 5e-3);
}

// Where few restitutions carry the wheel on, the chance of rest given omega+ is that of drawn contacts.
TEST(SettledDensity, BesideTheBarrierIsThatOfDrawnContacts) {
  const StepContext context{.leg = 2};
  constexpr double omega = 4.6;
  const ExtendedWheel wheel = extended();
  Draws draws;
  double rests = 0, foretold = 0, count = 0;
  for (int i = 0; i < 200000; ++i) {
    const Contact contact = draws.contact();
    const auto plus = wheel.omega_plus(context, omega, contact, false);
    if (!plus || std::abs(*plus - 1) > 0.25) continue;
    ++count;
    rests += !wheel.land(context, omega, contact, false).next;
    foretold += wheel.rest_share(context, omega, *plus);
  }
  EXPECT_GT(count, 400);
  EXPECT_NEAR(rests / count, foretold / count, 3.3 * std::sqrt(rests * (count - rests) / count) / count);
}

// Of omega+ and slides that the law gives next to never, what a landing says stays a number.
TEST(SettledDensity, IsANumberWhereHardlyAnyGoOn) {
  const StepContext context{.leg = 2};
  constexpr double omega = 4.6, blur = 0.02;
  const ExtendedWheel sure(equal_wheel(), slope, Law::settled, {0.4, 0.004, 0.38, 0.004}, {}, grid());
  for (double plus = 0.01; plus < 3.6; plus += 0.001)
    for (const double slide : {0.0, 0.02, 0.2}) {
      const NextTouch next = sure.at_next_touch(context, omega, {plus, slide, 1e-9}, blur, 4.3);
      EXPECT_GE(next.speed.density, 0) << plus;
      EXPECT_GE(next.speed.below, 0) << plus;
      EXPECT_LE(next.speed.below, 1) << plus;
      EXPECT_TRUE(std::isfinite(next.slide_density)) << plus;
      EXPECT_TRUE(std::isfinite(next.slope) && std::isfinite(next.curvature)) << plus;
    }
}

// An effect moves the next speed as it does in a wheel that is built so and followed.
struct BuiltEffect {
  const char* name;
  Extension extension;
  std::function<SettledMotion()> built;
  double tolerance;  // of the change
};

void PrintTo(const BuiltEffect& effect, std::ostream* out) { *out << effect.name; }

class EffectOnLanding : public testing::TestWithParam<BuiltEffect> {};

TEST_P(EffectOnLanding, IsThatOfTheWheelBuiltSo) {
  const SettledMotion stated(rigid(equal_wheel())), built = GetParam().built();
  const ExtendedWheel plain = extended(), changed = extended(GetParam().extension);
  for (const Contact contact : {Contact{0.4, 0.45}, Contact{0.3, 0.36}}) {
    const double omega = 4.9;
    const double followed = built.step(1, omega, contact).omega_minus - stated.step(1, omega, contact).omega_minus;
    const double read =
        *changed.land({.leg = 1}, omega, contact, false).next - *plain.land({.leg = 1}, omega, contact, false).next;
    EXPECT_NEAR(read, followed, GetParam().tolerance * std::abs(followed) + 1e-3) << contact.friction;
  }
}

std::vector<BuiltEffect> built_effects() {
  const auto with = [](const std::function<void(Extension&)>& change) {
    Extension extension;
    change(extension);
    return extension;
  };
  const auto heavier = [](SettledWheel wheel, double ratio) {
    wheel.radius_of_gyration *= std::sqrt(ratio);
    return SettledMotion(wheel);
  };
  const auto dragged = [](const std::function<void(SettledWheel&)>& change) {
    SettledWheel wheel = rigid(equal_wheel());
    change(wheel);
    return SettledMotion(wheel);
  };
  return {
      {"slope_offset", with([](Extension& e) { e.geometry.slope_offset_rad = 0.25 * degree; }),
       [] { return SettledMotion(rigid(equal_wheel(), slope + 0.25 * degree)); }, 0.05},
      {"hub_inertia", with([](Extension& e) { e.geometry.hub_inertia_ratio = 1.2; }),
       [heavier] { return heavier(rigid(equal_wheel()), 1.2); }, 0.02},
      {"axle_drag_viscous", with([](Extension& e) { e.torques.viscous = 0.002; }),
       [dragged] { return dragged([](SettledWheel& w) { w.linear_drag = 0.002; }); }, 0.1},
      {"rolling_resistance", with([](Extension& e) { e.torques.rolling = 0.01; }),
       [dragged] { return dragged([](SettledWheel& w) { w.constant_drag = 0.01; }); }, 0.1},
      {"air_drag", with([](Extension& e) { e.torques.air = 0.0004; }),
       [dragged] { return dragged([](SettledWheel& w) { w.quadratic_drag = 0.0004; }); }, 0.1},
      {"leg_lengths", with([](Extension& e) { e.geometry.leg_change = {0, 0.001, 0, 0, 0, 0, 0, 0}; }),
       [] {
         Wheel wheel = equal_wheel();
         wheel.leg_length[1] += 0.001;
         return SettledMotion(rigid(wheel));
       },
       0.1},
  };
}

INSTANTIATE_TEST_SUITE_P(All, EffectOnLanding, testing::ValuesIn(built_effects()),
                         [](const auto& effect) { return std::string(effect.param.name); });

}  // namespace
}  // namespace metastable::dynamics
