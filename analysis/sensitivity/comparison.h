#pragma once
// Puts two or more settings side by side, on common random numbers.

#include <optional>
#include <string>
#include <vector>

#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// Compares one setting with the first of the list.
struct Contrast {
  std::size_t against = 0, of = 0;  ///< indices: `of` compared with `against`
  std::optional<Estimate> ratio;    ///< expected steps of `of` over those of `against`; nothing if a side is infinite
  std::optional<Estimate> difference;  ///< expected steps of `of` minus those of `against`
  /// Is the number of measured trials per setting, each of `collisions` collisions, after which a two-sided 5 % Welch
  /// test on the mean number of steps within those collisions tells the two apart with 80 % power; nothing if they do
  /// not differ within them.
  std::optional<double> trials_needed;
  std::string sentence;  ///< the contrast in words
};

struct Comparison {
  std::vector<Metastability> studies;  ///< with their settings
  std::vector<Contrast> contrasts;     ///< each later setting against the first
};

/// Studies all settings with the same seed and the same resolution (the finest any of them needed), so that replicate r
/// of all sides shares its noise, and forms differences and ratios replicate by replicate.
/// @param collisions length of a measured trial, >= 1
Comparison compare(const std::vector<Setting>& settings, const StudyOptions& options, int collisions = 16);

/// Is the design behind Contrast::trials_needed, from the survival curves P(steps > n), n = 0 .. collisions.
/// n = (z_0.975 + z_0.8)^2 (var_a + var_b) / (mean_a - mean_b)^2 of min(steps, collisions + 1).
std::optional<double> trials_to_tell_apart(const std::vector<double>& survival_a, const std::vector<double>& survival_b,
                                           int collisions);

}  // namespace metastable::analysis
