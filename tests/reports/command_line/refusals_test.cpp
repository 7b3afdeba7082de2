// What no wheel can have, and options that would do nothing, give exit code 2 and one line that says why.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {

class Refusals : public CommandLine {
 protected:
  // Each names the whole line.
  void expect_refused(std::vector<Refused> all) const {
    for (Refused& one : all) one.named = "metastable: " + one.named + "\n";
    CommandLine::expect_refused(all);
  }
};

TEST_F(Refusals, OfWheelsThatSettledDoesNotHold) {
  const auto steps = [](std::vector<std::string> more) {
    more.insert(more.begin(), {"steps", "--law", "settled"});
    return more;
  };
  expect_refused({
      {steps({"--radius-of-gyration", "0"}),
       "--radius-of-gyration: 0 m is outside (0, 0.4557] m (3 mean legs; law settled)"},
      {steps({"--radius-of-gyration", "-1"}), "--radius-of-gyration: -1 is outside [0, 1000]"},
      {steps({"--tip-radius", "0.01"}),
       "tip_radius: 0.01 m is outside [0, 0.00754] m (a twentieth of the shortest leg)"},
      {steps({"--tip-radius", "-0.001"}), "--tip-radius: -0.001 is outside [0, 5]"},
      {steps({"--restitution", "0.97,0.01"}), "restitution: mean 0.97 is outside [0, 0.95], the range of law settled"},
      {steps({"--restitution", "0.96"}), "restitution: mean: the constant 0.96 is outside [0, 0.95]"},
      {steps({"--contact-list", file("pairs.csv", "restitution,friction\n0.4,0.4\n0.96,0.3\n")}),
       "pairs[1]: restitution 0.96 is outside [0, 0.95], the range of law settled"},
      {{"steps", "--direct"}, "--direct: has a meaning under --law settled only"},
  });
}

// Folders of walks show only once they are read which effects there are.
TEST_F(Refusals, NameTheOptionWhoseValueTheDiagnosisDoesNotKnow) {
  const std::string walks = path("walks");
  ASSERT_EQ(metastable({"simulate", "--walker", "simplest", "--slope-sd", "0.05", "--trials", "2", "--collisions", "4",
                        "--out", walks})
                .code,
            0);
  const Ran ran = metastable({"diagnose", walks, "--catalogue", "hip_dampng"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err.find("metastable: --catalogue: 'hip_dampng' is none of "), 0u) << ran.err;
}

TEST_F(Refusals, OfOptionsThatDoNothing) {
  expect_refused({
      {{"steps", "--leg-count", "12"}, "--leg-count: has a meaning where --legs is one length; it is 'paper'"},
      {{"steps", "--leg-count", "4", "--legs", "0.15,0.15,0.15,0.15"},
       "--leg-count: has a meaning where --legs is one length; it is '0.15,0.15,0.15,0.15'"},
      {{"steps", "--radius-of-gyration", "0.05"},
       "--radius-of-gyration: has a meaning under --law coulomb, plastic, settled only"},
      {{"steps", "--law", "coulomb", "--ramp-stiffness", "9000"},
       "--ramp-stiffness: has a meaning under --law published only"},
      {{"steps", "--law", "plastic", "--contact-mass", "1"},
       "--contact-mass: has a meaning under --law published only"},
      {{"steps", "--law", "plastic", "--friction", "0.3,0.1"},
       "--friction: has a meaning under --law published, coulomb, settled only"},
      {{"steps", "--law", "plastic", "--restitution", "0.3,0.1"},
       "--restitution: has a meaning under --law published, coulomb, settled only"},
      {{"sweep", "--law", "plastic", "--friction-sd", "0.1,0.2", "--out", path("s.csv")},
       "--friction-sd: has no meaning under --law plastic"},
      {{"steps", "--method", "integrated", "--samples", "256"}, "--samples: has a meaning under --method sampled only"},
      {{"steps", "--draws", "plain", "--tail", "1e-9"}, "--tail: plain draws have none; --draws weighted reaches it"},
      {{"steps", "--friction", "0.4", "--restitution", "0.4", "--correlation", "0.5"},
       "--correlation: has a meaning where --restitution and --friction both have an sd"},
      {{"sweep", "--slope", "7,8", "--initial-speed", "7,0.2", "--out", "-"},
       "--out: a sweep keeps its points in a file as they come; --json - prints them"},
      {{"simulate", "--ramp-length", "inf", "--out", path("endless")},
       "--ramp-length: inf: the ramp of an experiment ends; up to 100000 m do"},
      {{"simulate", "--reality", "--ramp-length", "inf", "--out", path("endless")},
       "--ramp-length: inf: the ramp of an experiment ends; up to 100000 m do"},
      {{"steps", "--json", ""}, "--json: what is given is empty"},
      {{"effects", "--json", ""}, "--json: what is given is empty"},
      {{"diagnose", ""}, "DIR: what is given is empty"},
      {{"steps", "--config", file("a.toml", "leg-count = 12\n")},
       path("a.toml") + ":1: --leg-count: has a meaning where --legs is one length; it is 'paper'"},
      {{"steps", "--config", file("b.toml", "law = \"coulomb\"\ncontact-mass = 2\n")},
       path("b.toml") + ":2: --contact-mass: has a meaning under --law published only"},
  });
  EXPECT_EQ(metastable({"steps", "--config", ""}).code, 2);
}

TEST_F(Refusals, OfNumbersTellTheRangeWhereverTheyStand) {
  const std::string pairs = file("low.csv", "restitution,friction\n0.4,0.4\n0.4,30\n"),
                    words = file("words.csv", "restitution,friction\nhigh,0.4\n");
  expect_refused({
      {{"steps", "--samples", "3"}, "--samples: 3 is outside 16..16777216"},
      {{"steps", "--samples", "3.5"}, "--samples: '3.5' is not a whole number in 16..16777216"},
      {{"steps", "--threads=-1"}, "--threads: -1 is outside 0..1024"},
      {{"steps", "--config", file("s.toml", "slope = 5\nsamples = 3\n")},
       path("s.toml") + ":2: --samples: 3 is outside 16..16777216"},
      {{"steps", "--config", file("t.toml", "samples = \"many\"\n")},
       path("t.toml") + ":1: --samples: 'many' is not a whole number in 16..16777216"},
      {{"steps", "--contact-list", pairs}, pairs + ":3: column friction: 30 is outside [0, 10]"},
      {{"steps", "--contact-list", words}, words + ":2: column restitution: 'high' is not a number"},
      {{"steps", "--slope-se", "-1"}, "--slope-se: -1 is outside [0, inf)"},
      {{"steps", "--friction-se", "-0.1,0"}, "--friction-se: mean -0.1 is outside [0, inf)"},
      {{"steps", "--slope", "inf"}, "--slope: 'inf' is not a finite number"},
  });
}

// The name of an option that follows one without its value is no file, no number and no word.
TEST_F(Refusals, OfAnOptionWhereAValueIsMissing) {
  const auto missing = [](const std::string& option, const std::string& value, const std::string& taken,
                          const std::string& command = "steps") {
    return option + ": " + value + " is missing: '" + taken + "' is an option; see 'metastable " + command + " --help'";
  };
  expect_refused({
      {{"steps", "--json", "--how-it-fails"}, missing("--json", "FILE|-", "--how-it-fails")},
      {{"steps", "--json", "--seed=3"}, missing("--json", "FILE|-", "--seed=3")},
      {{"steps", "--json", "-h"}, missing("--json", "FILE|-", "-h")},
      {{"steps", "--friction", "--law", "settled"}, missing("--friction", "MEAN,SD", "--law")},
      {{"steps", "--config", "--json"}, missing("--config", "FILE", "--json")},
      {{"describe", "--out", "--json", path("x"), path("y")}, missing("--out", "DIR", "--json", "describe")},
  });
  EXPECT_EQ(metastable({"steps", "--correlation", "-2"}).err, "metastable: --correlation: -2 is outside (-1, 1)\n");
}

TEST_F(Refusals, OfWhatNoWheelCanHave) {
  expect_refused({
      {{"steps", "--mass", "1e250"}, "--mass: 1e+250 is outside [1e-06, 1e+06]"},
      {{"steps", "--initial-speed", "1e200,1"}, "--initial-speed: mean 1e+200 is outside [0, 1000]"},
      {{"steps", "--initial-speed", "5,2000"}, "--initial-speed: sd 2000 is outside [0, 1000]"},
      {{"compare", "--initial-speed", "5,1", "--initial-speed", "1e9,1"},
       "--initial-speed: mean 1000000000 is outside [0, 1000]"},
      {{"steps", "--legs", "1000"}, "--legs: 1000 is outside [0.001, 100]"},
      {{"steps", "--legs", "0.15,0.15,0"}, "--legs: 0 is outside [0.001, 100]"},
      {{"steps", "--ramp-length", "1e9"}, "--ramp-length: 1000000000 is outside [0.001, 100000]"},
      {{"steps", "--ramp-stiffness", "0"}, "--ramp-stiffness: 0 is outside [1, 1e+12]"},
      {{"steps", "--gravity", "1e5"}, "--gravity: 100000 is outside [0.001, 1000]"},
      {{"steps", "--slope", "1e-9", "--initial-speed", "5,1"},
       "--slope: 1e-09 deg is outside [0.001, 22.5) deg (below half the angle between legs)"},
      {{"steps", "--restitution", "1.2,0.1"}, "--restitution: mean 1.2 is outside [0, 1]"},
      {{"sweep", "--friction-mean", "0:20:1", "--out", path("s.csv")}, "--friction-mean: 20 is outside [0, 10]"},
      {{"sweep", "--slope", "5,6", "--initial-speed", "1e5", "--out", path("s.csv")},
       "--initial-speed: mean 100000 is outside [0, 1000]"},
      {{"steps", "--config", file("c.toml", "slope = 5\nmass = 1e250\n")},
       path("c.toml") + ":2: --mass: 1e+250 is outside [1e-06, 1e+06]"},
      // It is the inertia about the hub, where that about the foot is asked for.
      {{"steps", "--inertia", "0.0035"},
       "--inertia: 0.0035 kg m^2 is below M (mean L)^2 = 0.03207 kg m^2, the least about the stance foot; if it is the "
       "inertia about the hub, 0.03557 kg m^2 is meant"},
      {{"steps", "--inertia", "1e6"},
       "--inertia: 1000000 kg m^2 is above 0.3207 kg m^2, where the radius of gyration is 3 mean legs"},
      {{"steps", "--law", "coulomb", "--radius-of-gyration", "2"},
       "--radius-of-gyration: 2 m is outside [0, 0.4557] m (3 mean legs)"},
  });
}

// A decimal comma makes two numbers of one.
TEST_F(Refusals, OfADecimalCommaHintsAtThePoint) {
  const std::string hint = "decimals take a point, so that 0.4 is a constant and 0.4,0.1 has sd 0.1";
  expect_refused({{{"steps", "--friction", "0,4"}, "--friction: '0,4' is mean 0 and sd 4; " + hint},
                  {{"steps", "--restitution", "0,4"}, "--restitution: '0,4' is mean 0 and sd 4; " + hint}});
}

TEST_F(Refusals, OfWrongWordsHintAtTheNearest) {
  const std::string laws = "is none of published, coulomb, plastic, settled";
  expect_refused({
      {{"steps", "--law", "plastik"}, "--law: 'plastik' " + laws + "; did you mean 'plastic'?"},
      {{"steps", "--law", "newton"}, "--law: 'newton' " + laws},
      {{"steps", "--config", file("law.toml", "law = \"colomb\"\n")},
       path("law.toml") + ":1: --law: 'colomb' " + laws + "; did you mean 'coulomb'?"},
      {{"steps", "--config", file("key.toml", "slope = 5\nfrictoin = 0.3\n")},
       path("key.toml") + ":2: unknown key 'frictoin' (keys are the long options of 'metastable steps'); did you mean "
                          "'friction'?"},
      {{"steps", "--method", "integrate"},
       "--method: 'integrate' is none of sampled, integrated, mesh, splitting, auto; did you mean 'integrated'?"},
      {{"steps", "--sequence", "sobel"}, "--sequence: 'sobel' is none of sobol, random; did you mean 'sobol'?"},
      {{"steps", "--walker", "compass", "--slope-sd", "1", "--method", "sampled"},
       "--method: 'sampled' is none of mesh, splitting, auto, which walkers have"},
      {{"steps", "--walker", "compass", "--slope-sd", "1", "--method", "splitting", "--spacing", "1"},
       "--spacing: has no meaning under --method splitting"},
      {{"steps", "--walker", "compass", "--slope-sd", "1", "--method", "splitting", "--memory", "1"},
       "--memory: has no meaning under --method splitting without --level mesh"},
      {{"steps", "--walker", "compass", "--slope-sd", "1", "--tolerance", "0.1"},
       "--tolerance: has a meaning under --method splitting only"},
      {{"steps", "--walker", "compass", "--slope-sd", "1", "--level", "mesh"},
       "--level: has a meaning under --method splitting and auto only"},
      {{"steps", "--walker", "biped", "--slope-sd", "3", "--method", "splitting", "--level", "mesh"},
       "a mesh's level: the map has 9 dimensions, where meshes hold 1 to 4; a learnt level takes up to 30"},
      {{"steps", "--level", "mesh"}, "--level: has a meaning with --walker only"},
      {{"steps", "--method", "splitting"},
       "method: 'splitting' is neither 'sampled' nor 'integrated', which wheels have"},
      {{"steps", "--walker", "compas", "--slope-sd", "1"},
       "--walker: 'compas' is none of simplest, compass, biped; did you mean 'compass'?"},
      {{"blind", "opne", "run"}, "ACTION: 'opne' is none of make, answer, open; did you mean 'open'?"},
      {{"blind", "shut", "run"}, "ACTION: 'shut' is none of make, answer, open"},
      {{"completion", "fihs"}, "SHELL: 'fihs' is none of bash, zsh, fish; did you mean 'fish'?"},
      {{"describe", "trials", "--transition", "setp"},
       "--transition: 'setp' is none of auto, collision, step; did you mean 'step'?"},
      {{"describe", "trials", "--against", "coulomb,publisht"},
       "--against: 'publisht' " + laws + "; did you mean 'published'?"},
      {{"import", "a.csv", "--out", path("o"), "--columns", "omega_minsu=w[deg/s]"},
       "--columns: 'omega_minsu=w[deg/s]' is not WHAT=NAME or WHAT=NAME[UNIT], where WHAT is one of condition, trial, "
       "collision, leg, time, position, omega_minus, omega_plus, outcome, angle; did you mean 'omega_minus'?"},
  });
  const std::string effect =
      metastable({"simulate", "--reality", "--effect", "leg_contct:leg=3", "--out", path("t")}).err;
  EXPECT_TRUE(effect.ends_with("; did you mean 'leg_contact'?\n")) << effect;
}

// The help says what the messages say, from the same table.
TEST_F(Refusals, AreAnnouncedInTheHelp) {
  std::string help = metastable({"steps", "--help"}).out;
  help.erase(std::unique(help.begin(), help.end(),
                         [](char a, char b) {
                           return std::isspace(static_cast<unsigned char>(a)) &&
                                  std::isspace(static_cast<unsigned char>(b));
                         }),
             help.end());
  std::ranges::replace(help, '\n', ' ');
  for (const char* text :
       {"(default: the paper's at 7.02 and 9.59, elsewhere steady); in [0, 1000]", "landing order; in [0.001, 100]",
        "Hub mass M [kg]; in [1e-06, 1e+06]", "Ramp length [m], inf: without end; in [0.001, 100000]",
        "g [m/s^2]; in [0.001, 1000]", "K_r [N/m] (published); in [1, 1e+12]",
        "Ramp slope [deg], from 0.001 to below half the angle between legs", "expected steps, relative; in (0, 1)",
        "Draws per cell and replicate, 16..16777216"})
    EXPECT_NE(help.find(text), std::string::npos) << text << "\n" << help;
}

// The ends of the ranges are answers. The curve of survival does not grow with the ramp.
TEST_F(Refusals, DoNotReachTheEndsOfTheRanges) {
  const std::vector<std::string> coarse{"--cells", "32", "--samples", "256", "--replicates", "2", "--json"};
  int number = 0;
  for (std::vector<std::string> words :
       std::vector<std::vector<std::string>>{{"--ramp-length", "100000"},
                                             {"--ramp-length", "100000", "--law", "coulomb"},
                                             {"--mass", "1e6", "--ramp-stiffness", "1e12"},
                                             {"--mass", "1e-6", "--ramp-stiffness", "1"},
                                             {"--legs", "0.001", "--initial-speed", "1000,0"},
                                             {"--legs", "100", "--initial-speed", "0.3,0.01", "--ramp-length", "3000"},
                                             {"--inertia", "0.32"},
                                             {"--gravity", "0.001"},
                                             {"--gravity", "1000", "--initial-speed", "70,1"}}) {
    SCOPED_TRACE(fmt::format("{}", fmt::join(words, " ")));
    words.insert(words.begin(), "steps");
    words.insert(words.end(), coarse.begin(), coarse.end());
    words.push_back(path(fmt::format("{}.json", number++)));
    const Ran ran = metastable(words);
    EXPECT_EQ(ran.code, 0) << ran.err;
    if (ran.code != 0) continue;
    const auto json = nlohmann::json::parse(read(words.back()));
    const std::vector<double> survival = json["survival"];
    EXPECT_LE(survival.size(), 10000u);
    EXPECT_TRUE(std::ranges::is_sorted(survival, std::greater<>()));
  }
}

}  // namespace
}  // namespace metastable::reports::test
