#pragma once
// Finds where a function of one variable is negative.

#include <boost/math/tools/minima.hpp>
#include <boost/math/tools/roots.hpp>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace metastable::dynamics {

struct NegativeInterval {
  double lower = 0, upper = 0;
};

namespace detail {

inline bool same_sign(double a, double b) { return (a < 0) == (b < 0); }

/// Adds the root of f between a and b to `roots`, if f changes sign between them.
template <class F>
void add_root(const F& f, double a, double fa, double b, double fb, std::vector<double>& roots) {
  if (same_sign(fa, fb)) return;
  if (fa == 0 || fb == 0) {
    roots.push_back(fa == 0 ? a : b);
    return;
  }
  std::uintmax_t iterations = 200;
  const auto [left, right] =
      boost::math::tools::toms748_solve(f, a, b, fa, fb, boost::math::tools::eps_tolerance<double>(52), iterations);
  roots.push_back(left + (right - left) / 2);
}

/// Adds the roots between a and b, of equal signs there, if f reaches zero in a dip between them.
template <class F>
void add_roots_of_dip(const F& f, double a, double fa, double b, double fb, std::vector<double>& roots) {
  const double sign = fa < 0 ? -1 : 1;
  std::uintmax_t iterations = 60;
  const auto [x, least] =
      boost::math::tools::brent_find_minima([&](double t) { return sign * f(t); }, a, b, 26, iterations);
  add_root(f, a, fa, x, sign * least, roots);
  add_root(f, x, sign * least, b, fb, roots);
}

/// Adds the roots between samples of a piece on which f is smooth, in order. @param at, value  two or more
template <class F>
void add_roots_of_piece(const F& f, std::span<const double> at, std::span<const double> value,
                        std::vector<double>& roots) {
  const std::size_t last = at.size() - 1;
  const auto closer = [&](std::size_t a, std::size_t b) {
    return same_sign(value[a], value[b]) && std::abs(value[a]) < std::abs(value[b]);
  };
  // Says whether |f| falls on leaving the sample at an edge towards its neighbour.
  const auto falls = [&](std::size_t edge, std::size_t neighbour) {
    return same_sign(value[edge], value[neighbour]) &&
           std::abs(f(at[edge] + 1e-4 * (at[neighbour] - at[edge]))) < std::abs(value[edge]);
  };
  const auto dip = [&](std::size_t a, std::size_t b) { add_roots_of_dip(f, at[a], value[a], at[b], value[b], roots); };
  // Of two equal samples only one may start the search for the dip between them.
  const bool last_dips = closer(last, last - 1) && falls(last, last - 1);
  if (!closer(1, 0) && falls(0, 1)) dip(0, 1);
  for (std::size_t i = 0; i < last; ++i) {
    add_root(f, at[i], value[i], at[i + 1], value[i + 1], roots);
    if (i + 2 <= last && closer(i + 1, i) && same_sign(value[i + 1], value[i + 2]) && !closer(i + 2, i + 1))
      dip(i, i + 2);
  }
  if (last_dips) dip(last - 1, last);
}

}  // namespace detail

/// Finds the intervals of [edges.front(), edges.back()] on which f < 0, ascending, disjoint, to double precision.
///
/// f is continuous and smooth between consecutive edges, and finite; it need not be monotone. Each piece is scanned at
/// `samples` (2 or more) equal steps; where the samples show a dip towards zero, beside an edge too, it is followed to
/// its bottom, so that a pair of roots between two samples is found. Finer structure than a step is missed. Cost:
/// samples + 2 calls a piece, about ten a root, about 30 a dip.
template <class F>
std::vector<NegativeInterval> negative_set(const F& f, std::span<const double> edges, int samples) {
  const auto count = static_cast<std::size_t>(samples);
  std::vector<double> at(count + 1), value(count + 1), roots;
  bool inside = false;  // where the set begins
  for (std::size_t e = 1; e < edges.size(); ++e) {
    for (std::size_t i = 0; i <= count; ++i) {
      at[i] = i == count ? edges[e] : edges[e - 1] + (edges[e] - edges[e - 1]) * static_cast<double>(i) / samples;
      value[i] = i == 0 && e > 1 ? value[count] : f(at[i]);
    }
    if (e == 1) inside = value[0] < 0;
    detail::add_roots_of_piece(f, at, value, roots);
  }
  std::vector<NegativeInterval> found;
  double start = edges.front();
  for (double root : roots) {
    if (inside) found.push_back({start, root});
    inside = !inside;
    start = root;
  }
  if (inside) found.push_back({start, edges.back()});
  return found;
}

}  // namespace metastable::dynamics
