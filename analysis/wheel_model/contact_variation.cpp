#include "analysis/wheel_model/contact_variation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

namespace metastable::analysis {
namespace {

using Values = std::vector<double>;
using Place = CollisionPlace;

constexpr double largest_change = 1.5;  // of a logarithm by a covariate of one
constexpr double change_step = 1e-3;    // of it, for differences
constexpr double usual_scatter = 0.5;   // sd of what single legs' scatter differs by, in its logarithm
constexpr int most_swings = 16;         // half ones, over the trials
constexpr int trials_a_swing = 4;       // half one, at least
constexpr int most_waves = 10;          // along the ramp

// Weighs a place by one number a parameter.
using Weights = std::function<double(const Place&, const Values& variant, std::size_t parameter)>;

ContactVariation variation(std::string facet, ContactAspect aspect, std::size_t parameters,
                           std::vector<Values> variants, Weights weight) {
  constexpr std::array<const char*, 4> names{"mean friction", "mean restitution", "scatter of friction", "mean loss"};
  ContactVariation v;
  v.aspect = aspect;
  v.variation.facet = std::move(facet);
  v.variation.aspect = names[static_cast<std::size_t>(aspect)];
  Candidate& c = v.variation.candidate;
  c.id = v.variation.aspect + " by " + v.variation.facet;
  c.parameters.assign(parameters, {0, -largest_change, largest_change, change_step});
  c.variants = std::move(variants);
  v.log_ratio = [weight = std::move(weight)](const Place& place, const Values& variant, const Values& values) {
    double sum = 0;
    for (std::size_t p = 0; p < values.size(); ++p)
      if (values[p] != 0) sum += values[p] * weight(place, variant, p);
    return sum;
  };
  return v;
}

// Measures a covariate from its mean over all collisions but the first so many of each trial, in its sds there.
template <class Covariate>
Weights standardised(const WheelRuns& measured, Covariate covariate, std::size_t but_first = 0) {
  double count = 0, sum = 0, squares = 0;
  for (std::size_t t = 0; t < measured.runs.size(); ++t) {
    const WheelRun& run = measured.runs[t];
    for (std::size_t k = but_first; k < run.collisions.size(); ++k) {
      const double x = covariate(collision_place(run, t, k, run.collisions[k], run.collisions[k].before));
      ++count;
      sum += x;
      squares += x * x;
    }
  }
  if (count == 0) return [](const Place&, const Values&, std::size_t) { return 0.0; };
  const double mean = sum / count, variance = squares / count - mean * mean;
  const double scale = variance > 1e-12 * squares / count ? 1 / std::sqrt(variance) : 0;
  return [=](const Place& place, const Values&, std::size_t) {
    return static_cast<std::size_t>(place.number) > but_first ? scale * (covariate(place) - mean) : 0.0;
  };
}

std::vector<Values> from_one_to(int last) {
  std::vector<Values> all;
  for (int i = 1; i <= last; ++i) all.push_back({static_cast<double>(i)});
  return all;
}

// Measures a trial's first speed from its condition's mean, in sds.
Weights launch_speed(const WheelRuns& measured) {
  std::vector<double> mean(measured.conditions.size()), count(measured.conditions.size());
  for (const WheelRun& run : measured.runs) {
    mean[run.condition] += run.collisions.front().before;
    ++count[run.condition];
  }
  for (std::size_t c = 0; c < mean.size(); ++c) mean[c] /= std::max(1.0, count[c]);
  return standardised(measured, [mean](const Place& at) { return at.launch - mean[at.condition]; });
}

double square(double x) { return x * x; }

// Returns what omega^2 fell by from the collision before to this one.
double fallen(const Place& at) { return square(at.omega - at.gained) - square(at.omega); }

// Returns what it fell by before that, from the last collision but one.
double fallen_before(const Place& at) {
  const double omega = at.omega - at.gained;
  return square(omega - at.gained_before) - square(omega);
}

// Returns how much more a fall was than in the mean of the trial so far, as a share of omega^2 here.
double unusual(const Place& at, double fall) {
  const double mean = (square(at.launch) - square(at.omega)) / (at.number - 1);
  return (fall - mean) / square(at.omega);
}

// Returns cosine and sine of `share` of `halves` half turns.
double swing(double share, double halves, std::size_t parameter) {
  const double angle = std::numbers::pi * halves * share;
  return parameter == 0 ? std::cos(angle) : std::sin(angle);
}

double is_odd(long number) { return number % 2 == 0 ? -1 : 1; }

}  // namespace

CollisionPlace collision_place(const WheelRun& run, std::size_t trial, std::size_t before, const RunCollision& here,
                               double omega) {
  CollisionPlace place{trial, run.condition, static_cast<int>(before) + 1, omega, omega, 0, 0, 0, here.context};
  if (before == 0) return place;
  place.launch = run.collisions[0].before;
  place.gained = omega - run.collisions[before - 1].before;
  if (before > 1) place.gained_before = run.collisions[before - 1].before - run.collisions[before - 2].before;
  for (std::size_t k = 1; k < before; ++k) place.clock += run.collisions[k].context.since_previous.value_or(0);
  place.clock += here.context.since_previous.value_or(0);
  return place;
}

void vary(dynamics::StepContext& step, ContactAspect aspect, double amount) {
  constexpr double furthest = 3;
  if (aspect == ContactAspect::loss) {
    step.loss_added += amount;
    return;
  }
  double& changed = aspect == ContactAspect::mean_friction      ? step.friction_ratio
                    : aspect == ContactAspect::mean_restitution ? step.restitution_ratio
                                                                : step.friction_scatter;
  changed *= std::exp(std::clamp(amount, -furthest, furthest));
}

namespace {

// The scales of the measured trials by which places are told: how many they are, how long, how far, how fast.
struct VariedDesign {
  explicit VariedDesign(const WheelRuns& measured)
      : trials(static_cast<double>(std::max<std::size_t>(1, measured.runs.size()))),
        legs(measured.legs_known ? measured.wheel.legs() : 0),
        conditions(static_cast<int>(measured.conditions.size())),
        launch(launch_speed(measured)),
        speed(standardised(measured, [](const Place& at) { return at.omega; })),
        gained(standardised(measured, [](const Place& at) { return at.gained; })),
        before{standardised(
                   measured, [](const Place& at) { return unusual(at, fallen(at)); }, 1),
               standardised(
                   measured, [](const Place& at) { return unusual(at, fallen_before(at)); }, 2),
               standardised(
                   measured, [](const Place& at) { return fallen(at) / square(at.omega - at.gained); }, 1),
               standardised(
                   measured, [](const Place& at) { return at.omega - at.gained; }, 1)} {
    for (std::size_t t = 0; t < measured.runs.size(); ++t) {
      const WheelRun& run = measured.runs[t];
      const std::size_t last = run.collisions.size() - 1;
      longest = std::max(longest, collision_place(run, t, last, run.collisions[last], 0).clock);
      furthest = std::max(furthest, run.collisions[last].context.position);
    }
  }
  double trials;
  int legs, conditions;                   // legs: 0 where they are not known
  double longest = 1e-3, furthest = 0.1;  // [s], [m]
  Weights launch, speed, gained;
  // They follow what the last collision lost in its trial, and the last but one; what the last lost by its speed, and
  // that speed.
  std::array<Weights, 4> before;
};

double first_collision(const Place& at, const Values&, std::size_t) { return at.number == 1 ? 1.0 : 0.0; }

// Lists the variations with the order of trials and collisions, with time and with the condition.
std::vector<ContactVariation> variations_with_order(const VariedDesign& design, ContactAspect mean) {
  std::vector<ContactVariation> all;
  all.push_back(
      variation("clock", mean, 2, {{}}, [longest = design.longest](const Place& at, const Values&, std::size_t p) {
        return std::cos(std::numbers::pi * static_cast<double>(p + 1) * std::min(1.0, at.clock / longest));
      }));
  std::vector<Values> swings = from_one_to(std::min(most_swings, static_cast<int>(design.trials) / trials_a_swing));
  if (swings.size() > 1) swings.erase(swings.begin());  // half a one is a drift
  if (!swings.empty())
    all.push_back(variation("order", mean, 2, std::move(swings),
                            [trials = design.trials](const Place& at, const Values& v, std::size_t p) {
                              return swing(static_cast<double>(at.trial) / trials, v[0], p);
                            }));
  all.push_back(variation("every other trial", mean, 1, {{}}, [](const Place& at, const Values&, std::size_t) {
    return is_odd(static_cast<long>(at.trial));
  }));
  all.push_back(
      variation("every other collision", mean, 1, {{}},
                [even = design.legs > 0 && design.legs % 2 == 0](const Place& at, const Values&, std::size_t) {
                  return is_odd(even ? at.step.leg : at.number);
                }));
  if (design.conditions > 1)
    all.push_back(variation("condition", mean, 1, from_one_to(design.conditions > 2 ? design.conditions : 1),
                            [](const Place& at, const Values& v, std::size_t) {
                              return static_cast<double>(at.condition) + 1 == v[0] ? 1.0 : 0.0;
                            }));
  return all;
}

// Lists those, and the variations with speed, place and leg.
std::vector<ContactVariation> variations_of_mean(const VariedDesign& design, ContactAspect mean) {
  std::vector<ContactVariation> all = variations_with_order(design, mean);
  all.push_back(variation("launch speed", mean, 1, {{}}, design.launch));
  all.push_back(variation("first collision", mean, 1, {{}}, first_collision));
  all.push_back(variation("change of speed", mean, 2, {{}},
                          [gained = design.gained](const Place& at, const Values& v, std::size_t p) {
                            const double change = gained(at, v, p);
                            return p == 0 ? change : std::abs(change) - std::sqrt(2 / std::numbers::pi);
                          }));
  all.push_back(
      variation("speed", mean, 3, {{}}, [speed = design.speed](const Place& at, const Values& v, std::size_t p) {
        constexpr double widest = 2.5;  // on either side [sds]
        const double share = std::clamp(0.5 + speed(at, v, p) / (2 * widest), 0.0, 1.0);
        return std::cos(std::numbers::pi * static_cast<double>(p + 1) * share);
      }));
  all.push_back(variation("position", mean, 2, from_one_to(most_waves),
                          [furthest = design.furthest](const Place& at, const Values& v, std::size_t p) {
                            return swing(at.step.position / furthest, 2 * v[0], p);
                          }));
  if (design.legs > 0)
    all.push_back(variation("leg in order", mean, 1, from_one_to(design.legs),
                            [trials = design.trials](const Place& at, const Values& v, std::size_t) {
                              return static_cast<double>(at.step.leg) + 1 == v[0]
                                         ? 2 * static_cast<double>(at.trial) / trials - 1
                                         : 0.0;
                            }));
  return all;
}

// Makes the loss of a collision depend on what those before it were like.
ContactVariation variation_of_loss(const VariedDesign& design) {
  return variation(
      "collisions before", ContactAspect::loss, design.before.size(), {{}},
      [before = design.before](const Place& at, const Values& v, std::size_t p) { return before[p](at, v, p); });
}

std::vector<ContactVariation> variations_of_scatter(const WheelRuns& measured, const VariedDesign& design) {
  constexpr ContactAspect scatter = ContactAspect::scatter_of_friction;
  std::vector<ContactVariation> all;
  all.push_back(variation("speed", scatter, 1, {{}}, design.speed));
  all.push_back(variation("position", scatter, 1, {{}},
                          standardised(measured, [](const Place& at) { return at.step.position; })));
  all.push_back(variation("trial", scatter, 1, {{}},
                          standardised(measured, [](const Place& at) { return static_cast<double>(at.trial); })));
  all.push_back(variation("first collision", scatter, 1, {{}}, first_collision));
  if (design.legs > 0) {
    all.push_back(variation("leg", scatter, static_cast<std::size_t>(design.legs), {{}},
                            [](const Place& at, const Values&, std::size_t p) {
                              return static_cast<std::size_t>(at.step.leg) == p ? 1.0 : 0.0;
                            }));
    for (FreeParameter& of_leg : all.back().variation.candidate.parameters) of_leg.prior_sd = usual_scatter;
  }
  return all;
}

}  // namespace

std::vector<ContactVariation> contact_variations(const WheelRuns& measured) {
  if (measured.law == dynamics::Law::plastic) return {};  // it has no contact that could vary
  const VariedDesign design(measured);
  std::vector<ContactVariation> all = variations_of_mean(design, ContactAspect::mean_friction);
  for (ContactVariation& one : variations_of_mean(design, ContactAspect::mean_restitution))
    all.push_back(std::move(one));
  all.push_back(variation_of_loss(design));
  for (ContactVariation& one : variations_of_scatter(measured, design)) all.push_back(std::move(one));
  return all;
}

}  // namespace metastable::analysis
