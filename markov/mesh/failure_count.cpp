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
  return scale * hazard;
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
