#include "analysis/machine_model/machine_transitions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "analysis/fitting/effect_fit.h"
#include "analysis/fitting/effect_scan.h"
#include "analysis/fitting/latest_evaluations.h"
#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"
#include "analysis/machine_model/asked_map.h"
#include "analysis/machine_model/machine_design.h"
#include "analysis/machine_model/machine_effects.h"
#include "analysis/machine_model/machine_filter.h"
#include "analysis/machine_model/machine_simulation.h"
#include "analysis/machine_model/machine_variations.h"
#include "analysis/machine_model/tolerant_starts.h"
#include "analysis/statistics/falling_order.h"
#include "analysis/statistics/interval_95.h"
#include "dynamics/numerics/truncated_normal.h"

namespace metastable::analysis {
namespace {

constexpr double least_sensor = 1e-6, usual_sensor = 0.1;  // sd of an error that is not stated, in sds of its change
constexpr double sensor_prior = 3;                         // sd of its logarithm
constexpr std::size_t enough_levels = 5000;                // Chance moves the distribution of so many values by 0.01.
constexpr std::uint64_t most_own_draws = 20, own_seed = 0x6f776e;
constexpr const char* wild_name = "logit wild_share";
constexpr double usual_wild = -7, wild_prior = 1.5, least_wild = -12;  // logit of the share of wild rows
constexpr double parameter_step = 1e-3;  // of the sd with which it is known, for differences
// A parameter is refitted within so many of its sds, or within this share of its nominal value where that is wider.
constexpr double widest_refit = 20, widest_share = 0.5;
constexpr double seen_share = 1e-6;  // of a column's change, that its noise or its error must exceed
// A recalibration may leave what is stated of a parameter behind. So many stated parameters are known less well than it
// is stated: an assumption, that of the wheel's contact. Physicists have done worse: of intervals that were to hold 98
// % of physical constants, later measurements left 9 to 57 % (Henrion and Fischhoff 1986, Am. J. Phys. 54, 791).
constexpr double misstated_share = 0.01;
// A parameter is looked at from two of its stated sds on, and what is stated of it is set aside from three, which
// chance reaches in 0.3 %. The effects that promise most, so many, may speak for the stated value.
constexpr double strained_sds = 2, misstated_sds = 3;
constexpr std::size_t most_instead = 3;
constexpr double far_behind = 12;  // log likelihood below, with priors, that one more effect may still make up for
constexpr double chance_sds = 2;   // So far from its mean chance takes what n numbers gain: n, with a variance of 2 n.

// Failures foretold in the steps recorded, for trials that end early to be asked about: none comes in one set of 150.
constexpr double foretold_failures = 5;
// A misread column fits better by so many nats a value, a normal error's tenth, and by so many in all, beyond chance.
constexpr double misread_nats = 0.1, misread_nats_in_all = 30;
constexpr std::size_t enough_to_suspect = 500;  // steps in which it is looked for
constexpr double few_failures = 10;             // counted ones, that say next to nothing of the expected steps

bool is_outliers(const EffectTerm& term) { return term.candidate->id == "outliers"; }
double share_of(double logit) { return 1 / (1 + std::exp(-logit)); }

class MachineTransitions : public TransitionModel {
 public:
  MachineTransitions(std::shared_ptr<const Machine> machine, MachineRuns runs)
      : map_(machine),
        machine_(machine->dear ? std::make_shared<Machine>(joining_steps(machine)) : machine),
        runs_(std::move(runs)) {
    notes_ = look_over(*machine_, runs_);
    std::ranges::copy(questions_on_values(*machine_, runs_), std::back_inserter(notes_));
    design_ = std::make_shared<MachineDesign>(machine_design(*machine_, runs_));
    set_up_nuisances();
    plan_ = score_plan(*machine_, runs_, hypothesis(nominal_values(*this), {}));
    std::ranges::copy(plan_.notes, std::back_inserter(notes_));
    set_up_effects();
    list_events();
    require_noise();
    starts_ = std::make_shared<TolerantStarts>(map_, runs_);
  }

  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return runs_.trials.size(); }
  std::size_t conditions() const override { return runs_.conditions.size(); }
  int legs() const override { return static_cast<int>(runs_.phases.size()); }
  bool time_tells() const override { return false; }
  std::string condition_name(std::size_t condition) const override { return runs_.conditions.at(condition); }
  std::string trial_name(std::size_t trial) const override { return runs_.name_of(trial); }
  std::string recalibrated() const override { return "parameters"; }
  std::vector<ObservedColumn> columns() const override {
    std::vector<ObservedColumn> all;
    for (const MachineSensor& sensor : machine_->observe)
      all.push_back({sensor.state, machine_->unit_of(sensor.state)});
    return all;
  }
  std::string unit_of(const std::string& effect, const std::string& parameter) const override {
    return machine_effect_unit(*machine_, effect, parameter);
  }
  std::string leg_name() const override { return "phase"; }
  std::string leg_word(int leg) const override { return "phase " + runs_.phases.at(static_cast<std::size_t>(leg)); }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  const std::vector<Variation>& variations() const override { return variations_; }
  const Candidate* even_push() const override { return &push_.variation.candidate; }
  std::string steps_not_told() const override { return replayed_inputs(*machine_, *design_); }
  std::string size_in_words(std::span<const EffectTerm> t) const override { return alternating_memory(*design_, t); }
  bool refits_noise() const override {
    return std::ranges::any_of(machine_->observe, [](const MachineSensor& s) { return !s.sd; });
  }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override {
    return latest_.of(nuisance, terms,
                      [&] { return follow_machine(*machine_, runs_, plan_, events_, hypothesis(nuisance, terms)); });
  }
  void side_by_side(std::size_t count, int threads, const std::function<void(std::size_t)>& work) const override {
    if (!machine_->dear) return TransitionModel::side_by_side(count, threads, work);
    starts_->prepare();  // No work may wait for another one to do it: joint calls wait for all works.
    analysis::side_by_side(*map_, count, threads, work);
  }
  std::vector<std::size_t> transitions() const override {
    std::vector<std::size_t> all;
    for (const MachineTrial& trial : runs_.trials) all.push_back(steps_of(trial));
    return all;
  }
  std::optional<Addition> addition(const EffectTerm& term, std::size_t parameter) const override;
  Evaluation evaluate_with(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                           const Addition& added) const override {
    MachineHypothesis supposed = hypothesis(nuisance, terms);
    add(supposed, machine_->states.size(), added);
    return follow_machine(*machine_, runs_, plan_, events_, supposed);
  }
  std::vector<FitStart> starts(std::span<const EffectTerm> terms) const override {
    std::vector<FitStart> all = starts_->starts(terms);
    for (FitStart& start : all)  // the share of wild rows is the last nuisance
      for (std::size_t slot = start.nuisance.size(); slot < nuisances_.size(); ++slot)
        start.nuisance.push_back(nuisances_[slot].nominal);
    // The score test promises few outliers next to no gain, because the likelihood is far too steep at a share of none,
    // and a recalibration takes them for a wider noise. So a fit starts from a likely share, too.
    if (std::ranges::any_of(terms, is_outliers)) {
      FitStart& start = all.emplace_back(FitStart{nominal_values(*this), {}, false});
      for (const EffectTerm& term : terms)
        start.values.push_back(is_outliers(term) ? std::vector{term.candidate->parameters[0].try_at} : term.values);
    }
    // An effect with a likely size is fitted from there whatever its scores promise, and with what is stated beside it.
    if (terms.size() == 1 && terms[0].values.size() == 1 && terms[0].candidate->parameters[0].likely != 0)
      all.push_back({nominal_values(*this), {{terms[0].candidate->parameters[0].likely}}, false});
    return all;
  }
  std::vector<double> rest_chances(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override {
    std::vector<double> chances;
    follow_machine(*machine_, runs_, plan_, events_, hypothesis(nuisance, terms), &chances);
    return chances;
  }
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                            std::uint64_t seed) const override {
    return drawn(runs_, nuisance, terms, seed, Launches::stated);
  }
  std::vector<ChangedExperiment> alternatives(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                              std::uint64_t seed) const override {
    const std::vector<double> n(nuisance.begin(), nuisance.end());
    const std::vector<EffectTerm> t(terms.begin(), terms.end());
    return {{"", 0, "the same experiment once more",
             [this, n, t, seed] { return drawn(runs_, n, t, seed, Launches::stated); }}};
  }
  std::pair<double, double> rests() const override {
    double at_risk = 0, failed = 0;
    for (const MachineTrial& trial : runs_.trials) {
      if (!trial.outcome) return {0, 0};
      at_risk += static_cast<double>(steps_of(trial));
      failed += *trial.outcome == MachineOutcome::failed;
    }
    return {at_risk, failed};
  }
  std::unique_ptr<TransitionModel> relaunched(std::uint64_t seed) const override {
    auto copy = std::make_unique<MachineTransitions>(*this);
    copy->runs_ = redrawn_launches(runs_, seed);
    return copy;
  }
  double expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                        std::uint64_t seed) const override;
  const std::vector<std::string>& notes() const override { return notes_; }
  std::vector<NamedValue> report_nuisances(std::span<const double> nuisance) const override;
  std::vector<std::string> misstated(const Fit& fitted) const override;
  void require_own_draws(const Fit& recalibrated) const override;
  std::unique_ptr<MachineTransitions> with_wide_priors() const;
  bool effect_speaks_for_what_is_stated(const Fit& recalibrated, const Fit& wide) const;
  void set_aside_what_is_misstated(const Fit& recalibrated);
  void ask_for_outcomes(const std::vector<double>& nuisance);  // near which the recalibration lies
  void ask_for_misread_columns(const Fit& recalibrated);
  double mean_log_density(const Evaluation& evaluation) const;  // of values measured after a trial's first row
  std::vector<double> levels_of_own_draws(const std::vector<double>& nuisance) const;
  std::vector<std::string> effects_instead(const Fit& recalibrated) const;
  bool only_wild_rows(const Fit& recalibrated) const;

 private:
  std::unique_ptr<MachineTransitions> drawn(const MachineRuns& like, std::span<const double> nuisance,
                                            std::span<const EffectTerm> terms, std::uint64_t seed,
                                            Launches launches) const;
  std::unique_ptr<MachineTransitions> with_runs(MachineRuns runs) const;  // that are of this machine, too
  MachineHypothesis hypothesis(std::span<const double> nuisance, std::span<const EffectTerm> terms) const;
  void set_up_nuisances();
  void set_up_effects();
  void list_events() { events_ = machine_events(*machine_, runs_, plan_); }
  void require_noise() const;

  std::shared_ptr<const Machine> map_;      // as its user gave it
  std::shared_ptr<const Machine> machine_;  // where calls are dear, it joins them
  MachineRuns runs_;
  std::shared_ptr<const MachineDesign> design_;
  ScorePlan plan_;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;  // parameters whose sd is above 0, sensors without sd, wild rows
  std::vector<MachineCandidate> effects_;
  std::vector<Candidate> candidates_;
  std::vector<MachineVariation> varied_;
  std::vector<Variation> variations_;
  MachineVariation push_;
  std::vector<std::string> notes_;
  std::shared_ptr<const TolerantStarts> starts_;  // those of a copy are its own
  mutable LatestEvaluations latest_;
};

void MachineTransitions::set_up_nuisances() {
  for (const MachineParameter& p : machine_->parameters) {
    if (!(p.sd > 0)) continue;
    const double widest = std::max(widest_refit * p.sd, widest_share * std::abs(p.nominal));
    nuisances_.push_back({p.name, p.nominal, p.sd, parameter_step * p.sd, std::max(p.lower, p.nominal - widest),
                          std::min(p.upper, p.nominal + widest)});
  }
  for (std::size_t j = 0; j < machine_->observe.size(); ++j) {
    if (machine_->observe[j].sd) continue;
    const double change = design_->change[j] > 0 ? design_->change[j] : 1;
    nuisances_.push_back({"log sensor sd of " + machine_->observe[j].state, std::log(usual_sensor * change),
                          sensor_prior, 1e-3, std::log(least_sensor * change), std::log(change)});
    nuisances_.back().assumed = true;
  }
  if (machine_->most_wild > 0) {
    const double most = std::log(machine_->most_wild / (1 - machine_->most_wild));
    nuisances_.push_back({wild_name, std::min(usual_wild, most - wild_prior), wild_prior, 1e-2,
                          std::min(least_wild, most - 2 * wild_prior), most});
  }
}

void MachineTransitions::set_up_effects() {
  effects_ = machine_effects(*machine_, design_);
  varied_ = machine_variations(*machine_, design_);
  push_ = analysis::even_push(*machine_, design_);
  for (const MachineCandidate& one : effects_) candidates_.push_back(one.candidate);
  for (const MachineVariation& one : varied_) variations_.push_back(one.variation);
  std::set<std::string> ids;
  for (const Candidate& one : candidates_)
    if (!ids.insert(one.id).second)
      throw std::invalid_argument(
          fmt::format("effects: \"{}\" is the name of an effect that any machine may have, too", one.id));
}

MachineHypothesis MachineTransitions::hypothesis(std::span<const double> nuisance,
                                                 std::span<const EffectTerm> terms) const {
  MachineHypothesis h;
  std::size_t slot = 0;
  for (const MachineParameter& p : machine_->parameters) h.values.push_back(p.sd > 0 ? nuisance[slot++] : p.nominal);
  for (const MachineEffect& effect : machine_->effects)
    for (const SuspectedParameter& p : effect.parameters) h.values.push_back(p.neutral);
  for (const MachineSensor& sensor : machine_->observe)
    h.sensor_sd.push_back(sensor.sd ? *sensor.sd : std::exp(nuisance[slot++]));
  if (machine_->most_wild > 0) h.wild = share_of(nuisance[slot]);
  for (const EffectTerm& term : terms) {
    const auto named = [&](const auto& one) { return one.id == term.candidate->id; };
    if (const auto at = std::ranges::find_if(candidates_, named); at != candidates_.end())
      effects_[static_cast<std::size_t>(at - candidates_.begin())].apply(h, term.variant, term.values);
    else
      for (const MachineVariation& one : varied_)
        if (named(one.variation.candidate)) one.apply(h, term.variant, term.values);
    if (named(push_.variation.candidate)) push_.apply(h, term.variant, term.values);
  }
  return h;
}

std::optional<Addition> MachineTransitions::addition(const EffectTerm& term, std::size_t parameter) const {
  EffectTerm moved = term;
  const double step = term.candidate->parameters[parameter].step;
  moved.values[parameter] += step;
  const std::vector<double> nominal = nominal_values(*this);
  return addition_of(hypothesis(nominal, {}), hypothesis(nominal, std::vector{moved}), machine_->states.size(), step);
}

// A state that the map foretells exactly and that is measured exactly has no density. Wild rows give it none.
void MachineTransitions::require_noise() const {
  MachineHypothesis nominal = hypothesis(nominal_values(*this), {});
  nominal.wild = 0;
  const Evaluation evaluation = follow_machine(*machine_, runs_, plan_, events_, nominal);
  for (std::size_t j = 0; j < machine_->observe.size(); ++j) {
    double most = 0;
    const auto seen = [&](const Event& e) { return e.column == j && e.kind == EventKind::step; };
    if (std::ranges::none_of(events_, seen))
      throw std::invalid_argument(
          fmt::format("runs: {} has no value after a trial's first row", machine_->observe[j].state));
    for (std::size_t e = 0; e < events_.size(); ++e)
      if (seen(events_[e])) most = std::max(most, evaluation.unit[e]);
    if (most > seen_share * design_->change[j]) continue;
    const double error = machine_->observe[j].sd.value_or(0);
    const std::string reach =
        error > 0 ? fmt::format(
                        "the machine's noise does not reach it, and the sd of its error, {:g}, is less than {:g} "
                        "of its change from row to row, {:.2g}: state a larger sd",
                        error, seen_share, design_->change[j])
                  : "neither the machine's noise nor an error of measurement reaches it: state the sd of its error";
    throw std::invalid_argument(
        fmt::format("sensor: {}: {}, or None to have it fitted", machine_->observe[j].state, reach));
  }
}

std::unique_ptr<MachineTransitions> MachineTransitions::drawn(const MachineRuns& like, std::span<const double> nuisance,
                                                              std::span<const EffectTerm> terms, std::uint64_t seed,
                                                              Launches launches) const {
  return with_runs(simulate_machine(*machine_, like, hypothesis(nuisance, terms), seed, launches));
}

std::unique_ptr<MachineTransitions> MachineTransitions::with_runs(MachineRuns runs) const {
  auto copy = std::make_unique<MachineTransitions>(*this);
  copy->runs_ = std::move(runs);
  copy->design_ = std::make_shared<MachineDesign>(machine_design(*machine_, copy->runs_));
  copy->effects_.clear();
  copy->candidates_.clear();
  copy->varied_.clear();
  copy->variations_.clear();
  copy->set_up_effects();
  copy->list_events();
  copy->starts_ = std::make_shared<TolerantStarts>(map_, copy->runs_);
  return copy;
}

// Failures are counted in the experiment drawn again and again, with launches like those measured. Where too few come,
// the chances of failure in one such experiment may say more; they miss failures from states that it did not meet, and
// never make a failure rarer.
double MachineTransitions::expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                          std::uint64_t seed) const {
  const MachineHypothesis supposed = hypothesis(nuisance, terms);
  const auto [steps, failed] = counted_failures(*machine_, runs_, supposed, seed);
  double rate = failed / steps;
  if (failed < few_failures && plan_.failing) {
    const auto trials = drawn(smoothed_launches(runs_, supposed, seed), nuisance, terms, seed, Launches::measured);
    const std::vector<double> chances = trials->rest_chances(nuisance, terms);
    double at_risk = 0, expected = 0;
    for (std::size_t e = 0; e < chances.size(); ++e)
      if (trials->events_[e].rested) {
        ++at_risk;
        expected += chances[e];
      }
    if (at_risk > 0) rate = std::max(rate, expected / at_risk);
  }
  return rate > 0 ? 1 / rate : std::numeric_limits<double>::infinity();
}

std::vector<NamedValue> MachineTransitions::report_nuisances(std::span<const double> nuisance) const {
  std::vector<NamedValue> all;
  std::size_t slot = 0;
  for (const MachineParameter& p : machine_->parameters)
    if (p.sd > 0) all.emplace_back(p.name, nuisance[slot++]);
  for (const MachineSensor& sensor : machine_->observe)
    if (!sensor.sd) all.emplace_back("sensor_sd_" + sensor.state, std::exp(nuisance[slot++]));
  if (machine_->most_wild > 0) all.emplace_back("wild_share", share_of(nuisance[slot]));
  return all;
}

double sds_off(const Nuisance& stated, double value) { return std::abs(value - stated.nominal) / stated.prior_sd; }

// Lists the parameters that are far from what is stated of them, by their slots.
std::vector<std::size_t> misstated_slots(const TransitionModel& model, const std::vector<double>& nuisance) {
  std::vector<std::size_t> all;
  for (std::size_t slot = 0; slot < nuisance.size(); ++slot)
    if (const Nuisance& one = model.nuisances()[slot];
        !one.assumed && one.name != wild_name && sds_off(one, nuisance[slot]) > misstated_sds)
      all.push_back(slot);
  return all;
}

// Returns the same model with priors that let parameters go that lie far off.
std::unique_ptr<MachineTransitions> MachineTransitions::with_wide_priors() const {
  auto copy = std::make_unique<MachineTransitions>(*this);
  std::size_t slot = 0;
  for (const MachineParameter& p : machine_->parameters)
    if (p.sd > 0) copy->nuisances_[slot++].misstated = misstated_share;
  return copy;
}

// Says whether one of the effects that promise most makes the runs likelier, with all parameters held to what is stated
// of them, than a recalibration that leaves some behind; of several variants one does by chance. It does not speak for
// what is stated where it leaves them as far off, at the cost of their priors.
bool MachineTransitions::effect_speaks_for_what_is_stated(const Fit& recalibrated, const Fit& wide) const {
  std::vector<const Candidate*> all;
  for (const Candidate& one : candidates_) all.push_back(&one);
  const EffectScan scan = scan_effects(*this, recalibrated, all, 1);
  std::vector<double> gains;
  for (const ScannedEffect& effect : scan.effects) gains.push_back(effect.gain[effect.best]);
  std::vector<std::size_t> order = falling_order(gains);
  order.resize(std::min(order.size(), most_instead));
  return std::ranges::any_of(order, [&](std::size_t i) {
    const ScannedEffect& effect = scan.effects[i];
    const Fit with = fit(*this, recalibrated.nuisance, {term_at(effect, effect.best)});
    const double variants = static_cast<double>(effect.candidate->variants.size());
    return 2 * (with.log_likelihood - wide.log_likelihood - std::log(variants)) > Rules{}.told_apart &&
           with.penalised > wide.penalised - far_behind;
  });
}

// Sets aside what is stated of each parameter that a recalibration moves far from it, where no effect speaks for the
// stated value. The stated value then counts against no hypothesis, and no effect gains by bringing the parameter back.
void MachineTransitions::set_aside_what_is_misstated(const Fit& recalibrated) {
  std::size_t slot = 0;
  double strain = 0;
  for (const MachineParameter& p : machine_->parameters)
    if (p.sd > 0) strain = std::max(strain, std::abs(recalibrated.nuisance[slot++] - p.nominal) / p.sd);
  if (!(strain > strained_sds)) return;
  const auto loose = with_wide_priors();
  Fit wide = fit(*loose, recalibrated.nuisance, {});
  // Steps from stated values that are far off may not find the way; those from a strained fit may lead elsewhere.
  Fit other = fit(*loose, nominal_values(*loose), {}, {.count = {}, .to_beat = wide.penalised});
  if (other.penalised > wide.penalised) wide = std::move(other);
  const std::vector<std::size_t> slots = misstated_slots(*loose, wide.nuisance);
  if (slots.empty() || effect_speaks_for_what_is_stated(recalibrated, wide)) return;
  for (const std::size_t one : slots) nuisances_[one].misstated = 1;
}

// Trials that end early where no outcome is stated may have failed: then the steps recorded hold too few failures.
void MachineTransitions::ask_for_outcomes(const std::vector<double>& nuisance) {
  if (!plan_.failing || std::ranges::any_of(runs_.trials, [](const MachineTrial& t) { return t.outcome.has_value(); }))
    return;
  const auto [shortest, longest] =
      std::ranges::minmax_element(runs_.trials, {}, [](const MachineTrial& t) { return t.rows.size(); });
  double foretold = 0;
  if (shortest->rows.size() < longest->rows.size())
    for (const double chance : rest_chances(fit(*this, nuisance, {}).nuisance, {})) foretold += chance;
  if (foretold < foretold_failures) return;
  notes_.push_back(
      fmt::format("outcome: the model fails in {:.0f} of the steps recorded, trials have {} to {} rows, and no outcome "
                  "is stated: did those that end early fail (outcome \"failed\")?",
                  foretold, shortest->rows.size(), longest->rows.size()));
}

double MachineTransitions::mean_log_density(const Evaluation& evaluation) const {
  double sum = 0, count = 0;
  for (std::size_t e = 0; e < events_.size(); ++e)
    if (events_[e].kind == EventKind::step) sum += evaluation.log_density[e], ++count;
  return count > 0 ? sum / count : -std::numeric_limits<double>::infinity();
}

bool of_unit(const MisreadRuns& read) { return read.change.ends_with("times as large"); }

// A column that was misread passes for effects, and for parameters that are far off. A part of the trials shows it. An
// input in another unit makes a state look as if it were: it is sought where a state is asked about.
void MachineTransitions::ask_for_misread_columns(const Fit& recalibrated) try {
  const double here = mean_log_density(recalibrated.evaluation);
  const auto unit = std::ranges::find_if(
      notes_, [](const std::string& note) { return note.find("what the machine makes of the rows") != note.npos; });
  std::vector<MisreadRuns> parts = misread_runs(*machine_, thinned(runs_, enough_to_suspect));
  if (unit == notes_.end()) std::erase_if(parts, of_unit);
  const std::vector<double> starts[]{nominal_values(*this), recalibrated.nuisance};
  std::vector<double> there(2 * parts.size());
  side_by_side(there.size(), 1, [&](std::size_t i) {
    const auto model = with_runs(parts[i / 2].runs);
    there[i] = model->mean_log_density(model->evaluate(starts[i % 2], {}));
  });
  const auto best = static_cast<std::size_t>(std::ranges::max_element(there) - there.begin());
  if (there.empty() || !(there[best] > here)) return;
  const std::vector<MisreadRuns> all = misread_runs(*machine_, runs_);
  const MisreadRuns& read = *std::ranges::find(all, parts[best / 2].change, &MisreadRuns::change);
  const auto model = with_runs(read.runs);
  const double gain = model->mean_log_density(fit(*model, starts[best % 2], {}).evaluation) - here;
  const auto values = static_cast<double>(std::ranges::count(events_, EventKind::step, &Event::kind));
  if (!(gain > std::max(misread_nats, misread_nats_in_all / values))) return;
  // A reading under which a state still seems to be in another unit explains nothing.
  if (unit != notes_.end() && !ask_map(*machine_, read.runs).other_units.empty()) return;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (of_unit(parts[i]) && std::max(there[2 * i], there[2 * i + 1]) > there[best] - misread_nats)
      unit->replace(unit->size() - 1, 1, ", or " + parts[i].question);
  if (!of_unit(read))  // It may settle other questions.
    notes_.insert(notes_.begin(),
                  fmt::format("{} the model fits by {:.2g} nats a value better: {}", read.change, gain, read.question));
} catch (const std::invalid_argument&) {  // The map need not be defined where no row was measured.
}

// Returns, in ascending order, the levels of the measured values of runs drawn from the model: the share of values
// below each, of those of rows that go on. They are uniform where the likelihood is that of what is drawn.
std::vector<double> MachineTransitions::levels_of_own_draws(const std::vector<double>& nuisance) const {
  const MachineHypothesis supposed = hypothesis(nuisance, {});
  std::vector<double> levels;
  for (std::uint64_t draw = 0; draw < most_own_draws && levels.size() < enough_levels; ++draw) {
    const auto own = drawn(runs_, nuisance, {}, own_seed + draw, Launches::stated);
    std::vector<double> failed;
    const Evaluation there = follow_machine(*machine_, own->runs_, own->plan_, own->events_, supposed, &failed);
    for (std::size_t e = 0; e < own->events_.size(); ++e) {
      if (own->events_[e].kind != EventKind::step || failed[e] >= 1) continue;
      // The score counts a failure as a value below all, and a wild row as one that may be a failure.
      const double below = own->events_[e].rested ? supposed.wild + (1 - supposed.wild) * failed[e] : 0;
      levels.push_back((dynamics::normal_cdf(there.score[e]) - below) / (1 - below));
    }
  }
  std::ranges::sort(levels);
  return levels;
}

void MachineTransitions::require_own_draws(const Fit& recalibrated) const {
  const std::vector<double> levels = levels_of_own_draws(recalibrated.nuisance);
  const auto count = static_cast<double>(levels.size());
  double apart = 0;  // It is Kolmogorov's distance.
  for (std::size_t i = 0; i < levels.size(); ++i)
    apart = std::max({apart, std::abs(levels[i] - static_cast<double>(i) / count),
                      std::abs(levels[i] - static_cast<double>(i + 1) / count)});
  const auto measured = static_cast<double>(std::ranges::count(events_, EventKind::step, &Event::kind));
  const Rules rules;
  if (apart < rules.own_draws_apart || apart * std::sqrt(measured) < rules.own_draws_shown ||
      apart * std::sqrt(count) < rules.own_draws_by_chance)
    return;
  throw OwnDrawsDiffer(apart, rules.own_draws_apart);
}

// Lists the suspected effects, with their sizes, with which the runs are about as likely while all parameters stay near
// where they are stated.
std::vector<std::string> MachineTransitions::effects_instead(const Fit& recalibrated) const {
  MachineTransitions strict(*this);
  for (Nuisance& one : strict.nuisances_) one.misstated = 0;
  std::vector<std::string> all;
  for (const MachineEffect& effect : machine_->effects) {
    const Candidate& candidate = *std::ranges::find(candidates_, effect.id, &Candidate::id);
    EffectTerm none{&candidate, candidate.variants.front(), {}};
    for (const FreeParameter& p : candidate.parameters) none.values.push_back(p.neutral);
    const Fit with = fit(strict, nominal_values(strict), {none});
    if (2 * (recalibrated.log_likelihood - with.log_likelihood) > Rules{}.told_apart) continue;
    if (!misstated_slots(*this, with.nuisance).empty()) continue;
    std::vector<std::string> sizes;
    for (const auto& [name, value] : candidate.report(none.variant, with.terms.front().values))
      sizes.push_back(fmt::format("{} {:.3g}", name, value));
    all.push_back(fmt::format("{} ({})", effect.id, fmt::join(sizes, ", ")));
  }
  return all;
}

// Says whether a recalibration gains by the share of wild rows alone, but for what chance gains in the others.
bool MachineTransitions::only_wild_rows(const Fit& recalibrated) const {
  if (!(machine_->most_wild > 0)) return false;
  std::vector<double> values = nominal_values(*this);
  values.back() = recalibrated.nuisance.back();
  const double gain =
      2 * (recalibrated.penalised - evaluate(values, {}).total() + nuisances_.back().cost(values.back()));
  const auto others = static_cast<double>(values.size() - 1);
  return others == 0 || gain < others + chance_sds * std::sqrt(2 * others);
}

std::vector<std::string> MachineTransitions::misstated(const Fit& fitted) const {
  const std::vector<std::size_t> slots = misstated_slots(*this, fitted.nuisance);
  if (fitted.terms.empty() && slots.empty() && only_wild_rows(fitted))
    return {fmt::format(
        "Nothing but the share of wild rows, {:.2g}, differs from the model as given by more than chance may make it.",
        share_of(fitted.nuisance.back()))};
  if (slots.empty()) return {};
  const Eigen::MatrixXd root = resolved_root(fitted.information);
  std::vector<std::string> far;
  for (const std::size_t slot : slots) {
    const Nuisance& stated = nuisances_[slot];
    const double value = fitted.nuisance[slot];
    const double half = normal_90 * root.row(static_cast<Eigen::Index>(slot)).norm();
    far.push_back(fmt::format("{} is {:.4g} (90 %: {:.4g} to {:.4g}), {:.2g} of its stated sds from {:.4g}{}",
                              stated.name, value, value - half, value + half, sds_off(stated, value), stated.nominal,
                              value * stated.nominal < 0 ? ", with the other sign" : ""));
  }
  const bool alone = fitted.terms.empty();
  const std::vector<std::string> other = alone ? effects_instead(fitted) : std::vector<std::string>{};
  return {fmt::format("{}{}: known less well than stated, unless {}{}.", alone ? "" : "With what is named, ",
                      fmt::join(far, "; "),
                      other.empty() ? "a unit, a sign or a clock is wrong"
                                    : "an effect is at work that these data do not tell from it: ",
                      fmt::join(other, ", "))};
}

}  // namespace

OwnDrawsDiffer::OwnDrawsDiffer(double apart_, double allowed_)
    : std::runtime_error(fmt::format(
          "step: rows that it draws itself are not distributed as its likelihood says (distribution functions differ "
          "by {:.2g}, {:.2g} is allowed), so that effects would be named that are not there. A step that jumps, folds, "
          "saturates or has a kink in its noise does that: each noise has to move the next state smoothly and one way",
          apart_, allowed_)),
      apart(apart_),
      allowed(allowed_) {}

std::unique_ptr<TransitionModel> machine_as_stated(std::shared_ptr<const Machine> machine, MachineRuns runs) {
  return std::make_unique<MachineTransitions>(refusing_nan(std::move(machine)), std::move(runs));
}

std::unique_ptr<TransitionModel> machine_transitions(std::shared_ptr<const Machine> machine, MachineRuns runs) {
  auto model = std::make_unique<MachineTransitions>(refusing_nan(std::move(machine)), std::move(runs));
  const Fit recalibrated = best_fit(*model, nominal_values(*model), {});
  model->set_aside_what_is_misstated(recalibrated);
  model->ask_for_outcomes(recalibrated.nuisance);
  model->ask_for_misread_columns(recalibrated);
  return model;
}

}  // namespace metastable::analysis
