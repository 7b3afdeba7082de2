#pragma once
// Sums a normal density of two numbers along a curve, with its first moments: what a likelihood asks most.

#include <cstddef>
#include <vector>

namespace metastable::analysis {

/// Holds points of a curve in (eta, mu) and what each stands for.
struct CurvePoints {
  std::vector<double> restitution, friction, weight;
  std::size_t size() const { return weight.size(); }
  void add(double eta, double mu, double of) {
    restitution.push_back(eta), friction.push_back(mu), weight.push_back(of);
  }
};

/// Holds a normal distribution: means, and one over the sds.
struct CurveNormal {
  double restitution, per_restitution_sd, friction, per_friction_sd;
};

/// Holds sums over a curve's points, with u and v their distances from the means in sds, of weight times
/// exp(-(u^2 + v^2 - nearest) / 2) times 1, u, u^2, v, v^2.
struct CurveMoments {
  double nearest = 0;  ///< 0; of a curve so far off that the sums would vanish the least u^2 + v^2 of its points
  double sum = 0, u = 0, uu = 0, v = 0, vv = 0;
};

/// @param points  one or more
CurveMoments curve_moments(const CurvePoints& points, const CurveNormal& normal);

}  // namespace metastable::analysis
