// The files of a sweep are whole, its own, and taken up again.

#include "reports/commands/sweep_command.h"

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "reports/output/file_lock.h"
#include "reports/output/interrupt.h"
#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {

class SweepCommand : public CommandLine {
 protected:
  Ran sweep(const std::string& out, const std::string& values = "0.3,0.4") const {
    return metastable(with({"sweep", "--friction-mean", values, "--out", out}, quick));
  }
};

TEST_F(SweepCommand, FigureDoesNotTakeThePlaceOfTheNumbers) {
  const Ran ran = sweep(path("x.svg"));
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: cannot write " + path("x.svg") +
                         ": the figure beside the numbers has that name; give the numbers another ending, .csv\n");
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(SweepCommand, TwoAtOnceDoNotShareAFile) {
  {
    const FileLock other(path("s.csv.partial"), FileLock::Missing::create);
    const Ran ran = sweep(path("s.csv"));
    EXPECT_EQ(ran.code, 2);
    EXPECT_EQ(ran.err, "metastable: cannot write " + path("s.csv.partial") + ": another sweep is writing it\n");
  }
  EXPECT_EQ(sweep(path("s.csv")).code, 0);
}

// A line, a head or nothing at all was being written when the program was killed: the rest goes on from there.
TEST_F(SweepCommand, IsTakenUpWhereverItWasCutShort) {
  ASSERT_EQ(sweep(path("whole.csv")).code, 0);
  const std::string whole = read(path("whole.csv"));
  const std::size_t last_line = whole.rfind('\n', whole.size() - 2) + 1, head = whole.rfind('\n', last_line - 2) + 1;
  for (const std::size_t kept : {std::size_t{0}, std::size_t{10}, head, head + 5, last_line, last_line + 5}) {
    std::filesystem::remove(path("s.csv"));
    std::ofstream(path("s.csv.partial"), std::ios::binary) << whole.substr(0, kept);
    const Ran ran = sweep(path("s.csv"));
    EXPECT_EQ(ran.code, 0) << ran.err;
    EXPECT_EQ(read(path("s.csv")), whole);
    EXPECT_NE(ran.out.find(kept < last_line ? "(0 taken over)" : "(1 taken over)"), std::string::npos) << ran.out;
  }
}

TEST_F(SweepCommand, OfTooManyPointsIsRefused) {
  const Ran ran = metastable(
      {"sweep", "--friction-mean", "0.3:0.4:0.00001", "--friction-sd", "0.1:0.2:0.00001", "--out", path("s.csv")});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: sweep: more than 1000000 points; take coarser steps\n");
}

TEST_F(SweepCommand, CutShortIsTakenUpAgainToTheSameBytes) {
  const std::vector<std::string> words =
      with({"sweep", "--friction-sd", "0.1:0.2:0.05", "--friction-mean", "0.3,0.4"}, quick);
  ASSERT_EQ(metastable(with(words, {"--out", path("whole.csv")})).code, 0);
  const std::string whole = read(path("whole.csv"));
  EXPECT_TRUE(std::filesystem::exists(path("whole.svg")));
  // It is cut in the middle of the fifth row.
  std::size_t at = 0;
  for (int line = 0; line < 9; ++line) at = whole.find('\n', at) + 1;
  std::ofstream(path("part.csv.partial")) << whole.substr(0, at + 5);
  const Ran resumed = metastable(with(words, {"--out", path("part.csv"), "--threads", "1"}));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.out.find("(4 taken over)"), std::string::npos) << resumed.out;
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

TEST_F(SweepCommand, CutShortByASignalSaysWhatItKept) {
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

TEST_F(SweepCommand, SaysWhatRigidBodiesGive) {
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

TEST_F(SweepCommand, LaunchesAreSteadyWhereThePaperHasNone) {
  const Ran ran = metastable(with(
      {"sweep", "--law", "published", "--slope", "0.1,7,8", "--friction-sd", "0.02", "--out", path("s.csv")}, quick));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(read(path("s.csv")).find("0.1,0.02,,,,,,,,,no_regime\n"), std::string::npos) << read(path("s.csv"));
}

// A wrong option, key or value gives exit code 2 and one line that names it and what is allowed.
TEST_F(SweepCommand, WrongInputIsOneLineAndCodeTwo) {
  expect_refused({
      {{"sweep", "--friction-mean", "0.2,0.3", "--contact-list", file("ok.csv", "restitution,friction\n0.4,0.3\n")},
       "--friction-mean: cannot vary with --contact-list"},
      {{"sweep"}, "no range given"},
      {{"sweep", "--slope", "5:12:0"}, "--slope: range 5:12:0"},
      {{"sweep", "--slope", "5:30:5", "--initial-speed", "7,0.1", "--out", path("s.csv")},
       "--slope: 30 is outside [0.001, 22.5)"},
      {{"sweep", "--method", "integrated", "--friction-sd", "0.0005,0.1", "--out", path("s.csv")},
       "friction: sd 0.0005 is too narrow for method integrated"},
      {{"sweep", "--slope", "7:8:1", "--initial-speed", "7,0.1", "--out", path("")}, "is a folder"},
      {{"sweep", "--slope", "7:8:1", "--initial-speed", "7,0.1", "--out", path("no/s.csv")}, "no/s.csv"},
  });
  EXPECT_FALSE(std::filesystem::exists(path("s.csv")));
}

}  // namespace
}  // namespace metastable::reports::test
