#pragma once
// Fits nuisances and effects of a transition model by penalised maximum likelihood.

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "analysis/fitting/transition_model.h"

namespace metastable::analysis {

/// Holds the change of every event's log density and score with each parameter, by differences.
struct Derivatives {
  Eigen::MatrixXd slope;           ///< [events x parameters] of the log density
  Eigen::MatrixXd change;          ///< [events x parameters] of the normal score
  std::vector<double> steps = {};  ///< by parameter: they are those half of it away; 0: differences to both sides
};

/// Holds what a fit has found of a hypothesis.
struct Fit {
  std::vector<double> nuisance;
  std::vector<EffectTerm> terms;
  double log_likelihood = 0;    ///< of the events counted, without the prior
  double penalised = 0;         ///< with the priors of nuisances and effects
  Evaluation evaluation;        ///< of all events, counted or not
  Derivatives derivatives;      ///< at the optimum: nuisances first, then the terms' free parameters in order
  Eigen::VectorXd gradient;     ///< there, of the penalised likelihood: what no step brought to 0
  Eigen::MatrixXd information;  ///< of the counted events, with the prior
  bool converged = true;
  double promised = 0;  ///< rise that the last step could have brought, to first order
  std::string reason;   ///< why it did not converge
};

/// The share of a direction's information, before fitted parameters were projected out of it, that must be left for
/// the data to resolve the direction beside them. Derivatives are differences over 0.05 of what the data resolve, along
/// which a score's slope changes by some 2 % of itself per unit: they err by 0.001 of their size, so that of a
/// direction which the fitted parameters take up altogether a share of about 0.001^2 seems to be left. Measured on
/// wheels: 3e-6 of eight leg lengths beside an eccentric hub, 2e-3 and more of the parameters of one fit; 1e-16 of what
/// is singular.
inline constexpr double resolved_share = 1e-6;

/// The information in units of a parameter's range that the data must hold for the parameter to be told from nothing:
/// with less its whole range moves the log likelihood by less than a millionth, and slopes are rounding.
inline constexpr double resolved_range = 1e-6;

/// Returns the root R [n x r] of the pseudo-inverse R R^T of the information of fitted parameters, over the directions
/// that the data and the priors resolve. @param information  [n x n], n >= 1
Eigen::MatrixXd resolved_root(const Eigen::MatrixXd& information);

struct FitOptions {
  std::vector<char> count;  ///< by trial: 0 leaves its events out; empty: all
  bool refit_nuisances = true;
  bool refit_effects = true;  ///< false: the effects keep the values that they are given
  int most_iterations = 25;
  /// A caller who knows the evaluation at the start, or the derivatives for the first step, spares the fit from finding
  /// them.
  const Evaluation* evaluation = nullptr;
  const Derivatives* derivatives = nullptr;
  /// If true, the entries of the last term's variant that may be refined are fitted, too, each within its spacing;
  /// their derivatives come last.
  bool last_variant_too = false;
  /// If true, a step that rises about as it foretold is the last. The fit's derivatives are those before it, then.
  bool ends_as_foretold = false;
  /// A penalised likelihood that is known from elsewhere. A fit that cannot come to it any more is given up, and has
  /// not converged.
  double to_beat = -std::numeric_limits<double>::infinity();
};

/// Finds the maximum of the penalised likelihood by Gauss-Newton steps on the scores: with z the normal score and J =
/// dz/d(speed), log density = log phi(z) + log J, and the information is the sum of z' z'^T + (log J)' (log J)'^T,
/// which no outlying observation inflates; damped where they gain far less than promised. Slopes are differences to one
/// side, from where no step rises on to both, and where none rises by these over wider steps, which see past the kinks
/// of single events' densities. Starts from the given values; parameters stay inside their bounds. A
/// likelihood that is not finite there has not converged, with that reason.
Fit fit(const TransitionModel& model, const std::vector<double>& nuisance, const std::vector<EffectTerm>& terms,
        const FitOptions& options = {});

/// Returns the nuisances of the model as given: nominal values, and beside them the best values together of those that
/// were only assumed.
std::vector<double> given_values(const TransitionModel& model);

/// Returns the better of the fits from the given values and from the model's own starts (TransitionModel::starts).
/// @param options  an evaluation and derivatives are those of the given values
Fit best_fit(const TransitionModel& model, const std::vector<double>& nuisance, const std::vector<EffectTerm>& terms,
             const FitOptions& options = {});

/// Takes the derivatives at a point with respect to the free parameters of `terms` only.
Derivatives derivatives(const TransitionModel& model, const std::vector<double>& nuisance,
                        const std::vector<EffectTerm>& terms, const Evaluation& here, bool with_nuisances);

/// Takes the first steps of a fit of terms that differ little from those of another fit, by that one's derivatives:
/// those of the scores, and those of what log densities are more than the scores'. It has not converged, but its
/// likelihood says what a fit would come to.
Fit stepped(const TransitionModel& model, const Fit& near, const std::vector<EffectTerm>& terms);

/// Fills a column with the slopes and changes of events between two evaluations. @param step  of the parameter between
/// them
void fill_differences(const Evaluation& here, const Evaluation& there, double step, Eigen::Index column,
                      Derivatives& all);

/// Returns the information of columns: sum over counted events of change change^T + (slope + z change)(...)^T.
/// @param weights  by event, 1 or 0
Eigen::MatrixXd information(const Derivatives& columns, const Evaluation& here, const Eigen::VectorXd& weights);

/// Returns by how much the prior's slope at each fitted parameter of a fit, nuisances first, scatters with what is
/// stated (sd): the root of the prior's information; 0 without a prior.
Eigen::VectorXd prior_scatter(const TransitionModel& model, const Fit& fit);

/// Returns 1 or 0 an event. @param count  by trial; empty: all ones
Eigen::VectorXd event_weights(const TransitionModel& model, const std::vector<char>& count);

}  // namespace metastable::analysis
