#pragma once
// Finds out whether trials fall into two groups, as those of two machines in one folder do.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/fitting/effect_scan.h"

namespace metastable::analysis {

/// Holds one parameter as a single trial's scores tell it: its value, and the information behind it.
struct TrialValue {
  std::size_t trial = 0;
  double value = 0, weight = 0;
};

/// Trials in two groups.
struct TwoGroups {
  std::vector<std::size_t> fewer;  ///< trials of the smaller group, in their order
  std::size_t sorted = 0;          ///< trials in both
  double apart = 0;                ///< of the groups' means, in sds of a trial within its group
  double within = 0;               ///< weighted sum of squares that they leave
  double gain = 0;                 ///< logarithm of the sum of squares over `within`, times the trials
};

/// Splits values where that leaves the least sum of squares; nothing where there are too few for two groups of three
/// and of a tenth of all.
std::optional<TwoGroups> split(std::vector<TrialValue> values);

/// Finds the trial from which on values differ, as they do where one machine's trials follow another's. Its gain is
/// over what a polynomial of degree three in the order of trials leaves: a drift gains nothing. Nothing where there are
/// too few.
/// @param values  in the order of trials
std::optional<TwoGroups> broken(const std::vector<TrialValue>& values);

/// Returns how often the gain of a break is as large by chance where values are normal. @param trials  >= 6
double break_p_value(double gain, std::size_t trials, std::uint64_t seed);

/// Returns how often the gain of a split is as large by chance where values swing like a sine: of all that varies
/// smoothly from trial to trial, this looks most like two groups. @param trials  their number, >= 6
double split_p_value(double gain, std::size_t trials, std::uint64_t seed);

/// The two groups of trials that one set of parameters cannot hold, and along what they lie apart.
struct TrialGroups {
  std::string along;  ///< name of a parameter that is refitted, or of an effect
  TwoGroups groups;
  bool in_order = false;  ///< one group comes after the other, and does not lie far enough apart to be told otherwise
  std::string label;      ///< column whose values the groups are; empty: none is known
};

/// Looks along every parameter that is refitted and every effect that all trials show alike, within the conditions.
/// Groups that a hypothesis accounts for by what it says of the trials' order, time, place or labels are none.
/// @param scan  of the recalibrated model  @param chosen  fit of the likeliest hypothesis
std::optional<TrialGroups> trial_groups(const TransitionModel& model, const EffectScan& scan, const Fit& recalibrated,
                                        const Fit& chosen, std::uint64_t seed);

/// Says it in a sentence, and asks for the reason where no label is that; names the first trials of the smaller group.
std::string trial_groups_in_words(const TransitionModel& model, const TrialGroups& found);

}  // namespace metastable::analysis
