#include "reports/commands/doctor_command.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/reports/support.h"

namespace metastable::reports {
namespace {

class Doctor : public test::InFolder {
 protected:
  // Puts a script before all other programs of that name.
  void put(const std::string& name, const std::string& script) {
    std::ofstream(folder_ / name) << "#!/bin/sh\n" << script << "\n";
    std::filesystem::permissions(folder_ / name, std::filesystem::perms::owner_all);
    ::setenv("PATH", (folder_.string() + ":" + path_).c_str(), 1);
  }
  void TearDown() override {
    ::setenv("PATH", path_.c_str(), 1);
    test::InFolder::TearDown();
  }
  const std::string path_ = std::getenv("PATH");
};

TEST_F(Doctor, EndsAProgramThatDoesNotAnswer) {
  put("gnuplot", "sleep 60");
  put("python3", "sleep 60 & wait");
  const auto begin = std::chrono::steady_clock::now();
  const std::string said = test::printed([] { run_doctor("", 0.1); });
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
  EXPECT_NE(said.find("gnuplot: did not answer within 0.1 s and was ended\n"), std::string::npos) << said;
  EXPECT_NE(said.find("python_module: did not answer within 0.1 s and was ended\n"), std::string::npos) << said;
}

TEST_F(Doctor, SaysWhichGnuplotThereIs) {
  put("gnuplot", "echo gnuplot 9.9 patchlevel 9");
  const std::string said = test::printed([] { run_doctor(""); });
  EXPECT_NE(said.find("gnuplot: gnuplot 9.9 patchlevel 9, which draws the figures\n"), std::string::npos) << said;
}

}  // namespace
}  // namespace metastable::reports
