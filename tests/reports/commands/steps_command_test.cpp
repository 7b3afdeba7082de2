// What `metastable steps` prints and writes, and what it refuses.

#include "reports/commands/steps_command.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using StepsCommand = CommandLine;

TEST_F(StepsCommand, WritesTheKeysThatWerePromised) {
  const Ran ran = metastable({"steps", "--json", "-"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_EQ(json.at("schema"), 1);
  EXPECT_EQ(json.at("slope_deg"), 7.02);
  EXPECT_EQ(json.at("method"), "sampled");
  const auto& steps = json.at("expected_steps");
  for (const char* key : {"from_start", "from_quasi_stationary", "worst_start", "sd", "median"})
    EXPECT_TRUE(steps.at(key).is_number()) << key;
  EXPECT_LT(steps.at("interval_95")[0].get<double>(), steps.at("from_start").get<double>());
  EXPECT_GT(steps.at("interval_95")[1].get<double>(), steps.at("from_start").get<double>());
  for (const char* key : {"failure_rate_per_step", "mixing_steps", "reach_ramp_end"})
    EXPECT_TRUE(json.at(key).is_number()) << key;
  EXPECT_GE(json.at("eigenvalue_moduli").size(), 2u);
  EXPECT_TRUE(json.at("quasi_stationary").at("mean_rad_s").is_number());
  EXPECT_TRUE(json.at("quasi_stationary").at("sd_rad_s").is_number());
  EXPECT_TRUE(json.at("error").at("discretization").is_number());
  EXPECT_TRUE(json.at("error").at("sampling").is_number());
}

TEST_F(StepsCommand, ExplainsItsWords) {
  const Ran brief = metastable(with({"steps"}, quick)), full = metastable(with({"steps", "--explain"}, quick));
  ASSERT_EQ(brief.code, 0) << brief.err;
  for (const char* word : {"\n  step: ", "\n  failure: ", "\n  metastable regime: ", "\n  worst start: ",
                           "\n  foot lifts: ", "--explain says more"})
    EXPECT_NE(brief.out.find(word), std::string::npos) << word << brief.out;
  EXPECT_EQ(brief.out.find("quasi-stationary distribution"), std::string::npos);
  EXPECT_NE(full.out.find("quasi-stationary distribution"), std::string::npos) << full.out;
  for (const char* word : {"\n  mixing: ", "\n  resolution: "}) {
    EXPECT_EQ(brief.out.find(word), std::string::npos) << word;
    EXPECT_NE(full.out.find(word), std::string::npos) << word << full.out;
  }
  // Where nothing fails there is no regime that ends.
  const Ran endless = metastable(with({"steps", "--law", "coulomb"}, quick));
  EXPECT_EQ(endless.out.find("metastable regime: "), std::string::npos) << endless.out;
}

TEST_F(StepsCommand, InfiniteIsAWord) {
  const Ran json = metastable(with({"steps", "--law", "coulomb", "--json", "-"}, quick));
  ASSERT_EQ(json.code, 0) << json.err;
  EXPECT_EQ(nlohmann::json::parse(json.out).at("expected_steps").at("from_start"), "infinite");
  const Ran text = metastable(with({"steps", "--law", "coulomb"}, quick));
  EXPECT_NE(text.out.find("infinite: rest is unreachable"), std::string::npos);
}

// Where no law was named, the law of rigid bodies is asked too; where one was, nothing is added.
TEST_F(StepsCommand, WithoutALawSaysWhatRigidBodiesGive) {
  const std::vector<std::string> rubber = with({"steps", "--slope", "9.59", "--friction", "0.6,0.1"}, quick);
  const Ran unnamed = metastable(with(rubber, {"--json", path("u.json")}));
  ASSERT_EQ(unnamed.code, 0) << unnamed.err;
  EXPECT_NE(unnamed.out.find("\n    of rigid bodies (law settled)"), std::string::npos) << unnamed.out;
  EXPECT_NE(
      unnamed.out.find("times as many: trust settled for a real wheel, and published only to compare with the paper."),
      std::string::npos)
      << unnamed.out;
  const auto rigid = nlohmann::json::parse(read(path("u.json"))).at("rigid_bodies");
  EXPECT_EQ(rigid.at("law"), "settled");
  EXPECT_EQ(rigid.at("verdict"), "differs");
  EXPECT_GT(rigid.at("expected_steps").at("interval_95")[0], 100);

  const Ran named = metastable(with(rubber, {"--law", "published", "--json", path("n.json")}));
  EXPECT_EQ(named.out.find("rigid bodies"), std::string::npos);
  EXPECT_FALSE(nlohmann::json::parse(read(path("n.json"))).contains("rigid_bodies"));
  const std::string config = file("law.toml", "law = \"published\"\n");
  EXPECT_EQ(metastable(with(rubber, {"--config", config})).out, named.out);
}

TEST_F(StepsCommand, CertifiedBoundsStandBesideTheEstimate) {
  const std::vector<std::string> words = with({"steps", "--slope", "9.59", "--certify", "--json"}, {path("c.json")});
  const Ran ran = metastable(with(words, quick));
  EXPECT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("certificate"), std::string::npos);
  EXPECT_NE(ran.out.find("guaranteed"), std::string::npos);
  const auto certificate = nlohmann::json::parse(read(path("c.json")))["certificate"];
  EXPECT_TRUE(certificate["exists"]);
  EXPECT_LT(certificate["expected_steps"]["lower"], 6.1746);
  EXPECT_GT(certificate["expected_steps"]["upper"], 6.1746);
  EXPECT_EQ(certificate["per_leg"].size(), 1U);

  const Ran none = metastable(with({"steps", "--slope", "9.59", "--law", "coulomb", "--certify"}, quick));
  EXPECT_EQ(none.code, 0) << none.err;
  EXPECT_NE(none.out.find("no certificate: bounds exist for the law published only"), std::string::npos) << none.out;
}

TEST_F(StepsCommand, LaunchesAreSteadyWhereThePaperHasNone) {
  const Ran text = metastable(with({"steps", "--slope", "8", "--law", "published"}, quick));
  ASSERT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("omega_0 of the metastable regime ("), std::string::npos) << text.out;
  const Ran json = metastable(with({"steps", "--slope", "8", "--initial-speed", "steady", "--json", "-"}, quick));
  const auto told = nlohmann::json::parse(json.out);
  EXPECT_TRUE(told.at("launch").at("steady"));
  EXPECT_NEAR(told.at("launch").at("mean_rad_s"), told.at("quasi_stationary").at("mean_rad_s"), 0.01);
  EXPECT_NEAR(told.at("expected_steps").at("from_start").get<double>() /
                  told.at("expected_steps").at("from_quasi_stationary").get<double>(),
              1, 0.01);
  EXPECT_FALSE(nlohmann::json::parse(metastable(with({"steps", "--json", "-"}, quick)).out).at("launch").at("steady"));
}

TEST_F(StepsCommand, SensitivitiesAndStandardErrorsComeOutRanked) {
  const Ran ran = metastable(
      with({"steps", "--sensitivities", "--friction-se", "0.01,0.004", "--slope-se", "0.1", "--json", "-"}, quick));
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  const auto& list = json["sensitivities"];
  ASSERT_EQ(list.size(), 9u);
  for (std::size_t i = 1; i < list.size(); ++i)
    EXPECT_GE(std::abs(list[i - 1]["elasticity"].get<double>()), std::abs(list[i]["elasticity"].get<double>()));
  const auto& apart = json["from_standard_errors"];
  EXPECT_LT(apart["interval_95"][0], json["expected_steps"]["from_start"]);
  EXPECT_GT(apart["interval_95"][1], json["expected_steps"]["from_start"]);
  EXPECT_EQ(apart["variance_shares"].size(), 3u);
}

TEST_F(StepsCommand, StandardErrorsOfWhatDoesNotMatterAreRefused) {
  const Ran ran = metastable({"steps", "--radius-of-gyration-se", "0.01"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_NE(ran.err.find("radius-of-gyration: a standard error was given"), std::string::npos) << ran.err;
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(StepsCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"steps", "--slope", "25", "--initial-speed", "7,0.1"}, "slope: 25 deg is outside [0.001, 22.5) deg"},
      {{"steps", "--initial-speed", "steadily"}, "--initial-speed: 'steadily' is not"},
      {{"steps", "--slope", "0.1", "--friction", "0.4,0.02"}, "initial speed: steady: fewer than 1e-12 of the wheels"},
      {{"steps", "--slope", "22.5"}, "slope: 22.5 deg is outside [0.001, 22.5) deg"},
      {{"steps", "--rebound-lost", "0.5"}, "--rebound-lost: has a meaning under --law coulomb only"},
      {{"steps", "--initial-speed=-3,0.1"}, "--initial-speed: mean -3 is outside [0, 1000]"},
      {{"steps", "--restitution", "0.4,-0.1"}, "--restitution: sd -0.1 is below 0"},
      {{"steps", "--friction", "-5,0.01"}, "friction"},
      {{"steps", "--legs", "0.15,0.15"}, "--legs: 2 legs are fewer than 3"},
      {{"steps", "--legs", "0.15", "--leg-count", "2"}, "--leg-count: 2 is outside 3..1000"},
      {{"steps", "--cells", "7"}, "--cells: 7 is outside 8..4096"},
      {{"steps", "--tolerance", "2"}, "tolerance: 2 is outside (0, 1)"},
      {{"steps", "--contact-list", path("missing.csv")}, "missing.csv: cannot be read"},
      {{"steps", "--contact-list", path("")}, ": cannot be read"},
      {{"steps", "--contact-list", file("list.csv", "restitution,friction\n0.4,0.3\n1.4,0.3\n")},
       "list.csv:3: column restitution"},
  });
}

TEST_F(StepsCommand, ALimitThatEndsTheCheckOfRigidBodiesLeavesTheAnswer) {
  StepsRequest request;
  request.setting.wheel.leg_length.assign(8, 0.15);
  request.setting.slope_deg = 7;
  request.setting.initial_speed = {6, 0.2};
  request.study.tolerance = 0.3;
  request.rigid_bodies = true;
  const StepsAnswer answer = answer_steps(request, [](const std::string& name) -> Tell {
    if (name != "rigid bodies") return {};
    return [](double share, const std::string& what) { throw TimeLimitReached(7, share, what); };
  });
  EXPECT_GE(answer.study.steps.from_start.value, 1);
  const std::string text = steps_answer_text(request, answer, 120);
  for (const char* said : {"expected steps before failure", "none: the time limit of 7 s ended the check",
                           "rigid bodies (law settled) have no answer: the time limit of 7 s ended the check."})
    EXPECT_NE(text.find(said), std::string::npos) << text;
  EXPECT_NE(steps_answer_json(request, answer).find("the time limit of 7 s ended the check"), std::string::npos);
}

}  // namespace
}  // namespace metastable::reports::test
