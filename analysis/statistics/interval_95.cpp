#include "analysis/statistics/interval_95.h"

#include <fmt/format.h>

#include <boost/math/distributions/beta.hpp>
#include <stdexcept>

namespace metastable::analysis {

Estimate exact_share(std::size_t count, std::size_t of) {
  if (of == 0 || count > of) throw std::invalid_argument(fmt::format("share: {} of {} is no share", count, of));
  using boost::math::beta_distribution;
  const auto k = static_cast<double>(count), n = static_cast<double>(of);
  return {k / n, count == 0 ? 0 : boost::math::quantile(beta_distribution<>(k, n - k + 1), 0.025),
          count == of ? 1 : boost::math::quantile(beta_distribution<>(k + 1, n - k), 0.975)};
}

}  // namespace metastable::analysis
