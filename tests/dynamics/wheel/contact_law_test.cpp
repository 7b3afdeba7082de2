#include "dynamics/wheel/contact_law.h"

#include <gtest/gtest.h>

#include "tests/dynamics/support.h"

namespace metastable::dynamics::test {
namespace {

TEST(ContactLaw, NamesGoBothWays) {
  for (const std::string& name : law_names()) EXPECT_EQ(law_name(law_from_name(name)), name);
  EXPECT_EQ(message_of([] { law_from_name("hertz"); }),
            "law: \"hertz\" is none of published, coulomb, plastic, settled");
}

TEST(ContactModel, DefaultsAreThoseOfEachLaw) {
  const Wheel wheel = even_wheel();
  EXPECT_EQ(contact_model(wheel, Law::coulomb).radius_of_gyration, 0.05);
  EXPECT_EQ(contact_model(wheel, Law::plastic).radius_of_gyration, 0);
  EXPECT_EQ(contact_model(wheel, Law::published).contact_mass, 1.39);
  EXPECT_NEAR(stance_inertia(wheel, Law::published, 0.15), 1.39 * 0.1519 * 0.1519, 1e-15);
  EXPECT_NEAR(stance_inertia(wheel, Law::coulomb, 0.15), 1.39 * (0.05 * 0.05 + 0.15 * 0.15), 1e-15);
  EXPECT_NEAR(stance_inertia(wheel, Law::plastic, 0.15), 1.39 * 0.15 * 0.15, 1e-15);
}

TEST(ContactModel, GivenInertiaBringsItsRadiusOfGyration) {
  Wheel wheel = even_wheel();
  wheel.inertia = 1.39 * (0.1519 * 0.1519 + 0.04 * 0.04);
  EXPECT_NEAR(contact_model(wheel, Law::coulomb).radius_of_gyration, 0.04, 1e-12);
  EXPECT_NEAR(stance_inertia(wheel, Law::coulomb, 0.16), 1.39 * (0.16 * 0.16 + 0.04 * 0.04), 1e-15);
  EXPECT_EQ(stance_inertia(wheel, Law::published, 0.16), *wheel.inertia);
  // Whatever an experiment may state to three digits every law takes: diagnoses try them all.
  wheel.inertia = 1.39 * 0.1519 * 0.1519 * (1 - 5e-4);
  EXPECT_EQ(contact_model(wheel, Law::coulomb).radius_of_gyration, 0);
}

TEST(ContactModel, IllegalInputIsNamed) {
  Wheel wheel = even_wheel();
  EXPECT_EQ(message_of([&] { contact_model(wheel, Law::coulomb, 1.5); }), "rebound_lost: 1.5 is outside [0, 1]");
  wheel.inertia = 0.01;
  EXPECT_NE(message_of([&] {
              contact_model(wheel, Law::plastic);
            }).find("inertia: 0.01 kg m^2 is below M (mean L)^2 = 0.032"),
            std::string::npos);
}

}  // namespace
}  // namespace metastable::dynamics::test
