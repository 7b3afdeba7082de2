#include "analysis/diagnosis/detectability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::line;

// Returns what the data hold on a slope: the squares of w about its mean, over the noise's variance.
double information(const std::vector<double>& w, double sd) {
  double sum = 0, squares = 0;
  for (const double one : w) {
    sum += one;
    squares += one * one;
  }
  return (squares - sum * sum / static_cast<double>(w.size())) / (sd * sd);
}

std::vector<double> speeds(const TransitionModel& model) {
  std::vector<double> w;
  for (const Event& e : model.events()) w.push_back(e.speed);
  return w;
}

std::vector<Detectability> visible(const TransitionModel& model, const std::vector<Candidate>& candidates) {
  std::vector<const Candidate*> pointers;
  for (const Candidate& candidate : candidates) pointers.push_back(&candidate);
  const Fit plain = fit(model, {3, std::log(0.5)}, {});
  return detectability(scan_effects(model, plain, pointers, 1), pointers, Rules{});
}

TEST(Detectability, TheSmallestSizeIsThatOfAGainOfSixteen) {
  const test::Line model = line(0, 7);
  const std::vector<Candidate> candidates{model.candidates()[0]};
  const Detectability v = visible(model, candidates).front();
  const double sd = std::exp(fit(model, {3, std::log(0.5)}, {}).nuisance[1]);
  const double smallest = std::sqrt(16 / information(speeds(model), sd));
  EXPECT_EQ(v.effect, "slope");
  EXPECT_EQ(v.parameter, "slope");
  EXPECT_TRUE(v.undecidable.empty());
  EXPECT_NEAR(v.smallest, smallest, 0.01 * smallest);
  // Its range ends at 100: the information needed for that is as much less as 100 is larger, squared.
  EXPECT_NEAR(v.times_more, smallest * smallest / 1e4, 0.02 * smallest * smallest / 1e4);
}

TEST(Detectability, SaysWhatHidesAnEffect) {
  const test::Line model = line(0, 7);
  Candidate narrow = model.candidates()[0], hopeless = narrow, untold = narrow;
  narrow.id = "narrow";
  narrow.parameters[0].upper = 0.01;
  hopeless.id = "hopeless";
  hopeless.undecidable = "nobody measured it";
  const std::vector<Candidate> candidates{narrow, hopeless};
  const std::vector<Detectability> all = visible(model, candidates);
  EXPECT_EQ(all[0].undecidable, "it would have to pass its range to be seen");
  EXPECT_GT(all[0].times_more, 1);
  EXPECT_EQ(all[1].undecidable, "nobody measured it");
  EXPECT_EQ(all[1].smallest, 0);
  const EffectScan scan = scan_effects(model, fit(model, {3, std::log(0.5)}, {}), {}, 1);
  EXPECT_EQ(detectability(scan, {&untold}, Rules{}).front().undecidable, "not scanned");
}

// Models y = mean + a w + b v + noise with v of a given correlation with w, and changed experiments with others.
class Plane : public test::Line {
 public:
  Plane(double correlation, unsigned seed) : Line(drawn(seed, 0.5), drawn(seed + 1, 1)) {
    const std::vector<double> own = drawn(seed + 2, 1);
    for (std::size_t i = 0; i < w_.size(); ++i)
      v_.push_back(correlation * w_[i] + std::sqrt(1 - correlation * correlation) * own[i]);
    candidates_[1].id = "other";
    candidates_[1].parameters[0].lower = -100;
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e;
    for (std::size_t i = 0; i < y_.size(); ++i) {
      double mean = n[0];
      for (const EffectTerm& t : terms) mean += t.values[0] * (t.candidate->id == "other" ? v_[i] : w_[i]);
      const double z = (y_[i] - mean) / std::exp(n[1]);
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z - 0.91893853320467274 - n[1]);
      e.unit.push_back(std::exp(n[1]));
    }
    return e;
  }
  std::vector<ChangedExperiment> alternatives(std::span<const double>, std::span<const EffectTerm>,
                                              std::uint64_t) const override {
    std::vector<ChangedExperiment> all;
    for (const auto& [words, correlation] : {std::pair{"alike", 0.95}, {"apart", 0.0}, {"nearly apart", 0.5}})
      all.push_back({"correlation", correlation, words, [c = correlation] { return std::make_unique<Plane>(c, 31); }});
    return all;
  }
  const std::vector<double>& v() const { return v_; }

 private:
  static std::vector<double> drawn(unsigned seed, double sd) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal(0, sd);
    std::vector<double> all;
    for (int i = 0; i < 400; ++i) all.push_back(normal(generator));
    return all;
  }
  std::vector<double> v_;
};

double product(const std::vector<double>& a, const std::vector<double>& b) {
  double sum_a = 0, sum_b = 0, products = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum_a += a[i];
    sum_b += b[i];
    products += a[i] * b[i];
  }
  return products - sum_a * sum_b / static_cast<double>(a.size());
}

TEST(Detectability, AnEffectLooksLikeAnotherByTheShareThatItExplains) {
  for (const double correlation : {0.9, 0.5}) {
    const Plane model(correlation, 11);
    const std::vector<Candidate> candidates = model.candidates();
    const std::vector<Detectability> all = visible(model, candidates);
    const std::vector<double> w = speeds(model);
    const double share = std::pow(product(w, model.v()), 2) / (product(w, w) * product(model.v(), model.v()));
    if (correlation == 0.5) {  // too little to be called alike
      EXPECT_TRUE(all[0].alike.empty());
      continue;
    }
    ASSERT_EQ(all[0].alike.size(), 1U);
    EXPECT_EQ(all[0].alike[0].first, "other");
    EXPECT_NEAR(all[0].alike[0].second, share, 0.01);
  }
}

// The closed form is what of the cause's slope is left beside the other's, squared, over the noise's variance.
TEST(NextExperiment, SeparatesByWhatTheRivalCannotTakeUp) {
  const Plane model(0.95, 11);
  const double size = 0.3;
  Fit cause = fit(model, {0, std::log(0.5)}, {});
  cause.terms = {{&model.candidates()[0], {}, {size}}};
  const std::vector<EffectTerm> rival{{&model.candidates()[1], {}, {size}}};
  Rules unbounded;
  unbounded.seen_gain = 1e9;
  const std::vector<NextExperiment> next = next_experiments(model, cause, {rival}, unbounded, 1, 1);
  ASSERT_EQ(next.size(), 3U);
  EXPECT_EQ(next[0].change, "apart");
  EXPECT_EQ(next[1].change, "nearly apart");
  EXPECT_EQ(next[2].change, "alike");
  for (const NextExperiment& one : next) {
    const Plane changed(one.change == "apart" ? 0 : one.change == "alike" ? 0.95 : 0.5, 31);
    const std::vector<double> w = speeds(changed);
    const double left = product(w, w) - std::pow(product(w, changed.v()), 2) / product(changed.v(), changed.v());
    const double sd = std::exp(fit(changed, cause.nuisance, {}).nuisance[1]);
    EXPECT_NEAR(one.separation / (size * size * left / (sd * sd)), 1, 0.02) << one.change;
  }
}

TEST(NextExperiment, NeedsTwoEffectsWithASize) {
  const Plane model(0.5, 11);
  Fit cause = fit(model, {0, std::log(0.5)}, {});
  EXPECT_TRUE(next_experiments(model, cause, {{{&model.candidates()[1], {}, {0.3}}}}, {}, 1, 1).empty());
  cause.terms = {{&model.candidates()[0], {}, {0.3}}};
  EXPECT_TRUE(next_experiments(model, cause, {{{&model.candidates()[1], {}, {}}}}, {}, 1, 1).empty());
}

}  // namespace
}  // namespace metastable::analysis
