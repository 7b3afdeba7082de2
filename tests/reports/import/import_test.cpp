// metastable import: what an experiment folder says, told in other files, comes back as the same experiment; what is
// missing or ambiguous is named.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "analysis/walker_model/walk_folder.h"
#include "reports/import/mat_rows.h"
#include "tests/reports/program.h"
#include "tests/reports/support.h"
#ifdef METASTABLE_MATIO
#include <hdf5.h>
#include <matio.h>
#endif

namespace metastable::reports::test {
namespace {
using analysis::Experiment;
using analysis::MeasuredCollision;
using analysis::MeasuredTrial;
using Words = std::vector<std::string>;

// It has two conditions, one trial whose foot turned back, and speeds that are not known.
constexpr const char* known_toml = R"(title = "Known"
[wheel]
hub_mass_kg = 1.39
leg_lengths_m = [0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.15]
[contact]
law = "coulomb"
restitution = { mean = 0.4, sd = 0.1 }
friction = { mean = 0.4, sd = 0.05 }
[[condition]]
id = "fast"
slope_deg = 9.59
ramp_length_m = 3.66
[[condition]]
id = "slow, again"
slope_deg = 9.59
ramp_length_m = 3.66
)";
constexpr const char* known_collisions =
    "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n"
    "fast,1,1,0,0,0,5.81237,4.7311\n"
    "fast,1,2,1,0.1912,0.1161,5.7001,4.61\n"
    "fast,1,3,2,0.3825,0.2326,5.6,4.5001\n"
    "\"slow, again\",2,1,3,0,0,4.43,\n"
    "fast,4,1,0,0,0,5.91,4.8\n"
    "fast,4,2,1,0.2,0.1162,3.2,-0.25\n";
constexpr const char* known_trials =
    "condition,trial,outcome\nfast,1,max_collisions\n\"slow, again\",2,rest\nfast,4,rest\n";

class Import : public InFolder {
 protected:
  void SetUp() override {
    InFolder::SetUp();
    std::filesystem::create_directory(folder_ / "known");
    file("known/experiment.toml", known_toml);
    file("known/collisions.csv", known_collisions);
    file("known/trials.csv", known_trials);
    known_ = analysis::read_experiment(folder_ / "known");
  }

  Ran import(Words more) const {
    std::filesystem::remove_all(folder_ / "out");
    Words words{"import"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--out", path("out")});
    if (std::ranges::find(words, "--slope") == words.end() && std::ranges::find(words, "--legs") == words.end())
      words.insert(words.end(), {"--description", path("known/experiment.toml")});
    return metastable(words);
  }

  // The experiment that was imported is the known one, numbers to a relative `close`.
  void expect_same(const Ran& ran, double close = 0) const {
    ASSERT_EQ(ran.code, 0) << ran.err;
    const Experiment read = analysis::read_experiment(folder_ / "out");
    const auto same = [close](std::optional<double> a, std::optional<double> b) {
      return a.has_value() == b.has_value() && (!a || std::abs(*a - *b) <= close * std::abs(*b));
    };
    ASSERT_EQ(read.trials.size(), known_.trials.size());
    for (std::size_t t = 0; t < read.trials.size(); ++t) {
      const MeasuredTrial &a = read.trials[t], &b = known_.trials[t];
      EXPECT_EQ(a.number, b.number);
      EXPECT_EQ(a.condition, b.condition);
      EXPECT_EQ(a.outcome, b.outcome);
      ASSERT_EQ(a.collisions.size(), b.collisions.size());
      for (std::size_t i = 0; i < a.collisions.size(); ++i) {
        const MeasuredCollision &c = a.collisions[i], &d = b.collisions[i];
        EXPECT_EQ(c.leg, d.leg);
        EXPECT_TRUE(c.number == d.number && same(c.time, d.time) && same(c.position, d.position) &&
                    same(c.omega_minus, d.omega_minus) && same(c.omega_plus, d.omega_plus))
            << "trial " << a.number << ", collision " << c.number;
      }
    }
  }

  void expect_refused(const Ran& ran, const std::string& said) const {
    EXPECT_EQ(ran.code, 2) << said;
    EXPECT_EQ(ran.out, "");
    EXPECT_EQ(ran.err, "metastable: " + said + "\n");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  }

  // Writes degrees, from leg 1, with other names, an outcome by number, rows of the trials mixed, and a column of
  // no use.
  std::string long_csv() const {
    std::string rows[3];
    for (const MeasuredTrial& trial : known_.trials)
      for (const MeasuredCollision& c : trial.collisions)
        rows[c.number - 1] +=
            fmt::format("{};\"{}\";{};{};{};{};{};ok\n", trial.number, known_.conditions[trial.condition].id,
                        c.number - 1, *c.leg + 1, c.omega_minus * 180 / std::numbers::pi,
                        c.omega_plus ? fmt::format("{}", *c.omega_plus * 180 / std::numbers::pi) : "NaN",
                        trial.outcome == dynamics::Outcome::rest ? 1 : 0);
    std::string text = "run;start;k;foot;w before [deg/s];w_after;stopped;remark\n";
    return file("long.csv", text + rows[0] + rows[1] + rows[2]);
  }

  // Leaves it as `known`, but for times and positions.
  void forget_course() {
    for (MeasuredTrial& trial : known_.trials)
      for (MeasuredCollision& c : trial.collisions) c.time = c.position = std::nullopt;
  }

  Experiment known_;
};

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

// Walks of which one fell; the file has degrees, mixes the rows of the trials, and lacks a rate.
TEST_F(Import, WalksInOtherWordsAndUnits) {
  const std::string csv = file("walks.csv",
                               "run,k,foot,theta [deg],rate [deg/s],end\n1,0,0,15,-60,ok\n2,0,1,15.5,-61,fell\n"
                               "1,1,1,15.2,NaN,ok\n2,1,0,14.9,-59,fell\n");
  const Words words{csv,
                    "--walker",
                    "compass",
                    "--slope",
                    "3",
                    "--slope-sd",
                    "0.3",
                    "--collisions-from",
                    "0",
                    "--legs-from",
                    "0",
                    "--outcomes",
                    "failed=fell,stopped=ok",
                    "--errors",
                    "half_angle=0.0005",
                    "--columns",
                    "trial=run,step=k,phase=foot,half_angle=theta,stance_rate=rate,outcome=end"};
  const Ran ran = import(words);
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(ran.out.substr(0, ran.out.find('\n')), path("out") + ": 2 trials, 4 steps");
  const auto walks = analysis::read_walks(folder_ / "out");
  ASSERT_TRUE(walks);
  ASSERT_EQ(walks->runs.trials.size(), 2u);
  const analysis::MachineTrial& first = walks->runs.trials[0];
  ASSERT_EQ(first.rows.size(), 2u);
  EXPECT_EQ(first.outcome, analysis::MachineOutcome::stopped);
  EXPECT_EQ(walks->runs.trials[1].outcome, analysis::MachineOutcome::failed);
  EXPECT_EQ(first.rows[0].inputs, std::vector<double>{1});
  EXPECT_NEAR(first.rows[0].seen[0], 15 * std::numbers::pi / 180, 1e-15);
  EXPECT_TRUE(std::isnan(first.rows[1].seen[1]));
  EXPECT_EQ(walks->machine->observe.size(), 2u);
  EXPECT_EQ(walks->machine->observe[0].sd, 0.0005);
  EXPECT_FALSE(walks->machine->observe[1].sd);
}

TEST_F(Import, WideWalks) {
  const std::string csv = file("wide.csv", "run,a1,a2,a3\n1,0.27,,0.26\n2,0.28,0.27,\n");
  const Ran ran = import({csv, "--walker", "simplest", "--slope", "0.5", "--slope-sd", "0.05", "--columns",
                          "trial=run,half_angle=a*[rad]"});
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(read(folder_ / "out" / "steps.csv"),
            "trial,step,half_angle_rad\n1,1,0.27\n1,2,\n1,3,0.26\n2,1,0.28\n2,2,0.27\n");
}

TEST_F(Import, NamesWhatWalksLack) {
  const std::string csv = file("a.csv", "run,foot,theta\n1,0,15\n1,1,14\n");
  const auto walks = [&](Words more) {
    Words words{csv, "--walker", "compass"};
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--slope", "3"});
    return import(words);
  };
  expect_refused(walks({}), "--slope-sd: is needed with --walker");
  expect_refused(walks({"--slope-sd", "0.3", "--mass", "1"}), "--mass: has no meaning with --walker");
  expect_refused(walks({"--slope-sd", "0.3"}),
                 "--columns: which column of " + csv + " is half_angle? It has run, foot, theta");
  expect_refused(walks({"--slope-sd", "0.3", "--columns", "trial=run,omega_minus=theta[deg/s]"}),
                 "--columns: 'omega_minus=theta[deg/s]' is not WHAT=NAME or WHAT=NAME[UNIT], where WHAT is one of "
                 "condition, trial, time, position, outcome, step, phase, half_angle, stance_rate, swing_rate");
  expect_refused(walks({"--slope-sd", "0.3", "--columns", "trial=run,phase=foot,half_angle=theta[deg]"}),
                 csv + ":2: phase: 0 is outside 1..2");
  expect_refused(walks({"--slope-sd", "0.3", "--errors", "theta=1"}),
                 "--errors: 'theta' is none of half_angle, stance_rate, swing_rate");
  expect_refused(import({csv, "--slope", "3", "--slope-sd", "0.3"}), "--slope-sd: has a meaning with --walker only");
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

#ifdef METASTABLE_MATIO

class ImportMat : public Import {
 protected:
  using Pad = std::vector<std::vector<double>>;

  // Returns the speeds of each trial, in deg/s.
  static std::vector<double> speeds(const MeasuredTrial& trial) {
    std::vector<double> values;
    for (const MeasuredCollision& c : trial.collisions) values.push_back(c.omega_minus * 180 / std::numbers::pi);
    return values;
  }
  static matvar_t* array(const char* name, std::vector<double> values, std::size_t rows, std::size_t columns) {
    std::size_t dims[] = {rows, columns};
    return Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values.data(), 0);
  }
  static matvar_t* text(const char* name, std::string value) {
    std::size_t dims[] = {1, value.size()};
    return Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UINT8, 2, dims, value.data(), 0);
  }
  std::string save(const std::vector<matvar_t*>& variables) const {
    mat_t* const mat = Mat_CreateVer(path("lab.mat").c_str(), nullptr, MAT_FT_MAT5);
    for (matvar_t* const v : variables) {
      Mat_VarWrite(mat, v, compression_);
      Mat_VarFree(v);
    }
    Mat_Close(mat);
    return path("lab.mat");
  }
  matio_compression compression_ = MAT_COMPRESSION_NONE;
  // Returns each trial's condition, and its number.
  matvar_t* conditions() const {
    std::size_t dims[] = {known_.trials.size(), 1};
    std::vector<matvar_t*> cells;
    for (const MeasuredTrial& trial : known_.trials)
      cells.push_back(text(nullptr, known_.conditions[trial.condition].id));
    return Mat_VarCreate("start", MAT_C_CELL, MAT_T_CELL, 2, dims, cells.data(), 0);
  }
  // Leaves all known but for what these files do not tell.
  void forget() {
    forget_course();
    for (MeasuredTrial& trial : known_.trials) {
      trial.outcome.reset();
      for (MeasuredCollision& c : trial.collisions) c.leg.reset(), c.omega_plus.reset();
    }
  }
  matvar_t* matrix(bool columns) const {
    std::vector<double> values(9, std::nan(""));
    for (std::size_t t = 0; t < 3; ++t)
      for (std::size_t i = 0; i < known_.trials[t].collisions.size(); ++i)
        values[columns ? i + 3 * t : t + 3 * i] = speeds(known_.trials[t])[i];
    return array("w", values, 3, 3);
  }
};

TEST_F(ImportMat, StructArrays) {
  const char* fields[] = {"n", "w", "w_plus", "leg", "start", "outcome"};
  std::size_t dims[] = {1, known_.trials.size()};
  matvar_t* const trials = Mat_VarCreateStruct("trials", 2, dims, fields, 6);
  for (std::size_t t = 0; t < known_.trials.size(); ++t) {
    const MeasuredTrial& trial = known_.trials[t];
    std::vector<double> plus, legs;
    for (const MeasuredCollision& c : trial.collisions) {
      plus.push_back(c.omega_plus ? *c.omega_plus : std::nan(""));
      legs.push_back(*c.leg + 1);
    }
    const std::size_t n = plus.size();
    const auto set = [&](const char* field, matvar_t* value) { Mat_VarSetStructFieldByName(trials, field, t, value); };
    set("n", array(nullptr, {static_cast<double>(trial.number)}, 1, 1));
    set("w", array(nullptr, speeds(trial), n, 1));
    set("w_plus", array(nullptr, plus, 1, n));
    set("leg", array(nullptr, legs, n, 1));
    set("start", text(nullptr, known_.conditions[trial.condition].id));
    set("outcome", text(nullptr, trial.outcome == dynamics::Outcome::rest ? "rest" : "max_collisions"));
  }
  forget_course();
  expect_same(import({save({trials}), "--legs-from", "1", "--columns",
                      "trial=trials.n,condition=trials.start,omega_minus=trials.w[deg/s],"
                      "omega_plus=trials.w_plus[rad/s],leg=trials.leg,outcome=trials.outcome"}),
              1e-15);
}

TEST_F(ImportMat, MatricesPaddedWithNan) {
  forget();
  for (const bool columns : {true, false})
    expect_same(import({save({matrix(columns), conditions(), array("n", {1, 2, 4}, 1, 3)}), "--trials-in",
                        columns ? "columns" : "rows", "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
                1e-15);
  expect_refused(import({path("lab.mat"), "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
                 path("lab.mat") + ": w: is 3 x 3: say --trials-in columns or --trials-in rows");
  expect_refused(
      import({path("lab.mat"), "--trials-in", "columns", "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
      path("lab.mat") + ": w(2,2): NaN before the last number");
}

TEST_F(ImportMat, VectorsAndWhatIsWrongWithThem) {
  forget();
  std::vector<double> all, of_trial;
  for (const MeasuredTrial& trial : known_.trials)
    for (const double speed : speeds(trial)) all.push_back(speed), of_trial.push_back(trial.number);
  const std::vector<double> legs(all.size() - 1, 0.0);
  const std::string mat = save({array("w_deg_s", all, all.size(), 1), array("run", of_trial, 1, all.size()),
                                array("short", legs, legs.size(), 1), text("name", "fast")});
  const auto columns = [&](const std::string& map) { return import({mat, "--columns", map}); };
  const std::string conditions =
      file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  EXPECT_EQ(metastable({"import", mat, "--columns", "omega_minus=w_deg_s,trial=run,condition=name", "--description",
                        conditions, "--out", path("out")})
                .code,
            0);
  expect_same({0, "", ""}, 1e-15);
  expect_refused(columns("omega_minus=w[deg/s]"),
                 "--columns: " + mat + " has no 'w' for omega_minus (it has w_deg_s, run, short, name)");
  expect_refused(columns("omega_minus=w_deg_s,trial=run,leg=short"),
                 mat + ": short: has 5 numbers where w_deg_s has 6");
  expect_refused(columns("omega_minus=w_deg_s"),
                 mat +
                     ": w_deg_s: is 6 x 1: say --trials-in columns or --trials-in rows, or map trial to a vector of as "
                     "many");
}

matvar_t* struct_of(const char* name, const char* field, matvar_t* value) {
  std::size_t dims[] = {1, 1};
  const char* fields[] = {field};
  matvar_t* const whole = Mat_VarCreateStruct(name, 2, dims, fields, 1);
  Mat_VarSetStructFieldByName(whole, field, 0, value);
  return whole;
}

TEST_F(ImportMat, StructsInStructsAndVersion4) {
  forget();
  expect_same(import({save({struct_of("lab", "run", struct_of(nullptr, "w", matrix(true))), conditions(),
                            array("n", {1, 2, 4}, 1, 3)}),
                      "--trials-in", "columns", "--columns", "trial=n,condition=start,omega_minus=lab.run.w[deg/s]"}),
              1e-15);
  expect_refused(import({path("lab.mat"), "--columns", "trial=n,condition=start,omega_minus=lab.run[deg/s]"}),
                 path("lab.mat") + ": lab.run: is a struct (1 x 1) with the fields w; name one of them");
  mat_t* const mat = Mat_CreateVer(path("v4.mat").c_str(), nullptr, MAT_FT_MAT4);
  for (matvar_t* const v : {matrix(true), array("n", {1, 2, 4}, 1, 3)}) {
    Mat_VarWrite(mat, v, MAT_COMPRESSION_NONE);
    Mat_VarFree(v);
  }
  Mat_Close(mat);
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  const std::string one = file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  expect_same(metastable({"import", path("v4.mat"), "--trials-in", "columns", "--columns",
                          "trial=n,omega_minus=w[deg/s]", "--description", one, "--out", path("out")}),
              1e-15);
}

// HDF5 as other programs write it, without MATLAB's header and attributes, which brought libmatio down; and the same
// file cut short or spoilt, byte by byte.
TEST_F(ImportMat, Hdf5OfOtherPrograms) {
  forget();
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  const std::string one = file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  const std::string mat = path("other.mat");
  {
    const hid_t to = H5Fcreate(mat.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                group = H5Gcreate2(to, "lab", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const auto write = [&](const char* name, const std::vector<double>& values, std::vector<hsize_t> sizes) {
      const hid_t space = H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr),
                  data = H5Dcreate2(group, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
      H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
      H5Dclose(data), H5Sclose(space);
    };
    std::vector<double> values(9, std::nan(""));
    for (std::size_t t = 0; t < 3; ++t)
      for (std::size_t i = 0; i < known_.trials[t].collisions.size(); ++i)
        values[i + 3 * t] = speeds(known_.trials[t])[i];
    write("w", values, {3, 3});
    write("n", {1, 2, 4}, {3});
    H5Gclose(group), H5Fclose(to);
  }
  const auto run = [&](const std::string& from) {
    std::filesystem::remove_all(folder_ / "out");
    return metastable({"import", from, "--trials-in", "columns", "--columns", "trial=lab.n,omega_minus=lab.w[deg/s]",
                       "--description", one, "--out", path("out")});
  };
  expect_same(run(mat), 1e-15);
  const std::string whole = read(mat);
  for (std::size_t k = 0; k < 60; ++k) {
    std::string spoilt = whole;
    if (k % 3 == 0)
      spoilt.resize(whole.size() * (k + 1) / 61);
    else
      spoilt[(k * 7919) % std::min<std::size_t>(whole.size(), 2400)] ^= static_cast<char>(1 + k * 37 % 255);
    const Ran ran = run(file("spoilt.mat", spoilt));
    EXPECT_TRUE(ran.code == 0 || ran.code == 2) << k << ran.err;
    EXPECT_EQ(ran.code == 2, ran.err.starts_with("metastable: ")) << ran.err;
    EXPECT_EQ(ran.code == 0, std::filesystem::exists(folder_ / "out")) << k;
  }
}

// What libmatio itself would read as other numbers.
TEST_F(ImportMat, CutShortOrDamagedIsRefused) {
  const auto refusal_of = [&](const std::string& text) {
    const std::string mat = file("broken.mat", text);
    const Ran ran = import({mat, "--columns", "omega_minus=w[deg/s]", "--trials-in", "columns"});
    EXPECT_EQ(ran.code, 2);
    return ran.err.substr(0, ran.err.find(" at byte"));
  };
  const std::string whole = read(save({matrix(true)}));
  const std::string begin = "metastable: " + path("broken.mat");
  EXPECT_EQ(refusal_of("MATLAB 5.0 MAT-file, not really"), begin + ": is cut short: what begins");
  for (const std::size_t size : {whole.size() - 1, whole.size() - 40, std::size_t{140}, std::size_t{131}})
    EXPECT_EQ(refusal_of(whole.substr(0, size)), begin + ": is cut short: what begins") << size;
  compression_ = MAT_COMPRESSION_ZLIB;
  std::string compressed = read(save({matrix(true)}));
  EXPECT_EQ(refusal_of(compressed.substr(0, compressed.size() - 1)), begin + ": is cut short: what begins");
  compressed[compressed.size() - 12] ^= 1;
  EXPECT_EQ(refusal_of(compressed), begin + ": is damaged: its variable");
}

#else

TEST_F(Import, WithoutTheLibrarySaysWhatToInstall) {
  const std::string mat = file("lab.mat", "MATLAB 5.0 MAT-file, Platform: GLNXA64");
  expect_refused(import({mat, "--columns", "omega_minus=w[rad/s]"}),
                 mat +
                     ": this metastable was built without libmatio, which reads MAT files: install libmatio-dev and "
                     "build again (./run install), or save a CSV (writetable, writematrix)");
}

#endif

}  // namespace
}  // namespace metastable::reports::test
