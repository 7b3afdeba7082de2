// What `metastable compare` prints, what it can compare, and what it refuses.

#include "reports/commands/compare_command.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using CompareCommand = CommandLine;

TEST_F(CompareCommand, PrintsTheContrast) {
  const Ran ran = metastable(with({"compare", "--json", path("c.json")}, quick));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("9.59 deg takes"), std::string::npos);
  EXPECT_NE(ran.out.find("measured trials of 16 collisions"), std::string::npos);
  const auto json = nlohmann::json::parse(read(path("c.json")));
  EXPECT_EQ(json.at("settings").size(), 2u);
  EXPECT_TRUE(json.at("contrasts")[0].at("ratio").at("value").is_number());
}

// Every parameter that steps takes can be what differs; the first values together are the reference.
TEST_F(CompareCommand, TakesSeveralValuesOfAnyParameter) {
  const auto labels = [&](const std::vector<std::string>& words) {
    const Ran ran = metastable(with(with({"compare", "--json", "-"}, words), quick));
    EXPECT_EQ(ran.code, 0) << ran.err;
    std::vector<std::string> all;
    if (ran.code != 0) return all;
    const auto json = nlohmann::json::parse(ran.out);
    for (const auto& one : json.at("settings")) all.push_back(one.at("label"));
    for (const auto& one : json.at("contrasts")) {
      EXPECT_EQ(one.at("against_label"), all.front());
      EXPECT_TRUE(one.at("power").is_null() || one.at("power") >= 0.8);
    }
    return all;
  };
  using Labels = std::vector<std::string>;
  EXPECT_EQ(labels({"--friction-mean", "0.4,0.6"}), (Labels{"mu 0.4", "mu 0.6"}));
  EXPECT_EQ(labels({"--slope", "9.59", "--restitution-sd", "0.1,0.05,0.02"}),
            (Labels{"sd of eta 0.1", "sd of eta 0.05", "sd of eta 0.02"}));
  EXPECT_EQ(labels({"--legs", "0.15", "--legs", "0.16"}),
            (Labels{"legs of 0.15 m", "legs of 0.16 m", "legs of 0.1519 m"}));
  EXPECT_EQ(labels({"--mass", "1.39,2"}), (Labels{"M 1.39 kg", "M 2 kg"}));
  EXPECT_EQ(labels({"--law", "published,plastic", "--friction", "0.4,0.1"}), (Labels{"law published", "law plastic"}));
  EXPECT_EQ(labels({"--initial-speed", "7,0.1", "--initial-speed", "5,0.1"}), (Labels{"omega_0 7", "omega_0 5"}));
  EXPECT_EQ(labels({"--slopes", "7.02,9.59", "--friction-mean", "0.4,0.5"}),
            (Labels{"7.02 deg, mu 0.4", "7.02 deg, mu 0.5", "9.59 deg, mu 0.4", "9.59 deg, mu 0.5"}));
  EXPECT_EQ(labels({"--law", "published,coulomb", "--rebound-lost", "0,0.5"}).size(), 3u);  // published has one
}

TEST_F(CompareCommand, SaysWhatRigidBodiesGive) {
  const Ran compared = metastable(with({"compare"}, quick));
  EXPECT_NE(compared.out.find("No law was named, so the answer is that of published; rigid bodies (law settled)"),
            std::string::npos)
      << compared.out;
  EXPECT_EQ(metastable(with({"compare", "--law", "published"}, quick)).out.find("rigid bodies"), std::string::npos);
}

TEST_F(CompareCommand, StandardErrorsWidenTheRatio) {
  const Ran ran = metastable(with({"compare", "--slope-se", "0.1", "--json", "-"}, quick));
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_TRUE(json["settings"][1].contains("from_standard_errors"));
  EXPECT_LT(json["contrasts"][0]["ratio_from_standard_errors"]["interval_95"][0],
            json["contrasts"][0]["ratio"]["value"]);
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(CompareCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"compare", "--slopes", "7.02"}, "--slopes: 1 given where at least 2"},
      {{"compare", "--slopes", "7.02,9.59", "--initial-speed", "7,0.1"}, "--initial-speed: 1 values for 2 slopes"},
      {{"compare", "--slope", "9.59"}, "--slope: 1 given where at least 2"},
      {{"compare", "--slope", "9.59", "--slopes", "7.02,9.59"}, "--slope: is one of --slopes"},
      {{"compare", "--law", "published,sticky"}, "'sticky'"},
      {{"compare", "--mass", "1,-2"}, "--mass: -2 is outside"},
      {{"compare", "--mass", "1,"}, "--mass: '' is not a number"},
      {{"compare", "--law", "plastic", "--friction-mean", "0.4,0.5"}, "--friction-mean: has a meaning under --law"},
      {{"compare", "--friction-mean", "0.4,0.5", "--friction", "0.4,0.1", "--law", "sticky"}, "sticky"},
      {{"compare", "--slopes", "7,30", "--initial-speed", "7,0", "--initial-speed", "7,0"},
       "--slopes: 30 deg is outside [0.001, 22.5) deg"},
  });
}

}  // namespace
}  // namespace metastable::reports::test
