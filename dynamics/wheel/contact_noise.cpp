#include "dynamics/wheel/contact_noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace metastable::dynamics {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

TruncatedNormal named(const char* quantity, double mean, double sd, double lower, double upper) {
  try {
    return {mean, sd, lower, upper};
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: {}", quantity, error.what()));
  }
}

}  // namespace

ContactNoise::ContactNoise(TruncatedNormal restitution, TruncatedNormal friction, double correlation,
                           std::vector<Contact> pairs)
    : restitution_(restitution), friction_(friction), correlation_(correlation), pairs_(std::move(pairs)) {}

ContactNoise ContactNoise::normal(double restitution_mean, double restitution_sd, double friction_mean,
                                  double friction_sd, double correlation, double most_restitution) {
  if (!(correlation > -1 && correlation < 1))
    throw std::invalid_argument(fmt::format("correlation: {} is outside (-1, 1)", correlation));
  return {named("restitution", restitution_mean, restitution_sd, 0, most_restitution),
          named("friction", friction_mean, friction_sd, 0, infinity),
          correlation,
          {}};
}

ContactNoise ContactNoise::empirical(std::vector<Contact> pairs) {
  if (pairs.empty()) throw std::invalid_argument("pairs: the list of contacts is empty");
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!(pairs[i].restitution >= 0 && pairs[i].restitution <= 1))
      throw std::invalid_argument(fmt::format("pairs[{}]: restitution {} is outside [0, 1]", i, pairs[i].restitution));
    if (!(pairs[i].friction >= 0 && std::isfinite(pairs[i].friction)))
      throw std::invalid_argument(fmt::format("pairs[{}]: friction {} is outside [0, inf)", i, pairs[i].friction));
  }
  return {TruncatedNormal(0, 0), TruncatedNormal(0, 0), 0, std::move(pairs)};
}

int ContactNoise::dimension() const { return is_empirical() ? 1 : 2; }

Contact ContactNoise::draw(std::span<const double> score) const {
  if (is_empirical()) {
    // The smaller tail decides, counted from its own end of the list.
    const auto count = pairs_.size();
    const double tail = normal_cdf(-std::abs(score[0])) * static_cast<double>(count);
    const auto index = std::min(static_cast<std::size_t>(tail), count - 1);
    return pairs_[score[0] < 0 ? index : count - 1 - index];
  }
  const double friction_score =
      correlation_ == 0 ? score[1]
                        : correlation_ * score[0] + std::sqrt((1 - correlation_) * (1 + correlation_)) * score[1];
  return {restitution_.at_score(score[0]), friction_.at_score(friction_score)};
}

ContactNoise::Support ContactNoise::support() const {
  if (is_empirical()) {
    Support s{infinity, -infinity, infinity, -infinity};
    for (const Contact& c : pairs_) {
      s.restitution_lower = std::min(s.restitution_lower, c.restitution);
      s.restitution_upper = std::max(s.restitution_upper, c.restitution);
      s.friction_lower = std::min(s.friction_lower, c.friction);
      s.friction_upper = std::max(s.friction_upper, c.friction);
    }
    return s;
  }
  const auto lower = [](const TruncatedNormal& n) { return n.constant() ? n.mean() : n.lower(); };
  const auto upper = [](const TruncatedNormal& n) { return n.constant() ? n.mean() : n.upper(); };
  return {lower(restitution_), upper(restitution_), lower(friction_), upper(friction_)};
}

}  // namespace metastable::dynamics
