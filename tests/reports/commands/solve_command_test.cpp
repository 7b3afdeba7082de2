// What `metastable solve` finds, and what it refuses.

#include "reports/commands/solve_command.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using SolveCommand = CommandLine;

TEST_F(SolveCommand, SaysTheValueOrThatItIsOutOfReach) {
  const std::vector<std::string> asked = with({"solve", "friction-mean", "--steps", "10", "--points", "5"}, quick);
  const Ran found = metastable(with(asked, {"--json", path("f.json")}));
  ASSERT_EQ(found.code, 0) << found.err;
  EXPECT_NE(found.out.find("friction-mean"), std::string::npos);
  EXPECT_NE(found.out.find("10 expected steps"), std::string::npos) << found.out;
  EXPECT_NE(found.out.find("No law was named, so the answer is that of published"), std::string::npos) << found.out;
  const auto json = nlohmann::json::parse(read(path("f.json")));
  ASSERT_EQ(json.at("solutions").size(), 1U);
  const double value = json.at("solutions")[0].at("value");
  EXPECT_LT(json.at("solutions")[0].at("interval_95")[0], value);
  EXPECT_GT(json.at("solutions")[0].at("interval_95")[1], value);
  EXPECT_EQ(json.at("scanned").size(), 5U);
  const Ran there = metastable(with({"steps", "--friction", fmt::format("{},0.1", value), "--json", "-"}, quick));
  EXPECT_NEAR(nlohmann::json::parse(there.out).at("expected_steps").at("from_start"), 10, 0.1);

  const Ran none = metastable(with({"solve", "friction-mean", "--steps", "10", "--from", "0.6", "--to", "0.8", "--law",
                                    "published", "--points", "3"},
                                   quick));
  EXPECT_EQ(none.code, 0);
  EXPECT_NE(none.out.find("out of reach between 0.6 and 0.8: "), std::string::npos) << none.out;
  EXPECT_EQ(none.out.find("rigid bodies"), std::string::npos);
}

// The parameter that is solved for has no value yet.
TEST(SolveAnswerText, IsHeadedByWhatDoesNotVaryOfAWalker) {
  SolveRequest request;
  request.walker = analysis::WalkerSetting{analysis::Walker::simplest, 0.5, 0.25, dynamics::Terrain::fresh};
  const auto heading = [&] {
    const std::string text = solve_answer_text(request, {});
    EXPECT_EQ(nlohmann::json::parse(solve_answer_json(request, {})).at("provenance").at("settings"),
              text.substr(0, text.find('\n')));
    return text.substr(0, text.find('\n'));
  };
  EXPECT_EQ(heading(), "walker simplest, slope varies, sd 0.25 deg, terrain fresh");
  request.of_slope_sd = true;
  EXPECT_EQ(heading(), "walker simplest, slope 0.5 deg, sd varies, terrain fresh");
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(SolveCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"solve"}, "PARAMETER is required"},
      {{"solve", "slope"}, "solve: one of --steps, --survive and --reach is needed, and no other"},
      {{"solve", "slope", "--steps", "100", "--reach", "0.5"}, "solve: one of --steps, --survive and --reach"},
      {{"solve", "slope", "--slope", "8", "--steps", "100"}, "--slope: is what is solved for"},
      {{"solve", "slop", "--steps", "100"}, "parameter: 'slop' is none of slope, restitution-mean"},
      {{"solve", "slope", "--survive", "1000"}, "--survive: '1000' is not of the form STEPS:SHARE, as 1000:0.9"},
      {{"solve", "slope", "--survive", "1000:1.5"}, "--survive: 1.5 is outside (0, 1)"},
      {{"solve", "slope", "--survive", "0:0.5"}, "--survive: 0 is outside 1..1000000000"},
      {{"solve", "slope", "--reach", "1"}, "--reach: 1 is outside (0, 1)"},
      {{"solve", "slope", "--steps", "1"}, "--steps: 1 is outside (1, inf)"},
      {{"solve", "slope", "--steps", "100", "--to", "30"}, "--to: slope: 30 deg is outside (0, 22.5) deg"},
      {{"solve", "slope", "--steps", "100", "--from", "0"}, "--from: slope: 0 deg is outside (0, 22.5) deg"},
      {{"solve", "slope", "--walker", "compass", "--slope-sd", "0.4", "--steps", "100", "--to", "90"}, "--to: slope"},
      {{"solve", "friction-mean", "--steps", "100", "--from", "0.5", "--to", "0.4"}, "from: 0.5 is not below to: 0.4"},
      {{"solve", "friction-mean", "--steps", "100", "--points", "2"}, "--points: 2 is outside 3..1000"},
      {{"solve", "slope-sd", "--steps", "100"}, "PARAMETER: slope-sd has a meaning with --walker only"},
      {{"solve", "friction-mean", "--walker", "compass", "--slope-sd", "0.4", "--steps", "100"},
       "PARAMETER: 'friction-mean' is none of slope, slope-sd, which a walker has"},
      {{"solve", "slope-sd", "--walker", "compass", "--slope-sd", "0.4", "--steps", "100"},
       "--slope-sd: is what is solved for"},
      {{"solve", "slope-sd", "--walker", "compass", "--reach", "0.4"}, "--reach: has no meaning with --walker"},
      {{"solve", "tip-radius", "--steps", "100"}, "tip-radius has no meaning under this setting"},
      {{"solve", "friction-mean", "--reach", "0.5", "--ramp-length", "inf"}, "reach: the ramp has no end"},
  });
}

}  // namespace
}  // namespace metastable::reports::test
