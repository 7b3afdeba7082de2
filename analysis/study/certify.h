#pragma once
// Finds guaranteed bounds on a wheel's expected steps before failure, or says why there are none.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "analysis/study/setting.h"
#include "markov/passage/certificate.h"

namespace metastable::analysis {

struct CertifyOptions {
  double tolerance = 0.01;        ///< wanted (upper - lower) / lower from the launch, > 0
  std::size_t largest_cells = 0;  ///< per phase, refinement stops here; 0: 1600 for one phase, 640 for more
  int threads = 0;                ///< 0: all cores. Results do not depend on it
  /// It is called now and then with the work done so far in [0, 1] and what is being done, and may throw to stop.
  std::function<void(double, const std::string&)> progress = {};
};

/// Says that lower <= expected steps <= upper of the model with a continuous state, in exact arithmetic.
struct CertifiedSteps {
  bool exists = false;             ///< false: no bound but `reason`
  std::string reason;              ///< why there is no certificate, or no upper bound; empty if both exist
  double lower = 0;                ///< expected steps from the launch
  double upper = 0;                ///< infinity if there is no upper bound
  std::size_t cells = 0;           ///< per phase, at the last refinement
  markov::Certificate from_state;  ///< the same from any state x = omega^2, per phase

  double width() const { return (upper - lower) / lower; }
};

/// Refines until the tolerance is met or cells reach their largest number (which is not an error: see width()).
///
/// Joins markov::certify (the proof for the chain) and dynamics::LandingBounds (the proof for one collision). What both
/// rest on: the formulas of the law `published` hold as printed, IEEE doubles, and a C library whose exp, log and erfc
/// keep the accuracy stated in dynamics/bounds/interval.h. Constants computed from the setting are widened by 2^-46.
/// @throws std::invalid_argument as Setting::problem(), and for a tolerance that is not above 0
CertifiedSteps certify(const Setting& setting, const CertifyOptions& options = {});

/// Returns one line: "between 1294.1 and 1301.6 (width 0.58 %), guaranteed", or why not.
std::string certificate_text(const CertifiedSteps& certified);

}  // namespace metastable::analysis
