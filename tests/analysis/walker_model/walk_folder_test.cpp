// Folders of walks: what is drawn is read, and bad files are named with their place.

#include "analysis/walker_model/walk_folder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>
#include <string>

#include "analysis/blind/effect_power.h"
#include "analysis/experiment/input_error.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/walker_model/walker_experiment.h"
#include "dynamics/catalogue/walker_effects.h"
#include "tests/analysis/diagnosed.h"
#include "tests/message_of.h"
#include "tests/own_folder.h"

namespace metastable::analysis::test {
namespace {

namespace fs = std::filesystem;

class WalkFolder : public ::testing::Test {
 protected:
  WalkFolder() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~WalkFolder() override { fs::remove_all(folder_); }

  void write(const WalkFiles& files) const {
    put("experiment.toml", files.experiment_toml);
    put("steps.csv", files.steps_csv);
    put("trials.csv", files.trials_csv);
  }
  void put(const char* name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  std::string refused() const {
    return message_of<InputError>([&] { read_walks(folder_); });
  }

  const fs::path folder_ = metastable::test::own_folder();
};

WalkFiles drawn(const std::vector<std::pair<std::string, double>>& effects = {}, std::size_t trials = 6,
                Walker walker = Walker::compass) {
  WalkerSetting setting{walker, walker_slope_deg(walker), walker == Walker::compass ? 0.3 : 0.05,
                        dynamics::Terrain::fresh};
  WalkOptions options;
  options.trials = trials;
  options.longest = 12;
  return draw_walks(setting, effects, options, "drawn");
}

TEST_F(WalkFolder, HoldsWhatWasDrawn) {
  for (const Walker walker : {Walker::compass, Walker::simplest}) {
    write(drawn({}, 6, walker));
    const auto walks = read_walks(folder_);
    ASSERT_TRUE(walks);
    EXPECT_EQ(walks->title, "drawn");
    EXPECT_EQ(walks->machine->name, walker_name(walker));
    EXPECT_EQ(walks->machine->observe.size(), walker == Walker::compass ? 3u : 2u);
    ASSERT_EQ(walks->runs.trials.size(), 6u);
    EXPECT_TRUE(walks->runs.trials[5].outcome.has_value());
    EXPECT_EQ(walks->runs.trials[1].rows.front().phase, 1) << "trials take turns with the leg they start from";
  }
}

TEST_F(WalkFolder, AnotherSystemIsNoFolderOfWalks) {
  put("experiment.toml", "title = \"a wheel\"\n");
  EXPECT_FALSE(read_walks(folder_));
}

TEST_F(WalkFolder, WhatIsWrongIsNamedWithItsPlace) {
  const WalkFiles files = drawn();
  const auto with = [&](std::string WalkFiles::*which, const std::string& from, const std::string& to) {
    WalkFiles changed = files;
    std::string& text = changed.*which;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    write(changed);
    return refused();
  };
  const auto has = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  has(with(&WalkFiles::experiment_toml, "\"compass\"", "\"biped\""), "none of \"compass\", \"simplest\"");
  has(with(&WalkFiles::experiment_toml, "[machine]", "[machine"), "experiment.toml:");
  EXPECT_EQ(refused().find("collisions.csv"), std::string::npos);
  has(with(&WalkFiles::experiment_toml, "mean = 3", "mean = 50"), "slope_deg.mean: 50 is outside [0, 45)");
  has(with(&WalkFiles::experiment_toml, "half_angle_rad =", "half_angle ="), "unknown key 'half_angle' in columns");
  has(with(&WalkFiles::steps_csv, ",0.27", ",15.5"), "half_angle_rad: 15.5");
  has(with(&WalkFiles::steps_csv, "1,2,2,", "1,3,2,"), "step: 3 is not due: step 2 of trial 1 is");
  has(with(&WalkFiles::steps_csv, "1,2,2,", "1,2,3,"), "phase: 3 is outside 1..2");
  has(with(&WalkFiles::steps_csv, "1,2,2,", "1,2,R,"),
      "phase: 'R' is not a whole number in 1..2; write 1 where leg 1 stands and 2 where leg 2 does");
  has(with(&WalkFiles::steps_csv, "swing_rate_rad_s", "swing"), "swing");
  has(with(&WalkFiles::trials_csv, "stopped", "halted"), "'halted' is none of failed, stopped, lost");
  has(with(&WalkFiles::trials_csv, "\n6,", "\n7,"), "steps.csv has no trial 7");
}

TEST_F(WalkFolder, LegsTakeTurnsWhereBothAreNamed) {
  WalkFiles files = drawn({}, 1, Walker::simplest);
  files.trials_csv = "trial,outcome\n1,stopped\n";
  const auto with = [&](const std::string& phases) {
    files.steps_csv = "trial,step,phase,half_angle_rad,stance_rate_rad_s\n";
    for (std::size_t k = 0; k < phases.size(); ++k)
      files.steps_csv += fmt::format("1,{},{},0.2,-0.2\n", k + 1, phases[k] == ' ' ? "" : phases.substr(k, 1));
    write(files);
    return read_walks(folder_)->runs.trials.front().rows.size();
  };
  const auto refusal = [&](const std::string& phases) { return message_of<InputError>([&] { with(phases); }); };
  const std::string file = (folder_ / "steps.csv").string();
  EXPECT_EQ(refusal("121221"),
            file + ":6:5: phase: leg 2 does not stand after leg 2: a row is missing, or out of order");
  EXPECT_EQ(refusal("12 1"),
            file + ":5:5: phase: leg 1 does not stand 2 rows after leg 2: a row is missing, or out of order");
  for (const char* phases : {"2121", "12 2", "1111", "    "}) EXPECT_EQ(with(phases), 4u) << phases;
}

// Columns that mean something else than their names say are likelier than a walker that falls at every step.
TEST_F(WalkFolder, SaysWhatToCheckWhereTheWalkerFailsFromMostRows) {
  for (const Walker walker : {Walker::compass, Walker::simplest}) {
    write(drawn({}, 6, walker));
    Walks walks = *read_walks(folder_);
    for (MachineTrial& trial : walks.runs.trials)
      for (MachineRow& row : trial.rows) row.seen[1] *= -1;
    const std::string message = message_of<std::invalid_argument>([&] { diagnose_walks(walks, {}); });
    const char* gait = walker == Walker::compass ? "half_angle_rad is 0.271, stance_rate_rad_s is -1.09, swing_rate_"
                                                 : "half_angle_rad is 0.2, stance_rate_rad_s is -0.2;";
    EXPECT_NE(message.find(gait), std::string::npos) << message;
    EXPECT_NE(message.find("check that angles are in radians, that half_angle_rad is half the angle between the legs, "
                           "and the signs of the rates"),
              std::string::npos)
        << message;
  }
}

TEST_F(WalkFolder, WithoutAKnownModelOneSentenceSaysWhatToWrite) {
  for (const char* stated : {"model = \"biped\"\n", ""}) {
    WalkFiles files = drawn();
    const std::string was = "model = \"compass\"\n";
    files.experiment_toml.replace(files.experiment_toml.find(was), was.size(), stated);
    write(files);
    const std::string message = refused();
    EXPECT_NE(message.find("write model = \"compass\" or model = \"simplest\" below [machine]"), std::string::npos)
        << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST_F(WalkFolder, AMachineOfOnesOwnIsSaidToBeReadFromPython) {
  put("experiment.toml", "system = \"machine\"\n[machine]\nmodel = \"none\"\n");
  put("steps.csv", "trial,step,x\n1,1,1.5\n");
  EXPECT_EQ(refused(), (folder_ / "experiment.toml").string() +
                           ":3:9: model = \"none\" is a machine of your own: read it from Python, "
                           "metastable.diagnose(metastable.runs(machine, \"" +
                           folder_.string() + "\"), machine)");
}

TEST_F(WalkFolder, LabelsHaveNamesOfTheirOwn) {
  const auto with = [&](const std::string& labels) {
    WalkFiles files = drawn();
    const std::string model = "model = \"compass\"\n";
    files.experiment_toml.insert(files.experiment_toml.find(model) + model.size(), "labels = " + labels + "\n");
    write(files);
    return refused();
  };
  const std::string file = (folder_ / "experiment.toml").string() + ": labels: ";
  for (const char* own : {"half_angle_rad", "condition", "trial", "step", "phase", "time_s", "position_m"})
    EXPECT_EQ(with("[\"" + std::string(own) + "\"]"),
              file + "'" + own + "' is a column of its own: a label needs another name");
  EXPECT_EQ(with("[\"a\", \"a\"]"), file + "'a' is there twice");
  EXPECT_EQ(with("[\"\"]"), file + "a name is empty");
  EXPECT_NE(with("[\"floor\"]").find("there is no column floor, which experiment.toml states"), std::string::npos);
}

TEST_F(WalkFolder, CollisionsBesideStepsAreAnotherMachines) {
  write(drawn());
  put("collisions.csv", "trial,collision,speed_rad_s\n1,1,2\n");
  const std::string message = refused();
  EXPECT_NE(message.find("collisions.csv: collisions are a wheel's, but experiment.toml states walks"),
            std::string::npos)
      << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

TEST_F(WalkFolder, AWalkersEffectsAreThoseThatItsWalksMayHave) {
  const auto ids = [](Walker walker) {
    std::set<std::string> all;
    for (const dynamics::EffectInfo& info : effects_known_to(walker)) all.insert(info.id);
    return all;
  };
  std::set<std::string> lacks;
  std::ranges::set_difference(ids(Walker::compass), ids(Walker::simplest), std::inserter(lacks, lacks.end()));
  EXPECT_EQ(lacks,
            (std::set<std::string>{"launch_spread_swing_rate_rad_s", "launch_swing_rate_rad_s", "leg_length",
                                   "leg_mass", "sensor_bias_swing_rate_rad_s", "sensor_noise_swing_rate_rad_s"}));
  EXPECT_EQ(ids(Walker::compass).size(), dynamics::walker_effects().size());
  EXPECT_EQ(effects_known_to(Walker::simplest).front().parameters.front().upper, 2) << "its own bounds of hip_damping";
  EXPECT_EQ(effects_known_to(Walker::simplest).front().parameters.front().unit, "");
}

TEST_F(WalkFolder, StatesWhereWalksBeginWhateverAnEffectDoesToThem) {
  const WalkFiles plain = drawn(), moved = drawn({{"launch_half_angle_rad.offset", 0.01}});
  EXPECT_EQ(moved.experiment_toml, plain.experiment_toml);
  write(moved);
  const Walks walks = *read_walks(folder_);
  const MachineLaunch* stated = walks.machine->stated_launch("half_angle_rad");
  ASSERT_NE(stated, nullptr);
  EXPECT_EQ(stated->sd, 0);
  for (const MachineTrial& trial : walks.runs.trials)
    EXPECT_NEAR(trial.rows.front().seen[0], stated->mean + 0.01, 5 * 0.0005);
  EXPECT_NE(message_of<std::invalid_argument>([] {
              drawn({{"launch_half_angle_rad.offset", 0.2}});
            }).find("--effect: launch_half_angle_rad.offset: 0.2 is outside [-0.1, 0.1]"),
            std::string::npos);
}

TEST_F(WalkFolder, ALaunchIsReadAndItsDefectsAreNamed) {
  WalkFiles files = drawn();
  const std::size_t at = files.experiment_toml.find("[launch]");
  ASSERT_NE(at, std::string::npos);
  const std::string before = files.experiment_toml.substr(0, at);
  const auto with = [&](const std::string& launch) {
    files.experiment_toml = before + launch;
    write(files);
  };
  with("");
  EXPECT_EQ(read_walks(folder_)->machine->stated_launch("half_angle_rad"), nullptr);
  with("[launch]\nstance_rate_rad_s = { mean = -1.1, sd = 0.02 }\n");
  const Walks walks = *read_walks(folder_);
  EXPECT_EQ(walks.machine->stated_launch("stance_rate_rad_s")->sd, 0.02);
  EXPECT_EQ(walks.machine->stated_launch("half_angle_rad"), nullptr) << "the gait's is assumed";
  with("[launch]\nstance_rate_rad_s = { mean = -1.1, sd = -0.02 }\n");
  EXPECT_NE(refused().find("launch.stance_rate_rad_s.sd: -0.02 is outside [0, 30]"), std::string::npos) << refused();
  with("[launch]\nstance_rate_rad_s = { mean = -1.1, sd = 50 }\n");
  EXPECT_NE(refused().find("launch.stance_rate_rad_s.sd: 50 is outside [0, 30]"), std::string::npos) << refused();
  for (const char* mean : {"-0.27", "0", "1.6"}) {
    with(std::string("[launch]\nhalf_angle_rad = { mean = ") + mean + ", sd = 0.02 }\n");
    const std::string said = std::string("launch.half_angle_rad.mean: ") + mean + " is outside (0, 1.5708)";
    EXPECT_NE(refused().find(said), std::string::npos) << refused();
  }
  with("[launch]\nstance_rate = { mean = -1.1, sd = 0.02 }\n");
  EXPECT_NE(refused().find("unknown key 'stance_rate' in launch"), std::string::npos) << refused();
}

// Catalogues are short here, so that a diagnosis takes a second; all launches are 0.05 rad/s off.
TEST_F(WalkFolder, LaunchesThatAreNotThoseStatedAreNamed) {
  WalkOptions options;
  options.trials = 12;
  options.longest = 8;
  WalkerSetting setting{Walker::compass, 3, 0.3, dynamics::Terrain::fresh};
  write(draw_walks(setting, {{"launch_stance_rate_rad_s.offset", 0.05}}, options, "drawn"));
  DiagnosisOptions study;
  study.catalogue = {"launch_stance_rate_rad_s", "launch_half_angle_rad", "impact_loss",
                     "sensor_bias_stance_rate_rad_s"};
  const Diagnosis d = diagnose_walks(*read_walks(folder_), study);
  ASSERT_FALSE(d.causes.at_work.empty());
  EXPECT_EQ(d.causes.at_work[0].name, "launch_stance_rate_rad_s");
  EXPECT_GT(d.causes.at_work[0].probability, 0.8);
  const EstimatedParameter& offset = d.causes.at_work[0].parameters[0];
  EXPECT_NEAR(offset.value, 0.05, 0.01);
  EXPECT_LT(offset.upper - offset.lower, 0.02);
  std::set<std::string> criteria;
  for (const StepwiseChoice& choice : d.causes.stepwise) criteria.insert(choice.criterion);
  EXPECT_EQ(criteria, (std::set<std::string>{"AICc", "BIC", "Gauss-Newton AICc", "Gauss-Newton BIC"}));
}

TEST_F(WalkFolder, EffectsThatTheMachineLacksAreRefused) {
  EXPECT_NE(message_of<std::invalid_argument>([] {
              drawn({{"hip_dampng.damping", 0.1}});
            }).find("did you mean"),
            std::string::npos);
  EXPECT_NE(message_of<std::invalid_argument>([] {
              drawn({{"hip_damping.damping", 9}});
            }).find("[0, 5]"),
            std::string::npos);
}

TEST_F(WalkFolder, UnknownEffectsOfACatalogueHintAtTheNearest) {
  write(drawn());
  DiagnosisOptions options;
  options.catalogue = {"leg_mas"};
  const std::string message = message_of<std::invalid_argument>([&] { diagnose_walks(*read_walks(folder_), options); });
  EXPECT_NE(message.find("catalogue: 'leg_mas' is none of hip_damping"), std::string::npos) << message;
  EXPECT_NE(message.find("did you mean 'leg_mass'"), std::string::npos) << message;
}

TEST_F(WalkFolder, HasTheSameBytesOnAnyNumberOfThreads) {
  WalkerSetting setting{Walker::compass, 3, 0.3, dynamics::Terrain::fresh};
  WalkOptions one, four;
  one.trials = four.trials = 9;
  one.longest = four.longest = 6;
  one.threads = 1;
  four.threads = 4;
  const std::vector<std::pair<std::string, double>> effects{{"leg_length.longer", 0.01}};
  EXPECT_EQ(draw_walks(setting, effects, one, "").steps_csv, draw_walks(setting, effects, four, "").steps_csv);
  const auto laboratory = walker_laboratory(setting, {}, one);
  EXPECT_EQ(laboratory_walks(laboratory, run_walks(laboratory, one), {}, {}).steps_csv,
            laboratory_walks(laboratory, run_walks(laboratory, four), {}, {}).steps_csv);
}

TEST_F(WalkFolder, TheLaboratorysWalksAreReadWithWhatIsTold) {
  WalkStatement statement{"laboratory", {}, {}};
  WalkOptions options;
  options.trials = 4;
  options.longest = 8;
  const auto laboratory = walker_laboratory(statement.walker.setting, {}, options);
  const auto trials = run_walks(laboratory, options);
  write(laboratory_walks(laboratory, trials, statement, {}));
  const Walks all = *read_walks(folder_);
  EXPECT_TRUE(all.runs.timed());
  EXPECT_TRUE(all.runs.placed());
  EXPECT_EQ(all.machine->inputs, std::vector<std::string>{"stance_leg"});
  ASSERT_EQ(all.runs.trials.size(), 4u);
  EXPECT_EQ(all.runs.trials[1].rows.size(), trials[1].rows.size());
  EXPECT_NEAR(all.runs.trials[1].rows[2].seen[0], trials[1].rows[2].seen.half_angle, 1e-8);
  write(laboratory_walks(laboratory, trials, statement, {"phase", "time_s", "position_m"}));
  const Walks less = *read_walks(folder_);
  EXPECT_FALSE(less.runs.timed());
  EXPECT_FALSE(less.runs.placed());
  EXPECT_TRUE(less.machine->inputs.empty());
  EXPECT_NE(message_of<std::invalid_argument>([&] {
              laboratory_walks(laboratory, trials, statement, {"leg"});
            }).find("--drop: 'leg' is none of phase, time_s, position_m, outcome"),
            std::string::npos);
}

// An effect of next to no size leaves the likelihood as it was: one that costs something by being there is never named.
TEST_F(WalkFolder, EffectsBeginAtNothing) {
  write(drawn());
  const auto walks = read_walks(folder_);
  const auto model = machine_transitions(walks->machine, walks->runs);
  const std::vector<double> nuisance = nominal_values(*model);
  const double without = model->evaluate(nuisance, std::vector<EffectTerm>{}).total();
  int tried = 0;
  for (const dynamics::EffectInfo& info : dynamics::walker_effects()) {
    const auto candidate = std::ranges::find(model->candidates(), info.id, &Candidate::id);
    if (candidate == model->candidates().end() || !candidate->undecidable.empty()) continue;
    std::vector<double> values;
    for (const dynamics::EffectParameter& p : info.parameters)
      values.push_back(*p.neutral + (p.place ? 0 : 1e-9 * p.upper));
    const EffectTerm term = fitted_term(*model, {info.id, values});
    EXPECT_NEAR(model->evaluate(nuisance, std::vector{term}).total(), without, 1e-3) << info.id;
    ++tried;
  }
  EXPECT_GT(tried, 20);
}

// One leg has more mass: the diagnosis names it with its size.
TEST_F(WalkFolder, OneHeavierLegIsNamed) {
  write(drawn({{"leg_mass.mass_ratio", 1.08}}));
  DiagnosisOptions options;
  options.catalogue = {"leg_mass", "impact_loss", "slope_deg_drift"};
  const auto walks = read_walks(folder_);
  const Diagnosis answer = decided(*machine_transitions(walks->machine, walks->runs), options);
  EXPECT_EQ(answer.verdict, Verdict::explained);
  ASSERT_FALSE(answer.causes.ranked.empty());
  EXPECT_EQ(answer.causes.ranked.front().name(), "leg_mass");
}

}  // namespace
}  // namespace metastable::analysis::test
