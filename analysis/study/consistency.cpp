#include "analysis/study/consistency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace metastable::analysis {
namespace {

constexpr double rounding = 1e-9;  // relative, of sums over a chain without negative entries

void require(bool holds, const std::string& what) {
  if (!holds) throw Contradiction(what);
}

void require_survival(const Metastability& study) {
  // Interpolated rows have entries of both signs: a probability is a sum that holds to the error of the rows, which the
  // study tells from the change of the expected steps under refinement. Below that error a rise is no contradiction.
  const double slack =
      study.method == Method::integrated ? std::max(rounding, study.steps.discretization_error) : rounding;
  double sum = 0;
  for (std::size_t n = 0; n < study.steps.survival.size(); ++n) {
    const double here = study.steps.survival[n], before = n == 0 ? 1 : study.steps.survival[n - 1];
    require(here >= 0 && here <= before * (1 + slack) && (n > 0 || here == 1),
            fmt::format("survival of {} steps is {} after {} of the step before", n, here, before));
    sum += here;
  }
  require(sum <= study.steps.distribution.mean * (1 + slack),
          fmt::format("survival of the first {} steps sums to {}, the expected steps are {}",
                      study.steps.survival.size(), sum, study.steps.distribution.mean));
}

void require_estimate(const std::string& name, const Estimate& estimate, double least, double most) {
  require(
      estimate.lower <= estimate.value && estimate.value <= estimate.upper &&
          estimate.value >= least * (1 - rounding) && estimate.value <= most * (1 + rounding),
      fmt::format("{} are {} with an interval from {} to {}", name, estimate.value, estimate.lower, estimate.upper));
}

}  // namespace

void require_consistent(const Metastability& study) {
  if (study.status == Status::rest_unresolved) return;
  require_survival(study);
  require_estimate("expected steps", study.steps.from_start, 1, infinite);
  require_estimate("expected steps from the metastable regime", study.steps.from_quasi_stationary, 1, infinite);
  require_estimate("expected steps from the worst start", study.steps.worst_start, 1, infinite);
  require_estimate("failure rates", study.spectrum.failure_rate, 0, 1);
  for (const Agreement& a : study.agreements)
    require(std::abs(a.one - a.other) <= a.tolerance * std::abs(a.one),
            fmt::format("{}: {} by one way, {} by another", a.what, a.one, a.other));
}

void require_overlap(const std::string& what, const std::string& name_a, const Estimate& a, const std::string& name_b,
                     const Estimate& b) {
  require(a.lower <= b.upper && b.lower <= a.upper, fmt::format("{}: {} from {} to {}, {} from {} to {}", what, name_a,
                                                                a.lower, a.upper, name_b, b.lower, b.upper));
}

void require_consistent(const Metastability& study, const CertifiedSteps& certified) {
  if (!certified.exists || study.status == Status::rest_unresolved) return;
  require_overlap("expected steps", std::string(method_name(study.method)), study.steps.from_start, "certificate",
                  {certified.lower, certified.lower, certified.upper});
}

}  // namespace metastable::analysis
