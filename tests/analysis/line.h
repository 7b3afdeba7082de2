#pragma once
// Makes a transition model of which everything is known in closed form.

#include <cmath>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis::test {

// A time spread evenly over 0.1 to 0.2 s.
inline double since_previous(std::size_t i) { return 0.1 + 0.1 * std::fmod(0.618034 * static_cast<double>(i), 1); }

// Models y = mean + slope w + noise: everything about it is known in closed form.
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
      return std::vector<NamedValue>{{"slope", v[0]}};
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
  bool time_tells() const override { return true; }
  std::string condition_name(std::size_t) const override { return "all"; }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e;
    double slope = 0;
    for (const EffectTerm& t : terms) slope += t.values[0];
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const double z = (y_[i] - n[0] - slope * w_[i]) / std::exp(n[1]);
      e.score.push_back(z);
      e.log_density.push_back(-0.5 * z * z - 0.91893853320467274 - n[1]);
      e.unit.push_back(std::exp(n[1]));
    }
    return e;
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double>, std::span<const EffectTerm>,
                                            std::uint64_t) const override {
    return std::make_unique<Line>(*this);
  }
  std::pair<double, double> rests() const override { return {0, 0}; }
  double expected_steps(std::span<const double>, std::span<const EffectTerm>, std::uint64_t) const override {
    return 1;
  }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::vector<NamedValue> report_nuisances(std::span<const double> n) const override { return {{"mean", n[0]}}; }

 protected:
  std::vector<double> y_, w_;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::vector<Candidate> candidates_;
  std::vector<std::string> notes_;
};

inline Line line(double slope, unsigned seed, std::size_t count = 400, double jump = 0) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> y, w;
  for (std::size_t i = 0; i < count; ++i) {
    w.push_back(normal(generator));
    y.push_back(3 + slope * w.back() + 0.5 * normal(generator) + (i % 4 == 2 ? jump : 0));
  }
  return {y, w};
}

// Has a slope, and eight waves of which the first is that slope.
class SlopeAmongWaves : public Line {
 public:
  explicit SlopeAmongWaves(const Line& from) : Line(from) {
    Candidate waves = candidates_[0];
    waves.id = "waves";
    waves.parameters.assign(8, waves.parameters[0]);
    candidates_ = {candidates_[0], waves};
    for (std::size_t i = 0; i < y_.size(); ++i)
      for (std::size_t k = 1; k < 8; ++k) y_[i] += 0.12 * wave(i, k);
  }
  Evaluation evaluate(std::span<const double> n, std::span<const EffectTerm> terms) const override {
    Evaluation e = Line::evaluate(n, {});
    for (std::size_t i = 0; i < e.score.size(); ++i) {
      for (const EffectTerm& term : terms)
        for (std::size_t k = 0; k < term.values.size(); ++k) e.score[i] -= term.values[k] * wave(i, k) / std::exp(n[1]);
      e.log_density[i] = -0.5 * e.score[i] * e.score[i] - 0.91893853320467274 - n[1];
    }
    return e;
  }

 private:
  double wave(std::size_t i, std::size_t k) const { return k == 0 ? w_[i] : std::sin(static_cast<double>(i * k)); }
};

}  // namespace metastable::analysis::test
