#pragma once
// Puts two or more settings side by side, on common random numbers.

#include <optional>
#include <string>
#include <vector>

#include "analysis/statistics/trial_design.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Compares one setting with the first of the list.
struct Contrast {
  std::size_t against = 0, of = 0;  ///< indices: `of` compared with `against`
  std::optional<Estimate> ratio;    ///< expected steps of `of` over those of `against`; nothing if a side is infinite
  std::optional<Estimate> difference;  ///< expected steps of `of` minus those of `against`
  /// The number of measured trials per setting, each of `collisions` collisions, after which a two-sided 5 % Welch
  /// test on the mean number of steps within those collisions tells the two apart with 80 % power; nothing if they do
  /// not differ within them.
  std::optional<double> trials_needed;
  std::optional<double> power;  ///< of that test with so many trials; nothing where there is no such number
  std::string sentence;         ///< the contrast in words
};

struct Comparison {
  std::vector<Metastability> studies;  ///< with their settings
  std::vector<std::string> labels;     ///< what is particular to each setting (setting_labels.h)
  std::vector<Contrast> contrasts;     ///< each later setting against the first
};

/// Studies all settings with the same seed and the same resolution (the finest any of them needed), so that replicate r
/// of all sides shares its noise, and forms differences and ratios replicate by replicate. What a table of landings and
/// moving feet leave open (StepsToRest::landing_error, memory) widens them by both sides: nothing shows that it
/// cancels.
/// @param collisions length of a measured trial, >= 1
Comparison compare(const std::vector<Setting>& settings, const StudyOptions& options, int collisions = 16);

/// Returns what is behind Contrast::trials_needed, of min(steps, collisions + 1), from the survival curves P(steps >
/// n), n = 0 .. collisions: trials_for_power().
/// @throws std::invalid_argument for curves that are shorter, and collisions below 1
std::optional<TrialDesign> trials_to_tell_apart(const std::vector<double>& survival_a,
                                                const std::vector<double>& survival_b, int collisions);

}  // namespace metastable::analysis
