#include "dynamics/return_map/published_row.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace metastable::dynamics::published {
namespace {

// A row of a wheel of 45 degrees between its legs, with a usual contact.
PublishedRow row() {
  PublishedRow r{};
  r.a0 = 0.8;
  r.a1 = r.t0 = 0.18;
  r.t1 = 0.7;
  r.kappa = 0.02;
  r.rounding = 0.01;
  r.sticking = r.t0 / r.t1;
  r.normal_sticking = r.a0 - r.a1 * r.sticking;
  set_contact(r, {0.4, 0.1, 0, 1}, {0.4, 0.1, 0});
  set_grid(r, {0.1, 0.4, 0.9}, {stretched(0.1, 0), stretched(0.4, 0), stretched(0.9, 0)}, 0.1);
  set_least(r);
  return r;
}

// The loss as the paper writes it: (1 - eta^2)/A + (1 + eta)^2 mu B/A^2 + kappa (1 + eta) s mu B/A.
double loss(const PublishedRow& r, double eta, double mu, double s) {
  const double a = r.a0 - r.a1 * mu, b = r.t1 * mu - r.t0, more = 1 + eta;
  return (1 - eta * eta) / a + more * more * mu * b / (a * a) + r.kappa * more * s * mu * b / a;
}

TEST(PublishedRow, FrictionsFoundHaveTheLevel) {
  const PublishedRow r = row();
  for (const double eta : {0.05, 0.4, 0.8})
    for (const double mu : {0.3, 0.4, 0.7}) {
      const double s = stretched(eta, 0), level = loss(r, eta, mu, s);
      const Root root = friction_at(r, eta, std::log(eta), level, mu + 0.02);
      EXPECT_NEAR(root.at, mu, 1e-6) << eta << " " << mu;
      const double step = 1e-6, slope = (loss(r, eta, mu + step, s) - loss(r, eta, mu - step, s)) / (2 * step);
      EXPECT_NEAR(root.weight * slope, 1, 1e-3) << eta << " " << mu;
    }
}

TEST(PublishedRow, RestitutionsFoundHaveTheLevel) {
  const PublishedRow r = row();
  for (const double mu : {0.05, 0.15, 0.22})
    for (const double eta : {0.2, 0.5, 0.8}) {
      const double level = loss(r, eta, mu, stretched(eta, r.rounding));
      EXPECT_NEAR(restitution_at(r, mu, level).at, eta, 1e-4) << eta << " " << mu;
    }
}

// Halving finds the least loss of contacts without restitution, and no loss of any contact is below the bound.
TEST(PublishedRow, NoLossIsBelowTheLeast) {
  const PublishedRow r = row();
  for (int k = 0; k <= 100; ++k) {
    const double mu = r.sticking * k / 100;
    EXPECT_GE(loss(r, 0, mu, stretched(0, r.rounding)), r.level_least - 1e-12) << mu;
    for (const double eta : {0.0, 0.4, 0.9})
      EXPECT_GE(loss(r, eta, mu, stretched(eta, r.rounding)), least_level(r, stretched(0.9, 0))) << eta << " " << mu;
  }
}

}  // namespace
}  // namespace metastable::dynamics::published
