#include "analysis/experiment/suggestion.h"

#include <gtest/gtest.h>

namespace metastable::analysis {
namespace {

TEST(Suggestion, IsTheNameWithFewestTypingErrors) {
  const std::vector<std::string> names{"--slope", "--slopes", "--friction", "--seed", "--legs"};
  EXPECT_EQ(nearest("--slpoe", names), "--slope");  // two letters exchanged
  EXPECT_EQ(nearest("--fricton", names), "--friction");
  EXPECT_EQ(nearest("--sloope", names), "--slope");
  EXPECT_EQ(nearest("--gravity", names), "");
  EXPECT_EQ(nearest("ab", {"aa", "bb"}), "");  // neither is nearer
  EXPECT_EQ(did_you_mean("--leg", names), "; did you mean '--legs'?");
  EXPECT_EQ(did_you_mean("", names), "");
}

}  // namespace
}  // namespace metastable::analysis
