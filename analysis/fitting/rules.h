#pragma once
// The rules of the diagnosis: the numbers that decide the verdict, with their sources. Numbers that save time, say how
// a fit is run and when it is decided, how a gap is measured, or what a sentence mentions stand where they are used.

#include <array>
#include <cstddef>
#include <utility>

namespace metastable::analysis {

/// The numbers that decide, as `diagnose` takes them. Gains are 2 Delta log likelihood, evidence is a log Bayes factor,
/// odds are ratios of probabilities. Three kinds of sources are named: a derivation; a convention, where any number
/// near it would do as well and this one is stated; a measurement, with the command that repeats it.
/// `tests/benchmarks/turned_rules` turns each by a quarter up and down on a folder of sealed cases and prints what
/// changes in false alarms, false names and names.
struct Rules {
  // Evidence of a hypothesis.

  /// Gain expected of an effect before its size is known, at least. Convention: six standard errors, between what is
  /// hardly seen (16) and what nobody overlooks (64). Half or twice of it move the evidence of a gain of 100 by less
  /// than 1.
  double expected_gain = 36;
  /// Share of an effect's size that its form may be off by: no catalogue entry has exactly the form of what nature did.
  /// Measurement: effects of engines under the form of the catalogue leave up to 5 % of their size (page of results,
  /// "engines"; `ctest -R EngineDiagnosis`).
  double model_error = 0.06;
  /// Share of its size that the form of a variation without a name may be off by: it is a general one, of nothing that
  /// was ever there. Measurement: where a collision gets back 0.74 of what the last one lost beyond its mean, effects
  /// that are not there gain up to 6.5 % of what the variation by collisions before does (page "Blind runs").
  double variation_error = 0.25;
  /// Odds of one more effect to none more, shared by those that it may be. Convention: of twenty experiments with one
  /// effect one has two, and so on.
  double pair_prior = 0.05;
  /// Largest logarithm of what one effect of a pair hides of the other's gain by its scatter. Derivation: of n normal
  /// errors a gain of g lowers the variance by exp(-g / n). Convention: no more than a third is put down to that.
  double most_hidden = 0.3;
  /// Ratio of what several effects gain together to what they gain alone, beyond which they describe and do not
  /// explain. Measurement: at most 1.12 in 80 simulated pairs, and 1.3 to 2.4 where two effects bend each other into
  /// the shape of a spread of restitution that depends on speed (page "What the blind runs taught").
  double most_together = 1.2;
  /// The ratio beyond which it is none of the catalogue. Measurement: data drawn with both effects have reached 1.41,
  /// pairs that imitate what no catalogue holds 1.6 and more (the same page). Between the two, both are at work with
  /// something without a name.
  double surely_bent = 1.5;

  // Tests for a gap: shares of the level, whose sum keeps it.

  /// Share of the test of the best single effect; the tests of unnamed gaps have equal parts of what it leaves (see
  /// share_for_unnamed()). Convention: tests of a named effect have the most power, so that they get most.
  double share_for_effects = 0.8;
  /// Share of the test of pairs whose effects hide one another, on top of the level. Measurement: of 93 folders of own
  /// data none raises an alarm (tests/benchmarks/own_data.py), as the look at all pairs is paid for in full.
  double share_for_pairs = 0.1;

  // Limits of what the best hypothesis may leave before something without a name is supposed.

  /// Level of the largest cell that it leaves beyond the model error, among all cells. Convention: 0.3 %, three
  /// standard deviations; of 30 cells one whose statistic squared is above 15.
  double remaining_level = 0.003;
  /// Held-out gap that counts as one [nats a collision]. Convention: a twentieth of a nat is what a normal error of a
  /// third of its sd does.
  double least_remaining = 0.05;
  /// Held-out gap that counts as one where every draw of the trials shows it [nats, all collisions]. Derivation: 2
  /// Delta log likelihood of 12, 3.5 standard deviations.
  double least_remaining_in_all = 6;
  /// Squared model errors of the gap as given that count as none held out. Derivation: an error of form of e leaves e^2
  /// of an effect's gain, and one in each of about six of the aspects and facets that it shows in.
  double remaining_errors = 6;
  /// Squared model errors that may be spread over the cells of a facet. Derivation: as remaining_errors, of a facet's
  /// three aspects: mean, spread, tail.
  double facet_errors = 3;

  // Priors of something without a name.

  /// Odds of something unnamed to one effect of the catalogue, where it acts alone. Measurement: with 4, 6 of 112
  /// effects outside the catalogue are misnamed on the seeds 2041 to 2044 (page "Blind runs").
  double unnamed_alone = 4;
  /// Odds of it beside a hypothesis, to that alone. Convention: of the kind of pair_prior, one in thirty.
  double unnamed_beside = 0.03;
  /// Odds of none to a gap where nothing is left over. Convention: never certain beyond one in a hundred.
  double none_prior = 0.01;
  /// Odds of none where a test decides against all that were fitted, as good as certain; and where too few trials
  /// cannot tell, or a pair gains suspiciously much. These are what the words mean: nothing is to be turned.
  static constexpr double certain_odds = 1e6, even_odds = 1;

  // The answer.

  /// Probability from which on an effect or a group is at work. Convention: four times as likely as not. A gap is
  /// explained where something without a name is less likely than 1 minus this.
  double least_at_work = 0.8;
  /// Share of what the effects' probabilities add up to that the set of causes holds. Convention: 95 %.
  double set_share = 0.95;
  /// Share of the first one's probability below which a cause is not named for completeness. Convention: 5 %.
  double least_of_first = 0.05;
  /// Gain that tells two causes apart. Derivation: 2 ln 20, odds of 20 to 1.
  double told_apart = 6;
  /// Gain at which an effect is seen in most experiments like this one. Derivation: four standard errors; with the look
  /// at 30 effects that exceeds the level of 2 % in seven of ten experiments.
  double seen_gain = 16;
  /// Probability from which on an effect or a facet is listed. Convention: 5 %.
  double least_listed = 0.05;

  /// Factor by which the steps for each failure over the later half of all steps differ from those over whole trials,
  /// by one model, for that to be told. Convention: a factor of 2, beyond what intervals of expected steps leave open.
  static constexpr double later_apart = 2;

  // Validity of chance levels and of causes: what data must have. The benchmark does not turn these.

  /// Trials, and transitions of each on average, from whose scores chance levels are drawn. Measurement: with fewer own
  /// data raise alarms above their level (tests/benchmarks/own_data.py --few).
  static constexpr std::size_t enough_trials = 40, enough_transitions = 4;
  /// Steps of each trial on average, and in all, from which fewer trials show what has no name, too: chance is then
  /// what the model says, or more where trials scatter more. Measurement: 20 trials of 50 steps with an input that
  /// pushes as strongly as the noise had a memory named with probability 1 without it.
  static constexpr std::size_t enough_long_steps = 25, enough_steps_in_all = 400;
  /// Trials, and transitions in all of them, from which a gap is put down to a cause: contact parameters, an
  /// effect, or something without a name. Derivation: five transitions for each of the eight parameters that a
  /// hypothesis fits (means and sds of eta and mu, shape, noise, an effect's own), and as many trials as a trend among
  /// them takes to be told from one odd trial. The tests for a gap are honest below (of 384 folders without one, of 2
  /// to 6 trials of 2 to 16 collisions, 5 at the level of 2 %; tests/benchmarks/own_data.py --few); what bends most
  /// would pass for its cause.
  static constexpr std::size_t least_trials_to_explain = 4, least_transitions_to_explain = 40;

  // These rules compare values that a machine draws with its own likelihood. The benchmark does not turn them.

  /// No diagnosis is given from this distance on between two distribution functions: that of the levels which the
  /// likelihood gives to values drawn from the model, and the uniform one that they should have. Measurement: machines
  /// that move smoothly and one way with each noise, walkers that fall in four of five trials among them, stay below
  /// 0.023; those with |z|, z^2, a jump or a dead zone in a noise z come to 0.04 to 0.22, and had effects named that
  /// were not there (two of them in `ctest -R MachineTransitions.AMapThatFolds`).
  static constexpr double own_draws_apart = 0.03;
  /// That distance times the root of the count of measured values has to be this large, too. Convention: below half of
  /// Kolmogorov's 5 % limit of 1.36 the data themselves show nothing of it.
  static constexpr double own_draws_shown = 0.6;
  /// That distance times the root of the count of values drawn has to be this large, too. Derivation: by chance it
  /// exceeds 2 in 0.07 % of samples.
  static constexpr double own_draws_by_chance = 2;

  // Trials of two machines in one folder. The benchmark does not turn these.

  /// Level at which two groups of trials are said to be there, half for groups in any order and half for one after the
  /// other. Convention: one folder in a hundred, where trials differ as the heights of a sine do or, in order, as
  /// normals about a smooth drift.
  static constexpr double two_machines_level = 0.01;
  /// Share of the trials' scatter under the likeliest hypothesis that two groups may leave. Convention: two thirds.
  /// A hypothesis that accounts for the groups leaves about as much as they do; a drift that is fitted to a step of
  /// four sds leaves twice as much.
  static constexpr double most_left_by_groups = 0.67;

  /// Says whether hypotheses are fitted and weighed alike under other rules.
  bool fits_as(const Rules& other) const {
    return expected_gain == other.expected_gain && model_error == other.model_error && pair_prior == other.pair_prior &&
           most_hidden == other.most_hidden && seen_gain == other.seen_gain;
  }
  /// Returns the share of each test of an unnamed gap: of one cell of the map, of all cells of a facet together, and of
  /// variations.
  double share_for_unnamed() const { return (1 - share_for_effects) / 3; }
  /// Returns the odds of something without a name below which a gap is explained.
  double most_odds_of_none() const { return (1 - least_at_work) / least_at_work; }
  /// Returns what an error of form leaves of a gain of one, or of each cell.
  double square_error() const { return model_error * model_error; }
};

/// The rules that can be turned, by their names.
inline constexpr std::array named_rules{
    std::pair{"expected_gain", &Rules::expected_gain},
    std::pair{"model_error", &Rules::model_error},
    std::pair{"variation_error", &Rules::variation_error},
    std::pair{"pair_prior", &Rules::pair_prior},
    std::pair{"most_hidden", &Rules::most_hidden},
    std::pair{"most_together", &Rules::most_together},
    std::pair{"surely_bent", &Rules::surely_bent},
    std::pair{"share_for_effects", &Rules::share_for_effects},
    std::pair{"share_for_pairs", &Rules::share_for_pairs},
    std::pair{"remaining_level", &Rules::remaining_level},
    std::pair{"least_remaining", &Rules::least_remaining},
    std::pair{"least_remaining_in_all", &Rules::least_remaining_in_all},
    std::pair{"remaining_errors", &Rules::remaining_errors},
    std::pair{"facet_errors", &Rules::facet_errors},
    std::pair{"unnamed_alone", &Rules::unnamed_alone},
    std::pair{"unnamed_beside", &Rules::unnamed_beside},
    std::pair{"none_prior", &Rules::none_prior},
    std::pair{"least_at_work", &Rules::least_at_work},
    std::pair{"set_share", &Rules::set_share},
    std::pair{"least_of_first", &Rules::least_of_first},
    std::pair{"told_apart", &Rules::told_apart},
    std::pair{"seen_gain", &Rules::seen_gain},
    std::pair{"least_listed", &Rules::least_listed},
};
static_assert(sizeof(Rules) == named_rules.size() * sizeof(double), "every rule has its name in named_rules");

}  // namespace metastable::analysis
