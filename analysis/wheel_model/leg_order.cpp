#include "analysis/wheel_model/leg_order.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "analysis/statistics/median.h"
#include "dynamics/settled/settled_motion.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t most_legs = 32, stances_a_leg = 5;
constexpr double clear_gain = 10;      // One trial has to gain so many nats.
constexpr double least_evidence = 30;  // Legs have to differ by so many variances of a stance each.
// Another order may leave this share of the squares between legs: lengths that are off by chance do so once in 1e4
// wheels.
constexpr double most_left = 0.1;
constexpr double wild = 9;  // A residual of more variances counts as so many.
// Some landings under `settled` hop as no stuck foot does: a miss of more deviations than these counts as so many.
constexpr double wild_landing = 3;
// Next speeds have to scatter less by this factor beside the omega+ of another row. Where rows are right they scatter
// more beside it, by factors of 3.3 to 5 in engines and in the virtual laboratory with a noise of 0.003 rad/s.
constexpr double row_off = 0.5;
constexpr std::size_t least_alike = 5, least_landings = 20;

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

using Misses = std::vector<std::vector<StanceMiss>>;  // They are by run.

dynamics::Wheel turned_wheel(const dynamics::Wheel& wheel, const LegOrder& order) {
  dynamics::Wheel turned = wheel;
  for (int leg = 0; leg < wheel.legs(); ++leg)
    turned.leg_length[static_cast<std::size_t>(leg)] =
        wheel.leg_length[static_cast<std::size_t>(order.of(leg, wheel.legs()))];
  return turned;
}

// Says by how much stances miss the next speed in that order of legs.
Misses stance_misses(const WheelRuns& measured, const LegOrder& order) {
  WheelRuns turned;
  turned.wheel = turned_wheel(measured.wheel, order);
  turned.law = measured.law;
  turned.conditions = measured.conditions;
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

// Knows by how much the next speeds of landings under `settled` whose foot stands miss the law, in any order of legs:
// what an order does to the median landing of a ramp and a leg it does to all of them.
class SettledMisses {
 public:
  explicit SettledMisses(const WheelRuns& measured) : measured_(measured), noted_(measured.runs.size()) {
    const auto wheels = wheels_on_ramps(measured, measured.contact, {});
    std::map<std::pair<std::size_t, std::size_t>, std::vector<double>> before, after, misses;
    for (std::size_t t = 0; t < measured.runs.size(); ++t) {
      const WheelRun& run = measured.runs[t];
      for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) {
        const RunCollision& m = run.collisions[k];
        if (!m.after || !(*m.after > 0) || m.before > wheels[run.condition].settles_below(m.context.leg)) continue;
        const auto next = expected_next(wheels[run.condition], {.leg = m.context.leg}, m);
        if (!next) continue;
        const auto leg = static_cast<std::size_t>(m.context.leg);
        noted_[t].push_back({leg, run.collisions[k + 1].before - *next});
        before[{run.condition, leg}].push_back(m.before);
        after[{run.condition, leg}].push_back(*m.after);
        misses[{run.condition, leg}].push_back(noted_[t].back().value);
      }
    }
    for (const auto& [at, values] : misses) {
      typical_[at] = {.before = median(before[at]), .after = median(after[at])};
      const double middle = median(values), most = wild_landing * median_deviation_to_sd * median_deviation(values);
      bounds_[at] = {middle - most, middle + most};
    }
    as_noted_ = typical_nexts({});
  }
  // Bounds of wild landings also bound trials whose legs are other ones than most trials'.
  Misses in(const LegOrder& order, bool bounded) const {
    const auto nexts = typical_nexts(order);
    Misses all(noted_.size());
    for (std::size_t t = 0; t < noted_.size(); ++t)
      for (const StanceMiss& one : noted_[t]) {
        const std::pair at{measured_.runs[t].condition, one.leg};
        const auto now = nexts.at(at), then = as_noted_.at(at);
        const auto [low, high] = bounds_.at(at);
        const double value = bounded ? std::clamp(one.value, low, high) : one.value;
        if (now && then) all[t].push_back({one.leg, value - (*now - *then)});
      }
    return all;
  }

 private:
  using At = std::pair<std::size_t, std::size_t>;  // It is a condition and a leg.
  struct Speeds {
    double before = 0, after = 0;
  };
  std::map<At, std::optional<double>> typical_nexts(const LegOrder& order) const {
    constexpr double degree = std::numbers::pi / 180;
    const dynamics::Wheel wheel = turned_wheel(measured_.wheel, order);
    std::map<At, std::optional<double>> nexts;
    std::map<double, dynamics::SettledMotion> ramps;
    for (const auto& [at, speeds] : typical_) {
      const double slope = measured_.conditions[at.first].slope_deg * degree;
      const auto& motion = ramps.try_emplace(slope, dynamics::settled_wheel(wheel, slope)).first->second;
      nexts[at] = next_of(motion, static_cast<int>(at.second), speeds);
    }
    return nexts;
  }
  // Returns the next speed of a foot that sticks, by its speeds around the first impact.
  static std::optional<double> next_of(const dynamics::SettledMotion& motion, int leg, const Speeds& speeds) {
    constexpr double springy = 0.5, much_friction = 10, most = 0.8;
    const auto step = [&](double eta) { return motion.step(leg, speeds.before, {eta, much_friction}); };
    const double dead = step(0).landing.omega_plus, high = step(springy).landing.omega_plus;
    const double eta = springy * (speeds.after - dead) / (high - dead);
    if (!(eta < most)) return std::nullopt;
    const dynamics::Step next = step(std::max(0.0, eta));
    return next.touched ? std::optional(next.omega_minus) : std::nullopt;
  }

  const WheelRuns& measured_;
  Misses noted_;
  std::map<At, Speeds> typical_;
  std::map<At, std::pair<double, double>> bounds_;
  std::map<At, std::optional<double>> as_noted_;
};

using MissesInOrder = std::function<Misses(const LegOrder&)>;

// The sum of squares between legs, the variance within them, and the number of stances.
struct BetweenLegs {
  double squares = 0, variance = 0;
  std::size_t count = 0;
};

BetweenLegs between_legs(const Misses& misses, std::size_t legs) {
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

std::optional<std::string> question_on_all(const WheelRuns& measured, const MissesInOrder& misses) {
  const Misses noted = misses({});
  const int legs = measured.wheel.legs();
  const auto size = static_cast<std::size_t>(legs);
  const BetweenLegs given = between_legs(noted, size);
  if (given.count < stances_a_leg * size) return std::nullopt;
  LegOrder best;
  BetweenLegs least = given;
  for (const bool backwards : {false, true})
    for (int first = 0; first < legs; ++first) {
      const LegOrder order{first, backwards};
      if (const BetweenLegs b = between_legs(misses(order), size); b.count == given.count && b.squares < least.squares)
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
                                            const MissesInOrder& misses) {
  const Misses noted = misses({});
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
    const auto turned = misses({.first = first});
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

// Returns how far next speeds under `settled` lie from the middle of those on the same ramp and leg, beside the omega+
// so many rows on [rad/s]. It returns nothing for too few of them.
std::optional<double> scatter_beside_row(const WheelRuns& measured, int off) {
  const auto wheels = wheels_on_ramps(measured, measured.contact, {});
  std::map<std::pair<std::size_t, int>, std::vector<double>> alike;
  for (const WheelRun& run : measured.runs)
    for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) {
      if (k == 0 && off < 0) continue;
      RunCollision m = run.collisions[k];
      m.after = run.collisions[off < 0 ? k - 1 : k + static_cast<std::size_t>(off)].after;
      if (!m.after || !(*m.after > 0)) continue;
      if (const auto next = expected_next(wheels[run.condition], {.leg = m.context.leg}, m))
        alike[{run.condition, m.context.leg}].push_back(run.collisions[k + 1].before - *next);
    }
  std::vector<double> distances;
  for (const auto& [where, misses] : alike) {
    if (misses.size() < least_alike) continue;
    const double middle = median(misses);
    for (const double miss : misses) distances.push_back(std::abs(miss - middle));
  }
  if (distances.size() < least_landings) return std::nullopt;
  return median_deviation_to_sd * median(std::move(distances));
}

}  // namespace

std::optional<std::string> question_on_leg_order(const WheelRuns& measured, const Experiment& experiment) {
  if (!measured.legs_known || !measured.speeds_after || measured.wheel.equal_legs() ||
      measured.wheel.leg_length.size() > most_legs)
    return std::nullopt;
  std::optional<SettledMisses> settled;
  if (measured.law == dynamics::Law::settled) settled.emplace(measured);
  const auto misses = [&](bool bounded) -> MissesInOrder {
    return [&, bounded](const LegOrder& order) {
      return settled ? settled->in(order, bounded) : stance_misses(measured, order);
    };
  };
  if (auto question = question_on_all(measured, misses(true))) return question;
  return question_on_some(measured, experiment, misses(false));
}

std::optional<std::string> question_on_rows(const WheelRuns& measured) {
  if (measured.law != dynamics::Law::settled || !measured.speeds_after) return std::nullopt;
  const auto as_given = scatter_beside_row(measured, 0);
  for (const int off : {-1, 1})
    if (const auto other = scatter_beside_row(measured, off); as_given && other && *other < row_off * *as_given)
      return fmt::format(
          "omega_plus_rad_s: next omega_minus_rad_s fit far better beside the values of the row {} (they scatter by "
          "{:.2g} rad/s, not {:.2g}): does the column stand a row {}?",
          off < 0 ? "before" : "behind", *other, *as_given, off < 0 ? "early" : "late");
  return std::nullopt;
}

}  // namespace metastable::analysis
