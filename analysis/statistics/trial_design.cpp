#include "analysis/statistics/trial_design.h"

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <stdexcept>

#include "analysis/statistics/random.h"

namespace metastable::analysis {
namespace {

constexpr double wanted_power = 0.8, two_sided = 0.975;
constexpr double most_drawn = 500;  // trials: beyond, the drawn power and the normal one differ by less than its error
constexpr double most_pairs = 20000, most_draws = 2e6;
constexpr std::uint64_t design_seed = 1, of_designs = 64;  // of the draws, apart from those of DrawStream

struct MeanVariance {
  double mean = 0, variance = 0;
};

MeanVariance moments_of(const std::vector<double>& probability) {
  MeanVariance of;
  for (std::size_t i = 0; i < probability.size(); ++i) of.mean += probability[i] * static_cast<double>(i);
  for (std::size_t i = 0; i < probability.size(); ++i)
    of.variance += probability[i] * std::pow(static_cast<double>(i) - of.mean, 2);
  return of;
}

// Holds Student's quantile over one over the degrees of freedom, from which it is read by straight lines.
class CriticalT {
 public:
  CriticalT() {
    for (std::size_t i = 0; i <= steps; ++i)
      value_.push_back(i == 0
                           ? boost::math::quantile(boost::math::normal(), two_sided)
                           : boost::math::quantile(boost::math::students_t(steps / static_cast<double>(i)), two_sided));
  }
  double operator()(double degrees) const {
    const double place = std::min(1.0, 1 / degrees) * steps;
    const auto i = std::min(static_cast<std::size_t>(place), steps - 1);
    return value_[i] + (place - static_cast<double>(i)) * (value_[i + 1] - value_[i]);
  }

 private:
  static constexpr std::size_t steps = 512;  // to 2e-5
  std::vector<double> value_;
};

// Adds up one sample, value by value.
struct Sample {
  double sum = 0, square = 0;
  void add(double value) { sum += value, square += value * value; }
  double mean(double n) const { return sum / n; }
  double error(double n) const { return std::max(0.0, square - sum * sum / n) / (n - 1) / n; }
};

// Returns the power with n = 0 .. most trials (none below 2).
std::vector<double> drawn_power(const std::vector<double>& a, const std::vector<double>& b, std::size_t most) {
  const auto summed = [](const std::vector<double>& probability) {
    std::vector<double> below;
    double sum = 0;
    for (const double p : probability) below.push_back(sum += p);
    return below;
  };
  const auto value_at = [](const std::vector<double>& below, double uniform) {
    const auto at = std::upper_bound(below.begin(), below.end(), uniform * below.back()) - below.begin();
    return static_cast<double>(std::min<std::ptrdiff_t>(at, std::ssize(below) - 1));
  };
  const std::vector<double> below_a = summed(a), below_b = summed(b);
  static const CriticalT critical;
  const auto pairs = static_cast<std::uint64_t>(std::min(most_pairs, most_draws / static_cast<double>(most)));
  std::vector<double> power(most + 1);
  for (std::uint64_t pair = 0; pair < pairs; ++pair) {
    Sample of_a, of_b;
    for (std::size_t n = 1; n <= most; ++n) {
      of_a.add(value_at(below_a, uniform_at(design_seed, pair, 2 * n, of_designs)));
      of_b.add(value_at(below_b, uniform_at(design_seed, pair, 2 * n + 1, of_designs)));
      if (n < 2) continue;
      const auto count = static_cast<double>(n);
      const double va = of_a.error(count), vb = of_b.error(count);
      const double apart = std::abs(of_a.mean(count) - of_b.mean(count));
      const double degrees = va + vb > 0 ? (va + vb) * (va + vb) * (count - 1) / (va * va + vb * vb) : 2 * count - 2;
      if (apart > 0 && apart >= critical(degrees) * std::sqrt(va + vb)) power[n] += 1;
    }
  }
  for (double& one : power) one /= static_cast<double>(pairs);
  return power;
}

}  // namespace

std::optional<TrialDesign> trials_for_power(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) throw std::invalid_argument("trials: a distribution without a value");
  const MeanVariance of_a = moments_of(a), of_b = moments_of(b);
  const double apart = of_a.mean - of_b.mean;
  if (std::abs(apart) < 1e-12 * std::max(of_a.mean, of_b.mean)) return std::nullopt;
  const boost::math::normal z;
  const double reach = boost::math::quantile(z, two_sided) + boost::math::quantile(z, wanted_power);
  const double normal = std::ceil(reach * reach * (of_a.variance + of_b.variance) / (apart * apart));
  if (normal > most_drawn) return TrialDesign{normal, wanted_power};
  for (auto most = static_cast<std::size_t>(1.5 * normal) + 12;; most *= 2) {
    const std::vector<double> power = drawn_power(a, b, most);
    // From here on: the power of small samples of few values goes up and down.
    std::size_t fewest = most;
    while (fewest > 2 && power[fewest - 1] >= wanted_power) --fewest;
    if (power[fewest] >= wanted_power) return TrialDesign{static_cast<double>(fewest), power[fewest]};
  }
}

}  // namespace metastable::analysis
