#pragma once
// Do two samples come from one distribution, and how far are they apart.
//
// All p-values are two-sided and hold for independent values: speeds of one trial are not independent of each other.

#include <span>

namespace metastable::analysis {

/// Holds a number with its 95 % interval.
struct EffectSize {
  double value = 0;
  double lower = 0;
  double upper = 0;
};

struct TTest {
  EffectSize difference;  ///< mean(a) - mean(b), in the unit of the values
  double t = 0;
  double degrees_of_freedom = 0;
  double p = 1;
};
/// Applies Student's t-test without (Welch 1947) and with the assumption of equal variances. For two constant samples t
/// and the difference are 0 and p = 1, or t is infinite and p = 0.
/// @param a, b  2 or more values each (std::invalid_argument otherwise; likewise below)
TTest welch_t_test(std::span<const double> a, std::span<const double> b);
TTest pooled_t_test(std::span<const double> a, std::span<const double> b);

/// Returns Hedges' g, the difference of the means over the pooled sd, with the factor 1 - 3/(4 df - 1) against its bias
/// (Hedges 1981); interval from the noncentral t distribution. Not finite where both samples are constant.
EffectSize hedges_g(std::span<const double> a, std::span<const double> b);

/// Returns the probability that a value of `a` exceeds one of `b`, ties counted half (0.5: neither is larger). Interval
/// from the variance of DeLong, DeLong and Clarke-Pearson (1988) on the logit scale; where one sample lies wholly above
/// the other, from the exact binomial bound of the smaller sample. O(n m).
EffectSize superiority(std::span<const double> a, std::span<const double> b);

struct DistributionTest {
  double statistic = 0;
  double p = 1;
};
/// Tests by Kolmogorov-Smirnov's D, the largest distance of the two distribution functions. p exact by counting paths
/// (with ties: an upper bound) up to n m = 4e6, beyond that Kolmogorov's limit. O(n m) or O(n + m).
DistributionTest kolmogorov_smirnov_test(std::span<const double> a, std::span<const double> b);
/// Returns D with the simultaneous 95 % band of Massart (1990) for both samples: valid for any distribution, and wide.
EffectSize kolmogorov_smirnov_distance(std::span<const double> a, std::span<const double> b);

/// Tests two samples by Anderson-Darling's A^2, Scholz and Stephens (1987), (6). p from the limit law of
/// the one-sample statistic (Pettitt 1976) after matching mean and variance; limit law by Marsaglia and Marsaglia
/// (2004), its far tail by sqrt(3) erfc(sqrt(z)) (Zolotarev 1961). O(N log N). 4 or more values in all.
DistributionTest anderson_darling_test(std::span<const double> a, std::span<const double> b);
/// Returns P(A^2 > z) in that limit, to an absolute error below 2e-5.
double anderson_darling_tail(double z);

}  // namespace metastable::analysis
