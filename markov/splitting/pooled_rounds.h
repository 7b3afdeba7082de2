#pragma once
// Pools what independent rounds of splitting say, and takes 95 % intervals from the jackknife over the rounds.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "markov/mesh/mesh_study.h"

namespace metastable::markov {

/// Holds the shares of one round's weight that fail in a step.
struct RoundShares {
  std::vector<double> early;  ///< in each step of the burn-in, which is a number of whole revolutions
  std::vector<double> late;   ///< at each phase after it, in the mean; empty: all walks have failed by then
};

/// Upper over lower end of the widest interval of a chance that is given: one known less well is left untold.
inline constexpr double widest_interval = 4;

/// Survival from the start: that of the burn-in, step by step, and beyond it by the shares of each phase.
class PooledRounds {
 public:
  PooledRounds() = default;
  /// @param rounds  two or more, with burn-ins of the same length
  explicit PooledRounds(std::vector<RoundShares> rounds);

  /// Expected steps before failure, with the interval of their logarithm.
  MeshEstimate steps() const;
  /// Failures a step beyond the burn-in, likewise; NaN where all walks have failed by then.
  MeshEstimate failure_rate() const;
  /// The share that walks on after so many steps, with the interval of its log odds (odds_interval).
  /// @param widened  factor by which that interval of the log odds is made wider, >= 1
  MeshEstimate survival_after(std::uint64_t steps, double widened = 1) const;
  std::size_t burn_in() const { return alive_.empty() ? 0 : alive_.front().size() - 1; }

 private:
  struct Pooled {
    double steps = 0, rate = 0;
  };
  Pooled pooled(std::size_t left_out) const;
  double share_after(std::uint64_t steps, std::size_t left_out) const;
  double mean_alive(std::size_t step, std::size_t left_out) const;
  std::vector<double> mean_late(std::size_t left_out) const;

  std::vector<RoundShares> rounds_;
  std::vector<std::vector<double>> alive_;  ///< round by round: the share that walks on after 0, 1, ... steps
};

/// Takes Student's interval of the logarithm of a value from the jackknife's values, one a round left out.
MeshEstimate log_interval(double value, std::span<const double> without);

/// Does the same for a share, in (0, 1), by its log odds, `widened` times as wide. Student's quantile counts as many
/// rounds as would carry the smaller of the share and its rest evenly: where failures are seldom seen, few rounds carry
/// most of it. The ends are NaN where the share, or one of the jackknife's, is 0 or 1, and where the smaller of the two
/// is not known to a factor of widest_interval.
MeshEstimate odds_interval(double share, std::span<const double> without, double widened = 1);

/// Holds the ratio of two sums over rounds, and what it is without each of them.
struct RatioOfSums {
  double value = 0;
  std::vector<double> without;
};
RatioOfSums ratio_of_sums(std::span<const double> over, std::span<const double> under);
/// Returns the jackknife's standard error.
double standard_error(const RatioOfSums& ratio);

}  // namespace metastable::markov
