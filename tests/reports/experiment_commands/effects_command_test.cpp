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

}  // namespace
}  // namespace metastable::reports::test
