#include "analysis/sensitivity/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "analysis/sensitivity/setting_labels.h"
#include "analysis/statistics/number_text.h"
#include "analysis/statistics/interval_95.h"
#include "analysis/study/landing_error.h"

namespace metastable::analysis {
namespace {

// Returns the probabilities of min(steps, collisions + 1) = 0, 1, ..., collisions + 1.
std::vector<double> limited_steps(const std::vector<double>& survival, int collisions) {
  std::vector<double> probability{0};
  for (std::size_t n = 0; n < static_cast<std::size_t>(collisions); ++n)
    probability.push_back(std::max(0.0, survival[n] - survival[n + 1]));
  probability.push_back(survival[static_cast<std::size_t>(collisions)]);
  return probability;
}

bool endless(const Metastability& study) {
  return study.status == Status::rest_unreachable || study.status == Status::rest_unresolved;
}

// Returns ln(expected steps) by replicate: studies without replicates have one value for all.
std::vector<double> replicate_logs(const Metastability& study, std::size_t count) {
  if (!study.steps.replicate_logs.empty()) return study.steps.replicate_logs;
  return std::vector<double>(count, std::log(study.steps.from_start.value));
}

// Says by how much trials that were followed leave the steps open, relative: they are no replicates of a chain.
double of_trials(const Metastability& study) {
  return study.steps.replicate_logs.empty() ? study.steps.sampling_error : 0;
}

void take_ratio(const Metastability& a, const Metastability& b, Contrast& result) {
  const std::size_t replicates = std::max(a.steps.replicate_logs.size(), b.steps.replicate_logs.size());
  const std::vector<double> of_a = replicate_logs(a, replicates), of_b = replicate_logs(b, replicates);
  std::vector<double> log_ratio, difference;
  for (std::size_t r = 0; r < std::min(of_a.size(), of_b.size()); ++r) {
    log_ratio.push_back(of_b[r] - of_a[r]);
    difference.push_back(std::exp(of_b[r]) - std::exp(of_a[r]));
  }
  const auto sampling = [](const std::vector<double>& sample) {
    return sample.empty() ? 0 : t_interval(sample).half_width;
  };
  const auto [at_a, at_b] = std::pair(a.steps.from_start.value, b.steps.from_start.value);
  const LandingReach open_a = landing_reach(a.steps), open_b = landing_reach(b.steps);
  const double ratio = at_b / at_a;
  const double ratio_half = std::hypot(sampling(log_ratio), of_trials(a), of_trials(b));
  const double half = std::hypot(ratio_half, a.steps.discretization_error + b.steps.discretization_error);
  result.ratio = Estimate{ratio, ratio * std::exp(-half - open_b.less - open_a.more),
                          ratio * std::exp(half + open_b.more + open_a.less)};
  const double apart = at_b - at_a;
  const double apart_half = std::hypot(std::hypot(sampling(difference), of_trials(a) * at_a, of_trials(b) * at_b),
                                       a.steps.discretization_error * at_a + b.steps.discretization_error * at_b);
  const auto less = [](double steps, double log) { return -steps * std::expm1(-log); };
  const auto more = [](double steps, double log) { return steps * std::expm1(log); };
  result.difference = Estimate{apart, apart - apart_half - less(at_b, open_b.less) - more(at_a, open_a.more),
                               apart + apart_half + more(at_b, open_b.more) + less(at_a, open_a.less)};
}

// Writes "1.916 more (1.900 to 1.932)", "4.928 fewer (...)", or "0.1 fewer (0.3 fewer to 0.1 more)".
std::string difference_text(const Estimate& difference) {
  const bool fewer = difference.value < 0;
  const Estimate along = fewer ? Estimate{-difference.value, -difference.upper, -difference.lower} : difference;
  const DecimalEstimate told = to_decimal(along, NumberFormat::significant, 4);
  const auto [word, other] = fewer ? std::pair("fewer", "more") : std::pair("more", "fewer");
  if (along.lower >= 0)
    return fmt::format("{} {} ({} to {})", plain_text(told.value), word, plain_text(told.lower),
                       plain_text(told.upper));
  const DecimalEstimate back = to_decimal({along.value, -along.lower, along.upper}, NumberFormat::significant, 4);
  return fmt::format("{} {} ({} {} to {} {})", plain_text(told.value), word, plain_text(back.lower), other,
                     plain_text(told.upper), word);
}

Contrast contrast(const Comparison& comparison, std::size_t against, std::size_t of, int collisions) {
  const Metastability &a = comparison.studies[against], &b = comparison.studies[of];
  const std::string &name_a = comparison.labels[against], &name_b = comparison.labels[of];
  Contrast result;
  result.against = against;
  result.of = of;
  if (!a.steps.survival.empty() && !b.steps.survival.empty())
    if (const auto design = trials_to_tell_apart(a.steps.survival, b.steps.survival, collisions)) {
      result.trials_needed = design->trials;
      result.power = design->power;
    }
  if (endless(a) || endless(b)) {
    result.sentence =
        endless(a) && endless(b)
            ? fmt::format("{}: {}; {}: {}; no ratio is formed", name_a, a.message, name_b, b.message)
            : fmt::format("{}: {}; no ratio is formed", endless(a) ? name_a : name_b, (endless(a) ? a : b).message);
    return result;
  }
  take_ratio(a, b, result);
  const DecimalEstimate times = to_decimal(*result.ratio, NumberFormat::significant, 4);
  result.sentence =
      fmt::format("{} takes {} times the steps of {} (95 % interval {} to {}), {}", name_b, plain_text(times.value),
                  name_a, plain_text(times.lower), plain_text(times.upper), difference_text(*result.difference));
  return result;
}

}  // namespace

std::optional<TrialDesign> trials_to_tell_apart(const std::vector<double>& survival_a,
                                                const std::vector<double>& survival_b, int collisions) {
  const auto wanted = static_cast<std::size_t>(collisions) + 1;
  if (collisions < 1 || survival_a.size() < wanted || survival_b.size() < wanted)
    throw std::invalid_argument(
        fmt::format("collisions: {} is outside 1..{}", collisions, std::min(survival_a.size(), survival_b.size()) - 1));
  return trials_for_power(limited_steps(survival_a, collisions), limited_steps(survival_b, collisions));
}

Comparison compare(const std::vector<Setting>& settings, const StudyOptions& options, int collisions) {
  if (settings.size() < 2) throw std::invalid_argument("compare: fewer than two settings");
  Comparison comparison;
  comparison.labels = setting_labels(settings);
  const auto part = [&](std::size_t index, double from, double to) {
    StudyOptions own = options;
    if (options.progress)
      own.progress = [&, index, from, to](double done, const std::string& what) {
        options.progress(from + (to - from) * done, fmt::format("{}: {}", comparison.labels[index], what));
      };
    return own;
  };
  const auto count = static_cast<double>(settings.size());
  for (std::size_t i = 0; i < settings.size(); ++i)
    comparison.studies.push_back(
        study(settings[i], part(i, 0.6 * static_cast<double>(i) / count, 0.6 * static_cast<double>(i + 1) / count)));
  // Common random numbers need common resolution.
  std::size_t cells = 0, samples = 0;
  const auto refinable = [](const Metastability& one) { return !endless(one) && one.method != Method::followed; };
  for (const Metastability& one : comparison.studies) {
    if (!refinable(one)) continue;
    cells = std::max(cells, one.cells);
    samples = std::max(samples, one.samples);
  }
  for (std::size_t i = 0; i < settings.size(); ++i) {
    Metastability& one = comparison.studies[i];
    if (!refinable(one) || (one.cells == cells && one.samples == samples)) continue;
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
