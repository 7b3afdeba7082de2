#include "analysis/study/consistency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "markov/parallel.h"

namespace metastable::analysis {
namespace {

constexpr double nearly_done = 0.999;  // share of a study
constexpr double rounding = 1e-9;      // relative, of sums over a chain without negative entries

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
  constexpr double infinite = std::numeric_limits<double>::infinity();
  require_survival(study);
  require_estimate("expected steps", study.steps.from_start, 1, infinite);
  require_estimate("expected steps from the metastable regime", study.steps.from_quasi_stationary, 1, infinite);
  require_estimate("expected steps from the worst start", study.steps.worst_start, 1, infinite);
  require_estimate("failure rates", study.spectrum.failure_rate, 0, 1);
  for (const Agreement& a : study.agreements)
    require(std::abs(a.one - a.other) <= a.tolerance * std::abs(a.one),
            fmt::format("{}: {} by one way, {} by another", a.what, a.one, a.other));
}

void require_followed(const Problem& problem, const Metastability& study, const StudyOptions& options) {
  constexpr double much = 0.1;
  constexpr std::size_t launches = 4000;
  const Estimate& memory = study.steps.memory;
  const double moved = std::max({study.steps.landing_error, std::abs(memory.lower), std::abs(memory.upper)});
  if (!problem.follow || !(moved > much)) return;
  const std::size_t most = study.steps.survival.size();
  std::vector<double> steps(launches);
  markov::Share told;
  if (options.progress) told = [&](double) { options.progress(nearly_done, "trials followed beside the chain"); };
  markov::parallel_for(
      launches, options.threads,
      [&](std::size_t i) { steps[i] = static_cast<double>(problem.follow(options.seed, i, most)); }, told);
  double sum = 0, square = 0, expected = 0;
  for (const double n : steps) {
    sum += n;
    square += n * n;
  }
  for (const double s : study.steps.survival) expected += s;
  const double mean = sum / launches, error = std::sqrt(std::max(0.0, square / launches - mean * mean) / launches);
  const Estimate& all = study.steps.from_start;
  const double lower = expected * all.lower / all.value, upper = expected * all.upper / all.value;
  if (mean + 4 * error >= lower && mean - 4 * error <= upper) return;
  throw StatesTooCoarse(fmt::format(
      "of the first {} steps the chain of landings expects {:.4g} ({:.4g} to {:.4g}), and {} trials followed "
      "without it take {:.4g} (standard error {:.2g}): a state at touch-down leaves out too much here, such "
      "as feet that still hop or slide; simulate follows trials",
      most, expected, lower, upper, launches, mean, error));
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
