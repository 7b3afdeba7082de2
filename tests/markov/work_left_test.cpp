#include "markov/work_left.h"

#include <gtest/gtest.h>

namespace metastable::markov {
namespace {

TEST(WorkLeft, KnowsNothingBeforeStagesArePlanned) {
  double now = 5;
  WorkLeft work([&] { return now; });
  work.advance(100);
  EXPECT_EQ(work.share(), 0);
}

TEST(WorkLeft, ForetellsTheTimeLeft) {
  double now = 0;
  WorkLeft work([&] { return now; });
  now = 10;
  work.plan(100, 0.1);   // ten seconds
  work.plan(1000, 0.2);  // two hundred
  EXPECT_DOUBLE_EQ(work.share(), 10.0 / 220);
  work.advance(50);
  now = 30;  // it goes at 0.4 seconds a unit
  EXPECT_DOUBLE_EQ(work.share(), 30.0 / (30 + 20 + 200));
  work.finish(0);
  EXPECT_DOUBLE_EQ(work.share(), 30.0 / 230);
  work.advance(500);
  now = 130;
  EXPECT_DOUBLE_EQ(work.share(), 130.0 / 230);
  work.add(1, 500);  // more turns up: the share falls back
  EXPECT_DOUBLE_EQ(work.share(), 130.0 / 330);
  work.finish(1);
  EXPECT_EQ(work.share(), 1);
}

TEST(WorkLeft, IsNotOverBeforeItsLastStageIs) {
  double now = 0;
  WorkLeft work([&] { return now; });
  work.plan(100, 1);
  work.advance(150);
  now = 100;
  EXPECT_LT(work.share(), 1);
}

}  // namespace
}  // namespace metastable::markov
