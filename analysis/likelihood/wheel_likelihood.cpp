#include "analysis/likelihood/wheel_likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "analysis/likelihood/speed_filter.h"
#include "dynamics/wheel/truncated_normal.h"

namespace metastable::analysis {
namespace {

using dynamics::ExtendedWheel;
using dynamics::normal_cdf;
using dynamics::StepContext;

struct Node {  // of Gauss-Hermite's rules for the standard normal
  double score, weight;
};
constexpr std::array<Node, 5> five_nodes{{{-2.856970013872806, 0.01125741132772069},
                                          {-1.355626179974266, 0.2220759220056126},
                                          {0, 0.5333333333333333},
                                          {1.355626179974266, 0.2220759220056126},
                                          {2.856970013872806, 0.01125741132772069}}};

constexpr double far_score = -8;  // of an event whose density has no finite score

// One trial followed through its collisions. A friction of the trial's own is integrated over: every node follows the
// trial, weighted by what it has explained.
class TrialFollower {
 public:
  /// @param rests  filled with the chances of rest, if any
  TrialFollower(const WheelRuns& measured, const WheelRun& run, const ExtendedWheel& wheel,
                const WheelHypothesis& hypothesis, Evaluation& result, std::vector<double>* rests)
      : measured_(measured),
        run_(run),
        wheel_(wheel),
        friction_sd_(hypothesis.extension.trial_friction_sd),
        nodes_(friction_sd_ > 0 ? five_nodes.size() : 1),
        filters_(nodes_, SpeedFilter(hypothesis.extension, hypothesis.tilt, hypothesis.noise.value_or(measured.noise),
                                     measured.slack)),
        result_(result),
        rests_(rests) {
    if (nodes_ > 1)
      for (std::size_t q = 0; q < nodes_; ++q) log_weight_[q] = std::log(five_nodes[q].weight);
  }

  void follow() {
    start();
    for (std::size_t k = 0; k < run_.collisions.size(); ++k) step(k);
  }

 private:
  void start() {
    const double first = run_.collisions.front().before;
    const Condition& condition = measured_.conditions[run_.condition];
    if (condition.initial_speed)
      add([&](SpeedFilter& f, double) { return f.launch(condition, first); });
    else
      for (SpeedFilter& f : filters_) f.start(first);
  }

  void step(std::size_t k) {
    const RunCollision& m = run_.collisions[k];
    const auto context = [&m](double shift) {
      StepContext c = m.context;
      c.friction_shift = shift;
      return c;
    };
    const bool last = k + 1 == run_.collisions.size();
    const bool after = m.after && *m.after > 0;
    if (rests_ && (after || !last || run_.outcome)) rests_->push_back(chance_of_rest(m.context));
    if (after) add([&](SpeedFilter& f, double shift) { return f.collision(wheel_, context(shift), *m.after); });
    if (!last) {
      const double next = run_.collisions[k + 1].before;
      if (after && measured_.exact_stances)
        for (SpeedFilter& f : filters_) f.start(next);
      else if (after)
        add([&](SpeedFilter& f, double shift) { return f.stance(wheel_, context(shift), next); });
      else
        add([&](SpeedFilter& f, double shift) { return f.step(wheel_, context(shift), next); });
    } else if (!after && run_.outcome) {
      const bool rested = *run_.outcome == dynamics::Outcome::rest;
      add([&](SpeedFilter& f, double shift) {
        const StepContext here = context(shift);
        return f.rest(wheel_, here, m.after ? jam_bound(measured_) : wheel_.barrier(here), rested);
      });
    }
  }

  double shift(std::size_t node) const { return five_nodes[node].score * friction_sd_; }
  double largest_log_weight() const { return *std::max_element(log_weight_.begin(), log_weight_.begin() + nodes_); }

  double chance_of_rest(const StepContext& context) {
    double sum = 0, weights = 0;
    for (std::size_t q = 0; q < nodes_; ++q) {
      StepContext shifted = context;
      if (nodes_ > 1) shifted.friction_shift = shift(q);
      const double w = std::exp(log_weight_[q] - largest_log_weight());
      sum += w * filters_[q].chance_below(wheel_, shifted, wheel_.barrier(shifted));
      weights += w;
    }
    return sum / weights;
  }

  // One event: its density averaged over the nodes, which are weighed anew by it.
  template <class Observe>
  void add(Observe observe) {
    if (rests_ && rests_->size() < result_.log_density.size() + 1) rests_->push_back(0);
    if (nodes_ == 1) {
      const SpeedFilter::Out out = observe(filters_[0], 0.0);
      result_.log_density.push_back(out.log_density);
      result_.score.push_back(out.score);
      result_.unit.push_back(out.unit);
      return;
    }
    const double largest = largest_log_weight();
    double before = 0, now = 0, below = 0, unit = 0;
    for (std::size_t q = 0; q < nodes_; ++q) {
      const SpeedFilter::Out out = observe(filters_[q], shift(q));
      const double w = std::exp(log_weight_[q] - largest);
      before += w;
      now += w * std::exp(out.log_density);
      below += w * normal_cdf(out.score);
      unit += w * out.unit;
      log_weight_[q] += out.log_density;
    }
    result_.log_density.push_back(now > 0 ? std::max(least_log_density, std::log(now / before)) : least_log_density);
    result_.score.push_back(score_of_probability(below / before));
    result_.unit.push_back(unit / before);
  }

  const WheelRuns& measured_;
  const WheelRun& run_;
  const ExtendedWheel& wheel_;
  double friction_sd_;  // of the trial's own; 0: one node, without a shift
  std::size_t nodes_;
  std::vector<SpeedFilter> filters_;                    // by node
  std::array<double, five_nodes.size()> log_weight_{};  // of the nodes
  Evaluation& result_;
  std::vector<double>* rests_;
};

// `rests`: filled with the chances of rest, if any.
Evaluation follow(const WheelRuns& measured, const std::vector<Event>& events, const WheelHypothesis& hypothesis,
                  std::vector<double>* rests) {
  const std::vector<ExtendedWheel> wheels = wheels_on_ramps(measured, hypothesis.contact, hypothesis.extension);
  Evaluation result;
  result.log_density.reserve(events.size());
  result.score.reserve(events.size());
  result.unit.reserve(events.size());
  for (const WheelRun& run : measured.runs)
    TrialFollower(measured, run, wheels[run.condition], hypothesis, result, rests).follow();
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (events[i].kind == EventKind::survival) result.score[i] = 0;
    if (!std::isfinite(result.log_density[i])) result.log_density[i] = least_log_density;
    if (!std::isfinite(result.score[i])) result.score[i] = far_score;
  }
  return result;
}

}  // namespace

Evaluation wheel_likelihood(const WheelRuns& measured, const std::vector<Event>& events,
                            const WheelHypothesis& hypothesis) {
  return follow(measured, events, hypothesis, nullptr);
}

std::vector<double> wheel_rest_chances(const WheelRuns& measured, const std::vector<Event>& events,
                                       const WheelHypothesis& hypothesis) {
  std::vector<double> rests;
  follow(measured, events, hypothesis, &rests);
  return rests;
}

}  // namespace metastable::analysis
