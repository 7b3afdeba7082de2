#include "analysis/blind/blind_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "analysis/blind/blind_dice.h"
#include "analysis/blind/outside_power.h"
#include "analysis/blind/size_search.h"
#include "analysis/blind/sized_effect.h"
#include "analysis/blind/walker_cases.h"
#include "analysis/experiment/stand_in.h"
#include "analysis/walker_model/walker_experiment.h"
#include "dynamics/catalogue/walker_effects.h"

namespace metastable::analysis {
namespace {

constexpr std::array<std::pair<std::string_view, BlindKind>, 7> kinds{{{"none", BlindKind::none},
                                                                       {"effect", BlindKind::effect},
                                                                       {"pair", BlindKind::pair},
                                                                       {"outside", BlindKind::outside},
                                                                       {"left_out", BlindKind::left_out},
                                                                       {"mixed", BlindKind::mixed},
                                                                       {"many", BlindKind::many}}};

// Holds the effects, and those from outside, that cases are drawn from.
struct CaseCatalogue {
  const std::vector<dynamics::EffectInfo>& effects;
  const std::vector<dynamics::OutsideInfo>& outside;
};
CaseCatalogue catalogue_of(const BlindSize& size) {
  if (size.walkers) return {dynamics::walker_effects(), dynamics::walker_outside_effects()};
  return {dynamics::effect_catalogue(), dynamics::outside_effects()};
}

Setting base_setting(dynamics::Law law) {
  Setting setting = stand_in_setting();
  setting.law = law;
  if (law == dynamics::Law::settled) {
    setting.wheel.radius_of_gyration = 0.0424;  // J = 0.0025 kg m^2
    return setting;
  }
  // Both are stated, so that the folder alone says what `coulomb` would be.
  setting.wheel.inertia = 0.0320723;  // M (mean L)^2
  setting.wheel.radius_of_gyration = 0.05;
  return setting;
}

std::vector<LaboratoryCondition> draw_conditions(const Setting& base, BlindDice& dice) {
  std::vector<LaboratoryCondition> conditions = stand_in_conditions(base);
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

std::vector<std::string> draw_dropped(const std::set<std::string>& needed, BlindDice& dice) {
  std::vector<std::string> dropped;
  if (dice.chance(0.5)) return dropped;
  for (const std::string& name : droppable())
    if (dice.chance(0.2) && !needed.contains(name)) dropped.push_back(name);
  return dropped;
}

// Draws what contacts are like, before any effect.
BlindTruth draw_contact(const BlindPlan& plan, int number, BlindDice& dice) {
  BlindTruth truth;
  truth.number = number;
  truth.kind = plan.kind;
  truth.strength = plan.strength;
  truth.seed = dice.word();
  truth.law = plan.law;
  truth.restitution.mean = dice.uniform(0.5, 0.58);
  truth.restitution.sd = dice.uniform(0.035, 0.06);
  truth.friction.mean = dice.uniform(0.33, 0.38);
  truth.friction.sd = dice.uniform(0.035, 0.05);
  if (plan.law == dynamics::Law::settled) {  // as rigid-body engines roll steadily, and now and then rest
    truth.restitution.mean -= 0.15;
    truth.friction = {truth.friction.mean + 0.05, truth.friction.sd - 0.01};
  }
  return truth;
}

// Draws the trials of a case and the noise of its sensor.
PowerDesign draw_design(BlindTruth& truth, BlindDice& dice) {
  Setting base = base_setting(truth.law);
  base.restitution = truth.restitution;
  base.friction = truth.friction;
  PowerDesign design;
  design.conditions = draw_conditions(base, dice);
  design.laboratory.sensor_noise = truth.noise = dice.uniform(0.003, 0.02);
  design.laboratory.shuffled = dice.chance(0.5);
  design.laboratory.flight = false;  // the models know no flight: it would be an effect of its own
  design.laboratory.seed = truth.seed;
  design.laboratory.threads = 1;
  return design;
}

// Runs the experiment of a case again until its expected steps are known to some 7 %, or ten seconds were spent on it.
void count_rests(BlindTruth& truth, dynamics::LaboratorySetup setup) {
  constexpr double enough_rests = 200;
  const double most_collisions = setup.law == dynamics::Law::settled ? 6000 : 20000;
  while (truth.rests_counted < enough_rests && truth.collisions_counted < most_collisions) {
    ++setup.seed;
    for (const dynamics::LaboratoryTrial& trial : run_laboratory(setup, 1)) {
      truth.collisions_counted += static_cast<double>(trial.collisions.size());
      truth.rests_counted += trial.outcome == dynamics::Outcome::rest;
    }
  }
}

// Sizes the effect that no catalogue holds and adds it to the design and the truth.
// @param target  power of each of the catalogue's effects
void size_outside(const BlindPlan& plan, double target, const Power& power, BlindDice& dice, PowerDesign& design,
                  BlindTruth& truth) {
  const dynamics::OutsideInfo& outside = dynamics::outside_info(plan.outside);
  // Beside effects of the catalogue it is half as strong to twice as strong as each of them.
  const double of_outside = plan.effects.empty() ? target : target * std::exp2(dice.uniform(-1, 1));
  const auto power_of = [&](double size) {
    design.laboratory.outside = {{outside.id, size}};
    return power(design, {});
  };
  // Twice the size is four times the power: 0.4 of the range stands for 2x where no likelihood says so.
  const bool weighed = can_be_weighed(outside.id);
  const double size = weighed ? find_size(0.03 * outside.upper, outside.upper, of_outside, power_of)
                              : 0.2 * outside.upper * plan.strength * dice.uniform(0.85, 1.15);
  if (weighed) truth.power += power_of(size);
  truth.outside = {outside.id, size};
  design.laboratory.outside = {*truth.outside};
}

// Draws what the modeller states: the truth, or something near it. Nobody states the shape of the noise.
FolderOptions draw_statement(const BlindPlan& plan, BlindTruth& truth, BlindDice& dice) {
  FolderOptions folder;
  folder.title = fmt::format("Blind case {}", truth.number);
  const bool recalibrated = plan.kind == BlindKind::effect && is_recalibration(plan.effects.front());
  truth.nominal_is_true = dice.chance(0.5) || recalibrated;
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
  return folder;
}

}  // namespace

std::string_view blind_kind_name(BlindKind kind) { return kinds[static_cast<std::size_t>(kind)].first; }

BlindKind blind_kind(std::string_view name) {
  for (const auto& [known, kind] : kinds)
    if (known == name) return kind;
  throw std::invalid_argument(
      fmt::format("kind: \"{}\" is none of none, effect, pair, outside, left_out, mixed, many", name));
}

bool is_recalibration(std::string_view effect) {
  return effect == dynamics::contact_distribution_id || effect == dynamics::slope_offset_id;
}

bool can_be_had(std::string_view effect, dynamics::Law law) {
  if (law != dynamics::Law::settled) return effect != "soft_contact";
  for (const std::string_view lacking :
       {"bounce", "ramp_vibration", "slip_reversal", "inertia", "stored_energy", "sloshing_fluid"})
    if (effect == lacking) return false;
  return true;
}

namespace {

void require_size(const BlindSize& size) {
  for (const auto& [name, count] :
       {std::pair<std::string_view, int>{"per_effect_and_strength", size.per_effect_and_strength},
        {"none", size.none},
        {"pairs", size.pairs},
        {"outside", size.outside},
        {"left_out_per_effect", size.left_out_per_effect},
        {"mixed", size.mixed},
        {"many", size.many}})
    if (count < 0) throw std::invalid_argument(fmt::format("{}: {} is below 0", name, count));
  if (size.laws.empty()) throw std::invalid_argument("laws: none is given");
  for (const dynamics::Law law : size.laws)
    if (law != dynamics::Law::published && law != dynamics::Law::settled)
      throw std::invalid_argument(fmt::format("laws: \"{}\" is none of published, settled", dynamics::law_name(law)));
}

bool had_under(const BlindPlan& one, dynamics::Law law) {
  return (one.outside.empty() || can_be_had(one.outside, law)) &&
         std::ranges::all_of(one.effects, [&](const std::string& id) { return can_be_had(id, law); });
}

// Lists the effects that cases of several draw from. One without a size is there or not: it cannot be made as visible
// as another one beside it.
std::vector<std::string> paired_effects(const CaseCatalogue& catalogue, const std::vector<dynamics::Law>& laws) {
  std::vector<std::string> ids;
  for (const dynamics::EffectInfo& info : catalogue.effects)
    if (!is_recalibration(info.id) && !info.parameters.empty() &&
        std::ranges::any_of(laws, [&](dynamics::Law law) { return can_be_had(info.id, law); }))
      ids.push_back(info.id);
  return ids;
}

void shuffle(std::vector<BlindPlan>& plan, BlindDice& dice) {
  for (std::size_t i = plan.size(); i > 1; --i)
    std::swap(plan[i - 1], plan[static_cast<std::size_t>(dice.whole(0, static_cast<int>(i) - 1))]);
}

}  // namespace

std::vector<BlindPlan> blind_plan(const BlindSize& size, std::uint64_t seed) {
  require_size(size);
  BlindDice dice(seed, 0);
  std::vector<BlindPlan> plan;
  std::map<BlindKind, std::size_t> turn;
  const auto law_of = [&](const BlindPlan& one) {
    return std::ranges::find_if(size.laws, [&](dynamics::Law law) { return had_under(one, law); });
  };
  const auto add = [&](BlindPlan one) {
    one.law = size.laws[turn[one.kind] % size.laws.size()];
    one.walker = size.walkers;
    if (had_under(one, one.law)) {
      ++turn[one.kind];
    } else {
      const auto other = law_of(one);
      if (other == size.laws.end()) return;
      one.law = *other;
    }
    plan.push_back(std::move(one));
  };
  for (int n = 0; n < size.none; ++n) add({BlindKind::none, {}, 0});
  const CaseCatalogue catalogue = catalogue_of(size);
  const std::vector<std::string> paired = paired_effects(catalogue, size.laws);
  for (const dynamics::EffectInfo& info : catalogue.effects) {
    for (const int strength : {1, 2, 4})
      for (int n = 0; n < size.per_effect_and_strength; ++n) add({BlindKind::effect, {info.id}, strength});
    // It is the nuisances of every model, which recalibration removes: no candidate to be left out or paired.
    if (is_recalibration(info.id)) continue;
    for (int n = 0; n < size.left_out_per_effect; ++n) add({BlindKind::left_out, {info.id}, 2});
  }
  // Draws effects that one law has together.
  const auto several = [&](std::size_t count, const std::string& beside = "") {
    BlindPlan one{BlindKind::pair, {}, 2, {}, beside};
    if (law_of(one) == size.laws.end()) one.outside.clear();  // no law has it: there will be no case
    while (one.effects.size() < count) {
      const std::string& id = paired[static_cast<std::size_t>(dice.whole(0, static_cast<int>(paired.size()) - 1))];
      if (std::ranges::find(one.effects, id) != one.effects.end()) continue;
      one.effects.push_back(id);
      if (law_of(one) == size.laws.end()) one.effects.pop_back();
    }
    return one.effects;
  };
  for (int p = 0; p < size.pairs; ++p) add({BlindKind::pair, several(2), 2});
  const auto family = [&](int n) {
    return catalogue.outside[static_cast<std::size_t>(n) % catalogue.outside.size()].id;
  };
  for (int o = 0; o < size.outside; ++o)
    add({BlindKind::outside,
         {},
         static_cast<std::size_t>(o) / catalogue.outside.size() % 2 == 0 ? 2 : 4,
         {},
         family(o)});
  for (int m = 0; m < size.mixed; ++m)
    add({BlindKind::mixed, several(m % 2 == 0 ? 1 : 2, family(m)), 2, {}, family(m)});
  for (int m = 0; m < size.many; ++m) add({BlindKind::many, several(3), 2});
  shuffle(plan, dice);
  return plan;
}

BlindCase blind_case(const BlindPlan& plan, int number, std::uint64_t seed, const Power& power) {
  if (plan.walker) return walker_case(plan, number, seed);
  BlindDice dice(seed, static_cast<std::uint64_t>(number));
  BlindCase made;
  BlindTruth& truth = made.truth;
  truth = draw_contact(plan, number, dice);
  PowerDesign design = draw_design(truth, dice);
  std::set<std::string> needed;
  if (!plan.outside.empty()) needed = columns_needed(dynamics::outside_info(plan.outside).id);
  std::vector<SizedEffect> sized;
  const dynamics::NominalValues contact =
      stated_values(truth.restitution, truth.friction, design.conditions.front().setting.wheel.leg_length);
  for (const std::string& id : plan.effects) {
    sized.push_back(sized_effect(id, contact, dice));
    needed.insert(sized.back().needs.begin(), sized.back().needs.end());
  }
  design.dropped = draw_dropped(needed, dice);
  const double target = 16 * plan.strength * plan.strength;
  for (const SizedEffect& one : sized) {
    const double size = find_size(one.start, one.largest, target, [&](double s) { return power(design, {one.at(s)}); });
    truth.effects.push_back(one.at(size));
  }
  if (!truth.effects.empty()) truth.power = power(design, truth.effects);
  if (!plan.outside.empty()) size_outside(plan, target, power, dice, design, truth);

  FolderOptions folder = draw_statement(plan, truth, dice);
  folder.dropped = design.dropped;
  design.laboratory.restitution_skewness = truth.skewness;
  design.laboratory.effects = truth.effects;
  const dynamics::LaboratorySetup setup = laboratory_setup(design.conditions, design.laboratory);
  made.files = laboratory_files(design.conditions, setup, run_laboratory(setup, 1), folder);
  count_rests(truth, setup);
  if (plan.kind == BlindKind::left_out) {
    truth.left_out = plan.effects;
    for (const dynamics::EffectInfo& info : dynamics::effect_catalogue())
      if (info.id != plan.effects.front()) made.catalogue.push_back(info.id);
  }
  return made;
}

void complete_truth(BlindCase& made) {
  BlindTruth& truth = made.truth;
  if (made.walks) return complete_walker_truth(made);
  const bool outside = truth.outside && can_be_weighed(truth.outside->id);
  if (truth.effects.empty() && !outside) return;
  const Experiment experiment = parse_experiment(source_of(made.files.files, fmt::format("case {}", truth.number)));
  const dynamics::NominalValues contact = stated_values(truth.restitution, truth.friction, experiment.wheel.leg_length);
  truth.left = truth.effects.empty() ? outside_power_left(experiment, contact, *truth.outside)
                                     : power_left(experiment, contact, truth.effects);
}

void complete_each(BlindTruth& truth, const Experiment& experiment) {
  const dynamics::NominalValues contact = stated_values(truth.restitution, truth.friction, experiment.wheel.leg_length);
  complete_each(
      truth,
      [&](const auto& others) {
        return power_left(experiment, contact, truth.effects, others, truth.kind == BlindKind::mixed);
      },
      [&] { return gap_as_given(experiment, contact, truth.effects); });
  if (truth.kind == BlindKind::mixed && truth.outside && can_be_weighed(truth.outside->id))
    truth.left_of_outside = outside_power_left(experiment, contact, *truth.outside, truth.effects);
}

void complete_each(BlindTruth& truth,
                   const std::function<double(const std::vector<dynamics::Effect>& others)>& left_beside,
                   const std::function<GapAsGiven()>& gap) {
  truth.left_by_effect.clear();
  const auto recalibrated = [](const dynamics::Effect& effect) { return is_recalibration(effect.id); };
  truth.gap_as_given.reset();
  if (!truth.outside && !truth.effects.empty() && std::ranges::none_of(truth.effects, recalibrated))
    truth.gap_as_given = gap();
  if (truth.effects.size() < 2 && truth.kind != BlindKind::mixed) return;
  for (std::size_t one = 0; one < truth.effects.size(); ++one) {
    std::vector<dynamics::Effect> others = truth.effects;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(one));
    truth.left_by_effect.push_back(left_beside(others));
  }
}

}  // namespace metastable::analysis
