#pragma once
// Describes what an experiment's trials show, before any model but the contact fit.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/description/contact_fit.h"
#include "analysis/description/speed_profile.h"
#include "analysis/experiment/experiment.h"
#include "analysis/statistics/kaplan_meier.h"
#include "analysis/statistics/two_sample_tests.h"

namespace metastable::analysis {

/// Holds the survival of one condition's trials; those that did not rest are censored.
struct Survival {
  std::size_t trials = 0, rests = 0;
  std::vector<SurvivalPoint> curve;
  ExpectedSteps expected;
};

struct ConditionDescription {
  std::string id;
  double slope_deg = 0;
  std::size_t trials = 0, collisions = 0;
  TrialSpeeds speeds;
  std::vector<SpeedSummary> profile;              ///< entry k: collision k + 1
  SpeedSummary steady;                            ///< of trial means from collision 13 on
  SpeedSummary steady_collisions;                 ///< of all collisions from there on; not independent of each other
  std::optional<std::vector<SpeedSummary>> legs;  ///< from the second turn on; nothing: legs unknown
  std::optional<ReturnMapLine> line;              ///< through all pairs of consecutive speeds
  std::optional<Survival> survival;               ///< nothing: outcomes unknown
};

/// Holds all tests on two samples.
struct SampleComparison {
  std::size_t count_a = 0, count_b = 0;
  TTest welch, pooled;
  EffectSize hedges, superiority, distance;
  DistributionTest kolmogorov_smirnov, anderson_darling;
};
/// Nothing for fewer than two values in either sample.
std::optional<SampleComparison> compare_samples(std::span<const double> a, std::span<const double> b);

struct ConditionComparison {
  std::size_t a = 0, b = 0;                           ///< indices of the conditions
  std::optional<SampleComparison> trial_means;        ///< steady state, one value a trial: the p-values hold
  std::optional<SampleComparison> all_collisions;     ///< steady state, collisions pooled as the paper seems to do
  std::vector<std::optional<double>> p_by_collision;  ///< Welch at collision 1, 2, ...
  /// The first collision from which on no test up to the last common one has p < 0.05; nothing if the last one has.
  std::optional<int> meet;
};
ConditionComparison compare_conditions(const TrialSpeeds& a, const TrialSpeeds& b);

struct DescribedFit {
  std::string of;  ///< condition, or "all conditions"
  ContactFit fit;
};

struct Description {
  std::vector<ConditionDescription> conditions;
  std::vector<ConditionComparison> comparisons;  ///< each pair of conditions
  Transition transition = Transition::step;      ///< that was fitted
  std::vector<DescribedFit> fits;                ///< under the nominal law; empty where that is `plastic`
  std::vector<std::string> notes;                ///< what is not known and what follows from that, a sentence each
};

struct DescriptionOptions {
  std::optional<Transition> transition = {};  ///< nothing: best_transition()
  bool fit = true;
  std::uint64_t seed = 1;
  int threads = 0;
  std::function<void()> progress = {};  ///< called now and then; may throw to stop
};

/// @throws std::invalid_argument for a coast-down
Description describe(const Experiment& experiment, const DescriptionOptions& options);

}  // namespace metastable::analysis
