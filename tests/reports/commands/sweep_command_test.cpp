// The files of a sweep are whole, its own, and taken up again.

#include "reports/commands/sweep_command.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "reports/output/file_lock.h"
#include "tests/reports/program.h"
#include "tests/reports/support.h"

namespace metastable::reports {
namespace {
using test::metastable;
using test::Ran;
using test::read;

class Sweep : public test::InFolder {
 protected:
  Ran sweep(const std::string& out, const std::string& values = "0.3,0.4") const {
    return metastable({"sweep", "--friction-mean", values, "--legs", "0.1519", "--cells", "32", "--samples", "256",
                       "--replicates", "2", "--out", out});
  }
};

TEST_F(Sweep, FigureDoesNotTakeThePlaceOfTheNumbers) {
  const Ran ran = sweep(path("x.svg"));
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: cannot write " + path("x.svg") +
                         ": the figure beside the numbers has that name; give the numbers another ending, .csv\n");
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(Sweep, TwoAtOnceDoNotShareAFile) {
  {
    const FileLock other(path("s.csv.partial"), FileLock::Missing::create);
    const Ran ran = sweep(path("s.csv"));
    EXPECT_EQ(ran.code, 2);
    EXPECT_EQ(ran.err, "metastable: cannot write " + path("s.csv.partial") + ": another sweep is writing it\n");
  }
  EXPECT_EQ(sweep(path("s.csv")).code, 0);
}

// A line, a head or nothing at all was being written when the program was killed: the rest goes on from there.
TEST_F(Sweep, IsTakenUpWhereverItWasCutShort) {
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

TEST_F(Sweep, OfTooManyPointsIsRefused) {
  const Ran ran = metastable(
      {"sweep", "--friction-mean", "0.3:0.4:0.00001", "--friction-sd", "0.1:0.2:0.00001", "--out", path("s.csv")});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: sweep: more than 1000000 points; take coarser steps\n");
}

}  // namespace
}  // namespace metastable::reports
