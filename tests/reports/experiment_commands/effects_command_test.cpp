// What `metastable effects` lists.

#include "reports/experiment_commands/effects_command.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using EffectsCommand = CommandLine;

TEST_F(EffectsCommand, ListsTheCatalogue) {
  const Ran ran = metastable({"effects", "--json", path("effects.json")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("leg_contact: one leg has another friction or restitution\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("0.1 to 5, none at 1"), std::string::npos) << ran.out;
  EXPECT_EQ(nlohmann::json::parse(read(path("effects.json"))).at("schema"), 1);
}

TEST_F(EffectsCommand, ListsThoseOfWalks) {
  const Ran compass = metastable({"effects", "--walker", "compass", "--json", path("effects.json")});
  ASSERT_EQ(compass.code, 0) << compass.err;
  EXPECT_NE(compass.out.find("hip_damping: the hip resists turning in proportion to its rate\n"), std::string::npos)
      << compass.out;
  EXPECT_NE(compass.out.find("(0.5 to 2, none at 1)"), std::string::npos) << "leg_mass\n" << compass.out;
  EXPECT_EQ(compass.out.find("leg_contact"), std::string::npos) << "a wheel's";
  const auto told = nlohmann::json::parse(read(path("effects.json")));
  EXPECT_EQ(told.at("schema"), 1);
  EXPECT_EQ(told.at("walker"), "compass");
  EXPECT_EQ(told.at("effects").at(0).at("parameters").at(0).at("unit"), "N m s/rad");
  const Ran simplest = metastable({"effects", "--walker", "simplest"});
  ASSERT_EQ(simplest.code, 0) << simplest.err;
  EXPECT_EQ(simplest.out.find("leg_mass"), std::string::npos) << simplest.out;
}

TEST_F(EffectsCommand, RefusesAWalkerWhoseWalksAreNotDiagnosed) {
  const Ran ran = metastable({"effects", "--walker", "biped"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_NE(ran.err.find("--walker: 'biped' is none of simplest, compass"), std::string::npos) << ran.err;
}

}  // namespace
}  // namespace metastable::reports::test
