#include "analysis/diagnosis/missing_columns.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::line;
using test::Line;

// A line with another column, which takes two thirds of its noise away and has a nuisance of its own, in front of the
// others.
class Completed : public Line {
 public:
  explicit Completed(const Line& from) : Line(from) {
    for (double& y : y_) y /= 3;
    nuisances_.insert(nuisances_.begin(), {"offset of the column", 0, 1, 1e-4, -10, 10});
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    EXPECT_EQ(n.size(), 3U);
    return Line::evaluate(std::vector<double>{n[1] + n[0], n[2]}, terms);
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double>, std::span<const EffectTerm>,
                                            std::uint64_t) const override {
    return std::make_unique<Completed>(*this);
  }
};

class Incomplete : public Line {
 public:
  explicit Incomplete(const Line& from) : Line(from) {}
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> completed(std::span<const double>,
                                                                                  std::uint64_t) const override {
    std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> all;
    all.emplace_back("column", std::make_unique<Completed>(*this));
    return all;
  }
};

// Three times as little noise shows effects of a third of the size, whichever nuisances the column brings along.
TEST(MissingColumns, MayBringNuisancesOfTheirOwn) {
  const Incomplete model(line(0, 7));
  const Candidate slope = model.candidates()[0];
  const Fit recalibrated = fit(model, {0, 0}, {});
  const std::vector<MissingColumn> missing = missing_columns(model, recalibrated, {&slope}, Rules{}, 1, 1);
  ASSERT_EQ(missing.size(), 1U);
  EXPECT_EQ(missing[0].column, "column");
  ASSERT_EQ(missing[0].effects.size(), 1U);
  ASSERT_TRUE(missing[0].effects[0].smallest);
  EXPECT_NEAR(*missing[0].effects[0].smallest / missing[0].effects[0].smallest_with_it, 3, 0.1);
}

}  // namespace
}  // namespace metastable::analysis
