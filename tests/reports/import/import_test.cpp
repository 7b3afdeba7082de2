// metastable import: what an experiment folder says, told in a CSV, comes back as the same experiment; what is missing
// or ambiguous is named.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "analysis/experiment/experiment.h"
#include "tests/reports/import/importing.h"

namespace metastable::reports::test {
namespace {

TEST_F(Import, TheFoldersOwnNamesNeedNoMap) {
  for (MeasuredTrial& trial : known_.trials) trial.outcome.reset();
  expect_same(import({path("known/collisions.csv")}));
}

TEST_F(Import, LongInOtherWordsAndUnits) {
  forget_course();
  const Words map{long_csv(),
                  "--separator",
                  ";",
                  "--collisions-from",
                  "0",
                  "--legs-from",
                  "1",
                  "--outcomes",
                  "rest=1,max_collisions=0",
                  "--columns",
                  "trial=run,condition=start,collision=k,leg=foot,omega_minus=w before [deg/s],"
                  "omega_plus=w_after[deg/s],outcome=stopped"};
  const Ran ran = import(map);
  expect_same(ran, 1e-15);
  EXPECT_NE(ran.out.find("  omega_minus  w before [deg/s] in deg/s\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("not used: remark\n"), std::string::npos) << ran.out;
  Words as_json = map;
  as_json.insert(as_json.end(), {"--json", "-"});
  const auto json = nlohmann::json::parse(import(as_json).out);
  EXPECT_EQ(json["conditions"][0]["trials"], 2);
  EXPECT_EQ(json["columns"]["omega_plus"]["unit"], "deg/s");
}

TEST_F(Import, WideWithARowATrial) {
  const std::string wide = file("wide.csv",
                                "no,kind,v1,w_1,w_2,w_3,v2,v3,t_1,t_2,t_3,x1_mm,x2_mm,x3_mm,leg1,leg2,leg3,end\n"
                                "1,fast,4.7311,5.81237,5.7001,5.6,4.61,4.5001,0,191.2,382.5,0,116.1,232.6,0,1,2,"
                                "max_collisions\n"
                                "2,\"slow, again\",NaN,4.43,,,,,0,,,0,,,3,,,rest\n"
                                "4,fast,4.8,5.91,3.2,,-0.25,,0,200,,0,116.2,,0,1,,rest\n");
  expect_same(import({wide, "--columns",
                      "trial=no,condition=kind,omega_minus=w_*[rad/s],omega_plus=v*[rad/s],time=t_*[ms],position=x*_mm,"
                      "leg=leg*,outcome=end"}),
              1e-15);
}

TEST_F(Import, NumbersNamesOfTrialsAndStatesTheWheelByOptions) {
  const std::string csv = file("named.csv",
                               "name,start,omega_deg_s\nmonday,fast,330\nmonday,fast,320\nmonday,slow,250\n"
                               "tuesday,fast,331\n");
  const Words columns{csv, "--columns", "trial=name,condition=start,omega_minus=omega_deg_s"};
  const auto with = [&](Words more) {
    more.insert(more.begin(), columns.begin(), columns.end());
    return more;
  };
  const Words wheel{"--legs", "paper", "--mass", "1.39", "--ramp-length", "3.66", "--law", "plastic"};
  const auto stated = [&](Words more) {
    more.insert(more.end(), wheel.begin(), wheel.end());
    return with(more);
  };
  const Ran ran = import(stated({"--slope", "9.59", "--number-trials", "--sensor-noise", "0.01"}));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("assumed: collisions are counted in the order of the rows\n"), std::string::npos);
  const Experiment read = analysis::read_experiment(folder_ / "out");
  ASSERT_EQ(read.trials.size(), 3u);
  EXPECT_EQ(read.trials[0].collisions.size(), 2u);
  EXPECT_EQ(read.conditions[read.trials[1].condition].id, "slow");
  EXPECT_EQ(read.sensor.noise_sd, 0.01);
  EXPECT_FALSE(read.conditions[0].first_leg_stated);
  EXPECT_NEAR(read.trials[2].collisions[0].omega_minus, 331 * std::numbers::pi / 180, 1e-12);

  expect_refused(import(stated({"--slope", "9.59"})),
                 csv +
                     ":2: trial: 'monday' is no whole number from 0; --number-trials numbers them in the order of "
                     "their first rows (in 3 rows)\nmetastable: " +
                     csv +
                     ":5: trial: 'tuesday' is no whole number from 0; --number-trials numbers them in the order "
                     "of their first rows");
  expect_refused(import(stated({"--conditions", "fast=9.59", "--number-trials"})),
                 csv + ":4: condition: unknown condition 'slow'; experiment.toml has: fast");
  expect_refused(import(with({"--slope", "9.59", "--law", "coulomb"})),
                 "import: data do not tell wheel, contact and ramp: --description FILE states them (an "
                 "experiment.toml), or these, of which some are missing: --legs, --mass, --ramp-length, --restitution, "
                 "--friction");
}

TEST_F(Import, RefusesRowsOfATrialThatAreApartAndUncounted) {
  const std::string apart =
      ": trial: '1' goes on behind rows of another trial, and no column tells in which order: put the rows of a trial "
      "together, or map the column that counts them";
  const std::string twice = file("twice.csv", "trial,w,condition\n1,5.1,fast\n1,4.9,fast\n2,5,fast\n1,5.1,fast\n");
  expect_refused(import({twice, "--columns", "omega_minus=w[rad/s]"}), twice + ":5" + apart);
  const std::string walks = file("walks.csv", "trial,a,r\n1,0.2,-1\n2,0.2,-1\n1,0.2,-1\n");
  expect_refused(import({walks, "--columns", "half_angle=a[rad],stance_rate=r[rad/s]", "--walker", "compass", "--slope",
                         "3", "--slope-sd", "0.3"}),
                 walks + ":4" + apart);
  const std::string nameless = file("nameless.csv", "run,w,condition\nA,5.1,fast\nNaN,5.1,fast\n");
  expect_refused(import({nameless, "--columns", "trial=run,omega_minus=w[rad/s]", "--number-trials"}),
                 nameless + ":3: trial: is not told");
}

TEST_F(Import, NamesWhatIsMissingOrAmbiguous) {
  const std::string csv = file("a.csv", "trial,w,w2,leg\n1,5.1,5,0\n1,4.9,5,2\n2,300,5,0\n2,x,5,1\n");
  const auto columns = [&](const std::string& map) { return import({csv, "--columns", map}); };
  expect_refused(import({csv}),
                 "--columns: which column of " + csv + " is omega_minus (or angle)? It has trial, w, w2, leg");
  expect_refused(
      columns("omega_minus=w"),
      "--columns: omega_minus: the unit of 'w' is not told; write omega_minus=w[rad/s] or [deg/s] or [rpm] or "
      "[rev/s]");
  expect_refused(columns("omega_minus=w[m]"),
                 "--columns: omega_minus: 'm' is none of the units rad/s, deg/s, rpm, rev/s");
  expect_refused(columns("speed=w[m]"),
                 "--columns: 'speed=w[m]' is not WHAT=NAME or WHAT=NAME[UNIT], where WHAT is one of condition, trial, "
                 "collision, leg, time, position, omega_minus, omega_plus, outcome, angle");
  expect_refused(columns("omega_minus=omega[rad/s]"),
                 "--columns: " + csv + " has no 'omega' for omega_minus (it has trial, w, w2, leg)");
  expect_refused(columns("omega_minus=w[rad/s],omega_plus=w[rad/s]"), "--columns: 'w' is taken twice");
  expect_refused(columns("omega_minus=w2[rad/s],omega_minus=w[rad/s]"), "--columns: omega_minus is given twice");
  expect_refused(columns("omega_minus=w[rad/s]"), csv + ":5:3: w: 'x' is not a finite number");
  const std::string bare = file("f.csv", "w\n5.1\n4.9\n"), no_condition = file("g.csv", "trial,w\n1,5.1\n1,4.9\n");
  expect_refused(import({bare, "--columns", "omega_minus=w[rad/s]"}), bare + ":2: trial: is not told");
  expect_refused(import({no_condition, "--columns", "omega_minus=w[rad/s]"}),
                 no_condition + ":2: trial: the column 'condition' is missing and experiment.toml has 2 conditions");
  const std::string jump = file("b.csv", "trial,w,leg,condition\n1,5.1,0,fast\n1,4.9,2,fast\n");
  expect_refused(import({jump, "--columns", "omega_minus=w[rad/s]"}),
                 jump + ":3: leg: leg 2 does not land after leg 0");
  const std::string gap = file("c.csv", "trial,w_1,w_2,w_4\n1,5,5,5\n");
  expect_refused(import({gap, "--columns", "omega_minus=w_*[rad/s]"}),
                 "--columns: w_*: number 3 is not there, but 4 is");
  const std::string hole = file("d.csv", "trial,w_1,w_2,condition\n1,,5,fast\n");
  expect_refused(import({hole, "--columns", "omega_minus=w_*[rad/s]"}),
                 hole + ":2:3: w_1: no speed, although the trial goes on or other columns tell of this collision");
  const std::string semicolons = file("e.csv", "trial;w\n1;5\n");
  expect_refused(import({semicolons, "--separator", ",", "--columns", "omega_minus=w[rad/s]"}),
                 semicolons + ":1: one column, which holds a ';'; say --separator ';'");
  expect_refused(import({semicolons, "--columns", "omega_minus=speed[rad/s]"}),
                 "--columns: " + semicolons + " has no 'speed' for omega_minus (it has trial, w)");
  expect_refused(import({csv, "--columns", "omega_minus=w[rad/s]", "--trials-in", "rows"}),
                 "--trials-in: has a meaning for matrices of a MAT file only");
  EXPECT_EQ(import({path("none.csv"), "--columns", "omega_minus=w[rad/s]"}).code, 2);
}

// A table as a German spreadsheet saves it, with lines before the header, a row of units, and rows that end early.
TEST_F(Import, FindsTheLayoutAndSaysIt) {
  forget_course();
  for (MeasuredTrial& trial : known_.trials) {
    trial.outcome.reset();
    for (MeasuredCollision& c : trial.collisions) c.leg.reset(), c.omega_plus.reset();
  }
  std::string rows;
  for (const MeasuredTrial& trial : known_.trials) {
    rows += fmt::format("{};12.03.2024;\"{}\"", trial.number, known_.conditions[trial.condition].id);
    for (const MeasuredCollision& c : trial.collisions) {
      std::string speed = fmt::format("{}", c.omega_minus * 180 / std::numbers::pi);
      std::ranges::replace(speed, '.', ',');
      rows += ";" + speed;
    }
    rows += trial.number == 1 ? ";;\n" : "\n";
  }
  const std::string columns = "trial=Versuch,condition=Start,omega_minus=Omega *";
  const std::string plain = "\xEF\xBB\xBFVersuch;Datum;Start;Omega 1 [deg/s];Omega 2 [deg/s];Omega 3 [deg/s]\n" + rows;
  const Ran ran = import({file("de.csv", plain), "--columns", columns});
  expect_same(ran, 1e-15);
  for (const char* found : {"found: fields are separated by ';'\n", "found: numbers have decimal commas\n"})
    EXPECT_NE(ran.out.find(found), std::string::npos) << ran.out;
  const std::string before = "Messung 3\nam Hang\nVersuch;Datum;Start;Omega 1;Omega 2;Omega 3\n";
  for (const char* degrees : {"[deg/s]", "\xC2\xB0/s"}) {
    const std::string units = fmt::format("-;;;{0};{0};{0}\n", degrees);
    const Ran units_found = import({file("units.csv", before + units + rows), "--columns", columns});
    expect_same(units_found, 1e-15);
    for (const char* found : {"found: the header is line 3;", "found: line 4 holds units\n"})
      EXPECT_NE(units_found.out.find(found), std::string::npos) << units_found.out;
  }
  const Ran told = import({path("units.csv"), "--columns", columns, "--separator", ";", "--decimal", "comma",
                           "--skip-rows", "2", "--units-row"});
  expect_same(told, 1e-15);
  EXPECT_EQ(told.out.find("found:"), std::string::npos) << told.out;
  expect_refused(import({path("units.csv"), "--columns", columns + "[rad/s]"}),
                 "--columns: omega_minus: the name 'Omega 1 [\xC2\xB0/s]' says deg/s, not rad/s");
  EXPECT_EQ(import({path("de.csv"), "--decimal", "no", "--columns", columns}).code, 2);
}

TEST_F(Import, FramesOfOneTrialBehindAPreamble) {
  std::string csv = "Trajectories\n120\nFrame,Sub Frame,hub:ang\n,,deg\n";
  for (int frame = 0; frame < 30; ++frame) csv += fmt::format("{},0,{}\n", frame, 2.5 * frame);
  std::string one = known_toml;
  const std::string description = file("one.toml", one.substr(0, one.rfind("[[")));
  const Ran ran = metastable({"import", file("vicon.csv", csv), "--columns", "time=Frame[1/120 s],angle=hub:ang",
                              "--description", description, "--out", path("out")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("assumed: all frames are of one trial\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("  time         Frame in 1/120 s\n"), std::string::npos) << ran.out;
  EXPECT_NE(read(folder_ / "out/angle.csv").find("\n1,0.025,0.1308"), std::string::npos)
      << read(folder_ / "out/angle.csv");
}

TEST_F(Import, AnglesOfACamera) {
  std::string csv = "trial,frame_ms,phi_deg,condition\n";
  for (int frame = 0; frame < 30; ++frame) csv += fmt::format("1,{},{},fast\n", 10 * frame, 3 * frame);
  const Ran ran = import({file("angle.csv", csv), "--columns", "time=frame_ms,angle=phi_deg"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.out.find("next: metastable collisions"), std::string::npos) << ran.out;
  EXPECT_NE(read(folder_ / "out/angle.csv").find("\nfast,1,0.01,0.05235987755982989\n"), std::string::npos);
}

TEST_F(Import, HelpTellsWhatItNeeds) {
  const std::string help = metastable({"import", "--help"}).out;
  for (const char* text : {"What it needs", "WHAT=NAME[UNIT]", "rad/s, deg/s, rpm or rev/s", "--description"})
    EXPECT_NE(help.find(text), std::string::npos) << help;
}

}  // namespace
}  // namespace metastable::reports::test
