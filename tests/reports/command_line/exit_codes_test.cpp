// Checks how the program ends where it cannot do its work: with the codes it documents, and never by waiting.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {

class ExitCodes : public InFolder {
 protected:
  std::string pipe(const std::string& name) const {
    ::mkfifo(path(name).c_str(), 0600);
    return path(name);
  }
};

// It runs in a process of its own: the stream stays broken.
void run_into_full_device(const std::vector<std::string>& words) {
  ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO);
  ::_exit(run(words));
}

TEST_F(ExitCodes, FullDeviceIsTwoAndALine) {
  const std::string full = "cannot write standard output: No space left on device";
  EXPECT_EXIT(run_into_full_device({"--help"}), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device({"--version"}), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device({"steps", "--help"}), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device({"effects"}), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device({"effects", "--json", "-"}), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device(with({"steps"}, quick)), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device(with({"compare"}, quick)), testing::ExitedWithCode(2), full);
  EXPECT_EXIT(run_into_full_device({"simulate", "--trials", "3", "--out", path("made")}), testing::ExitedWithCode(2),
              full);
  // A file does likewise.
  const Ran ran = metastable({"effects", "--json", "/dev/full"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: cannot write /dev/full: No space left on device\n");
}

TEST_F(ExitCodes, FullDeviceIsNoPlaceForASweep) {
  const Ran ran = metastable(with({"sweep", "--friction-mean", "0.3,0.4", "--out", "/dev/full"}, quick));
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err,
            "metastable: cannot write /dev/full: is no regular file, from which a sweep could be taken up again\n");
}

// Sends Ctrl-C or its like a while after the program has begun to wait; without it the program would wait for ever.
void run_and_signal(const std::vector<std::string>& words, int signal) {
  ::alarm(20);
  std::thread([signal] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    ::kill(::getpid(), signal);
  }).detach();
  ::_exit(run(words));
}

TEST_F(ExitCodes, PipesThatNobodyWritesToOrReadsEndAtASignal) {
  EXPECT_EXIT(run_and_signal({"steps", "--config", pipe("a")}, SIGINT), testing::ExitedWithCode(130), "interrupted");
  EXPECT_EXIT(run_and_signal({"steps", "--contact-list", pipe("b")}, SIGTERM), testing::ExitedWithCode(143),
              "terminated");
  EXPECT_EXIT(run_and_signal({"coast-down", pipe("c"), "--out", path("drum")}, SIGINT), testing::ExitedWithCode(130),
              "interrupted");
  EXPECT_EXIT(run_and_signal({"effects", "--json", pipe("d")}, SIGTERM), testing::ExitedWithCode(143), "terminated");
}

// A limit ends the wait with a sentence, and changes no number where it is not reached.
TEST_F(ExitCodes, TimeLimitIsThreeAndASentence) {
  for (const std::vector<std::string>& words : {with({"steps"}, quick),
                                                with({"steps", "--law", "coulomb"}, quick),
                                                {"steps", "--walker", "simplest", "--slope-sd", "0.1"}}) {
    std::vector<std::string> limited = words;
    limited.insert(limited.end(), {"--time-limit", "1e-9", "--json", path("none.json")});
    const Ran ran = metastable(limited);
    EXPECT_EQ(ran.code, 3) << ran.out;
    EXPECT_NE(ran.err.find("the time limit of 1e-09 s is reached at "), std::string::npos) << ran.err;
    EXPECT_EQ(ran.out, "");
    EXPECT_FALSE(std::filesystem::exists(path("none.json")));
  }
  EXPECT_EQ(metastable({"steps", "--time-limit", "0"}).code, 2);
  ASSERT_EQ(metastable(with({"steps", "--time-limit", "1e8", "--json", path("with.json")}, quick)).code, 0);
  ASSERT_EQ(metastable(with({"steps", "--json", path("without.json")}, quick)).code, 0);
  EXPECT_EQ(read(path("with.json")), read(path("without.json")));
}

TEST_F(ExitCodes, PipesAreReadToTheirEnd) {
  std::thread writer([name = pipe("config")] {
    std::ofstream out(name);
    out << "slope = 7.02\n" << std::flush;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    out << "slop = 3\n";
  });
  const Ran ran = metastable({"steps", "--config", path("config")});
  writer.join();
  EXPECT_EQ(ran.code, 2);
  EXPECT_NE(ran.err.find("config:2: unknown key 'slop'"), std::string::npos) << ran.err;
}

TEST_F(ExitCodes, ExperimentIsMadeOfFiles) {
  std::filesystem::create_directory(path("data"));
  pipe("data/experiment.toml");
  const Ran ran = metastable({"describe", path("data")});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: " + path("data/experiment.toml") + ": cannot be read: it is no regular file\n");
}

TEST_F(ExitCodes, DevicesAreNotRead) {
  const Ran ran = metastable({"steps", "--config", "/dev/zero"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.err, "metastable: /dev/zero: cannot be read: it is neither a file nor a pipe\n");
}

// What is no user's error has a code too, and no other than those documented.
TEST_F(ExitCodes, MissingGnuplotIsThree) {
  const auto without_programs = [&] {
    ::setenv("PATH", path("empty").c_str(), 1);
    ::_exit(run(with({"sweep", "--friction-mean", "0.3,0.4", "--out", path("s.csv")}, quick)));
  };
  EXPECT_EXIT(without_programs(), testing::ExitedWithCode(3), "gnuplot, which draws the figures, was not found");
}

}  // namespace
}  // namespace metastable::reports::test
