#pragma once
// Runs the program as its users meet it: arguments in, exit code and streams out.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "reports/command_line/cli.h"
#include "tests/reports/support.h"

namespace metastable::reports::test {

struct Ran {
  int code = 0;
  std::string out, err;
};

inline int run(const std::vector<std::string>& words) {
  std::vector<const char*> argv{"metastable"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  return reports::run(static_cast<int>(argv.size()), argv.data());
}

inline Ran metastable(const std::vector<std::string>& words) {
  Ran ran;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  ran.code = run(words);
  ran.out = testing::internal::GetCapturedStdout();
  ran.err = testing::internal::GetCapturedStderr();
  return ran;
}

/// The options of a wheel of equal legs whose study takes a moment.
inline const std::vector<std::string> quick{"--legs", "0.1519", "--cells", "32", "--samples", "256"};

inline std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// A command that is refused, and what its one line names.
struct Refused {
  std::vector<std::string> words;
  std::string named;
};

/// A test of the program with an empty folder of its own.
class CommandLine : public InFolder {
 protected:
  std::vector<std::string> left_behind() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  /// Each has exit code 2 and one line, and writes nothing.
  void expect_refused(const std::vector<Refused>& all) const {
    const std::vector<std::string> before = left_behind();
    for (const Refused& one : all) {
      std::string words;
      for (const std::string& word : one.words) words += word + " ";
      SCOPED_TRACE(words);
      const Ran ran = metastable(one.words);
      EXPECT_EQ(ran.code, 2);
      EXPECT_NE(ran.err.find(one.named), std::string::npos) << ran.err;
      EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
      EXPECT_EQ(ran.out, "");
    }
    EXPECT_EQ(left_behind(), before);
  }
};

}  // namespace metastable::reports::test
