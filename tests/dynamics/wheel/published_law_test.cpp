#include "dynamics/wheel/published_law.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

const ContactModel model = contact_model(even_wheel(), Law::published);

template <class F>
double integral(F f, double from, double to) {  // midpoint rule
  constexpr int steps = 20000;
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += f(from + (to - from) * (i + 0.5) / steps);
  return sum * (to - from) / steps;
}

// Integrates (12), (14), (17), (20) over the impulse, its end from the definition of the energetic restitution, the
// times from (28): everything but the closed forms under test. It takes mu > 0 and a slip that starts as j says.
Loss integrated(const Collision& c, const Contact& contact, double j) {
  const double eta = contact.restitution, mu = contact.friction, v0 = c.normal_speed, u0 = std::abs(c.tangential_speed);
  const double r2 = c.landing_length * c.landing_length, x = c.contact_x, y = c.contact_y;
  const auto m = [&](double s) { return 1.39 * r2 / (r2 + x * x + s * mu * x * y); };
  const auto n = [&](double s) { return 1.39 * r2 / (r2 + y * y + s * x * y / mu); };
  const double shift = n(j) > 0 ? u0 * n(j) / mu : std::numeric_limits<double>::infinity();  // impulse that stops slip
  const auto v = [&](double p) { return p < shift ? v0 - p / m(j) : v0 - shift / m(j) - (p - shift) / m(-j); };
  const auto u = [&](double p) { return p < shift ? u0 - mu * p / n(j) : mu * (p - shift) / n(-j); };
  // This finds the end of compression and of restitution by small steps of the impulse.
  const double step = 2e-5 * v0 * m(1);
  double end = 0, absorbed = 0, released = 0;
  while (v(end) > 0 || released < eta * eta * absorbed) {
    const double work = v(end + step / 2) * step;
    (work > 0 ? absorbed : released) += std::abs(work);
    end += step;
  }
  Loss loss;
  const double stop = std::min(shift, end);
  loss.zeta = shift / (v0 * m(j));
  loss.normal_pre = integral(v, 0, stop);
  loss.normal_post = integral(v, stop, end);
  loss.tangential_pre = mu * integral(u, 0, stop);
  loss.tangential_post = mu * integral(u, stop, end);
  const double xi = -std::log(eta) / std::hypot(std::numbers::pi, std::log(eta));
  const double whole = std::numbers::pi / std::sqrt(9000 / 1.39 * (1 - xi * xi));
  const double slipping = loss.zeta <= 1        ? whole / 2 * loss.zeta
                          : loss.zeta < 1 + eta ? whole / 2 * (1 + (loss.zeta - 1) / eta)
                                                : whole;
  const double before = stop > 0 ? loss.tangential_pre * slipping / stop : 0;
  const double after = end > stop ? loss.tangential_post * (whole - slipping) / (end - stop) : 0;
  loss.potential = j * 1.39 * 9.81 * (before - after) * std::sin(c.slope_rad);
  return loss;
}

// Has zeta below 1, between 1 and 1 + eta, and beyond; uphill slip, rolling, and downhill slip (mirrored signs).
TEST(PublishedLaw, AgreesWithTheIntegralsOverTheImpulse) {
  int cases[3] = {0, 0, 0};
  for (double u0 : {-2.0, -0.6, -0.1, 0.0, 0.05, 0.2, 0.5, 0.62, 0.7, 2.0})
    for (double mu : {0.1, 0.3, 0.5, 1.2})
      for (double eta : {0.2, 0.4, 0.9}) {
        const Collision c = make_collision(0.1519, 0.1519, 5.2, u0);
        const Loss expected = integrated(c, {eta, mu}, u0 < 0 ? -1 : 1), loss = published_loss(model, c, {eta, mu});
        ++cases[loss.zeta <= 1 ? 0 : loss.zeta < 1 + eta ? 1 : 2];
        const auto near = [&](double a, double b, const char* name) {
          EXPECT_NEAR(a, b, 2e-3 * (std::abs(b) + 0.01)) << name << " u0 " << u0 << " mu " << mu << " eta " << eta;
        };
        near(loss.normal_pre, expected.normal_pre, "D_n,pre");
        near(loss.normal_post, expected.normal_post, "D_n,post");
        near(loss.tangential_pre, expected.tangential_pre, "D_t,pre");
        near(loss.tangential_post, expected.tangential_post, "D_t,post");
        near(loss.potential, expected.potential, "eps_pot");
      }
  EXPECT_GT(std::min({cases[0], cases[1], cases[2]}), 2);
}

// The three forms of tau meet where zeta passes 1 and 1 + eta.
TEST(PublishedLaw, IsContinuousAcrossItsCases) {
  const Contact contact{0.4, 0.5};
  double before = published_loss(model, make_collision(0.1519, 0.1519, 5.2, 0), contact).total();
  for (double u0 = 1e-4; u0 < 2; u0 += 1e-4) {
    const double now = published_loss(model, make_collision(0.1519, 0.1519, 5.2, u0), contact).total();
    ASSERT_NEAR(now, before, 2e-3) << "u0 = " << u0;
    before = now;
  }
}

TEST(PublishedLaw, TangentialLossChangesSignAtMuC) {
  const Collision c = make_collision(0.1519, 0.1519, 5, 0);
  const double mu_c = published_friction_breaks(c).front();
  EXPECT_NEAR(mu_c, 0.19, 0.005);
  EXPECT_LT(published_loss(model, c, {0.4, 0.99 * mu_c}).tangential(), 0);
  EXPECT_GT(published_loss(model, c, {0.4, 1.01 * mu_c}).tangential(), 0);
  EXPECT_EQ(published_loss(model, c, {0.4, 0}).tangential(), 0);
  EXPECT_EQ(published_loss(model, c, {0.4, 0.3}).zeta, 0);
  EXPECT_EQ(published_loss(model, c, {0.4, 0.3}).tau, 1.4);
}

TEST(PublishedLaw, JamsWhereTheNormalMassIsNotPositive) {
  const Collision c = make_collision(0.1519, 0.1519, 5, 0);
  const double jam = published_friction_breaks(c).back();
  EXPECT_NEAR(jam, 3.2, 0.05);
  EXPECT_FALSE(published_loss(model, c, {0.4, jam * (1 - 1e-6)}).jammed);
  EXPECT_TRUE(published_loss(model, c, {0.4, jam * (1 + 1e-6)}).jammed);
}

RC_GTEST_PROP(PublishedLaw, IsFiniteOverTheWholeBox, ()) {
  const Collision c = make_collision(uniform(0.05, 0.3), uniform(0.05, 0.3), uniform(0, 10), uniform(-3, 3));
  const Loss loss = published_loss(model, c, {uniform(0, 1), uniform(0, 5)});
  RC_ASSERT(std::isfinite(loss.total()));
}

TEST(PublishedLaw, EndsOfTheRestitutionAreNotNaN) {
  for (double eta : {0.0, 5e-324, 1e-300, 1.0})
    for (double u0 : {-1.0, 0.0, 0.1, 1.0})
      for (double mu : {0.0, 0.1, 0.5}) {
        const Loss loss = published_loss(model, make_collision(0.1519, 0.1519, 5, u0), {eta, mu});
        EXPECT_TRUE(std::isfinite(loss.total())) << eta << " " << u0 << " " << mu;
      }
  // The smallest normal double stands for everything below.
  const Collision c = make_collision(0.1519, 0.1519, 5, 0);
  EXPECT_NEAR(published_loss(model, c, {0, 0.4}).potential,
              published_loss(model, c, {std::numeric_limits<double>::min(), 0.4}).potential, 1e-15);
}

}  // namespace
}  // namespace metastable::dynamics::test
