#pragma once
// Gives the probability density of a wheel's next state, in closed form up to one integral.

#include <vector>

#include "dynamics/return_map/loss_curve.h"
#include "dynamics/return_map/wheel_map.h"

namespace metastable::dynamics {

/// Gives the density of the landing x' of a wheel that meets the collision at `phase` with x = omega^2 = state > 0.
///
/// Given eta, the loss rises and falls once in mu, g(mu) = a/A + b mu B/A^2 + c mu B/A with A and B linear in mu, so x'
/// is reached by at most two mu, the roots of a cubic; the density is the integral over eta of f(eta) sum f(mu) /
/// |dx'/dmu|. It is broken where a pair of roots appears (the inverse square root there is removed by substitution) and
/// where a root leaves [0, inf). `coulomb`: the foot sticks for every mu >= mu_c, and that share of the mass has x'
/// from eta alone; its density is added in closed form.
///
/// Relative accuracy is about 1e-11, tails included. The density is smooth in x' but for a few points that move with
/// the state: under `published` they are about f(eta) at 0 times f(mu) at its own least loss in size, under `coulomb`
/// they are jumps and inverse square roots in the bulk of x'.
class LandingDensity {
 public:
  /// Cost: about 30 us. @throws std::invalid_argument where the landing has no density (a list of contacts,
  /// `plastic`, constant mu, rebound_lost = 1 under `coulomb`) or none in this form (correlated eta and mu): the
  /// message names the reason and the sampled method
  LandingDensity(const WheelMap& map, double state, int phase);

  /// Evaluates it at x' = next [1/(rad^2/s^2)]; it is 0 below the lowest state of a survivor. Costs 10 to 50 us.
  double operator()(double next) const;

  /// Throws what the constructor throws.
  static void check(const WheelMap& map);

 private:
  struct Guess {  // where the last calls found them
    double extreme = 0, first = 0, second = 0;
  };
  struct Point {
    double restitution, loss;
  };
  struct Piece {
    double lower, upper;
    bool fold_below, fold_above;
  };

  double given_restitution(double restitution, double level, Guess& guess) const;
  double sticking(double level) const;
  std::vector<Piece> pieces(double level) const;
  struct Panel;
  double integrand(const Piece& piece, double t, double level, Guess& guess) const;
  std::vector<Panel> panels(const std::vector<Piece>& pieces, double level, Guess& guess) const;
  void evaluate(Panel& panel, double level, Guess& guess) const;
  double integrate(const std::vector<Piece>& pieces, double level) const;

  const TruncatedNormal restitution_, friction_;
  const LossCurve curve_;
  double lower_ = 0, upper_ = 1;  // eta
  std::vector<Point> extremes_;   // over eta, its own extremes included
};

}  // namespace metastable::dynamics
