// Works side by side ask a machine's map in joint calls, and are told what they would be told alone.

#include "analysis/machine_model/machine.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <vector>

namespace metastable::analysis::test {
namespace {

// Counts calls of x' = a x + b + z, and the values that came as one number a row.
struct Counted {
  std::shared_ptr<Machine> machine = std::make_shared<Machine>();
  std::shared_ptr<std::atomic<int>> calls = std::make_shared<std::atomic<int>>(0),
                                    by_row = std::make_shared<std::atomic<int>>(0);
};

Counted counted_machine() {
  Counted counted;
  counted.machine->states = {"x"};
  counted.machine->parameters = {{"a", 0.5, 0.1}, {"b", 0, 0.1}};
  counted.machine->dear = true;
  counted.machine->step = [calls = counted.calls, by_row = counted.by_row](const MachineBatch& batch) {
    ++*calls;
    for (const auto& value : batch.values) *by_row += value.size() > 1;
    for (std::size_t i = 0; i < batch.rows; ++i)
      batch.next[i] = batch.value(0, i) * batch.states[i] + batch.value(1, i) + batch.scores[i];
  };
  return counted;
}

// Steps three rows a few times with this b.
std::vector<double> walk(const Machine& machine, double b, int steps) {
  std::vector<double> states{1, 2, 3}, next(3);
  const std::vector<double> scores{0.1, -0.2, 0.3}, a{0.5}, shift{b};
  std::vector<std::uint8_t> failed(3);
  const std::vector<std::span<const double>> values{a, shift};
  for (int step = 0; step < steps; ++step) {
    machine.step({3, states, scores, values, next, failed});
    states = next;
  }
  return states;
}

TEST(JoiningSteps, WorksSideBySideShareTheirCalls) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  std::vector<std::vector<double>> together(5);
  side_by_side(*counted.machine, 5, 2, [&](std::size_t i) { together[i] = walk(joining, static_cast<double>(i), 4); });
  EXPECT_EQ(*counted.calls, 4);
  EXPECT_EQ(*counted.by_row, 4) << "b alone differs between the works";
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(together[i], walk(*counted.machine, static_cast<double>(i), 4));
}

TEST(JoiningSteps, WorksWithinWorksRunOneAfterTheOther) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  std::vector<double> last(4);
  side_by_side(*counted.machine, 2, 1, [&](std::size_t i) {
    side_by_side(*counted.machine, 2, 1,
                 [&](std::size_t k) { last[2 * i + k] = walk(joining, static_cast<double>(2 * i + k), 3)[0]; });
  });
  EXPECT_EQ(*counted.calls, 6);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(last[k], walk(*counted.machine, static_cast<double>(k), 3)[0]);
  EXPECT_EQ(walk(joining, 1, 3), walk(*counted.machine, 1, 3)) << "outside of works";
}

TEST(JoiningSteps, AWorkThatThrowsEndsTheOthers) {
  const Counted counted = counted_machine();
  const Machine joining = joining_steps(counted.machine);
  EXPECT_THROW(side_by_side(*counted.machine, 3, 2,
                            [&](std::size_t i) {
                              if (i == 1) throw std::domain_error("the second");
                              walk(joining, 1, 5);
                            }),
               std::domain_error);
}

}  // namespace
}  // namespace metastable::analysis::test
