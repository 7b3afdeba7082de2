#include "analysis/diagnosis/even_push.h"

#include <gtest/gtest.h>

namespace metastable::analysis {
namespace {

// A hypothesis of more parameters that gains as much as the push is less likely, and no worse an answer.
TEST(EvenPush, TakesTheNameOfWhatGainsLessAlone) {
  const Rules rules;
  EXPECT_TRUE((EvenPush{.by = {0.1, 0.2}, .gain = 330, .of_best = 123, .log_odds = 95}.instead(rules)));
  EXPECT_FALSE((EvenPush{.by = {0.1, 0.2}, .gain = 200, .of_best = 200, .log_odds = 4.2}.instead(rules)));
  EXPECT_FALSE((EvenPush{.by = {0.1, 0.2}, .gain = 208, .of_best = 200, .log_odds = 1}.instead(rules)));
}

}  // namespace
}  // namespace metastable::analysis
