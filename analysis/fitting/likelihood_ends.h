#pragma once
// Finds the ends of intervals by following the likelihood.

#include <Eigen/Core>
#include <utility>

namespace metastable::analysis {

class TransitionModel;
struct Fit;

/// Returns the 90 % interval of one parameter of a fit, in its unit, which holds its value: on either side the
/// penalised likelihood falls by 1.645^2 / 2 to the end, while all other parameters move along with this one as their
/// covariance says. The two sides may differ in length, where curvature at the top makes them alike: that of a spread
/// over few trials is longer above. An end lies at a bound where the likelihood falls by less until there. It takes
/// some six likelihoods.
/// @param covariance  [n x n] of the fit's parameters, nuisances first, then the values of its terms
/// @param slot        of the parameter there, below the count of nuisances and values
std::pair<double, double> likelihood_ends(const TransitionModel& model, const Fit& fit,
                                          const Eigen::MatrixXd& covariance, Eigen::Index slot);

}  // namespace metastable::analysis
