#include "analysis/model_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "analysis/effect_scan.h"
#include "analysis/gap_map.h"

namespace metastable::analysis {
namespace {

// Spread evenly over 0.1 to 0.2 s.
double since_previous(std::size_t i) { return 0.1 + 0.1 * std::fmod(0.618034 * static_cast<double>(i), 1); }

// y = mean + slope w + noise: everything about it is known in closed form.
class Line : public TransitionModel {
 public:
  Line(std::vector<double> y, std::vector<double> w) : y_(std::move(y)), w_(std::move(w)) {
    for (std::size_t i = 0; i < y_.size(); ++i) {
      Event e;
      e.trial = i / 4;
      e.number = static_cast<int>(i % 4) + 1;
      e.speed = w_[i];
      e.position = static_cast<double>(i % 4);
      e.since_previous = since_previous(i);
      events_.push_back(e);
    }
    nuisances_ = {{"mean", 0, 1e3, 1e-4, -1e3, 1e3}, {"log sd", 0, 1e3, 1e-4, -5, 5}};
    Candidate slope;
    slope.id = "slope";
    slope.parameters = {{0, -100, 100, 1e-4}};
    slope.report = [](const std::vector<double>&, const std::vector<double>& v) {
      return std::vector<Named>{{"slope", v[0]}};
    };
    Candidate upward = slope;
    upward.id = "upward";
    upward.parameters[0].lower = 0;
    candidates_ = {slope, upward};
  }
  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return events_.back().trial + 1; }
  std::size_t conditions() const override { return 1; }
  int legs() const override { return 4; }
  std::string condition_name(std::size_t) const override { return "all"; }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  Evaluation evaluate(std::span<const double> n, std::span<const Term> terms) const override {
    Evaluation e;
    double slope = 0;
    for (const Term& t : terms) slope += t.values[0];
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const double z = (y_[i] - n[0] - slope * w_[i]) / std::exp(n[1]);
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z - 0.91893853320467274 - n[1]);
      e.unit.push_back(std::exp(n[1]));
    }
    return e;
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double>, std::span<const Term>,
                                            std::uint64_t) const override {
    return std::make_unique<Line>(*this);
  }
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> alternatives(std::span<const double>,
                                                                                     std::uint64_t) const override {
    return {};
  }
  std::pair<double, double> rests() const override { return {0, 0}; }
  double expected_steps(std::span<const double>, std::span<const Term>, std::uint64_t) const override { return 1; }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::vector<Named> report_nuisances(std::span<const double> n) const override { return {{"mean", n[0]}}; }

 private:
  std::vector<double> y_, w_;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

Line line(double slope, unsigned seed, std::size_t count = 400, double jump = 0) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < count; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + slope * w.back() + 0.5 * normal(generator) + (i % 4 == 2 ? jump : 0));
  }
  return {y, w};
}

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

TEST(EffectScan, ScoresPromiseWhatTheFitGains) {
  const Line model = line(0.08, 4, 2000);
  const Fit plain = fit(model, {0, 0}, {});
  const EffectScan scan = scan_effects(model, plain, {&model.candidates()[0], &model.candidates()[1]}, 1);
  const Fit with = fit(model, plain.nuisance, {{&model.candidates()[0], {}, {0.0}}});
  EXPECT_NEAR(scan.effects[0].gain[0], 2 * (with.penalised - plain.penalised), 0.5);
  EXPECT_NEAR(scan.effects[0].start[0][0], with.terms[0].values[0], 2e-3);
  EXPECT_EQ(scan.effects[0].gain[0], scan.effects[1].gain[0]);
}

// Under no effect the p-values of many data sets are uniform.
TEST(EffectScan, ChanceLevelsAreHonest) {
  int below_tenth = 0, below_hundredth = 0;
  constexpr int sets = 300;
  for (unsigned seed = 0; seed < sets; ++seed) {
    const Line model = line(0, 100 + seed, 240);
    const Fit plain = fit(model, {3, -0.7}, {});
    const EffectScan scan = scan_effects(model, plain, {&model.candidates()[0]}, 1);
    const double p = ChanceGains(scan, 400, 1).p_value(&model.candidates()[0], scan.effects[0].gain[0]);
    below_tenth += p < 0.1;
    below_hundredth += p < 0.01;
  }
  EXPECT_NEAR(below_tenth, 0.1 * sets, 4 * std::sqrt(0.09 * sets));
  EXPECT_LE(below_hundredth, 0.01 * sets + 4 * std::sqrt(0.0099 * sets));
}

TEST(GapMap, FindsTheCellThatIsShiftedAndNothingInNone) {
  const Line shifted = line(0, 7, 1200, 0.3), plain = line(0, 8, 1200);
  const GapMap found = gap_map(shifted, fit(shifted, {3, -0.7}, {}), 500, 1);
  double best = 0;
  std::string facet, at;
  for (const GapCell& cell : found.cells)
    if (std::abs(cell.statistic) > best) {
      best = std::abs(cell.statistic);
      facet = cell.facet;
      at = cell.at;
    }
  EXPECT_LT(found.p_value, 0.001);
  EXPECT_TRUE(facet == "collision" || facet == "position") << facet << ' ' << at;
  EXPECT_GT(gap_map(plain, fit(plain, {3, -0.7}, {}), 500, 1).p_value, 0.02);
}

// The cell that stands out most where `shift` (event) is added to noise of 0.5.
template <class Shift>
GapCell first_cell(unsigned seed, Shift shift) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < 1200; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + 0.5 * normal(generator) + shift(i));
  }
  const Line model(y, w);
  const GapMap map = gap_map(model, fit(model, {3, -0.7}, {}), 500, 1);
  return *std::min_element(map.cells.begin(), map.cells.end(),
                           [](const GapCell& a, const GapCell& b) { return a.p_adjusted < b.p_adjusted; });
}

TEST(GapMap, SeesATrendOverTheTrials) {
  const GapCell cell = first_cell(21, [](std::size_t i) { return 0.14 * (static_cast<double>(i / 4) / 149.5 - 1); });
  EXPECT_EQ(cell.at, "trend over the trials");
  EXPECT_LT(cell.p_adjusted, 0.01);
  EXPECT_NEAR(cell.size, 0.14, 3 * 0.5 / std::sqrt(1200 / 3.0));  // at the last trial, from the middle
}

TEST(GapMap, SeesASwingWithTheTimeSinceThePreviousCollision) {
  const GapCell cell =
      first_cell(22, [](std::size_t i) { return 0.13 * std::sin(2 * 3.14159 * 40 * since_previous(i)); });
  EXPECT_EQ(cell.facet, "time");
  EXPECT_NE(cell.at.find("Hz in the time since the previous collision"), std::string::npos) << cell.at;
  EXPECT_LT(cell.p_adjusted, 0.01);
}

TEST(GapMap, SeesTrialsThatDifferAsWholes) {
  std::mt19937_64 generator(3);
  std::normal_distribution<double> offset(0, 0.2);
  std::vector<double> offsets(300);
  for (double& o : offsets) o = offset(generator);
  const GapCell cell = first_cell(23, [&](std::size_t i) { return offsets[i / 4]; });
  EXPECT_EQ(cell.at, "trials as a whole");
  EXPECT_LT(cell.p_adjusted, 1e-4);
}

TEST(GapMap, LevelsAreHonest) {
  constexpr int sets = 150;
  int below = 0;
  for (unsigned seed = 100; seed < 100 + sets; ++seed)
    below += first_cell(seed, [](std::size_t) { return 0.0; }).p_adjusted < 0.05;
  EXPECT_LE(below, 0.05 * sets + 3 * std::sqrt(0.05 * 0.95 * sets));
}

TEST(GapMap, IsTheSameForTheSameSeed) {
  const Line model = line(0, 9, 400);
  const Fit plain = fit(model, {3, -0.7}, {});
  const GapMap a = gap_map(model, plain, 300, 5), b = gap_map(model, plain, 300, 5);
  ASSERT_EQ(a.cells.size(), b.cells.size());
  for (std::size_t i = 0; i < a.cells.size(); ++i) EXPECT_EQ(a.cells[i].p_adjusted, b.cells[i].p_adjusted);
}

}  // namespace
}  // namespace metastable::analysis
