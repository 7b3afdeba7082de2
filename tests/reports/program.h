#pragma once
// Runs the program as its users meet it: arguments in, exit code and streams out.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "reports/command_line/cli.h"

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

}  // namespace metastable::reports::test
