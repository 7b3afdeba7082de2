#include "markov/mesh/failure_count.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <limits>

namespace metastable::markov {
namespace {

using Binomial = boost::math::binomial_distribution<double>;

}  // namespace

double ForetoldHazard::at(std::uint64_t steps) const {
  if (steps == 0) return 0;
  const std::size_t known = survival.size();
  const auto number = static_cast<double>(steps);
  double hazard = 0;
  if (steps <= known) {
    hazard = -std::log(survival[steps - 1]);
  } else {
    hazard = known > 0 ? -std::log(survival.back()) : 0;
    hazard -= (number - static_cast<double>(known)) * std::log1p(-std::min(rate, 1.0));
  }
  return hazard;
}

std::vector<MeshEstimate> extrapolated_survival(
    const std::vector<std::vector<ForetoldHazard>>& hazards, double leaving,
    const std::function<Extrapolated(const std::vector<std::vector<double>>&)>& extrapolate) {
  constexpr double rounding = 1e-12;  // A hazard below it is what is left of shares next to 1.
  std::size_t steps = hazards.front().back().survival.size();
  for (const auto& sizes : hazards)
    for (const ForetoldHazard& one : sizes) steps = std::min(steps, one.survival.size());
  std::vector<MeshEstimate> survival;
  std::vector<std::vector<double>> logs(hazards.size(), std::vector<double>(hazards.front().size()));
  for (std::size_t k = 0; k < steps; ++k) {
    double least = std::numeric_limits<double>::infinity(), most = 0;
    for (std::size_t shift = 0; shift < hazards.size(); ++shift)
      for (std::size_t size = 0; size < hazards[shift].size(); ++size) {
        const double hazard = hazards[shift][size].at(k + 1);
        least = std::min(least, hazard), most = std::max(most, hazard);
        logs[shift][size] = std::log(hazard);
      }
    MeshEstimate hazard{hazards.front().back().at(k + 1), least, most};
    if (least > rounding && std::isfinite(most)) hazard = estimate_of(extrapolate(logs));
    survival.push_back({std::exp(-hazard.value), std::exp(-hazard.upper * std::exp(leaving)), std::exp(-hazard.lower)});
  }
  // Shares fall: what bounds a later one from below bounds an earlier one, and the other way round from above.
  for (std::size_t k = 1; k < steps; ++k) {
    survival[k].value = std::min(survival[k].value, survival[k - 1].value);
    survival[k].upper = std::min(survival[k].upper, survival[k - 1].upper);
  }
  for (std::size_t k = steps; k-- > 0;) {
    if (k + 1 < steps) survival[k].lower = std::max(survival[k].lower, survival[k + 1].lower);
    survival[k].lower = std::min(survival[k].lower, survival[k].value);
    survival[k].upper = std::max(survival[k].upper, survival[k].value);
  }
  return survival;
}

MeshEstimate extrapolated_rate(
    const std::vector<std::vector<ForetoldHazard>>& hazards, double leaving,
    const std::function<Extrapolated(const std::vector<std::vector<double>>&)>& extrapolate) {
  std::vector<std::vector<double>> logs;
  for (const auto& sizes : hazards) {
    logs.emplace_back();
    for (const ForetoldHazard& one : sizes) logs.back().push_back(std::log(one.rate));
  }
  MeshEstimate rate = estimate_of(extrapolate(logs));
  rate.upper *= std::exp(leaving);
  return rate;
}

MeshEstimate survival_after(std::span<const MeshEstimate> survival, const MeshEstimate& rate, std::uint64_t steps,
                            std::size_t phases) {
  const std::size_t all = survival.size();
  const std::uint64_t revolutions = steps > all ? (steps - all + phases - 1) / phases : 0;
  const std::uint64_t known = steps - std::min(steps, revolutions * phases);
  const MeshEstimate head = known > 0 ? survival[known - 1] : MeshEstimate{1, 1, 1};
  if (known == steps) return head;
  const auto beyond = static_cast<double>(steps - known);
  const auto on = [beyond](double share, double failing) {
    return share * std::exp(beyond * std::log1p(-std::min(failing, 1.0)));
  };
  return {on(head.value, rate.value), on(head.lower, rate.upper), on(head.upper, rate.lower)};
}

bool FailureCount::refutes(const ForetoldHazard& hazard) const {
  const double h = hazard.at(longest);
  const auto n = static_cast<double>(walks), k = static_cast<double>(failed);
  const double least = -std::expm1(-h * std::exp(-hazard.more)), most = -std::expm1(-h * std::exp(hazard.fewer));
  const bool too_many = failed > 0 && cdf(complement(Binomial(n, most), k - 1)) < refutation_level / 2;
  const bool too_few = failed < walks && cdf(Binomial(n, least), k) < refutation_level / 2;
  return too_many || too_few;
}

FailureCount count_failures(const std::vector<std::uint64_t>& walks, std::uint64_t longest,
                            const ForetoldHazard& hazard) {
  FailureCount count{.walks = walks.size(), .longest = longest};
  for (const std::uint64_t failed : walks) count.failed += failed > 0;
  count.foretold = -std::expm1(-hazard.at(longest)) * static_cast<double>(walks.size());
  return count;
}

std::string count_text(const FailureCount& count) {
  return fmt::format("{} of {} simulated walks failed within {} steps, where the mesh foretells {:.3g}", count.failed,
                     count.walks, count.longest, count.foretold);
}

}  // namespace metastable::markov
