#pragma once
// Proves bounds on where one collision lands a wheel: on the distribution function and its second derivatives.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>

#include "dynamics/bounds/interval.h"
#include "dynamics/bounds/published_level.h"
#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Says how finely the noise is cut. Bounds hold at any resolution; finer ones are closer.
struct BoundsResolution {
  double restitution_step = 1.0 / 12;  ///< panel of eta [sd], > 0
  double level_step = 1.0 / 16;        ///< of the table along t [sd of the landing over the state], > 0
  int speed_cells = 12;                ///< of the table along 1/omega, > 0
};

/// Bounds C(x, e) = P(rest, or landing below e) from the state x = omega^2 [rad^2/s^2] at one phase, `published`
/// law, independent truncated normal eta (or a constant) and mu.
///
/// omega+^2 / x = G(mu, eta, q) = s(mu, eta) - q d(mu, eta), q = 1/omega, so that C is a function of
/// t = (e - gain)/x and q alone: the probability of G < t. Proof of the bounds, all in outward-rounded intervals:
///   1. s and d are sums of products of a function of eta and one of mu. Beyond mu_c = x y/(r^2 + y^2) each makes G
///   fall
///      with mu; below mu_c the fall is verified strip by strip, and the strips where it cannot be are kept apart:
///      their mass counts as below t, above t, or open.
///   2. On a panel of eta around c, G = t has one root mu*(eta), enclosed by the interval Newton method. With
///      H = P(mu > mu*), the panel's share is w H(c) + M1 H'(c) + M2 H''(panel)/2, with w, M1, M2 the mass of the panel
///      and its moments about c, and derivatives from implicit differentiation; never more than w times the range of H.
///   3. On a cell of (t, q) the same gives ranges of the first and second derivatives of C; panels where mu* leaves the
///      verified strips have none and add their oscillation instead. Between the corners of a cell C is its bilinear
///      interpolation up to h^2/8 times the second derivatives, and that.
///   4. d landing/d omega^2 = s - q d/2 is >= 0 wherever the wheel survives: where d >= 0 because s - q d >= 0, and d <
///   0 needs
///      mu < mu_c, where s is verified to be >= 0. So C falls with x.
/// Constants taken from the map (lengths, inertias, barrier, gain) are widened by 2^-46 of their values.
class LandingBounds {
 public:
  using ForEach = std::function<void(std::size_t, const std::function<void(std::size_t)>&)>;

  /// @param lowest, highest  states [rad^2/s^2] the bounds are asked for, 0 < lowest < highest
  /// @param for_each  runs work(i) for i in [0, count), in any order or at once
  /// @throws NoBounds with the reason: another law, a list of contacts, correlated or constant friction, a map that
  ///         cannot be shown to rise with the state
  /// Cost: about 1 us per panel of eta and cell of the table, 1 to 3 s for a wheel with equal legs.
  LandingBounds(const WheelMap& map, int phase, double lowest, double highest, const BoundsResolution& resolution,
                const ForEach& for_each);
  ~LandingBounds();
  LandingBounds(LandingBounds&&) noexcept;
  LandingBounds& operator=(LandingBounds&&) noexcept;

  /// Bounds C at one point. Edges below the lowest state of a survivor count as that state. O(1).
  /// @throws std::out_of_range for states outside [lowest, highest]; so does curvature()
  Interval below(double state, double edge) const;

  /// Bounds the second derivatives of C over a rectangle.
  struct Curvature {
    Interval state, edge;  ///< d^2 C/dx^2, d^2 C/de^2 where they exist
    /// Say what else C may deviate from its chord across the rectangle, along x and along e.
    double loose_state = 0, loose_edge = 0;
  };
  /// Returns nothing where C is within 1e-22 of 0 or 1e-11 of 1 (outside the table).
  std::optional<Curvature> curvature(const Interval& state, const Interval& edge) const;

  /// Bounds E max(0, landing - edge) from a state from above.
  double overshoot(double state, double edge) const;
  /// Bounds d/dx E max(0, landing(x) - edge) for all states above `state` from above.
  double growth(double state) const;

 private:
  class Table;
  std::unique_ptr<const Table> table_;
};

}  // namespace metastable::dynamics
