#include "analysis/statistics/level_crossings.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double steepest = 700;      // height that stands for an infinite one
constexpr double of_interval = 0.05;  // of an interval's half, left of each of its ends
constexpr double of_spacing = 1e-6;   // of the points' spacing, below which no place is told apart
constexpr int most_turns = 3;         // steps towards a turning point
constexpr std::uintmax_t most_halvings = 60;

double bounded(double height) { return std::clamp(height, -steepest, steepest); }

class Search {
 public:
  Search(const Curve& curve, double from, double to, const CrossingOptions& options)
      : curve_(curve), from_(from), to_(to), options_(options) {
    if (!(from < to)) throw std::invalid_argument(fmt::format("range: from {} to {} is none", from, to));
    if (options.points < 3) throw std::invalid_argument(fmt::format("points: {} is below 3", options.points));
    if (options.logarithmic && !(from > 0)) throw std::invalid_argument(fmt::format("range: {} is not above 0", from));
  }

  Crossings run() {
    Crossings found;
    found.scanned = scan();
    turns();
    std::vector<double> places;
    for (const auto& [at, height] : known_) places.push_back(at);
    for (std::size_t i = 1; i < places.size(); ++i) {
      const double below = known_.at(places[i - 1]).value, above = known_.at(places[i]).value;
      if ((below < 0) != (above < 0)) found.crossings.push_back(crossing(places[i - 1], places[i]));
    }
    return found;
  }

 private:
  // Places are told by where they lie on the scale.
  double scaled(double at) const { return options_.logarithmic ? std::log(at) : at; }
  double place(double s) const {
    if (s <= scaled(from_)) return from_;
    if (s >= scaled(to_)) return to_;
    return options_.logarithmic ? std::exp(s) : s;
  }
  double resolution() const {
    return of_spacing * (scaled(to_) - scaled(from_)) / static_cast<double>(options_.points - 1);
  }

  double scan_place(std::size_t i) const {
    const double share = static_cast<double>(i) / static_cast<double>(options_.points - 1);
    return i + 1 == options_.points ? scaled(to_) : scaled(from_) + share * (scaled(to_) - scaled(from_));
  }

  void count() {
    ++looked_at_;
    if (options_.progress) options_.progress(looked_at_);
  }

  std::vector<CurvePoint> scan() {
    std::vector<CurvePoint> points(options_.points);
    std::mutex mutex;
    markov::parallel_for(points.size(), options_.threads, [&](std::size_t i) {
      const double at = place(scan_place(i));
      points[i] = curve_(at, 1);
      points[i].at = at;
      const std::scoped_lock lock(mutex);
      count();
    });
    for (std::size_t i = 0; i < points.size(); ++i)
      if (points[i].unknown.empty()) known_[scan_place(i)] = points[i].height;
    return points;
  }

  // @throws std::runtime_error where it is unknown
  const Estimate& height(double s) {
    const auto [entry, is_new] = known_.try_emplace(s);
    if (is_new) {
      CurvePoint point = curve_(place(s), options_.threads);
      count();
      if (!point.unknown.empty()) {
        known_.erase(entry);
        throw std::runtime_error(fmt::format("at {:.6g}: {}", place(s), point.unknown));
      }
      entry->second = point.height;
    }
    return entry->second;
  }

  // Looks whether the curve reaches zero where three neighbours show it turning towards it.
  void turns() {
    std::vector<double> places;
    for (const auto& [at, height] : known_) places.push_back(at);
    for (std::size_t i = 1; i + 1 < places.size(); ++i) {
      double left = places[i - 1], middle = places[i], right = places[i + 1];
      for (int turn = 0; turn < most_turns; ++turn) {
        const std::optional<double> next = turning_point(left, middle, right);
        if (!next) break;
        const double was = known_.at(middle).value, is = height(*next).value;
        if ((was < 0) != (is < 0)) break;
        const bool nearer = std::abs(is) < std::abs(was);
        double& replaced = (*next < middle) == nearer ? right : left;
        replaced = nearer ? middle : *next;
        if (nearer) middle = *next;
      }
    }
  }

  // Returns where the parabola through three points turns, if it does so nearer to zero than the middle one and all
  // three lie on one side.
  std::optional<double> turning_point(double left, double middle, double right) const {
    const double a = bounded(known_.at(left).value), b = bounded(known_.at(middle).value),
                 c = bounded(known_.at(right).value);
    if ((a < 0) != (b < 0) || (b < 0) != (c < 0)) return std::nullopt;
    if (std::abs(b) >= std::abs(a) || std::abs(b) >= std::abs(c)) return std::nullopt;
    const double x = left, y = middle, z = right;
    const double p = (y - x) * (y - x) * (b - c), q = (y - z) * (y - z) * (b - a);
    const double down = 2 * ((y - x) * (b - c) - (y - z) * (b - a));
    if (down == 0) return std::nullopt;
    const double turn = y - (p - q) / down;
    if (!(turn > x + resolution() && turn < z - resolution()) || std::abs(turn - y) < resolution()) return std::nullopt;
    return turn;
  }

  // Solves for a part of the height between two places of different sign, to `tolerance` as the scale has it.
  double solve(double low, double high, double Estimate::*part, double tolerance) {
    const auto at = [&](double s) { return bounded(height(s).*part); };
    const double at_low = bounded(known_.at(low).*part), at_high = bounded(known_.at(high).*part);
    if (at_low == 0) return low;
    if (at_high == 0) return high;
    std::uintmax_t steps = most_halvings;
    const auto [lower, upper] = boost::math::tools::toms748_solve(
        at, low, high, at_low, at_high, [&](double l, double u) { return u - l <= tolerance; }, steps);
    // Nearer to the end whose height is nearer to zero.
    const double l = std::abs(at(lower)), u = std::abs(at(upper));
    return l + u > 0 && l < steepest && u < steepest ? (lower * u + upper * l) / (l + u) : 0.5 * (lower + upper);
  }

  Crossing crossing(double low, double high) {
    Crossing result;
    result.rising = known_.at(low).value < 0;
    // About as far as the interval reaches to either side: by the secant of the neighbours.
    const double width = high - low;
    const double rise = std::abs(bounded(known_.at(high).value) - bounded(known_.at(low).value)) / width;
    const auto half = [&](const Estimate& e) { return 0.5 * (bounded(e.upper) - bounded(e.lower)); };
    const double reach = std::min(half(known_.at(low)), half(known_.at(high))) / rise;
    const double tolerance = std::max(resolution(), 0.5 * of_interval * std::min(reach, width));
    const double at = solve(low, high, &Estimate::value, tolerance);
    height(at);
    result.at.value = place(at);
    const bool rising = result.rising;
    const auto [lower, open_below] = end(at, -1, rising ? &Estimate::upper : &Estimate::lower, rising);
    const auto [upper, open_above] = end(at, 1, rising ? &Estimate::lower : &Estimate::upper, !rising);
    result.at.lower = place(lower), result.open_below = open_below;
    result.at.upper = place(upper), result.open_above = open_above;
    return result;
  }

  // Goes from a crossing to the side where the interval no longer holds zero. @param below  there that part is negative
  std::pair<double, bool> end(double from, int side, double Estimate::*part, bool below) {
    const auto beyond = [&](double at) { return below ? known_.at(at).*part < 0 : known_.at(at).*part > 0; };
    if (beyond(from)) return {from, false};
    double last = from;
    for (auto next = known_.find(from);;) {
      if (side < 0 ? next == known_.begin() : std::next(next) == known_.end())
        return {scaled(side < 0 ? from_ : to_), true};
      side < 0 ? --next : ++next;
      if (beyond(next->first)) {
        const double other = next->first;
        const double guess = nearer_guess(last, other, part);
        height(guess);
        const bool inside = !beyond(guess);
        const double near = inside ? guess : last, far = inside ? other : guess;
        const double tolerance = std::max(resolution(), of_interval * std::abs(guess - from));
        const double found = solve(std::min(near, far), std::max(near, far), part, tolerance);
        return {found, false};
      }
      last = next->first;
    }
  }

  // Returns where the secant of two places has zero, a little within both.
  double nearer_guess(double a, double b, double Estimate::*part) const {
    const double at_a = bounded(known_.at(a).*part), at_b = bounded(known_.at(b).*part);
    const double share = std::clamp(at_a / (at_a - at_b), 0.01, 0.99);
    return a + share * (b - a);
  }

  const Curve& curve_;
  double from_, to_;
  const CrossingOptions& options_;
  std::map<double, Estimate> known_;  // by place on the scale
  std::size_t looked_at_ = 0;
};

}  // namespace

Crossings level_crossings(const Curve& curve, double from, double to, const CrossingOptions& options) {
  return Search(curve, from, to, options).run();
}

}  // namespace metastable::analysis
