#include "analysis/wheel_model/leg_order.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_legs = 32, stances_a_leg = 5;
constexpr double clear_gain = 10;      // One trial has to gain so many nats.
constexpr double least_evidence = 30;  // Legs have to differ by so many variances of a stance each.
// Another order may leave this share of the squares between legs: lengths that are off by chance do so once in 1e4
// wheels.
constexpr double most_left = 0.1;
constexpr double wild = 9;  // A residual of more variances counts as so many.

// Leg j of the column has the stated length number first + j, or first - j.
struct LegOrder {
  int first = 0;
  bool backwards = false;
  int of(int leg, int legs) const { return ((backwards ? first - leg : first + leg) % legs + legs) % legs; }
};

// A stance by the leg of the column, and by how much it misses the next speed [rad/s].
struct StanceMiss {
  std::size_t leg = 0;
  double value = 0;
};

// Says by how much stances miss the next speed in that order of legs, by run.
std::vector<std::vector<StanceMiss>> stance_misses(const WheelRuns& measured, const LegOrder& order) {
  WheelRuns turned;
  turned.wheel = measured.wheel;
  turned.law = measured.law;
  turned.conditions = measured.conditions;
  const int legs = measured.wheel.legs();
  for (int leg = 0; leg < legs; ++leg)
    turned.wheel.leg_length[static_cast<std::size_t>(leg)] =
        measured.wheel.leg_length[static_cast<std::size_t>(order.of(leg, legs))];
  const auto wheels = wheels_on_ramps(turned, {}, {});
  std::vector<std::vector<StanceMiss>> all(measured.runs.size());
  for (std::size_t t = 0; t < measured.runs.size(); ++t) {
    const WheelRun& run = measured.runs[t];
    for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) {
      const RunCollision& m = run.collisions[k];
      if (!m.after || !(*m.after > 0)) continue;
      const int leg = m.context.leg;
      if (const auto next = wheels[run.condition].next({.leg = leg}, *m.after))
        all[t].push_back({static_cast<std::size_t>(leg), run.collisions[k + 1].before - *next});
    }
  }
  return all;
}

// The sum of squares between legs, the variance within them, and the number of stances.
struct BetweenLegs {
  double squares = 0, variance = 0;
  std::size_t count = 0;
};

BetweenLegs between_legs(const std::vector<std::vector<StanceMiss>>& misses, std::size_t legs) {
  std::vector<double> sum(legs), count(legs);
  double all = 0, squares = 0;
  BetweenLegs b;
  for (const auto& run : misses)
    for (const StanceMiss& one : run) {
      sum[one.leg] += one.value;
      ++count[one.leg];
      all += one.value;
      squares += one.value * one.value;
      ++b.count;
    }
  if (b.count < stances_a_leg * legs) return b;
  double of_legs = 0;
  for (std::size_t leg = 0; leg < legs; ++leg)
    if (count[leg] > 0) of_legs += sum[leg] * sum[leg] / count[leg];
  b.squares = of_legs - all * all / static_cast<double>(b.count);
  b.variance = (squares - of_legs) / static_cast<double>(b.count - legs);
  return b;
}

std::optional<std::string> question_on_all(const WheelRuns& measured,
                                           const std::vector<std::vector<StanceMiss>>& noted) {
  const int legs = measured.wheel.legs();
  const auto size = static_cast<std::size_t>(legs);
  const BetweenLegs given = between_legs(noted, size);
  if (given.count < stances_a_leg * size) return std::nullopt;
  LegOrder best;
  BetweenLegs least = given;
  for (const bool backwards : {false, true})
    for (int first = 0; first < legs; ++first) {
      const LegOrder order{first, backwards};
      if (const BetweenLegs b = between_legs(stance_misses(measured, order), size);
          b.count == given.count && b.squares < least.squares)
        best = order, least = b;
    }
  if (least.squares > most_left * given.squares ||
      given.squares < least_evidence * static_cast<double>(legs) * least.variance)
    return std::nullopt;
  return fmt::format(
      "leg: the stances fit the stated leg_lengths_m far better if the foot noted as leg 0 has length {} of that "
      "list (counted from 0), leg 1 length {} and so on: {}",
      best.of(0, legs), best.of(1, legs),
      best.backwards ? "is the list in the order in which the legs land?"
                     : "is the column, or the list, turned on by some legs?");
}

std::optional<std::string> question_on_some(const WheelRuns& measured, const Experiment& experiment,
                                            const std::vector<std::vector<StanceMiss>>& noted) {
  std::vector<double> sizes;
  for (const auto& run : noted)
    for (const StanceMiss& one : run) sizes.push_back(std::abs(one.value));
  if (sizes.empty()) return std::nullopt;
  const double sd = std::max(1e-6, median_deviation_to_sd * median(std::move(sizes))), variance = sd * sd;
  const auto misfit = [&](const std::vector<StanceMiss>& run) {
    double sum = 0;
    for (const StanceMiss& one : run) sum += std::min(wild, one.value * one.value / variance) / 2;
    return sum;
  };
  std::vector<double> as_noted, best;
  for (const auto& run : noted) as_noted.push_back(misfit(run));
  best = as_noted;
  for (int first = 1; first < measured.wheel.legs(); ++first) {
    const auto turned = stance_misses(measured, {.first = first});
    for (std::size_t t = 0; t < turned.size(); ++t)
      if (turned[t].size() == noted[t].size()) best[t] = std::min(best[t], misfit(turned[t]));
  }
  // The best of so many orders, in so many trials, gains the more by chance.
  const double least_gain = clear_gain + std::log(static_cast<double>(best.size()) * measured.wheel.legs());
  std::vector<int> others;
  std::size_t right = 0;
  for (std::size_t t = 0; t < best.size(); ++t) {
    right += !(best[t] < as_noted[t]);
    if (best[t] < as_noted[t] - least_gain && best[t] < static_cast<double>(noted[t].size()))
      others.push_back(experiment.trials[t].number);
  }
  if (others.empty() || 2 * right < best.size()) return std::nullopt;
  return fmt::format(
      "leg: the stances of {} of {} trials, the first of them trial {}, fit the stated leg_lengths_m far better with "
      "other legs than are noted: did these trials begin with another leg, or is a collision missing?",
      others.size(), best.size(), others.front());
}

}  // namespace

std::optional<std::string> question_on_leg_order(const WheelRuns& measured, const Experiment& experiment) {
  if (!measured.legs_known || !measured.speeds_after || measured.wheel.equal_legs() ||
      measured.law == dynamics::Law::settled || measured.wheel.leg_length.size() > most_legs)
    return std::nullopt;
  const auto noted = stance_misses(measured, {});
  if (auto question = question_on_all(measured, noted)) return question;
  return question_on_some(measured, experiment, noted);
}

}  // namespace metastable::analysis
