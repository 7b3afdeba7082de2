#pragma once
// This is the field's benchmark: a plastic, point-mass wheel on rough terrain (Byl & Tedrake 2009).

#include <optional>
#include <span>
#include <utility>

namespace metastable::dynamics {

/// Each step meets its own slope gamma_k ~ N(mean, sd^2), independent. The state x is omega^2 at the apex [rad^2/s^2];
///   x' = cos^2(2a) [x + G (1 - cos(a + gamma))] - G (1 - cos(a - gamma)),  G = 2 g / l,  rest if x' <= 0.
/// It has one phase and one noise score, and satisfies markov::ReturnMap.
class RoughTerrainWheel {
 public:
  struct Options {
    double mean_slope = 0;                        ///< [rad]
    double sd_slope = 0;                          ///< [rad], >= 0
    double half_leg_angle = 0.39269908169872414;  ///< a [rad], pi/8: eight legs
    double gravity = 9.8;                         ///< g [m/s^2]
    double leg_length = 1.0;                      ///< l [m]
  };
  /// @throws std::invalid_argument naming the quantity and its range
  explicit RoughTerrainWheel(Options options);

  const Options& options() const { return options_; }
  /// Returns the next state for a given slope [rad]; it may be <= 0 (rest).
  double next(double state, double slope) const;
  /// Returns the noise-free fixed point [rad^2/s^2]. @throws std::domain_error if it does not exist (it would rest).
  double fixed_point() const;

  std::pair<double, double> state_interval(int phase) const;  ///< {0, highest landing possible}
  int phases() const { return 1; }
  int noise_dimension() const { return 1; }
  std::optional<double> landing(double state, int phase, std::span<const double> score) const;
  /// Takes the error function at the slope where x' = 0: relative accuracy is full.
  std::optional<double> rest_probability(double state, int phase) const;
  /// Gives the density of x' at each next state, from the (at most two) slopes that lead there; returns the probability
  /// of rest. @throws std::invalid_argument for sd_slope = 0
  double landing_density(double state, int phase, std::span<const double> next, std::span<double> density) const;
  std::pair<double, double> landing_range(double state, int phase) const;

 private:
  Options options_;
};

}  // namespace metastable::dynamics
