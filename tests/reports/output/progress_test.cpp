#include "reports/output/progress.h"

#include <gtest/gtest.h>

#include <csignal>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "reports/output/interrupt.h"

namespace metastable::reports {
namespace {

TEST(Progress, SaysNothingWithoutATerminal) {
  std::ostringstream out;
  {
    Progress progress("working", 3, out, false);
    for (int i = 0; i < 3; ++i) progress.advance();
  }
  EXPECT_EQ(out.str(), "");
}

TEST(Progress, DrawsOneLineAndWipesIt) {
  std::ostringstream out;
  {
    Progress progress("working", 4, out, true);
    progress.advance();
    EXPECT_EQ(out.str(), "\r\033[Kworking  25 % (1 of 4)");
  }
  EXPECT_TRUE(out.str().ends_with("\r\033[K"));
  EXPECT_EQ(out.str().find('\n'), std::string::npos);
}

// What was done before shows at once and does not make the rest look fast.
TEST(Progress, WhatWasDoneBeforeCountsAsDone) {
  std::ostringstream out;
  Progress progress("working", 464, out, true);
  progress.skip(176);
  EXPECT_EQ(out.str(), "\r\033[Kworking  38 % (176 of 464)");
}

TEST(Progress, NeverPassesItsTotal) {
  std::ostringstream out;
  Progress progress("working", 2, out, true);
  progress.advance(5);
  EXPECT_NE(out.str().find("100 % (2 of 2)"), std::string::npos);
}

TEST(Progress, MayBeAdvancedFromManyThreads) {
  std::ostringstream out;
  Progress progress("working", 4000, out, true);
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 1000; ++i) progress.advance();
    });
  }
  threads.clear();
  EXPECT_TRUE(out.str().starts_with("\r\033[Kworking  0 % (1 of 4000)"));
}

TEST(Progress, StopsAtAnInterrupt) {
  std::ostringstream out;
  Progress progress("working", 4, out, false);
  catch_interrupts();
  std::raise(SIGINT);
  EXPECT_THROW(progress.advance(), Interrupted);
  clear_interrupt();
}

}  // namespace
}  // namespace metastable::reports
