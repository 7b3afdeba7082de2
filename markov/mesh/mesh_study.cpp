#include "markov/mesh/mesh_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>

#include "markov/mesh/batch_simulation.h"
#include "markov/mesh/guided_sampling.h"
#include "markov/mesh/mesh_passage.h"
#include "markov/mesh/noise_frame.h"
#include "markov/parallel.h"

namespace metastable::markov {
namespace {

constexpr double kNormal95 = 1.959963984540054;
constexpr double kDisagrees = 1.7;    // joint half-widths: 99.9 % of the normal
constexpr double kSampledFrom = 100;  // expected steps above which guided samples settle before they fail
constexpr std::size_t kFewestTrials = 100;

/// Coarsest spacings that the extrapolation was found to bear, by dimension.
double coarsest(int dimension) {
  constexpr std::array<double, 4> spacing{0.4, 0.5, 0.7, 1.4};
  return spacing[static_cast<std::size_t>(dimension - 1)];
}

/// The value at 0 of the polynomial in h^2 through the logs of sizes first .. last - 1, h^2 halving from each to the
/// next.
double at_zero(const std::vector<double>& by_size, std::size_t first, std::size_t last) {
  std::vector<double> row(by_size.begin() + static_cast<std::ptrdiff_t>(first),
                          by_size.begin() + static_cast<std::ptrdiff_t>(last));
  for (double factor = 2; row.size() > 1; factor *= 2) {
    for (std::size_t i = 0; i + 1 < row.size(); ++i) row[i] = (factor * row[i + 1] - row[i]) / (factor - 1);
    row.pop_back();
  }
  return row.front();
}

/// Spacing of the scores: few nodes have few offsets over which its error could average.
double score_spacing(const BatchMap& map) {
  constexpr std::array<double, 4> spacing{0.3, 0.4, 0.6, 0.6};
  return map.scores == 1 ? spacing[static_cast<std::size_t>(map.dimension - 1)] : 0.6;
}

struct Extrapolated {
  double log_value = 0, shift_error = 0, discretization_error = 0;
};

/// `logs[shift][size]`.
Extrapolated extrapolate(const std::vector<std::vector<double>>& logs) {
  const auto n = static_cast<double>(logs.size());
  const std::size_t sizes = logs.front().size();
  std::vector<double> values, mean(sizes, 0.0);
  Extrapolated e;
  for (const auto& by_size : logs) {
    values.push_back(at_zero(by_size, 0, sizes));
    e.log_value += values.back() / n;
    for (std::size_t i = 0; i < sizes; ++i) mean[i] += by_size[i] / n;
  }
  double spread = 0;
  for (const double value : values) spread += (value - e.log_value) * (value - e.log_value);
  const double quantile = boost::math::quantile(boost::math::students_t(n - 1), 0.975);
  e.shift_error = quantile * std::sqrt(spread / (n - 1) / n);
  e.discretization_error = std::abs(e.log_value - at_zero(mean, 1, sizes));
  // Where a fourth size was asked for, the square is far off: half of what the extrapolation by three last moved.
  if (sizes > 3)
    e.discretization_error = std::max(
        e.discretization_error, 0.5 * std::abs(at_zero(mean, sizes - 3, sizes) - at_zero(mean, sizes - 4, sizes - 1)));
  return e;
}

double half_width(const MeshEstimate& e) { return 0.5 * std::log(e.upper / e.lower); }

MeshEstimate around(double value, double relative) {
  return {value, value * std::exp(-relative), value * std::exp(relative)};
}

/// Names two ways that disagree, or returns nothing.
std::string disagreement(const char* one, const MeshEstimate& a, const char* other, const MeshEstimate& b) {
  const double apart = std::abs(std::log(a.value / b.value));
  if (!(a.lower > 0 && b.lower > 0) || apart <= kDisagrees * std::hypot(half_width(a), half_width(b))) return {};
  return fmt::format(
      "{} ({:.4g} steps, {:.4g} to {:.4g}) and {} ({:.4g}, {:.4g} to {:.4g}) disagree: no number is given", one,
      a.value, a.lower, a.upper, other, b.value, b.lower, b.upper);
}

}  // namespace

MeshStudy mesh_study(const BatchMap& map, std::span<const double> start, const MeshStudyOptions& options) {
  if (options.sizes != 0 && (options.sizes < 3 || options.sizes > 4))
    throw std::invalid_argument(fmt::format("mesh study: {} sizes, 3 or 4 expected", options.sizes));
  if (options.shifts < 6)
    throw std::invalid_argument(fmt::format("mesh study: {} shifts, 6 or more expected", options.shifts));
  const auto frames = noise_frames(map, start);
  const std::size_t sizes = options.sizes > 0 ? static_cast<std::size_t>(options.sizes) : map.dimension == 4 ? 4 : 3;
  const auto shifts = static_cast<std::size_t>(options.shifts);
  const double spacing = options.spacing > 0 ? options.spacing : coarsest(map.dimension);
  const int threads = std::min(thread_count(options.threads), options.shifts);

  MeshStudy study;
  study.sizes.resize(sizes);
  std::vector<std::vector<double>> steps(shifts, std::vector<double>(sizes)), rates = steps, brackets = steps;
  const auto mesh_options = [&](std::size_t size, std::size_t shift) {
    return MeshOptions{.spacing = spacing / std::pow(std::sqrt(2.0), static_cast<double>(size)),
                       .seed = options.seed,
                       .shift = static_cast<std::uint32_t>(shift),
                       .margin = options.margin > 0   ? options.margin
                                 : map.dimension == 4 ? 10.0
                                                      : 12.0,
                       .score_spacing = score_spacing(map),
                       .most_bytes = options.most_bytes / static_cast<std::size_t>(threads)};
  };
  parallel_for(sizes * shifts, threads, [&](std::size_t task) {
    const std::size_t size = sizes - 1 - task / shifts, shift = task % shifts;  // the long ones first
    const Mesh mesh(map, frames, start, mesh_options(size, shift));
    MeshPassage passage = mesh_passage(mesh, start);
    steps[shift][size] = std::log(passage.steps);
    rates[shift][size] = std::log(passage.failure_rate);
    brackets[shift][size] = 0.5 * std::log(passage.steps_upper / passage.steps_lower);
    if (shift > 0) return;
    study.sizes[size] = {mesh_options(size, 0).spacing, mesh.size(), mesh.entries(), {}};
    if (size + 1 < sizes) return;
    study.mixing_steps = passage.mixing_steps;
    study.survival = std::move(passage.survival);
    study.cheapest_failure = mesh.cheapest_failure();
  });
  for (std::size_t size = 0; size < sizes; ++size)
    for (std::size_t shift = 0; shift < shifts; ++shift) {
      study.sizes[size].steps.push_back(std::exp(steps[shift][size]));
      study.bracket = std::max(study.bracket, brackets[shift][size]);
    }
  const Extrapolated by_steps = extrapolate(steps), by_rate = extrapolate(rates);
  study.shift_error = by_steps.shift_error;
  study.discretization_error = by_steps.discretization_error;
  study.steps = around(std::exp(by_steps.log_value),
                       std::hypot(by_steps.shift_error, by_steps.discretization_error) + study.bracket);
  study.failure_rate = around(std::exp(by_rate.log_value),
                              std::hypot(by_rate.shift_error, by_rate.discretization_error) + study.bracket);

  const double value = study.steps.value;
  const auto trials = static_cast<std::size_t>(static_cast<double>(options.simulated_steps) / value);
  if (trials >= kFewestTrials) {
    const auto simulated = simulate_steps(map, start,
                                          {.trials = trials,
                                           .seed = options.seed,
                                           .threads = options.threads,
                                           .most_steps = 4 * options.simulated_steps});
    if (simulated) {
      const double half = kNormal95 * simulated->standard_error;
      study.simulated = MeshEstimate{simulated->mean, simulated->mean - half, simulated->mean + half};
      study.simulated_trials = trials;
    }
  }
  if (options.guided_samples > 0 && value > kSampledFrom) {
    // From the start to where failures keep their share: the time to forget the start, some times over.
    const int forgets = 4 + static_cast<int>(std::ceil(4 * study.mixing_steps));
    const Mesh mesh(map, frames, start, mesh_options(std::min<std::size_t>(1, sizes - 1), 0));
    const GuidedRate guided = guided_failure_rate(map, mesh, start,
                                                  {.samples = options.guided_samples,
                                                   .burn_in = std::min(3 * forgets, 60000),
                                                   .window = std::min(forgets, 200),
                                                   .seed = options.seed,
                                                   .threads = options.threads});
    if (guided.rate > 0) {
      const double beyond = value - 1 / study.failure_rate.value;  // what the start is worth
      const double half = kNormal95 * guided.standard_error / guided.rate;
      const double sampled = 1 / guided.rate + beyond;
      study.guided = MeshEstimate{sampled, sampled / (1 + half), half < 1 ? sampled / (1 - half) : sampled / 1e-3};
      study.guided_samples = options.guided_samples;
    }
  }
  if (study.simulated)
    study.disagreement = disagreement("the mesh", study.steps, "direct simulation", *study.simulated);
  if (study.disagreement.empty() && study.guided)
    study.disagreement = disagreement("the mesh", study.steps, "guided sampling", *study.guided);
  return study;
}

}  // namespace metastable::markov
