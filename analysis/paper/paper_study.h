#pragma once
// The simulated results of the paper, figure by figure, under one contact law and one reading of its rest rule.

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
  std::string name;  ///< "published, goes on", "published, rests", "coulomb"
};
/// `coulomb` once: at these slopes nothing rests under it.
std::vector<Variant> paper_variants();

/// One simulated velocity profile.
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

/// The three experiments: measured, or their stand-in.
struct PaperExperiments {
  bool stand_in = true;
  std::string title;
  TrialSpeeds fast_959, slow_959, fast_702;
  std::optional<double> rest_share_702;
};
/// Conditions of `experiment` by slope: one near 7.02 deg, two near 9.59 deg (the faster launch is the fast one).
/// @throws std::invalid_argument naming what is missing
PaperExperiments paper_experiments(const Experiment& experiment);
/// @param seed of the simulation (stand_in.h)
PaperExperiments simulated_experiments(std::uint64_t seed, int threads);

struct PaperStudyOptions {
  int trials = 1000;           ///< of each simulated profile, >= 20
  std::size_t samples = 8192;  ///< of the variance shares, >= 32
  std::uint64_t seed = 1;
  int threads = 0;
  std::function<void()> progress = {};  ///< after each of paper_study_units() pieces of work; may throw to stop
};
/// Calls of `progress` by one study_variant().
std::size_t paper_study_units();

constexpr std::array<double, 4> fig6_friction = {0.40, 0.45, 0.50, 0.55};
constexpr std::array<double, 3> fig6_launch = {3.35, 5.35, 7.35};
constexpr std::array<double, 3> fig7_restitution_sd = {0.05, 0.10, 0.15};
constexpr std::array<double, 4> fig7_friction_sd = {0.05, 0.10, 0.15, 0.20};
constexpr std::array<double, 4> fig9_friction = {0.2, 0.3, 0.4, 0.5};
constexpr std::array<double, 3> fig9_restitution = {0.3, 0.5, 0.7};
constexpr std::array<double, 4> variance_friction = {0.3, 0.4, 0.5, 0.55};

struct VariantStudy {
  Variant variant;
  std::array<StudiedProfile, 2> fig4;  ///< fast, slow
  ConditionComparison fig4_comparison;
  std::array<std::array<StudiedProfile, 3>, 4> fig6;        ///< [friction][launch]
  std::array<std::array<double, 3>, 4> fig6_p{};            ///< launches 1-2, 1-3, 2-3: pooled t, all collisions
  std::array<std::array<double, 3>, 4> fig6_p_trials{};     ///< the same, Welch, one value a trial
  std::array<std::array<StudiedProfile, 3>, 4> equal_legs;  ///< fig6 with all legs at their mean
  std::array<std::array<double, 3>, 4> legs_p{};            ///< fig6 against equal_legs, pooled t
  std::array<std::array<double, 3>, 4> legs_p_trials{};
  std::array<std::array<StudiedProfile, 3>, 4> fig7;             ///< [friction sd][restitution sd]
  std::array<std::array<std::optional<TTest>, 3>, 4> fig7_test;  ///< against the experiment at 7.02 deg
  std::array<EnergyLosses, 4> fig8;
  std::array<std::array<StudiedProfile, 3>, 4> fig9;  ///< [friction][restitution]
  std::array<VarianceSources, 4> variance;            ///< over variance_friction
};

/// P is NaN-free: 1 where a sample has fewer than two values (all trials rested).
VariantStudy study_variant(const Variant& variant, const PaperExperiments& experiments,
                           const PaperStudyOptions& options);

}  // namespace metastable::analysis
