#include "reports/experiment_commands/blind_command.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "analysis/experiment/experiment.h"
#include "analysis/walker_model/walk_folder.h"
#include "reports/diagnosis/blind_json.h"
#include "reports/diagnosis/blind_tables.h"
#include "reports/output/file_lock.h"
#include "tests/message_of.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {
namespace {

namespace fs = std::filesystem;

// Makes a run of three cases in a folder of its own, answered by a program that always says the same.
class BlindRun : public InFolder {
 protected:
  void SetUp() override {
    InFolder::SetUp();
    const fs::path tool = folder_ / "tool.sh";
    write(
        tool,
        "#!/bin/sh\n[ \"$1\" = diagnose ] || exit 2\ncat > \"$4\" <<END\n"
        "{\"verdict\":\"no_gap\",\"where\":[],\"causes\":[],\"cause_set\":[],\"shrinkage\":{\"closed\":null}}\nEND\n");
    fs::permissions(tool, fs::perms::owner_all);
    request_.folder = (folder_ / "run").string();
    request_.seed = 11;
    request_.size = {.per_effect_and_strength = 0, .none = 2, .pairs = 0, .outside = 1, .left_out_per_effect = 0};
    request_.tool = {tool.string()};
    request_.threads = 1;
    testing::internal::CaptureStdout();
  }
  void TearDown() override {
    testing::internal::GetCapturedStdout();
    InFolder::TearDown();
  }
  BlindRequest request_;
};

TEST_F(BlindRun, MakesAnswersAndOpens) {
  run_blind_make(request_);
  const fs::path cases = fs::path(request_.folder) / "cases";
  for (const char* name : {"0001", "0002", "0003"}) {
    EXPECT_EQ(read(cases / name / "seal.txt").size(), 65U);
    EXPECT_GE(analysis::read_experiment(cases / name).trials.size(), 50U);
    EXPECT_TRUE(fs::exists(request_.folder + "-sealed/" + name + ".json"));
    // Nothing of the truth is in the folder the diagnosis sees.
    EXPECT_EQ(read(cases / name / "experiment.toml").find("seed"), std::string::npos);
  }
  // Cut short and taken up again, it has the same bytes.
  const std::string before = read(cases / "0002" / "collisions.csv");
  fs::remove_all(cases / "0002");
  run_blind_make(request_);
  EXPECT_EQ(read(cases / "0002" / "collisions.csv"), before);
  BlindRequest other = request_;
  other.seed = 12;
  EXPECT_NE(message_of([&] { run_blind_make(other); }).find("belongs to a run of another seed or size"),
            std::string::npos);

  run_blind_answer(request_);
  run_blind_answer(request_);  // nothing left to do
  run_blind_open(request_);
  run_blind_open(request_);  // opening twice is no harm
  const fs::path report = fs::path(request_.folder) / "report";
  EXPECT_TRUE(fs::exists(report / "index.html"));
  EXPECT_NE(read(report / "tables" / "blind-measures.csv").find("false alarms where there is no gap,0,2,0"),
            std::string::npos);
  for (const char* id :
       {"blind-measures", "blind-stepwise", "blind-confusion", "blind-calibration", "blind-alike", "blind-cases"})
    for (const char* form : {".csv", ".md", ".tex"})
      EXPECT_TRUE(fs::exists(report / "tables" / (std::string(id) + form))) << id << form;
  EXPECT_FALSE(fs::exists(report / "figures"));
}

TEST_F(BlindRun, MakesAndOpensCasesOfWalkers) {
  request_.size = {.per_effect_and_strength = 0, .none = 1, .pairs = 0, .outside = 0, .left_out_per_effect = 0};
  request_.size.walkers = true;
  run_blind_make(request_);
  const fs::path one = fs::path(request_.folder) / "cases" / "0001";
  EXPECT_FALSE(fs::exists(one / "collisions.csv"));
  EXPECT_GE(analysis::read_walks(one)->runs.trials.size(), 25u);
  BlindRequest wheels = request_;
  wheels.size.walkers = false;
  EXPECT_NE(message_of([&] { run_blind_make(wheels); }).find("belongs to a run of another seed or size"),
            std::string::npos);
  run_blind_answer(request_);
  run_blind_open(request_);
  const std::string cases = read(fs::path(request_.folder) / "report" / "tables" / "blind-cases.csv");
  EXPECT_NE(cases.find("1,compass,none,"), std::string::npos) << cases;
}

TEST_F(BlindRun, RefusesASealedFolderThatIsNoCase) {
  run_blind_make(request_);
  const fs::path stray = fs::path(request_.folder) / "cases" / "0001 copy";
  fs::create_directories(stray);
  write(stray / "seal.txt", "");
  for (const auto command : {+run_blind_answer, +[](const BlindRequest& of) { run_blind_open(of); }})
    EXPECT_EQ(message_of([&] { command(request_); }),
              stray.string() + ": holds a seal.txt, but its name is not that of a case (0001, 0002, ...)");
}

TEST(BlindAnswer, VerdictsAreRead) {
  const auto answer = [](const std::string& verdict) {
    return R"({"verdict":")" + verdict + R"(","where":[],"causes":[],"cause_set":[],"shrinkage":{}})";
  };
  EXPECT_EQ(read_answer("a.json", answer("unexplained")).verdict, analysis::Verdict::unexplained);
  EXPECT_EQ(message_of([&] { read_answer("a.json", answer("perhaps")); }),
            "a.json: verdict: \"perhaps\" is none of no_gap, recalibrate, explained, partly_explained, unexplained");
}

// A walker's phases are what a wheel's legs are: "phase 2" is one of them, "step" all of its steps.
TEST(BlindAnswer, PhasesOfWalkersAreLegs) {
  const analysis::BlindAnswer answer = read_answer("a.json", R"({"verdict":"explained","where":[
      {"facet":"phase","aspect":"mean","at":"phase 2, half_angle_rad","p_adjusted":0.01},
      {"facet":"phase","aspect":"mean","at":"step, half_angle_rad","p_adjusted":0.02}],
      "causes":[],"cause_set":[],"shrinkage":{}})");
  EXPECT_EQ(answer.where.at(0).facet, "leg");
  EXPECT_EQ(answer.where.at(1).facet, "phase");
}

TEST(BlindTruth, WhatIsLeftOfAnOutsideEffectIsSealed) {
  analysis::BlindTruth truth;
  truth.slope_deg = analysis::Spread{3, 0.4};
  EXPECT_FALSE(read_truth("t.json", truth_json(truth, "salt")).left_of_outside);
  truth.left_of_outside = 12.5;
  EXPECT_EQ(read_truth("t.json", truth_json(truth, "salt")).left_of_outside, 12.5);
}

// No alarm in two cases is not enough to say that there are at most 9 % of them.
TEST(BlindTables, AFewCasesMeetNoBound) {
  analysis::BlindGrades grades;
  grades.grades = {{"false alarms", {0, 2}, 0, 0.05, 0.09}, {"found", {2, 2}, 0.85, 1}};
  const Table table = blind_tables(grades, {}, {}, {})[0];
  EXPECT_EQ(std::get<std::string>(table.rows[0][4].value()), "at most 5 %, its interval at most 9 %");
  EXPECT_EQ(std::get<std::string>(table.rows[0][5].value()), "open");
  EXPECT_EQ(std::get<std::string>(table.rows[1][5].value()), "met");
  EXPECT_NE(table.notes[1].find("no case at 1x"), std::string::npos);
}

TEST_F(BlindRun, RefusesChangedTruthsAndAnswersAndLateOnes) {
  run_blind_make(request_);
  for (const Unanswered unanswered : {Unanswered::refused, Unanswered::left_out})
    EXPECT_EQ(message_of([&] { run_blind_open(request_, unanswered); }),
              request_.folder +
                  ": no answer to 3 of 3 cases (0001 to 0003), and opening the truths ends the run: answer "
                  "them first (`blind answer`)");
  run_blind_answer(request_);

  const fs::path answer = fs::path(request_.folder) / "answers" / "0001.json";
  const std::string said = read(answer);
  write(answer, said + " ");
  EXPECT_NE(message_of([&] { run_blind_open(request_); }).find("the answer to case 1 was changed"), std::string::npos);
  fs::remove(answer);
  EXPECT_NE(message_of([&] { run_blind_open(request_); }).find("the answer to case 1 is missing"), std::string::npos);
  write(answer, said);

  const fs::path truth = request_.folder + "-sealed/0003.json";
  const std::string sealed = read(truth);
  write(truth, sealed + " ");
  EXPECT_NE(message_of([&] { run_blind_open(request_); }).find("the seal of case 3 is broken"), std::string::npos);
  write(truth, sealed);

  // Two of three are answered: opening the truths ends the run, so it has to be meant. The third then comes too late.
  const fs::path record = fs::path(request_.folder) / "answers" / "record.csv";
  const std::string all = read(record);
  write(record, all.substr(0, all.rfind('\n', all.size() - 2) + 1));
  EXPECT_EQ(message_of([&] { run_blind_open(request_); }),
            request_.folder +
                ": no answer to 1 of 3 cases (0003), and opening the truths ends the run: answer it first "
                "(`blind answer`), or give --partial to grade the others alone");
  EXPECT_FALSE(fs::exists(request_.folder + "-sealed/opened.csv"));
  run_blind_open(request_, Unanswered::left_out);
  EXPECT_NE(message_of([&] { run_blind_answer(request_); }).find("was opened"), std::string::npos);
  write(record, all);
  EXPECT_NE(message_of([&] { run_blind_open(request_); }).find("written after the truths had been opened"),
            std::string::npos);
}

// An interrupted `make` leaves a run that is not whole: it goes on, and until then is not opened.
TEST_F(BlindRun, CasesNotMadeYetAreMissed) {
  run_blind_make(request_);
  fs::remove_all(fs::path(request_.folder) / "cases" / "0003");
  run_blind_answer(request_);
  EXPECT_NE(message_of([&] { run_blind_open(request_); })
                .find("no answer to 1 of 3 cases (0003), and opening the truths ends the run: answer it first (`blind "
                      "make` for 0003, then `blind answer`)"),
            std::string::npos);
  run_blind_make(request_);
  run_blind_answer(request_);
  run_blind_open(request_);

  request_.folder += "-of-nothing";
  request_.size = {.per_effect_and_strength = 0, .none = 0, .pairs = 0, .outside = 0, .left_out_per_effect = 0};
  EXPECT_EQ(message_of([&] { run_blind_make(request_); }), "blind make: no case of any kind is asked for");
  EXPECT_FALSE(fs::exists(request_.folder));
}

// A case that the tool failed on is answered, and wrongly; one whose tool was killed with the program is not.
TEST_F(BlindRun, CountsWhatTheToolFailedOn) {
  run_blind_make(request_);
  const fs::path failing = folder_ / "failing.sh", answers = fs::path(request_.folder) / "answers";
  write(failing,
        "#!/bin/sh\ncase $2 in *0002) echo no >&2; exit 3;; esac\nexec " + request_.tool.front() + " \"$@\"\n");
  fs::permissions(failing, fs::perms::owner_all);
  request_.tool = {failing.string()};
  run_blind_answer(request_);
  EXPECT_EQ(read(answers / "0002.json.err"), "no\nexit code 3\n");
  write(answers / "0002.json.err", "");  // as a killed one leaves it
  EXPECT_NE(message_of([&] { run_blind_open(request_); }).find("no answer to 1 of 3 cases (0002)"), std::string::npos);
  run_blind_answer(request_);
  run_blind_open(request_);
}

TEST_F(BlindRun, SaysThatTheToolFailedOnEveryCase) {
  run_blind_make(request_);
  request_.tool = {"/bin/false"};
  run_blind_answer(request_);
  EXPECT_EQ(message_of([&] { run_blind_open(request_); }),
            request_.folder + ": the diagnosis failed on every case; see " + request_.folder + "/answers/*.err");
}

TEST_F(BlindRun, KeepsTruthsApart) {
  request_.sealed = request_.folder + "/truths";
  EXPECT_NE(message_of([&] { run_blind_make(request_); }).find("truths must be kept apart"), std::string::npos);
  EXPECT_NE(message_of([&] { run_blind_answer(request_); }).find("holds no blind case"), std::string::npos);
}

TEST_F(BlindRun, OneProcessAtATimeAnswers) {
  run_blind_make(request_);
  fs::create_directories(fs::path(request_.folder) / "answers");
  const auto answers = [&] { return message_of([&] { run_blind_answer(request_); }); };
  {
    const FileLock other(fs::path(request_.folder) / "answers" / ".lock", FileLock::Missing::create);
    EXPECT_NE(answers().find("answers: another `blind answer` is writing there"), std::string::npos);
    EXPECT_NE(message_of([&] { run_blind_open(request_, Unanswered::refused); }).find("another `blind answer`"),
              std::string::npos);
  }
  EXPECT_EQ(answers(), "nothing was thrown");
}

}  // namespace
}  // namespace metastable::reports::test
