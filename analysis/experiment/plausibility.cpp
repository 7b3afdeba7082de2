#include "analysis/experiment/plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "analysis/experiment/rolling_speeds.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr double turn = 2 * std::numbers::pi;

// The mean speed of a step over the speed at its end is 0.56 to 0.72 in the middle of what engines and the virtual
// laboratory roll, at most 0.96, and falls as a wheel comes slowly over its foot. Units differ by more.
constexpr double least_time_share = 0.15, most_time_share = 1.5;
constexpr std::size_t least_steps_to_judge = 10;  // Times of a condition are judged from so many steps on.
// A step is a chord, up to 1.4 where feet slide, 1.00 to 1.04 in the middle of what engines roll. Lengths of legs that
// are diameters make it half of one, two legs of eight that are not listed 0.76.
constexpr double least_step_share = 0.85, most_step_share = 1.6;
constexpr double end_room = 2.5;       // A position may lie so many chords beyond the ramp's end.
constexpr double most_lifting = 1.25;  // Wheels whose feet lift at most steps are not rolling.
constexpr double ramp_room = 1.02;     // A ramp is measured to two per cent.

// A wheel that turns about its foot has the energy J omega^2 / 2, J = I + M L^2 of that foot. A collision adds none, so
// that it keeps at most the square root of the two J's ratio of the speed, which is never more than the longest leg
// over the shortest. Where feet bounce, the hub's own motion may turn into spin: in 20,000 collisions of the virtual
// laboratory and of wheels under the laws, 1.1 times the speed up to a mean restitution of 0.6, and 3.6 beyond.
constexpr double bouncing = 0.6;      // a mean restitution beyond which a wheel hops, and may gain speed
constexpr double gain_room = 1.1;     // on the ratio of legs: what bouncing feet add
constexpr double gain_sds = 4;        // of the errors of speeds, on top of it
constexpr double least_error = 0.05;  // of a speed that is read from angles [rad/s]
constexpr double most_exchanged = 4;  // times the speed before: an exchange of columns makes no larger gain

constexpr double chance_of_copy = 1e-6;

struct Unit {
  std::string_view name;
  double too_large;  // by how much a number in it is
};
constexpr Unit speed_units[] = {{"degrees per second", 360 / turn}, {"revolutions per minute", 60 / turn}};
// Speeds of half their size lie too near to those in rev/s for one of the two to be named alone.
constexpr Unit slow_units[] = {{"revolutions per second", 1 / turn}, {"speeds halved by a misstated frame rate", 0.5}};
constexpr Unit time_units[] = {
    {"milliseconds", 1e3}, {"microseconds", 1e6}, {"minutes", 1.0 / 60}, {"nanoseconds", 1e9}};
constexpr Unit length_units[] = {
    {"millimetres", 1e3}, {"centimetres", 1e2}, {"inches", 1 / 0.0254}, {"kilometres", 1e-3}};

// Names the units that would make a number plausible.
std::string suspected(std::span<const Unit> units, double number, double least, double most) {
  std::string names;
  for (const Unit& unit : units)
    if (number / unit.too_large >= least && number / unit.too_large <= most)
      names += fmt::format("{}{}", names.empty() ? "" : " or ", unit.name);
  return names.empty() ? "" : fmt::format(": {} are suspected", names);
}

// Holds the worst of the values that are not plausible, and where the first stands.
struct Odd {
  std::size_t count = 0, line = 0;
  double worst = 0;
  void add(std::size_t at, double value) {
    if (count++ == 0 || at < line) line = at;
    if (count == 1 || std::abs(value) > std::abs(worst)) worst = value;
  }
};

class Plausible {
 public:
  Plausible(const Experiment& experiment, const std::string& file, const CollisionLines& lines, Defects& defects)
      : experiment_(experiment), file_(file), lines_(lines), defects_(defects) {}

  // Says whether most collisions gain speed, which is reported.
  bool exchanged() {
    std::vector<double> kept = kept_shares();
    if (kept.empty()) return false;
    const double usual = median(kept), most = most_kept();
    if (usual <= most) return false;
    const auto gains = std::ranges::count_if(kept, [&](double share) { return share > most; });
    defects_.add(
        file_, {1, 1},
        fmt::format("omega_plus_rad_s: {} of {} collisions gain speed, half of them by a factor of {:.3g} or "
                    "more, where a wheel of these legs without a motor keeps at most {:.3g} of it: {}",
                    gains, kept.size(), usual, most,
                    usual <= most_exchanged ? "omega_minus_rad_s and omega_plus_rad_s are suspected to be exchanged"
                                            : "two units are suspected in omega_minus_rad_s and omega_plus_rad_s"));
    return true;
  }

  // The errors of speeds are no larger than their scatter about the share that is usually kept, stated or not.
  void gains() {
    const std::vector<double> kept = kept_shares();
    if (kept.empty()) return;
    const double usual = median(kept), most = most_kept();
    std::vector<double> off;
    each([&](std::size_t, std::size_t, const MeasuredCollision& c) {
      if (c.omega_plus) off.push_back(std::abs(*c.omega_plus - usual * c.omega_minus));
    });
    const double error = std::max({least_error, std::numbers::sqrt2 * experiment_.sensor.noise_sd.value_or(0),
                                   experiment_.sensor.last_digit.value_or(0), median_deviation_to_sd * median(off)});
    Odd gain;
    double before = 0, after = 0;
    each([&](std::size_t t, std::size_t i, const MeasuredCollision& c) {
      if (!c.omega_plus || *c.omega_plus <= most * c.omega_minus + gain_sds * error) return;
      gain.add(lines_[t][i], *c.omega_plus);
      if (gain.line == lines_[t][i]) before = c.omega_minus, after = *c.omega_plus;
    });
    if (gain.count == 0) return;
    report(gain, fmt::format("omega_plus_rad_s: {:.4g} rad/s where omega_minus_rad_s is {:.4g}: a wheel of these legs "
                             "without a motor keeps at most {:.3g} of its speed, here {:.4g} rad/s with errors",
                             after, before, most, most * before + gain_sds * error));
  }

  void speeds() {
    Odd fast;
    std::vector<double> later;
    double slowest = 0, fastest = 0, too_fast = 0;
    each([&](std::size_t t, std::size_t i, const MeasuredCollision& c) {
      const RollingSpeeds bounds = rolling_speeds(experiment_, experiment_.trials[t].condition);
      for (const std::optional<double>& speed : {std::optional(c.omega_minus), c.omega_plus})
        if (speed && std::abs(*speed) > bounds.fastest) fast.add(lines_[t][i], *speed), fastest = bounds.fastest;
      if (i > 0) later.push_back(c.omega_minus), slowest = std::max(slowest, bounds.slowest);
      too_fast = std::max({too_fast, most_lifting * bounds.lifting, fastest_steady(experiment_.trials[t].condition)});
    });
    if (fast.count > 0)
      return report(fast,
                    fmt::format("a speed of {:.4g} rad/s, where a wheel of these legs rolls at {:.3g} rad/s at "
                                "most (three times the speed at which its feet lift off){}",
                                fast.worst, fastest, suspected(speed_units, typical_speed(), slowest, fastest / 3)));
    if (later.size() < 3) return;
    const double middle = median(later);
    if (middle > too_fast) {
      defects_.add(
          file_, {1, 1},
          fmt::format("omega_minus_rad_s: half of the speeds from collision 2 on lie above {:.3g} rad/s, where "
                      "the feet of this wheel lift off at {:.3g} rad/s: speeds doubled by a misstated frame "
                      "rate are suspected",
                      middle, rolling_speeds(experiment_, 0).lifting));
      return;
    }
    if (middle >= slowest) return;
    defects_.add(
        file_, {1, 1},
        fmt::format("omega_minus_rad_s: half of the speeds from collision 2 on lie below {:.3g} rad/s, where a "
                    "wheel that has come over a leg on this ramp reaches {:.3g} rad/s{}",
                    middle, slowest / RollingSpeeds::room,
                    suspected(slow_units, middle, slowest, rolling_speeds(experiment_, 0).lifting)));
  }

  // A wheel turns by a leg angle from collision to collision, at speeds below those before and behind.
  void times() {
    std::vector<double> all;
    std::vector<std::vector<double>> of(experiment_.conditions.size());
    steps([&](std::size_t t, std::size_t, const MeasuredCollision& last, const MeasuredCollision& next) {
      if (!last.time || !next.time || next.omega_minus <= 0) return;
      all.push_back(experiment_.wheel.leg_angle() / (*next.time - *last.time) / next.omega_minus);
      of[experiment_.trials[t].condition].push_back(all.back());
    });
    if (all.empty() || refused_times(std::move(all), "")) return;
    for (std::size_t c = 0; c < of.size(); ++c)
      if (of[c].size() >= least_steps_to_judge &&
          refused_times(std::move(of[c]), fmt::format(" of condition '{}'", experiment_.conditions[c].id)))
        return;
  }

  void positions() {
    const double leg = experiment_.wheel.mean_leg_length(),
                 chord = 2 * leg * std::sin(experiment_.wheel.leg_angle() / 2);
    std::vector<double> share;
    steps([&](std::size_t, std::size_t, const MeasuredCollision& last, const MeasuredCollision& next) {
      if (last.position && next.position) share.push_back((*next.position - *last.position) / chord);
    });
    const double middle = share.empty() ? 1 : median(share);
    const bool of_feet = middle >= least_step_share && middle <= most_step_share;
    if (!of_feet) {
      const std::string unit = suspected(length_units, middle, least_step_share, most_step_share);
      defects_.add(
          file_, {1, 1},
          fmt::format("position_m: half of the steps are {:.4g} m or longer, where the feet of this wheel are "
                      "{:.4g} m apart{}",
                      middle * chord, chord,
                      unit.empty() ? "; are wheel.leg_lengths_m all its legs, from the hub to the tips?" : unit));
    }
    Odd beyond;
    double end = 0;
    each([&](std::size_t t, std::size_t i, const MeasuredCollision& c) {
      const double ramp = experiment_.conditions[experiment_.trials[t].condition].ramp_length;
      if (!c.position || *c.position <= ramp_room * ramp + end_room * chord) return;
      beyond.add(lines_[t][i], *c.position);
      end = ramp;
    });
    if (beyond.count > 0)
      report(beyond,
             fmt::format("position_m: goes up to {:.4g} m, where the ramp ends at {:.4g} m{}", beyond.worst, end,
                         !share.empty() && of_feet
                             ? "; its steps are those of the feet: is ramp_length_m right?"
                             : suspected(length_units, beyond.worst, 0, ramp_room * end + end_room * chord)));
  }

 private:
  // Says whether half of the steps are in another unit of time, which is reported.
  bool refused_times(std::vector<double> share, const std::string& where) {
    const double middle = median(std::move(share));
    if (middle >= least_time_share && middle <= most_time_share) return false;
    defects_.add(file_, {1, 1},
                 fmt::format("time_s: half of the steps{} would turn the wheel at {:.3g} of its speed before the next "
                             "collision, where 0.5 to 1 of it is usual{}",
                             where, middle, suspected(time_units, 0.75 / middle, least_time_share, most_time_share)));
    return true;
  }
  void each(const std::function<void(std::size_t, std::size_t, const MeasuredCollision&)>& look) const {
    for (std::size_t t = 0; t < experiment_.trials.size(); ++t)
      for (std::size_t i = 0; i < experiment_.trials[t].collisions.size(); ++i)
        look(t, i, experiment_.trials[t].collisions[i]);
  }
  void steps(const std::function<void(std::size_t, std::size_t, const MeasuredCollision&, const MeasuredCollision&)>&
                 look) const {
    each([&](std::size_t t, std::size_t i, const MeasuredCollision& c) {
      if (i > 0) look(t, i, experiment_.trials[t].collisions[i - 1], c);
    });
  }
  // Returns the shares of their speed that collisions keep; none of a wheel that hops.
  std::vector<double> kept_shares() const {
    std::vector<double> kept;
    if (experiment_.contact.restitution.mean > bouncing) return kept;
    each([&](std::size_t, std::size_t, const MeasuredCollision& c) {
      if (c.omega_plus && c.omega_minus > 0) kept.push_back(*c.omega_plus / c.omega_minus);
    });
    return kept;
  }
  double most_kept() const {
    const auto [shortest, longest] = std::ranges::minmax(experiment_.wheel.leg_length);
    return gain_room * longest / shortest;
  }
  // Returns the steady speed on its slope of a wheel that keeps three quarters of omega^2, or what plastic collisions
  // leave of it where that is more. No wheel of eight legs keeps so much under any law or engine.
  double fastest_steady(std::size_t condition) const {
    const dynamics::Wheel& wheel = experiment_.wheel;
    const double kept = std::max(0.75, std::pow(std::cos(wheel.leg_angle()), 2));
    const double slope = experiment_.conditions[condition].slope_deg * turn / 360;
    return std::sqrt(most_stance_gain(wheel, slope) / (1 - kept));
  }
  double typical_speed() const {
    std::vector<double> all;
    each([&](std::size_t, std::size_t, const MeasuredCollision& c) { all.push_back(c.omega_minus); });
    return median(all);
  }
  void report(const Odd& odd, const std::string& what) {
    defects_.add(file_, {odd.line, 1},
                 odd.count == 1 ? what : fmt::format("{} ({} rows from this one on)", what, odd.count));
  }

  const Experiment& experiment_;
  const std::string& file_;
  const CollisionLines& lines_;
  Defects& defects_;
};

// Returns for each condition and collision the chance that two trials have the same speed there by chance: the step of
// the last digit over 2 sqrt(pi) sds, for normal speeds. Trials that all begin alike are simulated ones, which may go
// on alike too: theirs is 1.
std::map<std::pair<std::size_t, std::size_t>, double> chances(const Experiment& experiment) {
  const double digit = std::max(experiment.sensor.last_digit.value_or(0), 1e-7);
  struct Sums {
    double count = 0, mean = 0, squares = 0;
    std::map<double, std::size_t> times;  // of each speed, at collision 1
  };
  std::map<std::pair<std::size_t, std::size_t>, Sums> sums;
  for (const MeasuredTrial& trial : experiment.trials)
    for (std::size_t i = 0; i < trial.collisions.size(); ++i) {
      Sums& of = sums[{trial.condition, i}];
      if (i == 0) ++of.times[trial.collisions[i].omega_minus];
      const double step = trial.collisions[i].omega_minus - of.mean;
      of.mean += step / ++of.count;
      of.squares += step * (trial.collisions[i].omega_minus - of.mean);
    }
  std::map<std::pair<std::size_t, std::size_t>, double> chance;
  for (const auto& [at, of] : sums) {
    const auto& launches = sums.at({at.first, 0}).times;
    if (std::ranges::any_of(launches, [&](const auto& one) {
          return one.second > 2 && 2 * static_cast<double>(one.second) > sums.at({at.first, 0}).count;
        })) {
      chance[at] = 1;
      continue;
    }
    const double sd = of.count > 1 ? std::sqrt(of.squares / (of.count - 1)) : 0;
    chance[at] = sd > 0 ? std::min(1.0, digit / (2 * std::sqrt(std::numbers::pi) * sd)) : 1;
  }
  return chance;
}

}  // namespace

void check_plausible(const Experiment& experiment, const std::string& file, const CollisionLines& lines,
                     Defects& defects) {
  if (experiment.trials.empty() || !defects.empty()) return;
  Plausible plausible(experiment, file, lines, defects);
  if (!plausible.exchanged()) plausible.speeds();
  if (defects.empty()) plausible.gains();
  if (defects.empty()) plausible.times();
  plausible.positions();
}

void check_copies(const Experiment& experiment, const std::string& file, const CollisionLines& lines,
                  Defects& defects) {
  const auto chance = chances(experiment);
  const double pairs =
      static_cast<double>(experiment.trials.size()) * static_cast<double>(experiment.trials.size()) / 2;
  std::map<std::vector<double>, std::size_t> first;  // trial with these speeds
  std::size_t copies = 0, copy = 0, original = 0;
  for (std::size_t t = 0; t < experiment.trials.size(); ++t) {
    const MeasuredTrial& trial = experiment.trials[t];
    std::vector<double> speeds;
    double by_chance = pairs;
    for (std::size_t i = 0; i < trial.collisions.size(); ++i) {
      speeds.push_back(trial.collisions[i].omega_minus);
      by_chance *= chance.at({trial.condition, i});
    }
    const auto [at, fresh] = first.emplace(std::move(speeds), t);
    if (fresh || by_chance > chance_of_copy) continue;
    if (copies++ == 0) copy = t, original = at->second;
  }
  if (copies == 0) return;
  const std::string one = fmt::format("trial {} has the speeds of trial {}, all {} of them to the last digit",
                                      experiment.trials[copy].number, experiment.trials[original].number,
                                      experiment.trials[copy].collisions.size());
  defects.add(file, {lines[copy].front(), 1},
              copies == 1 ? one + ": a copy; take one of them out"
                          : fmt::format("{}, and so have {} more trials those of others: copies; take them out", one,
                                        copies - 1));
}

}  // namespace metastable::analysis
