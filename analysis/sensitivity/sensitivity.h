#pragma once
// Says how the expected steps respond to each parameter of a setting.

#include <optional>
#include <string>
#include <vector>

#include "analysis/sensitivity/parameter.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"

namespace metastable::analysis {

struct Sensitivity {
  Parameter parameter = Parameter::slope;
  std::optional<int> leg;  ///< given: the length of this leg alone (0: the first to land)
  double value = 0;        ///< of the parameter, in parameter_unit()
  double derivative = 0;   ///< d ln(expected steps from the launch) / d parameter [1 / parameter_unit()]
  double error = 0;        ///< of the derivative, numerical: 95 %
  /// Returns the relative change of the expected steps over a small relative change of the parameter.
  double elasticity() const { return derivative * value; }
};

struct Sensitivities {
  std::vector<Sensitivity> ranked;  ///< by abs(elasticity), falling
  std::string reason;               ///< why there are none, empty otherwise
};

/// Finds d ln M / d parameter for every parameter of the study's setting that matters(), by the adjoint
/// (markov::Adjoint): the chain is solved once at the study's resolution, perturbed parameters cost rows but no solves.
/// The launch stays as it is.
///
/// Method::sampled: the derivative of the sampled rows along their draws (PathwiseSlopes), extrapolated from two cell
/// sizes; error from the replicates and the extrapolation; legs one by one too when they differ.
/// Method::integrated: fourth-order differences of exact rows on nodes that move with the lowest state of a survivor;
/// error from the order and from halving the nodes. Cost: six times the rows of the study for every parameter.
/// `settled`: second-order differences of such rows whatever the method, over wider steps; slope, radius of gyration,
/// tips and legs need a table of landings to either side each, and their error holds the tables'. Cost: some seconds a
/// table.
/// There are no sensitivities, but a reason, where the expected steps are infinite or nothing is random.
/// @throws markov::ConvergenceError when a solver fails; std::invalid_argument as study(),
/// and for a study of no Setting
Sensitivities sensitivities(const Metastability& study, const StudyOptions& options);

/// Returns "friction-mean", "leg 3", ...
std::string sensitivity_name(const Sensitivity& one);

}  // namespace metastable::analysis
