#include "analysis/wheel_model/wheel_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "analysis/statistics/median.h"
#include "analysis/statistics/random.h"
#include "analysis/wheel_model/leg_order.h"
#include "analysis/wheel_model/standing_feet.h"
#include "analysis/wheel_model/wheel_columns.h"
#include "dynamics/numerics/truncated_normal.h"
#include "dynamics/settled/landing_grid.h"
#include "dynamics/settled/settled_density.h"

namespace metastable::analysis {
namespace {

using dynamics::ExtendedWheel;

constexpr double assumed_noise = 0.01;  // sd of reported speeds where neither text nor stances say it [rad/s]
// Fewer stances than these do not tell the noise of the speeds.
constexpr std::size_t least_stances = 20;
// So many stances without a residual show that the speeds were computed by the model: of two measured ones that happens
// by chance once in 1e5 experiments.
constexpr std::size_t least_exact = 2;
// A stance's residual is the difference of two reported speeds, the earlier one damped to 0.65 on the way: its sd is
// sqrt(1 + 0.65^2) times the noise of one.
constexpr double two_speeds = 1.2;
// Residuals below this come from the printed digits [rad/s].
constexpr double rounding = 1e-5;
// The noise is taken to be at least this: with less, the model's own numbers would have to be exact [rad/s].
constexpr double finest_noise = 1e-5;
constexpr const char* repeat_the_model =
    "the stances repeat the model to rounding, as simulated ones do: they are left out";
// The median deviation of n values has a standard error of 1.17 / sqrt(n) of itself: 4 / sqrt(n) is three and a half of
// these.
constexpr double chance_of_deviation = 4;

std::vector<ExtendedWheel> stated_wheels(const WheelRuns& measured) { return wheels_on_ramps(measured, {}, {}); }

// Returns the median distance of values from `middle`.
double median_deviation(std::vector<double> values, double middle) {
  for (double& value : values) value = std::abs(value - middle);
  return median(values);
}

// Where legs were not noted the stances tell them if omega_plus is there, because the legs' lengths differ.
void find_legs(WheelRuns& measured, bool column) {
  if (column || measured.wheel.equal_legs()) {
    measured.legs_known = column;
    return;
  }
  measured.legs_known = measured.speeds_after;
  const int legs = measured.wheel.legs();
  const std::vector<ExtendedWheel> stated = stated_wheels(measured);
  std::size_t found = 0;
  for (WheelRun& run : measured.runs) {
    std::vector<double> misfit(static_cast<std::size_t>(legs));
    for (int first = 0; first < legs && measured.speeds_after; ++first)
      for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k) {
        if (!run.collisions[k].after) continue;
        const auto next =
            expected_next(stated[run.condition], {.leg = (first + static_cast<int>(k)) % legs}, run.collisions[k]);
        const double miss = next ? run.collisions[k + 1].before - *next : 1;
        misfit[static_cast<std::size_t>(first)] += std::min(1.0, miss * miss);
      }
    const auto best = std::min_element(misfit.begin(), misfit.end());
    double second = std::numeric_limits<double>::infinity();
    for (auto m = misfit.begin(); m != misfit.end(); ++m)
      if (m != best) second = std::min(second, *m);
    const double steps = static_cast<double>(run.collisions.size());
    const double variance = std::max({2 * measured.noise * measured.noise, *best / steps, 1e-8});
    found += (second - *best) / (2 * variance) > 3;
    for (std::size_t k = 0; k < run.collisions.size(); ++k)
      run.collisions[k].context.leg =
          static_cast<int>((static_cast<std::size_t>(best - misfit.begin()) + k) % static_cast<std::size_t>(legs));
  }
  measured.legs_known =
      measured.speeds_after && static_cast<double>(found) >= 0.9 * static_cast<double>(measured.runs.size());
  if (measured.legs_known) {
    measured.notes.push_back("leg is missing: found for each trial from its stances, whose legs differ in length");
    return;
  }
  // The least next speed, just over the top, differs between legs.
  double sum = 0, squares = 0;
  for (int leg = 0; leg < legs; ++leg) {
    const ExtendedWheel& wheel = stated.front();
    const double least = wheel.next({.leg = leg}, 1.001 * wheel.barrier({.leg = leg})).value_or(0);
    sum += least / legs;
    squares += least * least / legs;
  }
  measured.slack = std::sqrt(std::max(0.0, squares - sum * sum));
  measured.notes.push_back(
      "leg is missing: legs of the mean length are taken, and no effect of a single leg can be told");
  for (WheelRun& run : measured.runs)
    for (RunCollision& m : run.collisions) m.context.leg = 0;
  std::fill(measured.wheel.leg_length.begin(), measured.wheel.leg_length.end(), measured.wheel.mean_leg_length());
}

// Says by how much the speeds before collisions scatter about what the times since the collisions before imply [rad/s];
// nothing where too few times were measured.
std::optional<double> scatter_about_times(const WheelRuns& measured) {
  constexpr double change = 1e-3;  // of a speed, for its slope by time
  const std::vector<ExtendedWheel> wheels = stated_wheels(measured);
  std::vector<double> residual;
  for (const WheelRun& run : measured.runs)
    for (std::size_t k = 1; k < run.collisions.size(); ++k) {
      const ExtendedWheel& wheel = wheels[run.condition];
      const RunCollision &m = run.collisions[k], &previous = run.collisions[k - 1];
      const auto from = wheel.back(previous.context, m.before),
                 faster = wheel.back(previous.context, m.before * (1 + change));
      if (!m.context.since_previous || !from || !faster) continue;
      const double time = wheel.duration(previous.context, *from);
      const double slope = (wheel.duration(previous.context, *faster) - time) / (change * m.before);
      if (slope < 0) residual.push_back((*m.context.since_previous - time) / slope);
    }
  if (residual.size() < least_stances) return std::nullopt;
  const double middle = median(residual);
  return median_deviation_to_sd * median_deviation(std::move(residual), middle);
}

// A time since the collision before that is far more exact than the speeds tells how they are off: whoever judged what
// a model leaves by it would find the noise there.
void judge_times(WheelRuns& measured) {
  constexpr double largest_share = 0.25;               // of the speeds' own deviation
  if (measured.law == dynamics::Law::settled) return;  // its hops scatter times by themselves
  std::vector<double> speeds;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) speeds.push_back(m.before);
  const std::optional<double> scatter = scatter_about_times(measured);
  if (!scatter) return;
  const double middle = median(speeds), own = median_deviation_to_sd * median_deviation(std::move(speeds), middle);
  measured.times_judge = !(own > 0) || *scatter < largest_share * own;  // a design to be drawn from has one speed
  if (!measured.times_judge)
    measured.notes.push_back(fmt::format(
        "speeds and those that time_s implies differ by {:.2g} rad/s: what is left is not judged by the time since the "
        "previous collision",
        *scatter));
}

// Positions and times that were not measured follow from the geometry.
void complete_contexts(WheelRuns& measured) {
  const std::vector<ExtendedWheel> wheels = stated_wheels(measured);
  for (WheelRun& run : measured.runs) {
    const ExtendedWheel& stated = wheels[run.condition];
    double position = 0;
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      RunCollision& m = run.collisions[k];
      if (k > 0) {
        const RunCollision& previous = run.collisions[k - 1];
        position += stated.advance(previous.context.leg);
        if (!m.context.since_previous) {
          const auto from = previous.after ? previous.after : stated.back(previous.context, m.before);
          if (from && *from > 0) m.context.since_previous = stated.duration(previous.context, *from);
        }
      }
      if (std::isnan(m.context.position)) m.context.position = position;
    }
  }
}

// Says by how much each stance misses the model's next speed [rad/s], by condition and leg.
std::vector<std::vector<double>> stance_residuals(const WheelRuns& measured) {
  const std::size_t legs = measured.wheel.leg_length.size();
  std::vector<std::vector<double>> residual(measured.conditions.size() * legs);
  const std::vector<ExtendedWheel> wheels = stated_wheels(measured);
  for (const WheelRun& run : measured.runs) {
    const ExtendedWheel& stated = wheels[run.condition];
    for (std::size_t k = 0; k + 1 < run.collisions.size(); ++k)
      if (run.collisions[k].after)
        if (const auto next = expected_next(stated, run.collisions[k].context, run.collisions[k]))
          residual[run.condition * legs + static_cast<std::size_t>(run.collisions[k].context.leg)].push_back(
              run.collisions[k + 1].before - *next);
  }
  return residual;
}

// Returns a word that the reported speeds make.
std::uint64_t word_of(const WheelRuns& measured) {
  std::uint64_t word = 0;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) word = std::rotl(word, 7) * 5 + std::bit_cast<std::uint64_t>(m.before);
  return word;
}

using Landings = std::map<std::pair<std::size_t, std::size_t>, std::vector<RunCollision*>>;

// Gathers collisions by condition and number.
Landings landings_by_number(WheelRuns& measured) {
  Landings alike;
  for (WheelRun& run : measured.runs)
    for (std::size_t k = 0; k < run.collisions.size(); ++k) alike[{run.condition, k}].push_back(&run.collisions[k]);
  return alike;
}

// Adds a normal error of that sd [rad/s] to every speed, the same for the same measured numbers; speeds stay positive.
void add_normal_errors(WheelRuns& measured, double added) {
  const std::uint64_t seed = word_of(measured);
  std::uint64_t draw = 0;
  for (auto& [where, landings] : landings_by_number(measured)) {
    const std::vector<double> before = even_normals(seed, draw++, landings.size());
    const std::vector<double> after = even_normals(seed, draw++, landings.size());
    for (std::size_t i = 0; i < landings.size(); ++i) {
      RunCollision& m = *landings[i];
      m.before = std::max(1e-3, m.before + added * before[i]);
      if (m.after && *m.after > 0) m.after = std::max(1e-3 * *m.after, *m.after + added * after[i]);
    }
  }
}

// Digits round evenly: where they are most of the noise, the stances' errors have no tails, which no model of noise
// foretells. A normal error of some digits is added, beside which that does not show; the noise knows of it.
void blur_digits(WheelRuns& measured, double digits) {
  constexpr double least_normal = 2;  // noise beside the digits', in those
  const double rest = std::sqrt(std::max(0.0, measured.noise * measured.noise - digits * digits));
  if (!(digits > 0) || rest >= least_normal * digits || !measured.speeds_after || measured.exact_stances) return;
  const double added = std::sqrt(least_normal * least_normal * digits * digits - rest * rest);
  add_normal_errors(measured, added);
  measured.noise = std::hypot(measured.noise, added);
  measured.notes.push_back(
      fmt::format("digits are most of the noise, and rounding has no tails: a normal error of {:.2g} rad/s is added to "
                  "every speed, {:.2g} rad/s in all",
                  added, measured.noise));
}

// Constant contacts, as those of `plastic`, leave speeds that scatter by the error of the sensor alone. If speeds are
// exact to rounding, the model's collisions cannot be held against them: the normal error of a good sensor is added.
void blur_exact(WheelRuns& measured) {
  constexpr double added = imagined_noise;
  add_normal_errors(measured, added);
  if (measured.exact_stances) measured.notes.pop_back();
  measured.notes.push_back(fmt::format("{}: a normal error of {:.2g} rad/s is added to every speed",
                                       measured.exact_stances
                                           ? "collisions and stances repeat the model to rounding, as simulated ones do"
                                           : "contacts are stated to be constant, and speeds are exact to rounding",
                                       added));
  measured.noise = added;
  measured.noise_stated = true;
  measured.exact_stances = false;
}

// Says whether contacts are stated to be constant while speeds are exact to rounding.
bool repeats_the_model(const WheelRuns& measured) {
  constexpr double most = 3 * finest_noise;
  if (measured.law == dynamics::Law::plastic) return measured.exact_stances;
  return measured.contact.restitution_sd == 0 && measured.contact.friction_sd == 0 && measured.noise < most;
}

// A stated noise is that of the sensor, the digits' comes to it, and a stated 0 means as good as the digits. Where
// nobody stated it, or the stances are more exact than was said, they tell it.
void estimate_noise(WheelRuns& measured, const Sensor& sensor) {
  const std::optional<double> stated = sensor.noise_sd;
  const double digits = sensor.last_digit.value_or(0) / std::sqrt(12.0), least = std::max(finest_noise, digits);
  measured.noise = std::hypot(stated.value_or(0), least);
  measured.noise_stated = stated.has_value();
  if (stated && digits > *stated)
    measured.notes.push_back(
        fmt::format("sensor noise of {:.2g} rad/s is stated: {:.2g} rad/s taken, that of the digits printed", *stated,
                    measured.noise));
  std::vector<std::vector<double>> groups;
  if (measured.speeds_after) groups = stance_residuals(measured);
  std::vector<double> residual;
  for (const std::vector<double>& group : groups) residual.insert(residual.end(), group.begin(), group.end());
  const auto is_exact = [](double value) { return std::abs(value) < rounding; };
  const bool few = residual.size() < least_stances;
  if (few && residual.size() >= least_exact && stated.value_or(0) < rounding &&
      std::ranges::all_of(residual, is_exact)) {
    measured.exact_stances = true;
    measured.noise = measured.noise_seen = least;
    measured.notes.push_back(repeat_the_model);
    return;
  }
  if (few) {
    if (stated) return;
    measured.noise = assumed_noise;
    measured.notes.push_back(fmt::format("no sensor noise is stated: {} rad/s assumed", assumed_noise));
    return;
  }
  const double middle = median(residual), size = std::sqrt(static_cast<double>(residual.size()));
  const double overall = median_deviation(residual, middle);
  // What legs and ramps do to all their stances is no noise.
  constexpr std::size_t fewest = 8;  // of one leg on one ramp
  auto own = residual.begin();
  for (const std::vector<double>& group : groups) {
    const double its_middle = group.size() < fewest ? middle : median(group);
    own = std::transform(group.begin(), group.end(), own, [&](double value) { return value - its_middle; });
  }
  const double deviation = median_deviation(residual, 0);
  double seen = std::max(least, median_deviation_to_sd * deviation / two_speeds);
  measured.noise_seen = seen;
  if (seen < least * (1 + chance_of_deviation / size)) seen = least;
  measured.exact_stances = stated.value_or(0) < rounding && std::abs(middle) < rounding && overall < rounding;
  if (measured.exact_stances) {
    measured.noise = seen;
    measured.notes.push_back(repeat_the_model);
  } else if (!stated) {
    measured.noise = seen;
    measured.notes.push_back(
        fmt::format("no sensor noise is stated: {:.2g} rad/s taken from the stances", measured.noise));
  } else if (sensor.last_digit && seen * (1 + chance_of_deviation / size) < measured.noise) {
    measured.notes.push_back(fmt::format(
        "sensor noise of {:.2g} rad/s is stated, and the stances are more exact: {:.2g} rad/s taken", *stated, seen));
    measured.noise = seen;
    measured.noise_stated = false;
  }
}

// Adds the errors that the law may have. They are drawn evenly over a condition's trials at each collision number, and
// anew for each experiment: the same draws in all of them would show in each as the same swing of its map.
void blur(WheelRuns& measured) {
  const std::uint64_t seed = word_of(measured);
  std::uint64_t draw = 0;
  for (auto& [where, landings] : landings_by_number(measured)) {
    const std::vector<double> speeds = even_normals(seed, draw++, landings.size());
    const std::vector<double> slides = even_normals(seed, draw++, landings.size());
    for (std::size_t i = 0; i < landings.size(); ++i) {
      landings[i]->law_error = measured.law_error * speeds[i];
      if (std::optional<double>& slide = landings[i]->slide)
        *slide += measured.slide_error * dynamics::slide_score(dynamics::normal_cdf(slides[i]));
    }
  }
}

// Takes slides from the feet's places; next speeds are blurred to what the law is good for.
void prepare_settled(WheelRuns& measured, const Experiment& experiment) {
  const std::vector<ExtendedWheel> wheels = wheels_on_ramps(measured, measured.contact, {});
  std::size_t all = 0, left_out = 0, stances_left_out = 0;
  measured.slides_seen = experiment.columns.position == Presence::all && measured.legs_known;
  for (WheelRun& run : measured.runs)
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      RunCollision& m = run.collisions[k];
      ++all;
      left_out += !m.counted;
      stances_left_out += m.counted && !m.stands;
      if (measured.slides_seen && k + 1 < run.collisions.size())
        m.slide =
            run.collisions[k + 1].context.position - m.context.position - wheels[run.condition].advance(m.context.leg);
    }
  if (left_out > 0)
    measured.notes.push_back(fmt::format(
        "{} of {} collisions are left out: at their speed the foot does not stand before the next one touches, and "
        "`settled` holds for landings on feet that stand",
        left_out, all));
  if (stances_left_out > 0)
    measured.notes.push_back(
        fmt::format("of {} more the first impact alone is judged: with its restitution the foot may not have come to "
                    "stand",
                    stances_left_out));
  // Where stances scatter more than that, the law may know less of this machine.
  const double root = std::sqrt(std::max(1.0, static_cast<double>(all - left_out))), known = settled_precision * root;
  measured.law_error = std::clamp(3 * measured.noise_seen, known, std::max(known, 0.03));
  measured.slide_error = settled_slide_precision * root;
  const std::string why =
      measured.law_error > known
          ? fmt::format("three times the scatter of the measured stances, {:.2g} rad/s, and 0.03 rad/s at most",
                        measured.noise_seen)
          : fmt::format(
                "{:.2g} rad/s, by which speeds computed under this law may be wrong, all in the same direction, "
                "times the square root of the {} collisions",
                settled_precision, all - left_out);
  measured.notes.push_back(fmt::format(
      "a measured speed that differs from the one that `settled` foretells by up to about {:.2g} rad/s is no "
      "sign of a gap. This allowance is {}",
      measured.law_error, why));
  std::vector<double> speeds;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) speeds.push_back(m.before);
  if (!speeds.empty())
    measured.memory = memory_of_scores(wheels.front(), measured.contact, median(speeds),
                                       measured.speeds_after ? std::nullopt : std::optional(measured.law_error));
  blur(measured);
}

void note_missing(WheelRuns& measured, const Columns& columns) {
  if (columns.time == Presence::none)
    measured.notes.push_back(
        "time_s is missing: times between collisions are those of the model's stance; ramp_vibration rests on them");
  if (columns.position == Presence::none)
    measured.notes.push_back(
        "position_m is missing: positions follow from the legs' lengths; slope_profile and friction_patch rest on "
        "them");
  if (!measured.speeds_after)
    measured.notes.push_back("omega_plus_rad_s is missing: collision and stance cannot be told apart");
  if (!columns.outcomes) measured.notes.push_back("trials.csv is missing: whether trials came to rest is not known");
}

}  // namespace

std::vector<ExtendedWheel> wheels_on_ramps(const WheelRuns& measured, const dynamics::ContactSpread& contact,
                                           const dynamics::Extension& extension) {
  constexpr double degree = std::numbers::pi / 180;
  std::vector<ExtendedWheel> all;
  all.reserve(measured.conditions.size());
  for (std::size_t c = 0; c < measured.conditions.size(); ++c)
    all.emplace_back(measured.wheel, measured.conditions[c].slope_deg * degree, measured.law, contact, extension,
                     measured.landings.empty() ? nullptr : measured.landings[c]);
  return all;
}

std::optional<double> expected_next(const ExtendedWheel& wheel, const dynamics::StepContext& context,
                                    const RunCollision& m) {
  if (!wheel.settles()) return wheel.next(context, *m.after);
  constexpr double high = 0.5, much_friction = 10;
  const auto dead = wheel.omega_plus(context, m.before, {0, much_friction}, false);
  const auto springy = wheel.omega_plus(context, m.before, {high, much_friction}, false);
  if (!dead || !springy) return std::nullopt;
  const double eta = high * (*m.after - *dead) / (*springy - *dead);
  if (!(eta > -0.1 && eta < 0.8)) return std::nullopt;
  return wheel.land(context, m.before, {std::max(0.0, eta), much_friction}, false).next;
}

void tabulate_landings(WheelRuns& measured) {
  measured.landings.clear();
  if (measured.law != dynamics::Law::settled) return;
  constexpr double degree = std::numbers::pi / 180, margin = 0.03, slowest = 1, fastest = fastest_tabulated;
  double low = fastest, high = slowest;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) {
      low = std::min(low, m.before);
      high = std::max(high, m.before);
    }
  low = std::clamp((1 - margin) * low, slowest, fastest - 1);
  high = std::clamp((1 + margin) * high, low + 1, fastest);
  constexpr double enough = 0.5;  // share of the collisions that are slow enough for any restitution
  measured.stands_by_plus = false;
  const auto tabulate = [&] {
    measured.landings.clear();
    for (std::size_t c = 0; c < measured.conditions.size(); ++c) {
      const double slope = measured.conditions[c].slope_deg;
      const auto same = std::find_if(measured.conditions.begin(), measured.conditions.begin() + static_cast<long>(c),
                                     [&](const Condition& other) { return other.slope_deg == slope; });
      const auto before = static_cast<std::size_t>(same - measured.conditions.begin());
      measured.landings.push_back(before < c
                                      ? measured.landings[before]
                                      : dynamics::landing_grid(dynamics::settled_wheel(measured.wheel, slope * degree),
                                                               low, high, measured.contact, {}, measured.stands_by_plus,
                                                               measured.stands_by_plus || !measured.springing.empty()));
    }
  };
  tabulate();
  if (!measured.speeds_after) return;
  double all = 0, slow = 0;
  for (const WheelRun& run : measured.runs)
    for (const RunCollision& m : run.collisions) {
      ++all;
      slow += stands_at_any_restitution(measured, run, m);
    }
  measured.stands_by_plus = slow < enough * all;
  if (measured.stands_by_plus) tabulate();
}

WheelRuns wheel_runs(const Experiment& experiment) {
  if (experiment.system != System::rimless_wheel)
    throw std::invalid_argument("wheel_runs: the experiment is a coast-down");
  WheelRuns measured;
  measured.wheel = experiment.wheel;
  measured.law = experiment.contact.law;
  const Spread &eta = experiment.contact.restitution, &mu = experiment.contact.friction;
  measured.contact = {eta.mean, eta.sd, mu.mean, mu.sd};
  measured.conditions = experiment.conditions;
  bool leg_column = true;
  const double count = static_cast<double>(experiment.trials.size());
  for (std::size_t t = 0; t < experiment.trials.size(); ++t) {
    const MeasuredTrial& trial = experiment.trials[t];
    WheelRun run;
    run.condition = trial.condition;
    run.outcome = trial.outcome;
    for (std::size_t k = 0; k < trial.collisions.size(); ++k) {
      const MeasuredCollision& c = trial.collisions[k];
      RunCollision m;
      m.context.leg = c.leg.value_or(0);
      leg_column = leg_column && c.leg;
      m.context.position = c.position.value_or(std::numeric_limits<double>::quiet_NaN());
      if (k > 0 && c.time && trial.collisions[k - 1].time)
        m.context.since_previous = *c.time - *trial.collisions[k - 1].time;
      m.context.run_share = count > 1 ? static_cast<double>(t) / (count - 1) : 0;
      m.before = c.omega_minus;
      if (c.omega_plus) m.after = std::max(0.0, *c.omega_plus);  // one that turned back has rested
      if (c.omega_plus && *c.omega_plus > 0) measured.speeds_after = true;
      run.collisions.push_back(m);
    }
    measured.runs.push_back(std::move(run));
  }
  measured.noise = experiment.sensor.noise_sd.value_or(0);
  tabulate_landings(measured);
  find_legs(measured, leg_column);
  if (leg_column)
    if (const auto question = question_on_leg_order(measured, experiment)) measured.notes.push_back(*question);
  if (measured.legs_known || measured.wheel.equal_legs())
    if (const auto question = question_on_rows(measured)) measured.notes.push_back(*question);
  for (const std::string& note : experiment.notes)
    if (note.ends_with('?')) measured.notes.push_back(note);
  if (!leg_column && !measured.legs_known) tabulate_landings(measured);  // of legs of the mean length
  judge_times(measured);
  complete_contexts(measured);
  find_springing_legs(measured);
  for (WheelRun& run : measured.runs) mark_counted(measured, run);
  estimate_noise(measured, experiment.sensor);
  if (measured.law == dynamics::Law::settled)
    prepare_settled(measured, experiment);
  else if (repeats_the_model(measured))
    blur_exact(measured);
  else
    blur_digits(measured, experiment.sensor.last_digit.value_or(0) / std::sqrt(12.0));
  for (WheelRun& run : measured.runs) mark_jam(measured, run);
  note_missing(measured, experiment.columns);
  return measured;
}

double jam_bound(const WheelRuns& measured) { return std::max(2e-3, 4 * measured.noise); }

void mark_jam(const WheelRuns& measured, WheelRun& run) {
  std::optional<double>& after = run.collisions.back().after;
  if (after && *after < jam_bound(measured) && run.outcome.value_or(dynamics::Outcome::rest) == dynamics::Outcome::rest)
    after = 0;
}

std::vector<Event> wheel_events(const WheelRuns& measured) {
  std::vector<Event> events;
  for (std::size_t t = 0; t < measured.runs.size(); ++t) {
    const WheelRun& run = measured.runs[t];
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const RunCollision& m = run.collisions[k];
      Event event;
      event.trial = t;
      event.condition = run.condition;
      event.number = static_cast<int>(k) + 1;
      if (measured.legs_known) event.leg = m.context.leg;
      event.position = m.context.position;
      if (measured.times_judge) event.since_previous = m.context.since_previous;
      event.speed = m.before;
      const auto add = [&](EventKind kind) {
        event.kind = kind;
        events.push_back(event);
      };
      if (k == 0 && measured.conditions[run.condition].initial_speed) add(EventKind::launch);
      if (!m.counted) continue;
      const bool last = k + 1 == run.collisions.size();
      const bool after = m.after && *m.after > 0;
      // Of a trial whose end is not known only those collisions that went on are, which says nothing of their share.
      if (run.outcome) event.rested = last && *run.outcome == dynamics::Outcome::rest;
      if (after) add(EventKind::collision);
      const bool jammed = m.after && !after && last && event.rested.value_or(false);
      if (!m.stands && !jammed) continue;
      if (!last) {
        if (after) event.speed = *m.after;
        if (after) event.rested.reset();
        event.added = run.collisions[k + 1].law_error;
        if (!after || !measured.exact_stances) add(after ? EventKind::stance : EventKind::step);
      } else if ((!after || !measured.landings.empty()) && run.outcome) {
        if (after) event.rested.reset();  // its collision said so
        add(*run.outcome == dynamics::Outcome::rest ? EventKind::rest : EventKind::survival);
      }
    }
  }
  return events;
}

}  // namespace metastable::analysis
