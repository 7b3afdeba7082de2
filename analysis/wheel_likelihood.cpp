#include "analysis/wheel_likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "analysis/speed_filter.h"
#include "dynamics/truncated_normal.h"

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

// `rests`: filled with the chances of rest, if any.
Evaluation follow(const WheelRuns& measured, const std::vector<Event>& events, const WheelHypothesis& hypothesis,
                  std::vector<double>* rests) {
  const dynamics::Extension& e = hypothesis.extension;
  const std::vector<ExtendedWheel> wheel = wheels_on_ramps(measured, hypothesis.contact, e);
  Evaluation result;
  result.log_density.reserve(events.size());
  result.score.reserve(events.size());
  result.unit.reserve(events.size());
  // A friction of the trial's own is integrated over: every node follows the trial, weighted by what it has explained.
  const bool spread = e.trial_friction_sd > 0;
  const std::size_t nodes = spread ? five_nodes.size() : 1;
  for (const WheelRun& run : measured.runs) {
    std::vector<SpeedFilter> filters(
        nodes, SpeedFilter(e, hypothesis.tilt, hypothesis.noise.value_or(measured.noise), measured.slack));
    std::array<double, five_nodes.size()> log_weight{};
    for (std::size_t q = 0; q < nodes && spread; ++q) log_weight[q] = std::log(five_nodes[q].weight);
    const ExtendedWheel& at = wheel[run.condition];
    const auto chance_of_rest = [&](const StepContext& context) {
      double sum = 0, weights = 0;
      for (std::size_t q = 0; q < nodes; ++q) {
        StepContext shifted = context;
        if (spread) shifted.friction_shift = five_nodes[q].score * e.trial_friction_sd;
        const double w = std::exp(log_weight[q] - *std::max_element(log_weight.begin(), log_weight.begin() + nodes));
        sum += w * filters[q].chance_below(at, shifted, at.barrier(shifted));
        weights += w;
      }
      return sum / weights;
    };
    const auto add = [&](auto observe) {
      if (rests && rests->size() < result.log_density.size() + 1) rests->push_back(0);
      if (!spread) {
        const SpeedFilter::Out out = observe(filters[0], 0.0);
        result.log_density.push_back(out.log_density);
        result.score.push_back(out.score);
        result.unit.push_back(out.unit);
        return;
      }
      std::array<SpeedFilter::Out, five_nodes.size()> out;
      double largest = -std::numeric_limits<double>::infinity(), before = 0, now = 0, below = 0, unit = 0;
      for (std::size_t q = 0; q < nodes; ++q) {
        out[q] = observe(filters[q], five_nodes[q].score * e.trial_friction_sd);
        largest = std::max(largest, log_weight[q]);
      }
      for (std::size_t q = 0; q < nodes; ++q) {
        const double w = std::exp(log_weight[q] - largest);
        before += w;
        now += w * std::exp(out[q].log_density);
        below += w * normal_cdf(out[q].score);
        unit += w * out[q].unit;
        log_weight[q] += out[q].log_density;
      }
      result.log_density.push_back(now > 0 ? std::max(least_log_density, std::log(now / before)) : least_log_density);
      result.score.push_back(score_of_probability(below / before));
      result.unit.push_back(unit / before);
    };
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const RunCollision& m = run.collisions[k];
      const auto context = [&m](double shift) {
        StepContext c = m.context;
        c.friction_shift = shift;
        return c;
      };
      if (k == 0) {
        if (measured.conditions[run.condition].initial_speed)
          add([&](SpeedFilter& f, double) { return f.launch(measured.conditions[run.condition], m.before); });
        else
          for (SpeedFilter& f : filters) f.start(m.before);
      }
      const bool last = k + 1 == run.collisions.size();
      const bool after = m.after && *m.after > 0;
      if (rests && (after || !last || run.outcome)) rests->push_back(chance_of_rest(m.context));
      if (after) add([&](SpeedFilter& f, double shift) { return f.collision(at, context(shift), *m.after); });
      if (!last) {
        const double next = run.collisions[k + 1].before;
        if (after && measured.exact_stances)
          for (SpeedFilter& f : filters) f.start(next);
        else if (after)
          add([&](SpeedFilter& f, double shift) { return f.stance(at, context(shift), next); });
        else
          add([&](SpeedFilter& f, double shift) { return f.step(at, context(shift), next); });
      } else if (!after && run.outcome) {
        const bool rested = *run.outcome == dynamics::Outcome::rest;
        add([&](SpeedFilter& f, double shift) {
          const StepContext here = context(shift);
          return f.rest(at, here, m.after ? jam_bound(measured) : at.barrier(here), rested);
        });
      }
    }
  }
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (events[i].kind == EventKind::survival) result.score[i] = 0;
    if (!std::isfinite(result.log_density[i])) result.log_density[i] = least_log_density;
    if (!std::isfinite(result.score[i])) result.score[i] = -8;
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
