#pragma once
// Names a folder of temporary files that no other test uses: tests run side by side, each in a process.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

namespace metastable::test {

/// Returns the path of the running test's own folder, which need not exist: its name holds suite, test and process.
inline std::filesystem::path own_folder() {
  const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
  std::string name =
      std::string("metastable_") + test.test_suite_name() + "_" + test.name() + "_" + std::to_string(::getpid());
  std::replace(name.begin(), name.end(), '/', '_');
  return std::filesystem::temp_directory_path() / name;
}

}  // namespace metastable::test
