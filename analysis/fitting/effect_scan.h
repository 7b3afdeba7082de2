#pragma once
// Says which effects a fit would gain from: score tests of every effect and variant at one fit.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "analysis/fitting/model_fit.h"
#include "analysis/fitting/rules.h"

namespace metastable::analysis {

/// The gain, 2 Delta log likelihood of one fit over another, in stances and in everything else.
struct PhaseGain {
  double collisions = 0, stances = 0;
  double& of(const Event& event) { return event.kind == EventKind::stance ? stances : collisions; }
};

/// Holds what the scores at a fit say of one candidate.
struct ScannedEffect {
  const Candidate* candidate = nullptr;
  std::vector<double> gain;            ///< by variant: 2 Delta log likelihood that the scores promise
  std::vector<Eigen::VectorXd> start;  ///< by variant: the values they point to
  std::vector<Eigen::Index> first;     ///< by variant: first of its columns
  std::size_t best = 0;                ///< variant
  PhaseGain by_phase = {};             ///< the best variant's gain, divided between stances and collisions
  Derivatives columns = {};            ///< those of the best variant, at neutral values
};

/// Holds the efficient scores (nuisances projected out) of all candidates at a fit.
struct EffectScan {
  std::vector<ScannedEffect> effects;
  Eigen::VectorXd scores;    ///< [columns] sums of the slopes
  Eigen::MatrixXd by_trial;  ///< [trials x columns] efficient scores, summed over a trial's events
  /// [fitted parameters x columns] how far each score moves if the stated value of a fitted parameter is off by one sd
  /// of its prior; it has no rows where nuisances were not refitted.
  Eigen::MatrixXd by_prior;
  Eigen::MatrixXd information;  ///< [columns x columns] efficient
  Eigen::VectorXd whole;        ///< [columns] its diagonal before the projection
  bool trials_suffice = true;   ///< to draw chance from them, by Rules::enough_trials and enough_transitions
  bool steps_suffice = true;    ///< to seek what has no name: trials do, or steps by Rules::enough_long_steps
  /// Returns what it says of a candidate, null if that was not scanned.
  const ScannedEffect* find(const Candidate* candidate) const;
};

/// Says beside which effect of an earlier scan, without terms, candidates are scanned.
struct ScanBeside {
  const EffectScan* earlier = nullptr;
  const Candidate* effect = nullptr;
};

/// @param fit  of nuisances, and possibly terms, whose derivatives are projected out
/// @param candidates  those to scan; candidates without parameters are skipped
/// @param beside  where given, of each effect's variants no more are scanned than a scan is worth: those of which the
///   earlier one promises most, to first order; the others gain 0. Differences start from steps that the earlier one
///   resolves
EffectScan scan_effects(const TransitionModel& model, const Fit& fit, const std::vector<const Candidate*>& candidates,
                        int threads, const ScanBeside& beside = {});

/// Knows how large the scan's gains get by chance alone, and what that says of gains found. Chance is drawn by
/// multipliers of whole trials' scores (multiplier bootstrap) and of `by_prior`. Few trials, or trials of few
/// transitions, have too few scores for that: chance has the covariance of the information then.
class ChanceGains {
 public:
  /// @param draws  >= 1 @throws std::invalid_argument for fewer
  ChanceGains(const EffectScan& scan, int draws, std::uint64_t seed);
  /// Returns P(the effect's largest gain over its variants >= gain) by chance.
  /// @param effect  one of those scanned @throws std::invalid_argument for another
  double p_value(const Candidate* effect, double gain) const;
  /// Returns P(some effect's p-value is <= p) by chance.
  double look_elsewhere(double p) const;

 private:
  struct ByChance {
    const Candidate* effect;
    double degrees;              // its parameters
    bool held;                   // by priors
    std::vector<double> sorted;  // gains, descending
    double p_value(double gain) const;
    double drawn_p_value(double gain) const;
  };
  std::vector<ByChance> effects_;
  std::vector<double> least_;  // smallest p-value of each draw, ascending
};

}  // namespace metastable::analysis
