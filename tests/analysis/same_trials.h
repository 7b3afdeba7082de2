#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "analysis/experiment/experiment.h"

namespace metastable::test {

/// Expects the trials of two experiments to be the same, numbers to a relative `close`.
inline void expect_same_trials(const analysis::Experiment& read, const analysis::Experiment& known, double close = 0) {
  const auto same = [close](std::optional<double> a, std::optional<double> b) {
    return a.has_value() == b.has_value() && (!a || std::abs(*a - *b) <= close * std::abs(*b));
  };
  ASSERT_EQ(read.trials.size(), known.trials.size());
  for (std::size_t t = 0; t < read.trials.size(); ++t) {
    const analysis::MeasuredTrial &a = read.trials[t], &b = known.trials[t];
    EXPECT_EQ(a.number, b.number);
    EXPECT_EQ(a.condition, b.condition);
    EXPECT_EQ(a.outcome, b.outcome);
    ASSERT_EQ(a.collisions.size(), b.collisions.size());
    for (std::size_t i = 0; i < a.collisions.size(); ++i) {
      const analysis::MeasuredCollision &c = a.collisions[i], &d = b.collisions[i];
      EXPECT_EQ(c.leg, d.leg);
      EXPECT_TRUE(c.number == d.number && same(c.time, d.time) && same(c.position, d.position) &&
                  same(c.omega_minus, d.omega_minus) && same(c.omega_plus, d.omega_plus))
          << "trial " << a.number << ", collision " << c.number;
    }
  }
}

}  // namespace metastable::test
