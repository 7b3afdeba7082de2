#include "analysis/description/curve_moments.h"

#include <algorithm>
#include <array>
#include <limits>

#include "dynamics/return_map/vector_math.h"

namespace metastable::analysis {
namespace {

constexpr std::size_t lanes = 8;   // points worked on together; sums are taken lane by lane on every machine
constexpr double farthest = 1400;  // of u^2 + v^2 beyond the nearest: exp(-700) is as good as nothing
constexpr double least_sum =
    1e-200;  // below it, the curve passes far from the mean: distances are taken from the nearest
using Lanes = std::array<double, lanes>;

struct Sums {
  Lanes sum{}, u{}, uu{}, v{}, vv{};
};

double total(const Lanes& of) {
  double sum = 0;
  for (const double one : of) sum += one;
  return sum;
}

METASTABLE_WIDE
void find_nearest(const double* eta, const double* mu, std::size_t count, const CurveNormal& n, Lanes& least) {
  for (std::size_t i = 0; i < count; i += lanes)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double u = (eta[i + l] - n.restitution) * n.per_restitution_sd;
      const double v = (mu[i + l] - n.friction) * n.per_friction_sd, square = u * u + v * v;
      least[l] = square < least[l] ? square : least[l];
    }
}

METASTABLE_WIDE
void add_all(const double* eta, const double* mu, const double* weight, std::size_t count, const CurveNormal& n,
             double nearest, Sums& sums) {
  Sums s = sums;
  for (std::size_t i = 0; i < count; i += lanes)
    for (std::size_t l = 0; l < lanes; ++l) {
      const double u = (eta[i + l] - n.restitution) * n.per_restitution_sd;
      const double v = (mu[i + l] - n.friction) * n.per_friction_sd, beyond = u * u + v * v - nearest;
      const double share = weight[i + l] * dynamics::vector_exp(-0.5 * (beyond < farthest ? beyond : farthest));
      s.sum[l] += share;
      s.u[l] += share * u, s.uu[l] += share * u * u;
      s.v[l] += share * v, s.vv[l] += share * v * v;
    }
  sums = s;
}

}  // namespace

CurveMoments curve_moments(const CurvePoints& points, const CurveNormal& normal) {
  const double *eta = points.restitution.data(), *mu = points.friction.data();
  const std::size_t whole = points.size() / lanes * lanes;
  // The last lanes are filled with the last point, which then stands for nothing.
  Lanes last_eta, last_mu, last_weight{};
  for (std::size_t l = 0; l < lanes; ++l) {
    const std::size_t i = std::min(whole + l, points.size() - 1);
    last_eta[l] = eta[i], last_mu[l] = mu[i];
    if (whole + l < points.size()) last_weight[l] = points.weight[i];
  }
  const auto sums_from = [&](double nearest) {
    Sums sums;
    add_all(eta, mu, points.weight.data(), whole, normal, nearest, sums);
    add_all(last_eta.data(), last_mu.data(), last_weight.data(), lanes, normal, nearest, sums);
    return CurveMoments{nearest, total(sums.sum), total(sums.u), total(sums.uu), total(sums.v), total(sums.vv)};
  };
  const CurveMoments usual = sums_from(0);
  if (usual.sum > least_sum) return usual;
  Lanes least;
  least.fill(std::numeric_limits<double>::infinity());
  find_nearest(eta, mu, whole, normal, least);
  find_nearest(last_eta.data(), last_mu.data(), lanes, normal, least);
  return sums_from(*std::min_element(least.begin(), least.end()));
}

}  // namespace metastable::analysis
