#pragma once
// Fits restitution and friction to measured trials by maximum likelihood.

#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "analysis/description/contact_likelihood.h"
#include "analysis/experiment/experiment.h"

namespace metastable::analysis {

/// Says which event is likely or not.
enum class Transition {
  collision,  ///< omega_minus to omega_plus of one collision
  step,       ///< omega_minus to the omega_minus of the next
};

constexpr std::array<const char*, 4> contact_parameter_names = {"eta mean", "eta sd", "mu mean", "mu sd"};

struct ContactFitOptions {
  dynamics::Law law = dynamics::Law::published;
  Transition transition = Transition::step;
  int threads = 0;        ///< the same result on any number
  bool intervals = true;  ///< lower_95 and upper_95 too: most of the time
  /// It is called now and then and may throw to stop.
  std::function<void()> progress = {};
};

/// Describes a direction of unit length in the space of the four parameters.
struct FitDirection {
  ContactParameters weight{};
  double sd = 0;  ///< standard error along it; infinite if the likelihood does not curve there
};

struct ContactFit {
  enum class Status {
    converged,
    undetermined,  ///< the likelihood does not fall off in every direction: see directions
    impossible,    ///< more than half of the transitions cannot come from this law at all; nothing is fitted
    no_parameters  ///< `plastic`
  };
  Status status = Status::converged;
  std::string message;          ///< one sentence where there is something to say
  std::size_t transitions = 0;  ///< that the likelihood uses, rests included
  std::size_t rests = 0;        ///< of these, rests after the last collision
  std::size_t impossible = 0;   ///< left out: no eta in [0, 1] and mu >= 0 lead there under this law
  double log_likelihood = 0;    ///< of omega^2 [1/(rad^2/s^2)]
  ContactParameters value{};
  ContactParameters standard_error{};  ///< from the observed information; infinite where undetermined or at a bound
  /// These hold 95 % by the profile of the likelihood: not symmetric, the other three free. Infinite ends, and 0 of an
  /// sd, where the likelihood does not fall off far enough or has no maximum; infinite without `intervals`.
  ContactParameters lower_95{}, upper_95{};
  std::array<std::array<double, 4>, 4> correlation{};
  std::vector<FitDirection> directions;  ///< eigenvectors of the observed information, best determined first
};

/// Tells what the fit cannot tell apart, in plain sentences, from its correlations and directions.
std::vector<std::string> ambiguities(const ContactFit& fit);

/// Says whether the law has contact parameters that a fit can find: not `plastic`, which has none, and not `settled`,
/// whose landing has no density in closed form.
bool has_contact_fit(dynamics::Law law);

/// Fits all trials of the named conditions together, under the wheel of the experiment.
///
/// It multiplies the likelihood of every landing and, after a trial's last collision, of rest or of survival
/// (contact_likelihood.h). Quasi-Newton descents from a grid of starts on every few-th transition, then on all from
/// the places they end at; standard errors from second differences, intervals from the profile over all maxima found
/// (profile_interval.h). How many hold the truth, under published, of (eta mean, eta sd, mu mean, mu sd):
///   like the stand-in, trials that last:       9 trials, of 50: 48, 49, 49, 50;  50 trials, of 40: 39, 40, 39, 39
///   N(0.4, 0.1^2) both at 9.59 deg, soon rest: 9 trials, of 50: 44, 45, 50, 44;  50 trials, of 40: 39, 36, 39, 40
/// (96 % of all; 9 trials of the second are 53 transitions: the chi^2 behind the intervals makes them too narrow); of
/// 16 with 10 trials under coulomb 14 or more. Speeds are taken as exact: sensor noise goes into the spreads. Where
/// legs are not known the wheel is taken with equal legs of its mean length.
/// @throws std::invalid_argument for a coast-down, conditions out of range, no transition to fit, or
///         Transition::collision without omega_plus
/// Cost: about 5 ms a transition, 2 ms without intervals
ContactFit fit_contact(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                       const ContactFitOptions& options);

/// Returns `collision` where every collision has an omega_plus that carries the wheel over its foot whenever it went
/// on; else `step`: such an omega_plus is not the speed with which the stance begins.
Transition best_transition(const Experiment& experiment);

/// Returns ln of that likelihood at given parameters from the exact density of the landing
/// (dynamics/return_map/landing_density.h); -infinity where a transition has none. Cost: about 50 us a transition, 1 ms
/// a last one
double contact_log_likelihood(const Experiment& experiment, const std::vector<std::size_t>& conditions,
                              const ContactFitOptions& options, const ContactParameters& parameters);

}  // namespace metastable::analysis
