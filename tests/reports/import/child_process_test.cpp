#include "reports/import/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <stdexcept>
#include <string>

#include "tests/message_of.h"

namespace metastable::reports {
namespace {

std::string refusal(const std::function<std::string()>& work) {
  return message_of([&] { in_child_process(work, "the work died"); });
}

TEST(ChildProcess, HandsOverWhatItFinds) {
  const std::string large(3000000, 'x');
  EXPECT_EQ(in_child_process([&] { return large; }, ""), large);
  EXPECT_EQ(in_child_process([] { return std::string(); }, ""), "");
}

TEST(ChildProcess, DiesAlone) {
  EXPECT_EQ(refusal([]() -> std::string { throw std::runtime_error("as it is said"); }), "as it is said");
  const auto killed = []() -> std::string {
    ::kill(::getpid(), SIGKILL);
    return "";
  };
  EXPECT_EQ(refusal(killed), "the work died (Killed)");
  EXPECT_EQ(refusal([]() -> std::string { ::_exit(7); }), "the work died (code 7)");
}

TEST(ChildProcess, DropsWhatItPrints) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  in_child_process(
      [] {
        std::puts("a library's own words");
        std::fputs("and more of them", stderr);
        std::fflush(nullptr);
        return std::string("x");
      },
      "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace metastable::reports
