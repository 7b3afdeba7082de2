// What `metastable diagnose` finds in small experiments, and what it refuses.

#include "reports/experiment_commands/diagnose_command.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using DiagnoseCommand = CommandLine;

// A small experiment with a leg that grips more gives the same bytes on any number of threads, in every form.
TEST_F(DiagnoseCommand, FindsWhatTheLaboratoryPutIn) {
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

// Another place has expected steps, and is refused where no wheel of these legs could roll.
TEST_F(DiagnoseCommand, SaysTheStepsOfAnotherPlace) {
  ASSERT_EQ(
      metastable({"simulate", "--slope", "9.59", "--law", "published", "--trials", "40", "--out", path("wheel")}).code,
      0);
  const auto asked = [&](std::vector<std::string> place) {
    return metastable(
        with({"diagnose", path("wheel"), "--catalogue", "slope_offset", "--json", "-"}, std::move(place)));
  };
  const Ran ran = asked({"--at-slope", "8", "--at-speed", "5"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto machine = nlohmann::json::parse(ran.out).at("steps_before_failure").at("machine");
  ASSERT_EQ(machine.size(), 2U);
  EXPECT_EQ(machine[0].at("where"), "as measured");
  EXPECT_EQ(machine[1].at("where"), "on a slope of 8 deg and with launches at 5 rad/s");
  EXPECT_LT(machine[1].at("interval_90")[0], machine[1].at("interval_90")[1]);
  EXPECT_NE(asked({"--at-slope", "30"}).err.find("metastable: --at-slope: 30 is outside [0.001, 22.5) deg\n"),
            std::string::npos)
      << asked({"--at-slope", "30"}).err;
  EXPECT_NE(asked({"--at-speed", "0"}).err.find("metastable: --at-speed: 0 is outside (0, 1000] rad/s\n"),
            std::string::npos)
      << asked({"--at-speed", "0"}).err;
  EXPECT_EQ(asked({"--at-speed", "0"}).code, 2);
}

// The second system is a drum that loses a tenth more than stated.
TEST_F(DiagnoseCommand, TakesACoastDown) {
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
  const Ran wheels = metastable({"diagnose", path("drum"), "--catalogue", "leg_contact"});
  EXPECT_EQ(wheels.code, 2);
  EXPECT_NE(wheels.err.find("catalogue: 'leg_contact' is none of axle_drag_viscous, rolling_resistance"),
            std::string::npos)
      << wheels.err;
  const Ran ran = metastable({"diagnose", path("drum"), "--json", "-"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  const auto json = nlohmann::json::parse(ran.out);
  EXPECT_NE(json.at("verdict"), "no_gap");
  EXPECT_LT(json.at("gap").at("p_value_as_given"), 1e-6);
}

TEST_F(DiagnoseCommand, NamesTheKnownEffects) {
  const Ran ran = metastable({"diagnose", path("none"), "--catalogue", "lag_contact"});
  EXPECT_EQ(ran.code, 2);
  for (const char* part : {"'lag_contact'", "leg_contact", "slip_reversal"})
    EXPECT_NE(ran.err.find(part), std::string::npos) << part << "\n" << ran.err;
}

// A folder that is broken is no wheel's, of whose effects a catalogue could be.
TEST_F(DiagnoseCommand, ABrokenFolderIsSaidBeforeItsCatalogue) {
  std::filesystem::create_directories(path("walks"));
  std::ofstream(path("walks/experiment.toml")) << "system = \"machine\"\n[machine\nmodel = \"compass\"\n";
  std::ofstream(path("walks/steps.csv")) << "trial,step,half_angle_rad\n1,1,0.27\n";
  const Ran all = metastable({"diagnose", path("walks")});
  const Ran some = metastable({"diagnose", path("walks"), "--catalogue", "impact_loss"});
  EXPECT_EQ(some.code, 2);
  EXPECT_EQ(some.err, all.err);
  EXPECT_NE(some.err.find("experiment.toml:2:"), std::string::npos) << some.err;
}

// The diagnosis leaves out an effect that the contact law cannot have, and lists it with the reason. It refuses a
// catalogue of which no effect is left.
TEST_F(DiagnoseCommand, SaysWhichEffectsTheModelCannotHave) {
  ASSERT_EQ(
      metastable({"simulate", "--slope", "9.59", "--law", "published", "--trials", "20", "--out", path("wheel")}).code,
      0);
  const Ran some = metastable({"diagnose", path("wheel"), "--catalogue", "soft_contact,slope_offset", "--json", "-"});
  ASSERT_EQ(some.code, 0) << some.err;
  const auto untold = nlohmann::json::parse(some.out).at("not_possible");
  EXPECT_TRUE(std::ranges::any_of(untold, [](const auto& one) {
    return one.at("statement") == "whether soft_contact is at work";
  })) << untold;
  const Ran none = metastable({"diagnose", path("wheel"), "--catalogue", "soft_contact"});
  EXPECT_EQ(none.code, 2);
  EXPECT_EQ(none.err,
            "metastable: --catalogue: these data under this law can show none of soft_contact; soft_contact: no impact "
            "lasts but under `settled`\n");
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(DiagnoseCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"diagnose"}, "DIR"},
      {{"diagnose", path("none"), "--catalogue", "leg_contact,lag_contact"}, "--catalogue: "},
      {{"diagnose", path("none"), "--catalogue", file("ids.csv", "leg_contact\n# more\nlag_contact\n")}, "ids.csv:3: "},
  });
}

}  // namespace
}  // namespace metastable::reports::test
