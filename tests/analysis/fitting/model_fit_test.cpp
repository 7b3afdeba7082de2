#include "analysis/fitting/model_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "tests/analysis/line.h"

namespace metastable::analysis {
namespace {

using test::Line;
using test::line;

struct Squares {
  double mean = 0, variance = 0, slope = 0, left = 0, sww = 0;
};
Squares least_squares(const Line& model) {  // by the textbook
  const Evaluation e = model.evaluate(std::vector<double>{0, 0}, {});
  const double n = static_cast<double>(e.score.size());
  double sy = 0, sw = 0, syy = 0, sww = 0, syw = 0;
  for (std::size_t i = 0; i < e.score.size(); ++i) {
    const double y = e.score[i], w = model.events()[i].speed;
    sy += y, sw += w, syy += y * y, sww += w * w, syw += y * w;
  }
  Squares s;
  s.mean = sy / n;
  s.variance = syy / n - s.mean * s.mean;
  s.sww = sww - sw * sw / n;
  s.slope = (syw - sy * sw / n) / s.sww;
  s.left = s.variance - s.slope * s.slope * s.sww / n;
  return s;
}

// The prior of a number that may be misstated altogether is the normal one nearby, lets go far away, and costs no more
// than that chance.
TEST(Nuisance, APriorLetsGoOfANumberThatIsAnotherAltogether) {
  Nuisance stated;
  stated.nominal = 0.3;
  stated.prior_sd = 0.08;
  Nuisance normal = stated;
  stated.misstated = 0.01;
  EXPECT_EQ(stated.cost(0.3), 0);
  EXPECT_NEAR(stated.cost(0.38), normal.cost(0.38), 0.01);
  EXPECT_NEAR(stated.cost(1.2), -std::log(0.01), 1e-9);
  EXPECT_NEAR(stated.pull(1.2), 0, 1e-9);
  EXPECT_NEAR(normal.cost(0.46), 2, 1e-12);
  for (const Nuisance& prior : {stated, normal})
    for (const double value : {0.2, 0.35, 0.5, 0.6})
      EXPECT_NEAR((prior.cost(value + 1e-6) - prior.cost(value - 1e-6)) / 2e-6, prior.pull(value), 1e-5) << value;
}

TEST(ModelFit, IsLeastSquaresOnALine) {
  const Line model = line(0.1, 1);
  const Squares s = least_squares(model);
  const Fit plain = fit(model, {0, 0}, {});
  EXPECT_TRUE(plain.converged);
  EXPECT_NEAR(plain.nuisance[0], s.mean, 1e-3);
  EXPECT_NEAR(plain.nuisance[1], 0.5 * std::log(s.variance), 2e-3);
  EXPECT_NEAR(plain.information(0, 0), 400 / s.variance, 2);
  EXPECT_NEAR(plain.information(1, 1), 800, 8);
  const Fit with = fit(model, {0, 0}, {{&model.candidates()[0], {}, {0.0}}});
  EXPECT_NEAR(with.terms[0].values[0], s.slope, 1e-3);
  EXPECT_NEAR(2 * (with.log_likelihood - plain.log_likelihood), 400 * std::log(s.variance / s.left), 0.02);
}

// Has a ridge that bends: means of 100 (n1 - n0^2) and of 1 - n0, with noise of 1.
class Bent : public test::Line {
 public:
  using Line::Line;
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm>) const override {
    Evaluation e;
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const double z = y_[i] + (i % 2 == 0 ? 100 * (n[1] - n[0] * n[0]) : 1 - n[0]);
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z);
      e.unit.push_back(1);
    }
    return e;
  }
};

// Along such a ridge undamped steps leave it and are cut to nothing: fits stopped there. (Legs of other lengths were
// called a pair of effects for it.)
TEST(ModelFit, FollowsARidgeThatBends) {
  const Bent model(std::vector<double>(200, 0.0), std::vector<double>(200, 0.0));
  FitOptions options;
  options.most_iterations = 150;
  const Fit found = fit(model, {-1.5, 2.25}, {}, options);
  EXPECT_TRUE(found.converged) << found.reason;
  EXPECT_NEAR(found.nuisance[0], 1, 0.02);
  EXPECT_NEAR(found.log_likelihood, 0, 0.02);
}

// Has ten events whose densities have a cusp where the mean is `at`, as those have beyond the end of what a landing can
// do.
class Cusped : public test::Line {
 public:
  Cusped(std::vector<double> y, std::vector<double> w, double at) : Line(std::move(y), std::move(w)), at_(at) {
    nuisances_[0].step = 0.01;  // no bound of a difference: what the data resolve is one
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e = Line::evaluate(n, terms);
    for (std::size_t i = 0; i < 10; ++i) {
      e.score[i] = 0;
      e.log_density[i] = -8 * std::abs(n[0] - at_);
    }
    return e;
  }

 private:
  double at_;
};

// Seen from one side a cusp promises a rise that is not there: such fits did not converge, and their effects were not
// decided.
TEST(ModelFit, SettlesOnACusp) {
  const Line straight = line(0, 1);
  std::vector<double> y, w;
  const Evaluation here = straight.evaluate(std::vector<double>{0, 0}, {});
  for (std::size_t i = 0; i < here.score.size(); ++i) {
    y.push_back(here.score[i]);
    w.push_back(straight.events()[i].speed);
  }
  const double at = least_squares(straight).mean + 0.02;
  const Fit found = fit(Cusped(y, w, at), {2.9, -0.7}, {});
  EXPECT_TRUE(found.converged) << found.reason << ", promised " << found.promised;
  EXPECT_NEAR(found.nuisance[0], at, 0.005);
}

// An effect of known size is held near nothing as a ridge does: sxy / (sxx + variance / prior's) on a line.
TEST(ModelFit, AnEffectsPriorIsARidge) {
  class Held : public Line {
   public:
    explicit Held(const Line& line) : Line(line) { candidates_[0].parameters[0].prior_sd = 0.02; }
  };
  const Held model(line(0.1, 1));
  const Squares s = least_squares(model);
  const Fit with = fit(model, {0, 0}, {{&model.candidates()[0], {}, {0.0}}});
  const double variance = std::exp(2 * with.nuisance[1]), price = variance / (0.02 * 0.02);
  const double slope = with.terms[0].values[0];
  EXPECT_NEAR(slope, s.slope * s.sww / (s.sww + price), 1e-3);
  EXPECT_NEAR(with.penalised, with.log_likelihood - 0.5 * slope * slope / (0.02 * 0.02), 1e-3);
}

TEST(ModelFit, LeavesOutTrialsThatDoNotCount) {
  const Line model = line(0, 2, 80, 5);
  FitOptions options;
  options.count.assign(20, 0);
  options.count[0] = options.count[1] = 1;
  const Fit part = fit(model, {0, 0}, {}, options);
  const Evaluation e = model.evaluate(std::vector<double>{0, 0}, {});
  double mean = 0;
  for (int i = 0; i < 8; ++i) mean += e.score[static_cast<std::size_t>(i)] / 8;
  EXPECT_NEAR(part.nuisance[0], mean, 0.02);
}

TEST(ModelFit, StaysInsideItsBounds) {
  const Line model = line(-0.4, 3);
  const Fit held = fit(model, {0, 0}, {{&model.candidates()[1], {}, {0.0}}});
  EXPECT_TRUE(held.converged);
  EXPECT_EQ(held.terms[0].values[0], 0);
}

// Nobody stated how much the line scatters: about the mean that is stated, 0, by the root of the mean square.
class OfUnstatedNoise : public test::Line {
 public:
  OfUnstatedNoise(std::vector<double> y, std::vector<double> w) : Line(std::move(y), std::move(w)) {
    nuisances_[1].assumed = true;
  }
};

TEST(GivenValues, RefitWhatWasOnlyAssumed) {
  const std::vector<double> y{1, -2, 2, 4, -1, 3, 0.5, -2.5};
  double squares = 0;
  for (const double value : y) squares += value * value / static_cast<double>(y.size());
  const std::vector<double> values = given_values(OfUnstatedNoise(y, std::vector<double>(y.size(), 0.0)));
  EXPECT_EQ(values[0], 0);
  EXPECT_NEAR(values[1], 0.5 * std::log(squares), 1e-2);
  EXPECT_EQ(given_values(test::Line(y, std::vector<double>(y.size(), 0.0)))[1], 0);
}

}  // namespace
}  // namespace metastable::analysis
