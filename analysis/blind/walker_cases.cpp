#include "analysis/blind/walker_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "analysis/blind/blind_dice.h"
#include "analysis/blind/effect_power.h"
#include "analysis/blind/size_search.h"
#include "analysis/blind/sized_walker_effect.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/machine_model/machine_transitions.h"
#include "analysis/walker_model/walker_experiment.h"

namespace metastable::analysis {
namespace {

constexpr int replicates = 2;               // of the walks by which a power is measured
constexpr std::size_t weighed_trials = 24;  // on which an outside effect is sized: fits take their time

// Describes an experiment in the laboratory, with what its folder tells.
struct WalkDesign {
  WalkerSetting truth;
  WalkerReality reality;
  WalkOptions options;
  double sensor_ratio = 1;  // errors of the sensors over their usual ones
};

dynamics::WalkerLaboratory laboratory_of(const WalkDesign& design) {
  dynamics::WalkerLaboratorySetup setup = walker_laboratory(design.truth, design.reality, design.options).setup();
  for (double& sd : setup.sensor_sd) sd *= design.sensor_ratio;
  return dynamics::WalkerLaboratory(setup);
}

WalkFiles files_of(const WalkDesign& design, const WalkStatement& statement) {
  const dynamics::WalkerLaboratory laboratory = laboratory_of(design);
  return laboratory_walks(laboratory, run_walks(laboratory, design.options), statement, design.reality.left_out);
}

// Sets the nuisances of a walker's model to the true slope; the others stay at their nominal values.
std::vector<double> true_slope(const TransitionModel& model, const Spread& slope_deg) {
  std::vector<double> values = nominal_values(model);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (model.nuisances()[i].name == "slope_deg") values[i] = slope_deg.mean;
    if (model.nuisances()[i].name == "slope_sd_deg") values[i] = slope_deg.sd;
  }
  return values;
}

// Leaves out what is a slope's: the nuisances have it.
std::vector<EffectTerm> walk_terms(const TransitionModel& model, const std::vector<dynamics::Effect>& effects) {
  std::vector<EffectTerm> terms;
  for (const dynamics::Effect& effect : effects)
    if (!is_recalibration(effect.id)) terms.push_back(fitted_term(model, effect));
  return terms;
}

Spread slope_with(Spread slope_deg, const std::vector<dynamics::Effect>& effects) {
  for (const dynamics::Effect& effect : effects)
    if (is_recalibration(effect.id)) slope_deg.mean += effect.values[0];
  return slope_deg;
}

// Returns the mean over walks with the effects of 2 log(likelihood with them / without), the true slope known to both.
double walk_power(WalkDesign design, const std::vector<dynamics::Effect>& effects) {
  const Spread slope{design.truth.slope_deg, design.truth.slope_sd_deg};
  design.reality.effects = effects;
  const std::uint64_t seed = design.options.seed;
  double sum = 0;
  for (int r = 1; r <= replicates; ++r) {
    design.options.seed = seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(r);
    WalkStatement statement{"power", {}, {}};
    statement.walker.setting = design.truth;
    const auto walks = parse_walks(source_of(files_of(design, statement), "laboratory"));
    const auto model = machine_transitions(walks->machine, walks->runs);
    sum += 2 * (model->evaluate(true_slope(*model, slope_with(slope, effects)), walk_terms(*model, effects)).total() -
                model->evaluate(true_slope(*model, slope), {}).total());
  }
  return sum / replicates;
}

WalkDesign draw_walk_design(BlindTruth& truth, const std::set<std::string>& needed, BlindDice& dice) {
  WalkDesign design;
  // As a modeller writes them: whether the truth is what is stated does not show in the digits.
  truth.slope_deg =
      Spread{std::round(100 * dice.uniform(2.7, 3.3)) / 100, std::round(1000 * dice.uniform(0.3, 0.46)) / 1000};
  design.truth = {Walker::compass, truth.slope_deg->mean, truth.slope_deg->sd, dynamics::Terrain::fresh};
  design.options.trials = static_cast<std::size_t>(dice.whole(40, 50));
  design.options.longest = static_cast<std::uint64_t>(dice.whole(9, 12));
  design.options.seed = truth.seed;
  design.options.threads = 1;
  design.reality.launch_spread = dice.uniform(0, 0.03);
  design.sensor_ratio = std::exp(dice.uniform(-0.7, 0.7));
  truth.noise = dynamics::WalkerLaboratorySetup{}.sensor_sd[0] * design.sensor_ratio;
  if (dice.chance(0.5)) return design;
  for (const std::string& name : walk_columns_left_out())
    if (dice.chance(0.2) && !needed.contains(name)) design.reality.left_out.push_back(name);
  return design;
}

// Draws what the modeller states: the truth, or something near it.
WalkStatement draw_walk_statement(const BlindPlan& plan, BlindTruth& truth, BlindDice& dice) {
  WalkStatement statement{fmt::format("Blind case {}", truth.number), {}, {}};
  const bool recalibrated = plan.kind == BlindKind::effect && is_recalibration(plan.effects.front());
  truth.nominal_is_true = dice.chance(0.5) || recalibrated;
  WalkerSetting& stated = statement.walker.setting;
  stated = {Walker::compass, truth.slope_deg->mean, truth.slope_deg->sd, dynamics::Terrain::fresh};
  if (!truth.nominal_is_true) {
    stated.slope_deg = std::round(100 * (stated.slope_deg + dice.uniform(-0.15, 0.15))) / 100;
    stated.slope_sd_deg = std::round(1000 * stated.slope_sd_deg * std::exp(dice.uniform(-0.25, 0.25))) / 1000;
  }
  return statement;
}

// Weighs an outside effect: 2 log(likelihood of the walks without it / with it), each under a model recalibrated to
// them, in which the sizes of effects of the catalogue that both have are refitted. Both have the same scores and
// errors of sensors, so that this is what the effect moves them by. Trials that are of different lengths, as one fell,
// cannot be compared and count as the others do in the mean.
class OutsideScales {
 public:
  explicit OutsideScales(WalkDesign design, std::vector<dynamics::Effect> beside = {})
      : design_(std::move(design)), beside_(std::move(beside)) {
    design_.reality.effects = beside_;
    design_.reality.outside.clear();
    without_ = weighed();
  }
  double power(const dynamics::OutsideEffect& effect) {
    design_.reality.outside = {effect};
    const std::vector<Weighed> with = weighed();
    double sum = 0, compared = 0;
    for (std::size_t t = 0; t < with.size(); ++t)
      if (with[t].events == without_[t].events) sum += without_[t].likelihood - with[t].likelihood, ++compared;
    return compared > 0 ? 2 * sum * static_cast<double>(with.size()) / compared : 0;
  }

 private:
  struct Weighed {
    double likelihood = 0;
    std::size_t events = 0;
  };

  // Returns the log likelihood of each trial.
  std::vector<Weighed> weighed() const {
    WalkStatement statement{"power", {}, {}};
    statement.walker.setting = design_.truth;
    const auto walks = parse_walks(source_of(files_of(design_, statement), "laboratory"));
    const auto model = machine_transitions(walks->machine, walks->runs);
    const Fit fitted = fit(*model, nominal_values(*model), walk_terms(*model, beside_));
    std::vector<Weighed> trials(walks->runs.trials.size());
    for (std::size_t e = 0; e < model->events().size(); ++e) {
      Weighed& trial = trials[model->events()[e].trial];
      trial.likelihood += fitted.evaluation.log_density[e];
      ++trial.events;
    }
    return trials;
  }

  WalkDesign design_;
  std::vector<dynamics::Effect> beside_;
  std::vector<Weighed> without_;
};

// Sizes the effect that no catalogue holds and adds it to the design and the truth.
// @param target  power of each of the catalogue's effects
void size_walker_outside(const BlindPlan& plan, double target, BlindDice& dice, WalkDesign& design, BlindTruth& truth) {
  const double largest = dynamics::walker_outside_info(plan.outside).upper;
  // Beside effects of the catalogue it is half as strong to twice as strong as each of them.
  const double of_outside = plan.effects.empty() ? target : target * std::exp2(dice.uniform(-1, 1));
  // The size is found on a share of the trials.
  WalkDesign some = design;
  some.options.trials = std::min(some.options.trials, weighed_trials);
  const double share = static_cast<double>(some.options.trials) / static_cast<double>(design.options.trials);
  OutsideScales scales(some);
  const auto power = [&](double size) { return scales.power({plan.outside, size}); };
  truth.outside = {plan.outside, find_size(0.01 * largest, largest, share * of_outside, power)};
  const double own = OutsideScales(design).power(*truth.outside);
  truth.power += own;
  if (plan.effects.empty())
    truth.left = own;
  else
    truth.left_of_outside = OutsideScales(design, truth.effects).power(*truth.outside);
  design.reality.outside = {*truth.outside};
}

GapAsGiven walk_gap_as_given(const Walks& walks, const Spread& slope_deg,
                             const std::vector<dynamics::Effect>& effects) {
  const auto model = machine_transitions(walks.machine, walks.runs);
  return gap_as_given(*model, true_slope(*model, slope_with(slope_deg, effects)), walk_terms(*model, effects));
}

// Runs the walks of a case again until its expected steps are known to some 7 %, or some seconds were spent on it.
void count_falls(BlindTruth& truth, WalkDesign design) {
  constexpr double enough_falls = 200, most_steps = 12000;
  while (truth.rests_counted < enough_falls && truth.collisions_counted < most_steps) {
    ++design.options.seed;
    const dynamics::WalkerLaboratory laboratory = laboratory_of(design);
    for (const dynamics::WalkedTrial& trial : run_walks(laboratory, design.options)) {
      truth.collisions_counted += static_cast<double>(trial.rows.size()) - (trial.fell ? 0 : 1);
      truth.rests_counted += trial.fell;
    }
  }
}

}  // namespace

BlindCase walker_case(const BlindPlan& plan, int number, std::uint64_t seed) {
  BlindDice dice(seed, static_cast<std::uint64_t>(number));
  BlindCase made;
  BlindTruth& truth = made.truth;
  truth.number = number;
  truth.kind = plan.kind;
  truth.strength = plan.strength;
  truth.seed = dice.word();
  std::set<std::string> needed;
  std::vector<SizedEffect> sized;
  for (const std::string& id : plan.effects) {
    sized.push_back(sized_walker_effect(id, dice));
    needed.insert(sized.back().needs.begin(), sized.back().needs.end());
  }
  WalkDesign design = draw_walk_design(truth, needed, dice);
  const double target = 16 * plan.strength * plan.strength;
  for (const SizedEffect& one : sized) {
    const auto power = [&](double s) { return walk_power(design, {one.at(s)}); };
    truth.effects.push_back(one.at(find_size(one.start, one.largest, target, power)));
  }
  if (!truth.effects.empty()) truth.power = walk_power(design, truth.effects);
  if (!plan.outside.empty()) size_walker_outside(plan, target, dice, design, truth);
  WalkStatement statement = draw_walk_statement(plan, truth, dice);
  design.reality.effects = truth.effects;
  made.walks = files_of(design, statement);
  count_falls(truth, design);
  if (plan.kind != BlindKind::left_out) return made;
  truth.left_out = plan.effects;
  const auto walks = parse_walks(source_of(*made.walks, statement.title));
  for (const std::string& id : machine_transitions(walks->machine, walks->runs)->effect_ids())
    if (id != plan.effects.front()) made.catalogue.push_back(id);
  return made;
}

void complete_walker_truth(BlindCase& made) {
  BlindTruth& truth = made.truth;
  if (truth.effects.empty()) return;
  const auto walks = parse_walks(source_of(*made.walks, fmt::format("case {}", truth.number)));
  truth.left = walk_power_left(*walks, *truth.slope_deg, truth.effects);
}

void complete_each(BlindTruth& truth, const Walks& walks) {
  complete_each(
      truth,
      [&](const auto& others) {
        return walk_power_left(walks, *truth.slope_deg, truth.effects, others, truth.kind == BlindKind::mixed);
      },
      [&] { return walk_gap_as_given(walks, *truth.slope_deg, truth.effects); });
}

double walk_power_left(const Walks& walks, const Spread& slope_deg, const std::vector<dynamics::Effect>& effects,
                       const std::vector<dynamics::Effect>& kept, bool fitted) {
  const auto model = machine_transitions(walks.machine, walks.runs);
  const std::vector<double> nuisance = true_slope(*model, slope_with(slope_deg, effects));
  const std::vector<EffectTerm> terms = walk_terms(*model, effects);
  const double with = fitted ? fit(*model, nuisance, terms).log_likelihood : model->evaluate(nuisance, terms).total();
  return 2 * (with - fit(*model, nuisance, walk_terms(*model, kept)).log_likelihood);
}

}  // namespace metastable::analysis
