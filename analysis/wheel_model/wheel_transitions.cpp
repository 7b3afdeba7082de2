#include "analysis/wheel_model/wheel_transitions.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "analysis/wheel_model/contact_variation.h"
#include "analysis/wheel_model/wheel_candidates.h"
#include "analysis/wheel_model/wheel_columns.h"
#include "analysis/wheel_model/wheel_hypothesis.h"
#include "analysis/wheel_model/wheel_likelihood.h"
#include "analysis/wheel_model/wheel_nuisances.h"
#include "analysis/wheel_model/wheel_runs.h"
#include "analysis/wheel_model/wheel_simulation.h"
#include "dynamics/catalogue/effect_catalogue.h"
#include "dynamics/wheel/ranges.h"

namespace metastable::analysis {

WheelRuns runs_with_legs(const Experiment& experiment) {
  constexpr double clearly = 3;  // in log likelihood: odds of 20 to 1
  WheelRuns measured = wheel_runs(experiment);
  if (measured.legs_known) return measured;
  const bool named = std::all_of(experiment.trials.begin(), experiment.trials.end(), [&](const MeasuredTrial& trial) {
    return experiment.conditions[trial.condition].first_leg_stated;
  });
  if (experiment.wheel.equal_legs() && !named) return measured;
  WheelRuns stated = wheel_runs(with_legs_from_the_first(experiment));
  const WheelHypothesis nominal{
      .contact = stated_contact(experiment.contact, stated.noise), .tilt = ScoreTilt(0, 0), .extension = {}};
  const double with = wheel_likelihood(stated, wheel_events(stated), nominal).total();
  const double without = wheel_likelihood(measured, wheel_events(measured), nominal).total();
  if (!(with > without + (named ? -clearly : clearly))) {
    if (named)
      measured.notes.insert(measured.notes.begin(),
                            "leg is missing: first_landing_leg is stated and not used, as the speeds contradict it");
    return measured;
  }
  stated.notes.insert(
      stated.notes.begin(),
      named ? "leg is missing: counted from each condition's first_landing_leg, which is stated"
            : "leg is missing: taken from each condition's first_landing_leg, which the transitions bear out");
  return stated;
}

namespace {

constexpr double least_shift = 1e-4;  // of mu from day to day: no two days are more alike

// Says where the foot of each collision lands, by number; nothing where trials differ by more than a quarter of a step.
std::vector<double> fixed_footholds(const std::vector<WheelRun>& runs) {
  std::vector<std::pair<double, double>> ends;  // least and largest
  for (const WheelRun& run : runs)
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const double at = run.collisions[k].context.position;
      if (k == ends.size()) ends.emplace_back(at, at);
      ends[k] = {std::min(ends[k].first, at), std::max(ends[k].second, at)};
    }
  std::vector<double> footholds;
  for (const auto& [least, most] : ends) {
    const double step = ends.back().second / static_cast<double>(std::max<std::size_t>(1, ends.size() - 1));
    if (most - least > 0.25 * step) return {};
    footholds.push_back((least + most) / 2);
  }
  return footholds;
}

// Effects that act alike where the design does not tell them apart.
std::vector<EffectGroup> wheel_groups() {
  return {{"a constant torque", {"slope_offset", "rolling_resistance"}},
          {"a torque that grows with speed", {"axle_drag_viscous", "air_drag"}},
          {"a constant or growing torque", {"slope_offset", "rolling_resistance", "axle_drag_viscous", "air_drag"}},
          {"legs that differ", {"leg_lengths", "leg_contact", "hub_eccentricity"}},
          {"trials that differ", {"trial_drift", "trial_spread"}}};
}

class WheelTransitions : public TransitionModel {
 public:
  explicit WheelTransitions(const Experiment& experiment);

  const std::vector<Event>& events() const override { return events_; }
  std::size_t trials() const override { return measured_.runs.size(); }
  std::size_t conditions() const override { return measured_.conditions.size(); }
  int legs() const override { return measured_.legs_known ? measured_.wheel.legs() : 0; }
  // Times that were not measured follow from the speeds, and from the leg where it is known.
  bool time_tells() const override {
    return measured_.times_judge && (measured_.legs_known || experiment_.columns.time != Presence::none);
  }
  std::string condition_name(std::size_t condition) const override { return measured_.conditions.at(condition).id; }
  const std::vector<Nuisance>& nuisances() const override { return nuisances_; }
  const std::vector<Candidate>& candidates() const override { return candidates_; }
  std::string step_name() const override { return "collision"; }
  std::string unit_of(const std::string& effect, const std::string& parameter) const override {
    return dynamics::effect_unit(effect, parameter);
  }
  std::vector<std::string> effect_ids() const override { return dynamics::effect_ids(); }
  std::vector<EffectGroup> groups() const override { return wheel_groups(); }
  std::string recalibration_id() const override { return std::string(dynamics::contact_distribution_id); }
  const std::vector<Variation>& variations() const override { return variations_; }
  const std::vector<std::string>& notes() const override { return measured_.notes; }
  Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override;
  std::vector<std::size_t> transitions() const override;
  std::optional<Addition> addition(const EffectTerm& term, std::size_t parameter) const override;
  Evaluation evaluate_with(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                           const Addition& added) const override;
  std::vector<FitStart> starts(std::span<const EffectTerm> terms) const override;
  std::string size_in_words(std::span<const EffectTerm> terms) const override;
  std::vector<double> rest_chances(std::span<const double> nuisance, std::span<const EffectTerm> terms) const override;
  std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                            std::uint64_t seed) const override;
  std::vector<ChangedExperiment> alternatives(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                              std::uint64_t seed) const override;
  std::pair<std::string, std::unique_ptr<TransitionModel>> elsewhere(
      const std::vector<NamedValue>& place) const override;
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> completed(std::span<const double> nuisance,
                                                                                  std::uint64_t seed) const override;
  std::pair<double, double> rests() const override;
  double expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                        std::uint64_t seed) const override;
  std::vector<NamedValue> report_nuisances(std::span<const double> nuisance) const override;

 private:
  WheelHypothesis hypothesis(std::span<const double> nuisance, std::span<const EffectTerm> terms) const;
  void set_up_parameters();
  void set_up_days();

  Experiment experiment_;  // as it was read
  WheelRuns measured_;
  std::vector<Event> events_;
  std::vector<Nuisance> nuisances_;
  std::size_t days_from_ = 0;  // in nuisances_: shifts of mu on the days behind the first
  std::vector<int> days_;      // rising
  std::vector<WheelCandidate> effects_;
  std::vector<Candidate> candidates_;
  std::vector<ContactVariation> contact_variations_;
  std::vector<Variation> variations_;
};

WheelTransitions::WheelTransitions(const Experiment& experiment)
    : experiment_(experiment), measured_(runs_with_legs(experiment)), events_(wheel_events(measured_)) {
  if (events_.size() < 2 || std::none_of(events_.begin(), events_.end(), [](const Event& e) {
        return e.kind == EventKind::collision || e.kind == EventKind::step;
      })) {
    if (!measured_.landings.empty() &&
        std::ranges::any_of(measured_.runs, [](const WheelRun& run) { return run.collisions.size() > 1; }))
      throw std::invalid_argument(
          fmt::format("contact.restitution: mean {} + 2 sd of {} leaves feet moving when the next one touches, at "
                      "nearly every speed of "
                      "collisions.csv; `settled` holds for landings on feet that stand{}",
                      measured_.contact.restitution_mean, measured_.contact.restitution_sd,
                      measured_.speeds_after ? "" : " (omega_plus_rad_s would tell which do)"));
    throw std::invalid_argument(
        "collisions.csv: no trial has two collisions or omega_plus_rad_s: there is no transition");
  }
  set_up_parameters();
}

void WheelTransitions::set_up_parameters() {
  // Where nobody stated the noise, the stances say it only together with the effects that act in them.
  // Under `settled` they say what the law does not know; but steps of feet whose places are seen tell a noise that was
  // only assumed.
  const bool settled = measured_.law == dynamics::Law::settled;
  const bool refits_noise = !measured_.noise_stated && measured_.speeds_after != settled && !measured_.exact_stances;
  nuisances_ = wheel_nuisances(experiment_.contact,
                               refits_noise ? std::optional<double>(measured_.noise) : std::nullopt, measured_.noise);
  set_up_days();
  WheelDesign design;
  design.legs = measured_.wheel.legs();
  design.legs_known = measured_.legs_known;
  design.speeds_after = measured_.speeds_after;
  design.launches_stated = std::any_of(measured_.conditions.begin(), measured_.conditions.end(),
                                       [](const Condition& one) { return one.initial_speed.has_value(); });
  design.noise_stated = measured_.noise_stated;
  design.noise = measured_.noise;
  design.noise_seen = measured_.noise_seen;
  design.leg_lengths = measured_.wheel.leg_length;
  design.law = measured_.law;
  design.furthest = 0.1;
  for (const WheelRun& run : measured_.runs)
    design.furthest = std::max(design.furthest, run.collisions.back().context.position);
  design.footholds = fixed_footholds(measured_.runs);
  std::vector<double> speeds;
  for (const WheelRun& run : measured_.runs)
    for (const RunCollision& m : run.collisions) speeds.push_back(m.before);
  std::sort(speeds.begin(), speeds.end());
  for (const double share : {0.15, 0.3, 0.45, 0.6, 0.75, 0.9})
    if (const double speed = speeds[static_cast<std::size_t>(share * static_cast<double>(speeds.size()))];
        design.speeds.empty() || speed > design.speeds.back())
      design.speeds.push_back(speed);
  design.trials = measured_.runs.size();
  for (const Event& e : events_) {
    design.launches += e.kind == EventKind::launch;
    const bool contact = e.kind == EventKind::collision || e.kind == EventKind::step;
    design.successive += contact && e.number > 1;
    design.away += contact && e.position > 0;
  }
  design.ramp_length = 0;
  for (const Condition& one : measured_.conditions) design.ramp_length = std::max(design.ramp_length, one.ramp_length);
  effects_ = wheel_candidates(design);
  for (const WheelCandidate& effect : effects_) candidates_.push_back(effect.candidate);
  contact_variations_ = contact_variations(measured_);
  for (const ContactVariation& one : contact_variations_) variations_.push_back(one.variation);
}

// Wheel and ramp are not quite the same from day to day: mu may shift, as far as days are said to differ.
void WheelTransitions::set_up_days() {
  days_from_ = nuisances_.size();
  for (const Condition& condition : measured_.conditions) days_.push_back(condition.day);
  std::sort(days_.begin(), days_.end());
  days_.erase(std::unique(days_.begin(), days_.end()), days_.end());
  if (days_.size() < 2) return;
  const double mean = experiment_.contact.friction.mean,
               share = experiment_.contact.day_to_day.value_or(usual_run_to_run);
  const double sd = std::max(least_shift, std::numbers::sqrt2 * share * mean);  // of a difference
  for (std::size_t d = 1; d < days_.size(); ++d)
    nuisances_.push_back({fmt::format("friction_shift_day_{}", days_[d]), 0, sd, 1e-4, -0.5 * mean, 0.5 * mean});
  if (!experiment_.contact.day_to_day)
    measured_.notes.push_back(
        fmt::format("contact.day_to_day is missing: the mean friction is taken to differ by {:.0f} % from day to day",
                    100 * usual_run_to_run));
}

WheelHypothesis WheelTransitions::hypothesis(std::span<const double> nuisance,
                                             std::span<const EffectTerm> terms) const {
  WheelHypothesis h = hypothesis_at(nuisance.first(days_from_));
  if (days_.size() > 1)
    for (const Condition& condition : measured_.conditions) {
      const auto d =
          static_cast<std::size_t>(std::lower_bound(days_.begin(), days_.end(), condition.day) - days_.begin());
      h.friction_shift.push_back(d == 0 ? 0 : nuisance[days_from_ + d - 1]);
    }
  for (const EffectTerm& term : terms)
    for (const WheelCandidate& effect : effects_)
      if (effect.candidate.id == term.candidate->id) effect.apply(h.extension, term.variant, term.values);
  for (const EffectTerm& term : terms)
    for (const ContactVariation& one : contact_variations_)
      if (one.variation.candidate.id == term.candidate->id)
        h.varied = [&one, term, others = std::move(h.varied)](const CollisionPlace& place,
                                                              dynamics::StepContext& step) {
          if (others) others(place, step);
          vary(step, one.aspect, one.log_ratio(place, term.variant, term.values));
        };
  return h;
}

Evaluation WheelTransitions::evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const {
  return wheel_likelihood(measured_, events_, hypothesis(nuisance, terms));
}

std::vector<std::size_t> WheelTransitions::transitions() const {
  std::vector<std::size_t> all;
  for (const WheelRun& run : measured_.runs) all.push_back(run.collisions.size());
  return all;
}

// Contacts may be changed collision by collision: the numbers are their aspects.
std::optional<Addition> WheelTransitions::addition(const EffectTerm& term, std::size_t parameter) const {
  std::function<AspectChange(const CollisionPlace&)> change;
  for (const WheelCandidate& one : effects_)
    if (one.candidate.id == term.candidate->id && one.changes)
      change = [&](const CollisionPlace& at) { return one.changes(at.step, term.variant, parameter); };
  std::vector<double> unit(term.values.size(), 0.0);
  unit[parameter] = 1;
  for (const ContactVariation& one : contact_variations_)
    if (one.variation.candidate.id == term.candidate->id)
      change = [&](const CollisionPlace& at) {
        return AspectChange{one.aspect, one.log_ratio(at, term.variant, unit)};
      };
  if (!change) return std::nullopt;
  Addition added;
  for (std::size_t t = 0; t < measured_.runs.size(); ++t) {
    const WheelRun& run = measured_.runs[t];
    for (std::size_t k = 0; k < run.collisions.size(); ++k) {
      const AspectChange at = change(collision_place(run, t, k, run.collisions[k], run.collisions[k].before));
      added.number = static_cast<std::size_t>(at.aspect);
      added.weights.push_back(at.amount);
    }
  }
  return added;
}

Evaluation WheelTransitions::evaluate_with(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                           const Addition& added) const {
  std::vector<std::size_t> first{0};  // collision, by trial
  for (const std::size_t count : transitions()) first.push_back(first.back() + count);
  WheelHypothesis h = hypothesis(nuisance, terms);
  h.varied = [&, others = std::move(h.varied)](const CollisionPlace& place, dynamics::StepContext& step) {
    if (others) others(place, step);
    vary(step, static_cast<ContactAspect>(added.number),
         added.weights[first[place.trial] + static_cast<std::size_t>(place.number) - 1]);
  };
  return wheel_likelihood(measured_, events_, h);
}

// A recalibration whose stated contact is far astray starts from a coarse lattice of means, too: there the likelihood
// is flat, and no step from what is stated finds the way. The likelihood is flat about sds that the noise hides, too,
// so that a fit starts from larger ones as well.
std::vector<FitStart> WheelTransitions::starts(std::span<const EffectTerm> terms) const {
  constexpr double astray = 2;   // mean square of the scores as given, of independent standard normals if it is right
  constexpr double wide = 0.08;  // sds of either, with which a mean between two of the lattice still shows
  if (!terms.empty()) return {};
  std::vector<double> values = nominal_values(*this);
  const Evaluation given = evaluate(values, {});
  double squares = 0;
  for (const double score : given.score) squares += score * score;
  FitStart best;
  double most = given.total();
  const auto offer = [&](const dynamics::ContactSpread& contact) {
    set_contact(values, contact);
    double reached = evaluate(values, {}).total();
    for (std::size_t p = 0; p < values.size(); ++p) reached -= nuisances_[p].cost(values[p]);
    if (!(reached > most)) return;
    most = reached;
    best = {values, {}};
  };
  const Spread &eta = experiment_.contact.restitution, &mu = experiment_.contact.friction;
  if (measured_.law != dynamics::Law::settled && (eta.sd < least_scatter || mu.sd < least_scatter))
    for (const double sd : {0.003, 0.01, 0.03, wide})
      offer({eta.mean, std::max(sd, eta.sd), mu.mean, std::max(sd, mu.sd)});
  if (squares >= astray * static_cast<double>(given.score.size()))
    for (const double restitution : {0.1, 0.25, 0.4, 0.55, 0.7, 0.85})
      for (const double friction : {0.1, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0, 1.3})
        offer({restitution, wide, friction, wide});
  if (best.nuisance.empty()) return {};
  return {best};
}

// A drag is fitted with either sign, so that data with less loss than stated get a name, too.
std::string WheelTransitions::size_in_words(std::span<const EffectTerm> terms) const {
  std::vector<std::string> driving;
  for (const EffectTerm& term : terms)
    for (const char* drag : {"rolling_resistance", "axle_drag_viscous", "air_drag"})
      if (term.candidate->id == drag && term.values.front() < 0) driving.push_back(drag);
  if (driving.empty()) return {};
  return fmt::format(
      "A negative {} would drive the wheel, and no drag does: something acts alike. "
      "Are slope, inertia and the scale of the speeds as stated?",
      fmt::join(driving, " and "));
}

std::vector<double> WheelTransitions::rest_chances(std::span<const double> nuisance,
                                                   std::span<const EffectTerm> terms) const {
  return wheel_rest_chances(measured_, events_, hypothesis(nuisance, terms));
}

std::unique_ptr<TransitionModel> WheelTransitions::simulate(std::span<const double> nuisance,
                                                            std::span<const EffectTerm> terms,
                                                            std::uint64_t seed) const {
  auto copy = std::make_unique<WheelTransitions>(*this);
  copy->measured_.runs = simulated_runs(measured_, hypothesis(nuisance, terms), seed);
  copy->events_ = wheel_events(copy->measured_);
  return copy;
}

std::vector<ChangedExperiment> WheelTransitions::alternatives(std::span<const double> nuisance,
                                                              std::span<const EffectTerm> terms,
                                                              std::uint64_t seed) const {
  std::vector<ChangedExperiment> all;
  const std::vector<double> n(nuisance.begin(), nuisance.end());
  const std::vector<EffectTerm> t(terms.begin(), terms.end());
  const auto add = [&](std::string kind, double amount, std::string words,
                       std::function<void(WheelTransitions&)> change) {
    all.push_back({std::move(kind), amount, std::move(words), [this, n, t, seed, change = std::move(change)] {
                     WheelTransitions changed = *this;
                     change(changed);
                     return changed.simulate(n, t, seed);
                   }});
  };
  add("", 0, "the same experiment once more", [](WheelTransitions&) {});
  const double steepest = dynamics::steepest_slope(measured_.wheel.legs()) * 180 / std::numbers::pi;
  for (const double by : {-3.0, 3.0})
    if (std::all_of(measured_.conditions.begin(), measured_.conditions.end(),
                    [&](const Condition& c) { return c.slope_deg + by > 1 && c.slope_deg + by < steepest; }))
      add("slope_deg_by", by, fmt::format("slopes {} by {:g} deg", by < 0 ? "flatter" : "steeper", std::abs(by)),
          [by](WheelTransitions& w) {
            for (Condition& c : w.measured_.conditions) c.slope_deg += by;
            tabulate_landings(w.measured_);
          });
  for (const double by : {-2.0, 2.0})
    add("launch_rad_s_by", by, fmt::format("launches {} by {:g} rad/s", by < 0 ? "slower" : "faster", std::abs(by)),
        [by](WheelTransitions& w) {
          for (Condition& c : w.measured_.conditions)
            if (c.initial_speed) c.initial_speed->mean = std::max(1.0, c.initial_speed->mean + by);
          for (WheelRun& run : w.measured_.runs)
            run.collisions.front().before = std::max(1.0, run.collisions.front().before + by);
        });
  if (!measured_.speeds_after)
    add("speeds_after", 1, "the speed after each collision measured as well", [](WheelTransitions& w) {
      w.measured_.speeds_after = true;
      w.measured_.noise = std::max(w.measured_.noise, imagined_noise);
      for (WheelRun& run : w.measured_.runs)
        for (RunCollision& m : run.collisions) m.after = m.before;  // a value to be drawn anew
    });
  add("collisions_times", 2, "trials of twice as many collisions", [](WheelTransitions& w) {
    for (WheelRun& run : w.measured_.runs) {
      const auto count = run.collisions.size();
      run.collisions.resize(2 * count, run.collisions.back());
    }
  });
  return all;
}

std::pair<std::string, std::unique_ptr<TransitionModel>> WheelTransitions::elsewhere(
    const std::vector<NamedValue>& place) const {
  auto there = std::make_unique<WheelTransitions>(*this);
  WheelRuns& runs = there->measured_;
  dynamics::Range speeds = dynamics::range::speed;
  speeds.low_open = true;
  if (!runs.landings.empty()) speeds.high = fastest_tabulated;
  const auto require = [](const NamedValue& one, const dynamics::Range& range, const char* unit) {
    if (!range.holds(one.second))
      throw std::invalid_argument(fmt::format("{}: {} is outside {} {}", one.first, one.second, range.text(), unit));
  };
  std::vector<std::string> words;
  for (const NamedValue& one : place) {
    const double value = one.second;
    if (one.first == other_slope) {
      require(one, dynamics::slope_range(runs.wheel.legs()), "deg");
      for (Condition& condition : runs.conditions) condition.slope_deg = value;
      words.push_back(fmt::format("on a slope of {:.6g} deg", value));
    } else if (one.first == other_launch) {
      require(one, speeds, "rad/s");
      for (Condition& condition : runs.conditions)
        if (condition.initial_speed) condition.initial_speed->mean = value;
      for (WheelRun& run : runs.runs) run.collisions.front().before = value;
      words.push_back(fmt::format("with launches at {:.6g} rad/s", value));
    } else {
      throw std::invalid_argument(
          fmt::format("{}: a wheel's place is told by {} and {}", one.first, other_slope, other_launch));
    }
  }
  tabulate_landings(runs);
  return {fmt::format("{}", fmt::join(words, " and ")), std::move(there)};
}

std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> WheelTransitions::completed(
    std::span<const double> nuisance, std::uint64_t seed) const {
  std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> all;
  for (const auto& [column, experiment] : completed_experiments(experiment_))
    if (!(column == "leg" && measured_.legs_known))
      all.emplace_back(column, WheelTransitions(experiment).simulate(nuisance, {}, seed));
  return all;
}

std::pair<double, double> WheelTransitions::rests() const {
  double at_risk = 0, rested = 0;
  for (const WheelRun& run : measured_.runs) {
    if (!run.outcome) return {0, 0};
    at_risk += static_cast<double>(run.collisions.size());
    rested += *run.outcome == dynamics::Outcome::rest;
  }
  return {at_risk, rested};
}

double WheelTransitions::expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                        std::uint64_t seed) const {
  return simulated_steps(measured_, hypothesis(nuisance, terms), seed);
}

std::vector<NamedValue> WheelTransitions::report_nuisances(std::span<const double> nuisance) const {
  const WheelHypothesis at = hypothesis_at(nuisance.first(days_from_));
  const dynamics::ContactSpread& contact = at.contact;
  std::vector<NamedValue> named{{"restitution_mean", contact.restitution_mean},
                                {"restitution_sd", contact.restitution_sd},
                                {"friction_mean", contact.friction_mean},
                                {"friction_sd", contact.friction_sd}};
  if (measured_.law == dynamics::Law::plastic) named.clear();
  if (measured_.law == dynamics::Law::settled) {
    const dynamics::ContactModel model = dynamics::contact_model(measured_.wheel, measured_.law);
    named.emplace_back("hub_inertia_kg_m2", model.mass * model.radius_of_gyration * model.radius_of_gyration *
                                                at.extension.geometry.hub_inertia_ratio);
  }
  for (std::size_t k = days_from_; k < nuisances_.size(); ++k) named.emplace_back(nuisances_[k].name, nuisance[k]);
  return named;
}

}  // namespace

std::unique_ptr<TransitionModel> wheel_transitions(const Experiment& experiment) {
  return std::make_unique<WheelTransitions>(experiment);
}

}  // namespace metastable::analysis
