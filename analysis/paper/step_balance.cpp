#include "analysis/paper/step_balance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>

#include "dynamics/return_map/wheel_map.h"

namespace metastable::analysis {
namespace {

struct Step {
  std::size_t condition = 0;
  int leg = 0;
  double speed = 0, plastic = 0, excess = 0;
  std::optional<double> after_collision, slide, previous;
};

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

StepBalance balance(std::string of, const std::vector<const Step*>& steps) {
  StepBalance b;
  b.of = std::move(of);
  b.steps = steps.size();
  std::vector<double> excess, plastic, after, slide;
  for (const Step* s : steps) {
    excess.push_back(s->excess);
    plastic.push_back(s->plastic);
    if (s->after_collision) after.push_back(*s->after_collision);
    if (s->slide) slide.push_back(*s->slide);
  }
  if (excess.empty()) return b;
  b.plastic = mean_of(plastic);
  b.mean = mean_of(excess);
  for (const double e : excess) b.sd += (e - b.mean) * (e - b.mean);
  b.sd = std::sqrt(b.sd / static_cast<double>(excess.size()));
  std::sort(excess.begin(), excess.end());
  b.median = excess[excess.size() / 2];
  b.low = excess[excess.size() / 20];
  if (!after.empty()) b.after_collision = mean_of(after);
  if (!slide.empty()) b.slide = mean_of(slide);
  return b;
}

// Returns Pearson's correlation, over the steps that have the quantity.
std::optional<double> correlation(const std::vector<Step>& steps,
                                  const std::function<std::optional<double>(const Step&)>& of) {
  double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0;
  for (const Step& s : steps)
    if (const auto x = of(s)) {
      n += 1, sx += *x, sy += s.excess;
      sxx += *x * *x, syy += s.excess * s.excess, sxy += *x * s.excess;
    }
  const double vx = sxx - sx * sx / std::max(1.0, n), vy = syy - sy * sy / std::max(1.0, n);
  if (n < 3 || !(vx > 0) || !(vy > 0)) return std::nullopt;
  return (sxy - sx * sy / n) / std::sqrt(vx * vy);
}

}  // namespace

StepBalances step_balances(const Experiment& experiment) {
  if (experiment.system != System::rimless_wheel) throw std::invalid_argument("step balance: not a rimless wheel");
  if (experiment.columns.leg != Presence::all)
    throw std::invalid_argument("collisions.csv: a step balance needs the column leg");
  // `coulomb` without rebound at high friction is the plastic collision of a wheel with a hub inertia.
  std::vector<dynamics::WheelMap> maps;
  for (const Condition& c : experiment.conditions)
    maps.emplace_back(experiment.wheel, c.slope_deg * std::numbers::pi / 180, dynamics::Law::coulomb,
                      dynamics::ContactNoise::empirical({{0, 10}}));
  std::vector<Step> steps;
  for (const MeasuredTrial& trial : experiment.trials) {
    const dynamics::WheelMap& map = maps[trial.condition];
    std::optional<double> previous;
    for (std::size_t k = 0; k + 1 < trial.collisions.size(); ++k) {
      const MeasuredCollision &here = trial.collisions[k], &next = trial.collisions[k + 1];
      const double x = here.omega_minus * here.omega_minus;
      if (!(x > 0)) continue;
      Step s;
      s.condition = trial.condition;
      s.leg = *here.leg;
      const int phase = s.leg % map.phases();
      s.speed = here.omega_minus;
      s.plastic = map.coefficients(phase, {0, 10}).scale;
      s.excess = (next.omega_minus * next.omega_minus - map.stance(phase).gain) / x - s.plastic;
      if (here.omega_plus) s.after_collision = *here.omega_plus * *here.omega_plus / x;
      if (here.position && next.position) s.slide = *next.position - *here.position - map.advance(phase);
      s.previous = previous;
      previous = s.excess;
      if (here.number >= 4) steps.push_back(s);
    }
  }
  if (steps.size() < 20)
    throw std::invalid_argument(
        fmt::format("collisions.csv: {} steps from the fourth collision on; 20 are needed", steps.size()));
  const auto where = [&](const std::function<bool(const Step&)>& wanted) {
    std::vector<const Step*> some;
    for (const Step& s : steps)
      if (wanted(s)) some.push_back(&s);
    return some;
  };
  StepBalances all;
  for (std::size_t c = 0; c < experiment.conditions.size(); ++c)
    all.conditions.push_back(
        balance(experiment.conditions[c].id, where([c](const Step& s) { return s.condition == c; })));
  for (int leg = 0; leg < experiment.wheel.legs(); ++leg)
    all.legs.push_back(balance(fmt::format("leg {}", leg), where([leg](const Step& s) { return s.leg == leg; })));
  std::vector<const Step*> slid = where([](const Step& s) { return s.slide.has_value(); });
  std::stable_sort(slid.begin(), slid.end(), [](const Step* a, const Step* b) { return *a->slide < *b->slide; });
  for (std::size_t fifth = 0; fifth < 5 && slid.size() >= 20; ++fifth)
    all.slides.push_back(balance(fmt::format("fifth {} by slide", fifth + 1),
                                 {slid.begin() + static_cast<std::ptrdiff_t>(fifth * slid.size() / 5),
                                  slid.begin() + static_cast<std::ptrdiff_t>((fifth + 1) * slid.size() / 5)}));
  all.correlation.speed = correlation(steps, [](const Step& s) { return std::optional(s.speed); }).value_or(0);
  all.correlation.previous = correlation(steps, [](const Step& s) { return s.previous; }).value_or(0);
  all.correlation.after_collision = correlation(steps, [](const Step& s) { return s.after_collision; });
  all.correlation.slide = correlation(steps, [](const Step& s) { return s.slide; });
  return all;
}

}  // namespace metastable::analysis
