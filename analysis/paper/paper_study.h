#pragma once
// Simulates the paper's results, figure by figure, under one contact law and one reading of its rest rule.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "analysis/description/description.h"
#include "analysis/description/speed_profile.h"
#include "analysis/paper/energy_losses.h"
#include "analysis/paper/variance_sources.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

/// The paper gives no rest rule. Either the wheel goes on whatever happens (x' < 0 is set to 0: all trials have 16
/// collisions, and Fig. 8 comes out), or it rests where it fails to vault (as its experiment at 7.02 deg did).
enum class RestReading { goes_on, rests };

struct Variant {
  dynamics::Law law = dynamics::Law::published;
  RestReading reading = RestReading::goes_on;
  std::string name;  ///< "published, goes on", "published, rests", "coulomb", "settled"
};
/// `coulomb` is there once: at these slopes nothing rests under it. So is `settled`: its wheel cannot go on from rest.
std::vector<Variant> paper_variants();

/// Holds one simulated velocity profile.
struct StudiedProfile {
  Setting setting;
  std::string label;
  TrialSpeeds speeds;
  std::vector<SpeedSummary> profile;
  std::vector<double> steady;       ///< speeds from collision 13 on, collisions pooled as in the paper
  std::vector<double> trial_means;  ///< of these, one a trial
  double rest_share = 0;            ///< of trials, within 16 collisions
  double transient_sd() const;      ///< mean sd at collisions 2 to 6 [rad/s]
  double steady_sd() const;         ///< mean sd at collisions 13 to 16 [rad/s]; of the survivors
};

/// Holds the three experiments, measured or their stand-in.
struct PaperExperiments {
  bool stand_in = true;
  std::string title;
  TrialSpeeds fast_959, slow_959, fast_702;
  std::optional<double> rest_share_702;
};
/// Picks the conditions of `experiment` by slope: one near 7.02 deg, two near 9.59 deg (the faster launch is the fast
/// one).
/// @throws std::invalid_argument naming what is missing
PaperExperiments paper_experiments(const Experiment& experiment);
/// @param seed of the simulation (stand_in.h)
PaperExperiments simulated_experiments(std::uint64_t seed, int threads);

struct PaperStudyOptions {
  int trials = 1000;           ///< of each simulated profile, >= 20
  std::size_t samples = 8192;  ///< of the variance shares, >= 32; `settled`, whose trials are rolled, takes an eighth
  std::uint64_t seed = 1;
  int threads = 0;
  std::function<void()> progress = {};  ///< after each of paper_study_units() pieces of work; may throw to stop
};
/// Counts the calls of `progress` by one study_variant().
std::size_t paper_study_units();

/// Says whether steady speeds of two profiles are alike. P is 1 where one of them has fewer than two values (all trials
/// rested).
struct SteadyTest {
  double p = 1;           ///< pooled t, all collisions, as the paper seems to do
  double p_by_trial = 1;  ///< Welch, one value a trial
};

/// Fig. 4 shows two starts at 9.59 deg.
struct Fig4 {
  StudiedProfile fast, slow;
  ConditionComparison comparison;
};

/// Holds a launch at one friction (Fig. 6), and the same with all legs at their mean (Sec. IV-A).
struct LaunchRun {
  double launch = 0;  ///< mean [rad/s]
  StudiedProfile measured_legs, equal_legs;
  SteadyTest legs_alike;
};
/// Compares two launches of Fig. 6 by the paper's k = 1, 2, 3.
struct LaunchPair {
  int first = 1, second = 2;
  SteadyTest alike;
};
/// Holds one panel of Fig. 6.
struct LaunchPanel {
  double friction = 0;
  std::array<LaunchRun, 3> runs;    ///< slowest launch first
  std::array<LaunchPair, 3> pairs;  ///< 1-2, 1-3, 2-3
  const LaunchRun& run(int k) const { return runs.at(static_cast<std::size_t>(k - 1)); }
  /// @throws std::out_of_range unless 1 <= first < second <= 3
  const LaunchPair& pair(int first, int second) const;
};

/// Fig. 7 varies the sds of eta and mu.
struct SpreadRun {
  double restitution_sd = 0;
  StudiedProfile profile;
  std::optional<TTest> against_experiment;  ///< at 7.02 deg; nothing where too few trials get past the 12th collision
};
struct SpreadPanel {
  double friction_sd = 0;
  std::array<SpreadRun, 3> runs;  ///< narrowest first
};

/// Fig. 8 varies one sd for eta and mu.
struct LossRun {
  double sd = 0;
  EnergyLosses losses;
};

/// Fig. 9 varies the means of eta and mu, both with sd 0.15.
struct MeanRun {
  double restitution = 0;
  StudiedProfile profile;
};
struct MeanPanel {
  double friction = 0;
  std::array<MeanRun, 3> runs;  ///< least restitution first
  const StudiedProfile& low_restitution() const { return runs.front().profile; }
  const StudiedProfile& high_restitution() const { return runs.back().profile; }
};

/// Holds shares of the variance at one mean of mu (Sec. IV).
struct VarianceRun {
  double friction = 0;
  VarianceSources shares;
};

/// Panels and runs rise with the quantity they are named after.
struct VariantStudy {
  Variant variant;
  Fig4 fig4;
  std::array<LaunchPanel, 4> fig6;
  std::array<SpreadPanel, 4> fig7;
  std::array<LossRun, 4> fig8;
  std::array<MeanPanel, 4> fig9;
  std::array<VarianceRun, 4> variance;

  // These have the paper's contact, eta, mu ~ N(0.4, 0.1^2), at 7.02 deg.
  const SpreadRun& usual_spreads() const;     ///< of fig7
  const LossRun& usual_losses() const;        ///< of fig8
  const VarianceRun& usual_variance() const;  ///< of variance
};

/// @throws std::invalid_argument for options out of range
VariantStudy study_variant(const Variant& variant, const PaperExperiments& experiments,
                           const PaperStudyOptions& options);

}  // namespace metastable::analysis
