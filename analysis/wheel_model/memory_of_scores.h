#pragma once
// Says how much of a memory of contacts is one of the speeds that they leave.

#include <optional>

#include "dynamics/extended_wheel/extended_wheel.h"

namespace metastable::analysis {

/// Takes the correlation of the normal scores of successive contacts, of eta as of mu, to that of the normal scores of
/// the speeds after them. What a landing does with its contact is no straight line: of a foot that sticks eta alone
/// counts, of one that slides mu, and under `settled` three quarters are left.
struct MemoryOfScores {
  double linear = 1, square = 0, cubic = 0, rest = 0;  ///< shares of the scores' variance, 1 in all
  double operator()(double rho) const { return rho * (linear + rho * (square + rho * (cubic + rho * rho * rest))); }
};

/// Expands the score of a speed in Hermite polynomials of the contact's two scores (Mehler's formula), up to the third
/// order; the rest counts as of the fifth. In the mean over the legs; under `settled`.
/// @param omega  omega- of the landings [rad/s]
/// @param blur   the speed is the next omega-, told so exactly [rad/s]; without it omega+
MemoryOfScores memory_of_scores(const dynamics::ExtendedWheel& wheel, const dynamics::ContactSpread& contact,
                                double omega, std::optional<double> blur);

}  // namespace metastable::analysis
