#pragma once
// States what the diagnosis knows of a system: one-step transition densities of its measured trials, with effects that
// can be added. No wheel stands in here: any stochastic return map can be diagnosed that has these members.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace metastable::analysis {

/// Says what a transition's density is of.
enum class EventKind {
  launch,     ///< the first speed
  collision,  ///< omega+ given omega-
  stance,     ///< the next omega- given omega+
  step,       ///< the next omega- given this one
  rest,       ///< coming to rest
  survival    ///< not coming to rest after the last measured speed
};

inline bool is_stance(EventKind kind) { return kind == EventKind::stance; }
/// Says whether it is a collision, with its stance or alone, or what came of one: rest, survival.
inline bool is_contact(EventKind kind) { return kind != EventKind::stance && kind != EventKind::launch; }

/// A column of what was measured; its unit may be unknown.
struct ObservedColumn {
  std::string name, unit;
};

/// One observed transition and its place in the experiment. The list of a data set does not depend on parameters.
struct Event {
  EventKind kind = EventKind::step;
  std::size_t trial = 0;      ///< index, in the order the trials were run
  std::size_t condition = 0;  ///< index
  int number = 1;             ///< of the collision in its trial, from 1
  std::optional<int> leg = {};
  double position = 0;                        ///< [TransitionModel::position_unit()]
  std::optional<double> since_previous = {};  ///< collision [s]; none where it may not judge
  double speed = 0;                           ///< given, the condition of the density [rad/s]
  std::optional<bool> rested = {};            ///< after this collision; none: not known, or no collision
  std::size_t column = 0;                     ///< which of TransitionModel::columns() was observed
  double added = 0;                           ///< known part of the measurement error, in the observed speed [rad/s]
};

/// Says whether an event is the first that is observed of a collision or step.
bool begins_step(const std::vector<Event>& events, std::size_t event);

/// Holds the logarithm of each event's density [events] and the normal score of its probability integral transform,
/// independent and standard normal if the model is right. The score of a `survival` is 0.
struct Evaluation {
  std::vector<double> log_density;
  std::vector<double> score;
  std::vector<double> unit;  ///< change of the observed speed per unit of score, there [rad/s]
  double total() const;
};

/// A parameter that is refitted with every hypothesis, held near its nominal value by a normal prior. Where a stated
/// number may be another one altogether, the prior is (1 - misstated) exp(-d^2/2) + misstated, d sds from it: far off
/// it neither pulls nor lets an effect gain by bringing the parameter back.
struct Nuisance {
  std::string name;
  double nominal = 0;
  double prior_sd = 1;
  double step = 1e-4;  ///< for differences
  double lower = 0, upper = 0;
  bool assumed = false;  ///< nobody stated it: the model as given has it refitted
  double form_sd = 0;    ///< what errors of the model's form move a fitted one by; its reported interval knows of it
  double misstated = 0;  ///< probability that the nominal value is not that of what was run at all, in [0, 1)

  /// Returns minus the logarithm of the prior, 0 at the nominal value.
  double cost(double value) const;
  /// Returns by how much that rises with the value.
  double pull(double value) const;
  /// Returns the information that the prior adds there.
  double information(double value) const;
};

/// A parameter of an effect that is fitted.
struct FreeParameter {
  double neutral = 0;
  double lower = 0, upper = 0;
  double step = 1e-4;   ///< for differences
  double try_at = 0;    ///< a size worth starting from where the neutral value says nothing; 0: start at neutral
  double likely = 0;    ///< a size that the data show by themselves, from which fits start as well; 0: there is none
  double prior_sd = 0;  ///< of a normal prior about neutral, where more is known than the bounds say; 0: there is none
  double blur = 0;      ///< values so far to either side of a fitted one are about as likely as that one
};

/// A number as it is reported: by its name.
using NamedValue = std::pair<std::string, double>;

/// One effect with its variant and the values of its parameters, as a fit holds it.
struct FittedForm {
  std::vector<double> variant, values;
};

/// An effect as it is fitted: some parameters are free, the others run over a list of variants (a leg, an interval).
struct Candidate {
  std::string id;
  std::vector<FreeParameter> parameters;
  std::vector<std::vector<double>> variants{{}};  ///< at least one
  /// Says by entry of a variant how far apart the list's values lie, where those between are possible; else 0.
  std::vector<double> refine = {};
  /// Returns the fitted values under the names of the catalogue.
  std::function<std::vector<NamedValue>(const std::vector<double>& variant, const std::vector<double>& values)> report;
  /// The inverse gives the form of the effect with these values of the catalogue, in the order of its parameters. Where
  /// it is empty the catalogue's values are the fitted ones.
  std::function<FittedForm(const std::vector<double>& catalogue_values)> form_of = {};
  /// Says why these data cannot tell it; empty if they can.
  std::string undecidable;
  /// If true, reality has no other form of it than this one: none of its gain is forgiven as an error of form.
  bool exact = false;
  /// If true, likely sizes far from none are sought where fits leave a gap without a name (far_sizes.h): it has one
  /// parameter and one variant.
  bool seek_far = false;
};

/// A variation without a name, as it is fitted: something varies in a way that no effect of the catalogue has.
struct Variation {
  std::string facet, aspect;  ///< what it goes by, and what of the contact varies
  Candidate candidate;
  std::vector<std::string> named = {};  ///< effects that go by the same, with as many numbers
  bool beside = false;                  ///< no effect does such a thing: it is sought beside the likeliest ones, too
};

/// A hypothesis adds candidates with values.
struct EffectTerm {
  const Candidate* candidate = nullptr;
  std::vector<double> variant;
  std::vector<double> values;
};

/// Says what a unit of an effect's parameter adds to one number of the model, transition by transition.
struct Addition {
  std::size_t number = 0;       ///< which of the numbers that the model lets differ between transitions
  std::vector<double> weights;  ///< [transitions], of all trials in their order
};

/// Makes the candidate the effect with these values of the catalogue.
EffectTerm term_of(const Candidate& candidate, const std::vector<double>& catalogue_values);

/// Effects that act alike in some experiments, and what the field calls all of them together.
struct EffectGroup {
  std::string name;  ///< "a constant torque"
  std::vector<std::string> members;
};

/// Says where a fit may start.
struct FitStart {
  std::vector<double> nuisance;
  std::vector<std::vector<double>> values;  ///< by term
  bool alone = false;                       ///< where it is likelier, the usual start is not worth a fit
};

class TransitionModel;
struct Fit;

/// An experiment that differs from the one at hand in one thing.
struct ChangedExperiment {
  std::string kind;   ///< what differs, in the words of a key ("slope_deg_by"); empty: nothing
  double amount = 0;  ///< by how much, in the unit of the kind
  std::string words;  ///< "slopes flatter by 3 deg"
  /// Makes it, with data drawn, while the model that lists it lives.
  std::function<std::unique_ptr<TransitionModel>()> make;
};

class TransitionModel {
 public:
  virtual ~TransitionModel() = default;
  virtual const std::vector<Event>& events() const = 0;
  virtual std::size_t trials() const = 0;
  virtual std::size_t conditions() const = 0;
  /// Counts the legs, where events know theirs; 0 where it is not known which leg landed, or without legs.
  virtual int legs() const = 0;
  /// Says whether the events' times since the previous one tell more than their speeds do: false where a time was
  /// computed from the event's own speed alone.
  virtual bool time_tells() const = 0;
  virtual std::string condition_name(std::size_t condition) const = 0;
  /// Names a trial as its user does. The default is its number in the order they were run, from 1.
  virtual std::string trial_name(std::size_t trial) const { return std::to_string(trial + 1); }
  /// Names one of the steps that a speed is observed of, in the singular.
  virtual std::string step_name() const { return "step"; }
  /// Names what is observed of a step; Event::column is its index.
  virtual std::vector<ObservedColumn> columns() const { return {{"speed", "rad/s"}}; }
  /// Names what Event::leg is the number of, and says which one.
  virtual std::string leg_name() const { return "leg"; }
  virtual std::string leg_word(int leg) const;
  /// Returns the unit of an effect's parameter as it is reported; "" for a ratio, and where no unit is known.
  virtual std::string unit_of(const std::string& /*effect*/, const std::string& /*parameter*/) const { return ""; }
  /// Names the unit in which Event::position is measured.
  virtual std::string position_unit() const { return "m"; }
  /// Says what a recalibration refits, in words that "remove" can follow.
  virtual std::string recalibrated() const { return "contact parameters"; }
  virtual const std::vector<Nuisance>& nuisances() const = 0;
  virtual const std::vector<Candidate>& candidates() const = 0;
  /// Names every effect of the system's catalogue, those included that these data cannot have. The default names the
  /// candidates.
  virtual std::vector<std::string> effect_ids() const;
  /// Names groups of effects that may act alike; of two groups with the same members the first counts. The default has
  /// none.
  virtual std::vector<EffectGroup> groups() const { return {}; }
  /// Names what a recalibration alone is called where causes are listed.
  virtual std::string recalibration_id() const { return "recalibration"; }
  /// Lists what may vary without a name: it is fitted as candidates are, held against them, and never a cause.
  virtual const std::vector<Variation>& variations() const;
  /// Returns the push of every observed value by a number of its own, the same at every step, whatever causes it; its
  /// parameters are in the order of columns(). The default, nullptr, says that this system has none.
  virtual const Candidate* even_push() const { return nullptr; }
  /// Gives the densities with these nuisances and effects. Values outside a model's reach give a very small density,
  /// never a NaN.
  virtual Evaluation evaluate(std::span<const double> nuisance, std::span<const EffectTerm> terms) const = 0;
  /// Calls work(i), which evaluates hypotheses, once for every i in [0, count). The default is markov::parallel_for();
  /// a model whose simulator costs much a call may join the calls of all works. Answers do not depend on it.
  virtual void side_by_side(std::size_t count, int threads, const std::function<void(std::size_t)>& work) const;
  /// Counts the transitions of each trial. Event::number is that of its transition in the trial, from 1. The default is
  /// none: the model has no additions.
  virtual std::vector<std::size_t> transitions() const { return {}; }
  /// Returns what a term at its neutral values adds, a unit of one of its parameters, if an addition is all that it
  /// does. The default says that it is not.
  virtual std::optional<Addition> addition(const EffectTerm& term, std::size_t parameter) const;
  /// Gives the densities with an addition beside the terms. The default throws std::logic_error.
  virtual Evaluation evaluate_with(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                   const Addition& added) const;
  /// Says whether a recalibration refits the noise of every step, so that it takes up part of a large gap.
  virtual bool refits_noise() const { return false; }
  /// Offers starts that the data themselves suggest for a fit of these terms, tried beside the usual one. The default
  /// offers none.
  virtual std::vector<FitStart> starts(std::span<const EffectTerm> terms) const;
  /// Says how large effects are beside what the nominal model states, or that sizes are none that the effects can have,
  /// a sentence. The default says nothing.
  virtual std::string size_in_words(std::span<const EffectTerm> terms) const;
  /// Returns [events] the probability of coming to rest after each event's collision, given what was measured before
  /// it; 0 for events of no collision. The default is 0 throughout.
  virtual std::vector<double> rest_chances(std::span<const double> nuisance, std::span<const EffectTerm> terms) const;
  /// Returns the same design (trials, columns, conditions) with outcomes drawn from the model. The same seed gives the
  /// same data.
  virtual std::unique_ptr<TransitionModel> simulate(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                                    std::uint64_t seed) const = 0;
  /// Lists changed experiments, with data that will be drawn from the model with these effects: the same once more,
  /// first, then another slope or launch, more columns, longer trials. The default lists none.
  virtual std::vector<ChangedExperiment> alternatives(std::span<const double> nuisance,
                                                      std::span<const EffectTerm> terms, std::uint64_t seed) const;
  /// Returns the same design at another place, by the names of what differs there (a slope, a launch), for its expected
  /// steps alone, and says in words where that is. The default knows none.
  /// @throws std::invalid_argument for a name that this system does not have, or a value out of its range
  virtual std::pair<std::string, std::unique_ptr<TransitionModel>> elsewhere(
      const std::vector<NamedValue>& place) const;
  /// Returns the same design with each column not measured, by the column's name, with data drawn from the model.
  /// The default has none.
  virtual std::vector<std::pair<std::string, std::unique_ptr<TransitionModel>>> completed(
      std::span<const double> nuisance, std::uint64_t seed) const;
  /// Counts observed collisions at risk, and how many of them led to rest. Zero where outcomes are unknown.
  virtual std::pair<double, double> rests() const = 0;
  /// Returns the same design with launches of a distribution that these trials leave possible, for its expected steps
  /// alone: where launches are known from no more than these trials. The default, nullptr, says that they are stated.
  virtual std::unique_ptr<TransitionModel> relaunched(std::uint64_t seed) const;
  /// Finds the expected steps before failure under the model, from its hazard along simulated trials as long as the
  /// measured ones, with launches like theirs: infinity where it never rests.
  virtual double expected_steps(std::span<const double> nuisance, std::span<const EffectTerm> terms,
                                std::uint64_t seed) const = 0;
  /// Says in a sentence why expected_steps() are not the machine's; "" where they are.
  virtual std::string steps_not_told() const { return ""; }
  /// Holds what the recalibrated model draws against the densities that it gives. The default does nothing.
  /// @throws std::runtime_error  where the two differ by so much that effects would be named which are not there
  virtual void require_own_draws(const Fit& recalibrated) const;
  /// Says where a fit that suits the data leaves a number far from where it is stated, and, for a fit without effects,
  /// what would do instead: sentences. The default has none.
  virtual std::vector<std::string> misstated(const Fit& fitted) const;
  /// Says what is not known or was assumed, a sentence each.
  virtual const std::vector<std::string>& notes() const = 0;
  /// Says what was wrong with the data or the nominal model and taken all the same; "" if nothing was.
  virtual std::string accepted_defects() const { return ""; }
  /// Says what a recalibration is reported by: contact or loss parameters.
  virtual std::vector<NamedValue> report_nuisances(std::span<const double> nuisance) const = 0;
};

/// Gives the nuisances as the experiment states them.
inline std::vector<double> nominal_values(const TransitionModel& model) {
  std::vector<double> values;
  for (const Nuisance& n : model.nuisances()) values.push_back(n.nominal);
  return values;
}

}  // namespace metastable::analysis
