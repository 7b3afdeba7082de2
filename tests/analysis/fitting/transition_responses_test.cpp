// Slopes that are summed from the answers to single transitions are those of differences along the effect itself.

#include "analysis/fitting/transition_responses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/wheel_model/wheel_transitions.h"
#include "tests/analysis/diagnosed.h"
#include "tests/analysis/machine_model/machines.h"

namespace metastable::analysis::test {
namespace {

// The runs have phases, places and a label; one trial is short, and some values are missing.
std::unique_ptr<TransitionModel> model_of(double error) {
  MachineRuns runs =
      scalar_runs(30, 17, 1.5, error, 3, [](double x, double z, std::size_t) { return 0.8 * x + 0.3 + 0.2 * z; });
  runs.phases = {"left", "right"};
  runs.labels = {{"floor", {"wood", "stone"}}};
  runs.trials[4].rows.resize(3);
  for (std::size_t t = 0; t < runs.trials.size(); ++t)
    for (std::size_t k = 0; k < runs.trials[t].rows.size(); ++k) {
      MachineRow& row = runs.trials[t].rows[k];
      row.phase = static_cast<int>(k % 2);
      row.position = 0.3 * static_cast<double>(k) + 0.01 * static_cast<double>(t);
      row.labels = {static_cast<int>(t % 3 == 0)};
      if (k > 0 && (t + k) % 11 == 5) row.seen = {missing};
    }
  return machine_transitions(std::make_shared<const Machine>(linear_machine(error)), std::move(runs));
}

struct Compared {
  std::string effect;
  double off;  // of slopes and changes, as a share of their size
};

std::vector<Compared> compared(const TransitionModel& model) {
  const Fit at = fit(model, given_values(model), {});
  std::vector<const Candidate*> all;
  for (const Candidate& one : model.candidates()) all.push_back(&one);
  for (const Variation& one : model.variations()) all.push_back(&one.candidate);
  std::vector<Compared> list;
  for (const Candidate* one : all)
    for (std::size_t p = 0; one->undecidable.empty() && p < one->parameters.size(); ++p) {
      EffectTerm term{one, one->variants.back(), {}};
      for (const FreeParameter& parameter : one->parameters) term.values.push_back(parameter.neutral);
      const std::optional<Addition> addition = model.addition(term, p);
      const auto counts = [](double weight) { return std::abs(weight) > 1e-9; };
      if (!addition || std::ranges::none_of(addition->weights, counts)) continue;
      TransitionResponses responses(model, at, addition->number, one->parameters[p].step);
      for (std::size_t k = 0; k < responses.evaluations(); ++k) responses.evaluate(k);
      if (responses.evaluations() == 0) continue;
      const Derivatives whole = derivatives(model, at.nuisance, {term}, at.evaluation, false);
      Derivatives summed = whole;
      responses.fill(*addition, static_cast<Eigen::Index>(p), summed);
      const auto column = static_cast<Eigen::Index>(p);
      list.push_back(
          {one->id, std::max((summed.slope - whole.slope).col(column).norm() / whole.slope.col(column).norm(),
                             (summed.change - whole.change).col(column).norm() / whole.change.col(column).norm())});
    }
  return list;
}

TEST(TransitionResponses, SumToTheSlopesOfEveryAddition) {
  const std::vector<Compared> all = compared(*model_of(0.05));
  // These are b by phase, drift, stretch and label, and means and scatter by state, phase, order, number, place and
  // label.
  EXPECT_GE(all.size(), 50u);
  for (const Compared& one : all) EXPECT_LT(one.off, 0.01) << one.effect;
}

// A wheel's contacts are varied collision by collision: by what has no name, and by three effects of the catalogue.
TEST(TransitionResponses, SumToTheSlopesOfAWheelsVariations) {
  const auto design = wheel_transitions(wheel_design(60, 14));
  const std::vector<Compared> all = compared(*design->simulate(nominal_values(*design), {}, 5));
  for (const char* effect : {"leg_contact", "friction_patch", "ramp_vibration", "mean friction by position",
                             "mean restitution by leg in order", "scatter of friction by trial"})
    EXPECT_GT(std::ranges::count(all, effect, &Compared::effect), 0) << effect;
  // Differences to one side err by as much where the whole column is moved.
  for (const Compared& one : all) EXPECT_LT(one.off, 0.03) << one.effect;
}

// With errors of measurement as large as the noise an event remembers a dozen transitions.
TEST(TransitionResponses, AreNotSoughtWhereEventsRememberLong) { EXPECT_TRUE(compared(*model_of(2)).empty()); }

TEST(TransitionResponses, AreNotThereForAnEffectThatDoesMoreThanAdd) {
  const auto model = model_of(0.05);
  for (const Candidate& one : model->candidates())
    if (one.id == "memory" || one.id == "outliers" || one.id == "bend" || one.id == "sensor_bias_x" ||
        one.id == "b_spread") {
      EffectTerm term{&one, one.variants.front(), {0}};
      EXPECT_FALSE(model->addition(term, 0).has_value()) << one.id;
    }
}

}  // namespace
}  // namespace metastable::analysis::test
