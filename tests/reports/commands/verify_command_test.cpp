// What `metastable verify` prints.

#include "reports/commands/verify_command.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/reports/program.h"

namespace metastable::reports::test {
namespace {
using VerifyCommand = CommandLine;

TEST_F(VerifyCommand, SaysOnceWhoseFailureNegativeTimesAre) {
  // The example of its --help.
  const Ran ran = metastable({"verify", "--out", path("evidence"), "--export", path("chain")});
  ASSERT_EQ(ran.code, 0) << ran.err;
  for (const char* name : {"evidence/verify-solvers.csv", "chain/chain.mtx", "chain/chain.tra"})
    EXPECT_FALSE(read(path(name)).empty()) << name;
  const auto count = [&](const std::string& part) {
    int found = 0;
    for (std::size_t at = ran.out.find(part); at != std::string::npos; at = ran.out.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("negative time"), 1) << ran.out;
  EXPECT_LT(ran.out.find("negative time"), ran.out.find("The rough-terrain wheel")) << ran.out;
  EXPECT_EQ(count("version: "), 1) << ran.out;
  EXPECT_EQ(count("seed: "), 1) << ran.out;
}

}  // namespace
}  // namespace metastable::reports::test
