#include "analysis/blind_cases.h"

#include <Random123/philox.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include "analysis/stand_in.h"

namespace metastable::analysis {
namespace {

constexpr std::array<std::pair<std::string_view, BlindKind>, 5> kinds{{{"none", BlindKind::none},
                                                                       {"effect", BlindKind::effect},
                                                                       {"pair", BlindKind::pair},
                                                                       {"outside", BlindKind::outside},
                                                                       {"left_out", BlindKind::left_out}}};

// Random numbers of one case, in the order they are asked for: Philox4x64 at counter (number, n).
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t number) : seed_(seed), number_(number) {}
  std::uint64_t word() {
    const r123::Philox4x64::ctr_type counter{{number_, asked_++, 300, 0}};
    return r123::Philox4x64()(counter, r123::Philox4x64::key_type{{seed_, 0}})[0];
  }
  double uniform(double from = 0, double to = 1) {
    return from + (to - from) * (static_cast<double>(word() >> 12) + 0.5) * 0x1p-52;
  }
  int whole(int from, int to) { return std::min(to, from + static_cast<int>(uniform(0, to - from + 1))); }
  bool chance(double probability) { return uniform() < probability; }
  double sign() { return chance(0.5) ? 1 : -1; }
  double normal() { return dynamics::normal_quantile(uniform()); }

 private:
  std::uint64_t seed_, number_, asked_ = 0;
};

// An effect as a function of its size: the rest of it is drawn once.
struct Sized {
  std::function<dynamics::Effect(double)> at;
  double start = 0.1;                // where the search begins
  double largest = 1;                // end of the range
  std::set<std::string> needs = {};  // columns and statements without which nobody can tell it
};

Sized sized_effect(const std::string& id, const dynamics::NominalValues& truth, Dice& dice) {
  const auto make = [id, truth](std::map<std::string, std::vector<double>> values) {
    return dynamics::effect_from_values(id, values, truth);
  };
  const double sign = dice.sign();
  if (id == "contact_distribution") {
    const double a = dice.uniform(0, 2 * std::numbers::pi), b = dice.uniform(-0.3, 0.3);
    return {[=](double s) {
              return make({{"restitution_mean", {truth.restitution_mean + 0.5 * s * std::cos(a)}},
                           {"restitution_sd", {truth.restitution_sd * std::exp(b * s)}},
                           {"friction_mean", {truth.friction_mean + 0.5 * s * std::sin(a)}},
                           {"friction_sd", {truth.friction_sd * std::exp(-b * s)}}});
            },
            0.01, 0.3};
  }
  if (id == "initial_speed") {
    const double a = dice.uniform(-0.25, 0.25) * std::numbers::pi;
    return {[=](double s) {
              return make({{"mean_rad_s", {sign * s * std::cos(a)}}, {"sd_rad_s", {s * std::sin(a) / 2}}});
            },
            0.08,
            0.6,
            {"initial_speed_rad_s"}};
  }
  if (id == "leg_lengths") {
    std::vector<double> pattern(truth.leg_lengths.size());
    double mean = 0;
    for (double& p : pattern) mean += (p = dice.normal()) / static_cast<double>(pattern.size());
    for (double& p : pattern) p -= mean;
    return {[=](double s) {
              std::vector<double> lengths = truth.leg_lengths;
              for (std::size_t i = 0; i < lengths.size(); ++i) lengths[i] += s * pattern[i];
              return make({{"leg_lengths_m", lengths}});
            },
            2e-4,
            5e-3,
            {"leg"}};
  }
  if (id == "leg_contact") {
    const double leg = dice.whole(0, static_cast<int>(truth.leg_lengths.size()) - 1);
    return {[=](double s) {
              return make({{"leg", {leg}}, {"friction_ratio", {std::exp(sign * s)}}});
            },
            0.03,
            1,
            {"leg"}};
  }
  if (id == "hub_eccentricity") {
    const double phase = dice.uniform(-std::numbers::pi, std::numbers::pi);
    return {[=](double s) { return make({{"offset_m", {s}}, {"phase_rad", {phase}}}); }, 2e-4, 0.01, {"leg"}};
  }
  if (id == "inertia") return {[=](double s) { return make({{"ratio", {std::exp(sign * s)}}}); }, 0.01, 0.4};
  if (id == "slope_offset") return {[=](double s) { return make({{"offset_deg", {sign * s}}}); }, 0.05, 1.5};
  if (id == "slope_profile") {
    const double to = dice.chance(0.5) ? 0 : 1.83;
    return {[=](double s) { return make({{"sag_m", {sign * s}}, {"to_m", {to}}}); }, 2e-3, 0.06};
  }
  if (id == "axle_drag_viscous") return {[=](double s) { return make({{"n_m_s", {s}}}); }, 1e-3, 0.03};
  if (id == "rolling_resistance") return {[=](double s) { return make({{"torque_n_m", {s}}}); }, 4e-3, 0.1};
  if (id == "air_drag") return {[=](double s) { return make({{"n_m_s2", {s}}}); }, 2e-4, 6e-3};
  if (id == "speed_dependent_restitution")
    return {[=](double s) { return make({{"exponent", {sign * s}}}); }, 0.05, 1.5};
  if (id == "speed_dependent_friction") {
    const double speed = dice.uniform(1, 8);
    return {[=](double s) { return make({{"amplitude", {s}}, {"speed_rad_s", {speed}}}); }, 0.05, 4};
  }
  if (id == "contact_memory") return {[=](double s) { return make({{"correlation", {s}}}); }, 0.1, 0.95};
  if (id == "friction_patch") {
    const double from = dice.uniform(0.1, 0.9), to = from + dice.uniform(0.35, 0.8);
    return {[=](double s) {
              return make({{"from_m", {from}}, {"to_m", {to}}, {"friction_ratio", {std::exp(sign * s)}}});
            },
            0.02, 1};
  }
  if (id == "trial_drift") return {[=](double s) { return make({{"relative_change", {sign * s}}}); }, 0.03, 0.8};
  if (id == "trial_spread") return {[=](double s) { return make({{"friction_sd", {s}}}); }, 0.015, 0.12};
  if (id == "contact_outliers") {
    const double ratio = dice.uniform(1.7, 2.5);
    return {[=](double s) { return make({{"share", {s}}, {"friction_ratio", {ratio}}}); }, 0.005, 0.08};
  }
  if (id == "sensor_noise")
    return {[=](double s) { return make({{"sd_rad_s", {s}}}); }, 0.03, 0.5, {"noise", "omega_plus_rad_s"}};
  if (id == "sensor_bias")
    return {[=](double s) { return make({{"bias_rad_s", {sign * s}}}); }, 0.005, 0.3, {"omega_plus_rad_s"}};
  if (id == "bounce") return {[=](double s) { return make({{"rebound_lost", {s}}}); }, 0.02, 1};
  if (id == "ramp_vibration") {
    const double frequency = dice.uniform(4, 40);
    return {[=](double s) { return make({{"amplitude", {s}}, {"frequency_hz", {frequency}}}); }, 0.02, 0.6, {"time_s"}};
  }
  return {[=](double) { return make({}); }, 1, 1};  // slip_reversal has no size
}

// The size whose power is `target`. Powers grow like a power of a small size, mostly its square: secant steps in
// logarithms, inside the bracket known so far.
double find_size(const Sized& effect, double target, const std::function<double(const dynamics::Effect&)>& power) {
  double size = std::min(effect.start * std::sqrt(target / 16), effect.largest);
  double low = 0, high = effect.largest, exponent = 2;
  double last_size = 0, last_power = 0;
  for (int i = 0; i < 8; ++i) {
    const double now = power(effect.at(size));
    if (std::abs(now / target - 1) < 0.1) break;
    if (now < target && size == effect.largest) break;
    (now < target ? low : high) = size;
    if (now > 0 && last_power > 0 && size != last_size)
      exponent = std::clamp(std::log(now / last_power) / std::log(size / last_size), 0.7, 3.0);
    last_size = size;
    last_power = now;
    double next = now > 0.02 * target ? size * std::pow(target / now, 1 / exponent) : 3 * size;
    next = std::min(next, effect.largest);
    if (next <= low || (next >= high && high < effect.largest)) next = (low + high) / 2;
    size = next;
  }
  return size;
}

Setting base_setting() {
  Setting setting = stand_in_setting();
  // Both stated, so that the folder alone says what `coulomb` would be.
  setting.wheel.inertia = 0.0320723;  // M (mean L)^2
  setting.wheel.radius_of_gyration = 0.05;
  return setting;
}

std::vector<RealityCondition> draw_conditions(const Setting& base, Dice& dice) {
  std::vector<RealityCondition> conditions = stand_in_conditions(base);
  const double few = dice.uniform();
  if (few < 0.35) conditions.erase(conditions.begin() + dice.whole(0, 2));
  if (few < 0.1) conditions.erase(conditions.begin() + dice.whole(0, 1));
  const int trials = dice.whole(50, 150), count = static_cast<int>(conditions.size());
  for (int c = 0; c < count; ++c) {
    conditions[static_cast<std::size_t>(c)].trials = trials / count + (c < trials % count ? 1 : 0);
    conditions[static_cast<std::size_t>(c)].setting.first_landing_leg = dice.whole(0, 7);
  }
  return conditions;
}

std::vector<std::string> draw_dropped(const std::set<std::string>& needed, Dice& dice) {
  std::vector<std::string> dropped;
  if (dice.chance(0.5)) return dropped;
  for (const std::string& name : droppable())
    if (dice.chance(0.2) && !needed.contains(name)) dropped.push_back(name);
  return dropped;
}

}  // namespace

std::string_view blind_kind_name(BlindKind kind) { return kinds[static_cast<std::size_t>(kind)].first; }

BlindKind blind_kind(std::string_view name) {
  for (const auto& [known, kind] : kinds)
    if (known == name) return kind;
  throw std::invalid_argument(fmt::format("kind: \"{}\" is none of none, effect, pair, outside, left_out", name));
}

std::vector<BlindPlan> blind_plan(const BlindSize& size, std::uint64_t seed) {
  Dice dice(seed, 0);
  std::vector<std::string> ids;
  for (const dynamics::EffectInfo& info : dynamics::effect_catalogue()) ids.push_back(info.id);
  std::vector<BlindPlan> plan(static_cast<std::size_t>(size.none), BlindPlan{BlindKind::none, {}, 0});
  for (const std::string& id : ids) {
    for (const int strength : {1, 2, 4})
      plan.insert(plan.end(), static_cast<std::size_t>(size.per_effect_and_strength),
                  BlindPlan{BlindKind::effect, {id}, strength});
    if (id == "contact_distribution") continue;  // the nuisances are no candidate that could be left out
    plan.insert(plan.end(), static_cast<std::size_t>(size.left_out_per_effect),
                BlindPlan{BlindKind::left_out, {id}, 2});
  }
  for (int p = 0; p < size.pairs; ++p) {
    std::vector<std::string> two;
    while (two.size() < 2) {
      const std::string& id = ids[static_cast<std::size_t>(dice.whole(1, static_cast<int>(ids.size()) - 2))];
      if (two.empty() || two.front() != id) two.push_back(id);
    }
    plan.push_back({BlindKind::pair, two, 2});
  }
  const auto& outside = dynamics::outside_effects();
  for (int o = 0; o < size.outside; ++o)
    plan.push_back({BlindKind::outside, {outside[static_cast<std::size_t>(o) % outside.size()].id}, 0});
  for (std::size_t i = plan.size(); i > 1; --i)
    std::swap(plan[i - 1], plan[static_cast<std::size_t>(dice.whole(0, static_cast<int>(i) - 1))]);
  return plan;
}

BlindCase blind_case(const BlindPlan& plan, int number, std::uint64_t seed, const Power& power) {
  Dice dice(seed, static_cast<std::uint64_t>(number));
  BlindCase made;
  BlindTruth& truth = made.truth;
  truth.number = number;
  truth.kind = plan.kind;
  truth.strength = plan.strength;
  truth.seed = dice.word();
  truth.restitution = {dice.uniform(0.5, 0.58), dice.uniform(0.035, 0.06)};
  truth.friction = {dice.uniform(0.33, 0.38), dice.uniform(0.035, 0.05)};
  Setting base = base_setting();
  base.restitution = truth.restitution;
  base.friction = truth.friction;
  const dynamics::NominalValues contact{truth.restitution.mean, truth.restitution.sd, truth.friction.mean,
                                        truth.friction.sd, base.wheel.leg_length};
  PowerDesign design;
  design.conditions = draw_conditions(base, dice);
  design.reality.sensor_noise = truth.noise = dice.uniform(0.003, 0.02);
  design.reality.shuffled = dice.chance(0.5);
  design.reality.flight = false;  // the models know no flight: it would be an effect of its own
  design.reality.seed = truth.seed;
  design.reality.threads = 1;
  std::vector<Sized> sized;
  std::set<std::string> needed;
  if (plan.kind != BlindKind::outside)
    for (const std::string& id : plan.effects) {
      sized.push_back(sized_effect(id, contact, dice));
      needed.insert(sized.back().needs.begin(), sized.back().needs.end());
    }
  design.dropped = draw_dropped(needed, dice);
  constexpr std::array<double, 5> targets{0, 16, 64, 0, 256};
  for (const Sized& one : sized) {
    const double size = find_size(one, targets.at(static_cast<std::size_t>(plan.strength)),
                                  [&](const dynamics::Effect& effect) { return power(design, {effect}); });
    truth.effects.push_back(one.at(size));
  }
  if (!truth.effects.empty()) truth.power = power(design, truth.effects);
  if (plan.kind == BlindKind::outside) {
    const dynamics::OutsideInfo& info = dynamics::outside_info(plan.effects.front());
    truth.outside = {info.id, info.upper * dice.uniform(0.35, 0.8)};
    design.reality.outside = {*truth.outside};
  }

  // What the modeller believes: the truth, or something near it. A shape of the noise that no one states.
  FolderOptions folder;
  folder.title = fmt::format("Blind case {}", number);
  folder.dropped = design.dropped;
  const bool recalibration = plan.kind == BlindKind::effect && plan.effects.front() == "contact_distribution";
  truth.nominal_is_true = dice.chance(0.5) || recalibration;
  folder.restitution = truth.restitution;
  folder.friction = truth.friction;
  if (!truth.nominal_is_true) {
    folder.restitution->mean += dice.uniform(-0.03, 0.03);
    folder.restitution->sd *= std::exp(dice.uniform(-0.25, 0.25));
    folder.friction->mean += dice.uniform(-0.02, 0.02);
    folder.friction->sd *= std::exp(dice.uniform(-0.25, 0.25));
    for (Spread* spread : {&*folder.restitution, &*folder.friction}) {
      spread->mean = std::round(spread->mean * 1000) / 1000;
      spread->sd = std::round(spread->sd * 1000) / 1000;
    }
  }
  if (dice.chance(0.5)) truth.skewness = dice.uniform(-0.8, 0.8);
  if (truth.skewness != 0) truth.nominal_is_true = false;  // no model of the contact states a skewness
  design.reality.restitution_skewness = truth.skewness;
  design.reality.effects = truth.effects;
  const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, design.reality);
  made.files = reality_files(design.conditions, setup, run_laboratory(setup, 1), folder);
  if (plan.kind == BlindKind::left_out) {
    truth.left_out = plan.effects;
    for (const dynamics::EffectInfo& info : dynamics::effect_catalogue())
      if (info.id != plan.effects.front()) made.catalogue.push_back(info.id);
  }
  return made;
}

}  // namespace metastable::analysis
