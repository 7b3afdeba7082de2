#include "analysis/experiment/experiment.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "analysis/experiment/experiment_folder.h"
#include "analysis/experiment/input_error.h"
#include "tests/analysis/settings.h"
#include "tests/own_folder.h"

namespace metastable::analysis {
namespace {

using Strings = std::vector<std::string>;

const std::string description = R"([wheel]
hub_mass_kg = 1.39
leg_lengths_m = [0.15, 0.151, 0.15, 0.15]
[contact]
law = "coulomb"
restitution = { mean = 0.4, sd = 0.1 }
friction = { mean = 0.3, sd = 0.05 }
[[condition]]
id = "a"
slope_deg = 9.59
ramp_length_m = 3.66
[[condition]]
id = "b"
slope_deg = 12
ramp_length_m = 3
initial_speed_rad_s = { mean = 5.83, sd = 0.28 }
first_landing_leg = 1
day = 2
)";
const std::string header = "condition,trial,collision,leg,omega_minus_rad_s\n";

ExperimentSource source(const std::string& toml, const std::string& collisions,
                        std::optional<std::string> trials = {}) {
  return {.folder = "",
          .experiment_toml = toml,
          .collisions_csv = collisions,
          .trials_csv = std::move(trials),
          .angle_csv = {}};
}

Strings defects(const ExperimentSource& of) {
  try {
    parse_experiment(of);
  } catch (const InputError& error) {
    return error.lines();
  }
  return {};
}

std::string replaced(std::string text, const std::string& old, const std::string& fresh) {
  return text.replace(text.find(old), old.size(), fresh);
}

TEST(Experiment, ReadsEverythingThatTheFilesSay) {
  const Experiment e = parse_experiment(source("title = \"t\"\n" + description + "[sensor]\nrate_hz = 120\n",
                                               "omega_plus_rad_s,condition,trial,collision,leg,omega_minus_rad_s\n"
                                               "4.5,b,7,1,1,5.5\n4.0,a,3,1,0,5.0\n,b,7,2,2,8.1\n",
                                               "trial,condition,outcome\n3,a,rest\n7,b,end_of_ramp\n"));
  EXPECT_EQ(e.title, "t");
  EXPECT_EQ(e.system, System::rimless_wheel);
  EXPECT_EQ(e.wheel.leg_length, (std::vector<double>{0.15, 0.151, 0.15, 0.15}));
  EXPECT_EQ(e.wheel.inertia, std::nullopt);
  EXPECT_EQ(e.contact.law, dynamics::Law::coulomb);
  EXPECT_EQ(e.contact.friction.sd, 0.05);
  ASSERT_EQ(e.conditions.size(), 2u);
  EXPECT_EQ(e.conditions[0].initial_speed, std::nullopt);
  EXPECT_EQ(e.conditions[1].initial_speed->mean, 5.83);
  EXPECT_EQ(e.conditions[1].first_landing_leg, 1);
  EXPECT_EQ(e.conditions[0].day, 1);
  EXPECT_EQ(e.conditions[1].day, 2);
  EXPECT_EQ(e.sensor.rate, 120);
  ASSERT_EQ(e.trials.size(), 2u);
  EXPECT_EQ(e.trials[0].number, 3);
  EXPECT_EQ(e.trials[0].outcome, dynamics::Outcome::rest);
  EXPECT_EQ(e.trials[1].condition, 1u);
  ASSERT_EQ(e.trials[1].collisions.size(), 2u);
  EXPECT_EQ(e.trials[1].collisions[0].omega_plus, 4.5);
  EXPECT_EQ(e.trials[1].collisions[1].omega_plus, std::nullopt);
  EXPECT_EQ(e.trials[1].collisions[1].omega_minus, 8.1);
  EXPECT_EQ(e.columns.leg, Presence::all);
  EXPECT_EQ(e.columns.omega_plus, Presence::some);
  EXPECT_EQ(e.columns.time, Presence::none);
  EXPECT_TRUE(e.columns.outcomes);
  EXPECT_EQ(e.notes, (Strings{"time_s is not given.", "position_m is not given.",
                              "omega_plus_rad_s is given for some collisions only."}));
}

TEST(Experiment, NominalSettingTakesTheMeasuredLaunchWhereNoneIsStated) {
  const Experiment e = parse_experiment(source(description, header + "a,1,1,0,5.0\na,2,1,0,6.0\nb,3,1,1,4.0\n"));
  const Setting a = nominal_setting(e, 0), b = nominal_setting(e, 1);
  EXPECT_DOUBLE_EQ(a.initial_speed.mean, 5.5);
  EXPECT_DOUBLE_EQ(a.initial_speed.sd, std::sqrt(0.5));
  EXPECT_EQ(a.law, dynamics::Law::coulomb);
  EXPECT_EQ(a.slope_deg, 9.59);
  EXPECT_EQ(b.initial_speed.mean, 5.83);
  EXPECT_EQ(b.first_landing_leg, 1);
  EXPECT_THROW(nominal_setting(e, 2), std::invalid_argument);
}

TEST(Experiment, ReadsCoastDowns) {
  const std::string toml =
      "system = \"coast_down\"\n[rotor]\ninertia_kg_m2 = 2.0\n[loss]\nconstant = 0.15\nlinear = 0.0\nquadratic = "
      "0.00165\n"
      "noise_sd = 0.1\n";
  const Experiment e = parse_experiment(source(toml, "trial,collision,omega_minus_rad_s\n1,1,50\n1,2,49\n2,1,48\n"));
  EXPECT_EQ(e.system, System::coast_down);
  EXPECT_EQ(e.rotor_inertia, 2.0);
  EXPECT_EQ(e.loss.quadratic, 0.00165);
  EXPECT_EQ(e.loss.noise_sd, 0.1);
  ASSERT_EQ(e.conditions.size(), 1u);
  EXPECT_EQ(e.trials.size(), 2u);
  EXPECT_THROW(nominal_setting(e, 0), std::invalid_argument);
  const Experiment two =
      parse_experiment(source(toml, "condition,trial,collision,omega_minus_rad_s\nfree,1,1,50\ntyre,2,1,49\n"));
  ASSERT_EQ(two.conditions.size(), 2u);
  EXPECT_EQ(two.conditions[1].id, "tyre");
}

TEST(Experiment, NamesWhatIsWrongWithTheDescription) {
  const std::string rows = header + "a,1,1,0,5.0\n";
  EXPECT_TRUE(defects(source(description, rows)).empty());
  const auto of = [&](const std::string& old, const std::string& fresh) {
    const Strings lines = defects(source(replaced(description, old, fresh), rows));
    return lines.empty() ? "" : lines.front();
  };
  EXPECT_EQ(of("hub_mass_kg = 1.39\n", ""), "experiment.toml:1:1: missing key 'wheel.hub_mass_kg'");
  EXPECT_EQ(of("1.39", "-1"), "experiment.toml:2:15: wheel.hub_mass_kg: -1 is outside [1e-06, 1e+06]");
  EXPECT_EQ(of("1.39", "\"1.39\""), "experiment.toml:2:15: wheel.hub_mass_kg: a number is expected");
  const std::string grams = of("1.39", "1390");
  EXPECT_NE(grams.find("wheel.hub_mass_kg: 1390 kg between the tips of legs of"), std::string::npos) << grams;
  EXPECT_TRUE(grams.ends_with("would be denser than any metal; grams are suspected")) << grams;
  EXPECT_EQ(of("0.151", "nan"), "experiment.toml:3:24: wheel.leg_lengths_m[1]: nan is outside [0.001, 100]");
  EXPECT_EQ(of("[0.15, 0.151, 0.15, 0.15]", "[0.15]"),
            "experiment.toml:3:17: wheel.leg_lengths_m: 1 legs are outside 3..1000");
  EXPECT_EQ(of("[0.15, 0.151, 0.15, 0.15]", "0.15"),
            "experiment.toml:3:17: wheel.leg_lengths_m: a list of 3 to 1000 numbers [m] is expected");
  EXPECT_EQ(of("coulomb", "sticky"),
            "experiment.toml:5:7: contact.law: one of published, coulomb, plastic, settled is expected");
  EXPECT_EQ(of("mean = 0.4", "mean = 1.4"), "experiment.toml:6:24: contact.restitution.mean: 1.4 is outside [0, 1]");
  EXPECT_EQ(of("{ mean = 0.4, sd = 0.1 }", "0.4"),
            "experiment.toml:6:15: contact.restitution: { mean = ..., sd = ... } is expected");
  EXPECT_EQ(of("slope_deg = 12", "slope_deg = 45"),
            "experiment.toml:14:13: condition[1].slope_deg: 45 is outside [0.001, 45)");
  EXPECT_EQ(of("leg = 1", "leg = 4"), "experiment.toml:17:21: condition[1].first_landing_leg: 4 is outside 0..3");
  EXPECT_EQ(of("leg = 1", "leg = 1.5"),
            "experiment.toml:17:21: condition[1].first_landing_leg: a whole number in 0..3 is expected");
  EXPECT_EQ(of("id = \"b\"", "id = \"a\""), "experiment.toml:13:6: id: a condition 'a' was there before");
  EXPECT_EQ(of("[wheel]\n", "[wheel]\nhub_mas_kg = 1\n"),
            "experiment.toml:2:1: unknown key 'hub_mas_kg' in wheel (known: hub_mass_kg, inertia_kg_m2, leg_lengths_m, "
            "radius_of_gyration_m, tip_radius_m); did you mean 'hub_mass_kg'?");
  EXPECT_EQ(of("[wheel]\n", "[wheel\n").substr(0, 20), "experiment.toml:1:7:");
}

TEST(Experiment, RefusesWhatNoWheelCanHave) {
  const auto of = [&](const std::string& old, const std::string& fresh, const std::string& rows = "a,1,1,0,5.0\n") {
    const Strings lines = defects(source(replaced(description, old, fresh), header + rows));
    return lines.empty() ? "" : lines.front();
  };
  EXPECT_EQ(of("1.39", "1e250"), "experiment.toml:2:15: wheel.hub_mass_kg: 1e+250 is outside [1e-06, 1e+06]");
  EXPECT_EQ(of("0.151", "1e5"), "experiment.toml:3:24: wheel.leg_lengths_m[1]: 100000 is outside [0.001, 100]");
  // It is the inertia about the hub, where that about the foot is asked for.
  EXPECT_EQ(
      of("hub_mass_kg = 1.39\n", "inertia_kg_m2 = 0.0035\nhub_mass_kg = 1.39\n"),
      "experiment.toml:2:17: wheel.inertia_kg_m2: 0.0035 kg m^2 is below M (mean L)^2 = 0.03138 kg m^2, the least "
      "about the stance foot; if it is the inertia about the hub, 0.03488 kg m^2 is meant");
  EXPECT_EQ(of("hub_mass_kg = 1.39\n", "inertia_kg_m2 = 0.0349\nhub_mass_kg = 1.39\n"), "");
  EXPECT_EQ(of("hub_mass_kg = 1.39\n", "inertia_kg_m2 = 1e6\nhub_mass_kg = 1.39\n").substr(0, 80),
            "experiment.toml:2:17: wheel.inertia_kg_m2: 1000000 kg m^2 is above 0.3138 kg m^2");
  EXPECT_EQ(of("hub_mass_kg = 1.39\n", "radius_of_gyration_m = 2\nhub_mass_kg = 1.39\n"),
            "experiment.toml:2:24: wheel.radius_of_gyration_m: 2 m is outside [0, 0.4507] m (3 mean legs)");
  EXPECT_EQ(
      defects(source(replaced(replaced(description, "coulomb", "settled"), "hub_mass_kg = 1.39\n",
                              "radius_of_gyration_m = 0\nhub_mass_kg = 1.39\n"),
                     header + "a,1,1,0,5.0\n"))
          .front(),
      "experiment.toml:2:24: wheel.radius_of_gyration_m: 0 m is outside (0, 0.4507] m (3 mean legs; law settled)");
  EXPECT_EQ(
      of("hub_mass_kg = 1.39\n", "tip_radius_m = 0.01\nhub_mass_kg = 1.39\n"),
      "experiment.toml:2:16: wheel.tip_radius_m: 0.01 m is outside [0, 0.0075] m (a twentieth of the shortest leg)");
  EXPECT_EQ(of("1.39", "1.39", "a,1,1,0,1e308\n"),
            "collisions.csv:2:9: omega_minus_rad_s: 1e+308 is outside [0, 1000]");
}

// A spelling that runs through the data is one mistake, not thousands.
TEST(Experiment, SaysOnceWhatIsWrongWithManyRows) {
  std::string rows = header, outcomes = "condition,trial,outcome\n";
  for (int trial = 1; trial <= 1000; ++trial) {
    rows += fmt::format("{},{},1,0,{}\n", trial % 2 == 0 ? "a" : "C", trial, trial == 2 ? 5 : 5000);
    outcomes += fmt::format("{},{},stopped\n", trial % 2 == 0 ? "a" : "C", trial);
  }
  const std::string unknown = ":2:1: condition: unknown condition 'C'; experiment.toml has: a, b (in 500 rows)";
  EXPECT_EQ(
      defects(source(description, rows, outcomes)),
      (Strings{"collisions.csv" + unknown,
               "collisions.csv:2:9: omega_minus_rad_s: 5000 is outside [0, 1000] (in 999 rows)", "trials.csv" + unknown,
               "trials.csv:2:5: outcome: 'stopped' is none of rest, end_of_ramp, max_collisions (in 1000 rows)"}));
}

TEST(Experiment, NamesWhatIsWrongWithTheRows) {
  const auto of = [&](const std::string& rows) { return defects(source(description, header + rows)); };
  EXPECT_EQ(of(""), (Strings{"collisions.csv: holds no collision"}));
  EXPECT_EQ(of("a,1,2,0,5\n"), (Strings{"collisions.csv:2:5: collision: 2 skips: collision 1 of trial 1 is due"}));
  EXPECT_EQ(of("a,1,1,0,5\na,1,1,1,5\na,1,2,1,5\n"),
            (Strings{"collisions.csv:3:5: collision: 1 repeats or goes back: collision 2 of trial 1 is due"}));
  EXPECT_EQ(of("a,1,1,0,5\na,1,3,1,5\n"),
            (Strings{"collisions.csv:3:5: collision: 3 skips: collision 2 of trial 1 is due"}));
  EXPECT_EQ(of("a,1,1,0,5\na,1,2,2,5\n"), (Strings{"collisions.csv:3:7: leg: leg 2 does not land after leg 0"}));
  const std::string ids = "; experiment.toml has: a, b";
  EXPECT_EQ(of("c,1,1,0,5\n"), (Strings{"collisions.csv:2:1: condition: unknown condition 'c'" + ids}));
  EXPECT_EQ(of(",1,1,0,5\n"),
            (Strings{"collisions.csv:2:1: condition: is empty where the id of a condition is expected" + ids}));
  EXPECT_EQ(
      of("a,1,1,0,5\nb,1,2,1,5\n"),
      (Strings{"collisions.csv:3:1: condition: trial 1 is of condition 'a' in line 2; numbers count over the whole "
               "experiment"}));
  EXPECT_EQ(of("a,1,1,4,-5\na,x,1,0,NaN\n"),
            (Strings{"collisions.csv:2:7: leg: 4 is outside 0..3",
                     "collisions.csv:2:9: omega_minus_rad_s: -5 is outside [0, 1000]",
                     "collisions.csv:3:3: trial: 'x' is not a whole number in 0..2147483647",
                     "collisions.csv:3:9: omega_minus_rad_s: 'NaN' is not a finite number"}));
  EXPECT_EQ(
      defects(source(description, "trial,collision,omega_minus_rad_s\n1,1,5\n1,2,5\n")),
      (Strings{"collisions.csv:2:1: trial: the column 'condition' is missing and experiment.toml has 2 conditions"}));
  EXPECT_EQ(defects(source(description,
                           "condition,trial,collision,time_s,position_m,omega_minus_rad_s\n"
                           "a,1,1,1.0,1.0,5\na,1,2,0.9,1.0,5\n")),
            (Strings{"collisions.csv:3:7: time_s: 0.9 s is not after the collision before (1 s)",
                     "collisions.csv:3:11: position_m: 1 m is not below the collision before (1 m)"}));
  EXPECT_EQ(defects(source(description,
                           "condition,trial,collision,omega_minus_rad_s,omega_plus_rad_s\n"
                           "a,1,1,5,-0.1\na,1,2,5,-0.1\n")),
            (Strings{"collisions.csv:3:5: collision: trial 1 goes on after an omega_plus_rad_s of -0.1: a wheel that "
                     "turned back"}));
}

TEST(Experiment, NamesTrialsThatAreInOneFileOnly) {
  const std::string rows = header + "a,1,1,0,5\na,2,1,0,5\n", outcomes = "condition,trial,outcome\n";
  EXPECT_EQ(defects(source(description, rows, outcomes + "a,1,rest\na,3,rest\n")),
            (Strings{"collisions.csv:3:1: trial 2 is not in trials.csv",
                     "trials.csv:3:1: trial 3 is not in collisions.csv"}));
  EXPECT_EQ(defects(source(description, rows, outcomes + "a,1,rest\nb,2,stop\na,1,rest\n")),
            (Strings{"trials.csv:3:5: outcome: 'stop' is none of rest, end_of_ramp, max_collisions",
                     "trials.csv:3:1: condition: trial 2 is of condition 'a' in collisions.csv",
                     "trials.csv:4:3: trial: trial 1 was there before, in line 2"}));
}

TEST(Experiment, ReportsDefectsOfAllFilesAtOnce) {
  const Strings lines = defects(source(replaced(description, "1.39", "0"), header + "a,1,1,0,\n", "condition,trial\n"));
  EXPECT_EQ(lines, (Strings{"experiment.toml:2:15: wheel.hub_mass_kg: 0 is outside [1e-06, 1e+06]",
                            "collisions.csv:2:9: omega_minus_rad_s: is empty; a number is expected",
                            "trials.csv:1:1: missing column 'outcome'"}));
}

TEST(Experiment, ReadsWhatSimulateWrites) {
  const Setting setting = paper_setting(7.02, false);
  const auto trials = simulate_trials(setting, {.trials = 20, .seed = 3});
  const ExperimentFiles files = experiment_files(setting, trials, "A \"test\"", {"made by a test"});
  const Experiment e = parse_experiment(source(files.experiment_toml, files.collisions_csv, files.trials_csv));
  EXPECT_TRUE(e.notes.empty());
  ASSERT_EQ(e.trials.size(), trials.size());
  for (std::size_t t = 0; t < trials.size(); ++t) {
    EXPECT_EQ(e.trials[t].outcome, trials[t].outcome);
    ASSERT_EQ(e.trials[t].collisions.size(), trials[t].collisions.size());
    for (std::size_t i = 0; i < trials[t].collisions.size(); ++i)
      EXPECT_NEAR(e.trials[t].collisions[i].omega_minus, trials[t].collisions[i].omega_minus, 1e-7);
  }
  EXPECT_EQ(nominal_setting(e, 0).describe(), setting.describe());
}

TEST(Experiment, ReadsFoldersAndNamesTheFileThatIsMissing) {
  const std::filesystem::path folder = metastable::test::own_folder();
  std::filesystem::create_directories(folder);
  const auto message = [&] {
    try {
      read_experiment(folder);
    } catch (const InputError& error) {
      return error.lines().front();
    }
    return std::string();
  };
  EXPECT_EQ(message(),
            fmt::format("{}: there is no such file; an experiment needs it", (folder / "experiment.toml").string()));
  std::ofstream(folder / "experiment.toml") << description;
  EXPECT_EQ(message(),
            fmt::format("{}: there is no such file; an experiment needs it", (folder / "collisions.csv").string()));
  std::ofstream(folder / "collisions.csv") << header << "a,1,1,0,5\n";
  EXPECT_EQ(read_experiment(folder).collisions(), 1u);
  std::filesystem::remove_all(folder);
  EXPECT_EQ(message(), fmt::format("{}: there is no such folder", folder.string()));
}

// Two seconds is the demand on a machine left alone, in a release build; the bound leaves room for others.
TEST(Experiment, ReadsAMillionRowsQuickly) {
  std::string rows = "condition,trial,collision,leg,time_s,position_m,omega_minus_rad_s,omega_plus_rad_s\n";
  constexpr int trials = 10000, collisions = 100;
  for (int t = 1; t <= trials; ++t)
    for (int c = 1; c <= collisions; ++c)
      fmt::format_to(std::back_inserter(rows), "a,{},{},{},{:.6f},{:.6f},{:.9g},{:.9g}\n", t, c, c % 4, 0.2 * c,
                     0.2125 * c, 8 + 0.001 * t / c, 7 + 0.001 * t / c);
  const ExperimentSource text = source(replaced(description, "3.66", "36.6"), rows);
  const auto start = std::chrono::steady_clock::now();
  const Experiment e = parse_experiment(text);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_EQ(e.collisions(), 1000000u);
  RecordProperty("rows_per_second", static_cast<int>(1e6 / seconds));
  fmt::print("1000000 rows in {:.2f} s\n", seconds);
#ifdef NDEBUG
  EXPECT_LT(seconds, 10);
#endif
}

}  // namespace
}  // namespace metastable::analysis
