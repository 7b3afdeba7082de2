#include "analysis/sensitivity/rigid_body_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "analysis/statistics/interval_95.h"
#include "analysis/statistics/number_text.h"
#include "dynamics/return_map/trials.h"
#include "dynamics/wheel/contact_law.h"
#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr std::uint64_t longest_roll = 512;  // collisions of a wheel
// Collisions after which a launch counts as forgotten. Wheels of 8 legs forget it by the 12th in all studies.
constexpr std::uint64_t least_early = 32;
constexpr double forgotten = 0.01;          // of what squared speeds differ by: less than wheels scatter
constexpr std::size_t wheels_a_batch = 16;  // wheels between two looks at what has been rolled
constexpr double differing = 2;             // times as many or as few steps
// The speed at which a wheel spins that hops away down the slope, for ever, times the speed sqrt(g / leg) at which
// gravity no longer holds a standing foot down: none with feet that settle comes near it.
constexpr double hops_away = 10;

// Holds what a number of wheels did.
struct Rolled {
  std::uint64_t early = least_early;
  std::size_t wheels = 0, past = 0;  // all, and those that roll on after the first `early` steps
  double early_steps = 0, early_squares = 0;
  double late_steps = 0, late_rests = 0;
  void add(std::uint64_t steps, bool rested) {
    const auto in_early = static_cast<double>(std::min(steps, early));
    ++wheels;
    early_steps += in_early;
    early_squares += in_early * in_early;
    if (steps < early || (steps == early && rested)) return;
    ++past;
    late_steps += static_cast<double>(steps - early);
    late_rests += rested;
  }
};

// Returns the 95 % bounds of a Poisson mean of which `count` were seen; of none the upper one is one-sided.
std::pair<double, double> poisson_95(double count) {
  if (count == 0) return {0, -std::log(0.05)};
  return {boost::math::gamma_p_inv(count, 0.025), boost::math::gamma_p_inv(count + 1, 0.975)};
}

// Fills in expected steps and interval: early steps, and late steps over late rests for the share that gets so far.
// @param away  some never will rest, and nothing bounds the steps above
void estimate(const Rolled& of, bool away, RigidBodyCheck& check) {
  const auto wheels = static_cast<double>(of.wheels);
  const double mean = of.early_steps / wheels;
  const double variance = std::max(0.0, of.early_squares / wheels - mean * mean);
  const double half = normal_95 * std::sqrt(variance / std::max(1.0, wheels - 1));
  const double low = std::max(1.0, mean - half), high = mean + half;
  if (of.past == 0) {
    check.steps = {mean, low, high};
    return;
  }
  const Estimate share = exact_share(of.past, of.wheels);
  const auto [fewest, most] = poisson_95(of.late_rests);
  if (of.late_rests == 0 || away) {
    check.at_least = true;
    const double least = low + share.lower * of.late_steps / most;
    check.steps = {least, least, infinite};
    return;
  }
  const double late = share.value * of.late_steps / of.late_rests;
  const double less = std::hypot(std::log(share.value / share.lower), std::log(most / of.late_rests));
  const double more = std::hypot(std::log(share.upper / share.value), std::log(of.late_rests / fewest));
  check.steps = {mean + late, low + late * std::exp(-less), high + late * std::exp(more)};
}

// Returns after how many collisions little is left of a launch. A wheel whose feet neither slip nor rebound (McGeer's)
// keeps this share of what squared speeds differ by; one that does forgets sooner.
// @param gyration  of the wheel about its hub, as a share of a leg
double forgets_after(const dynamics::Wheel& wheel, double gyration) {
  const double hub = gyration * gyration, kept = (std::cos(wheel.leg_angle()) + hub) / (1 + hub);
  return kept * kept < 1 ? std::log(forgotten) / std::log(kept * kept) : infinite;
}

bool one_contact(const dynamics::ContactNoise& noise, const Setting& setting) {
  return setting.pairs.empty() ? noise.restitution().constant() && noise.friction().constant()
                               : setting.pairs.size() == 1;
}

// Returns whether rigid bodies take more steps in `a` than in `b`, or fewer, or neither for sure: 1, -1, 0.
int order(const Estimate& a, const Estimate& b) { return a.lower > b.upper ? 1 : a.upper < b.lower ? -1 : 0; }

// Returns "650 times as many" or "a third as many" as how many times one number is the other.
std::string times_text(const BesideRigidBodies& one) {
  const double ratio = one.check.steps.value / one.steps.value;
  const std::string least = one.check.at_least ? "at least " : "";
  if (ratio == 0) return "not infinitely many";
  if (std::isinf(ratio)) return "without ever resting";
  const auto number = [](double value) { return plain_text(to_decimal(value, NumberFormat::general, 2)); };
  return ratio >= 1 ? fmt::format("{}{} times as many", least, number(ratio))
                    : fmt::format("{} times fewer", number(1 / ratio));
}

const BesideRigidBodies& farthest(const std::vector<const BesideRigidBodies*>& all) {
  return **std::max_element(all.begin(), all.end(), [](const auto* a, const auto* b) {
    const auto apart = [](const BesideRigidBodies& one) {
      return std::abs(std::log(one.check.steps.value / one.steps.value));
    };
    return apart(*a) < apart(*b);
  });
}

std::string trust_text(dynamics::Law law) {
  return fmt::format("trust settled for a real wheel, and {} only to compare with the paper", dynamics::law_name(law));
}

std::string alone_text(const BesideRigidBodies& one, dynamics::Law law) {
  std::string text = fmt::format("rigid bodies (law settled) take {} steps", rigid_body_steps_text(one.check));
  switch (one.verdict()) {
    case RigidBodyVerdict::within_twice:
      return text + ", within a factor of two of that";
    case RigidBodyVerdict::differs:
      return text + fmt::format(", {}: {}", times_text(one), trust_text(law));
    case RigidBodyVerdict::open:
      return text +
             "; the wheels simulated do not tell whether that is within a factor of two, a study under law settled "
             "does";
  }
  throw std::logic_error("unknown verdict");
}

std::string several_text(const std::vector<const BesideRigidBodies*>& known, dynamics::Law law) {
  for (std::size_t i = 0; i < known.size(); ++i)
    for (std::size_t j = known.size(); j-- > i + 1;) {
      const BesideRigidBodies &a = *known[i], &b = *known[j];
      const int answered = order(b.steps, a.steps);
      if (answered == 0 || order(b.check.steps, a.check.steps) != -answered) continue;
      return fmt::format(
          "rigid bodies (law settled) disagree in direction, {} steps at {} and {} at {}, where {} has {} at the "
          "latter: {}",
          rigid_body_steps_text(a.check), a.name, rigid_body_steps_text(b.check), b.name, dynamics::law_name(law),
          answered > 0 ? "more" : "fewer", trust_text(law));
    }
  std::vector<const BesideRigidBodies*> differ, open;
  for (const BesideRigidBodies* one : known) {
    if (one->verdict() == RigidBodyVerdict::differs) differ.push_back(one);
    if (one->verdict() == RigidBodyVerdict::open) open.push_back(one);
  }
  if (!differ.empty()) {
    const BesideRigidBodies& most = farthest(differ);
    return fmt::format(
        "rigid bodies (law settled) differ by more than a factor of two in {} of {}, most at {}, {} steps, {}: {}",
        differ.size(), known.size(), most.name, rigid_body_steps_text(most.check), times_text(most), trust_text(law));
  }
  if (!open.empty())
    return fmt::format(
        "the wheels simulated do not tell in {} of {} whether rigid bodies (law settled) are within a factor of two of "
        "it, as at {}: {} steps; studies under law settled do",
        open.size(), known.size(), open.front()->name, rigid_body_steps_text(open.front()->check));
  return fmt::format("rigid bodies (law settled) are within a factor of two of it in all {}", known.size());
}

}  // namespace

RigidBodyCheck rigid_body_check(const Setting& setting, const RigidBodyOptions& options) {
  RigidBodyCheck check;
  Setting rigid = setting;
  rigid.law = dynamics::Law::settled;
  std::optional<dynamics::SettledMotion> motion;
  try {
    rigid.validate();
    motion.emplace(rigid.motion());
  } catch (const std::invalid_argument& error) {
    check.reason = error.what();
    return check;
  }
  const double forgets = forgets_after(rigid.wheel, motion->wheel().radius_of_gyration / rigid.wheel.mean_leg_length());
  if (forgets > static_cast<double>(longest_roll) / 2) {
    check.reason =
        fmt::format("with {} legs a launch may show for more than half of the {} collisions that a wheel is rolled",
                    rigid.wheel.legs(), longest_roll);
    return check;
  }
  const dynamics::ContactNoise noise = rigid.noise();
  const dynamics::LaunchSpeed launch = rigid.launch();
  const bool same_contacts = one_contact(noise, rigid), once = same_contacts && launch.constant();
  Rolled rolled{.early = std::max(least_early, static_cast<std::uint64_t>(std::ceil(forgets)))};
  const double fastest = hops_away * std::sqrt(rigid.wheel.gravity / rigid.wheel.mean_leg_length());
  bool any_away = false;
  std::vector<dynamics::RolledOn> wheels(once ? 1 : wheels_a_batch);
  while (check.collisions < options.collisions && check.rests < options.rests) {
    markov::parallel_for(wheels.size(), options.threads, [&](std::size_t i) {
      wheels[i] = dynamics::roll_on(*motion, noise, launch, rigid.first_landing_leg, options.seed, check.wheels + i,
                                    longest_roll, fastest);
    });
    for (const dynamics::RolledOn& one : wheels) {
      const bool rested = one.outcome == dynamics::Outcome::rest;
      // One that hops away would roll on.
      rolled.add(one.ran_away ? longest_roll : one.steps, rested);
      any_away = any_away || one.ran_away;
      check.collisions += one.ran_away ? longest_roll : one.steps;
      check.rests += rested;
    }
    check.wheels += wheels.size();
    if (once) break;
    if (options.progress)
      options.progress(
          std::min(1.0, std::max(static_cast<double>(check.collisions) / static_cast<double>(options.collisions),
                                 static_cast<double>(check.rests) / static_cast<double>(options.rests))));
  }
  if (same_contacts && check.rests < check.wheels)
    check.steps = {infinite, infinite, infinite};  // one that rolls on after so many steps is on its orbit
  else
    estimate(rolled, any_away, check);
  return check;
}

RigidBodyVerdict BesideRigidBodies::verdict() const {
  if (std::isinf(steps.value) && std::isinf(check.steps.value)) return RigidBodyVerdict::within_twice;
  const double least = check.steps.lower / steps.upper, most = check.steps.upper / steps.lower;
  if (least > differing || most < 1 / differing) return RigidBodyVerdict::differs;
  return least >= 1 / differing && most <= differing ? RigidBodyVerdict::within_twice : RigidBodyVerdict::open;
}

Estimate answered_steps(const Metastability& study) {
  if (study.status == Status::rest_unresolved) return {infinite, infinite, infinite};
  return study.steps.from_start;
}

BesideRigidBodies beside_rigid_bodies(const Metastability& study, std::string name, const StudyOptions& options) {
  RigidBodyOptions rolled{.seed = options.seed, .threads = options.threads};
  if (options.progress) rolled.progress = [&](double share) { options.progress(share, "rigid bodies"); };
  return {std::move(name), answered_steps(study), rigid_body_check(study.setting.value(), rolled)};
}

std::string verdict_text(RigidBodyVerdict verdict) {
  switch (verdict) {
    case RigidBodyVerdict::within_twice:
      return "within_twice";
    case RigidBodyVerdict::differs:
      return "differs";
    case RigidBodyVerdict::open:
      return "open";
  }
  throw std::logic_error("unknown verdict");
}

std::string rigid_body_steps_text(const RigidBodyCheck& check) {
  if (!check.reason.empty()) return "none: " + check.reason;
  if (std::isinf(check.steps.value)) return "infinitely many";
  if (check.at_least)
    return fmt::format("at least {} (95 %)", plain_text(to_decimal(check.steps.lower, NumberFormat::general, 2)));
  const DecimalEstimate e = to_decimal(check.steps, NumberFormat::general, 3);
  return fmt::format("{} (95 % interval {} to {})", plain_text(e.value), plain_text(e.lower), plain_text(e.upper));
}

std::string rigid_body_sentence(std::span<const BesideRigidBodies> all, dynamics::Law law) {
  std::vector<const BesideRigidBodies*> known;
  for (const BesideRigidBodies& one : all)
    if (one.check.reason.empty()) known.push_back(&one);
  const std::string head = fmt::format("No law was named, so the answer is that of {}; ", dynamics::law_name(law));
  if (known.empty())
    return head + fmt::format("rigid bodies (law settled) have no answer: {}.",
                              all.empty() ? "the law knows no such wheel" : all.front().check.reason);
  return head + (all.size() == 1 ? alone_text(*known.front(), law) : several_text(known, law)) + ".";
}

}  // namespace metastable::analysis
