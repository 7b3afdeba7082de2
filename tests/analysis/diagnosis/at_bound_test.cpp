// Fitted values at an end of their range are said.

#include "analysis/diagnosis/at_bound.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "analysis/machine_model/machine_transitions.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

Diagnosis diagnosed_with(const Machine& machine, double bend, double b, unsigned seed) {
  const auto next = [&](double x, double z, std::size_t) { return 0.8 * x + b + 0.2 * z + bend * x * x; };
  DiagnosisOptions options;
  options.draws = 400;
  options.catalogue = {"bend", "b_drift"};
  return diagnose(
      machine_transitions(std::make_shared<const Machine>(machine), scalar_runs(60, 14, 1.5, 0.05, seed, next)),
      options);
}

std::string all_of(const Diagnosis& d) {
  std::string all;
  for (const std::string& sentence : d.sentences) all += sentence + "\n";
  return all;
}

TEST(AtBound, AnEffectThatIsLargerThanItMayBeIsSaid) {
  Machine machine = linear_machine(0.05);
  machine.effects = {{"bend", {{"c", 0, -0.05, 0.05}}}};
  for (const unsigned seed : {1U, 2U}) {
    const Diagnosis d = diagnosed_with(machine, -0.1, 0.3, seed);
    ASSERT_EQ(d.limits.at_bound.size(), 1u) << all_of(d);
    const AtBound& one = d.limits.at_bound.front();
    EXPECT_EQ(one.of, "bend");
    EXPECT_EQ(one.parameter, "c");
    EXPECT_FALSE(one.upper);
    EXPECT_NEAR(one.value, -0.05, 1e-6);
    EXPECT_NE(all_of(d).find("The bend's c stands at the lower bound of its range, -0.05: its interval has one side "
                             "only"),
              std::string::npos)
        << all_of(d);
  }
}

TEST(AtBound, ARecalibratedParameterIsSaidAndOneInsideIsNot) {
  Machine machine = linear_machine(0.05);
  machine.parameters[1] = {"b", 0.3, 0.1, 0.1, 0.4};
  const Diagnosis beyond = diagnosed_with(machine, 0, 0.5, 3);
  ASSERT_EQ(beyond.limits.at_bound.size(), 1u) << all_of(beyond);
  EXPECT_EQ(beyond.limits.at_bound.front().of, "");
  EXPECT_NE(all_of(beyond).find("The fitted b stands at the upper bound of its range, 0.4"), std::string::npos)
      << all_of(beyond);
  EXPECT_TRUE(diagnosed_with(linear_machine(0.05), -0.05, 0.3, 3).limits.at_bound.empty());
  EXPECT_TRUE(diagnosed_with(linear_machine(0.05), 0, 0.3, 3).limits.at_bound.empty());
}

}  // namespace
}  // namespace metastable::analysis::test
