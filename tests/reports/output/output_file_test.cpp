#include "reports/output/output_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <iterator>
#include <string>

#include "tests/message_of.h"
#include "tests/reports/support.h"

namespace metastable::reports {
namespace {
namespace fs = std::filesystem;
using test::read;

class OutputFileTest : public test::InFolder {
 protected:
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
};

TEST_F(OutputFileTest, TargetAppearsOnlyOnCommit) {
  const fs::path target = folder_ / "a.csv";
  OutputFile file(target);
  file.stream() << "one," << 2 << '\n' << std::flush;
  EXPECT_FALSE(fs::exists(target));
  file.commit();
  EXPECT_EQ(read(target), "one,2\n");
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, WithoutCommitNothingChanges) {
  const fs::path target = folder_ / "a.csv";
  write_file(target, "old");
  { OutputFile(target).stream() << "half"; }
  EXPECT_EQ(read(target), "old");
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, TwoWritersOfOneTargetDoNotMix) {
  const fs::path target = folder_ / "a.csv";
  OutputFile first(target);
  OutputFile second(target);
  first.stream() << "first";
  second.stream() << "second";
  second.commit();
  first.commit();
  EXPECT_EQ(read(target), "first");
  EXPECT_EQ(files(), 1u);
}

// A killed writer leaves its temporary, which goes when the target is written again.
TEST_F(OutputFileTest, SweepsUpWhatAKilledWriterLeft) {
  EXPECT_EXIT(
      {
        OutputFile file(folder_ / "a.csv");
        file.stream() << "half" << std::flush;
        ::kill(::getpid(), SIGKILL);
      },
      testing::KilledBySignal(SIGKILL), "");
  EXPECT_EQ(files(), 1u);
  write_file(folder_ / ".a.csv.notes.tmp", "not ours");
  OutputFile another(folder_ / "a.csv");  // its writer lives
  write_file(folder_ / "a.csv", "whole");
  EXPECT_EQ(files(), 3u);
  another.stream() << "other";
  another.commit();
  EXPECT_EQ(read(folder_ / "a.csv"), "other");
  EXPECT_EQ(files(), 2u);
}

TEST_F(OutputFileTest, FollowsASymbolicLink) {
  write_file(folder_ / "real", "old");
  fs::create_symlink("real", folder_ / "link");
  write_file(folder_ / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(read(folder_ / "real"), "new");
}

TEST_F(OutputFileTest, AFolderBehindABrokenLinkIsRefused) {
  fs::create_symlink("nowhere", folder_ / "link");
  EXPECT_THROW(OutputFolder(folder_ / "link"), OutputError);
}

TEST_F(OutputFileTest, ADeviceIsWrittenToNotReplaced) {
  write_file("/dev/null", "gone");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(OutputFileTest, DashIsStandardOutput) {
  testing::internal::CaptureStdout();
  {
    OutputFile abandoned("-");
    abandoned.stream() << "half";
  }
  write_file("-", "{}\n");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "{}\n");
}

TEST_F(OutputFileTest, ErrorsNamePathAndReason) {
  const auto message = [](const fs::path& path) -> std::string {
    return message_of<OutputError>([&] { write_file(path, "x"); });
  };
  const fs::path missing = folder_ / "missing" / "a.csv";
  EXPECT_EQ(message(missing), "cannot write " + missing.string() + ": No such file or directory");
  EXPECT_EQ(message(folder_), "cannot write " + folder_.string() + ": Is a directory");
  EXPECT_EQ(message(""), "cannot write '': the name is empty");
  EXPECT_EQ(message("/dev/full"), "cannot write /dev/full: No space left on device");
}

TEST_F(OutputFileTest, MakesFolders) {
  make_folder(folder_ / "a" / "b");
  EXPECT_TRUE(fs::is_directory(folder_ / "a" / "b"));
  EXPECT_NO_THROW(make_folder(folder_ / "a" / "b"));
  write_file(folder_ / "file", "x");
  EXPECT_THROW(make_folder(folder_ / "file"), OutputError);
  EXPECT_THROW(make_folder(folder_ / "file" / "below"), OutputError);
}

TEST_F(OutputFileTest, FolderAppearsWholeOrNotAtAll) {
  const fs::path target = folder_ / "run";
  {
    OutputFolder folder(target);
    write_file(folder.path() / "a.csv", "a");
  }
  EXPECT_EQ(files(), 0u);
  for (const bool empty_target : {false, true}) {
    if (empty_target) fs::create_directory(target);
    OutputFolder folder(target);
    write_file(folder.path() / "a.csv", "a");
    EXPECT_FALSE(fs::exists(target / "a.csv"));
    folder.commit("a.csv");
    EXPECT_EQ(read(target / "a.csv"), "a");
    EXPECT_EQ(files(), 1u);
    fs::remove_all(target);
  }
  // They go beside what somebody keeps there.
  fs::create_directory(target);
  write_file(target / "notes.txt", "mine");
  {
    OutputFolder folder(target.string() + "/");
    write_file(folder.path() / "a.csv", "a");
    write_file(folder.path() / "b.csv", "b");
    folder.commit("a.csv");
  }
  EXPECT_EQ(read(target / "notes.txt") + read(target / "a.csv") + read(target / "b.csv"), "mineab");
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, FolderOfAKilledWriterGoesWithTheNext) {
  EXPECT_EXIT(
      {
        OutputFolder folder(folder_ / "run");
        write_file(folder.path() / "a.csv", "half");
        kill(getpid(), SIGKILL);
      },
      testing::KilledBySignal(SIGKILL), "");
  EXPECT_EQ(files(), 1u);
  EXPECT_FALSE(fs::exists(folder_ / "run"));
  OutputFolder folder(folder_ / "run");
  write_file(folder.path() / "a.csv", "whole");
  folder.commit("a.csv");
  EXPECT_EQ(read(folder_ / "run" / "a.csv"), "whole");
  EXPECT_EQ(files(), 1u);
}

}  // namespace
}  // namespace metastable::reports
