// Runs the program as its users meet it: arguments in, exit code, streams and files out.

#include "reports/command_line/cli.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "reports/output/interrupt.h"
#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports {
namespace {
using test::metastable;
using test::Ran;
using test::read;

class CommandLine : public test::InFolder {
 protected:
  std::string file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  std::vector<std::string> left_behind() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
};

const std::vector<std::string> quick{"--legs", "0.1519", "--cells", "32", "--samples", "256"};

std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(CommandLine, CertifiedBoundsStandBesideTheEstimate) {
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

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(CommandLine, WrongInputIsOneLineAndCodeTwo) {
  struct Case {
    std::vector<std::string> words;
    std::string named;
  };
  const std::vector<Case> cases = {
      {{}, "subcommand"},
      {{"stepz"}, "stepz"},
      {{"steps", "--bogus", "1"}, "--bogus"},
      {{"steps", "--slope", "abc"}, "--slope: 'abc' is not a number"},
      {{"steps", "--slope", "25", "--initial-speed", "7,0.1"}, "slope: 25 deg is outside [0.001, 22.5) deg"},
      {{"steps", "--initial-speed", "steadily"}, "--initial-speed: 'steadily' is not"},
      {{"steps", "--slope", "0.1", "--friction", "0.4,0.02"}, "initial speed: steady: fewer than 1e-12 of the wheels"},
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
      {{"solve", "slope", "--steps", "100", "--to", "30"}, "slope: 30 deg is outside (0, 22.5) deg"},
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
      {{"steps", "--slope", "22.5"}, "slope: 22.5 deg is outside [0.001, 22.5) deg"},
      {{"steps", "--rebound-lost", "0.5"}, "--rebound-lost: has a meaning under --law coulomb only"},
      {{"sweep", "--friction-mean", "0.2,0.3", "--contact-list", file("ok.csv", "restitution,friction\n0.4,0.3\n")},
       "--friction-mean: cannot vary with --contact-list"},
      {{"steps", "--initial-speed=-3,0.1"}, "--initial-speed: mean -3 is outside [0, 1000]"},
      {{"steps", "--restitution", "0.4,-0.1"}, "--restitution: sd -0.1 is below 0"},
      {{"steps", "--friction", "-5,0.01"}, "friction"},
      {{"steps", "--legs", "0.15,0.15"}, "--legs: 2 legs are fewer than 3"},
      {{"steps", "--legs", "0.15", "--leg-count", "2"}, "--leg-count: 2 is outside 3..1000"},
      {{"steps", "--cells", "7"}, "--cells: 7 is outside 8..4096"},
      {{"steps", "--tolerance", "2"}, "tolerance: 2 is outside (0, 1)"},
      {{"steps", "--law", "sticky"}, "published, coulomb"},
      {{"steps", "--method", "guess"}, "--method: 'guess'"},
      {{"steps", "--seed", "1", "--seed", "2"}, "--seed: given 2 times"},
      {{"steps", "--json", path("no/such/folder/x.json")}, "no/such/folder"},
      {{"steps", "--config", path("missing.toml")}, "missing.toml: cannot be read: No such file or directory"},
      {{"--foo"}, "--foo: is no option before a subcommand; --help and --version are"},
      {{"describe"}, "DIR is required; see 'metastable describe --help'"},
      {{"steps", "--config", path("")}, ": cannot be read: it is a folder"},
      {{"steps", "--contact-list", path("missing.csv")}, "missing.csv: cannot be read"},
      {{"steps", "--contact-list", path("")}, ": cannot be read"},
      {{"steps", "--config", file("key.toml", "slope = 7.02\nslop = 3\n")}, "key.toml:2: unknown key 'slop'"},
      {{"steps", "--config", file("toml.toml", "slope = = 3\n")}, "toml.toml:1"},
      {{"steps", "--contact-list", file("list.csv", "restitution,friction\n0.4,0.3\n1.4,0.3\n")},
       "list.csv:3: column restitution"},
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
      {{"sweep"}, "no range given"},
      {{"sweep", "--slope", "5:12:0"}, "--slope: range 5:12:0"},
      {{"sweep", "--slope", "5:30:5", "--initial-speed", "7,0.1", "--out", path("s.csv")},
       "--slope: 30 is outside [0.001, 22.5)"},
      {{"sweep", "--method", "integrated", "--friction-sd", "0.0005,0.1", "--out", path("s.csv")},
       "friction: sd 0.0005 is too narrow for method integrated"},
      {{"sweep", "--slope", "7:8:1", "--initial-speed", "7,0.1", "--out", path("")}, "is a folder"},
      {{"sweep", "--slope", "7:8:1", "--initial-speed", "7,0.1", "--out", path("no/s.csv")}, "no/s.csv"},
      {{"report", "--out", file("report.csv", "")}, "report.csv"},
      {{"verify", "--out", file("verify.csv", "")}, "verify.csv: Not a directory"},
      {{"verify", "--export", file("chain.csv", "")}, "chain.csv: Not a directory"},
      {{"study", "--out", file("study.csv", "")}, "study.csv"},
      {{"study", "--data", path("none"), "--out", path("study")}, "none: there is no such folder"},
      {{"describe", path("none"), "--out", path("described")}, "none: there is no such folder"},
      {{"collisions", path("none")}, "none: there is no such folder"},
      {{"coast-down", path(""), "--out", path("drum")}, ": cannot be read"},
      {{"diagnose"}, "DIR"},
      {{"diagnose", path("none")}, "none: there is no such folder"},
      {{"lessons", "--data", path("none"), "--out", path("lessons")}, "none: there is no such folder"},
      {{"diagnose", path("none"), "--catalogue", "leg_contact,lag_contact"}, "--catalogue: "},
      {{"diagnose", path("none"), "--catalogue", file("ids.csv", "leg_contact\n# more\nlag_contact\n")}, "ids.csv:3: "},
      {{"effects", "--json", path("no/such/folder/x.json")}, "no/such/folder"},
      {{"simulate"}, "--out: a folder must be given"},
      {{"simulate", "--trials", "0", "--out", path("t")}, "--trials: 0 is outside 1..1000000"},
  };
  for (const Case& one : cases) {
    const Ran ran = metastable(one.words);
    std::string words;
    for (const std::string& word : one.words) words += word + " ";
    EXPECT_EQ(ran.code, 2) << words;
    EXPECT_NE(ran.err.find(one.named), std::string::npos) << words << "\n" << ran.err;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << words << "\n" << ran.err;
    EXPECT_EQ(ran.out, "") << words;
  }
  for (const std::string& name : left_behind()) EXPECT_TRUE(name.ends_with(".toml") || name.ends_with(".csv")) << name;
  EXPECT_FALSE(std::filesystem::exists(path("s.csv")));
}

TEST_F(CommandLine, StepsWritesTheKeysThatWerePromised) {
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

// Where no law was named, the law of rigid bodies is asked too; where one was, nothing is added.
TEST_F(CommandLine, StepsWithoutALawSaysWhatRigidBodiesGive) {
  const std::vector<std::string> rubber = with({"steps", "--slope", "9.59", "--friction", "0.6,0.1"}, quick);
  const Ran unnamed = metastable(with(rubber, {"--json", path("u.json")}));
  ASSERT_EQ(unnamed.code, 0) << unnamed.err;
  EXPECT_NE(unnamed.out.find("\n    of rigid bodies (law settled)"), std::string::npos) << unnamed.out;
  EXPECT_NE(unnamed.out.find("times as many: trust settled for a real wheel, published for comparing with the paper."),
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

TEST_F(CommandLine, CompareAndSweepSayItToo) {
  const Ran compared = metastable(with({"compare"}, quick));
  EXPECT_NE(compared.out.find("The law is published, as none was named; rigid bodies (law settled)"), std::string::npos)
      << compared.out;
  EXPECT_EQ(metastable(with({"compare", "--law", "published"}, quick)).out.find("rigid bodies"), std::string::npos);

  const std::vector<std::string> rubber = with({"sweep", "--slope", "9.59", "--friction-mean", "0.4,0.5,0.6"}, quick);
  const Ran swept = metastable(with(rubber, {"--out", path("s.csv")}));
  ASSERT_EQ(swept.code, 0) << swept.err;
  EXPECT_NE(swept.out.find("disagree in direction"), std::string::npos) << swept.out;
  const std::string whole = read(path("s.csv"));
  EXPECT_NE(whole.find(",status,rigid_bodies_steps,rigid_bodies_steps_low95,rigid_bodies_steps_high95\n"),
            std::string::npos);
  EXPECT_NE(read(path("s.svg")).find("law settled"), std::string::npos);
  EXPECT_NE(read(path("s.svg")).find("law published"), std::string::npos);
  // Points taken over from the file are in the line as well.
  const Ran again = metastable(with(rubber, {"--out", path("s.csv")}));
  EXPECT_EQ(again.out.substr(again.out.find('\n')), swept.out.substr(swept.out.find('\n')));
  ASSERT_EQ(metastable(with(rubber, {"--law", "published", "--out", path("n.csv")})).code, 0);
  EXPECT_EQ(read(path("n.csv")).find("rigid"), std::string::npos);
}

TEST_F(CommandLine, LaunchesAreSteadyWhereThePaperHasNone) {
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

  ASSERT_EQ(metastable(with({"sweep", "--law", "published", "--slope", "0.1,7,8", "--friction-sd", "0.02", "--out",
                             path("s.csv")},
                            quick))
                .code,
            0);
  EXPECT_NE(read(path("s.csv")).find("0.1,0.02,,,,,,,,,no_regime\n"), std::string::npos) << read(path("s.csv"));
  const Ran made = metastable({"simulate", "--slope", "8", "--legs", "0.1519", "--trials", "3", "--out", path("t")});
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_NE(read(path("t/experiment.toml")).find("initial_speed_rad_s = { mean = 4."), std::string::npos)
      << read(path("t/experiment.toml"));
}

TEST_F(CommandLine, SolveSaysTheValueOrThatItIsOutOfReach) {
  const std::vector<std::string> asked = with({"solve", "friction-mean", "--steps", "10", "--points", "5"}, quick);
  const Ran found = metastable(with(asked, {"--json", path("f.json")}));
  ASSERT_EQ(found.code, 0) << found.err;
  EXPECT_NE(found.out.find("friction-mean"), std::string::npos);
  EXPECT_NE(found.out.find("10 expected steps"), std::string::npos) << found.out;
  EXPECT_NE(found.out.find("The law is published, as none was named"), std::string::npos) << found.out;
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

TEST_F(CommandLine, InfiniteIsAWord) {
  const Ran json = metastable(with({"steps", "--law", "coulomb", "--json", "-"}, quick));
  ASSERT_EQ(json.code, 0) << json.err;
  EXPECT_EQ(nlohmann::json::parse(json.out).at("expected_steps").at("from_start"), "infinite");
  const Ran text = metastable(with({"steps", "--law", "coulomb"}, quick));
  EXPECT_NE(text.out.find("infinite: rest is unreachable"), std::string::npos);
}

TEST_F(CommandLine, ConfigFileAndOptionsGiveTheSameBytesAndOptionsWin) {
  const std::string config = file("c.toml",
                                  "slope = 9.59\nlegs = 0.1519\nfriction = [0.3, 0.1]\ncells = 32\nsamples = 256\n"
                                  "initial-speed = [5.83, 0.28]\n");
  const Ran by_file = metastable({"steps", "--config", config});
  const Ran by_options = metastable(with({"steps", "--slope", "9.59", "--friction", "0.3,0.1"}, quick));
  ASSERT_EQ(by_file.code, 0) << by_file.err;
  EXPECT_EQ(by_file.out, by_options.out);
  const Ran overridden = metastable({"steps", "--config", config, "--friction", "0.4,0.1"});
  EXPECT_NE(overridden.out, by_file.out);
  EXPECT_NE(overridden.out.find("mu ~ N(0.4, 0.1^2)"), std::string::npos);
}

TEST_F(CommandLine, ComparePrintsTheContrast) {
  const Ran ran = metastable(with({"compare", "--json", path("c.json")}, quick));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("9.59 deg takes"), std::string::npos);
  EXPECT_NE(ran.out.find("measured trials of 16 collisions"), std::string::npos);
  const auto json = nlohmann::json::parse(read(path("c.json")));
  EXPECT_EQ(json.at("settings").size(), 2u);
  EXPECT_TRUE(json.at("contrasts")[0].at("ratio").at("value").is_number());
}

// Every parameter that steps takes can be what differs; the first values together are the reference.
TEST_F(CommandLine, CompareTakesSeveralValuesOfAnyParameter) {
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

TEST_F(CommandLine, SweepCutShortIsTakenUpAgainToTheSameBytes) {
  const std::vector<std::string> words =
      with({"sweep", "--friction-sd", "0.1:0.2:0.05", "--friction-mean", "0.3,0.4"}, quick);
  ASSERT_EQ(metastable(with(words, {"--out", path("whole.csv")})).code, 0);
  const std::string whole = read(path("whole.csv"));
  EXPECT_TRUE(std::filesystem::exists(path("whole.svg")));
  // It is cut in the middle of the fourth row.
  std::size_t at = 0;
  for (int line = 0; line < 9; ++line) at = whole.find('\n', at) + 1;
  std::ofstream(path("part.csv.partial")) << whole.substr(0, at + 5);
  const Ran resumed = metastable(with(words, {"--out", path("part.csv"), "--threads", "1"}));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.out.find("taken over"), std::string::npos);
  EXPECT_EQ(read(path("part.csv")), whole);
  EXPECT_FALSE(std::filesystem::exists(path("part.csv.partial")));
  // Nor does one over other contacts of as many pairs.
  const auto by_list = [&](const std::string& pairs) {
    return metastable(with({"sweep", "--slope", "7:8:0.5", "--initial-speed", "7,0.2", "--out", path("list.csv"),
                            "--contact-list", file("pairs.csv", "restitution,friction\n" + pairs)},
                           quick))
        .code;
  };
  EXPECT_EQ(by_list("0.4,0.4\n0.5,0.3\n"), 0);
  EXPECT_EQ(by_list("0.4,0.4\n0.5,0.6\n"), 2);
  // Another sweep does not write over it.
  const Ran other = metastable(with({"sweep", "--friction-sd", "0.1,0.3"}, with(quick, {"--out", path("part.csv")})));
  EXPECT_EQ(other.code, 2);
  EXPECT_NE(other.err.find("another sweep"), std::string::npos);
  EXPECT_EQ(read(path("part.csv")), whole);
}

TEST_F(CommandLine, SweepCutShortByASignalSaysWhatItKept) {
  const std::vector<std::string> words = with(
      {"sweep", "--friction-sd", "0.1,0.2", "--friction-mean", "0.3,0.4", "--out", path("s.csv"), "--threads", "1"},
      quick);
  ASSERT_EQ(metastable(words).code, 0);
  const std::string whole = read(path("s.csv"));
  std::filesystem::remove(path("s.csv"));
  std::size_t at = 0;
  for (int line = 0; line < 8; ++line) at = whole.find('\n', at) + 1;
  std::ofstream(path("s.csv.partial")) << whole.substr(0, at);
  catch_interrupts();
  std::raise(SIGINT);
  const Ran cut = metastable(words);
  clear_interrupt();
  EXPECT_EQ(cut.code, 130);
  EXPECT_EQ(cut.err, "metastable: interrupted: 3 of 4 points kept; the same command goes on\n");
  EXPECT_EQ(metastable(words).code, 0);
  EXPECT_EQ(read(path("s.csv")), whole);
  // The head states no value that the axes replace.
  const std::string head = whole.substr(0, whole.find('\n'));
  EXPECT_NE(head.find("mu ~ N(varies, varies^2)"), std::string::npos) << head;
  EXPECT_NE(head.find("7.02 deg"), std::string::npos) << head;
  EXPECT_EQ(whole.find("N(0.4, 0.1^2), omega"), std::string::npos) << whole;
}

TEST_F(CommandLine, StepsExplainsItsWords) {
  const Ran brief = metastable(with({"steps"}, quick)), full = metastable(with({"steps", "--explain"}, quick));
  ASSERT_EQ(brief.code, 0) << brief.err;
  for (const char* word : {"\n  step: ", "\n  failure: ", "\n  metastable regime: ", "\n  worst start: ",
                           "\n  foot lifts: ", "--explain says more"})
    EXPECT_NE(brief.out.find(word), std::string::npos) << word << brief.out;
  EXPECT_EQ(brief.out.find("quasi-stationary distribution"), std::string::npos);
  EXPECT_NE(full.out.find("quasi-stationary distribution"), std::string::npos) << full.out;
  EXPECT_GT(full.out.size(), brief.out.size());
  // Where nothing fails there is no regime that ends.
  const Ran endless = metastable(with({"steps", "--law", "coulomb"}, quick));
  EXPECT_EQ(endless.out.find("metastable regime: "), std::string::npos) << endless.out;
}

TEST_F(CommandLine, VerifySaysOnceWhoseFailureNegativeTimesAre) {
  const Ran ran = metastable({"verify", "--nodes", "128"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto count = [&](const std::string& part) {
    int found = 0;
    for (std::size_t at = ran.out.find(part); at != std::string::npos; at = ran.out.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("negative time"), 1) << ran.out;
  EXPECT_LT(ran.out.find("negative time"), ran.out.find("The rough-terrain wheel")) << ran.out;
  EXPECT_EQ(count("version: "), 1) << ran.out;
  EXPECT_EQ(count("seed: "), 1) << ran.out;
}

TEST_F(CommandLine, SimulateWritesAnExperimentOnce) {
  const std::vector<std::string> words{"simulate", "--trials", "5", "--out", path("trials")};
  const Ran ran = metastable(words);
  ASSERT_EQ(ran.code, 0) << ran.err;
  for (const char* name : {"experiment.toml", "collisions.csv", "trials.csv"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "trials" / name)) << name;
  const Ran again = metastable(words);
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("already holds"), std::string::npos);
}

// What it understands gives the same trials on one thread and on two.
TEST_F(CommandLine, RealityLeavesNothingBehindWhenItIsMisunderstood) {
  const auto refused = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "simulate");
    words.insert(words.end(), {"--out", path("lab")});
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 2);
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1);
    return ran.err;
  };
  EXPECT_EQ(refused({"--effect", "bounce"}), "metastable: --effect: needs --reality\n");
  EXPECT_EQ(refused({"--reality", "--effect", "inertia:ratio=9"}),
            "metastable: effect inertia: ratio: 9 is outside [0.5, 2]\n");
  EXPECT_EQ(refused({"--reality", "--outside", "planks"}),
            "metastable: --outside: 'planks' is not of the form ID:SIZE\n");
  EXPECT_EQ(refused({"--reality", "--outside", "planks:7"}), "metastable: effect planks: size 7 is outside [0, 0.9]\n");
  EXPECT_TRUE(left_behind().empty());
  const std::vector<std::string> fine{"simulate",          "--reality", "--effect",
                                      "inertia:ratio=1.1", "--effect",  "leg_contact:leg=3,friction_ratio=1.4",
                                      "--trials",          "3",         "--out"};
  std::vector<std::string> one = fine, two = fine;
  one.push_back(path("one")), two.push_back(path("two"));
  two.insert(two.end(), {"--threads", "2"});
  EXPECT_EQ(metastable(one).code, 0);
  EXPECT_EQ(metastable(two).code, 0);
  EXPECT_EQ(read(folder_ / "one" / "collisions.csv"), read(folder_ / "two" / "collisions.csv"));
}

TEST_F(CommandLine, CoastDownTakesTheNominalLossOfAnotherFolder) {
  std::string log;
  double time = 0, square = 900;
  for (int k = 0; k < 700; ++k) {
    log += std::to_string(static_cast<long>(time * 1e6)) + ",1," + std::to_string(k) + ",1," + std::to_string(k) + "\n";
    time += 6.283185307 / std::sqrt(square);
    square -= 0.2 + 0.002 * square;
  }
  const std::string free = file("free.csv", log);
  EXPECT_EQ(metastable({"coast-down", free, "--out", path("a")}).code, 0);
  EXPECT_EQ(metastable({"coast-down", free, "--nominal", path("a"), "--out", path("b")}).code, 0);
  const std::string a = read(folder_ / "a" / "experiment.toml"), b = read(folder_ / "b" / "experiment.toml");
  EXPECT_EQ(a.substr(a.find("[loss]")), b.substr(b.find("[loss]")));
  EXPECT_EQ(metastable({"coast-down", free, free, "--out", path("c")}).err,
            "metastable: " + free + ": a log named so was there before\n");
  EXPECT_EQ(metastable({"coast-down", path("none.csv"), "--out", path("c")}).err,
            "metastable: " + path("none.csv") + ": cannot be read: No such file or directory\n");
  EXPECT_FALSE(std::filesystem::exists(path("c")));
  EXPECT_EQ(metastable({"blind", "shut", path("run")}).err,
            "metastable: ACTION: 'shut' is none of make, answer, open\n");
}

// The whole report, made on one thread and on two, has the same bytes in every file.
TEST_F(CommandLine, ReportIsTheSameBytesOnAnyNumberOfThreads) {
  const auto report = [&](const std::string& name, const std::string& threads) {
    return metastable(with({"report", "--out", path(name), "--threads", threads, "--slopes", "9.59", "--energy-trials",
                            "20", "--landings", "3000"},
                           quick));
  };
  const Ran one = report("one", "1"), two = report("two", "2");
  ASSERT_EQ(one.code, 0) << one.err;
  ASSERT_EQ(two.code, 0) << two.err;
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "one")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const auto relative = std::filesystem::relative(entry.path(), folder_ / "one");
    EXPECT_EQ(read(entry.path()), read(folder_ / "two" / relative)) << relative;
  }
  const std::string page = read(folder_ / "one" / "index.html");
  // The answer comes first, the long table last and folded; every figure and table names a law.
  EXPECT_LT(page.find("under the law of rigid bodies (settled)"), page.find("<section"));
  EXPECT_LT(page.find("figure-survival"), page.find("<details>"));
  EXPECT_LT(page.rfind("<details>", page.find("table-ramps")), page.find("table-ramps"));
  const std::regex told(R"(<title>([^<]*)</title>\n<desc>|<figcaption>([^<]*)</figcaption>)");
  std::size_t titles = 0;
  for (std::sregex_iterator match(page.begin(), page.end(), told), end; match != end; ++match, ++titles)
    EXPECT_TRUE(std::regex_search(match->str(), std::regex("settled|published|law"))) << match->str();
  EXPECT_GT(titles, 20u);
  const std::string csv = read(folder_ / "one" / "tables" / "ramps.csv");
  for (const char* part : {"# seed: 1", "# version: ", "# settings: ", "infinite"})
    EXPECT_NE(csv.find(part), std::string::npos) << part;
}

TEST_F(CommandLine, InterruptLeavesNoFileAndItsOwnExitCode) {
  catch_interrupts();
  std::raise(SIGINT);  // as if Ctrl-C came before the first result
  const Ran ran = metastable(with({"steps", "--json", path("x.json")}, quick));
  clear_interrupt();
  EXPECT_EQ(ran.code, 130);
  EXPECT_TRUE(left_behind().empty());
}

TEST_F(CommandLine, HelpAndVersion) {
  EXPECT_EQ(metastable({"--help"}).code, 0);
  const Ran version = metastable({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_TRUE(std::regex_match(
      version.out,
      std::regex("metastable 0\\.2\\.0(\\+g[0-9a-f]+(-dirty)?)?\nbuilt by \\w+ \\d+[.\\d]* .*\nwith .*\n")))
      << version.out;
  for (const char* library : {"Boost 1.", "CLI11 ", "Eigen 3.", "KLU 1.", "OpenSSL ", "Spectra 1.", "fmt ", "toml++ "})
    EXPECT_NE(version.out.find(library), std::string::npos) << library;
  for (const char* command : {"steps", "compare", "sweep", "simulate", "report"}) {
    const Ran help = metastable({command, "--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("--config"), std::string::npos) << command;
  }
}

TEST_F(CommandLine, SensitivitiesAndStandardErrorsComeOutRanked) {
  const Ran ran = metastable({"steps", "--legs", "0.1519", "--cells", "32", "--samples", "256", "--sensitivities",
                              "--friction-se", "0.01,0.004", "--slope-se", "0.1", "--json", "-"});
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

  const Ran compared = metastable(
      {"compare", "--legs", "0.1519", "--cells", "32", "--samples", "256", "--slope-se", "0.1", "--json", "-"});
  ASSERT_EQ(compared.code, 0) << compared.err;
  const auto both = nlohmann::json::parse(compared.out);
  EXPECT_TRUE(both["settings"][1].contains("from_standard_errors"));
  EXPECT_LT(both["contrasts"][0]["ratio_from_standard_errors"]["interval_95"][0],
            both["contrasts"][0]["ratio"]["value"]);
}

TEST_F(CommandLine, StandardErrorsOfWhatDoesNotMatterAreRefused) {
  const Ran ran = metastable({"steps", "--radius-of-gyration-se", "0.01"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_NE(ran.err.find("radius-of-gyration: a standard error was given"), std::string::npos) << ran.err;
  EXPECT_EQ(metastable({"steps", "--slope-se", "-1"}).code, 2);
}

TEST_F(CommandLine, DiagnoseNamesTheKnownEffects) {
  const Ran ran = metastable({"diagnose", path("none"), "--catalogue", "lag_contact"});
  EXPECT_EQ(ran.code, 2);
  for (const char* part : {"'lag_contact'", "leg_contact", "slip_reversal"})
    EXPECT_NE(ran.err.find(part), std::string::npos) << part << "\n" << ran.err;
}

// A small experiment with a leg that grips more gives the same bytes on any number of threads, in every form.
TEST_F(CommandLine, DiagnoseFindsWhatTheLaboratoryPutIn) {
  ASSERT_EQ(metastable({"simulate", "--reality", "--slope", "9.59", "--friction", "0.352,0.043", "--restitution",
                        "0.54,0.045", "--trials", "40", "--effect", "leg_contact:leg=3,friction_ratio=0.8",
                        "--sensor-noise", "0.01", "--no-flight", "--out", path("wheel")})
                .code,
            0);
  const Ran one = metastable({"diagnose", path("wheel"), "--catalogue", "leg_contact,slope_offset", "--threads", "1",
                              "--json", path("one.json"), "--out", path("page")});
  ASSERT_EQ(one.code, 0) << one.err;
  const auto json = nlohmann::json::parse(read(path("one.json")));
  EXPECT_EQ(json.at("verdict"), "explained");
  EXPECT_EQ(json.at("cause_set"), std::vector<std::string>{"leg_contact"});
  EXPECT_EQ(json.at("causes").at(0).at("parameters").at("leg"), 3);
  const auto interval = json.at("causes").at(0).at("interval_90").at("friction_ratio");
  EXPECT_LT(interval.at(0), 0.8);
  EXPECT_GT(interval.at(1), 0.8);
  EXPECT_TRUE(std::filesystem::exists(path("page/index.html")));
  EXPECT_EQ(one.out.find("verdict: explained"), 0U);

  const Ran two = metastable({"diagnose", path("wheel"), "--catalogue",
                              file("ids.txt", "leg_contact # a leg\nslope_offset\n"), "--threads", "2", "--json", "-"});
  ASSERT_EQ(two.code, 0) << two.err;
  auto again = nlohmann::json::parse(two.out), first = json;
  again.erase("provenance"), first.erase("provenance");
  EXPECT_EQ(again, first);
}

// The second system is a drum that loses a tenth more than stated.
TEST_F(CommandLine, DiagnoseTakesACoastDown) {
  std::string rows = "trial,collision,time_s,omega_minus_rad_s\n";
  double x = 10000, time = 0, noise = 0.5;
  for (int k = 0; k < 1500; ++k) {
    const double omega = std::sqrt(x);
    rows += fmt::format("{},{},{:.6f},{:.9g}\n", 1 + k / 50, 1 + k % 50, time, omega);
    time += 2 * 3.141592653589793 / omega;
    noise = 3.99 * noise * (1 - noise);  // in (0, 1), mean about a half
    x -= 0.6 + 0.00165 * x + 0.4 * (noise - 0.5);
  }
  std::filesystem::create_directories(path("drum"));
  std::ofstream(path("drum/collisions.csv")) << rows;
  std::ofstream(path("drum/experiment.toml"))
      << "system = \"coast_down\"\ntitle = \"Drum\"\n[rotor]\ninertia_kg_m2 = 1.0\n[loss]\nconstant = 0.15\n"
         "linear = 0.0\nquadratic = 0.00165\nnoise_sd = 0.14\n[[condition]]\nid = \"drum\"\n";
  const Ran ran = metastable({"diagnose", path("drum"), "--json", "-"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_NE(json.at("verdict"), "no_gap");
  EXPECT_LT(json.at("gap").at("p_value_as_given"), 1e-6);
}

TEST_F(CommandLine, EffectsListsTheCatalogue) {
  const Ran ran = metastable({"effects", "--json", path("effects.json")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("leg_contact: one leg has another friction or restitution\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("0.1 to 5, none at 1"), std::string::npos) << ran.out;
  EXPECT_EQ(nlohmann::json::parse(read(path("effects.json"))).at("schema"), 1);
}

}  // namespace
}  // namespace metastable::reports
