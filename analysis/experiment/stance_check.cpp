#include "analysis/experiment/stance_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "analysis/experiment/rolling_speeds.h"
#include "analysis/statistics/median.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t least_stances_to_judge = 20;
constexpr double radians = std::numbers::pi / 180;

// A stance adds to omega^2 what gravity gives, whatever its collision left: in trials of four engines, of the virtual
// laboratory and of wheels under the laws omega^2 behind a stance less that before it scatters by no more than the same
// taken a row off. In columns that stand a row off it is the other way round, by a factor of 5.
constexpr double row_off = 0.35;
constexpr std::size_t least_alike = 5;  // Stances of a ramp and a leg are held against their middle from so many on.
constexpr double hardly_unequal =
    1.05;  // Legs that nobody noted may differ by this ratio: theirs is the larger scatter.
// Feet that hop hide energy in omega+: stances of engines gain up to 1.26 times what gravity gives. A slope is rarely
// misread by more than 3 deg. Torques that resist take a tenth at 9 deg; a slope in per cent that is read in degrees
// leaves 0.43.
constexpr double least_gain = 0.7, questioned_gain = 1.5, refused_gain = 1.8, misread_slope = 3 * radians;
// The stances of these trials last 0.99 to 1.02 times what their speeds say. Feet that hop shorten that to 0.87, and
// then omega^2 gains more than gravity gives.
constexpr double time_room = 0.03, most_scatter = 0.1, too_long = 1.6;
// Hops keep a stance longer, the more so on steeper ramps: in rigid-body engines and in the virtual laboratory, for
// mean restitutions from 0.2 to 0.4, stances on two ramps of 6 to 12 deg differ so by up to 0.016 a degree, and by
// 0.007 on one. Speeds that are 5 % off make 0.08 or more.
constexpr double room_between_ramps = 0.04, room_a_degree = 0.02, most_scatter_of_hops = 0.06;
// Median shares of trials fall into two groups if these lie so many of the deviations within them apart. Of 70
// conditions of those recordings none came to more than 4.2; where half of the trials are 5 % off it is 12.
// Trials of one machine fall so far apart by chance in 1 of 100 folders of eight, and in 1 of 1000 of 16.
constexpr std::size_t stances_of_a_trial = 8, least_trials = 3, fewest_trials = 10;
constexpr double clearly_apart = 6;
// Steps are in distances between feet; sliding feet reach beyond both.
constexpr double slide_room = 1.1, two_steps = 1.8;

// A stance between two collisions: its trial and the collision behind it (indices), and the speeds [rad/s] at its ends.
struct MeasuredStance {
  std::size_t trial = 0, behind = 0;
  double from = 0, to = 0;
};

std::vector<MeasuredStance> measured_stances(const Experiment& experiment) {
  std::vector<MeasuredStance> all;
  for (std::size_t t = 0; t < experiment.trials.size(); ++t) {
    const std::vector<MeasuredCollision>& rows = experiment.trials[t].collisions;
    for (std::size_t k = 1; k < rows.size(); ++k)
      if (rows[k - 1].omega_plus && *rows[k - 1].omega_plus > 0)
        all.push_back({t, k, *rows[k - 1].omega_plus, rows[k].omega_minus});
  }
  return all;
}

double slope_of(const Experiment& experiment, std::size_t trial) {
  return experiment.conditions[experiment.trials[trial].condition].slope_deg * radians;
}

// Returns the stated inertia about the foot over that of a wheel whose mass is all in its hub.
double inertia_share(const Experiment& experiment) {
  const dynamics::Wheel& wheel = experiment.wheel;
  const double leg = wheel.mean_leg_length(), gyration = wheel.radius_of_gyration.value_or(0);
  return wheel.inertia ? *wheel.inertia / (wheel.hub_mass * leg * leg) : 1 + gyration * gyration / (leg * leg);
}

double gained(const MeasuredStance& stance) { return stance.to * stance.to - stance.from * stance.from; }

// Returns the median gain of stances over what `of_slope` says for theirs.
double gain_share(const Experiment& experiment, const std::vector<MeasuredStance>& stances,
                  const std::function<double(double)>& of_slope) {
  std::vector<double> share;
  for (const MeasuredStance& one : stances) share.push_back(gained(one) / of_slope(slope_of(experiment, one.trial)));
  return median(std::move(share));
}

// Returns how far the gains of omega^2 lie from the middle of those on the same ramp and the same noted leg, where
// omega_plus is taken so many rows on. It returns nothing for too few of them.
std::optional<double> scatter_of_gains(const Experiment& experiment, int off) {
  std::map<std::pair<std::size_t, int>, std::vector<double>> alike;  // They are by condition and leg.
  for (const MeasuredTrial& trial : experiment.trials) {
    const auto& rows = trial.collisions;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const std::size_t end = k + static_cast<std::size_t>(1 + off);
      if (end < rows.size() && rows[k].omega_plus && *rows[k].omega_plus > 0)
        alike[{trial.condition, rows[k].leg.value_or(-1)}].push_back(rows[end].omega_minus * rows[end].omega_minus -
                                                                     *rows[k].omega_plus * *rows[k].omega_plus);
    }
  }
  std::vector<double> distances;
  for (const auto& [where, gains] : alike) {
    if (gains.size() < least_alike) continue;
    const double middle = median(gains);
    for (const double gain : gains) distances.push_back(std::abs(gain - middle));
  }
  return distances.size() < least_stances_to_judge ? std::nullopt : std::optional(median(std::move(distances)));
}

// Says by how many rows omega_plus seems to stand off: -1 where a row has that of the collision before.
std::optional<int> rows_off(const Experiment& experiment) {
  const auto [shortest, longest] = std::ranges::minmax(experiment.wheel.leg_length);
  if (experiment.columns.leg == Presence::none && longest > hardly_unequal * shortest) return std::nullopt;
  const auto as_given = scatter_of_gains(experiment, 0);
  for (const int off : {-1, 1})
    if (const auto other = scatter_of_gains(experiment, off); as_given && other && *other < row_off * *as_given)
      return off;
  return std::nullopt;
}

// Says how long stances last by their speeds: omega^2 goes through both of them by the curve that gravity makes, either
// scaled to the usual gain (another inertia), or with a torque that makes up for the difference.
class Durations {
 public:
  Durations(const Experiment& experiment, const std::vector<MeasuredStance>& stances) : experiment_(experiment) {
    std::vector<std::vector<double>> gains(experiment.conditions.size());
    for (const MeasuredStance& one : stances) gains[experiment.trials[one.trial].condition].push_back(gained(one));
    const double half = experiment.wheel.leg_angle() / 2;
    for (std::size_t c = 0; c < gains.size(); ++c) {
      const double slope = experiment.conditions[c].slope_deg * radians;
      OnRamp on{gains[c].empty() ? 0 : median(std::move(gains[c])), most_stance_gain(experiment.wheel, slope), 0, {}};
      on.given_with_inertia = on.given / inertia_share(experiment);
      for (int i = 0; i < pieces; ++i)
        on.fallen[static_cast<std::size_t>(i)] =
            (std::cos(half - slope) - std::cos(slope + half * (2 * middle_of(i) - 1))) /
            (2 * std::sin(half) * std::sin(slope));
      ramps_.push_back(on);
    }
  }
  // Returns nothing if the wheel nearly stops, because small errors then decide.
  std::optional<std::array<double, 2>> of(const MeasuredStance& stance) const {
    constexpr double least_share = 0.2;  // It is a share of the omega^2 at the end.
    const OnRamp& on = ramps_[experiment_.trials[stance.trial].condition];
    const double width = experiment_.wheel.leg_angle() / pieces,
                 start = (stance.from * stance.from + stance.to * stance.to - on.usual) / 2;
    std::array<double, 2> time{};
    for (int i = 0; i < pieces; ++i) {
      const double fallen = on.fallen[static_cast<std::size_t>(i)];
      const std::array<double, 2> squared{start + on.usual * fallen,
                                          start + on.given * fallen + (on.usual - on.given) * middle_of(i)};
      for (std::size_t h = 0; h < 2; ++h) {
        if (squared[h] < least_share * stance.to * stance.to) return std::nullopt;
        time[h] += width / std::sqrt(squared[h]);
      }
    }
    return time;
  }
  // Says the same by the speed at the end alone, behind a foot that stands all the time.
  std::optional<double> from_end(const MeasuredStance& stance) const {
    constexpr double least_share = 0.1;
    const OnRamp& on = ramps_[experiment_.trials[stance.trial].condition];
    double time = 0;
    for (const double fallen : on.fallen) {
      const double squared = stance.to * stance.to - on.given_with_inertia * (1 - fallen);
      if (squared < least_share * stance.to * stance.to) return std::nullopt;
      time += experiment_.wheel.leg_angle() / pieces / std::sqrt(squared);
    }
    return time;
  }

 private:
  static constexpr int pieces = 40;  // A stance has so many, even in the angle.
  static double middle_of(int piece) { return (piece + 0.5) / pieces; }
  // One ramp: the gains of omega^2 [rad^2/s^2], and the share of them that gravity has given in the middle of each
  // piece.
  struct OnRamp {
    double usual = 0, given = 0, given_with_inertia = 0;
    std::array<double, pieces> fallen = {};
  };
  const Experiment& experiment_;
  std::vector<OnRamp> ramps_;  // They are in the order of conditions.
};

std::optional<double> time_of(const Experiment& experiment, const MeasuredStance& stance) {
  const auto& rows = experiment.trials[stance.trial].collisions;
  if (!rows[stance.behind].time || !rows[stance.behind - 1].time) return std::nullopt;
  return *rows[stance.behind].time - *rows[stance.behind - 1].time;
}

double relative_scatter(const std::vector<double>& values) {
  return median_deviation_to_sd * median_deviation(values) / median(values);
}

// Returns what chance may do to the median of so many values, as a share of it.
double left_by_chance(const std::vector<double>& values) {
  constexpr double sds = 3, of_a_median = 1.2533;  // sqrt(pi/2) sds of the mean, where values are normal
  return sds * of_a_median * relative_scatter(values) / std::sqrt(static_cast<double>(values.size()));
}

// Holds what the times of some stances say, and those among them that are too long.
struct TimesSaid {
  std::array<std::vector<double>, 2> share;  // It is the measured time over the expected one.
  std::size_t late = 0;
  const MeasuredStance* first = nullptr;
  double longest = 0;
  bool tell() const { return share[0].size() >= least_stances_to_judge && relative_scatter(share[0]) <= most_scatter; }
  // Returns the share if it contradicts the speeds.
  std::optional<double> contradiction(double gain) const {
    const auto [least, most] = std::minmax({median(share[0]), median(share[1])});
    const double room = time_room + left_by_chance(share[0]);
    if (least > 1 + room) return least;
    return most < 1 - room && gain < 1 ? std::optional(most) : std::nullopt;
  }
};

TimesSaid times_said(const Experiment& experiment, const Durations& durations,
                     const std::vector<MeasuredStance>& stances) {
  TimesSaid said;
  for (const MeasuredStance& one : stances) {
    const auto lasts = time_of(experiment, one);
    const auto expected = durations.of(one);
    if (!lasts || !expected) continue;
    for (std::size_t h = 0; h < 2; ++h) said.share[h].push_back(*lasts / (*expected)[h]);
    if (std::min(said.share[0].back(), said.share[1].back()) < too_long) continue;
    if (said.late++ == 0) said.first = &one;
    said.longest = std::max(said.longest, *lasts);
  }
  return said;
}

double gravity_share(const Experiment& experiment, const std::vector<MeasuredStance>& stances) {
  return gain_share(experiment, stances, [&](double slope) { return most_stance_gain(experiment.wheel, slope); });
}

std::vector<std::vector<MeasuredStance>> by_condition(const Experiment& experiment,
                                                      const std::vector<MeasuredStance>& stances) {
  std::vector<std::vector<MeasuredStance>> all(experiment.conditions.size());
  for (const MeasuredStance& one : stances) all[experiment.trials[one.trial].condition].push_back(one);
  return all;
}

constexpr const char* contradict = "time_s and the speeds contradict each other";
constexpr const char* is_it_right = "are frame rate, clock, scale and offset of the speeds right?";

void ask_about_times(const Experiment& experiment, const std::vector<MeasuredStance>& stances,
                     const Durations& durations, std::vector<std::string>& questions) {
  const auto ask = [&](const std::string& where, double share) {
    questions.push_back(fmt::format("{}{}: stances last {:.3g} times as long as the speeds at their ends say; {}",
                                    contradict, where, share, is_it_right));
  };
  const TimesSaid all = times_said(experiment, durations, stances);
  if (all.tell())
    if (const auto share = all.contradiction(gravity_share(experiment, stances))) return ask("", *share);
  const auto groups = by_condition(experiment, stances);
  for (std::size_t c = 0; c < groups.size(); ++c) {
    const TimesSaid said = times_said(experiment, durations, groups[c]);
    if (!said.tell()) continue;
    if (const auto share = said.contradiction(gravity_share(experiment, groups[c])))
      return ask(fmt::format(" in condition '{}'", experiment.conditions[c].id), *share);
  }
  if (all.tell() && all.late > 0 && questions.empty())  // A step that is too long has asked already.
    questions.push_back(fmt::format(
        "time_s: {} of {} stances last more than {} times as long as the speeds at their ends say, up to {:.3g} s, the "
        "first of them before collision {} of trial {}: does the clock jump, or is a collision missing?",
        all.late, all.share[0].size(), too_long, all.longest,
        experiment.trials[all.first->trial].collisions[all.first->behind].number,
        experiment.trials[all.first->trial].number));
}

// Returns the measured times over those that the speeds at the ends say, by trial.
std::map<std::size_t, std::vector<double>> shares_from_end(const Experiment& experiment, const Durations& durations,
                                                           const std::vector<MeasuredStance>& stances) {
  std::map<std::size_t, std::vector<double>> shares;
  for (const MeasuredStance& one : stances)
    if (const auto lasts = time_of(experiment, one))
      if (const auto expected = durations.from_end(one)) shares[one.trial].push_back(*lasts / *expected);
  return shares;
}

// Under `settled` hops decide how long stances last, and much the same in all conditions.
void compare_times_of_conditions(const Experiment& experiment, const std::vector<MeasuredStance>& stances,
                                 const Durations& durations, std::vector<std::string>& questions) {
  if (experiment.contact.law != dynamics::Law::settled) return;
  struct Judged {
    const Condition* condition;
    double chance, share;
  };
  std::vector<Judged> judged;
  const auto groups = by_condition(experiment, stances);
  for (std::size_t c = 0; c < groups.size(); ++c) {
    std::vector<double> shares;
    for (const auto& [trial, some] : shares_from_end(experiment, durations, groups[c]))
      shares.insert(shares.end(), some.begin(), some.end());
    if (shares.size() >= least_stances_to_judge && relative_scatter(shares) <= most_scatter_of_hops)
      judged.push_back({&experiment.conditions[c], left_by_chance(shares), median(shares)});
  }
  for (const Judged& one : judged)
    for (const Judged& other : judged) {
      const double steeper = std::max(0.0, one.condition->slope_deg - other.condition->slope_deg);
      const double room = room_between_ramps + room_a_degree * steeper + std::hypot(one.chance, other.chance);
      if (one.share <= (1 + room) * other.share) continue;
      return questions.push_back(fmt::format(
          "{}: by the speeds at their ends, stances of condition '{}' last {:.3g} times as long as those of condition "
          "'{}'; {}",
          contradict, one.condition->id, one.share / other.share, other.condition->id, is_it_right));
    }
}

// Holds a trial (index) and the median share of its stances.
using TrialShare = std::pair<double, std::size_t>;

// Returns how many of the sorted trials make the first of two groups that lie clearly apart; 0: they do not.
std::size_t first_group(const std::vector<TrialShare>& sorted) {
  if (sorted.size() < fewest_trials) return 0;
  std::size_t best = 0;
  double most = clearly_apart;
  for (std::size_t k = least_trials; k + least_trials <= sorted.size(); ++k) {
    const auto middle = [&](std::size_t from, std::size_t to) { return sorted[(from + to) / 2].first; };
    const double low = middle(0, k), high = middle(k, sorted.size());
    double squares = 0;
    for (std::size_t i = 0; i < sorted.size(); ++i) squares += std::pow(sorted[i].first - (i < k ? low : high), 2);
    const double within = std::sqrt(squares / static_cast<double>(sorted.size() - 2));
    if (high < (1 + time_room) * low || high - low <= most * within) continue;
    best = k;
    most = within > 0 ? (high - low) / within : most;
  }
  return best;
}

// Frame rate, clock or scale may change from one trial to another.
void compare_times_of_trials(const Experiment& experiment, const std::vector<MeasuredStance>& stances,
                             const Durations& durations, std::vector<std::string>& questions) {
  const auto groups = by_condition(experiment, stances);
  for (std::size_t c = 0; c < groups.size(); ++c) {
    std::vector<TrialShare> sorted;
    for (auto& [trial, shares] : shares_from_end(experiment, durations, groups[c]))
      if (shares.size() >= stances_of_a_trial) sorted.emplace_back(median(shares), trial);
    std::ranges::sort(sorted);
    const std::size_t low = first_group(sorted), high = sorted.size() - low;
    if (low == 0) continue;
    const auto split = sorted.begin() + static_cast<long>(low);
    const bool few_are_high = high <= low;
    std::size_t first = experiment.trials.size();
    for (auto one = few_are_high ? split : sorted.begin(); one != (few_are_high ? sorted.end() : split); ++one)
      first = std::min(first, one->second);
    const double ratio = sorted[low + high / 2].first / sorted[low / 2].first;
    return questions.push_back(
        fmt::format("{} in some trials: in {} of {} trials of condition '{}', the first of them trial {}, stances last "
                    "{:.3g} times as long as in the others, by the speeds at their ends; {}",
                    contradict, few_are_high ? high : low, sorted.size(), experiment.conditions[c].id,
                    experiment.trials[first].number, few_are_high ? ratio : 1 / ratio, is_it_right));
  }
}

void ask_about_positions(const Experiment& experiment, std::vector<std::string>& questions) {
  const double apart = 2 * experiment.wheel.mean_leg_length() * std::sin(experiment.wheel.leg_angle() / 2);
  std::vector<double> steps;
  std::vector<std::pair<int, int>> long_ones;  // They are trials with their collisions.
  for (const MeasuredTrial& trial : experiment.trials)
    for (std::size_t k = 1; k < trial.collisions.size(); ++k) {
      const MeasuredCollision &last = trial.collisions[k - 1], &next = trial.collisions[k];
      if (!last.position || !next.position) continue;
      steps.push_back((*next.position - *last.position) / apart);
      if (steps.back() > two_steps) long_ones.emplace_back(trial.number, next.number);
    }
  if (long_ones.empty() || steps.size() < least_stances_to_judge) return;
  const auto beyond = std::ranges::count_if(steps, [](double step) { return step > slide_room; });
  if (static_cast<std::size_t>(beyond) > 2 * long_ones.size()) return;  // Its feet slide.
  questions.push_back(
      fmt::format("position_m: {} of {} steps are longer than {} times the {:.3g} m between its feet, the first of "
                  "them before collision {} of trial {}: is a collision missing?",
                  long_ones.size(), steps.size(), two_steps, apart, long_ones.front().second, long_ones.front().first));
}

}  // namespace

void check_stances(const Experiment& experiment, const std::string& file, Defects& defects) {
  const std::vector<MeasuredStance> stances = measured_stances(experiment);
  if (stances.size() < least_stances_to_judge || !defects.empty()) return;
  const auto refuse = [&](const std::vector<MeasuredStance>& of, const std::string& where) {
    if (of.size() < least_stances_to_judge) return false;
    const double share = gain_share(experiment, of, [&](double slope) {
      return most_stance_gain(experiment.wheel, std::min(slope + misread_slope, std::numbers::pi / 2));
    });
    if (share <= refused_gain) return false;
    const double given = gravity_share(experiment, of);
    defects.add(
        file, {1, 1},
        fmt::format("half of the stances{} raise omega^2 by {:.3g} times what gravity gives this wheel on the stated "
                    "slope, or more: speeds {:.2g} times too large are suspected, as by a misstated frame rate or unit",
                    where, given, std::sqrt(given)));
    return true;
  };
  if (refuse(stances, "")) return;
  const auto groups = by_condition(experiment, stances);
  for (std::size_t c = 0; c < groups.size(); ++c)
    if (refuse(groups[c], fmt::format(" of condition '{}'", experiment.conditions[c].id))) return;
  if (const auto off = rows_off(experiment))
    defects.add(
        file, {1, 1},
        fmt::format("omega_plus_rad_s: its values are suspected to stand one row {}: from omega_plus to the "
                    "next omega_minus, gravity raises omega^2 by much the same in all stances, and does so from a "
                    "row's omega_plus to {}",
                    *off < 0 ? "late" : "early",
                    *off < 0 ? "the same row's omega_minus" : "the omega_minus two rows on"));
}

std::vector<std::string> questions_on_stances(const Experiment& experiment) {
  std::vector<std::string> questions;
  ask_about_positions(experiment, questions);
  const std::vector<MeasuredStance> stances = measured_stances(experiment);
  if (stances.size() < least_stances_to_judge) return questions;
  const double gain = gravity_share(experiment, stances);
  const double stated = gain * inertia_share(experiment);
  if (gain > questioned_gain || stated < least_gain)
    questions.push_back(fmt::format(
        "half of the stances raise omega^2 by {:.3g} times what gravity gives this wheel on the stated slope, or {}: "
        "are slope, leg lengths, inertia and the scale of the speeds right{}?",
        stated, stated < least_gain ? "less" : "more", stated < least_gain ? ", or does a torque resist it" : ""));
  const Durations durations(experiment, stances);
  const std::size_t before = questions.size();
  ask_about_times(experiment, stances, durations, questions);
  if (questions.size() == before) compare_times_of_conditions(experiment, stances, durations, questions);
  if (questions.size() == before) compare_times_of_trials(experiment, stances, durations, questions);
  return questions;
}

}  // namespace metastable::analysis
