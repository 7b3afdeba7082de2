#include "analysis/statistics/two_sample_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/beta.hpp>
#include <boost/math/distributions/non_central_t.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "analysis/statistics/interval_95.h"

namespace metastable::analysis {
namespace {

struct Moments {
  double count = 0, mean = 0, variance = 0;
};

Moments moments(std::span<const double> values) {
  if (values.size() < 2)
    throw std::invalid_argument(fmt::format("two-sample test: a sample of {} where 2 are needed", values.size()));
  Moments m{static_cast<double>(values.size()), 0, 0};
  for (const double x : values) m.mean += x;
  m.mean /= m.count;
  for (const double x : values) m.variance += (x - m.mean) * (x - m.mean) / (m.count - 1);
  return m;
}

TTest t_test(double difference, double standard_error, double degrees_of_freedom) {
  TTest test{{difference, difference, difference}, 0, degrees_of_freedom, 1};
  if (standard_error == 0) {
    if (difference != 0) test.t = std::copysign(std::numeric_limits<double>::infinity(), difference), test.p = 0;
    return test;
  }
  const boost::math::students_t law(degrees_of_freedom);
  test.t = difference / standard_error;
  test.p = 2 * boost::math::cdf(boost::math::complement(law, std::abs(test.t)));
  const double half = boost::math::quantile(law, 0.975) * standard_error;
  test.difference = {difference, difference - half, difference + half};
  return test;
}

struct Pooled {
  double difference, sd, degrees_of_freedom, scale;  // scale = sqrt(1/n + 1/m)
};

Pooled pooled(std::span<const double> a, std::span<const double> b) {
  const Moments ma = moments(a), mb = moments(b);
  const double df = ma.count + mb.count - 2;
  return {ma.mean - mb.mean, std::sqrt(((ma.count - 1) * ma.variance + (mb.count - 1) * mb.variance) / df), df,
          std::sqrt(1 / ma.count + 1 / mb.count)};
}

// Finds the noncentrality whose t distribution has `t` at that probability.
double noncentrality(double t, double df, double probability) {
  const auto excess = [&](double delta) {
    return boost::math::cdf(boost::math::non_central_t(df, delta), t) - probability;
  };
  const double reach = 4 + std::abs(t) * 5 / std::sqrt(std::min(df, 50.0));
  double low = t - reach, high = t + reach;  // falls with delta
  for (int i = 0; i < 60 && high - low > 1e-9 * (1 + std::abs(t)); ++i) {
    const double middle = (low + high) / 2;
    (excess(middle) > 0 ? low : high) = middle;
  }
  return (low + high) / 2;
}

std::vector<double> sorted(std::span<const double> values) {
  std::vector<double> copy(values.begin(), values.end());
  std::sort(copy.begin(), copy.end());
  return copy;
}

// Returns the sd of A^2 under the null hypothesis (Scholz and Stephens 1987, (4), k = 2).
double anderson_darling_sd(double n, double m) {
  const double k = 2, total = n + m, shares = 1 / n + 1 / m;
  double h = 0, g = 0, inner = 0;
  const auto count = static_cast<int>(total);
  for (int i = 1; i < count; ++i) h += 1.0 / i;
  for (int i = count - 2; i >= 1; --i) {  // inner = sum of 1/j over i < j < N
    inner += 1.0 / (i + 1);
    g += inner / (total - i);
  }
  const double a = (4 * g - 6) * (k - 1) + (10 - 6 * g) * shares;
  const double b = (2 * g - 4) * k * k + 8 * h * k + (2 * g - 14 * h - 4) * shares - 8 * h + 4 * g - 6;
  const double c = (6 * h + 2 * g - 2) * k * k + (4 * h - 4 * g + 6) * k + (2 * h - 6) * shares + 4 * h;
  const double d = (2 * h + 6) * k * k - 4 * h * k;
  return std::sqrt((((a * total + b) * total + c) * total + d) / ((total - 1) * (total - 2) * (total - 3)));
}

}  // namespace

TTest welch_t_test(std::span<const double> a, std::span<const double> b) {
  const Moments ma = moments(a), mb = moments(b);
  const double va = ma.variance / ma.count, vb = mb.variance / mb.count;
  const double df = va + vb > 0 ? (va + vb) * (va + vb) / (va * va / (ma.count - 1) + vb * vb / (mb.count - 1))
                                : ma.count + mb.count - 2;
  return t_test(ma.mean - mb.mean, std::sqrt(va + vb), df);
}

TTest pooled_t_test(std::span<const double> a, std::span<const double> b) {
  const Pooled p = pooled(a, b);
  return t_test(p.difference, p.sd * p.scale, p.degrees_of_freedom);
}

EffectSize hedges_g(std::span<const double> a, std::span<const double> b) {
  const Pooled p = pooled(a, b);
  if (p.sd == 0) {
    const double g = p.difference == 0 ? 0 : std::copysign(std::numeric_limits<double>::infinity(), p.difference);
    return {g, g, g};
  }
  const double unbiased = 1 - 3 / (4 * p.degrees_of_freedom - 1);
  const double t = p.difference / p.sd / p.scale;
  return {unbiased * p.difference / p.sd, unbiased * p.scale * noncentrality(t, p.degrees_of_freedom, 0.975),
          unbiased * p.scale * noncentrality(t, p.degrees_of_freedom, 0.025)};
}

EffectSize superiority(std::span<const double> a, std::span<const double> b) {
  moments(a), moments(b);  // sizes
  const auto n = static_cast<double>(a.size()), m = static_cast<double>(b.size());
  std::vector<double> of_a(a.size(), 0), of_b(b.size(), 0);  // shares of the other sample each value beats
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double win = a[i] > b[j] ? 1 : a[i] == b[j] ? 0.5 : 0;
      of_a[i] += win;
      of_b[j] += win;
    }
  // The counts are whole, so that samples apart from each other are told as such.
  const double value = std::accumulate(of_a.begin(), of_a.end(), 0.0) / (n * m);
  for (double& wins : of_a) wins /= m;
  for (double& wins : of_b) wins /= n;
  const Moments ma = moments(of_a), mb = moments(of_b);
  const double se = std::sqrt(ma.variance / n + mb.variance / m);
  if (value <= 0 || value >= 1) {
    const double bound = std::pow(0.025, 1 / std::min(n, m));
    return value >= 1 ? EffectSize{1, bound, 1} : EffectSize{0, 0, 1 - bound};
  }
  const double logit = std::log(value / (1 - value)), half = normal_95 * se / (value * (1 - value));
  const auto back = [](double l) { return 1 / (1 + std::exp(-l)); };
  return {value, back(logit - half), back(logit + half)};
}

DistributionTest kolmogorov_smirnov_test(std::span<const double> a, std::span<const double> b) {
  moments(a), moments(b);  // sizes
  const std::vector<double> x = sorted(a), y = sorted(b);
  const auto n = static_cast<std::int64_t>(x.size()), m = static_cast<std::int64_t>(y.size());
  // This is n m D, a whole number.
  std::int64_t most = 0;
  for (std::size_t i = 0, j = 0; i < x.size() || j < y.size();) {
    const double at = j == y.size() || (i < x.size() && x[i] <= y[j]) ? x[i] : y[j];
    while (i < x.size() && x[i] == at) ++i;
    while (j < y.size() && y[j] == at) ++j;
    most = std::max(most, std::abs(static_cast<std::int64_t>(i) * m - static_cast<std::int64_t>(j) * n));
  }
  DistributionTest test;
  test.statistic = static_cast<double>(most) / (static_cast<double>(n) * static_cast<double>(m));
  if (n * m > 4000000) {
    const double size = std::sqrt(static_cast<double>(n) * static_cast<double>(m) / static_cast<double>(n + m));
    const double z = test.statistic * size;
    double p = 0;
    if (z < 0.3) {
      p = 1;
    } else {
      for (int k = 1; k <= 20; ++k) p += 2 * (k % 2 == 1 ? 1 : -1) * std::exp(-2.0 * k * k * z * z);
    }
    test.p = std::clamp(p, 0.0, 1.0);
    return test;
  }
  // outside[j] is the probability that a random merging of the samples, now at (i, j), has come to the distance D.
  std::vector<double> outside(static_cast<std::size_t>(m) + 1, 0);
  for (std::int64_t i = 0; i <= n; ++i)
    for (std::int64_t j = 0; j <= m; ++j) {
      double& here = outside[static_cast<std::size_t>(j)];
      if (std::abs(i * m - j * n) >= most && most > 0) {
        here = 1;
        continue;
      }
      if (i + j == 0) continue;
      const double steps = static_cast<double>(i + j);
      const double left = j > 0 ? outside[static_cast<std::size_t>(j) - 1] * static_cast<double>(j) / steps : 0;
      here = (i > 0 ? here * static_cast<double>(i) / steps : 0) + left;
    }
  test.p = most > 0 ? outside.back() : 1;
  return test;
}

EffectSize kolmogorov_smirnov_distance(std::span<const double> a, std::span<const double> b) {
  const double d = kolmogorov_smirnov_test(a, b).statistic;
  double reach = 0;  // 97.5 % for each sample
  for (const auto size : {a.size(), b.size()})
    reach += std::sqrt(std::log(2 / 0.025) / (2 * static_cast<double>(size)));
  return {d, std::max(0.0, d - reach), std::min(1.0, d + reach)};
}

double anderson_darling_tail(double z) {
  if (z <= 0) return 1;
  if (z > 8) return std::sqrt(3.0) * std::erfc(std::sqrt(z));
  if (z < 2)
    return 1 - std::exp(-1.2337141 / z) / std::sqrt(z) *
                   (2.00012 + (0.247105 - (0.0649821 - (0.0347962 - (0.011672 - 0.00168691 * z) * z) * z) * z) * z);
  return -std::expm1(
      -std::exp(1.0776 - (2.30695 - (0.43424 - (0.082433 - (0.008056 - 0.0003146 * z) * z) * z) * z) * z));
}

DistributionTest anderson_darling_test(std::span<const double> a, std::span<const double> b) {
  const double n = moments(a).count, m = moments(b).count, total = n + m;
  const std::vector<double> x = sorted(a), y = sorted(b);
  double sum = 0, below = 0, below_x = 0;
  for (std::size_t i = 0, j = 0; i < x.size() || j < y.size();) {
    const double at = j == y.size() || (i < x.size() && x[i] <= y[j]) ? x[i] : y[j];
    const std::size_t i0 = i, j0 = j;
    while (i < x.size() && x[i] == at) ++i;
    while (j < y.size() && y[j] == at) ++j;
    const auto of_x = static_cast<double>(i - i0), both = of_x + static_cast<double>(j - j0);
    below += both;
    below_x += of_x;
    const double distance = total * below_x - n * below;  // the other sample's is its negative
    if (below < total) sum += both / total * distance * distance / (below * (total - below)) * (1 / n + 1 / m);
  }
  DistributionTest test;
  test.statistic = sum;
  const double limit_sd = std::sqrt(2 * (std::numbers::pi * std::numbers::pi / 3 - 3));
  test.p = anderson_darling_tail(1 + (test.statistic - 1) / anderson_darling_sd(n, m) * limit_sd);
  return test;
}

}  // namespace metastable::analysis
