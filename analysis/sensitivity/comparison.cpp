#include "analysis/sensitivity/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <stdexcept>

#include "analysis/statistics/number_text.h"
#include "analysis/statistics/t_interval.h"

namespace metastable::analysis {
namespace {

struct MeanVariance {
  double mean = 0, variance = 0;
};

// These are the moments of min(steps, collisions + 1): the mean is the sum of P(steps > n) over n = 0 .. collisions.
MeanVariance limited_steps(const std::vector<double>& survival, int collisions) {
  double first = 0, second = 0;
  for (int n = 0; n <= collisions; ++n) {
    first += survival[static_cast<std::size_t>(n)];
    second += (2.0 * n + 1.0) * survival[static_cast<std::size_t>(n)];
  }
  return {first, std::max(0.0, second - first * first)};
}

bool endless(const Metastability& study) {
  return study.status == Status::rest_unreachable || study.status == Status::rest_unresolved;
}

Contrast contrast(const Comparison& comparison, std::size_t against, std::size_t of, int collisions) {
  const Metastability &a = comparison.studies[against], &b = comparison.studies[of];
  const std::string name_a = fmt::format("{} deg", a.setting->slope_deg);
  const std::string name_b = fmt::format("{} deg", b.setting->slope_deg);
  Contrast result;
  result.against = against;
  result.of = of;
  if (!a.steps.survival.empty() && !b.steps.survival.empty())
    result.trials_needed = trials_to_tell_apart(a.steps.survival, b.steps.survival, collisions);
  if (endless(a) || endless(b)) {
    result.sentence =
        endless(a) && endless(b)
            ? fmt::format("{}: {}; {}: {}; no ratio is formed", name_a, a.message, name_b, b.message)
            : fmt::format("{}: {}; no ratio is formed", endless(a) ? name_a : name_b, (endless(a) ? a : b).message);
    return result;
  }
  std::vector<double> log_ratio, difference;
  for (std::size_t r = 0; r < a.steps.replicate_logs.size(); ++r) {
    log_ratio.push_back(b.steps.replicate_logs[r] - a.steps.replicate_logs[r]);
    difference.push_back(std::exp(b.steps.replicate_logs[r]) - std::exp(a.steps.replicate_logs[r]));
  }
  const double ratio = b.steps.from_start.value / a.steps.from_start.value;
  // Integrated studies have no replicates, and no sampling error.
  const auto sampling = [](const std::vector<double>& sample) {
    return sample.empty() ? 0 : t_interval(sample).half_width;
  };
  const double ratio_half =
      std::hypot(sampling(log_ratio), a.steps.discretization_error + b.steps.discretization_error);
  result.ratio = Estimate{ratio, ratio * std::exp(-ratio_half), ratio * std::exp(ratio_half)};
  const double apart = b.steps.from_start.value - a.steps.from_start.value;
  const double apart_half =
      std::hypot(sampling(difference), a.steps.discretization_error * a.steps.from_start.value +
                                           b.steps.discretization_error * b.steps.from_start.value);
  result.difference = Estimate{apart, apart - apart_half, apart + apart_half};
  const DecimalEstimate times = to_decimal(*result.ratio, NumberFormat::significant, 4),
                        more = to_decimal(*result.difference, NumberFormat::significant, 4);
  result.sentence =
      fmt::format("{} takes {} times the steps of {} (95 % interval {} to {}), {} more ({} to {})", name_b,
                  plain_text(times.value), name_a, plain_text(times.lower), plain_text(times.upper),
                  plain_text(more.value), plain_text(more.lower), plain_text(more.upper));
  return result;
}

}  // namespace

std::optional<double> trials_to_tell_apart(const std::vector<double>& survival_a, const std::vector<double>& survival_b,
                                           int collisions) {
  const auto wanted = static_cast<std::size_t>(collisions) + 1;
  if (collisions < 1 || survival_a.size() < wanted || survival_b.size() < wanted)
    throw std::invalid_argument(
        fmt::format("collisions: {} is outside 1..{}", collisions, std::min(survival_a.size(), survival_b.size()) - 1));
  const MeanVariance a = limited_steps(survival_a, collisions), b = limited_steps(survival_b, collisions);
  const double apart = a.mean - b.mean;
  if (std::abs(apart) < 1e-12 * std::max(a.mean, b.mean)) return std::nullopt;
  const boost::math::normal z;
  const double reach = boost::math::quantile(z, 0.975) + boost::math::quantile(z, 0.8);
  return std::max(2.0, std::ceil(reach * reach * (a.variance + b.variance) / (apart * apart)));
}

Comparison compare(const std::vector<Setting>& settings, const StudyOptions& options, int collisions) {
  if (settings.size() < 2) throw std::invalid_argument("compare: fewer than two settings");
  Comparison comparison;
  const auto part = [&](std::size_t index, double from, double to) {
    StudyOptions own = options;
    if (options.progress)
      own.progress = [&options, &settings, index, from, to](double done, const std::string& what) {
        options.progress(from + (to - from) * done, fmt::format("{} deg: {}", settings[index].slope_deg, what));
      };
    return own;
  };
  const auto count = static_cast<double>(settings.size());
  for (std::size_t i = 0; i < settings.size(); ++i)
    comparison.studies.push_back(
        study(settings[i], part(i, 0.6 * static_cast<double>(i) / count, 0.6 * static_cast<double>(i + 1) / count)));
  // Common random numbers need common resolution.
  std::size_t cells = 0, samples = 0;
  for (const Metastability& one : comparison.studies) {
    if (endless(one)) continue;
    cells = std::max(cells, one.cells);
    samples = std::max(samples, one.samples);
  }
  for (std::size_t i = 0; i < settings.size(); ++i) {
    Metastability& one = comparison.studies[i];
    if (endless(one) || (one.cells == cells && one.samples == samples)) continue;
    StudyOptions own =
        part(i, 0.6 + 0.4 * static_cast<double>(i) / count, 0.6 + 0.4 * static_cast<double>(i + 1) / count);
    own.cells = cells;
    own.samples = samples;
    const Status status = one.status;
    const std::string message = one.message;
    one = study(settings[i], own);
    one.status = status;
    one.message = message;
  }
  for (std::size_t i = 1; i < settings.size(); ++i)
    comparison.contrasts.push_back(contrast(comparison, 0, i, collisions));
  return comparison;
}

}  // namespace metastable::analysis
